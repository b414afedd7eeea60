"""What the paper says of its trajectories over X_L, claim by claim, and where our figures say otherwise.

The least damped swing of a scenario is the mode with the least damping in which the generators' speeds take part.
"""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.studies.modes.modes import compute_modes

pytestmark = [pytest.mark.reproduction, pytest.mark.slow]

REACTANCES = (0.01, 0.02, 0.04, 0.07, 0.08, 0.1, 0.2, 0.3, 0.4, 0.6)
SCENARIOS = ("base", "gfor", "pod_p", "pod_q", "pod_pq")
SPEEDS = ("sg1.machine.omega", "sg2.machine.omega")


@pytest.fixture(scope="module")
def swings():
    """The least damped swing by scenario and X_L."""
    case = load_case("two_area")

    def least(scenario, reactance):
        (ready,) = case.prepare([scenario], {"grid.X_L": reactance, "*.native": True})
        modes = compute_modes(ready).modes
        return min((m for m in modes if sum(speeds(m)) > 0.1), key=lambda m: m.damping_percent)

    return {s: {x: least(s, x) for x in REACTANCES} for s in SCENARIOS}


def speeds(mode):
    return [dict(mode.participation).get(name, 0.0) for name in SPEEDS]


def damping(swings, scenario):
    return {x: mode.damping_percent for x, mode in swings[scenario].items()}


@pytest.mark.parametrize("scenario", ["base", "gfor"])
def test_a_longer_line_makes_the_oscillation_slower_and_shares_it_between_the_areas(
    swings, scenario
):
    """Claimed, and so it is: from a local mode of SG1 to an inter-area one."""
    frequencies = [m.frequency_hz for m in swings[scenario].values()]
    assert frequencies == sorted(frequencies, reverse=True)
    assert frequencies[0] == pytest.approx(1.0, abs=0.02)
    assert frequencies[-1] < 0.3
    near, far = (speeds(swings[scenario][x]) for x in (0.01, 0.6))
    assert near[1] / near[0] < 0.4 < far[1] / far[0]


def test_the_base_case_is_unstable_for_most_reactances(swings):
    """Claimed, and so it is: from X_L = 0.08 pu on."""
    assert {x: d < 0 for x, d in damping(swings, "base").items()} == {
        x: x >= 0.08 for x in REACTANCES
    }


def test_the_converter_raises_the_damping_everywhere(swings):
    """Claimed, and so it is."""
    base, gfor = damping(swings, "base"), damping(swings, "gfor")
    assert all(gfor[x] > base[x] for x in REACTANCES)


@pytest.mark.parametrize("scenario", ["pod_p", "pod_q", "pod_pq"])
def test_the_controllers_raise_it_further_up_to_a_long_line(swings, scenario):
    """Claimed for the whole range. Ours: up to 0.3 pu; around 0.4 pu a mode of SG2 is less damped than without POD."""
    gfor, pod = damping(swings, "gfor"), damping(swings, scenario)
    assert all(pod[x] > gfor[x] for x in REACTANCES if x <= 0.3)
    assert pod[0.4] < gfor[0.4]
    slow = swings[scenario][0.4]
    assert speeds(slow)[1] > 5 * speeds(slow)[0]
    # what is left is well damped all the same
    assert min(pod[x] for x in REACTANCES if x >= 0.1) > 20


def test_pod_p_damps_more_than_pod_q_where_the_oscillation_is_local(swings):
    """Claimed in general, and so it is for local modes. From 0.1 pu (as in the paper's table) to 0.3 it is POD-Q."""
    p, q = damping(swings, "pod_p"), damping(swings, "pod_q")
    assert all(p[x] > q[x] for x in REACTANCES if x <= 0.07)
    assert all(p[x] < q[x] for x in (0.1, 0.2, 0.3))
    assert p[0.6] > q[0.6]


def test_both_controllers_together_damp_local_modes_best(swings):
    """Claimed in general, and so it is for local modes; from 0.1 pu on one of them alone does as well or better."""
    p, q, both = (damping(swings, s) for s in ("pod_p", "pod_q", "pod_pq"))
    assert all(both[x] > max(p[x], q[x]) for x in REACTANCES if x < 0.1)
    assert q[0.1] > both[0.1] > p[0.1]
    assert all(both[x] > p[x] - 1 for x in REACTANCES)


@pytest.mark.parametrize("scenario", ["pod_p", "pod_pq"])
def test_the_trajectory_splits_in_two(swings, scenario):
    """Claimed, and so it is: a fast path on which SG1 swings alone, a slow one on which SG2 does."""
    case = load_case("two_area")
    (ready,) = case.prepare([scenario], {"grid.X_L": 0.4, "*.native": True})
    modes = [m for m in compute_modes(ready).modes if sum(speeds(m)) > 0.2]
    slow, fast = sorted(modes, key=lambda m: m.frequency_hz)
    assert (fast.frequency_hz > 0.7, slow.frequency_hz < 0.2) == (True, True)
    assert speeds(fast)[0] > 20 * speeds(fast)[1]
    assert speeds(slow)[1] > 20 * speeds(slow)[0]
