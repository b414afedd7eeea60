"""The eigenvalue map: labels that can be read, marks in the legend, scenarios that share one picture."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orchestrator.studies.runs import mode_plots
from orchestrator.studies.runs.mode_plots import damping_rays, draw_eigenvalues, draw_mode_shape

SHAPES = {
    "two_area": (-2.1, 1.02),
    "ieee118": (-1.23, 1.12),
    "infinite_bus": (-1.0, 1.0),
    "slow": (-3.3, 0.2),
}
"""Left edge [1/s] and upper edge [Hz] of pictures."""


def axes():
    figure = Figure(figsize=(7.2, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    return figure.subplots()


def result(label, *eigenvalues, references=()):
    """Modes with a name, as the map takes them."""
    modes = [
        SimpleNamespace(
            eigenvalue=z, frequency_hz=z.imag / 6.283185, damping_ratio=-z.real / abs(z)
        )
        for z in eigenvalues
    ]
    named = {str(k): mode for k, mode in enumerate(modes)}
    known = {str(k): reference for k, reference in enumerate(references)}
    return SimpleNamespace(
        label=label, modes=modes, named=named, references=known, name_of=lambda mode: "named"
    )


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_the_labels_of_rays_lie_inside_and_apart(shape):
    axis, (left, highest) = axes(), shape
    axis.set_xlim(left, 0.35)
    axis.set_ylim(0, highest)
    damping_rays(axis, left, highest)
    axis.figure.canvas.draw()
    frame, boxes = axis.get_window_extent(), [text.get_window_extent() for text in axis.texts]
    assert [text.get_text() for text in axis.texts] == ["5 %", "10 %", "15 %", "20 %", "30 %"]
    for box in boxes:
        assert frame.x0 < box.x0
        assert box.x1 < frame.x1
        assert frame.y0 < box.y0
        assert box.y1 < frame.y1
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


@pytest.mark.parametrize("percent", [5, 30])
def test_a_ray_joins_eigenvalues_of_its_damping(percent):
    axis = axes()
    damping_rays(axis, -2.0, 1.0)
    ray = axis.lines[[5, 10, 15, 20, 30].index(percent)]
    real, imag = ray.get_xdata()[1], 2 * 3.14159265 * ray.get_ydata()[1]
    assert -real / abs(complex(real, imag)) == pytest.approx(percent / 100, rel=1e-6)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_every_ray_ends_at_an_edge(shape):
    axis, (left, highest) = axes(), shape
    damping_rays(axis, left, highest)
    for ray in axis.lines:
        real, hertz = ray.get_xdata()[1], ray.get_ydata()[1]
        assert real >= left - 1e-9
        assert hertz == pytest.approx(highest) or real == pytest.approx(left)


def test_a_scenario_without_a_mode_in_range_has_its_mark_in_the_legend():
    axis = axes()
    draw_eigenvalues(axis, [result("none")])
    (mark,) = axis.legend().legend_handles
    assert mark.get_sizes().tolist() == [30]


def test_a_second_scenario_does_not_cut_off_the_first():
    axis = axes()
    draw_eigenvalues(axis, [result("first", -2.5 + 6j)])
    draw_eigenvalues(axis, [result("second", -0.1 + 1j)], first=1)
    assert axis.get_xlim()[0] < -2.5
    assert axis.get_ylim()[1] > 6 / 6.2832
    colours = [tuple(marks.get_edgecolors()[0]) for marks in axis.collections]
    assert len(set(colours)) == 2
    assert len(axis.texts) == 5, "rays stand there once"


def test_rays_reach_the_edge_that_a_later_scenario_moves():
    axis = axes()
    draw_eigenvalues(axis, [result("slow", -0.1 + 2j)])
    draw_eigenvalues(axis, [result("fast", -0.2 + 8j)], first=1)
    rays = [line for line in axis.lines if line.get_linestyle() == "--"]
    assert len(rays) == 5
    assert max(ray.get_ydata()[-1] for ray in rays) == pytest.approx(axis.get_ylim()[1])


def test_another_persons_mode_is_a_circle_at_its_damping_and_frequency():
    axis = axes()
    known = SimpleNamespace(real=None, frequency_hz=0.5, damping_percent=10.0)
    draw_eigenvalues(axis, [result("one", -0.3 + 3j, references=[known])])
    ((real, hertz),) = axis.collections[1].get_offsets().tolist()
    assert hertz == 0.5
    assert -real / abs(complex(real, 2 * 3.14159265 * hertz)) == pytest.approx(0.1, rel=1e-6)


def test_a_mode_shape_names_the_components_of_either_side():
    sides = (["sg1.omega"], ["sg2.omega", "gfor.theta"])
    mode = SimpleNamespace(
        swing=lambda states, least: sides,
        shape={"sg1.omega": 2, "sg2.omega": -1, "gfor.theta": -1j},
    )
    axis = Figure().subplots(subplot_kw={"projection": "polar"})
    draw_mode_shape(axis, SimpleNamespace(named={"tie": mode}, swing=()), "tie", "k")
    assert axis.get_xlabel() == "→ sg1\n← sg2, gfor"
    assert [tuple(np.round(line.get_data(), 6).ravel()) for line in axis.lines[::2]][1] == (
        3.141593,
        3.141593,
        0,
        0.5,
    )


def test_bars_of_a_named_mode_have_as_much_room_beside_those_of_others(tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(mode_plots, "save_figure", lambda figure, path: kept.append(figure))
    for number in (1, 2, 3):
        named = {str(k): SimpleNamespace(by_component={"sg1": 1.0}) for k in range(number)}
        shown = SimpleNamespace(named=named, prepared=SimpleNamespace(title="base"))
        assert mode_plots.plot_participation([shown], tmp_path / "participation.png")
    one, two, three = (figure.get_figheight() for figure in kept)
    assert three - two == pytest.approx(two - one)
    assert two - one > 0.5 * one
