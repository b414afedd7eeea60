"""A generator's parts, chosen in a case file, its scenarios, its units' file and on the command line."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.build_choices import CHOICES, PARTS, layer_of
from orchestrator.core.errors import CaseError

CASE = """
name = "parts"

[power_flow]
grid = "grid"
slack = "north"

[components.grid]
model = "grid"

[network]
buses = ["north", "south"]
lines.tie = { from = "north", to = "south", X = 0.1, B = 0.2 }
loads.town = { bus = "south", p = "60 MW" }

[components.gn]
model = "synchronous_generator"
machine = "classical"
bus = "north"

[components.gs]
model = "synchronous_generator"
machine = "classical"
governor = "constant_power"
bus = "south"
parameters = { P_0 = 0.3 }

[scenarios.plain]

[scenarios.other]
set = { "*.governor" = "constant_torque" }
"""
UNITS = """
[units]
file = "units.csv"
generator = "synchronous_generator"
converter = "gfor"
machine = "classical"
governor = "constant_power"
"""


@pytest.fixture
def write(tmp_path):
    def write(*replacements, extra="", units=""):
        text = CASE + extra
        for old, new in replacements:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / "case.toml").write_text(text, encoding="utf-8")
        (tmp_path / "units.csv").write_text(units, encoding="utf-8")
        return load_case(tmp_path / "case.toml")

    return write


def models(case, scenario="plain", overrides=None):
    """Name of each generator's model, after its parts."""
    components = case.components_of(scenario, overrides or {})
    return {
        name: plan.description.model_name.removeprefix("synchronous_generator_")
        for name, plan in components.items()
        if name != "grid"
    }


def test_a_component_is_made_of_the_parts_it_names(write):
    assert models(write()) == {
        "gn": "classical_manual_constant_torque",
        "gs": "classical_manual_constant_power",
    }


def test_a_scenarios_pattern_changes_a_part_of_those_that_have_it(write):
    assert set(models(write(), "other").values()) == {"classical_manual_constant_torque"}


def test_the_command_line_decides_last(write):
    found = models(write(), "other", {"gs.governor": "constant_power"})
    assert found["gs"] == "classical_manual_constant_power"
    assert found["gn"] == "classical_manual_constant_torque"


def test_the_system_of_chosen_parts_runs_from_its_power_flow(write):
    (prepared,) = write().prepare(["plain"])
    assert prepared.values["gs.P_0"] == pytest.approx(0.3)
    assert prepared.values["gn.P_0"] == pytest.approx(0.3, abs=1e-3)


def test_units_choose_in_their_table_and_each_row_for_itself(write):
    rows = (
        "bus,rating_mva,p_mw,v_pu,governor\nnorth,100,30,1.0,\nsouth,100,30,1.0,constant_torque\n"
    )
    own = CASE[CASE.index("[components.gn]") : CASE.index("[scenarios.plain]")]
    case = write((own, UNITS), units=rows)
    assert models(case) == {
        "sgnorth": "classical_manual_constant_power",
        "sgsouth": "classical_manual_constant_torque",
    }


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            'governor = "constant_power"',
            'governor = "tgov"',
            "there is no governor 'tgov'; did you mean 'tgov",
        ),
        (
            'governor = "constant_power"',
            'exciter = "sexs"',
            "the classical machine has no field winding",
        ),
        ('governor = "constant_power"', 'stabilizer = "pss1a"', "manual excitation has none"),
        (
            'machine = "classical"\ngovernor',
            'machine = ["genrou"]\ngovernor',
            "components.gs.machine",
        ),
        (
            'model = "grid"\n',
            'model = "grid"\nexciter = "sexs"\n',
            "the model 'grid' has no such part to choose",
        ),
    ],
)
def test_a_part_that_cannot_be_is_one_error_at_its_component(write, old, new, said):
    with pytest.raises(CaseError) as caught:
        models(write((old, new)))
    assert said in str(caught.value)
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"gs.exciter": 3.0},
            "--set gs.exciter: exciter = 3.0; it must be the name of a part, in quotes",
        ),
        ({"gz.exciter": "sexs"}, "--set gz.exciter: there is no component 'gz'"),
        (
            {"grid.machine": "genrou"},
            "machine = 'genrou': the model 'grid' has no such part to choose",
        ),
    ],
)
def test_a_wrong_choice_on_the_command_line_is_named(write, given, said):
    with pytest.raises(CaseError) as caught:
        models(write(), "plain", given)
    assert said in str(caught.value)


def test_a_part_is_a_choice_and_a_parameter_of_it_a_value():
    layer = layer_of({"g1.exciter": "sexs", "g1.exciter.K": 90.0}, lambda key: key, has_units=False)
    assert [(c.pattern, c.part, c.name) for c in layer.parts] == [("g1", "exciter", "sexs")]
    assert dict(layer.values) == {"g1.exciter.K": 90.0}
    assert set(PARTS) == {"machine", "exciter", "governor", "stabilizer", "oel", "uel"}
    assert set(CHOICES) == {*PARTS, "records"}


@pytest.mark.parametrize(("S_data", "asked"), [(0, True), (1000, False)])
def test_machine_data_are_judged_on_the_rating(write, S_data, asked):
    """X'_d = 2 pu on 1000 MVA is 0.2 pu on the rating of 100 MVA."""
    values = f"parameters = {{ P_0 = 0.3, machine.S_data = {S_data}, machine.X_d1 = 2.0, machine.H = 0.6 }}"
    (prepared,) = write(("parameters = { P_0 = 0.3 }", values)).prepare(["plain"])
    texts = [question.text for question in prepared.questions]
    assert any("machine.X_d1 = 2 pu is outside of" in text for text in texts) == asked
    assert not any("on machine.S_data" in text for text in texts)


def test_a_question_shows_machine_data_on_both_bases(write):
    values = (
        "parameters = { P_0 = 0.3, machine.S_data = 1000, machine.X_d1 = 30.0, machine.H = 0.6 }"
    )
    (prepared,) = write(("parameters = { P_0 = 0.3 }", values)).prepare(["plain"])
    (text,) = [question.text for question in prepared.questions]
    assert "machine.X_d1 = 30 pu on machine.S_data, 3 pu on S_n, is outside of 0.05 to 1 pu" in text
