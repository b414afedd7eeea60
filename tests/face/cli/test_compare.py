"""``gfor signal compare`` and ``gfor signal identify`` on recorded runs."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from orchestrator.face.cli import main
from orchestrator.studies.runs.ring_down import ring_down_of
from tests.support.scenarios import bare_scenario

TIMES = np.arange(0, 15, 0.01)


def save(folder, eigenvalue, offset=0.0, times=TIMES, **attributes):
    """A run in which one signal rings with a known mode and another stays."""
    ring = 1 + 1e-3 * np.real(np.exp(eigenvalue * times))
    data = {
        "a.omega": ("time", ring, {"units": "pu"}),
        "b.omega": ("time", np.ones_like(times) + offset, {"units": "pu"}),
    }
    folder.mkdir()
    xr.Dataset(data, {"time": times}, attributes).to_netcdf(
        folder / "trajectory.nc", engine="scipy"
    )
    return folder


@pytest.fixture
def runs(tmp_path):
    return save(tmp_path / "one", -0.3 + 4j), save(tmp_path / "two", -0.9 + 5j, 1e-4, TIMES[::2])


def test_two_runs_side_by_side(runs, capsys):
    assert (
        main(
            [
                "signal",
                "compare",
                *map(str, runs),
                "--signal",
                "a.omega - b.omega",
                "--signal",
                "b.omega",
                "--json",
            ]
        )
        == 0
    )
    ring, still = json.loads(capsys.readouterr().out)
    assert [m["damping_percent"] for m in ring["modes"]] == pytest.approx(
        [100 * 0.3 / abs(-0.3 + 4j), 100 * 0.9 / abs(-0.9 + 5j)], abs=0.05
    )
    assert ring["unit"] == "pu"
    assert still["largest"] == pytest.approx(1e-4)
    assert still["modes"] == [None, None]


def test_without_signals_those_that_differ_most_are_shown(runs, capsys):
    assert main(["signal", "compare", *map(str, runs)]) == 0
    out = capsys.readouterr().out
    assert out.index("b.omega") < out.index("a.omega")


def test_doubtful_oscillations_are_told_in_a_sentence_for_each_run(tmp_path, gfor):
    """A line for each would be twenty below a table of ten signals."""
    rings = {"a.omega": -3 + 4j, "b.omega": -4 + 5j, "c.omega": -0.3 + 6j}
    folders = [tmp_path / "one", tmp_path / "two"]
    for folder in folders:
        data = {
            name: ("time", 1 + 1e-3 * np.real(np.exp(value * TIMES)), {"units": "pu"})
            for name, value in rings.items()
        }
        folder.mkdir()
        run = xr.Dataset(data, {"time": TIMES})
        run.to_netcdf(folder / "trajectory.nc", engine="scipy")
    asked = [word for name in rings for word in ("--signal", name)]
    _, out, _ = gfor("signal", "compare", *folders, *asked, "--start", "0")
    told = [line for line in out.splitlines() if line.startswith("? ")]
    assert [line.partition(": ")[0] for line in told] == [f"? {folder}" for folder in folders]
    assert all("a.omega at 0.6366 Hz is doubtful: its damping of 60 %" in line for line in told)
    assert all("So are those of b.omega; 'doubts' of each mode says why." in line for line in told)


def test_runs_of_two_cases_are_told(tmp_path, gfor):
    one, same, other = (
        save(tmp_path / name, -0.3 + 4j, case=name, case_file=text)
        for name, text in (("one", "x = 1"), ("same", "x = 1"), ("other", "x = 2"))
    )
    assert f"two case files ({one} of one, {other} of other)" in " ".join(
        gfor("signal", "compare", one, other)[2].split()
    )
    assert "two case files" not in gfor("signal", "compare", one, same)[2]


def test_runs_of_a_network_that_was_edited_between_are_told(tmp_path, gfor):
    made_of = [
        json.dumps({"own.raw": "1a", "own.dyr": content, f"{content}.fmu": content})
        for content in "abb"
    ]
    one, other, same = (
        save(tmp_path / f"r{k}", -0.3 + 4j, inputs=text) for k, text in enumerate(made_of)
    )
    assert "of files that differ: own.dyr" in " ".join(
        gfor("signal", "compare", one, other)[2].split()
    )
    assert "differ" not in gfor("signal", "compare", other, same)[2]


def test_the_modes_of_a_signal(runs, capsys):
    assert main(["signal", "identify", str(runs[0]), "a.omega", "--start", "1", "--json"]) == 0
    mode, *_ = json.loads(capsys.readouterr().out)
    assert (mode["real"], mode["imag"]) == pytest.approx((-0.3, 4.0), abs=1e-3)
    assert mode["amplitude"] == pytest.approx(0.5e-3 * np.exp(-0.3), rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["signal", "identify", "{0}", "a.speed"], "was not recorded; there are: a.omega, b.omega"),
        (["signal", "identify", "{0}", "b.omega"], "constant"),
        (["signal", "identify", "{0}/..", "a.omega"], "choose a scenario in it: one, two"),
        (["signal", "compare", "{0}", "nowhere"], "there is no trajectory.nc"),
    ],
)
def test_what_cannot_be_compared_is_said(runs, arguments, word, capsys):
    assert main([a.replace("{0}", str(runs[0])) for a in arguments]) in (1, 2)
    assert word in capsys.readouterr().err


@pytest.mark.parametrize(
    "command", [["signal", "compare", "{0}", "{1}"], ["signal", "identify", "{0}", "a.omega"]]
)
@pytest.mark.parametrize(
    ("start", "words"),
    [
        ("nan", "argument --start: 'nan' must be 0 or above and finite"),
        ("-5", "argument --start: '-5' must be 0 or above and finite"),
        ("true", "argument --start: 'true' is not a time"),
        ("2 kV", "argument --start: '2 kV' is in kV, but s is needed"),
        ("99", "ends at t = 14.99 s; give an earlier start"),
    ],
)
def test_a_start_that_leaves_nothing_is_refused(runs, gfor, command, start, words):
    code, out, err = gfor(*[word.format(*runs) for word in command], "--start", start)
    assert (code, out) == (2, "")
    assert words in err


def test_a_start_may_have_a_unit_and_be_the_beginning(runs, gfor):
    for start, same in (("1200 ms", "1.2"), ("0 s", "0")):
        printed = [
            gfor("signal", "identify", runs[0], "a.omega", "--start", text, "--json")[1]
            for text in (start, same)
        ]
        assert printed[0] == printed[1]
        assert json.loads(printed[0])


def test_the_heading_names_the_part_of_the_record_that_was_used(runs, gfor):
    _, out, _ = gfor("signal", "identify", runs[0], "a.omega", "--start", "1.005", "--stop", "99")
    assert "a.omega from 1.01 to 14.99 s" in out
    assert "λ [rad/s]" in out
    code, _, err = gfor("signal", "identify", runs[0], "a.omega", "--start", "3", "--stop", "2")
    assert (code, "stop = 2.0: it must come after start = 3.0" in err) == (2, True)


def test_other_intervals_and_short_runs_are_said(runs, gfor, tmp_path):
    _, out, _ = gfor("signal", "compare", *runs)
    assert "at [s]" in out
    assert "they are compared at the 750 times that both have" in out.replace("\n", " ")
    short = save(tmp_path / "short", -0.3 + 4j, times=np.arange(0, 1.5, 0.01))
    code, out, err = gfor("signal", "compare", runs[0], short, "--json")
    assert code == 0
    assert [c["modes"][1] for c in json.loads(out)] == [None, None]
    assert (
        "short ends at t = 1.49 s: its oscillations, which are read from t = 2 s on, are not shown"
        in err
    )


@pytest.mark.parametrize(("interval", "near"), [(0.01, False), (1.0, True)])
def test_identify_says_what_the_records_can_show(tmp_path, capsys, interval, near):
    """0.5733 Hz, recorded every second, appears at 0.4267 Hz."""
    run = str(
        save(
            tmp_path / "run", complex(-0.02, 2 * np.pi * 0.5733), times=np.arange(0, 100, interval)
        )
    )
    assert main(["signal", "identify", run, "a.omega"]) == 0
    out = capsys.readouterr().out
    assert ("0.4267" in out) == near
    assert ("show nothing above 0.5 Hz" in out) == near
    assert "show nothing above" in out
    assert ("Above a quarter of the sampling frequency of 1 Hz" in out) == near
    assert main(["signal", "identify", run, "a.omega", "--json"]) == 0
    captured = capsys.readouterr()
    assert isinstance(json.loads(captured.out), list)
    assert "show nothing above" in captured.err
    assert "time in ms" not in captured.err
    in_ms = save(
        tmp_path / "ms",
        complex(-0.02, 2 * np.pi * 0.5733) / 1e3,
        times=1e3 * np.arange(0, 100, interval),
    )
    assert main(["signal", "identify", str(in_ms), "a.omega"]) == 0
    assert "Is the time in ms?" in capsys.readouterr().out


@pytest.mark.parametrize(("interval", "shown"), [(0.4, True), (0.45, False), (1.0, False)])
def test_a_ring_down_that_is_recorded_too_coarsely_is_left_out(tmp_path, interval, shown):
    value = complex(-0.02, 2 * np.pi * 0.5733)
    folder = save(tmp_path / "run", value, times=np.arange(0, 100, interval))
    ring_down = SimpleNamespace(signal="a.omega", start=2.0)
    case = SimpleNamespace(table=SimpleNamespace(analysis=SimpleNamespace(ring_down=ring_down)))
    prepared = bare_scenario(case=case)
    modes = SimpleNamespace(
        prepared=prepared, electromechanical=SimpleNamespace(eigenvalue=value, frequency_hz=0.5733)
    )
    with xr.open_dataset(folder / "trajectory.nc", engine="scipy") as data:
        seen, why = ring_down_of(modes, data, [])
    assert (seen is not None, "no ring-down is shown: a.omega is known every" in why) == (
        shown,
        not shown,
    )
    assert seen is None or seen.frequency_hz == pytest.approx(0.5733, abs=1e-3)
