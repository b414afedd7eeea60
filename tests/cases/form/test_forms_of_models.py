"""EMT and phasor models in one case; and buses of phasors, which need no capacitance."""

import numpy as np
import pytest

import orchestrator as gfor
from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError
from tests.cases.form.test_case_files import THREE_BUSES

PHASORS = (
    THREE_BUSES.replace('model = "grid"', 'model = "phasor_grid"')
    .replace('"gfor"', '"gfor_phasor"')
    .replace("generator_st1", "generator_st1_phasor")
    .replace('stop_time = "0.1 s"', 'step_size = "2 ms"\nstop_time = "0.1 s"')
    .replace(", B = 0.02", "")
)
HANGING = PHASORS.replace('["b1", "b2", "b3"]', '["b1", "b2", "b3", "b4"]').replace(
    "loads.d3", 'lines.l24 = { from = "b2", to = "b4", X = 0.1 }\nloads.d3'
)


def loaded(tmp_path, text):
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    return load_case(tmp_path / "case.toml")


def test_an_emt_model_among_phasors_is_one_error(tmp_path):
    """Before, there were eight: four outputs that it lacks, and four inputs that nothing feeds."""
    with pytest.raises(CaseError) as caught:
        loaded(tmp_path, PHASORS.replace("gfor_phasor", "gfor")).prepare()
    (problem,) = caught.value.problems
    assert problem.place == "line 18, components.vsc.model"
    assert problem.text.startswith(
        "vsc: 'gfor' is an EMT model, and the network 'grid' is one of phasors"
    )
    assert "take 'gfor_phasor', or model = 'grid' for the network" in problem.text


def test_the_hint_is_given_once_for_all_units_of_a_model(tmp_path):
    second = '[components.other]\nmodel = "synchronous_generator_st4b_pss2a"\nbus = "b3"\n'
    more = second.replace("other", "more")
    with pytest.raises(CaseError) as caught:
        loaded(tmp_path, PHASORS + second + more).prepare()
    (problem,) = caught.value.problems
    assert problem.text.startswith(
        "other and 1 more: 'synchronous_generator_st4b_pss2a' is an EMT model"
    )
    assert "it has no phasor form" in problem.text


def test_a_phasor_model_in_an_emt_network_is_questioned(tmp_path):
    """Before, nothing said so, and the coupling was found unstable at every step."""
    (ready,) = loaded(tmp_path, THREE_BUSES.replace('"gfor"', '"gfor_phasor"')).prepare()
    (asked,) = [question for question in ready.questions if "rating" not in question.text]
    assert (
        "vsc: 'gfor_phasor' is a phasor model, and the network 'grid' is an EMT one" in asked.text
    )
    (ready,) = loaded(tmp_path, PHASORS).prepare()
    assert not [question for question in ready.questions if "rating" not in question.text]


def test_buses_of_phasors_need_no_capacitance(tmp_path):
    """A bus between two lines; before, stray_B was asked for. A small one gives the same, in the limit."""
    plain, stray = (
        loaded(tmp_path, text).prepare()[0].power_flow.voltages["b1"]
        for text in (HANGING, HANGING.replace("[network]", "[network]\nstray_B = 1e-7"))
    )
    assert abs(plain - stray) < 1e-6
    with pytest.raises(
        CaseError, match=r"bus 'b4' has neither a load with P > 0 nor line charging, .*stray_B"
    ):
        loaded(
            tmp_path,
            THREE_BUSES.replace('"b3"]', '"b3", "b4"]').replace(
                "loads.d3", 'lines.l24 = { from = "b2", to = "b4", X = 0.1 }\nloads.d3'
            ),
        ).prepare()


def test_a_bus_that_its_last_line_leaves_has_no_voltage(tmp_path):
    """0, and not 0/0, which would reach every signal."""
    trip = '[[events]]\ntype = "line_trip"\ntime = "20 ms"\nline = "l24"\n'
    (tmp_path / "case.toml").write_text(HANGING + trip, encoding="utf-8")
    run = gfor.load(tmp_path / "case.toml").scenario("three").run(stop=0.05)
    voltage = np.hypot(*(run.signal(f"grid.b4.v_{part}").values for part in ("re", "im")))
    assert voltage[0] > 0.9
    assert voltage[-1] == 0
    assert np.isfinite(run.signal("vsc.p").values).all()
