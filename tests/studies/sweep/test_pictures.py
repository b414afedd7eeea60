"""Pictures and remarks of a sweep: which axis has the legend, and what stays at 0."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from orchestrator.studies.sweep import plots, tables
from orchestrator.studies.sweep.trajectories import Beginning
from orchestrator.studies.sweep.view import ParameterSweep
from tests.support.scenarios import bare_scenario


@pytest.fixture
def drawn(monkeypatch):
    """Figures, in place of their files; one named curve from 40 to 60."""
    figures = []
    trajectory = SimpleNamespace(name="tie", case_name="tie")
    sweep = SimpleNamespace(prepared=bare_scenario(title="SG + GFOR"))
    monkeypatch.setattr(plots, "_named_curves", lambda samples: [(0, sweep, trajectory, None)])
    monkeypatch.setattr(plots, "_draw", lambda axis, *_, **__: axis.plot([1, 2], [40, 60]))
    monkeypatch.setattr(plots, "axis_label", lambda axis: "X_L [pu]")
    monkeypatch.setattr(plots, "save_figure", lambda figure, path: figures.append(figure))
    return figures


def labelled(figure: Figure):
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["SG + GFOR"]
    first, *_, last = figure.axes
    assert first.get_title("left").startswith("Named modes")
    assert (last.get_xlabel(), last.get_title("left")) == ("X_L [pu]", "")


def test_numbers_beside_curves_stand_in_the_legend():
    places = {"damping": 5.0, "real": -0.2, "frequency": 0.5}
    trajectories = [SimpleNamespace(name=f"tie {k}", case_name="tie") for k in (1, 2)]
    sweep = SimpleNamespace(
        trajectories=trajectories,
        prepared=bare_scenario(title="SG + GFOR"),
        unstable=lambda axes: [],
    )
    samples = SimpleNamespace(
        result=SimpleNamespace(scenarios=[sweep]),
        axes=[SimpleNamespace(key="grid.X_L", unit="pu", values=(0.1, 0.3))],
        of=lambda *_: [((0,), places), ((1,), places | {"real": -0.3})],
    )
    axes = Figure().subplots()
    assert plots.draw_trajectories(axes, samples)
    assert {"1", "2"} <= {text.get_text() for text in axes.texts}
    assert axes.get_legend_handles_labels()[1] == ["SG + GFOR", "tie 1", "tie 2"]


def test_a_ring_stands_where_each_curve_begins_also_after_a_gap():
    figures = [{"damping": 5.0, "real": -0.1 * k, "frequency": 0.5 + 0.1 * k} for k in range(4)]
    sweep = SimpleNamespace(
        trajectories=[SimpleNamespace(name="tie", case_name="tie")],
        prepared=bare_scenario(title="SG + GFOR"),
        unstable=lambda axes: [],
    )
    samples = SimpleNamespace(
        result=SimpleNamespace(scenarios=[sweep]),
        axes=[SimpleNamespace(key="grid.X_L", unit="pu", values=(0.1, 0.2, 0.3, 0.4, 0.5))],
        of=lambda *_: [((place,), figures[k]) for k, place in enumerate((0, 1, 2, 4))],
    )
    axes = Figure().subplots()
    assert plots.draw_trajectories(axes, samples)
    rings = [line for line in axes.lines if line.get_markerfacecolor() == "white"]
    found = [(float(ring.get_xdata()[0]), float(ring.get_ydata()[0])) for ring in rings]
    assert found == [(0.0, 0.5), (pytest.approx(-0.3), pytest.approx(0.8))]


def test_damping_and_frequency_of_named_modes(drawn):
    assert plots.plot_named(SimpleNamespace(axes=["X_L"]), None)
    labelled(drawn[0])
    damping, frequency = drawn[0].axes
    assert (damping.get_ylabel(), frequency.get_ylabel()) == ("Damping [%]", "Frequency [Hz]")
    assert frequency.get_ylim()[0] == 0
    assert [list(line.get_ydata()) for line in damping.lines if len(line.get_ydata()) == 2] == [
        [40, 60],
        [0, 0],
    ]


@pytest.mark.parametrize("states", [["sg1.omega"], ["sg1.omega", "sg2.omega"]])
def test_participation_begins_at_0(drawn, states):
    assert plots.plot_swing(SimpleNamespace(axes=["X_L"], states=states), None)
    axes = drawn[0].axes
    assert [axis.get_ylabel() for axis in axes] == [f"{state} [%]" for state in states]
    assert {axis.get_ylim()[0] for axis in axes} == {0}
    assert [text.get_text() for text in drawn[0].legends[0].get_texts()] == ["SG + GFOR"]


@pytest.mark.parametrize("beyond", [0, 1])
def test_failures_are_listed_up_to_a_number_and_the_rest_is_counted(monkeypatch, beyond):
    monkeypatch.setattr(tables, "place_text", lambda axes, place: str(place))
    monkeypatch.setattr(tables, "warned", lambda result: [])
    sweep = SimpleNamespace(prepared=bare_scenario())
    failed = [(sweep, place, "no power flow") for place in range(tables._FAILURES_SHOWN + beyond)]
    result = SimpleNamespace(
        plan=SimpleNamespace(idle=(), number_of_points=99),
        limits=(),
        scenarios=(),
        refined=0,
        failures=lambda: iter(failed),
    )
    texts = tables.remarks(SimpleNamespace(result=result, axes=()))
    assert len(texts) == 1 + tables._FAILURES_SHOWN + beyond
    assert [text for text in texts if "more" in text] == ["  … and 1 more, in sweep.csv"] * beyond


def test_where_a_mode_was_lost_and_begins_anew_is_told_and_no_other_beginning(monkeypatch):
    monkeypatch.setattr(tables, "place_text", lambda axes, place: f"X_L {place[0]}")
    monkeypatch.setattr(tables, "warned", lambda samples: [])
    broken = {0, *range(10, 12 + tables._FAILURES_SHOWN)}
    points = {
        (k,): SimpleNamespace(
            beginning=Beginning.BROKEN if k in broken else Beginning(k % Beginning.BROKEN)
        )
        for k in range(20)
    }
    sweep = SimpleNamespace(
        prepared=bare_scenario("gfor"),
        trajectories=[SimpleNamespace(name="tie", points=points)],
    )
    result = SimpleNamespace(
        plan=SimpleNamespace(idle=()),
        limits=(),
        scenarios=[sweep],
        refined=0,
        failures=lambda: iter(()),
    )
    *shown, rest = tables.remarks(SimpleNamespace(result=result, axes=()))
    assert [text.partition(", not")[0] for text in shown] == [
        f"gfor: tie begins at X_L {k}" for k in sorted(broken)[: tables._FAILURES_SHOWN]
    ]
    assert rest == "… and 3 more beginnings, marked 'broken' in sweep.csv"


def test_a_trajectory_is_told_by_its_ends_and_where_it_is_damped_least_and_most(monkeypatch):
    monkeypatch.setattr(tables, "axis_label", lambda axis: "X_L [pu]")
    values = (0.1, 0.2, 0.3, 0.4)
    figures = [
        {"frequency": f, "damping": d, "similarity": s, "named": d < 8}
        for f, d, s in ((0.5, 5.0, 1.0), (0.6, 2.5, 0.97), (0.65, 9.0, 0.8), (0.7, 7.0, 0.9))
    ]
    trajectories = [
        SimpleNamespace(name="tie", case_name="tie", points={}),
        SimpleNamespace(name="mode 2", case_name=None, points={(0,): SimpleNamespace(mode=1)}),
        SimpleNamespace(name="mode 3", case_name=None, points={(0,): SimpleNamespace(mode=0)}),
    ]
    monkeypatch.setattr(tables, "least_damped", lambda *_: ((0,), None, 0))
    sweep = SimpleNamespace(trajectories=trajectories, prepared=bare_scenario(title="SG + GFOR"))
    samples = SimpleNamespace(
        result=SimpleNamespace(scenarios=[sweep]),
        axes=["X_L"],
        of=lambda *_: [((k,), found) for k, found in enumerate(figures)],
        setting=lambda place: {"grid.X_L": values[place[0]]},
    )
    table = tables.trajectories(samples)
    assert [[str(cell) for cell in column.cells] for column in table.columns] == [
        ["SG + GFOR: tie", "SG + GFOR: mode 3, damped least"],
        ["0.500 → 0.700"] * 2,
        ["5.00 → 7.00"] * 2,
        ["2.50 at 0.2"] * 2,
        ["9.00 at 0.3"] * 2,
        ["4, named at 3"] * 2,
        ["0.80"] * 2,
    ]


def test_shares_are_shown_in_percent():
    assert plots._percent_of("a")({"states": {"a": 0.25}}) == 25
    assert np.isnan(plots._percent_of("a")({"states": {}}))


def test_a_curve_stands_over_the_last_axis():
    axes = [
        SimpleNamespace(values=[0.0, 1.0], logarithmic=False),
        SimpleNamespace(values=[5.0, 7.0], logarithmic=False),
    ]
    curve = [((1, k), {"named": True, "damping": d}) for k, d in enumerate((40.0, 60.0))]
    axis = Figure().subplots()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "_rows", lambda given: [given])
        plots._draw(axis, SimpleNamespace(axes=axes), curve, lambda sample: sample["damping"])
    assert [(list(line.get_xdata()), list(line.get_ydata())) for line in axis.lines] == [
        ([5.0, 7.0], [40.0, 60.0])
    ] * 2


def test_a_sweep_shows_itself_under_its_own_name(monkeypatch):
    plan = SimpleNamespace(case=SimpleNamespace(name="two_area"), number_of_points=2)
    sweep = ParameterSweep.__new__(ParameterSweep)
    sweep.result = SimpleNamespace(plan=plan, failures=lambda: iter(()), scenarios=[])
    sweep.samples = SimpleNamespace(axes=[SimpleNamespace(key="grid.X_L")])
    monkeypatch.setattr(ParameterSweep, "table", lambda self: pd.DataFrame())
    verdict, name, *_ = sweep._repr_html_().splitlines()
    assert "<b>stable at all points</b>" in verdict
    assert name.startswith("<p><b>ParameterSweep of two_area over grid.X_L</b>")
