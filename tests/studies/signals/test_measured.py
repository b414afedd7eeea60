"""Modes of a measured signal: what is noise in it makes no mode."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.output.results.readers import LINE_FREQUENCY
from orchestrator.studies.signals.measured import measured_modes


@pytest.mark.parametrize("rate", [20.0, 400.0])
def test_what_is_noise_makes_no_mode(rate):
    """Two modes are found in two per cent of noise, of samples as they are and of those that are averaged first."""
    times = np.arange(0, 20, 1 / rate)
    clean = 0.05 * np.exp(-0.2 * times) * np.cos(2 * np.pi * 0.9 * times)
    clean += 0.03 * np.exp(-0.1 * times) * np.cos(2 * np.pi * 0.4 * times)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(times))
    window = xr.DataArray(60 + clean + noise, {"time": times, LINE_FREQUENCY: 60.0}, ("time",))
    found = measured_modes(window)
    hertz = sorted(abs(mode.eigenvalue.imag) / (2 * np.pi) for mode in found[:2])
    assert hertz == pytest.approx([0.4, 0.9], rel=0.01)
    assert all(mode.amplitude < 1e-3 for mode in found[2:])
    assert len(measured_modes(window, coarser=1e6)) < 2
