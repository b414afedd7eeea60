"""A load whose sign slipped feeds the network; where a unit then cannot work, the load is named as the likely cause."""

import pytest

from orchestrator.core.errors import CosimError, StartError
from orchestrator.studies.modes.modes import in_service, running
from tests.support.scenarios import prepare_one

CASE = """\
name = "feeding"
[solver]
step_size = "5 ms"
[power_flow]
grid = "grid"
slack = "sg"
[network]
buses = ["b1", "b2", "b3"]
[network.lines]
l12 = { from = "b1", to = "b2", X = 0.02, B = 0.02 }
l23 = { from = "b2", to = "b3", X = 0.02, R = 0.002, B = 0.02 }
[network.loads]
d2 = { bus = "b2", p = "900 MW", q = "100 Mvar" }
d3 = { bus = "b3", p = "-600 MW", q = "100 Mvar" }
[components.grid]
model = "phasor_grid"
[components.sg]
model = "synchronous_generator_phasor"
bus = "b1"
[components.sg.parameters]
S_n = "1000 MVA"
[components.vsc]
model = "gfor_phasor"
bus = "b2"
[components.vsc.parameters]
S_n = "500 MVA"
P_0 = 0.8
"""


@pytest.fixture
def prepared(tmp_path):
    def prepare(feeds, d2=900, **values):
        path = tmp_path / "feeding.toml"
        text = CASE.replace("-600 MW", f"{feeds} MW").replace("900 MW", f"{d2} MW")
        path.write_text(text, encoding="utf-8")
        found = prepare_one(path, overrides=values)
        return found

    return prepare


def asked(prepared):
    return [str(question) for question in prepared.questions if "below zero" in question.text]


def test_a_machine_that_is_driven_as_a_motor_names_the_load(prepared):
    (question,) = asked(prepared(-600))
    assert "line 17, components.sg: sg is the slack and takes" in question
    assert "a load below zero: d3 feeds 600 MW; is its sign meant?" in question


def test_static_generation_that_leaves_the_machine_its_work_is_no_question(prepared):
    assert asked(prepared(-400, d2=1500)) == []


def test_a_unit_that_cannot_start_names_the_load(prepared):
    scenario = prepared(-1600)
    with pytest.raises(CosimError, match=r"cannot start: .* below zero: d3 feeds 1600 MW"):
        running(in_service(scenario)).close()


def test_a_unit_that_is_asked_for_too_much_by_itself_does_not_name_the_load(prepared):
    """The converter's own P_0 is too large: a load below zero leaves a unit less, never more."""
    scenario = prepared(-400, d2=1500, **{"vsc.P_0": 1.5})
    with pytest.raises(CosimError, match=r"vsc .*cannot start") as failure:
        running(in_service(scenario)).close()
    assert "below zero" not in str(failure.value)


def test_all_units_that_cannot_start_are_told_together(tmp_path):
    """One of 1.5 pu at each bus with a converter; what to do about it stands with the first."""
    unit = CASE[CASE.index("[components.vsc]") :]
    text = CASE + unit.replace("components.vsc", "components.another").replace('"b2"', '"b3"')
    (tmp_path / "case.toml").write_text(text.replace("P_0 = 0.8", "P_0 = 1.5"), encoding="utf-8")
    with pytest.raises(StartError) as failure:
        running(in_service(prepare_one(tmp_path / "case.toml"))).close()
    assert failure.value.component == "vsc"
    first, second = (problem.text for problem in failure.value.problems)
    assert ": vsc would need" in first
    assert "Give others more of the power" in first
    assert ": another would need" in second
    assert "the power flow asks it for P_0 = 1.5" in second
    assert "Give others more of the power" not in second


def test_a_unit_that_cannot_start_for_another_reason_names_none(prepared):
    with pytest.raises(CosimError, match="cannot start") as failure:
        running(in_service(prepared(20, **{"vsc.P_0": 1.5}))).close()
    assert "below zero" not in str(failure.value)
