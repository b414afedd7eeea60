"""The command ``gfor`` as a user meets it: what it prints, writes and returns."""

import csv
import json
import re
import shlex
import subprocess
import sys
import zipfile
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO

import fmpy
import numpy as np
import pytest
import xarray as xr

from orchestrator.cases.case import load_case
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.sandbox import wine
from orchestrator.face.cli import COMMANDS, GROUPS, OLD, QUESTIONS, _command_in, _parser, main
from tests.support.once import made_once
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu


@pytest.fixture
def refused(gfor):
    """Run a command that cannot be carried out: exit code 2, nothing printed, one error."""

    def run(*arguments):
        code, out, err = gfor(*arguments)
        assert (code, out) == (2, ""), err
        assert err.count("error:") == 1
        assert "Traceback" not in err
        return err

    return run


# -- help ------------------------------------------------------------------------------------------


def test_help_opens_with_the_newcomers_page_and_lists_all(gfor):
    code, out, _ = gfor("--help")
    assert code == 0
    assert out.startswith(QUESTIONS)
    assert {line.split()[0] for line in out.splitlines() if re.match(r" {4}\w", line)} == {
        name.split()[0] for name in COMMANDS
    }


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_alone_lists_its_commands(gfor, group):
    code, out, err = gfor(group)
    assert (code, err) == (0, "")
    listed = {
        f"{group} {line.split()[0]}" for line in out.splitlines() if re.match(r" {4}\w", line)
    }
    assert listed == {name for name in COMMANDS if name.startswith(f"{group} ")}


@pytest.mark.parametrize("old", OLD)
def test_an_old_spelling_is_the_same_command_with_a_note(gfor, old):
    """Help of both, but for the note, which is not on standard output."""
    words = OLD[old].split()
    command = [words[0]] if words[-1].startswith("--") else words
    code, out, err = gfor(old, "--help")
    assert (code, out, err) == (
        *gfor(*command, "--help")[:2],
        f"note: gfor {old} is now gfor {OLD[old]}; the old spelling works until 1.0\n",
    )


def test_an_old_spelling_gives_the_same_json(gfor, fmu_path):
    path = fmu_path("infinite_bus")
    code, out, err = gfor(*["info", path, "--json"])
    assert (code, err.count("\n")) == (0, 1)
    assert (0, out, "") == gfor("fmu", "info", path, "--json")


def test_a_wrong_name_in_a_group_names_what_is_there(refused):
    assert "invalid choice: 'inf' (choose from 'info', 'bind'" in refused("fmu", "inf", "x.fmu")


def test_what_is_of_one_black_box_needs_its_name(refused):
    case = ("modes", "two_area")
    assert "give --black-box as well" in refused(*case, "--component", "gfor")
    assert "--method is for a black box" in refused(*case, "--black-box", "--method", "pulse")
    assert "--details does not go with --component" in refused(
        *case, "--black-box", "--component", "gfor", "--details"
    )


def test_alone_it_answers_a_newcomers_questions_with_lines_that_parse(gfor):
    code, out, err = gfor()
    assert (code, err) == (0, "")
    lines = [
        re.split(r" {2,}", line.strip())[0]
        for line in out.splitlines()
        if line.startswith("  gfor ")
    ]
    assert out.count("?\n") >= 4
    assert len(lines) >= 15
    assert len(out.splitlines()) <= 38  # fits a window of 40 lines
    assert max(map(len, out.splitlines())) <= 100
    for line in lines:
        words = shlex.split(line)[1:]
        _parser({_command_in(words)}).parse_args(words)
    named = {name for name in COMMANDS if re.search(rf"\b{name.split()[-1]}\b", out)}
    assert named == set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(gfor, command):
    code, out, _ = gfor(*command.split(), "--help")
    assert code == 0
    assert out.startswith(f"usage: gfor {command}")


def test_as_a_module_in_a_process_of_its_own():
    done = subprocess.run(
        [sys.executable, "-m", "orchestrator.face.cli", "fmu", "info", "none.fmu"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: none.fmu: there is no such file; give the path of an .fmu\n"


# -- modes -----------------------------------------------------------------------------------------


def modes_of(gfor, *arguments):
    code, out, _ = gfor("modes", "two_area", "--json", *arguments)
    assert code == 0
    return json.loads(out)


def test_modes_as_json(gfor):
    content = modes_of(gfor, "--scenario", "gfor")
    assert content["case"] == "two_area"
    assert content["step_size_s"] == pytest.approx(1e-4)
    (scenario,) = content["scenarios"]
    assert scenario["name"] == "gfor"
    assert 0 <= scenario["residual"] <= 1e-9
    assert scenario["states"] == 62
    modes = scenario["modes"]
    assert len(modes) >= 3
    dampings = [mode["damping_percent"] for mode in modes]
    assert dampings == sorted(dampings)
    for mode in modes:
        eigenvalue = complex(mode["real"], mode["imag"])
        assert eigenvalue.imag >= 0
        assert 0.1 <= mode["frequency_hz"] <= 2.0
        assert mode["frequency_hz"] == pytest.approx(eigenvalue.imag / 2 / np.pi)
        assert mode["damping_percent"] == pytest.approx(-100 * eigenvalue.real / abs(eigenvalue))
        factors = [entry["factor"] for entry in mode["participation"]]
        assert factors == sorted(factors, reverse=True)
        assert 0.9 < sum(factors) < 1.0001
        assert all(
            entry["state"].split(".")[0] in ("gfor", "sg1", "sg2", "grid")
            for entry in mode["participation"]
        )
    (electromechanical,) = [mode for mode in modes if mode["name"] == "electromechanical"]
    assert electromechanical["frequency_hz"] == pytest.approx(0.58, abs=0.02)
    assert electromechanical["participation"][0]["state"] == "sg1.machine.omega"


def test_a_range_of_frequencies(gfor):
    (narrow,) = modes_of(gfor, "--scenario", "gfor", "--range", "0.5:0.7")["scenarios"]
    (wide,) = modes_of(gfor, "--scenario", "gfor", "--range", "0.5:60")["scenarios"]
    assert [mode["frequency_hz"] for mode in narrow["modes"]] == pytest.approx([0.58], abs=0.02)
    assert len(wide["modes"]) > 3
    assert all(0.5 <= mode["frequency_hz"] <= 60 for mode in wide["modes"])
    assert max(mode["frequency_hz"] for mode in wide["modes"]) > 40


def test_modes_as_a_table_with_overrides_and_a_step(gfor):
    code, out, err = gfor(
        *("modes", "two_area", "--scenario", "base", "--set", "grid.X_L=0.3", "--step", "200 us"),
        "--details",
    )
    assert (code, err) == (0, "")
    assert "Base (only SG): 35 states" in out
    assert "sg1.machine.omega" in out
    assert "paper" not in out  # its figures hold for X_L = 0.1 only
    json_modes = modes_of(gfor, "--scenario", "base", "--set", "grid.X_L=0.3", "--step", "200 us")
    assert json_modes["step_size_s"] == pytest.approx(2e-4)
    for mode in json_modes["scenarios"][0]["modes"]:
        assert f"{mode['real']:+.4f} ± j{mode['imag']:.4f}" in out


# -- arguments that cannot be used -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ["--set", "X_L"],
            "argument --set: 'X_L' is not of the form component.parameter=value, such as grid.X_L=0.2",
        ),
        (
            ["--set", "X_L=3"],
            "argument --set: 'X_L=3' is not of the form component.parameter=value",
        ),
        (["--set", "grid.X_L="], "argument --set: 'grid.X_L=' is not of the form"),
        (
            ["--set", "grid.X_M=1"],
            "--set grid.X_M: component 'grid' has no variable 'X_M'; did you mean X_L",
        ),
        (
            ["--set", "net.X_L=1"],
            "--set net.X_L: there is no component 'net'; the case has: gfor, sg1, sg2, grid",
        ),
        (["--set", "grid.X_L=1 MW"], "--set grid.X_L: X_L: '1 MW' is in MW, but pu is needed"),
        (["--set", "grid.X_L=-1"], "--set grid.X_L: X_L = -1 pu; it must be at least 1e-05 pu"),
        (["--set", "grid.X_L=true"], "--set grid.X_L: X_L = true; it must be a number"),
        (
            ["--set", "gfor.pod_p.enabled=2"],
            "--set gfor.pod_p.enabled: pod_p.enabled = 2; it must be true or false",
        ),
        (
            ["--set", "sg1.omega=1"],
            "--set sg1.omega: omega is of causality output; only parameters and inputs",
        ),
        (
            ["--range", "2:1"],
            "argument --range: '2:1' is not a range; write LO:HI in Hz with 0 ≤ LO < HI, such as",
        ),
        (["--range", "1"], "argument --range: '1' is not a range"),
        (["--range", "a:b"], "argument --range: 'a:b' is not a range"),
        (["--range", "nan:1"], "argument --range: 'nan:1' is not a range"),
        (["--step", "0"], "argument --step: '0' must exceed 0"),
        (["--step", "1 MW"], "argument --step: '1 MW' is in MW, but s is needed"),
        (
            ["--step", "0.3 ms"],
            "is not a communication point; with steps of 0.0003 s the nearest is",
        ),
        (
            ["--scenario", "none"],
            "there is no scenario 'none'; the case has: base, gfor, pod_p, pod_q, pod_pq",
        ),
        (["--frequency", "1"], "unrecognized arguments: --frequency 1"),
        (["--outages", "n-1"], "--outages is an option of"),
    ],
)
def test_an_argument_that_cannot_be_used(refused, arguments, words):
    assert words in refused("modes", "two_area", "--scenario", "gfor", *arguments)


@pytest.mark.parametrize("arguments", [["run", "--stop", "inf"], ["modes", "--step", "inf"]])
def test_an_infinite_time(refused, arguments):
    command, *options = arguments
    refused(command, "two_area", "--scenario", "gfor", *options)


def test_a_folder_that_cannot_be_written(refused, tmp_path):
    (tmp_path / "file").touch()
    case = small_case(tmp_path, "")
    assert str(tmp_path / "file") in refused("run", case, "--out", tmp_path / "file" / "inside")


def test_an_unknown_case(refused, tmp_path):
    assert (
        "error: none: there is no such file, nor a built-in case of that name; built-in: "
        in refused("modes", "none")
    )
    assert "none.toml: there is no such file" in refused("run", tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["mode", "kundur"], "there is no command 'mode'; did you mean modes?"),
        (["modes", "kundor"], "; did you mean kundur? built-in: "),
        (
            ["modes", "kundur", "--scenario", "gfr"],
            "'gfr'; did you mean gfor or tgr? the case has: ",
        ),
    ],
)
def test_a_mistyped_name_is_answered_with_the_near_one(refused, words, hint):
    assert hint in refused(*words)


def test_an_unknown_command(refused):
    assert "invalid choice: 'simulate'" in refused("simulate")


def test_square_brackets_of_the_user_are_shown_as_they_are(refused):
    assert "'[red]x[/red]' is not a number with a unit" in refused(
        "modes", "two_area", "--set", "grid.X_L=[red]x[/red]"
    )


# -- build and info --------------------------------------------------------------------------------


def test_build_writes_an_fmu_that_info_reads(gfor, tmp_path):
    code, out, err = gfor("fmu", "build", "gfor", "--dest", tmp_path / "new")
    assert code == 0
    assert err.startswith("gfor: building, Python-backed (1 of 1)")
    assert out == f"{tmp_path / 'new' / 'gfor.fmu'}\n"
    description = read_description(tmp_path / "new" / "gfor.fmu")

    code, out, err = gfor("fmu", "info", tmp_path / "new" / "gfor.fmu")
    assert (code, err) == (0, "")
    assert description.guid in out
    assert description.title in out
    assert f"continuous states: {len(description.states)} (settable by a master)" in out
    assert fmpy.platform in out
    for causality in ("inputs", "outputs", "parameters"):
        names = getattr(description, causality)
        assert f"{causality.removesuffix('s')} ({len(names)})" in out
        assert all(name in out for name in names)
    assert re.search(r"pod_p\.K\s.*200.*0…100000.*tunable", out)


def test_build_of_an_unknown_model_builds_nothing(refused, tmp_path):
    err = refused("fmu", "build", "gfor", "gfro", "--dest", tmp_path / "new")
    assert "there is no model 'gfro'; there are: cstatt_phasor, csvgn1_phasor, " in err
    assert not (tmp_path / "new").exists()


def test_build_without_a_name_lists_the_models_and_builds_nothing(refused, tmp_path):
    err = refused("fmu", "build", "--native", "--dest", tmp_path / "new")
    assert (
        "no model is named, and nothing is built; name one of cstatt_phasor, csvgn1_phasor" in err
    )
    assert "--all" in err
    assert not (tmp_path / "new").exists()
    assert "leave it out, or the name gfor" in refused("fmu", "build", "gfor", "--all")


def test_build_says_how_a_folder_is_given(refused):
    assert "write gfor fmu build gfor --dest b" in refused("fmu", "build", "gfor", "b")


def test_build_of_a_model_that_needs_a_network(refused, tmp_path):
    err = refused("fmu", "build", "grid", "--dest", tmp_path)
    assert "model 'grid' is built from the [network] table of a case file" in err


def test_build_for_an_unknown_platform(refused, tmp_path):
    assert "invalid choice: 'amiga'" in refused(
        "fmu", "build", "gfor", "--dest", tmp_path, "--platform", "amiga"
    )


@pytest.fixture
def damaged(tmp_path):
    """Write an FMU with a changed model description or without some files."""

    def write(change=lambda text: text, keep=lambda name: True):
        path = tmp_path / "damaged.fmu"
        with zipfile.ZipFile(small_fmu("gain").path) as good, zipfile.ZipFile(path, "w") as bad:
            for name in filter(keep, good.namelist()):
                content = good.read(name)
                bad.writestr(
                    name, change(content.decode()) if name == "modelDescription.xml" else content
                )
        return path

    return write


def test_info_on_a_file_that_is_not_an_archive(refused, tmp_path):
    (tmp_path / "text.fmu").write_text("text")
    assert "it is not an FMU: an .fmu is a zip archive and this file is not" in refused(
        "fmu", "info", tmp_path / "text.fmu"
    )


def test_info_on_an_archive_without_a_model_description(refused, damaged):
    path = damaged(keep=lambda name: name != "modelDescription.xml")
    assert "damaged.fmu: the archive has no modelDescription.xml at its top" in refused(
        "fmu", "info", path
    )


def test_info_on_another_fmi_version(refused, damaged):
    path = damaged(lambda text: text.replace('fmiVersion="2.0"', 'fmiVersion="1.0"'))
    assert "it is an FMU of FMI 1.0; this master runs co-simulation of FMI 2.0 and 3.0" in refused(
        "fmu", "info", path
    )


def test_info_on_model_exchange_only(refused, damaged):
    exchange = '<ModelExchange modelIdentifier="small_gain" />'
    path = damaged(lambda text: re.sub(r"<CoSimulation .*?/>", exchange, text, flags=re.DOTALL))
    assert (
        "it is not an FMU for co-simulation (for Model Exchange only), which this master needs"
        in refused("fmu", "info", path)
    )


def test_info_on_an_fmu_for_other_platforms(gfor, damaged, monkeypatch, tmp_path):
    """A vendor's FMU for Windows alone can be looked at and bound, and without Wine not be checked."""

    def missing():
        raise wine.NoWineError(wine.MISSING)

    monkeypatch.setattr(wine, "find_wine", missing)
    path = damaged(keep=lambda name: not name.startswith(f"binaries/{fmpy.platform}/"))
    code, out, _ = gfor("fmu", "info", path)
    assert code == 0
    assert f"It cannot run here: it has no binary for this platform ({fmpy.platform})" in " ".join(
        out.split()
    )
    code, _, err = gfor("fmu", "bind", path, "--out", tmp_path / "own.toml")
    assert code == 0, err
    code, out, _ = gfor("fmu", "check", path)
    assert code == 2
    assert f"it has no binary for this platform ({fmpy.platform}), only for: win64" in " ".join(
        out.split()
    )


# -- run -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def results():
    """Folder and printed text of a short run of the two-area case."""

    def run(folder):
        command = ["run", "two_area", "--stop", "0.2", "--scenario", "pod_p", "--out", "results"]
        printed, said = StringIO(), StringIO()
        with chdir(folder), redirect_stdout(printed), redirect_stderr(said):
            assert main(command) == 0
        assert "the event at 1 s never happens, as the run stops at 0.2 s" in said.getvalue()
        (folder / "printed.txt").write_text(printed.getvalue(), encoding="utf-8")

    folder = made_once("run_of_commands", run)
    return folder / "results", (folder / "printed.txt").read_text(encoding="utf-8")


def test_the_trajectory_has_units_and_says_where_it_comes_from(results):
    with xr.open_dataset(results[0] / "pod_p" / "trajectory.nc") as data:
        assert data["time"].values == pytest.approx(np.arange(41) * 0.005)
        assert data["time"].attrs["units"] == "s"
        assert data["sg1.delta"].attrs["units"] == "rad"
        assert data["gfor.p"].attrs["units"] == "pu"
        assert data["gfor.p"].attrs["long_name"].startswith("gfor: ")
        assert np.abs(data["gfor.p"].values - 0.9).max() < 1e-6  # nothing happens before 1 s
        attributes = data.attrs
    assert (attributes["case"], attributes["scenario"]) == ("two_area", "pod_p")
    assert attributes["step_size_s"] == pytest.approx(1e-4)
    assert attributes["schedule"] == "gauss-seidel: gfor, sg1, sg2 | grid"
    assert attributes["case_file"] == load_case("two_area").text
    assert json.loads(attributes["values"])["gfor.pod_p.enabled"] is True
    fmus = json.loads(attributes["fmus"])
    ready = prepare_one("two_area", "pod_p")
    assert {name: fmu["guid"] for name, fmu in fmus.items()} == {
        name: plan.description.guid for name, plan in ready.system.components.items()
    }
    assert set(json.loads(attributes["versions"])) >= {"gfor-cosim", "numpy", "fmpy"}


def test_the_csv_has_the_same_numbers_under_names_with_units(results):
    with (results[0] / "pod_p" / "trajectory.csv").open(encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    table = np.array(rows, float)
    with xr.open_dataset(results[0] / "pod_p" / "trajectory.nc") as data:
        names = list(data.data_vars)
        assert header == ["time [s]", *(f"{name} [{data[name].attrs['units']}]" for name in names)]
        whole = np.column_stack([data["time"].values, *(data[name].values for name in names)])
    assert table == pytest.approx(whole, rel=1e-9, abs=1e-12)


def test_plots_tables_and_the_case_itself_are_left_in_the_folder(results):
    folder, printed = results
    for name in ("frequency_difference", "gfor_power", "pod_signals", "eigenvalues"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert f"{name}.png" in printed
    assert (folder / "case.toml").read_text(encoding="utf-8") == load_case("two_area").text
    with (folder / "step_size.csv").open(encoding="utf-8") as file:
        assert {row["schedule"] for row in csv.DictReader(file)} == {"gauss-seidel", "jacobi"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--threads", "0"), "'0' is not a whole number from 1 to 64"),
        (("--threads", "65"), "'65' is not a whole number from 1 to 64"),
        (
            ("--threads", "2", "--like", "libcosim"),
            "--like steps as another master does, on one thread",
        ),
    ],
)
def test_threads_that_cannot_be_had_are_refused(gfor, words, said):
    code, _, error = gfor("run", "two_area", *words)
    assert code == 2
    assert said in " ".join(error.split())


@pytest.mark.slow
def test_summary_and_tables_show_the_same_mode(results):
    folder, printed = results
    (scenario,) = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    assert (scenario["name"], scenario["states"], scenario["failure"]) == ("pod_p", 62, None)
    assert scenario["residual"] <= 1e-9
    assert 0 < scenario["share_in_fmus"] <= 1
    assert scenario["steps_per_second"] > 100
    assert scenario["real_time_factor"] == pytest.approx(
        scenario["steps_per_second"] * scenario["step_size_s"]
    )
    assert scenario["threads"] == 1
    assert "times as fast as real time" in " ".join(printed.split())
    assert "(Python-backed); with --native several threads can." in " ".join(printed.split())
    mode = scenario["modes"]["electromechanical"]
    assert f"{mode['real']:+.4f} ± j{mode['imag']:.4f}" in printed
    with (folder / "modes.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    (row,) = [row for row in rows if row["name"] == "electromechanical"]
    assert float(row["real [1/s]"]) == pytest.approx(mode["real"])
    assert (folder / "pod_p" / "modes.csv").read_text() == (folder / "modes.csv").read_text()


def small_case(folder, event):
    """A component at rest that an event may set off."""
    path = folder / "small.toml"
    path.write_text(
        f"""\
name = "small"
[solver]
step_size = "1 ms"
stop_time = "0.3 s"
record_interval = "5 ms"
[components.burst]
fmu = '{small_fmu("blow_up").path}'
inputs = {{ u = 0 }}
[[plots]]
name = "burst"
title = "The state"
panels = [{{ signal = "burst.y", label = "x" }}]
{event}
[scenarios.one]
[scenarios.two]
"""
    )
    return path


KICK = '[[events]]\ntype = "parameter_change"\ntime = 0.05\ncomponent = "burst"\nparameter = "u"\nvalue = 100'


def test_a_component_that_fails_in_the_middle(gfor, tmp_path):
    """ẋ = x² + 100 from 50 ms on: x = 10·tan(10·(t − 50 ms)), infinite at 207 ms."""
    folder = tmp_path / "out"
    code, out, err = gfor("run", small_case(tmp_path, KICK), "--workers", 1, "--out", folder)
    assert code == 1
    assert "Traceback" not in out + err
    found = re.search(
        r"error: scenario 'one': component 'burst' at t = (\S+) s: fmi2DoStep returned \w+: (.*)",
        err,
    )
    assert float(found.group(1)) == pytest.approx(0.05 + np.pi / 20, abs=2e-3)
    assert "burst: state x is no longer finite" in found.group(2)
    assert f"What was computed until then is in {folder}" in err
    with xr.open_dataset(folder / "one" / "trajectory.nc") as data:
        time, x = data["time"].values, data["burst.y"].values
    assert time[0] == 0
    assert time[-1] == pytest.approx(0.205)
    assert (x[time <= 0.05] == 0).all()
    middle = (time > 0.05) & (time < 0.18)
    assert x[middle] == pytest.approx(10 * np.tan(10 * (time[middle] - 0.05)), rel=1e-6)
    (scenario,) = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["scenarios"]
    assert "component 'burst' at t = " in scenario["failure"]
    assert (folder / "burst.png").exists()
    assert (folder / "one" / "trajectory.csv").exists()
    assert not (folder / "two").exists()


def test_the_summary_as_json_is_all_that_is_printed(gfor, tmp_path):
    code, out, err = gfor(
        "run", small_case(tmp_path, ""), "--json", "--out", tmp_path / "out", "--stop", "20 ms"
    )
    assert (code, err) == (0, "")
    summary = json.loads(out)
    assert [scenario["name"] for scenario in summary] == ["one", "two"]
    assert (
        json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["scenarios"]
        == summary
    )


def test_without_a_folder_results_go_below_the_current_one(gfor, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, _ = gfor("run", small_case(tmp_path, ""), "--scenario", "two", "--stop", "20 ms")
    assert code == 0
    assert "Results in results/small: " in out
    assert (tmp_path / "results" / "small" / "two" / "trajectory.nc").exists()


def test_modes_leaves_participation_shapes_and_plots(gfor, tmp_path):
    folder = tmp_path / "modes"
    code, out, _ = gfor(
        "modes", "two_area", "--scenario", "base", "--scenario", "pod_p", "--out", folder
    )
    assert code == 0
    assert "area_1" in out
    for name in ("eigenvalues.png", "participation.png", "mode_shapes.png"):
        assert (folder / name).stat().st_size > 5_000
    with (folder / "participation.csv").open(encoding="utf-8") as file:
        rows = [
            r
            for r in csv.DictReader(file)
            if r["scenario"] == "base" and r["name"] == "electromechanical"
        ]
    by = {
        kind: {r["element"]: float(r["participation"]) for r in rows if r["of"] == kind}
        for kind in ("component", "area")
    }
    assert by["component"]["sg1"] > by["component"]["sg2"] > 0.2
    assert by["area"]["area_1"] == pytest.approx(by["component"]["sg1"], rel=1e-5)
    with (folder / "mode_shapes.csv").open(encoding="utf-8") as file:
        shape = {
            r["state"]: r for r in csv.DictReader(file) if r["scenario"] == "base" and r["name"]
        }
    assert float(shape["sg1.machine.omega"]["magnitude"]) == 1
    assert abs(float(shape["sg2.machine.omega"]["angle [deg]"])) > 150


def test_critical_modes_alone(gfor):
    code, out, _ = gfor(
        "modes",
        "two_area",
        "--scenario",
        "gfor",
        "--scenario",
        "pod_p",
        "--critical",
        "15",
        "--json",
    )
    assert code == 0
    with_pod_off, with_pod_on = json.loads(out)["scenarios"]
    (mode,) = with_pod_off["modes"]
    assert mode["damping_percent"] == pytest.approx(10.6, abs=0.1)
    assert max(mode["components"], key=mode["components"].get) == "sg1"
    assert with_pod_on["modes"] == []


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--critical", "120"), "between 0 and 90"),
        (("--critical", "0.1"), "read in percent; write 10 for a ratio of 0.1"),
        (("--critical", "--range", "0:2"), "begin above 0"),
    ],
)
def test_a_search_over_nothing_is_refused(gfor, arguments, word):
    code, _, err = gfor("modes", "two_area", *arguments)
    assert code == 2
    assert word in err


def test_a_mode_out_of_range_leaves_its_name_to_no_other(gfor):
    _, out, _ = gfor("modes", "two_area", "--scenario", "base", "--range", "1:2", "--json")
    (scenario,) = json.loads(out)["scenarios"]
    assert scenario["modes"]
    assert all(mode["name"] is None for mode in scenario["modes"])
