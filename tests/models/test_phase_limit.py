"""The limit of each phase of `gfor_abc`: kept at unbalanced voltages, and nothing at balanced ones."""

from contextlib import ExitStack

import numpy as np
import pytest

from tests.models.test_abc import AMPERE, OMEGA_B, START, STEP, of_the_phases, start, three_phases

BEGINS, ENDS = 0.1, 0.5  # of the dip, and of the run [s]
CIRCULAR = 1


def run(fmu_path, voltage, **values):
    """Currents of the phases [pu, S_n] and the part of the limit that is taken away, a row each step."""
    rows = []
    with ExitStack() as release:
        begin = of_the_phases(three_phases(1.0, 0.0))
        usual = {**START, "theta_0": 0.0, "P_0": 0.3}
        device = start(release, fmu_path("gfor_abc"), {**usual, **values}, begin)
        for k in range(round(ENDS / STEP)):
            time = k * STEP
            phases = np.array(three_phases(1.0, time))
            device.set(of_the_phases(voltage(phases, time) if time >= BEGINS else phases))
            device.step(time, STEP)
            rows.append(list(device.get(["i_a", "i_b", "i_c", "phase_limit.cut"]).values()))
    table = np.array(rows)
    return table[:, :3] / AMPERE, table[:, 3]


def amplitudes(currents):
    """Of each phase's fundamental in the last cycle [pu, S_n]."""
    cycle = currents[-round(2 * np.pi / OMEGA_B / STEP) :]
    times = np.arange(len(cycle)) * STEP
    return np.abs(2 / len(cycle) * np.exp(-1j * OMEGA_B * times) @ cycle)


def between_two_phases(phases, time):
    """Short circuit of b and c: both have the middle of their voltages."""
    middle = (phases[1] + phases[2]) / 2
    return np.array([phases[0], middle, middle])


@pytest.mark.parametrize("kind", [0, CIRCULAR])
def test_nothing_is_taken_away_at_balanced_voltages(kind, fmu_path):
    """A deep dip with a jump as well leaves the limit as it is, to the last bit: only what is above 0 lowers it."""

    def dip(phases, time):
        return 0.1 * np.array(three_phases(np.exp(0.8j), time)) if time < 0.3 else phases

    currents, cut = run(fmu_path, dip, **{"current_limit.kind": kind})
    assert np.abs(currents).max() > 1.3  # the limit acts
    assert (cut <= 0).all()


def test_no_phase_carries_more_than_the_limit_at_unbalanced_voltages(fmu_path):
    kind = {"current_limit.kind": CIRCULAR}
    without, none = run(fmu_path, between_two_phases, **kind, **{"phase_limit.I_max": 9.0})
    limited, cut = run(fmu_path, between_two_phases, **kind)
    assert (none <= 0).all()
    assert amplitudes(without).max() > 1.1 * 1.05
    assert amplitudes(limited).max() < 1.1 * 1.02
    assert 0.02 < cut[-1] < 0.5


def test_a_declared_limit_of_a_phase_is_kept(fmu_path):
    values = {"current_limit.kind": CIRCULAR, "phase_limit.I_max": 0.8}
    currents, _ = run(fmu_path, between_two_phases, **values)
    assert 0.7 < amplitudes(currents).max() < 0.8 * 1.02
