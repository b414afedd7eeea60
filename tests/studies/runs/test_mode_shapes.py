"""Which shapes a screen shows where no mode has a name: the swings with the least damping, and how many are left."""

from dataclasses import replace

import pytest

import orchestrator as gfor
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.runs.tables import mode_shapes, named_modes

SWINGS, CONTROLS = 20, 15


def mode(k, swings):
    """Of k / 100 1/s of decay at 1 Hz: the greater k, the better damped."""
    state = "sg.omega" if swings else "avr.x"
    return Mode(complex(-k / 100, 6.2832), ((state, 1.0),), {state: 1 + 0j})


@pytest.fixture(scope="module")
def unnamed():
    """A large system's modes: controls, damped least of all, and swings in no order."""
    result = gfor.load("infinite_bus").scenario("dip").modes().result
    swings = [
        mode(k, swings=True) for k in (*range(30, 30 + SWINGS, 2), *range(31, 31 + SWINGS, 2))
    ]
    controls = [mode(k, swings=False) for k in range(1, CONTROLS + 1)]
    return replace(result, modes=[*controls, *swings], named={}, swing=("sg.omega",), areas={})


def dampings(table):
    return [float(cell.plain.split()[2]) for cell in table.columns[0]._cells]


def percent(k):
    return pytest.approx(100 * (k / 100) / abs(complex(k / 100, 6.2832)), abs=0.005)


def test_a_dozen_swings_with_the_least_damping_are_shown_and_the_others_counted(unnamed):
    table = mode_shapes([unnamed])
    assert dampings(table) == [percent(k) for k in range(30, 42)]
    assert table.caption.startswith(f"and {SWINGS + CONTROLS - 12} more")
    assert "--details" in table.caption


def test_several_scenarios_share_the_dozen(unnamed):
    other = replace(unnamed, modes=[*unnamed.modes, mode(90, swings=False)])
    table = mode_shapes([unnamed, other])
    assert dampings(table) == [percent(k) for k in [*range(30, 36)] * 2]
    assert table.caption.startswith(f"and {2 * (SWINGS + CONTROLS) + 1 - 12} more")


def test_scenarios_with_the_same_modes_stand_once(unnamed):
    """As where only their events differ."""
    table = mode_shapes([unnamed, unnamed])
    assert dampings(table) == [percent(k) for k in range(30, 42)]
    assert table.caption == mode_shapes([unnamed]).caption


def test_details_show_all(unnamed):
    table = mode_shapes([unnamed], whole=True)
    assert len(dampings(table)) == SWINGS + CONTROLS
    assert table.caption is None


def test_where_nothing_swings_the_least_damped_are_shown(unnamed):
    found = mode_shapes([replace(unnamed, swing=())])
    assert dampings(found) == [percent(k) for k in range(1, 13)]


def test_of_a_mode_with_a_name_nothing_else_is_counted(unnamed):
    named = unnamed.modes[-1]
    table = mode_shapes([replace(unnamed, named={"Local mode": named})])
    assert table.row_count == 1
    assert table.caption is None


def test_a_shape_tells_its_modes_name_and_frequency(unnamed):
    """The block stood below a table of other modes, and told neither."""
    named = replace(unnamed, named={"inter-area": unnamed.modes[-1]})
    table = mode_shapes([named])
    assert str(table.title) == "Mode shapes: inter-area"
    (column,) = [column for column in table.columns if str(column.header) == "f [Hz]"]
    assert [str(cell) for cell in column.cells] == ["1.000"]
    assert "f [Hz]" not in [str(c.header) for c in mode_shapes([named], with_values=True).columns]
    assert named_modes([named], None).title == "Electromechanical mode: inter-area"
    usual = replace(unnamed, named={"electromechanical": unnamed.modes[-1]})
    assert named_modes([usual], None).title == "Electromechanical mode"
