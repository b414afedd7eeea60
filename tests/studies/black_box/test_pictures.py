"""The picture of a measured admittance: its fit is drawn at the frequencies of its axis."""

from types import SimpleNamespace

import numpy as np

from orchestrator.studies.black_box import files

STEP = 1e-3


def test_the_fit_is_drawn_at_the_communication_points_frequency(monkeypatch):
    """A fit that is 1/z turns by 360° a sampling frequency; measured is the same."""
    figures = []
    monkeypatch.setattr(files, "save_figure", lambda figure, path: figures.append(figure))
    f = np.array([1.0, 10.0, 100.0])
    response = SimpleNamespace(
        frequencies=f,
        step_size=STEP,
        inputs=("v",),
        outputs=("i",),
        bounds=np.full((3, 1, 1), 1e-3),
        values=np.exp(-2j * np.pi * f * STEP)[:, None, None],
    )
    model = SimpleNamespace(response=lambda z: 1 / z[:, None, None], D=np.zeros((1, 1)))
    passive = SimpleNamespace(frequencies=f, relative=np.zeros(3))
    files._plot(response, model, passive, None)
    phase = figures[0].axes[1]
    measured, fitted = phase.lines
    assert np.allclose(
        np.interp(f, fitted.get_xdata(), fitted.get_ydata()), measured.get_ydata(), atol=0.05
    )
    assert np.allclose(measured.get_ydata(), 180 - 360 * f * STEP)
