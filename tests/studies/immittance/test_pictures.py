"""The picture of both sides of a cut shows them at the frequencies of its axis."""

from types import SimpleNamespace

import numpy as np

from orchestrator.studies.immittance.pictures import _matrices


def test_both_sides_are_drawn_over_their_frequency():
    """A lag of 1 Hz and an inductance: the phase is −45° at 1 Hz, and 90° throughout."""
    lag = lambda s: (1 / (1 + s / (2 * np.pi)))[:, None, None] * np.ones((2, 2))  # noqa: E731
    coil = lambda s: s[:, None, None] * np.ones((2, 2))  # noqa: E731
    result = SimpleNamespace(
        judgement=SimpleNamespace(range_hz=(0.1, 100.0), active={"device": [], "network": []}),
        unit="pu",
        loop=SimpleNamespace(device=SimpleNamespace(at=lag), network=None, impedance=coil),
    )
    figure = _matrices(result)
    sizes, phases = figure.axes[:2], figure.axes[2:4]
    device, network = (axis.lines[0] for axis in phases)
    f = device.get_xdata()
    assert (f[0], f[-1]) == (0.1, 100.0)
    assert abs(np.interp(1.0, f, device.get_ydata()) + 45) < 0.1
    assert np.allclose(network.get_ydata(), 90)
    assert np.allclose(sizes[1].lines[0].get_ydata(), 2 * np.pi * f)
