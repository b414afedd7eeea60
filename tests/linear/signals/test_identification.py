"""The matrix pencil on signals whose exponentials are known."""

import numpy as np
import pytest

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.signals.identification import averaging, identify_modes, nearest, sampling

TIMES = np.arange(0, 18, 0.005)


def exponential(eigenvalue: complex, amplitude: float, phase: float = 0.3) -> np.ndarray:
    return amplitude * np.real(np.exp(eigenvalue * TIMES + 1j * phase))


@pytest.mark.parametrize("eigenvalue", [0.05 + 3.6j, -0.38 + 3.65j, -1.2 + 5.1j, -0.9 + 3.6j])
def test_one_mode_on_a_drift(eigenvalue):
    signal = exponential(eigenvalue, 1e-4) + 2e-4 * np.exp(-0.3 * TIMES) + 1e-3
    found = nearest(identify_modes(TIMES, signal), eigenvalue)
    assert found is not None
    assert found.eigenvalue == pytest.approx(eigenvalue, abs=1e-3)
    assert found.amplitude == pytest.approx(0.5e-4, rel=0.01)


def test_close_and_well_damped_modes_are_told_apart():
    wanted = [-1.1 + 4.8j, -0.73 + 2.12j, -0.53 + 0.88j]
    signal = sum(
        exponential(v, a, p)
        for v, a, p in zip(wanted, (1.0, 0.7, 0.4), (0.1, 1.0, 2.0), strict=True)
    )
    modes = identify_modes(TIMES, signal)
    for value in wanted:
        assert nearest(modes, value).eigenvalue == pytest.approx(value, abs=1e-2)
    assert modes[0].eigenvalue == pytest.approx(wanted[0], abs=1e-2)


def test_as_many_modes_as_a_system_of_several_areas_has_are_found():
    """Six oscillations beside a drift are an order of thirteen; a pencil of a lower one blends them."""
    wanted = [complex(-0.02 - 0.06 * k, 2 * np.pi * (0.25 + 0.28 * k)) for k in range(6)]
    signal = sum(
        exponential(v, 1 - 0.12 * k, 0.5 * k) for k, v in enumerate(wanted)
    ) + 0.5 * np.exp(-0.2 * TIMES)
    found = identify_modes(TIMES, signal)
    for k, value in enumerate(wanted):
        mode = nearest(found, value)
        assert mode.eigenvalue == pytest.approx(value, abs=1e-4)
        assert mode.amplitude == pytest.approx((1 - 0.12 * k) / 2, rel=1e-3)


def test_what_alternates_from_sample_to_sample_has_an_eigenvalue():
    """Two exponentials, 0.9^k and (-0.8)^k: both multipliers are real, and one is negative."""
    k = np.arange(40)
    modes = identify_modes(0.1 * k, 0.9**k + 0.5 * (-0.8) ** k)
    wanted = np.array([np.log(0.9), np.log(0.8) + 1j * np.pi]) / 0.1
    assert [one.eigenvalue for one in modes] == pytest.approx(list(wanted))


def test_noise_is_not_a_mode():
    rng = np.random.default_rng(1)
    signal = exponential(-0.2 + 4j, 1.0) + 1e-3 * rng.standard_normal(len(TIMES))
    found = identify_modes(TIMES, signal, tolerance=0.05)
    assert found[0].eigenvalue == pytest.approx(-0.2 + 4j, abs=5e-3)
    assert len(found) <= 2


@pytest.mark.parametrize(
    ("times", "signal", "word"),
    [(TIMES, np.ones_like(TIMES), "constant"), (TIMES[:15], TIMES[:15], "15 samples")],
)
def test_what_holds_no_mode_is_said(times, signal, word):
    with pytest.raises(AnalysisError, match=word):
        identify_modes(times, signal)


@pytest.mark.parametrize(
    ("step", "stop", "advised"),
    [
        (0.05, 20.0, "record more often"),
        (0.05, 50.0, "record more often (solver.record_interval), and identify a shorter part"),
        (
            0.002,
            120.0,
            "identify a shorter part of the record (start, stop), as at most 1200 samples are used",
        ),
        (0.05, 120.0, "identify a shorter part"),
        (0.001, 10.0, "look at the record itself, which has a sample every 0.001 s"),
        (0.008, 8.0, "look at the record itself"),
    ],
)
def test_the_advice_is_what_makes_the_samples_denser(step, stop, advised):
    """What is advised is done, and so is what is not advised: only the first gives a shorter interval."""

    def used(step, stop):
        return sampling(np.arange(0, stop, step))

    one = used(step, stop)
    assert one.remedy.startswith(advised)
    more = min(used(step / k, stop).interval for k in (2, 4, 10))
    shorter = min(used(step, stop / k).interval for k in (2, 4, 10))
    both = min(used(step / k, stop / k).interval for k in (2, 4, 10))
    denser = {
        way
        for way, interval in (("more", more), ("shorter", shorter))
        if interval < 0.9 * one.interval
    }
    if "look at" in advised:
        assert not denser
        assert both >= 0.9 * one.interval
    else:
        assert both < 0.9 * one.interval
        assert ("record more" in one.remedy) == ("more" in denser) or "and identify" in one.remedy
        assert ("identify a shorter" in one.remedy) == (
            "shorter" in denser
        ) or "and identify" in one.remedy


@pytest.mark.parametrize("hum", [49.7, 99.4])
def test_what_is_too_fast_for_the_samples_used_is_no_slower_mode(hum):
    times = np.arange(0, 20, 1e-3)
    ring = np.exp(-0.2 * times) * np.cos(2 * np.pi * 0.6 * times)
    found = identify_modes(times, ring + 0.05 * np.sin(2 * np.pi * hum * times), tolerance=1e-3)
    assert found[0].frequency_hz == pytest.approx(0.6, abs=1e-4)
    assert found[0].amplitude == pytest.approx(0.5, rel=1e-3)
    assert all(mode.amplitude < 1e-3 for mode in found[1:])


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_modes_do_not_depend_on_the_unit_of_the_signal(unit):
    t = np.arange(0, 10, 0.02)
    noise = 1e-6 * np.random.default_rng(1).standard_normal(len(t))
    signal = np.exp(-0.3 * t) * np.cos(7 * t) + 0.4 * np.exp(-0.5 * t) * np.cos(3 * t) + noise
    one, other = identify_modes(t, signal), identify_modes(t, unit * signal)
    assert [m.eigenvalue for m in other] == pytest.approx([m.eigenvalue for m in one], rel=1e-6)
    assert [m.amplitude for m in other] == pytest.approx(
        [unit * m.amplitude for m in one], rel=1e-6
    )


@pytest.mark.parametrize("mean", [0.0, 1e5, -1e5])
def test_what_is_too_fast_is_averaged_beside_any_mean(mean):
    """A hum is nothing beside a power of 100 GW, and much beside what moves."""
    t = np.arange(2000) * 1e-3
    slow, hum = np.exp(-0.3 * t) * np.cos(6 * t), 0.3 * np.cos(2 * np.pi * 180 * t)
    assert len(averaging(mean + slow + hum, 10)) > 1
    assert len(averaging(mean + slow, 10)) == 1
