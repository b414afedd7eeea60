"""WECC's generic plants in dynamics data: REGCA1 with REECA1 or REECB1, and REPCA1, as models of their own."""

import json

import pytest

from orchestrator.core.errors import CaseError
from tests.cases.networks.psse.test_dyr_following import REGCA1, dyr, prepared, record

__all__ = ["prepared"]  # the fixture
PLANT = (
    "3 'REPCA1' 1 0 0 0 '{}' 0 0 1 0.02 18 5 0 0.05 0 0 0 0.02 0.1 -0.1 -1 1 0.43 -0.43 1 0.05 0.25 "
    "-1 1 99 -99 1 0 0.1 20 10 /\n"
)
VOLTAGES = {"Brkpt": 0.9, "Zerox": 0.4, "Lvpl1": 1.22, "Volim": 1.2, "Lvpnt1": 0.8, "Lvpnt0": 0.4}
TABLES = {"Vq1": 0.2, "Iq1": 1.0, "Vq4": 1.1, "Iq4": 1.2}


def unit(ready):
    return ready.system.components["gfor3"]


@pytest.mark.parametrize("electrical", ["REECA1", "REECB1"])
def test_records_are_the_whole_unit_with_its_own_values(electrical, prepared):
    more = {"Thld": 0.1, **TABLES} if electrical == "REECA1" else {}
    own = {"Iqh1": 1.1, "QFLAG": 1, "VMAX": 1.1, "VMIN": 0.9, "Vdip": 0.8, "Vup": 1.2, **more}
    ready = prepared(dyr(electrical, **own), "")
    plan = unit(ready)
    assert plan.description.model_name == "regca1_phasor"
    assert {
        "Tg": 0.02,
        "Lvplsw": True,
        "Khv": 0.7,
        "electrical.QFLAG": True,
        "electrical.VFLAG": False,
        "electrical.Kvi": 40,
        "electrical.Iqh1": 1.1,
        "S_n": 128.0,
    }.items() <= plan.parameters.items()
    assert ("electrical.only_in_dips" in plan.parameters) == (electrical == "REECB1")
    assert plan.parameters.get("electrical.Iq4", 1.2) == 1.2


@pytest.mark.parametrize("circuit", ["0 ", "1", "A", ""])
def test_a_plant_controller_is_a_part_of_it(circuit, prepared):
    plan = unit(prepared(dyr(plant=PLANT.format(circuit)), ""))
    assert plan.description.model_name == "regca1_repca1_phasor"
    assert plan.parameters["plant.Fflag"] is True
    assert (plan.parameters["plant.Ddn"], plan.parameters["plant.Dup"]) == (20, 10)


def test_a_plant_controller_that_is_left_out_is_said(prepared):
    ready = prepared(dyr(plant=PLANT.format("")), 'dyr_leave_out = ["REPCA1"]')
    assert unit(ready).description.model_name == "regca1_phasor"
    assert any("REPCA1 left out, as dyr_leave_out says: the ref" in q.text for q in ready.questions)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            dyr().replace("3 'REECB1'", "1 'REECB1'"),
            r"machine '1' at bus 3 has records of its converter and no REECA1 or REECB1.*replace =",
        ),
        (
            dyr().replace("3 'REGCA1'", "1 'REGCA1'"),
            r"machine '1' at bus 3 has records of its electrical and no REGCA1",
        ),
        (
            dyr(plant=record("REGCA1", REGCA1)),
            r"line 7: a second converter of machine '1' at bus 3",
        ),
        (dyr(plant=record("REECA1", {})), r"line 7: a second electrical of machine '1' at bus 3"),
        (dyr(BUSR=2), r"line 6: REECB1 has BUSR = 2; only 0 can be modelled"),
        (dyr(VFLAG=2), r"line 6: REECB1 has VFLAG = 2; only 0 or 1 can be modelled"),
        (
            dyr(plant=PLANT.format("1").replace("0 0 0 '1'", "0 2 3 '1'")),
            r"line 7: REPCA1 has BUS1 = 2; only 0 can be modelled",
        ),
    ],
)
def test_what_cannot_be_taken_over_is_refused(text, words, prepared):
    with pytest.raises(CaseError, match=f"(?s){words}"):
        prepared(text, "")


@pytest.mark.slow
def test_the_system_with_a_plant_has_a_steady_state_and_modes(prepared, tmp_path, gfor):
    text = dyr(plant=PLANT.format(""))
    prepared(text.replace(record("REGCA1", REGCA1), record("REGCA1", REGCA1, **VOLTAGES)), "")
    code, out, error = gfor("modes", tmp_path / "case.toml", "--json")
    assert code == 0, error
    scenario = json.loads(out)["scenarios"][0]
    assert scenario["stable"]
    assert any("gfor3.plant" in str(mode) for mode in scenario["modes"])
