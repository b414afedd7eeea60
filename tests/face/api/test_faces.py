"""An object's own face: its truth value, what a notebook shows of it, and what its errors say to Python."""

import ast
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from inspect import signature
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor
from orchestrator.core.options import Option, command
from orchestrator.core.spelling import spelled
from orchestrator.linear.spectra.stability import Stability

ROOT = Path(__file__).parents[3]
OWNERS = (gfor, gfor.Case, gfor.Scenario)


@pytest.fixture(scope="module")
def case():
    return gfor.load("two_area")


@pytest.fixture(scope="module")
def modes(case):
    return case.scenario("base").modes()


def test_a_verdict_is_neither_true_nor_false(modes):
    for judged in (modes, modes.stability, Stability(None)):
        with pytest.raises(TypeError, match=r"ask \.stab"):
            bool(judged)
    for kind in ("Screening", "ParameterSweep", "Interactions", "Run", "Verification", "Nyquist"):
        judged = object.__new__(getattr(gfor, kind))
        with pytest.raises(gfor.CosimError, match=r"neither true nor false.*; ask \.\w+"):
            bool(judged)
        assert hasattr(type(judged), re.match(r"\.(\w+)", judged.ask)[1])


def test_a_sweep_says_whether_all_points_are_stable(case):
    sweep = case.sweep({"grid.X_L": [0.1, 0.2]}, ["base", "gfor"])
    assert sweep.stable is False
    assert case.sweep({"grid.X_L": [0.1, 0.2]}, "gfor").stable is True


def test_a_run_before_its_events_is_not_known(case):
    scenario = case.scenario("gfor")
    with pytest.warns(UserWarning, match="the event at 1 s never happens"):
        run = scenario.run(stop=0.5)
    assert run.stable is None
    assert run.verdict.startswith("not known: the run ends at 0.5 s, before its events")
    assert "--" not in run.verdict
    assert run.summary()["stable"] is None
    assert "not known" in repr(run)
    assert "not known" in run._repr_html_()


def test_a_notebook_shows_one_sentence_of_an_error(case):
    with pytest.raises(gfor.CosimError) as caught:
        case.scenario("pod_p", {"gfor.pod_p.KK": 1.0})
    (shown,) = caught.value._render_traceback_()
    assert shown.startswith(
        "CaseError: values: gfor.pod_p.KK: component 'gfor' has no variable 'pod_p.KK'"
    )
    assert "case.toml" not in shown


def test_a_scenario_shows_names_values_and_units(case):
    (table,) = pd.read_html(StringIO(case.scenario("gfor")._repr_html_()))
    row = table.set_index("name").loc["gfor.S_n"]
    assert (float(row["value"]), row["unit"]) == (1500.0, "MVA")


def test_a_mode_shape_is_drawn(modes):
    pytest.importorskip("matplotlib.pyplot").switch_backend("Agg")
    axes = modes.plot_shape("electromechanical")
    assert axes.name == "polar"
    assert {tip for line in axes.lines for tip in np.abs(line.get_ydata()).round(6)} >= {1.0}
    with pytest.raises(gfor.CosimError, match=r"no modes\[99\]"):
        modes.plot_shape(99)


def test_a_linear_model_goes_to_other_packages_continuous(case):
    scenario = case.scenario("gfor")
    inputs, outputs = ["gfor.droop.delta_P_ref"], ["sg1.omega"]
    model, other = (scenario.linearize(inputs, outputs, continuous=c) for c in (False, True))
    assert model.to_scipy().dt is None
    assert np.array_equal(model.to_scipy().A, other.A)
    assert model.to_scipy(step_map=True).dt == scenario.prepared.step_size
    with pytest.raises(gfor.CosimError, match="the model is continuous"):
        other.to_scipy(step_map=True)


def test_frames_and_arrays_are_recordings():
    times = np.arange(0.0, 10.0, 0.02)
    ring = np.exp(-0.3 * times) * np.cos(2 * np.pi * 0.8 * times)
    frame = pd.DataFrame({"a.b": ring}, index=pd.to_timedelta(times, unit="s"))
    array = frame["a.b"].set_axis(times).rename_axis("time").to_xarray()
    for given in (frame, array, frame.set_axis(times)):
        found = gfor.identify(given, start=0.0).table()
        assert found["frequency_hz"][0] == pytest.approx(0.8, abs=1e-3)
    difference = gfor.compare(frame, array, ["a.b"]).table()["largest_difference"]["a.b"]
    assert difference == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(gfor.CosimError, match="its index is no time"):
        gfor.identify(frame.set_axis(map(str, times)))
    with pytest.raises(gfor.CosimError, match="do not ascend"):
        gfor.identify(frame[::-1])


def test_raw_errors_are_sentences(case):
    for slip, said in (
        (lambda: case.with_({"solver": {}}), "give tables by name"),
        (lambda: case.with_(evnts=[]), "did you mean events"),
        (lambda: case.scenario("pod_p", {"gfor.pod_p.K": pd.NA}), "NA"),
        (lambda: gfor.identify(np.zeros(4)), "a DataFrame or DataArray over the time"),
    ):
        with pytest.raises(gfor.CosimError, match=said):
            slip()


def test_a_table_from_python_looks_beside_the_working_folder(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(gfor.CosimError, match=re.escape(str(tmp_path / "MyPss.fmu"))):
        case.with_(components={"x": {"fmu": "MyPss.fmu"}}).scenario("gfor")


def quoted_commands():
    """Every command that a text of the program quotes as a value, with the file that it stands in."""
    for path in (ROOT / "orchestrator").rglob("*.py"):
        text = path.read_text("utf-8")
        for node in ast.walk(ast.parse(text)) if "command(" in text else ():
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "command":
                words, *options = node.args
                # options of a list are of `gfor new`, which Python does not have
                options = [one for one in options if not isinstance(one, ast.Starred)]
                given = [
                    (Option[one.elts[0].attr], "1")
                    if isinstance(one, ast.Tuple)
                    else Option[one.attr]
                    for one in options
                ]
                yield path.name, command(words.value, *given)


def test_advice_in_python_names_what_exists():
    """Every command that a text quotes is spelt for Python as a call with keywords that there are."""
    calls = [(name, re.fullmatch(r"`(\w+)\((.*)\)`", spelled(c))) for name, c in quoted_commands()]
    wrong = []
    for name, call in calls:
        if call is None:
            continue
        keywords = re.findall(r"(\w+)=", call[2])
        found = [getattr(one, call[1]) for one in OWNERS if hasattr(one, call[1])]
        if not any({*keywords} <= {*signature(one).parameters} for one in found):
            wrong.append(f"{name}: {call[0]}")
    assert not wrong, "\n".join(wrong)
    assert len([call for _, call in calls if call]) > 5


SCRIPT = """
import orchestrator as gfor
{guard}gfor.load("infinite_bus").sweep({{"grid.X_g": [0.1, 0.2]}}, "dip", workers=2)
"""


def test_a_script_without_the_main_guard_is_told_so(tmp_path):
    file = tmp_path / "study.py"
    file.write_text(SCRIPT.format(guard=""), encoding="utf-8")
    done = subprocess.run([sys.executable, file], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    last = done.stderr.strip().splitlines()[-1]
    assert "line 3: this script would run again in each worker" in last
    assert "if __name__ == '__main__':" in last
    assert done.stderr.count("Traceback") == 1


def test_threads_take_turns(case):
    def damping(X_L):
        modes = case.scenario("gfor", {"grid.X_L": X_L}).modes()
        return modes.named["electromechanical"].damping_percent

    reactances = [0.1, 0.15, 0.2, 0.25]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(damping, reactances))
    assert together == [damping(X_L) for X_L in reactances]


def test_labels_of_modes_stay_in_the_frame(case):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    axes = case.scenario("pod_pq").modes().plot(annotate=True)
    axes = case.scenario("base").modes().plot(axes, annotate=True)
    axes.figure.draw_without_rendering()
    frame = axes.get_window_extent()
    labels = [text for text in axes.texts if "Hz" in text.get_text()]
    assert len(labels) > 3
    boxes = [label.get_window_extent() for label in labels]
    assert not any(box.count_overlaps(boxes[:k]) for k, box in enumerate(boxes))
    for label in labels:
        place = label.get_window_extent()
        assert frame.x0 - 1 <= place.x0
        assert place.x1 <= frame.x1 + 1
        assert frame.y0 - 1 <= place.y0
        assert place.y1 <= frame.y1 + 1
    pyplot.close("all")


def test_a_question_about_a_table_is_placed_where_the_caller_stands(case):
    table = pd.DataFrame({"grid.X_L": [0.1, np.nan]}, index=["short", "long"])
    with pytest.warns(UserWarning, match="the case's value is taken at NaN") as asked:
        case.screen(table, scenario="gfor")
    (question,) = [one for one in asked if "at NaN" in str(one.message)]
    assert question.filename == __file__


def test_a_screening_says_where_its_points_stand(case):
    screening = case.screen(
        {"short": {"grid.X_L": 0.1}, "long": {"grid.X_L": 0.3}}, scenario="gfor"
    )
    assert "all points stand in items()" in repr(screening)
    assert len(screening.items()) == 2


def test_the_commands_word_for_a_folder_is_answered_by_pythons():
    with pytest.raises(
        gfor.CosimError, match=r"build cannot be asked for 'dest', but for .*folder"
    ):
        gfor.build("infinite_bus", dest="somewhere")


def test_a_notebook_shows_the_matrices_of_a_linear_model(case):
    model = case.scenario("gfor").linearize(["gfor.droop.delta_P_ref"], ["sg1.omega"])
    shown = model._repr_html_()
    assert f"{len(model.states)} states, 1 inputs, 1 outputs" in shown
    assert model.stability.sentence()[:20] in shown
    states, D = pd.read_html(StringIO(shown), index_col=0)
    assert [*states.columns] == ["B: gfor.droop.delta_P_ref", "C: sg1.omega"]
    first = model.states[0]
    for matrix, column in ((model.B, "B: gfor.droop.delta_P_ref"), (model.C.T, "C: sg1.omega")):
        assert float(states.loc[first, column]) == pytest.approx(matrix[0, 0], rel=1e-4)
    assert D.shape == (1, 1)
