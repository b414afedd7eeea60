"""What cannot start is told with the questions about its own values, the likeliest cause first."""

import pytest

from orchestrator.core.errors import StartError
from orchestrator.studies.modes.modes import in_service, running
from tests.studies.screening.five_machines import five_machines
from tests.support.scenarios import prepare_one

REACTANCES = "1.72 1.66 0.3 0.5 0.25 0.15"  # X_d, X_q, X'_d, X'_q, X'' and X_l of each machine [pu]
PERCENT = "172 166 30 50 25 15"
MOTOR = "11 'CIM5BL' 1 1 {stator} 3.0 {cage} 0 0 0 0 0 0 160 100 0.7 0 0 0 2 0 /\n"


@pytest.fixture
def refused(tmp_path):
    """A change of the records → what the component that cannot start is told with."""

    def questions(change):
        five_machines(tmp_path)
        dyr = tmp_path / "five.dyr"
        dyr.write_text(change(dyr.read_text()))
        with pytest.raises(StartError) as failure:
            running(in_service(prepare_one(tmp_path / "five.toml"))).close()
        return failure.value.component, [x.text for x in failure.value.problems if x.besides]

    return questions


def test_reactances_in_percent_are_asked_about_where_the_exciter_cannot_hold_the_voltage(refused):
    name, asked = refused(lambda dyr: dyr.replace(REACTANCES, PERCENT, 1))
    assert name == "sg1"
    assert all("questioned besides: sg1: " in text for text in asked)
    # 172 pu is 43 times the largest usual value of 4 pu, 166 pu is 41.5 times, 30 pu is 30 times 1 pu
    first = [text.split("machine.")[1].split(" ")[0] for text in asked if "outside of" in text]
    assert first[:4] == ["X_d", "X_q", "X_l", "X_d1"]
    assert "is it in percent? 1.72 pu would be usual" in asked[0]


def test_a_motor_beyond_its_pull_out_point_names_the_reactance_that_is_ten_times_too_large(refused):
    name, asked = refused(
        lambda dyr: dyr + MOTOR.format(stator="0.083 0.0138", cage="0.053 0.55"),
    )
    assert name == "motor11"
    assert "X1 = 0.55 pu is outside of 0.01 to 0.5 pu" in asked[0]
    assert "RA = 0.083 pu exceeds XA = 0.0138 pu; are the two swapped?" in asked[1]


def test_what_is_wrong_at_others_is_not_named(refused):
    """Machine 2 has an unusual inertia, which keeps no machine from starting."""
    _, asked = refused(
        lambda dyr: dyr.replace(REACTANCES, PERCENT, 1).replace(" 5.0 0.0 1.72", " 90.0 0.0 1.72")
    )
    assert asked
    assert not any("machine.H" in text for text in asked)
