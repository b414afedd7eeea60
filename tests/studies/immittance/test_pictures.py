"""The picture of both sides of a cut shows them at the frequencies of its axis."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from orchestrator.studies.immittance import pictures
from orchestrator.studies.immittance.family import LoopFigures
from orchestrator.studies.immittance.pictures import _matrices
from orchestrator.studies.immittance.retune import Retuned, Tunable


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


@pytest.mark.parametrize("scr", [None, 2.5])
def test_what_a_parameter_does_is_drawn_beside_what_is_wanted(scr, tmp_path, monkeypatch):
    """A column for each parameter that could be followed; the ratio at which stability is lost, where one is given."""
    shown, written = [], []
    monkeypatch.setattr(pictures, "_eigenloci", lambda *_: Figure())
    monkeypatch.setattr(pictures, "_matrices", lambda *_: Figure())
    monkeypatch.setattr(
        pictures, "save_figure", lambda figure, path: (shown.append(figure), written.append(path))
    )
    values = np.array([0.5, 1.0, 2.0])
    figures = [LoopFigures(d, 10.0, -1 + 60j, 2.0) for d in (0.3, 0.2, 0.1)]
    setting = Tunable("gain", "pu", 1.0, 0.5, 2.0)
    followed, remarked = Retuned(setting, values=values, figures=figures), Retuned(setting)
    device = SimpleNamespace(name="plant.csv")
    result = SimpleNamespace(
        judgement=None, verdict="stable", loop=SimpleNamespace(device=device), scr=scr
    )
    files = pictures.draw(result, tmp_path, [followed, remarked], 0.15)
    assert [file.name for file in files] == ["eigenloci.png", "matrices.png", "retune.png"]
    assert written == files
    axes = shown[-1].axes
    assert len(axes) == (2 if scr is None else 3)
    curve, wanted = axes[0].lines[:2]
    assert list(curve.get_ydata()) == [0.3, 0.2, 0.1]
    assert (set(wanted.get_ydata()), wanted.get_label()) == ({0.15}, "wanted: 0.15")
    assert scr is None or list(axes[2].lines[0].get_ydata()) == [1.25] * 3
