"""What a certificate prints to compute a point again gives that point's figures to the last digit."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from orchestrator.face.cli import main
from orchestrator.studies.certification import case_file
from orchestrator.studies.certification.bus_frequency import bus_frequency
from orchestrator.studies.certification.point import FREQUENCY, POWER
from tests.support.bindings import GFOR

BOUND = f"""{GFOR}[parameters]
"droop.R_f" = 0.03
"pod_q.enabled" = true
"""


@pytest.fixture
def short(tmp_path, monkeypatch):
    """The norm's study with three seconds of response, to be quick; nothing else of it is changed."""
    text = case_file.BASE.read_text(encoding="utf-8")
    path = tmp_path / "short.toml"
    path.write_text(text.replace('stop_time = "61 s"', 'stop_time = "3 s"'), encoding="utf-8")
    assert path.read_text(encoding="utf-8") != text
    monkeypatch.setattr(case_file, "BASE", path)


def certified(folder, fmu, *arguments, X_L="0.3"):
    """The one point of a certificate."""
    words = [
        "certify",
        str(fmu),
        "--no-check",
        "--workers",
        "1",
        "--reactances",
        X_L,
        "--out",
        str(folder),
    ]
    assert main([*words, *map(str, arguments)]) in (1, 3)
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    (point,) = content["points"]
    assert not any("study failed" in fault for fault in point["faults"])
    return content, point


def run_as_printed(command, capsys):
    """A command of the certificate, with what it prints."""
    words = shlex.split(command)
    assert words[0] == "gfor"
    capsys.readouterr()
    assert main(words[1:]) == 0
    return capsys.readouterr().out


def modes_again(point, scenario, capsys):
    """Eigenvalues by the printed command."""
    found = json.loads(run_as_printed(point["again"][scenario]["modes"], capsys))
    (only,) = found if isinstance(found, list) else found["scenarios"]
    return {complex(m["real"], m["imag"]) for m in only["modes"]}


def stated(modes):
    return {complex(m["real"], m["imag"]) for m in modes}


@pytest.mark.slow
def test_every_kind_of_setting_is_in_the_case_file(tmp_path, short, fmu_path, capsys, monkeypatch):
    """A Boolean by --pod, a real, one with a unit, an integer, and a value of the study."""
    values = {"pod_p.K": "150", "droop.tau_P": "80 ms", "pod_p.N_S": "1", "sg1.machine.H": "4"}
    words = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
    folder = tmp_path / "out"
    content, point = certified(folder, fmu_path("gfor", True), "--pod", "p", *words)
    assert content["verdict"] == "incomplete"
    assert content["departures"] == ["sg1.machine.H = 4.0"]
    monkeypatch.chdir(folder)
    assert stated([*point["modes"], *point["modes_beside"]]) == modes_again(point, "with", capsys)
    assert stated(point["modes_without"]) == modes_again(point, "without", capsys)
    run_as_printed(point["again"]["with"]["response"], capsys)
    again, kept = (
        xr.load_dataset("again/with/trajectory.nc"),
        xr.load_dataset("responses.nc").sel(scenario="with"),
    )
    v = (again[f"grid.bus_2.{part}"].values for part in ("v_re", "v_im"))
    assert content["signal"] == FREQUENCY
    assert np.array_equal(bus_frequency(again.time.values, *v, 50.0), kept[FREQUENCY].values[0])
    for name in (*values, "pod_p.enabled"):  # each of them matters, and is not lost unseen
        text = Path("case.toml").read_text(encoding="utf-8")
        key = name if name.startswith("sg1") else f"converter.{name}"
        less = "\n".join(line for line in text.splitlines() if not line.startswith(f'"{key}" ='))
        assert less.count("\n") < text.count("\n")
        Path("less.toml").write_text(less, encoding="utf-8")
        command = {
            "with": {"modes": point["again"]["with"]["modes"].replace("case.toml", "less.toml")}
        }
        assert modes_again({"again": command}, "with", capsys) != stated(
            [*point["modes"], *point["modes_beside"]]
        )


@pytest.mark.slow
def test_start_values_and_parameters_of_a_binding(tmp_path, short, fmu_path, capsys, monkeypatch):
    binding = tmp_path / "mine.toml"
    binding.write_text(BOUND, encoding="utf-8")
    folder = tmp_path / "out"
    content, point = certified(folder, fmu_path("gfor", True), "--binding", binding, "--pod", "q")
    assert content["pod_source"].startswith("set in the FMU")
    used = {row["name"]: row for row in content["parameters"]}
    assert used["droop.R_f"]["used"] == 0.03
    assert used["droop.R_f"]["changed_by"] == "the binding"
    assert used["P_0"]["used"] == pytest.approx(0.9)
    monkeypatch.chdir(folder)
    assert point["converter_model"]["source"] == "perturbed"
    assert stated([*point["modes"], *point["modes_beside"]]) == modes_again(point, "with", capsys)


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("foreign", [True, False])
def test_a_black_box(tmp_path, short, gallery, fmu_path, capsys, monkeypatch, foreign):
    folder = tmp_path / "out"
    if foreign:
        fmu, binding = gallery("converter_power_si")
        content, point = certified(folder, fmu, "--binding", binding, "--pod", "p")
        assert content["pod_source"].startswith("declared by the applicant")
    else:
        content, point = certified(
            folder, fmu_path("gfor", True), "--black-box", "--set", "pod_p.K=100", "--pod", "p"
        )
        assert content["black_box"]
    assert point["converter_model"]["source"] == "identified"
    assert 0 < point["converter_model"]["fit_error"] < 0.01
    monkeypatch.chdir(folder)
    again = modes_again(point, "with", capsys)
    judged = stated(point["modes"])
    assert judged
    assert judged <= again
    run_as_printed(point["again"]["with"]["response"], capsys)
    kept = xr.load_dataset("responses.nc").sel(scenario="with")
    found = xr.load_dataset("again/with/trajectory.nc")
    v = (found[f"grid.bus_2.{part}"].values for part in ("v_re", "v_im"))
    assert np.array_equal(bus_frequency(found.time.values, *v, 50.0), kept[FREQUENCY].values[0])
    assert np.array_equal(
        found[POWER].values.astype(np.float32), kept[POWER].values[0].astype(np.float32)
    )
