"""Cases, points and bindings as Python has them, what was saved, and models for control design."""

import hashlib
import json
import sys
import tomllib
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor
from orchestrator.cases.case import BUILT_IN
from orchestrator.cases.form.given import path_of_given
from orchestrator.core.errors import CaseError, InputError

pytestmark = pytest.mark.usefixtures("undrawn")


@pytest.fixture(scope="module")
def case():
    return gfor.load("infinite_bus")


def test_a_case_is_loaded_from_tables_and_from_text(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = case.file.text
    for given in (text, tomllib.loads(text)):
        found = gfor.load(given)
        assert found.scenarios == case.scenarios
        assert found.file.directory == tmp_path
    with pytest.raises(InputError, match=r"case: .*give what TOML has"):
        gfor.load({"name": object()})


def test_changes_join_tables_and_leave_the_case(case):
    changed = case.with_(solver={"stop_time": "3 s"}, scenarios={"dip": None})
    assert changed.scenarios == ("load_step",)
    assert changed.scenario().prepared.stop_time == 3.0
    assert changed.scenario().prepared.step_size == case.scenario("dip").prepared.step_size
    assert changed.file.directory == case.file.directory
    assert case.scenarios == ("dip", "load_step")


def test_points_are_tables_and_mappings():
    case = gfor.load("two_area_rms")
    frame = pd.DataFrame({"name": ["short", "long"], "grid.X_L": [0.1, 0.2]})
    rows = {"short": {"grid.X_L": 0.1}, "long": {"grid.X_L": 0.2}}
    of_frame, of_rows = (
        case.screen(points, scenario="gfor", outages="units") for points in (frame, rows)
    )
    assert of_frame.items().equals(of_rows.items())
    assert of_frame.items()["point"].unique().tolist() == ["short", "long"]
    table = of_frame.table()
    assert table.index.is_unique
    assert table["least_damping_percent"].dropna().is_monotonic_increasing
    with pytest.raises(InputError, match=r"points: column 'grid\.X_l'"):
        case.screen({"short": {"grid.X_l": 0.1}}, scenario="gfor")


def test_a_gap_in_a_table_of_points_is_asked_about():
    with pytest.warns(
        UserWarning, match="question: points: load: the case's value is taken at NaN"
    ):
        path_of_given(
            pd.DataFrame({"load": [np.nan, 0.9], "hours": [1.0, 2.0]}), "points.csv", "points"
        )


def test_a_point_without_values_is_the_case_as_it_is():
    case = gfor.load("two_area_rms")
    items = case.screen({"usual": {}, "long": {"grid.X_L": 0.2}}, scenario="gfor").items()
    assert items["point"].tolist() == ["usual", "long"]
    # its name is what was given
    assert case.screen({7: {}}, scenario="gfor").items()["point"].tolist() == [7]


def test_a_binding_is_a_mapping(tmp_path):
    fmu = gfor.build("gfor", tmp_path)
    binding = tomllib.loads(gfor.bind(fmu))
    with pytest.raises(gfor.CosimError, match=r"binding: 2 problems"):
        gfor.open_fmu(fmu, binding=binding | {"voltage": {}})


@pytest.fixture(scope="module")
def modes():
    return gfor.load("two_area_rms").scenario("gfor").modes()


def test_what_was_saved_is_opened(case, modes, tmp_path):
    modes.save(tmp_path / "dip")
    saved = gfor.open(tmp_path / "dip")
    assert {"date", "made_by", "code", "command"} <= saved.provenance.keys()
    assert saved["modes.json"]["scenarios"][0]["name"] == "gfor"
    assert saved["modes.csv"]["frequency [Hz]"].size == len(modes)
    with pytest.raises(InputError, match=r"holds no 'modes\.nc'; it holds: .*modes\.csv"):
        saved["modes.nc"]
    case.scenario("dip").modes().save(tmp_path / "none")
    assert gfor.open(tmp_path / "none")["modes.csv"].empty
    with pytest.raises(InputError, match="there are no results"):
        gfor.open(tmp_path / "x")
    (tmp_path / "dip" / "modes.csv").write_text("changed")
    with pytest.raises(InputError):
        saved["modes.csv"]


def test_a_recording_says_what_it_was_computed_from(tmp_path):
    (tmp_path / "own.txt").write_text("1")
    text = (
        '# from "own.txt", not from "gone.txt"\n'
        + (BUILT_IN / "infinite_bus" / "case.toml").read_text()
    )
    (tmp_path / "own.toml").write_text(text)
    run = gfor.load(tmp_path / "own.toml").scenario("dip").run(stop=1e-3)
    run.save(tmp_path / "out")
    said = gfor.open(tmp_path / "out")["dip/trajectory.nc"].attrs
    assert said["date"].endswith(" UTC")
    assert len(said["code"]) == len(said["inputs"].split('"')[3]) == 64
    inputs = json.loads(said["inputs"])
    assert inputs["own.txt"] == hashlib.sha256(b"1").hexdigest()
    assert {"own.toml", "gfor.fmu"} <= inputs.keys()
    assert "gone.txt" not in inputs


def test_all_eigenvalues_and_the_map_in_one_unit(modes):
    assert len(modes.eigenvalues) == modes.stability.eigenvalues - modes.stability.zeros
    assert modes.eigenvalues[0].real == pytest.approx(modes.stability.largest_growth_rate, rel=1e-6)
    assert all(
        np.abs(modes.eigenvalues - mode.eigenvalue).min() < 1e-6 * abs(mode.eigenvalue)
        for mode in modes
    )
    axes = modes.plot(radians=True)
    assert axes.get_ylabel() == "Imaginary part [rad/s]"
    points = next(c for c in axes.collections if len(c.get_offsets()))
    assert list(points.get_offsets()[0]) == pytest.approx(
        [modes[0].eigenvalue.real, modes[0].eigenvalue.imag]
    )


def test_linear_models_go_to_scipy_and_control(case, monkeypatch):
    scenario, inputs = case.scenario("load_step"), ["gfor.droop.delta_P_ref"]
    parts = scenario.linearize(inputs, ["gfor.omega", "gfor.p"], continuous=True)
    both = scenario.linearize(inputs, ["gfor.p - gfor.omega", "gfor.p"], continuous=True)
    assert both.outputs == ("gfor.p - gfor.omega", "gfor.p")
    np.testing.assert_allclose(both.C, [parts.C[1] - parts.C[0], parts.C[1]], rtol=1e-9, atol=1e-12)
    with pytest.raises(InputError, match="a magnitude is not linear"):
        scenario.linearize(inputs, ["|gfor.i|"])
    assert np.array_equal(both.to_scipy().A, both.A)
    assert scenario.linearize(inputs, ["gfor.p"]).to_scipy().dt is None
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(InputError, match="pip install control"):
        both.to_control()
    monkeypatch.setitem(
        sys.modules, "control", SimpleNamespace(ss=lambda *a, **names: (a[4], names))
    )
    step, names = both.to_control()
    assert (step, names["inputs"]) == (0, ["gfor_droop_delta_P_ref"])
    assert names["outputs"] == ["gfor_p_gfor_omega", "gfor_p"]


def test_what_was_given_as_tables_is_named_as_it_was_given(case):
    with pytest.raises(CaseError) as refused:
        case.with_(solver={"stop_tim": 3}).scenario("dip")
    assert (
        str(refused.value)
        == "case: 1 problem\n  - solver.stop_tim: this key is unknown; did you mean stop_time?"
    )
    with pytest.raises(CaseError, match="case: 3 problems\n  - line 2, foo: this key"):
        gfor.load('name = "x"\nfoo = 3\n[components.g]\nmodel = "gfor"\n').scenario()
    with pytest.raises(InputError, match="points, row 2: load = -1"):
        gfor.load("wscc9").screen(pd.DataFrame({"load": [1.0, -1.0]}))
