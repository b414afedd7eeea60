"""The values that move a mode most, as the first screen has them."""

import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.face.explore.movers import _gains, candidates, grid_of, movers
from orchestrator.studies.sensitivities.parameters import Parameter, round_step
from orchestrator.studies.sensitivities.sensitivities import Sensitivity

RANGE = (0.1, 2.0)


def test_a_round_step_moves_the_mode_as_its_sentence_says():
    """To first order: a tenth of the step, computed anew at both sides, gives a tenth of the points."""
    case = gfor.load("two_area")
    scenario = case.scenario("pod_p")
    found = movers(scenario, {}, RANGE, ["gfor.pod_p.K", "gfor.pod_p.T_S1"], lambda part: None)
    assert {one["parameter"] for one in found["movers"]} == {"gfor.pod_p.K", "gfor.pod_p.T_S1"}
    for one in found["movers"]:
        part = one["step"] / 10
        ends = [
            case.scenario("pod_p", {one["parameter"]: one["value"] + sign * part}).modes(RANGE)
            for sign in (1, -1)
        ]
        upper, lower = (modes.named["electromechanical"] for modes in ends)
        points = (upper.damping_percent - lower.damping_percent) / 2
        hertz = (upper.frequency_hz - lower.frequency_hz) / 2
        assert one["points"] / 10 == pytest.approx(points, rel=0.02)
        assert one["hertz"] / 10 == pytest.approx(hertz, rel=0.02)


def test_the_mode_is_the_least_damped_one_of_the_range():
    scenario = gfor.load("two_area").scenario("gfor")
    found = movers(scenario, {}, RANGE, ["grid.X_L"], lambda part: None)
    least = min(scenario.modes(RANGE), key=lambda mode: mode.damping_percent)
    assert found["frequency_hz"] == pytest.approx(least.frequency_hz, rel=1e-9)
    assert found["damping_percent"] == pytest.approx(least.damping_percent, rel=1e-9)


def test_the_value_whose_step_moves_damping_most_comes_first():
    """A load that moves the frequency further once stood above one that moves damping three times as much."""
    scenario = gfor.load("kundur").scenario("pod_q")
    loads = ["grid.load_7.scale", "grid.load_9.scale"]
    found = movers(scenario, {}, RANGE, loads, lambda part: None)["movers"]
    assert [one["parameter"] for one in found] == ["grid.load_9.scale", "grid.load_7.scale"]
    assert abs(found[0]["points"]) > 2 * abs(found[1]["points"])
    assert abs(found[0]["hertz"]) < abs(found[1]["hertz"])


def test_the_halves_of_a_tie_stand_in_the_order_of_their_names():
    """They move a mode alike, and rounding once chose which came first."""
    halves = [f"grid.X_tie_8_9_{k}" for k in (1, 2)]
    scenario = gfor.load("kundur").scenario("pod_q")
    found = movers(scenario, {}, RANGE, halves[::-1], lambda part: None)["movers"]
    assert [one["parameter"] for one in found] == halves


def test_what_is_off_or_zero_moves_nothing_and_is_not_looked_at():
    looked_at, of = candidates(gfor.load("two_area").scenario("gfor"), {})
    assert looked_at == of
    assert "grid.X_L" in of
    assert not [name for name in of if "pod_" in name]  # both controllers are off
    assert "grid.R_L" not in of  # it is 0


def test_in_a_large_case_the_devices_that_take_part_and_the_network_beside_them_are_looked_at(
    monkeypatch,
):
    shares = {"gfor38": 0.6, "gfor30": 0.1}
    scenario = gfor.load("ieee39").scenario("pod_p")
    large, _ = candidates(scenario, shares)
    assert not [name for name in large if name.startswith("grid.")]  # as the case starts slowly
    monkeypatch.setattr("orchestrator.face.explore.movers._LARGE", 10_000)
    looked_at, of = candidates(scenario, shares)
    assert len(looked_at) == 40 < len(of)
    assert looked_at[0].startswith("gfor38.")
    bus = next(p.bus for p in scenario.prepared.network.ports if p.name == "gfor38")
    near = [name for name in looked_at if name.startswith("grid.")]
    assert len(near) == 12
    beside = [
        x.variable("X") for x in scenario.prepared.network.lines if bus in (x.from_bus, x.to_bus)
    ]
    assert near[0].removeprefix("grid.") in beside


def test_a_gain_is_weighed_by_what_the_mode_has_without_it():
    """The first gain by name, of a converter without a part in the mode, was once asked about."""
    rows = [
        Sensitivity(Parameter(*row[:2], "1", row[2], tunable=True), -0.1 + 9j, row[3], None, "")
        for row in (
            ("gfor30", "pod_p.K", 200.0, 0j),
            ("gfor31", "pod_p.K", 200.0, -1e-3 + 0j),
            ("gfor31", "pod_p.T_f", 0.1, 1 + 0j),
            ("gfor32", "pod_p.K", 200.0, None),
        )
    ]
    gains = _gains(rows)
    assert gains["gfor30.pod_p.K"] == 0
    assert gains["gfor31.pod_p.K"] == pytest.approx(100 * 200 * 1e-3 / 9, rel=1e-3)  # points
    assert list(gains) == ["gfor30.pod_p.K", "gfor31.pod_p.K"]


@pytest.mark.parametrize(("size", "step"), [(20, 20), (0.037, 0.05), (0.1, 0.1), (8.7e3, 1e4)])
def test_steps_are_round(size, step):
    assert round_step(size) == step


def test_a_slider_stays_within_the_declared_bounds_and_has_the_own_value():
    grid = grid_of({"value": 2.0, "minimum": 1.0, "maximum": 3.0}, 4)
    assert (grid[0], grid[-1], len(grid)) == (1.0, 3.0, 5)
    assert 2.0 in grid
    assert grid == sorted(grid)
    below = grid_of({"value": -1.0, "minimum": None, "maximum": None}, 4)
    assert (below[0], below[-1]) == (-2.0, 0.0)


def test_a_slider_rests_on_the_double_and_on_the_half():
    for value in (200.0, 1.0, 0.37):
        grid = grid_of({"value": value, "minimum": 0.0, "maximum": 1e5}, 12)
        assert {value / 2, value, 2 * value} <= {*grid}
        assert len(grid) == 13
    assert 2.0 not in grid_of({"value": 1.0, "minimum": 0.5, "maximum": 1.9}, 12)


def test_nothing_to_change_is_said():
    scenario = gfor.load("two_area").scenario("gfor")
    with pytest.raises(InputError, match="no value can be changed"):
        movers(_Frozen(scenario), {}, RANGE, [], lambda part: None)


class _Frozen:
    """A scenario whose components have no parameter."""

    def __init__(self, scenario):
        self.prepared = type("Prepared", (), {"grid": scenario.prepared.grid})()
        self.prepared.system = type("System", (), {"components": {}, "connections": ()})()
