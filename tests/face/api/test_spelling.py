"""Errors name Python's keywords to those who call functions, and options to those who type commands."""

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import pytest

import orchestrator as gfor
from orchestrator.core.errors import (
    CaseError,
    ComponentError,
    CosimError,
    EndedError,
    InputError,
    Problem,
)
from orchestrator.core.spelling import as_options, keyword, spelled
from orchestrator.face import api
from orchestrator.studies.points.failure import Failure

ROOT = Path(__file__).parents[3]
OPTION = re.compile(r"(?<![\w-])--([a-z][a-z-]*[a-z])")
OTHERS = ("certification", "interop", "cli", "agents", "report/pdf.py", "cases/new")
"""Where texts are for the command line alone: Python has no such functions."""

COMMANDS_ALONE = {
    *(
        "broker",
        "broker_port",
        "external",
        "like",
        "engine",
        "against",
        "beside",
        "contest",
        "details",
        "html",
        "models",
        "generator",
        "junit",
    ),
    *(
        "method",
        "no_csv",
        "json",
        "with_linear_model",
        "per_unit",
        "units_checked",
        "scr",
        "retune",
        "beside",
    ),
}
"""Options of errors that no function of the face has."""

FOREIGN = {"ipv", "loglevel", "port", "local", "timeout", "federates"}  # of helics_broker


def test_questions_name_keywords_too():
    with pytest.warns(UserWarning, match=r"values gfor.pod_p.K: .* cannot act"):
        gfor.load("two_area").scenario("gfor", {"gfor.pod_p.K": 30.0})


@pytest.mark.parametrize(
    ("text", "python"),
    [
        ("--set grid.X_M: there is no X_M", "values grid.X_M: there is no X_M"),
        ("--vary a.b: give --until, and --scheduler", "vary a.b: give until, and scheduler"),
        ("give --trust-fmus; see --min-damping", "give trust_fmus; see least_damping"),
        ("`gfor modes CASE --black-box` shows it", "`modes(black_box=True)` shows it"),
        ("`gfor check --only initial_outputs`", "`check(only='initial_outputs')`"),
        ("`gfor black-box CASE --component sg1`", "`gfor black-box CASE --component sg1`"),
        ("`gfor build --with-linear-model` packs", "`gfor build --with-linear-model` packs"),
        ("(`gfor new --slack bus_1`)", "(`gfor new --slack bus_1`)"),
        ("(`--step 0.01`)", "(`step 0.01`)"),
        ("leave out --engine helics", "leave out federates"),
        ("start `helics_broker -f 2 --ipv4`", "start `helics_broker -f 2 --ipv4`"),
        ("1 -- 2, a--b, ---", "1 -- 2, a--b, ---"),
    ],
)
def test_an_option_is_spelt_for_who_reads_it(text, python):
    assert spelled(text) == str(CosimError(text)) == python
    with as_options():
        assert spelled(text) == str(InputError(text)) == text


@pytest.mark.parametrize(
    "text",
    [
        "line 3: title = 'give --out': it is too long",
        'line 3: title = "see --set, it\'s odd": it is too long',
        "/data/--set/case.toml: there is no such file",
    ],
)
def test_words_of_a_users_file_stay_as_they_are(text):
    assert str(InputError(text)) == text


def test_words_of_an_fmu_stay_as_they_are_beside_an_option_of_ours():
    error = ComponentError("dev", "fmi2DoStep", "fmi2Error", "pass --step or --set to me")
    assert str(error).endswith("pass --step or --set to me")
    ended = EndedError("dev", "fmi2Discard", "stopped by --stop", 1.0, 0.9)
    assert "(it says: stopped by --stop)" in str(ended)
    problem = Problem("line 4", "it says: use --set; give --step", words_of_others="use --set")
    assert str(problem) == "line 4: it says: use --set; give step"
    assert "it says: use --set; give step" in str(CaseError("case.toml", [problem]))


def test_what_was_given_as_tables_is_named_as_it_was_given():
    kept = "cases/form/given/0123456789abcdef"
    assert spelled(f"{kept}/case.toml: no table") == "case: no table"
    assert spelled(f"{kept}/points.csv, line 1: no head") == "points: no head"
    assert spelled(f"{kept}/points.csv, line 4: hour = 'x'") == "points, row 3: hour = 'x'"


def test_what_is_kept_of_a_point_is_the_same_for_everybody():
    for error in (
        InputError("use --workers"),
        CaseError("x.toml", [Problem("--set a.b", "wrong")]),
    ):
        with as_options():
            kept = Failure.of(error)
        assert Failure.of(error) == kept
        assert "--" in kept.text


def faces():
    """Every function and method of the face that a user may call."""
    for module in iter_modules(api.__path__):
        for thing in vars(import_module(f"{api.__name__}.{module.name}")).values():
            if getattr(thing, "__module__", "").startswith(api.__name__):
                if inspect.isfunction(thing):
                    yield thing
                elif inspect.isclass(thing):
                    yield from (f for _, f in inspect.getmembers(thing, inspect.isfunction))
                    yield from inspect.get_annotations(thing)


def test_an_option_of_an_error_is_a_keyword_of_some_function():
    """All texts of the program that name an option: it has a keyword, or is known to be of commands alone."""
    keywords = {
        k for f in faces() for k in ([f] if isinstance(f, str) else inspect.signature(f).parameters)
    }
    named = {}
    for path in [*(ROOT / "orchestrator").rglob("*.py")]:
        if any(other in path.as_posix() for other in OTHERS):
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        raised = [
            node for node in ast.walk(tree) if isinstance(node, ast.Raise) and node.exc is not None
        ]
        texts = [c.value for r in raised for c in ast.walk(r.exc) if isinstance(c, ast.Constant)]
        for text in texts:
            if isinstance(text, str):
                named |= dict.fromkeys(OPTION.findall(text), path.name)
    assert len(named) > 20
    unknown = {
        o: p for o, p in named.items() if keyword(o) not in keywords | COMMANDS_ALONE | FOREIGN
    }
    assert not unknown


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area")


WRONG = {
    "scenario": lambda c, p: c.scenario("nobody"),
    "value": lambda c, p: c.scenario("pod_p", {"grid.X_M": 1}),
    "unit": lambda c, p: c.scenario("pod_p", {"grid.X_L": "1 MW"}),
    "model": lambda c, p: c.scenario("pod_p", {"models": "none"}),
    "force": lambda c, p: c.scenario("pod_p", force="sg1 nothing"),
    "step": lambda c, p: c.scenario("pod_p", step=0.0301),
    "choose": lambda c, p: c.choose("nobody"),
    "vary": lambda c, p: c.sweep(["grid.X_L"], ["pod_p"]),
    "vary unknown": lambda c, p: c.sweep(["grid.X_M=1:2:3"], ["pod_p"]),
    "until": lambda c, p: c.sweep(["grid.X_L=0.1,0.2"], ["pod_p"], until="unstable"),
    "twice": lambda c, p: c.sweep({"grid.X_L": [0.1, 0.1]}, ["pod_p"]),
    "tls": lambda c, p: c.sweep({"grid.X_L": [0.1, 0.2]}, ["pod_p"], tls=p),
    "points": lambda c, p: c.screen(p / "none.csv", scenario="pod_p"),
    "outages": lambda c, p: c.screen(outages="nobody", scenario="pod_p"),
    "mode": lambda c, p: c.design("pod_p", mode="none"),
    "stages": lambda c, p: c.design("pod_p", stages=9),
    "bounds": lambda c, p: c.design("pod_p", gain_bounds=(0, 1e9)),
    "damping": lambda c, p: c.design("pod_p", damping=5),
    "component": lambda c, p: c.design("pod_p", component="sg*"),
    "controller": lambda c, p: c.design("pod_x"),
    "place": lambda c, p: c.interactions(places=["nobody"], swap=True),
    "device": lambda c, p: c.site("nobody", scenario="pod_p"),
    "sensitivities": lambda c, p: c.scenario("pod_p").sensitivities(parameters=["gfor.none"]),
    "mode of them": lambda c, p: c.scenario("pod_p").sensitivities("none"),
    "steps": lambda c, p: c.scenario("pod_p").steps(steps=[0.0301]),
    "cut": lambda c, p: gfor.nyquist("two_area", components=["grid"], scenario="pod_p"),
    "bus": lambda c, p: gfor.nyquist("two_area", bus="nowhere", scenario="pod_p"),
    "load": lambda c, p: gfor.load("nobody"),
    "build": lambda c, p: gfor.build("nobody", p),
    "check": lambda c, p: gfor.check(p / "none.fmu"),
    "binding": lambda c, p: gfor.check(gfor.build("infinite_bus", p), only="binding"),
    "linear model": lambda c, p: gfor.read_linear_model(gfor.build("infinite_bus", p)),
}


@pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)
def test_an_error_of_the_face_has_no_word_of_the_command_line(case, tmp_path, call):
    with pytest.raises(CosimError) as caught:
        call(case, tmp_path)
    said = str(caught.value)
    # a whole command that no function stands for is to be typed at a terminal
    assert not re.search(r"(^|[ `(])--[a-z]", re.sub("`gfor [^`]*`", "", said)), said
