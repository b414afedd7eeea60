"""The bench's own resonance, told from one of the device and the grid by measuring it with less capacitance.

The responses are exact solutions of linear systems that are written here anew: source, capacitance, and a device."""

import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.studies.certification.codes.bench_resonance import (
    PARTS,
    WINDOW,
    Ring,
    of_the_bench,
    ring_of,
    ringing_since,
)

OMEGA = 2 * np.pi * 50.0
TURN = 1j * OMEGA
CAPACITANCE = 0.05  # [pu]
Z = (1 + 6j) / np.hypot(1, 6) / 10  # SCR 10, X/R 6 [pu]
LAG = 3e-3  # of the current behind its reference, in the honest devices of the gallery [s]


def lagging(B, behind=0.1 + 0.3j, lag=LAG):
    """A current that follows the voltage behind a virtual impedance with a lag; states: line, bus, current."""
    A = np.zeros((3, 3), dtype=complex)
    A[0] = [-OMEGA * Z.real / Z.imag - TURN, -OMEGA / Z.imag, 0]
    A[1] = [OMEGA / B, -TURN, OMEGA / B]
    A[2] = [0, -1 / behind / lag, -1 / lag]
    return A, 2


def filtered(B, conductance, reactance=0.15, susceptance=0.0233):
    """A filter whose capacitor resonates with grid and reactance at 659 Hz, and whose control is a conductance there.

    States: line, bus, current of the reactance, voltage of the capacitor."""
    A = np.zeros((4, 4), dtype=complex)
    A[0] = [-OMEGA * Z.real / Z.imag - TURN, -OMEGA / Z.imag, 0, 0]
    A[1] = [OMEGA / B, -TURN, OMEGA / B, 0]
    A[2] = [0, -OMEGA / reactance, -TURN, OMEGA / reactance]
    A[3] = [0, 0, -OMEGA / susceptance, -TURN - OMEGA * conductance / susceptance]
    return A, 2


def grows_most(A):
    return max(np.linalg.eigvals(A), key=lambda pole: pole.real)


def rings(device, *given):
    found = []
    for part in PARTS:
        A, current = device(CAPACITANCE * part, *given)
        step = 1e-4 if part == 1 else 5e-5
        times = np.arange(0, 0.1, step)
        by_step, x = expm(A * step), np.zeros(len(A), dtype=complex)
        x[0] = 0.05  # a current of the line that the event leaves
        x_of = []
        for _ in times:
            x_of.append(x)
            x = by_step @ x
            x = x / max(1.0, abs(x[1]) / 10)  # what grows comes to the limit of its current
        x_of = np.array(x_of)
        found.append(ring_of(times, x_of[:, 1], x_of[:, current], 50.0))
    return found


@pytest.mark.parametrize("behind", [0.1 + 0.3j, 0.15 + 0.45j])
@pytest.mark.parametrize("lag", [1e-3, LAG])
def test_what_a_lag_of_the_current_feeds_is_the_bench_s_own_resonance(behind, lag):
    """Each frequency is that of the mode that grows most, and goes with 1/√C."""
    found = rings(lagging, behind, lag)
    grown = [grows_most(lagging(CAPACITANCE * part, behind, lag)[0]) for part in PARTS]
    wanted = [abs(pole.imag + OMEGA) / 2 / np.pi for pole in grown]
    assert min(pole.real for pole in grown) > 50
    assert [ring.frequency for ring in found] == pytest.approx(wanted, rel=0.02)
    assert wanted == pytest.approx([wanted[0] / part**0.5 for part in PARTS], rel=0.02)
    assert all(ring.lasts and ring.driven > 0 for ring in found)
    assert of_the_bench(found, 1.0)


def test_a_real_resonance_with_the_grid_is_the_device_s_and_fails():
    """It grows with each capacitance, and without any at 659 Hz: that is where the grid has it as well."""
    found = rings(filtered, -0.05)
    assert all(ring.lasts and ring.driven > 0 and ring.size > 0.05 for ring in found)
    grown = grows_most(filtered(1e-6, -0.05)[0])
    assert grown.real > 0
    assert abs(grown.imag + OMEGA) / 2 / np.pi == pytest.approx(659, rel=0.05)
    assert not of_the_bench(found, 11.4)


def test_what_an_event_excites_at_the_bench_s_resonance_is_none():
    """A device that takes power there damps it: what fails in its row has another cause."""
    found = rings(lagging, 0.3 + 0.1j, 1e-5)
    assert not of_the_bench(found, 1.2)
    assert not of_the_bench(found, 11.4)


def ring(part, frequency=710.0, **given):
    values = {"size": 1.0, "share": 0.9, "lasts": True, "driven": 0.1} | given
    return Ring(frequency / part**0.5, **values)


def test_each_mark_of_it_is_needed():
    first, *others = (ring(part) for part in PARTS)
    assert of_the_bench([first, *others], 1.0)
    for mark in ({"share": 0.4}, {"size": 0.01}, {"driven": -0.1}, {"lasts": False}):
        assert not of_the_bench([ring(1.0, **mark), *others], 1.0)
    assert of_the_bench([ring(1.0, lasts=False), *others], 11.4)  # the device tripped
    for frequency in (640.0, 780.0):
        assert not of_the_bench([first, others[0], ring(0.25, frequency)], 11.4)


def test_one_that_is_gone_with_less_capacitance_is_the_bench_s_as_well():
    first, half, _ = (ring(part) for part in PARTS)
    gone = ring(1.0, 300.0, size=0.05, lasts=False)
    assert of_the_bench([first, half, gone], 1.0)
    assert not of_the_bench([first, half, ring(1.0, 300.0, size=0.05)], 1.0)  # it grows late


TIMES = np.arange(0, 3, 1e-3)


def test_a_ring_is_seen_in_a_record_that_is_slower_than_it():
    grown = np.minimum(np.exp(np.minimum(130 * (TIMES - 1.2), 10)), 5.0) * (TIMES > 1.2)
    v = 1 + grown * np.exp(2j * np.pi * 659.3 * TIMES)
    assert ringing_since(TIMES, v) == pytest.approx(1.2, abs=0.03)
    v[1300:] = np.nan  # it gave up
    assert ringing_since(TIMES, v) == pytest.approx(1.2, abs=0.03)


def test_neither_a_slip_nor_a_jump_nor_a_decay_is_a_ring():
    slipping = np.exp(1j * np.cumsum(2 * np.pi * 5e-3 * np.maximum(TIMES - 1, 0)))
    jumping = np.where(TIMES > 1, 1.0, np.exp(0.5j))
    decaying = 1 + 0.3 * np.exp(-31 * np.maximum(TIMES - 1, 0)) * (TIMES > 1) * np.exp(
        2j * np.pi * 659.3 * TIMES
    )
    assert [ringing_since(TIMES, v) for v in (slipping, jumping, decaying)] == [None] * 3
    assert ringing_since(TIMES, np.full(TIMES.shape, np.nan * 1j)) is None


def test_a_span_without_a_window_of_points_has_no_ring():
    few = np.arange(0, 0.02, 1e-4)
    assert ring_of(few, np.ones(len(few), complex), np.ones(len(few), complex), 50.0) is None
    assert ring_of(few[:1], few[:1] + 0j, few[:1] + 0j, 50.0) is None


def test_a_span_of_one_window_has_its_ring():
    times = np.arange(0, WINDOW - 5e-5, 1e-4)
    v = 1 + 0.1 * np.exp(2j * np.pi * 650.0 * times)
    ring = ring_of(times, v, np.zeros(len(times), complex), 50.0)
    assert ring.frequency == pytest.approx(700.0, abs=2.0)
