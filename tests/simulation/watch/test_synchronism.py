"""Who loses synchronism with whom, by how many turns, and who does not."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.binding.misfits import Misfit
from orchestrator.simulation.watch import synchronism
from orchestrator.simulation.watch.seen import rescaled
from orchestrator.simulation.watch.settings import Settings
from orchestrator.simulation.watch.synchronism import _forget_turns_off_the_grid, lost_synchronism
from orchestrator.systems.coupling.events import ParameterChange
from tests.simulation.watch.seen import foreign_fmu, seen_of, source_fmu, units
from tests.support import vendor

TURN = 2 * np.pi
STOP = 10.0


def slip(turns, since=2.0, until=STOP, start=0.0):
    """So many turns from ``since`` to ``until`` [s]."""
    return lambda t: start + TURN * turns * np.clip((t - since) / (until - since), 0.0, 1.0)


def found(ratings, events=(), **angles):
    system = units(**ratings)
    seen = seen_of({f"{name}.delta": angle for name, angle in angles.items()}, STOP)
    return list(lost_synchronism(seen, system, Settings(system, events, seen.times)))


def test_three_units_that_part_are_told_pair_by_pair_with_their_own_turns():
    """Their mean belongs to none of them: 36.46 turns where g1 moved by 5.97 and 66.95."""
    gfor, g1 = found(
        {"g1": 400, "gfor": 150, "g2": 600},
        g1=slip(66.95, until=8),
        gfor=slip(60.98, until=8),
        g2=slip(0.0),
    )
    assert gfor.component == "gfor"
    assert gfor.figures["turns_against_g1"] == pytest.approx(5.97)
    assert gfor.figures["turns_against_g2"] == pytest.approx(60.98)
    assert "5.97 turns against g1, and holds" in gfor.message
    assert "60.98 turns against g2, and holds" in gfor.message
    assert (g1.component, g1.figures["turns"]) == ("g1", pytest.approx(66.95))
    assert "g1 loses synchronism with g2" in g1.message
    assert "gfor" not in g1.message


def test_units_that_stay_together_are_one_group_and_are_told_once():
    (finding,) = found(
        {"a": 100, "b": 100, "c": 900}, a=slip(6.0), b=slip(6.0, start=2.5), c=slip(0.0)
    )
    assert finding.message.startswith("a, b lose synchronism with c: from t = ")
    assert finding.figures == {"turns": pytest.approx(6.0), "slips_at_the_end": 1.0}


def test_the_time_is_that_of_the_first_half_turn():
    (finding,) = found({"a": 100, "b": 900}, a=slip(2.0, since=2, until=6), b=slip(0.0))
    assert finding.time == pytest.approx(3.0, abs=0.006)
    assert finding.message.endswith("2.00 turns against b, and holds")


def test_a_chain_of_neighbours_holds_together():
    """The ends are 300 degrees apart, and no neighbours more than 150."""
    assert found({"a": 1, "b": 1, "c": 1}, a=slip(0), b=slip(5 / 12), c=slip(10 / 12)) == []


def test_turns_off_the_grid_count_for_nothing():
    """It slips one turn until it is tripped at 4 s, and turns freely from then on."""
    trip = ParameterChange(4.0, "a", "connected", value=False)
    (finding,) = found({"a": 100, "b": 900}, [trip], a=slip(50.0, since=3.84), b=slip(0.0))
    assert finding.figures["turns"] == pytest.approx(50 * 0.16 / 6.16, abs=0.05)
    assert finding.figures["slips_at_the_end"] == 0.0
    assert "when one of both leaves the grid" in finding.message
    assert found({"a": 100, "b": 900}, [trip], a=slip(50.0, since=4.1), b=slip(0.0)) == []


def test_a_source_behind_its_own_open_breaker_keeps_nobody_in_step():
    """The plant is alone from 2 s on, and its frequency is its own."""
    system = units(plant=100)
    system.add("grid", source_fmu())
    seen = seen_of({"plant.delta": slip(9.0), "grid.source.theta": slip(0.0)}, STOP)
    opened = ParameterChange(2.0, "grid", "source.connected", value=False)
    assert list(lost_synchronism(seen, system, Settings(system, [opened], seen.times))) == []
    (finding,) = lost_synchronism(seen, system, Settings(system, [], seen.times))
    assert finding.message.startswith("plant loses synchronism with grid")


def test_the_angle_of_a_foreign_unit_is_the_integral_of_its_frequency():
    """At 60 Hz and 0.5 % too fast from 2 to 6 s it turns 1.2 times; it starts a quarter of a turn ahead."""
    system = units(grid=900)
    system.add("theirs", foreign_fmu(), {"theta_0": TURN / 4})
    fast = {
        "theirs.omega": lambda t: 1.0 + 0.005 * ((t >= 2.0) & (t < 6.0)),
        "grid.delta": slip(0.0),
    }
    seen = seen_of(fast, STOP)
    (finding,) = lost_synchronism(seen, system, Settings(system, [], seen.times))
    assert finding.figures["turns"] == pytest.approx(1.2, abs=0.002)
    assert finding.time == pytest.approx(2.0 + 0.25 / 0.3, abs=0.011)
    assert finding.message.endswith("1.20 turns against grid, and holds")


@pytest.mark.parametrize("f_n", [50.0, 60.0])
def test_turns_are_the_integral_of_the_frequency_that_was_recorded(f_n, tmp_path):
    """10 Hz above the network's for 8 s, and a rise over two looks: half of it counts."""
    system = units(big=100)
    system.add("plant", bound_fmu(vendor.device(tmp_path), vendor.binding(tmp_path, f_n)))
    seen = seen_of({"plant.omega": lambda t: 1 + 10 / f_n * (t >= 2), "big.delta": slip(0.0)}, STOP)
    (finding,) = lost_synchronism(seen, system, Settings(system, [], seen.times))
    assert finding.figures["turns"] == pytest.approx(10 * (STOP - 2 + seen.interval / 2), abs=1e-6)


def test_a_frequency_of_another_scale_is_no_slip_and_a_slip_from_the_start_stays_one():
    misfits = {"plant": [Misfit("wrong rated frequency", "", {"omega": 5 / 6})]}
    still, turning = (
        seen_of(
            {
                "plant.omega": lambda t: 5 / 6 + 0 * t,
                "plant.i_re": re,
                "plant.i_im": lambda t: 0 * t,
            },
            1.0,
        )
        for re in (lambda t: 1.0 + 0 * t, lambda t: 1 + np.cos(TURN * 10 * t))
    )
    assert rescaled(still, misfits).values["plant.omega"] == pytest.approx(1.0)
    assert rescaled(turning, misfits).values["plant.omega"] == pytest.approx(5 / 6)
    assert rescaled(still, {}).values["plant.omega"] == pytest.approx(5 / 6)


@pytest.mark.parametrize("begins", [0.0, 0.9, 50.0])
def test_a_meter_that_settles_is_no_slip_and_what_follows_is_seen(begins):
    """Its current stands still; a slip from 1.5 s on moves it, and one that begins like a meter does as well."""

    def omega(t):
        return 1 + (begins - 1) * np.exp(-t / 0.05) + np.where(t > 1.5, 0.3, 0.0)

    resting = {
        "plant.omega": omega,
        "plant.i_re": lambda t: np.where(t > 1.5, np.cos(9 * t), 1.0),
        "plant.i_im": lambda t: 0 * t,
    }
    seen = seen_of(resting, 2.0)
    found = rescaled(seen, {}).values["plant.omega"]
    assert found[seen.times < 1.5] == pytest.approx(1.0, abs=2e-4)
    assert found[seen.times > 1.51] == pytest.approx(1.3)
    turning = seen_of({**resting, "plant.i_re": lambda t: np.cos(60 * t)}, 2.0)
    assert rescaled(turning, {}).values["plant.omega"] == pytest.approx(
        turning.values["plant.omega"]
    )


@pytest.mark.parametrize(("known", "value"), [({"S_n": None}, 500.0), ({}, 100.0)])
def test_a_unit_counts_with_its_rating_at_the_start(known, value):
    plan = SimpleNamespace(description=SimpleNamespace(variables=known))
    settings = SimpleNamespace(values=lambda name, parameter: [500.0, 700.0])
    assert (
        synchronism._start(SimpleNamespace(components={"a": plan}), settings, "a", "S_n", 100.0)
        == value
    )


def test_turns_off_the_grid_are_taken_away_from_the_moment_of_its_return():
    angles = np.array([[0.0, 0.0, 0.1, 0.1, 0.1], [0.2, 7.0, 13.0, 13.0, 13.2]])
    on = np.array([[True] * 5, [True, False, False, True, True]])
    _forget_turns_off_the_grid(angles, on)
    assert angles[1] == pytest.approx([0.2, 7.0, 13.0, 13.0 - 4 * np.pi, 13.2 - 4 * np.pi])
