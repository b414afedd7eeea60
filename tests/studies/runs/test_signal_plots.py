"""Plots of a case file whose signals the recording leaves out, and what a recording says of its rows."""

import numpy as np
import pytest

from orchestrator.cases.case import BUILT_IN
from orchestrator.cases.form.schema import PlotTable
from orchestrator.core.errors import InputError
from orchestrator.output.results.signals import signal
from orchestrator.studies.runs import mode_plots
from orchestrator.studies.runs.run import run_scenario
from tests.support.scenarios import prepare_one

TEXT = (BUILT_IN / "two_area_rms" / "case.toml").read_text(encoding="utf-8")


def run(tmp_path, solver, stop=0.2):
    path = tmp_path / "case.toml"
    path.write_text(TEXT.replace("[solver]", f"[solver]\n{solver}", 1), encoding="utf-8")
    ready = prepare_one(path, "gfor", stop_time=stop)
    return run_scenario(ready)


def test_a_panel_without_its_signal_says_so_and_a_plot_without_any_is_left_out(
    tmp_path, monkeypatch
):
    result = run(tmp_path, 'record = ["sg1.omega", "sg2.omega"]')
    kept = {}
    monkeypatch.setattr(
        mode_plots, "save_figure", lambda figure, path: kept.setdefault(path.stem, figure)
    )
    drawn, shown = {}, {}
    for table in result.modes.prepared.case.table.plots:
        drawn[table.name] = mode_plots.plot_signals(table, [result], tmp_path / f"{table.name}.png")
        shown[table.name] = [panel.signal for panel in table.panels]
    assert set(kept) == {name for name, whether in drawn.items() if whether}
    assert set(drawn.values()) == {True, False}
    for name, figure in kept.items():
        for axis, expression in zip(figure.axes, shown[name], strict=True):
            assert [t.get_text() for t in axis.texts] == (
                [] if axis.lines else [f"{expression} was not recorded"]
            )
        assert len(figure.legends) == 1
    said = [str(question) for question in result.modes.warnings if "is not shown" in question]
    assert said  # before the run, too


@pytest.mark.parametrize(
    ("chosen", "word"), [("none", "none: every row"), ("low-pass", "low-pass: symmetric FIR")]
)
def test_a_recording_says_what_its_rows_are(tmp_path, chosen, word):
    text = TEXT.replace(
        'record_interval = "5 ms"', f'record_interval = "20 ms"\nrecord_filter = "{chosen}"'
    )
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    ready = prepare_one(path, "gfor", stop_time=0.2)
    dataset = run_scenario(ready).dataset
    assert dataset.attrs["record_filter"].startswith(word)
    assert dataset.attrs["record_interval_s"] == pytest.approx(0.02)
    assert dataset.attrs["record_every_steps"] == 4


def test_a_panel_shows_the_magnitude_of_a_current_beside_its_parts(tmp_path, monkeypatch):
    result = run(tmp_path, 'record = ["gfor.i_re", "gfor.i_im"]')
    recorded = result.dataset
    found = signal(recorded, "|gfor.i|")
    expected = np.hypot(recorded["gfor.i_re"].values, recorded["gfor.i_im"].values)
    assert found.values == pytest.approx(expected, rel=1e-12)
    assert found.attrs["units"] == recorded["gfor.i_re"].attrs["units"]
    kept = {}
    monkeypatch.setattr(
        mode_plots, "save_figure", lambda figure, path: kept.setdefault("figure", figure)
    )
    panel = {"signal": "|gfor.i|", "also": ["gfor.i_re", "gfor.i_im"], "label": "i [pu]"}
    table = PlotTable.model_validate({"name": "i", "title": "I", "panels": [panel]})
    assert mode_plots.plot_signals(table, [result], tmp_path / "i.png")
    (axis,) = kept["figure"].axes
    assert [line.get_label() for line in axis.lines] == ["|gfor.i|", "gfor.i_re", "gfor.i_im"]
    assert axis.lines[0].get_ydata() == pytest.approx(expected)
    assert signal(recorded, "|sg1.i|") is None
    with pytest.raises(InputError, match=r"or '\|component.i\|' for the magnitude"):
        signal(recorded, "a - b - c")
