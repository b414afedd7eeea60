"""Published figures stand beside ours where their conditions hold, in whatever unit these are written."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.support.scenarios import prepare_one

WHEN = 'when = { "grid.X_L" = 0.1 }'


@pytest.fixture(scope="module")
def text():
    return load_case("two_area_rms").text


@pytest.fixture
def references(tmp_path, text):
    def find(condition, overrides=None):
        assert WHEN in text
        (tmp_path / "case.toml").write_text(
            text.replace(WHEN, f"when = {{ {condition} }}"), encoding="utf-8"
        )
        prepared = prepare_one(tmp_path / "case.toml", "pod_p", overrides)
        return list(prepared.references)

    return find


@pytest.mark.parametrize(
    "condition", ['"grid.X_L" = "0.1 pu"', "grid.X_L = 0.1", '"sg1.S_n" = "1.5 GVA"']
)
def test_a_condition_is_compared_in_the_unit_of_its_variable(references, condition):
    assert references(condition) == ["electromechanical"]


def test_a_condition_that_does_not_hold_hides_the_figures(references):
    assert references('"grid.X_L" = "0.1 pu"', {"grid.X_L": 0.3}) == []
    assert references('"grid.X_L" = "0.2 pu"') == []


def test_a_value_from_outside_that_is_no_condition_hides_the_figures(references):
    """They were published for the case's own values."""
    assert references('"grid.X_L" = 0.1', {"grid.X_L": "0.1 pu"}) == ["electromechanical"]
    assert references('"grid.X_L" = 0.1', {"grid.X_L": 0.1, "gfor.pod_p.K": 50.0}) == []


def test_a_condition_on_a_value_that_nobody_set_looks_at_the_default(references):
    prepared = prepare_one("two_area_rms", "pod_p")
    default = prepared.system.components["sg1"].description.variables["machine.X_l"].start
    assert "sg1.machine.X_l" not in prepared.values
    assert references(f'"sg1.machine.X_l" = {default}') == ["electromechanical"]
    assert references(f'"sg1.machine.X_l" = {default + 0.01}') == []


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ('"gird.X_L" = 0.1', "there is no component 'gird'; did you mean grid"),
        ('"grid.X_LL" = 0.1', "component 'grid' has no variable 'X_LL'"),
        ('"grid.X_L" = "0.1 MW"', "'0.1 MW' is in MW, but pu is needed"),
        ('"grid.X_L" = true', "it must be a number"),
    ],
)
def test_a_condition_that_cannot_be_judged_is_an_error_with_its_line(references, condition, words):
    with pytest.raises(CaseError, match=words) as caught:
        references(condition)
    assert str(caught.value.problems[0]).startswith("line ")
