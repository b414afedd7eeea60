"""Modes in a CSV file: a measured one in the forms that people have, and the program's own."""

import numpy as np
import pandas as pd
import pytest

from orchestrator.core.errors import InputError
from orchestrator.face.api.identification import identify
from orchestrator.output.results.csv_recording import read_table

TIMES = np.arange(0, 20, 0.02)
SWING = 0.05 * np.exp(-0.3 * TIMES) * np.cos(2 * np.pi * 0.9 * TIMES)


def written(path, heading, mark=",", decimal=".", scale=1.0, remark=""):
    lines = [
        f"{scale * t:.5f}{mark}{60 + y:.9f}".replace(".", decimal) + remark
        for t, y in zip(TIMES, SWING, strict=True)
    ]
    path.write_text("\n".join([heading, *lines, ""]), encoding="utf-8-sig")
    return path


@pytest.mark.parametrize(
    ("heading", "options"),
    [
        ("time,f north", {}),
        ("Time [s],f north [Hz]", {}),
        ("t;f north [Hz]", {"mark": ";", "decimal": ","}),
        ("t;f north (Hz)", {"mark": ";"}),
        ("time [ms]\tf north", {"mark": "\t", "scale": 1000.0}),
        ("time,f north,remark", {"remark": ",ok"}),
    ],
)
def test_the_modes_of_a_measured_table_are_found(tmp_path, heading, options):
    found = identify(written(tmp_path / "ring.csv", heading, **options), "f north", start=1.0)
    best = found.modes[0]
    assert best.frequency_hz == pytest.approx(0.9, rel=1e-4)
    assert best.damping_percent == pytest.approx(
        100 * 0.3 / np.hypot(0.3, 2 * np.pi * 0.9), rel=1e-3
    )


@pytest.mark.parametrize(
    ("head", "stamp"),
    [
        ("time,f", "2025-03-01 23:59:59.{:03d}"),
        ("timestamp;f", "2025-03-01T08:00:00,{:03d}"),
        ("time,f", "12:00:00.{:03d}"),
        ("Zeit;f [Hz]", "31.05.2025 23:59:59,{:03d}"),
        ("UTC,f", "5/1/2025 11:59:59.{:03d} PM"),
        ("Date;Time;f", "2025-03-01;08:00:00,{:03d}"),
        ("PMU 7;NORTH\n\ntime;f\ns;Hz", "0,{:03d}"),
        ("Time,f", "1700000000.{:03d}"),
        ("SOC,f", "1700000000.{:03d}"),
        ("PMU 7\nDatum;f\n-;Hz", "31.05.2025 23:59:59,{:03d}"),
        ("Uhrzeit (s);f", "0,{:03d}"),
        ("time,f", "2025-03-01T12:00:00.{:03d}+01:00"),
        ("time [ms],f", "{}"),
        ("t [s],f", "0.{:03d}"),
        ("time [msec],f", "{}.0"),
    ],
)
def test_times_are_seconds_from_dates_clocks_and_stated_units(tmp_path, head, stamp):
    path, mark = tmp_path / "ring.csv", ";" if ";" in head else ","
    path.write_text("\n".join([head, *(f"{stamp.format(20 * k)}{mark}{k}" for k in range(4)), ""]))
    found = read_table(path)
    assert found["time"].values == pytest.approx([0, 0.02, 0.04, 0.06], abs=1e-12)
    assert found["f"].values.tolist() == [0, 1, 2, 3]


def test_units_below_the_names_and_excel_and_windows_text_are_read(tmp_path):
    path = tmp_path / "ring.csv"
    path.write_bytes(
        "Gerät 7\nZeit;f Süd;P\n[s];[Hz];[MW]\n0,00;50,01;1\n0,02;50,02;2\n".encode("cp1252")
    )
    found = read_table(path)
    assert {name: found[name].units for name in found} == {"f Süd": "Hz", "P": "MW"}
    pytest.importorskip("openpyxl")
    stamps = pd.date_range("2025-03-01", periods=2, freq="20ms")
    for times, name in (([0.0, 0.02], "t"), (stamps, "when")):
        sheet = tmp_path / f"{name}.xlsx"
        with pd.ExcelWriter(sheet) as writer:
            pd.DataFrame({name: times, "f [Hz]": [50.01, 50.02]}).to_excel(
                writer, startrow=2, index=False
            )
        found = read_table(sheet)
        assert found["time"].values == pytest.approx([0, 0.02])
        assert found["f"].values.tolist() == [50.01, 50.02]
    (tmp_path / "no.xlsx").write_text("text")
    with pytest.raises(InputError, match=r"no\.xlsx: it cannot be read as Excel"):
        read_table(tmp_path / "no.xlsx")


def test_times_whole_seconds_apart_are_taken_where_their_unit_is_said(tmp_path):
    path = tmp_path / "slow.csv"
    path.write_text("time [s],f\n0,1\n20,2\n")
    assert read_table(path)["time"].values.tolist() == [0, 20]


@pytest.mark.parametrize("frames", [10, 16, 20, 25])
def test_phasors_sent_ten_times_a_second_are_in_seconds(tmp_path, frames):
    path = tmp_path / "slow.csv"
    times = np.arange(10 * frames + 1) / frames
    path.write_text("\n".join(["time,f", *(f"{t:.6g},50.01" for t in times), ""]))
    assert read_table(path)["time"].values == pytest.approx(times, abs=1e-6)


@pytest.mark.parametrize(("apart", "length"), [(0.05, 400.0), (0.1, 0.5), (0.2, 20.0)])
def test_times_that_may_be_milliseconds_are_asked_about(tmp_path, apart, length):
    path = tmp_path / "fast.csv"
    times = np.arange(0.0, length, apart)
    path.write_text("\n".join(["time,f", *(f"{t:.6g},50.01" for t in times), ""]))
    with pytest.raises(InputError, match=r"perhaps in ms, and 'time' says no unit"):
        read_table(path)


def test_what_is_no_table_over_the_time_is_refused_in_own_words(tmp_path):
    path = tmp_path / "ring.csv"
    for text, words in (
        ("f,time\n1,2\n", "its first column is 'f'; it must be the time"),
        ("time [h],f\n1,2\n2,3\n", "must be the time, as numbers below"),
        ("time,f\n1,2\n1,3\n", "the time of its 2 rows does not rise"),
        ("time,f\n1.5,2\n1.5,3\n", "several rows have 1.5: give each row once"),
        ("time,f\n1.5,2\n1.4,3\n", "sort them"),
        ("time,f\n1.5,2\n", "give at least two rows"),
        ("time,f\n1.51,2\n,7\n1.53,3\n", "row 2 of the numbers has no time"),
        ("time,f,f\n1.51,2,4\n1.52,3,4\n", "several columns have the name 'f'"),
        ("time,f\n0.01,2\ntime,f\n0.02,3\n", "row 3 repeats the heading; remove that row"),
        ("PMU 7\n\nt,f\ns,Hz\n0.01,2\n\ns,Hz\n0.02,3\n", "row 7 repeats the heading"),
        ("time,f\n1,2\n2,3,4,5\n", "and '2,3,4,5' has 4; name them all"),
        (
            "time,f\n0,00,50,1\n0,02,50,2\n",
            "the comma both parts the columns and stands in the numbers",
        ),
        ("time,f\n0.0,1\n0.5,2\n1.0,3\n", "its times are 0.5 apart, perhaps in ms"),
        ("time,f\n0.0,1\n0.1,2\n0.2,3\n", "its times are 0.1 apart, perhaps in ms"),
        ("time,f\n0.1,1,\n0.2,2,\n", "names 2 columns, and '0.1,1,' has 3; name them all"),
        (
            "time,f\n0,1\n20,2\n40,3\n",
            "its times are 20 apart, perhaps in ms, and 'time' says no unit; write 'time [s]'",
        ),
        ("time,f\n0.00,1\n20.00,2\n40.00,3\n", "or 'time [ms]'"),
        ("time,f\n1/5/2025 23:59:59,1\n2/5/2025 00:00:00,2\n", "or as dates such as 2025-03-01"),
        (
            "time;P\n0;1.234,5\n0,02;1.235,5\n",
            "'P' has '1.234,5'; write its numbers without marks between thousands",
        ),
        ('time,P\n0.0,"1,234"\n0.02,999\n', "without marks between thousands"),
        ("time,f\n0.0,1\n0.02,bad\n", "column 'f' has 'bad' among numbers; leave such cells empty"),
        ("", "its first column is ''"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=r"ring\.csv: ") as caught:
            read_table(path)
        assert words in str(caught.value)
    (tmp_path / "ring.txt").write_text("no recording")
    with pytest.raises(InputError, match=r"in CSV \(.csv\)") as caught:
        identify(tmp_path / "ring.txt", "f")
    assert "xarray" not in str(caught.value)
