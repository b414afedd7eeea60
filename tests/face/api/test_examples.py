"""Every public name of the Python face has an example in its docstring, and all examples run."""

import doctest
import inspect
from importlib import import_module

import pytest

import orchestrator

MODULES = (
    *(
        f"face.api.{name}"
        for name in ("acceptance", "admittance", "binding", "case", "certification", "comparison")
    ),
    *(f"face.api.{name}" for name in ("comtrade", "export", "fmu", "identification", "linear")),
    "face.api.voltage_source",
    *(
        f"face.api.{name}"
        for name in ("models", "nyquist", "results", "saved", "scenario", "source", "validation")
    ),
    *(
        f"studies.{name}.view"
        for name in (
            "coordinated_design",
            "interactions",
            "pod_design",
            "screening",
            "sensitivities",
        )
    ),
    *("studies.siting.view", "studies.sweep.view"),
)


def examples():
    """Examples of all modules of the face, and of the package itself."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    modules = [orchestrator, *(import_module(f"orchestrator.{name}") for name in MODULES)]
    return [test for module in modules for test in finder.find(module, module.__name__)]


EXAMPLES = examples()


@pytest.mark.parametrize(
    "example", EXAMPLES, ids=lambda example: example.name.removeprefix("orchestrator.")
)
def test_an_example_runs(example, tmp_path, monkeypatch):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    said = []
    doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(example, out=said.append)
    pyplot.close("all")
    assert not said, "".join(said)


RESULTS = (
    "BusStrength",
    "Exploration",
    "Mode",
    "Stability",
    "CheckpointWarning",
    "RunEndedWarning",
    "UnusualDataWarning",
    "Nyquist",
    "RunComparison",
    "SignalModes",
    "Sources",
    "StepChoice",
    "Validation",
    "Verification",
    "VoltageSource",
)
"""Types of results, named for annotations; the functions that return them have the examples."""


@pytest.mark.parametrize("name", [name for name in orchestrator.__all__ if name != "CosimError"])
def test_every_name_has_an_example(name):
    value = getattr(orchestrator, name)
    with_example = {example.name for example in EXAMPLES}
    assert name in RESULTS or f"{value.__module__}.{value.__qualname__}" in with_example
    assert value.__doc__
    for method, function in inspect.getmembers(value, inspect.isfunction):
        if not method.startswith("_"):
            assert function.__doc__, f"{name}.{method}"
