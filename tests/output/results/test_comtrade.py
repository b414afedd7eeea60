"""Recordings in COMTRADE: files written by hand as the standard says, another reader, and what is refused."""

import json
import struct

import comtrade
import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import AnalysisError, InputError
from orchestrator.output.results.comtrade.configuration import FORMS
from orchestrator.output.results.comtrade.reading import read_comtrade
from orchestrator.output.results.comtrade.writing import write_comtrade
from orchestrator.output.results.manifest import ResultsWarning
from orchestrator.studies.signals.comparison import strongest_modes

CFG = """\
NORTH,PMU 7,1999
5,3A,2D
1,UL1,A,,kV,0.5,10,0,-32767,32767,400,0.1,S
2,F,,,Hz,0.001,50,0,-32767,32767,1,1,P
3,F,,,Hz,1,0,0,-32767,32767,1,1,P
1,CB,,,0
2,TRIP,,,0
50
1
50,3
23/11/2024,10:00:00.000000
23/11/2024,10:00:00.020000
ASCII
1
"""
DAT = "1,0,2,10,7,0,1\n2,20000,4,99999,8,1,1\n3,40000,-6,-30,9,1,0\n"
ROWS = [(2, 10, 7, 0b10), (4, -32768, 8, 0b11), (-6, -30, 9, 0b01)]


@pytest.fixture
def recording(tmp_path):
    """Text and samples of a recording → the path of its configuration."""

    def write(cfg=CFG, dat=DAT, name="rec"):
        (tmp_path / f"{name}.cfg").write_text(cfg, encoding="utf-8")
        (tmp_path / f"{name}.dat").write_bytes(dat.encode() if isinstance(dat, str) else dat)
        return tmp_path / f"{name}.cfg"

    return write


def check(dataset):
    """The values of `ROWS`, worked out by hand; 4000 is the transformer's ratio."""
    assert list(dataset) == ["UL1", "F (A2)", "F (A3)", "CB", "TRIP"]
    assert dataset["UL1"].values == pytest.approx(4000 * np.array([11, 12, 7]))
    assert dataset["UL1"].attrs["units"] == "kV"
    assert dataset["F (A2)"].values == pytest.approx([50.01, np.nan, 49.97], nan_ok=True)
    assert dataset["CB"].values.tolist() == [0, 1, 1]
    assert dataset["TRIP"].values.tolist() == [1, 1, 0]
    assert dataset["time"].values == pytest.approx([0, 0.02, 0.04])
    assert dataset.attrs["referred_to_primary"] == "UL1"
    assert float(dataset["line_frequency_hz"]) == 50


def test_text_of_1999(recording):
    check(read_comtrade(recording()))
    check(read_comtrade(recording().with_suffix(".dat")))


def test_characters_that_steer_a_terminal_are_written_out(recording):
    """An analog name, a status name and a unit that would erase or turn the line they are shown on."""
    steering = CFG.replace("UL1,A,,kV", "UL1\x1b[2K,A,,k\u202eV").replace("1,CB", "1,CB\u202e")
    dataset = read_comtrade(recording(steering))
    assert list(dataset) == ["UL1\\x1b[2K", "F (A2)", "F (A3)", "CB\\u202e", "TRIP"]
    assert dataset["UL1\\x1b[2K"].attrs["units"] == "k\\u202eV"


def test_sixteen_bits_of_1999(recording):
    dat = b"".join(struct.pack("<IIhhhH", k + 1, 20000 * k, *row) for k, row in enumerate(ROWS))
    check(read_comtrade(recording(CFG.replace("ASCII", "BINARY"), dat)))


@pytest.mark.parametrize(
    ("form", "letter", "missing"), [("BINARY32", "i", -(2**31)), ("FLOAT32", "f", np.nan)]
)
def test_both_forms_of_2013_in_one_file(tmp_path, form, letter, missing):
    dat = b"".join(
        struct.pack(
            f"<II{letter * 3}H",
            k + 1,
            0xFFFFFFFF,
            *(missing if x == -32768 else x for x in row[:3]),
            row[3],
        )
        for k, row in enumerate(ROWS)
    )
    cfg = CFG.replace("1999", "2013").replace("ASCII", form) + "0,0\n0,0\n"
    head = f"--- file type: CFG ---\r\n{cfg}--- file type: INF ---\r\n--- file type: DAT {form}: {len(dat)} ---\r\n"
    (tmp_path / "rec.cff").write_bytes(head.encode() + dat)
    check(read_comtrade(tmp_path / "rec.cff"))


def test_the_form_of_1991(recording):
    """No revision in the first line, status channels of three fields, a blank for a missing sample."""
    cfg = CFG.replace(",1999", "").replace("1,CB,,,0", "1,CB,0").replace("ASCII\n1\n", "ASCII\n")
    cfg = cfg.replace(",400,0.1,S", "").replace(",1,1,P", "")
    dataset = read_comtrade(recording(cfg, DAT.replace("99999", "")))
    assert dataset["UL1"].values == pytest.approx([11, 12, 7])
    assert np.isnan(dataset["F (A2)"].values[1])
    assert dataset["CB"].values.tolist() == [0, 1, 1]
    with pytest.warns(
        ResultsWarning,
        match=r"rec.dat, line 2: 99999 is taken as a missing sample \(F \(A2\); 1 in",
    ):
        marked = read_comtrade(recording(cfg))
    assert np.isnan(marked["F (A2)"].values[1])


def test_times_from_several_rates_and_from_stamps(recording):
    two = read_comtrade(
        recording(CFG.replace("1\n50,3", "2\n100,2\n25,3"), DAT.replace("40000", "50000"))
    )
    assert two["time"].values == pytest.approx([0, 0.01, 0.05])
    none = CFG.replace("1\n50,3", "0\n0,3").replace("ASCII\n1", "ASCII\n2.5")
    assert read_comtrade(recording(none))["time"].values == pytest.approx([0, 0.05, 0.10])
    fine = none.replace("1999", "2013").replace("10:00:00.000000", "10:00:00.000000000")
    assert read_comtrade(recording(fine))["time"].values == pytest.approx([0, 0.05e-3, 0.10e-3])


def test_times_that_contradict_each_other_are_said(recording):
    with pytest.warns(
        ResultsWarning, match=r"time stamps span 0.04 s, the sampling rates 0.4 s; the rates count"
    ):
        read_comtrade(recording(CFG.replace("50,3", "5,3")))
    with pytest.warns(ResultsWarning, match=r"skewed by .*UL1 \(0.005 s\)"):
        read_comtrade(recording(CFG.replace("0.5,10,0,", "0.5,10,5000,")))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            ",1999",
            ",1949",
            r"rec.cfg, line 1: the revision is '1949'; those of 1991, 1999, 2001, 2013 can be read",
        ),
        ("5,3A,2D", "5,3,2", r"line 2: the numbers of channels are '5, 3, 2'; expected such as"),
        (
            "5,3A,2D",
            "5,3A,99999999D",
            r"line 2: the number of channels of kind D is '99999999'; it must be",
        ),
        (
            "0.5,10",
            "half,10",
            r"line 3: the scale a of analog channel 1 is 'half'; it must be a number",
        ),
        (
            "400,0.1,S",
            "400,0,S",
            r"line 3: analog channel 1 holds secondary values with a ratio of 400 to 0",
        ),
        ("1\n50,3", "2\n50,3\n25,3", r"line 11: 25 Hz until sample 3: .* last samples must rise"),
        (
            "1\n50,3",
            "1\n0,3",
            r"line 10: a sampling rate is 0; write the number of sampling rates as 0",
        ),
        (
            "50,3",
            "50,4",
            r"rec.dat: it has 3 samples, and .*rec.cfg says 4; copy the files once more",
        ),
        (
            "5,3A,2D",
            "4,3A,1D",
            r"line 9: the number of the last sample is ''; it must be a whole number",
        ),
        (
            "ASCII",
            "EBCDIC",
            r"line 13: the form of the samples is 'EBCDIC'; known are ASCII, BINARY",
        ),
        ("ASCII\n1\n", "", r"rec.cfg: the file ends after line 12, before the form of the samples"),
        ("ASCII\n1", "ASCII\n0", r"the multiplier of time stamps is 0; it must exceed 0"),
        (
            "ASCII",
            "BINARY",
            r"rec.dat: it has 58 bytes, and a sample of 3 analog and 2 status channels in BINARY has",
        ),
    ],
)
def test_a_configuration_that_cannot_be_used(recording, old, new, words):
    with pytest.raises(InputError, match=words):
        read_comtrade(recording(CFG.replace(old, new, 1)))


@pytest.mark.parametrize(
    ("dat", "words"),
    [
        (
            DAT.replace("2,20000,4", "2,20000"),
            r"rec.dat, line 2: it has 6 columns; .*rec.cfg asks for 7",
        ),
        (DAT.replace("-6", "six"), r"rec.dat, line 3: a sample is no number"),
        (
            DAT.replace("3,40000", "4,40000"),
            r"rec.dat: after sample 2 comes sample 4; samples between them are missing",
        ),
        ("", r"rec.dat: a sample is no number|it has 0 samples"),
    ],
)
def test_samples_that_cannot_be_used(recording, dat, words):
    with pytest.raises(InputError, match=words):
        read_comtrade(recording(dat=dat))


def test_files_that_are_not_there(tmp_path, recording, gfor):
    with pytest.raises(InputError, match=r"none.cfg: there is no such file"):
        read_comtrade(tmp_path / "none.cfg")
    path = recording()
    path.with_suffix(".dat").unlink()
    code, _, error = gfor("signal", "identify", path, "UL1")
    assert code == 2
    assert "rec.dat: there is no such file; a recording needs both its .cfg and its .dat" in error
    (tmp_path / "x.cff").write_bytes(b"--- file type: CFG ---\n")
    with pytest.raises(InputError, match=r"no part '--- file type: DAT ---'"):
        read_comtrade(tmp_path / "x.cff")


# -- modes of a recording --------------------------------------------------------------------------

MODE, WEAK = -0.3 + 2j * np.pi * 0.6, -0.9 + 2j * np.pi * 1.3


def swing(interval, noise=0.0, stop=20.0):
    """Two modes and noise, as a dataset."""
    times = np.arange(0, stop, interval)
    signal = 50 + 0.1 * np.exp(MODE * times).real + 0.04 * np.exp(WEAK * times).real
    signal = signal + noise * np.random.default_rng(7).standard_normal(len(times))
    return xr.Dataset({"F": ("time", signal, {"units": "Hz"})}, coords={"time": times})


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("interval", [0.001, 0.02])
def test_what_is_written_is_read_and_rings_as_before(tmp_path, form, interval):
    dataset = swing(interval)
    span = float(np.ptp(dataset["F"].values))
    error = {"ASCII": 2.6e-6, "BINARY": 7.7e-6, "BINARY32": 1.2e-10, "FLOAT32": 3e-8}[form]
    cfg, dat = write_comtrade(dataset, ["F"], tmp_path / "swing.cfg", form)
    own = read_comtrade(cfg)
    assert np.abs(own["F"].values - dataset["F"].values).max() <= error * span
    assert own["time"].values == pytest.approx(dataset["time"].values, abs=1e-9)
    other = comtrade.load(str(cfg), str(dat), use_double_precision=True)
    assert (other.analog_channel_ids, other.cfg.analog_channels[0].uu, other.frequency) == (
        ["F"],
        "Hz",
        50,
    )
    assert np.array(other.analog[0]) == pytest.approx(own["F"].values, abs=1e-9 * span)
    assert np.array(other.time) == pytest.approx(own["time"].values, abs=1e-9)
    first, second, *_ = strongest_modes(own["F"], 2.0)
    for found, wanted, size in ((first, MODE, 0.1), (second, WEAK, 0.04)):
        assert found.eigenvalue == pytest.approx(wanted, rel=2e-3)
        assert found.amplitude == pytest.approx(size / 2 * np.exp(wanted.real * 2), rel=5e-3)


def test_noise_above_the_range_of_swings_is_averaged_away(tmp_path):
    """1 kHz with 5 % of noise and a ripple at 99.4 Hz, which thinned out to 100 Hz alone would appear at 0.6 Hz."""
    dataset = swing(0.001, 0.005)
    dataset["F"] = dataset["F"] + 0.05 * np.cos(2 * np.pi * 99.4 * dataset["time"])
    cfg, _ = write_comtrade(dataset, ["F"], tmp_path / "swing.cfg", frequency=60)
    first, *_ = strongest_modes(read_comtrade(cfg)["F"], 2.0)
    assert first.eigenvalue == pytest.approx(MODE, rel=0.01)


def test_a_gap_a_change_of_rate_and_a_wave_are_refused(recording):
    rows = [f"{k + 1},,0,{99999 if k == 40 else k % 7},{k % 5},0,0" for k in range(200)]
    path = recording(CFG.replace("50,3", "50,200"), "\n".join(rows))
    with pytest.raises(
        AnalysisError,
        match=r"1 of 200 samples are missing, the first at t = 0.8 s; .*0.82 to 3.98 s",
    ):
        strongest_modes(read_comtrade(path)["F (A2)"], 0.0)
    path = recording(CFG.replace("1\n50,3", "2\n50,100\n25,200"), "\n".join(rows))
    with pytest.raises(
        AnalysisError, match=r"the sampling rate changes at t = 1.98 s, and modes need one rate"
    ):
        strongest_modes(read_comtrade(path)["F (A3)"], 0.0)
    wave = [
        f"{k + 1},0,0,0,{10000 * np.cos(2 * np.pi * 50 * k / 1000):.0f},0,0" for k in range(2000)
    ]
    path = recording(CFG.replace("50,3", "1000,2000"), "\n".join(wave))
    with pytest.raises(
        AnalysisError, match=r"100 % of the signal's power lies near the line's frequency of 50 Hz"
    ):
        strongest_modes(read_comtrade(path)["F (A3)"], 0.0)


def test_the_commands(tmp_path, gfor):
    folder = tmp_path / "run"
    folder.mkdir()
    swing(0.02).rename({"F": "a.omega"}).to_netcdf(folder / "trajectory.nc", engine="scipy")
    code, out, _ = gfor("export", "comtrade", folder, "--frequency", 60, "--form", "float32")
    assert (code, out.split()) == (
        0,
        [str(folder / "trajectory.cfg"), str(folder / "trajectory.dat")],
    )
    code, out, _ = gfor("signal", "identify", folder / "trajectory.cfg", "a.omega", "--json")
    assert json.loads(out)[0]["frequency_hz"] == pytest.approx(0.6, abs=1e-3)
    code, out, _ = gfor(
        "signal", "compare", folder, folder / "trajectory.cfg", "--signal", "a.omega", "--json"
    )
    assert json.loads(out)[0]["largest"] < 1e-8
    code, _, error = gfor("export", "comtrade", folder, "--form", "morse")
    assert (code, "the form 'MORSE' is unknown; choose one of ASCII" in error) == (2, True)


def test_a_run_that_is_not_recorded_evenly_is_not_written(tmp_path):
    dataset = swing(0.02).isel(time=[0, 1, 2, 5])
    with pytest.raises(InputError, match=r"not recorded evenly: .*set solver.record_interval"):
        write_comtrade(dataset, ["F"], tmp_path / "x.cfg")
