"""``gfor validate``: the forms that have to work, and that a recording of a known plant comes back."""

import json

import pandas as pd
import pytest
import xarray as xr

import orchestrator as gfor_in_python
from orchestrator.core.errors import InputError
from orchestrator.face.api import models
from orchestrator.output.results.comtrade.writing import write_comtrade
from orchestrator.studies.validation.limits import EXAMPLE
from tests.studies.validation.recordings import run, table, waves, with_noise, written

ON = {"pod_p.enabled": True}
STEP = "500 us"
"""Of the device where it is not the subject: as long as a first look has, so that none is made beside it."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return written(with_noise(table(run(stop=3.0))), tmp_path_factory.mktemp("recording"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """One that is long enough for the example's limits of a ring-down."""
    return written(with_noise(table(run())), tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return gfor_in_python.build("gfor", tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="module")
def phasor(tmp_path_factory):
    """Both kinds of file: one with Python in it, and a compiled one."""
    folder = tmp_path_factory.mktemp("phasor")
    return {
        native: gfor_in_python.build("gfor_phasor", folder / str(native), native=native)
        for native in (False, True)
    }


def kinds(found):
    return [q["kind"] for event in found.as_json()["events"] for q in event["questions"]]


def test_the_form_that_must_work(gfor, fmu, recording):
    code, out, _ = gfor(
        "validate", str(fmu), str(recording), "--set", "pod_p.enabled=true", "--json"
    )
    content = json.loads(out)
    assert code == 0
    assert content["verdict"] is None
    (event,) = content["events"]
    assert event["recording"] == str(recording)
    assert [one["name"] for one in event["windows"]] == ["before", "during", "after"]
    for window in event["windows"]:
        for signal in ("p", "q"):
            figures = window[signal]
            assert 0 <= figures["mean_abs_error_pu"] <= figures["max_error_pu"] < 0.02
            assert abs(figures["mean_error_pu"]) <= figures["mean_abs_error_pu"]
    assert event["questions"] == []
    assert event["start"]["p_pu"] == pytest.approx(0.9, abs=1e-3)
    assert event["windows"][1]["begin_s"] == pytest.approx(1.0, abs=0.003)


@pytest.mark.parametrize("native", [False, True])
def test_the_form_works_with_a_phasor_fmu_compiled_or_not(gfor, phasor, recording, native):
    options = ("--set", "pod_p.enabled=true", "--json")
    code, out, _ = gfor("validate", str(phasor[native]), str(recording), *options)
    assert code == 0
    content = json.loads(out)
    assert content["verdict"] is None
    after = content["events"][0]["windows"][2]
    assert after["p"]["max_error_pu"] < 0.003
    assert after["q"]["max_error_pu"] < 0.003


def test_a_machine_is_driven_by_its_own_voltage(gfor, tmp_path):
    bus = {"time": 0.5, "component": "grid", "type": "load_change", "load": "load_7", "scale": 1.1}
    case = gfor_in_python.load("k2a").with_(
        events=[bus], solver={"record": ["*"], "record_interval": "5 ms"}
    )
    ran = case.scenario("no_pss").run(stop=3.0).dataset
    frame = with_noise(table(ran, unit="sg1", bus="grid.bus_1"))
    path = written(frame, tmp_path)
    options = ("--component", "sg1", "--scenario", "no_pss", "--step", "1 ms", "--json")
    code, out, _ = gfor("validate", "k2a", str(path), *options)
    assert code == 0
    (event,) = json.loads(out)["events"]
    assert event["questions"] == []
    after = event["windows"][2]
    assert max(after[signal]["max_error_pu"] for signal in "pq") < 0.005


def in_comtrade(frame, path):
    units = {"v": "kV", "i": "kA"}
    signals = {
        name: ("time", values, {"units": units[name[0]]}) for name, values in waves(frame).items()
    }
    dataset = xr.Dataset(signals, coords={"time": frame.time.to_numpy()})
    return write_comtrade(dataset, list(signals), path)[0]


def test_an_excel_file_gives_the_same_figures(recording, tmp_path):
    frame = pd.read_csv(recording)[::10]
    frame.to_excel(tmp_path / "rec.xlsx", index=False)
    frame.to_csv(tmp_path / "rec.csv", index=False)
    given = {"values": ON, "step": STEP}
    tables = [
        gfor_in_python.validate("gfor", tmp_path / name, **given).table().drop(columns="recording")
        for name in ("rec.csv", "rec.xlsx")
    ]
    pd.testing.assert_frame_equal(*tables)


def test_a_fault_recorders_waves_in_comtrade_agree_with_the_device(gfor, recording, tmp_path):
    waves = in_comtrade(pd.read_csv(recording), tmp_path / "rec.cfg")
    options = ("--set", "pod_p.enabled=true", "--voltage", "230 kV", "--json")
    code, out, _ = gfor("validate", "gfor", str(waves), *options)
    assert code == 0
    (event,) = json.loads(out)["events"]
    assert event["questions"] == []
    assert event["start"]["p_pu"] == pytest.approx(0.9, abs=1e-3)
    assert max(event["windows"][2][signal]["max_error_pu"] for signal in "pq") < 0.006


def test_several_events_stand_in_one_table(recording, tmp_path):
    other = written(with_noise(table(run(stop=3.0, scale=0.95)), 2), tmp_path, "other.csv")
    given = {"values": ON, "step": STEP}
    found = gfor_in_python.validate("gfor", [recording, other], **given).table()
    after = found.query("window == 'after' and signal == 'p'").set_index("recording")
    assert list(after.index) == [str(recording), str(other)]
    assert after["mean_abs_error_pu"].max() < 0.002


def test_the_folder_holds_figures_curves_and_the_page(gfor, whole, tmp_path):
    out = tmp_path / "out"
    options = ("--set", "pod_p.enabled=true", "--limits", str(EXAMPLE), "--out", str(out))
    code, _, _ = gfor("validate", "gfor", str(whole), *options)
    assert code == 0
    assert json.loads((out / "validation.json").read_text())["verdict"] == "met"
    assert len(pd.read_csv(out / "curves_1.csv")) == 6001
    assert not (out / "validation.pdf").exists()
    page = (out / "validation.html").read_text(encoding="utf-8")
    assert "of no standard" in page
    assert "nothing here says that it is met" in page
    assert "during the event</text>" in page
    assert "Without a limit, and not judged: active current before the event" in page


def test_the_device_itself_agrees_and_another_setting_does_not(recording):
    right, wrong = (
        gfor_in_python.validate("gfor", recording, values=ON | values, step=STEP)
        for values in ({}, {"droop.R_f": 0.02})
    )
    error = [
        found.table().query("window == 'after' and signal == 'p'")["mean_abs_error_pu"].item()
        for found in (right, wrong)
    ]
    assert error[0] < 0.002
    assert error[1] > 10 * error[0]


def test_a_run_of_the_same_model_is_too_good():
    found = gfor_in_python.validate("gfor", run(), values=ON, place="gfor")
    assert kinds(found) == ["too good"]
    # the recording's low-pass sees the event a little before it is there
    assert found.table().query("window == 'before'")["max_error_pu"].max() < 2e-5


def test_a_component_of_a_case_is_validated(gfor, whole):
    options = ("--component", "gfor", "--scenario", "pod_p", "--limits", str(EXAMPLE))
    code, out, _ = gfor("validate", "two_area", str(whole), *options)
    assert code == 0
    assert "MET" in out


def test_limits_that_are_not_met_are_named_and_end_with_3(gfor, recording, tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text('source = "mine"\n[windows.after.p]\nmean_abs_error = 0.005\n')
    options = ("--set", "droop.R_f=0.02", "--limits", str(limits), "--step", STEP, "--json")
    code, out, _ = gfor("validate", "gfor", str(recording), *options)
    assert code == 3
    content = json.loads(out)
    assert content["verdict"] == "not met"
    assert [one["name"] for one in content["criteria"]] == ["after p mean_abs_error"]


def test_a_file_of_limits_says_what_is_wrong_with_it(gfor, recording, tmp_path):
    limits = tmp_path / "limits.toml"
    limits.write_text('source = "mine"\n[windows.later.p]\nmax_error = 0.1\n')
    code, _, err = gfor("validate", "gfor", str(recording), "--limits", str(limits))
    assert code == 2
    assert "later" in err


def test_a_model_of_ours_is_known_by_the_catalogue_without_being_built(recording, monkeypatch):
    gfor_in_python.validate("gfor", recording, values=ON)  # its FMU is built now

    def refuse(name, **parts):
        pytest.fail(f"{name} is built, and only its name was asked about")

    monkeypatch.setattr(models, "build_model", refuse)
    assert gfor_in_python.validate("gfor", recording, values=ON).verdict is None
    with pytest.raises(InputError, match="there is no model 'gfr'"):
        gfor_in_python.validate("gfr", recording)
    with pytest.raises(InputError, match=r"built from the \[network\] table"):
        gfor_in_python.validate("grid", recording)


def test_windows_are_as_the_user_says(recording):
    found = gfor_in_python.validate("gfor", recording, values=ON, events=[(2.0, 2.5)]).as_json()
    (event,) = found["events"]
    assert not event["windows_found"]
    assert [(w["begin_s"], w["end_s"]) for w in event["windows"]][1] == pytest.approx((2.0, 2.5))


def test_the_sample_in_which_the_event_begins_is_the_events():
    """A right model, and a recorder of 50 samples a second whose sample at 1 s holds a part of the event."""
    frame = with_noise(table(run(stop=3.0))).iloc[::20].set_index("time")
    given = {"values": ON, "step": STEP, "events": [(1.0, 1.1)]}
    found = gfor_in_python.validate("gfor", frame, **given).table()
    largest = found.groupby("window")["max_error_pu"].max()
    assert largest["before"] < 0.01
    assert largest["during"] > 0.05


def test_columns_that_are_missing_are_asked_for(gfor, tmp_path):
    frame = table(run()).rename(columns={"p_mw": "p_left_mw", "v_pu": "v_pu"})
    path = written(frame, tmp_path)
    code, _, err = gfor("validate", "gfor", str(path))
    assert code == 2
    assert "--channel 'p=COLUMN'" in err
    assert "p_left_mw" in err


def test_the_page_holds_the_fit_and_what_explains_the_error(recording, tmp_path):
    frame = pd.read_csv(recording)[::5].set_index("time")
    values = ON | {"pod_p.K": 60.0}
    found = gfor_in_python.validate(
        "gfor_phasor", frame, values=values, fit="pod_p.K", explain=True, step="1 ms"
    )
    page = found.html()
    assert "Fitted parameters" in page
    assert "The likeliest cause is pod_p.K" in page
    assert "The error with the fitted values" in page


def test_a_page_is_printed_only_where_a_folder_is_given(gfor, recording):
    code, _, err = gfor("validate", "gfor", str(recording), "--pdf")
    assert code == 2
    assert "--out DIR" in err
