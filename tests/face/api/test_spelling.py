"""Errors name Python's keywords to those who call functions, and options to those who type commands."""

import argparse
import ast
import inspect
import json
import pickle
import re
import tomllib
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import SimpleNamespace

import pytest

import orchestrator as gfor
from orchestrator.core.errors import (
    AnalysisError,
    CaseError,
    ComponentError,
    CosimError,
    EndedError,
    InputError,
    Problem,
)
from orchestrator.core.given_files import ShownFile
from orchestrator.core.options import Option, command
from orchestrator.core.spelling import as_options, joined, restored, spelled, stored
from orchestrator.face import api
from orchestrator.face.cli import whole_parser
from orchestrator.studies.immittance.view import Nyquist
from orchestrator.studies.points.codec import packed, unpacked
from orchestrator.studies.points.failure import Failure

ROOT = Path(__file__).parents[3]

OPTION = re.compile(r"(?<![\w/\\-])--[a-z][a-z-]*[a-z]")
# a file that has none of these need not be parsed, which takes seconds for all of them
MAY_NAME_ONE = re.compile(r"--[a-z\"'{]")
SURFACES = (
    "face/cli/",
    "face/agents/",
    "face/explore/",
)  # for those who type, who alone see their words
DECLARING = ("request_field", "FieldKind", "StudyAtOnce")  # of options, with their help
ONLY_TYPED = (
    r"`gfor (new|certify|[^`]*--(json|with-linear-model)\b)[^`]*`"  # commands that Python has not
)
FOREIGN = r"`helics_broker [^`]*`"  # commands of other programs have options of their own
BY_TEXT = tomllib.loads(
    Path(__file__).with_name("options_in_words.toml").read_text(encoding="utf-8")
)
"""Files whose texts name options in plain words, and how many texts; the numbers may only fall."""


def test_questions_name_keywords_too():
    with pytest.warns(UserWarning, match=r"values gfor.pod_p.K: .* cannot act"):
        gfor.load("two_area").scenario("gfor", {"gfor.pod_p.K": 30.0})


@pytest.mark.parametrize(
    ("text", "python"),
    [
        (Option.SET + " grid.X_M: there is no X_M", "values grid.X_M: there is no X_M"),
        (
            Option.VARY + " a.b: give " + Option.UNTIL + ", and " + Option.SCHEDULER,
            "vary a.b: give until, and scheduler",
        ),
        (
            "give " + Option.TRUST_FMUS + " or " + Option.MIN_DAMPING,
            "give trust_fmus or least_damping",
        ),
        (command("modes CASE", Option.BLACK_BOX) + " shows it", "`modes(black_box=True)` shows it"),
        (command("fmu check", (Option.ONLY, "initial_outputs")), "`check(only='initial_outputs')`"),
        (command("new", (Option.SLACK, "bus_1")), "`gfor new --slack bus_1`"),
        ("(`" + Option.STEP + " 0.01`)", "(`step 0.01`)"),
        ("leave out " + Option.ENGINE_HELICS, "leave out federates"),
        ("add " + Option.CONVERTER, "add --converter"),  # which Python has not
    ],
)
def test_an_option_is_spelt_for_who_reads_it(text, python):
    assert spelled(text) == str(CosimError(text)) == str(Problem("", text)) == python
    with as_options():
        assert spelled(text) == str(InputError(text)) == text


def test_a_command_that_python_lacks_or_takes_otherwise_stays_as_it_is_typed():
    for typed in (
        command("modes CASE", Option.BLACK_BOX, (Option.COMPONENT, "sg1")),
        command("fmu build", Option.WITH_LINEAR_MODEL),
        command("fmu check", Option.JSON),
    ):
        assert spelled(typed) == typed


@pytest.mark.parametrize(
    "text",
    [
        "line 3: title = 'give --out': it is too long",
        "/data/--set/case.toml: there is no such file",
        "1 -- 2, a--b, ---",
        "start `helics_broker -f 2 --ipv4`",
        "--set",
    ],
)
def test_words_that_are_no_option_of_ours_stay_as_they_are(text):
    assert str(InputError(text)) == text
    said = str(CaseError("case.toml", [Problem("line 4", text + "; give " + Option.STEP)]))
    assert said.endswith(f"line 4: {text}; give step")


def test_words_of_an_fmu_stay_as_they_are():
    error = ComponentError("dev", "fmi2DoStep", "fmi2Error", "pass --step or --set to me")
    assert str(error).endswith("pass --step or --set to me")
    ended = EndedError("dev", "fmi2Discard", "stopped by --stop", 1.0, 0.9)
    assert "(it says: stopped by --stop)" in str(ended)


def test_texts_keep_their_options_as_they_are_joined_copied_and_kept():
    text = "use " + Option.WORKERS + ", or " + command("modes", Option.CRITICAL)
    for same in (
        pickle.loads(pickle.dumps(text)),
        deepcopy(text),
        restored(json.loads(json.dumps(stored(text)))),
        joined("", [text]),
    ):
        assert (same, spelled(same)) == (text, "use workers, or `modes(critical=True)`")
    assert spelled(joined("; ", ["a", Option.OUT, text])).startswith("a; folder; use workers")
    assert joined("; ", []) == ""


def test_reasons_and_remarks_of_a_study_name_keywords_to_python():
    text = "give it by " + Option.RANGE
    reasons = SimpleNamespace(judgement=SimpleNamespace(reasons=(text,)))
    assert Nyquist(reasons, None, None).reasons == ("give it by frequencies",)
    with as_options():
        assert Nyquist(reasons, None, None).reasons == (text,)


def test_what_was_given_as_tables_is_named_as_it_was_given():
    kept = "cases/form/given/0123456789abcdef"
    assert str(ShownFile.of(f"{kept}/case.toml")) == "case"
    points = ShownFile.of(Path(f"{kept}/points.csv"))
    assert (points.at_line(1), points.at_line(4)) == ("points", "points, row 3")
    assert ShownFile.of("given/mine/points.csv").at_line(4) == "given/mine/points.csv, line 4"
    assert str(CaseError(f"{kept}/case.toml", [Problem("a", "b")])).startswith("case: 1 problem")


def test_what_is_kept_of_a_point_is_the_same_for_everybody():
    for error in (
        InputError("use " + Option.WORKERS),
        CaseError("x.toml", [Problem(Option.SET + " a.b", "wrong")]),
    ):
        with as_options():
            kept = Failure.of(error)
        assert Failure.of(error) == kept
        assert "--" in kept.text
        again = unpacked(Failure, *packed(kept))
        assert again == kept
        assert "--" not in str(AnalysisError(again.text))


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


def test_an_option_has_a_keyword_of_some_function_or_is_known_to_be_typed_alone():
    keywords = {
        k for f in faces() for k in ([f] if isinstance(f, str) else inspect.signature(f).parameters)
    }
    assert "retune" in vars(Nyquist)  # a method of what a function gives
    assert {o for o in Option if o.has_keyword and o.python not in keywords} == {Option.RETUNE}
    assert not {o for o in Option if not o.has_keyword and o[2:].replace("-", "_") in keywords}


def test_each_option_is_one_of_the_command_line():
    assert not {o for o in Option if o.split()[0] not in options_of_commands()}


def options_of_commands() -> set[str]:
    """Return every option that some command takes."""
    found, parsers = set(), [whole_parser()]
    while parsers:
        for action in parsers.pop()._actions:
            found |= {*action.option_strings}
            if isinstance(action, argparse._SubParsersAction):
                parsers += action.choices.values()
    return found


def options_in(path: Path) -> list[int]:
    """Return lines of texts that name an option in plain words, in a file of the program."""
    text = path.read_text(encoding="utf-8")
    if not MAY_NAME_ONE.search(text):
        return []
    tree = ast.parse(text)
    declared = {
        id(inner)
        for node in ast.walk(tree)
        if (isinstance(node, ast.Call) and ast.unparse(node.func) in DECLARING)
        or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
        for inner in ast.walk(node)
    }
    before_a_field = {
        id(node.values[k])
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for k, after in enumerate(node.values[1:])
        if isinstance(after, ast.FormattedValue)
    }
    return [
        node.lineno
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in declared
        and (
            OPTION.search(re.sub(f"{FOREIGN}|{ONLY_TYPED}", "", node.value))
            or (id(node) in before_a_field and node.value.endswith("--"))
        )
    ]


def test_texts_hold_options_as_values():
    """An option in plain words could not be spelt for Python; the command line's own rooms are spelt for it already."""
    found = {}
    for path in sorted((ROOT / "orchestrator").rglob("*.py")):
        name = path.relative_to(ROOT / "orchestrator").as_posix()
        if not name.startswith(SURFACES) and (lines := options_in(path)):
            found[name] = lines
    assert {name: len(lines) for name, lines in found.items()} == BY_TEXT, found


@pytest.mark.parametrize(
    "line",
    [
        'raise InputError(f"{x}: give --out")',
        'way = "`gfor modes --critical` does"',
        'where = f"--{option} {text}"',
    ],
)
def test_an_option_in_plain_words_is_seen(tmp_path, line):
    (tmp_path / "x.py").write_text(line)
    assert options_in(tmp_path / "x.py") == [1]


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
