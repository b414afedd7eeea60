"""Records that stand in a file of dynamics data a second time: copies, and further models of a load."""

import pytest

from orchestrator.core.errors import InputError
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_motor_loads import STIFF, case, cim5  # noqa: F401 - a fixture
from tests.support.scenarios import prepare_one


def test_a_copy_of_a_machines_record_is_read_once_and_asked_about(case):  # noqa: F811
    motor = f"2 'CIM5BL' 1 {cim5()} /\n"
    alone, twice = (prepare_one(case(text), "base") for text in (motor, motor + STIFF))
    (asked,) = (q for q in twice.questions if "a second time" in q.text)
    assert asked.place.endswith("mill.dyr, line 3")
    assert "GENCLS of machine '1' at bus 1 stands there a second time" in asked.text
    assert "with the values of line 1; it is read once" in asked.text
    (copy,) = (use for use in twice.records if use.line == 3 and use.kind == "GENCLS")
    assert (copy.use, copy.why) == ("not used", "a copy of the record in line 1")
    assert not any("a second time" in q.text for q in alone.questions)
    modes = [compute_modes(one).eigenvalues for one in (alone, twice)]
    assert list(modes[1]) == list(modes[0])


def test_a_second_record_with_other_values_is_refused(case):  # noqa: F811
    with pytest.raises(InputError, match="a second machine of machine '1' at bus 1"):
        case(STIFF.replace("0 0", "3 0"))


@pytest.mark.parametrize("base", [0, 110])
def test_a_second_model_of_a_load_is_told_with_the_first(case, base):  # noqa: F811
    """The load follows the first record, whatever the second has."""
    records = f"2 'CIM5BL' 1 {cim5()} /\n2 'CIM5BL' 1 {cim5(base=base)} /\n"
    prepared = prepare_one(case(records), "base")
    assert prepared.system.components["motor2"].number("S_n") == pytest.approx(100.0)
    (asked,) = (q.text for q in prepared.questions if "second load" in q.text)
    why = "a second load record of the load '1' at bus 2; the first is CIM5BL in line 2"
    assert asked == f"CIM5BL is not used: {why}; remove one of them"
    assert [use.why for use in prepared.records if use.kind == "CIM5BL"] == ["", why]
    assert not any("no load in service" in q.text for q in prepared.questions)
