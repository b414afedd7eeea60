"""Co-simulation of grid-forming converters: ``import orchestrator as gfor``.

A name is imported where it is first used, so that ``import orchestrator`` takes no time; ``__init__.pyi`` says the
same to type checkers.

Examples
--------
>>> import orchestrator as gfor
>>> scenario = gfor.load("two_area").scenario("pod_p", {"grid.X_L": 0.3})
>>> axes = scenario.modes().plot()
"""

from importlib import import_module

_HOMES = {
    "Case": "api.case", "CosimError": "errors", "LinearSystem": "api.linear", "Modes": "api.results",
    "ParameterSweep": "sweep.view", "Run": "api.results", "Scenario": "api.scenario", "Screening": "screening.view",
    "admittance": "api.admittance", "ambient": "api.identification", "bind": "api.binding", "build": "api.models",
    "built_in_cases": "api.case",
    "certify": "api.certification", "check": "api.acceptance", "compare": "api.comparison", "export": "api.export",
    "export_comtrade": "api.comtrade", "identify": "api.identification", "info": "api.fmu", "load": "api.case",
    "nyquist": "api.nyquist", "open": "api.saved", "open_fmu": "api.fmu", "read_linear_model": "api.linear",
    "source": "api.source", "verify": "api.certification",
}  # fmt: skip
"""Name → module of this package that defines it."""

__all__ = [*_HOMES]  # noqa: PLE0604 - names all the same


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has: {', '.join(_HOMES)}")
    value: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
