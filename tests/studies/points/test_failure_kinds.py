"""What an error means is its kind: the same trouble has one status, whatever its text says and however it was met."""

import ast
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import (
    AnalysisError,
    CaseError,
    ComponentError,
    ErrorKind,
    InputError,
    PowerFlowError,
    Problem,
    StartError,
)
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.preparation import failure
from orchestrator.studies.points.codec import packed, unpacked
from orchestrator.studies.points.executor import Serial
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.points import Work
from orchestrator.studies.points.store import PointStore
from orchestrator.studies.screening.request import ScreeningRequest
from orchestrator.studies.screening.study import plan_screening, run_screening
from tests.support.all_code import asked_of_all_code
from tests.support.source_files import product_files

ROOT = Path(__file__).parents[3]
TEXT = (
    "the power flow asks it for more, no steady state, parameters cannot be used: --black-box; hang"
)


@pytest.mark.parametrize(
    ("error", "status", "lasting"),
    [
        (StartError("c", Problem("c", TEXT, ErrorKind.START), "sg1"), Status.STEADY_STATE, True),
        (StartError("c", Problem("c", TEXT, ErrorKind.FMU), "theirs"), Status.FMU, False),
        (CaseError("c", [Problem("c", TEXT, ErrorKind.POWER_FLOW)]), Status.POWER_FLOW, True),
        (CaseError("c", [Problem("c", TEXT)]), Status.VALUES, True),
        (
            CaseError("c", [Problem("c", TEXT), Problem("d", TEXT, ErrorKind.POWER_FLOW)]),
            Status.VALUES,
            True,
        ),
        (PowerFlowError(TEXT), Status.POWER_FLOW, True),
        (InputError(TEXT), Status.VALUES, False),
        (AnalysisError(TEXT), Status.MODES, True),
        (AnalysisError(TEXT, kind=ErrorKind.STEADY_STATE), Status.STEADY_STATE, True),
        (ComponentError("sg1", "fmi2DoStep", "fmi2Error", TEXT), Status.FMU, False),
        (
            ComponentError("sg1", "fmi2DoStep", "hang: no answer", TEXT, kind=ErrorKind.HANG),
            Status.FMU,
            False,
        ),
        (np.linalg.LinAlgError(TEXT), Status.MODES, True),
        (ValueError(TEXT), Status.INTERNAL, False),
    ],
)
def test_a_status_follows_from_the_kind_alone(error, status, lasting):
    found, told = failure(error, Item(0, 0, {"sg1.P_0": 1.3, "sg2.H": 3.0}, ()))
    assert (found, told.lasting) == (status, lasting)
    assert "the power flow asks it for more" in told.text
    kept = Failure.of(error)
    assert unpacked(Failure, *packed(kept)) == kept


def test_a_component_that_refuses_its_own_values_has_no_other_operating_point():
    """The operating point is to blame only where nothing else of the component was set."""
    error = StartError("c", Problem("c", TEXT, ErrorKind.START), "sg1")
    own, others = (
        {"sg1.governor.T_3": 0.0, "sg1.P_0": 0.5},
        {"sg2.governor.T_3": 0.0, "sg1.P_0": 0.5},
    )
    assert [failure(error, Item(0, 0, values, ()))[0] for values in (own, others)] == [
        Status.VALUES,
        Status.STEADY_STATE,
    ]


def test_an_overloaded_converter_has_one_status_opened_anew_and_reset(tmp_path):
    """The first point of a file is served by new FMUs, the second by the same ones, reset."""
    case, found = load_case("two_area"), []
    over = "{},1.45\n"
    for name, rows in (
        ("opened", over.format("over")),
        ("reset", "usual,\n" + over.format("over")),
    ):
        path = tmp_path / f"{name}.csv"
        path.write_text("name,gfor.P_0\n" + rows)
        found.append(
            run_screening(
                plan_screening(case, ScreeningRequest(path, None, "gfor")),
                Work(Serial(), PointStore(tmp_path / name)),
            )
        )
    opened, reset = (result.items[-1].record for result in found)
    assert found[1].items[0].record.status is Status.COMPUTED
    assert (opened.status, opened.text, opened.lasting) == (reset.status, reset.text, reset.lasting)
    assert opened.status is Status.STEADY_STATE
    assert opened.lasting
    assert opened.cause.startswith("gfor would need ")
    assert opened.text.endswith(f"scenario 'gfor': {opened.cause}")


# -- no English decides ------------------------------------------------------------------------------

_MESSAGES = {
    "text",
    "texts",
    "error",
    "message",
    "sentence",
    "said",
    "why",
    "reason",
    "words",
    "log",
    "status",
}
_CUTS = {
    "startswith",
    "endswith",
    "partition",
    "rpartition",
    "split",
    "removeprefix",
    "removesuffix",
    "find",
    "index",
}

_PATTERNS = {"match", "search", "fullmatch", "findall", "finditer", "sub"}

ALLOWED = {
    "orchestrator/simulation/federation/helics_calls.py": 1,  # what the library of HELICS says
}
"""Files that may look into a text, and how often."""


def looks_into_a_message(node: ast.AST) -> bool:
    """Whether an expression searches or cuts an error, a message or a sentence."""
    if isinstance(node, ast.Compare) and any(isinstance(op, ast.In | ast.NotIn) for op in node.ops):
        sought = node.left
        is_text = isinstance(sought, ast.JoinedStr) or (
            isinstance(sought, ast.Constant) and isinstance(sought.value, str)
        )
        named = isinstance(sought, ast.Name) and sought.id.isupper()
        return (is_text or named) and any(is_message(one) for one in node.comparators)
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
        return False
    if node.func.attr in _PATTERNS and any(is_message(one) for one in node.args):
        return True
    if node.func.attr in _CUTS:
        given = node.args[:1]
        literal = (
            bool(given) and isinstance(given[0], ast.Constant) and len(str(given[0].value)) > 0
        )
        return literal and is_message(node.func.value)
    return False


def is_message(node: ast.AST) -> bool:
    """An error as text, something called a message, or what a function of sentences gives."""
    if isinstance(node, ast.Call):
        if isinstance(node.func, ast.Name) and node.func.id in ("str", "repr"):
            return bool(node.args) and is_error(node.args[0])
        return isinstance(node.func, ast.Attribute | ast.Name) and "sentence" in name_of(node.func)
    if isinstance(node, ast.BoolOp):
        return any(is_message(value) for value in node.values)
    if isinstance(node, ast.Subscript):
        return isinstance(node.slice, ast.Constant) and node.slice.value in _MESSAGES
    if isinstance(node, ast.Attribute):
        return node.attr in _MESSAGES and node.attr != "words"
    return isinstance(node, ast.Name) and node.id in (
        "error",
        "message",
        "sentence",
        "verdict",
        "answer",
        "remark",
    )


def is_error(node: ast.AST) -> bool:
    return "error" in name_of(node) or "failure" in name_of(node) or "problem" in name_of(node)


def name_of(node: ast.AST) -> str:
    return (
        node.attr
        if isinstance(node, ast.Attribute)
        else node.id
        if isinstance(node, ast.Name)
        else ""
    )


def searches(nodes: Iterable[ast.AST]) -> list[int]:
    return [node.lineno for node in nodes if looks_into_a_message(node)]


@pytest.mark.parametrize(
    "line",
    [
        '"power flow" in str(error)',
        "_HIDES in (record.error or '')",
        'error.status.startswith("hang")',
        'verdict.sentence().partition(":")',
        'str(error).rpartition("; ")',
        '"x" in problem.text',
        'answer.startswith("no error")',
        'stability["sentence"].removeprefix("UNSTABLE: ")',
        'verdict_sentence(summary).partition(":")',
        "_GIVEN.match(problem.text)",
        're.sub(r"--[a-z]+", "", str(error))',
    ],
)
def test_a_search_of_a_message_is_seen(line):
    assert searches(ast.walk(ast.parse(line)))


@pytest.mark.parametrize(
    "line", ['"a" in names', 'path.name.startswith("x")', 'key.partition(".")', "kind in kinds"]
)
def test_other_texts_may_be_cut(line):
    assert not searches(ast.walk(ast.parse(line)))


@asked_of_all_code
def searches_by_file():
    """File → lines in which it looks into a message."""
    found = {source.place: searches(source.of(ast.AST)) for source in product_files("orchestrator")}
    return {place: lines for place, lines in found.items() if lines}


def test_no_code_decides_by_the_text_of_a_message():
    found = searches_by_file()
    assert {name: len(lines) for name, lines in found.items()} == ALLOWED, found
