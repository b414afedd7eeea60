"""Modes in a CSV file: a measured one in the forms that people have, and the program's own."""

import numpy as np
import pytest

from orchestrator.api.identification import identify
from orchestrator.errors import InputError
from orchestrator.results.csv_recording import read_csv

TIMES = np.arange(0, 20, 0.02)
SWING = 0.05 * np.exp(-0.3 * TIMES) * np.cos(2 * np.pi * 0.9 * TIMES)


def written(path, heading, mark=",", decimal=".", scale=1.0, remark=""):
    lines = [
        f"{scale * t:.5f}{mark}{60 + y:.9f}".replace(".", decimal) + remark for t, y in zip(TIMES, SWING, strict=True)
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
    assert best.damping_percent == pytest.approx(100 * 0.3 / np.hypot(0.3, 2 * np.pi * 0.9), rel=1e-3)


@pytest.mark.parametrize(
    ("head", "stamp"),
    [("time,f", "2025-03-01 23:59:59.{:03d}"), ("timestamp;f", "2025-03-01T08:00:00,{:03d}"),
     ("time,f", "12:00:00.{:03d}"), ("time,f", "2025-03-01T12:00:00.{:03d}+01:00"), ("time [ms],f", "{}"),
     ("t [s],f", "0.{:03d}"), ("time [msec],f", "{}.0")],
)  # fmt: skip
def test_times_are_seconds_from_dates_clocks_and_stated_units(tmp_path, head, stamp):
    path, mark = tmp_path / "ring.csv", ";" if ";" in head else ","
    path.write_text("\n".join([head, *(f"{stamp.format(20 * k)}{mark}{k}" for k in range(4)), ""]))
    found = read_csv(path)
    assert found["time"].values == pytest.approx([0, 0.02, 0.04, 0.06], abs=1e-12)
    assert found["f"].values.tolist() == [0, 1, 2, 3]


def test_times_whole_seconds_apart_are_taken_where_their_unit_is_said(tmp_path):
    path = tmp_path / "slow.csv"
    path.write_text("time [s],f\n0,1\n20,2\n")
    assert read_csv(path)["time"].values.tolist() == [0, 20]


def test_what_is_no_table_over_the_time_is_refused_in_own_words(tmp_path):
    path = tmp_path / "ring.csv"
    for text, words in (
        ("f,time\n1,2\n", "its first column is 'f'; it must be the time"),
        ("time [h],f\n1,2\n2,3\n", "must be the time, as numbers below"),
        ("time,f\n1,2\n1,3\n", "the time of its 2 rows does not rise"),
        ("time,f\n1,2\n2,3,4,5\n", "its lines do not have the columns of the first one"),
        ("time,f\n0,00,50,1\n0,02,50,2\n", "the comma both parts the columns and stands in the numbers"),
        ("time,f\n0.1,1,\n0.2,2,\n", "its first line names 2 columns, and the others have 3; name them all"),
        (
            "time,f\n0,1\n20,2\n40,3\n",
            "its times are 20 apart, perhaps in ms, and 'time' says no unit; write 'time [s]'",
        ),
        ("time,f\n0.00,1\n20.00,2\n40.00,3\n", "or 'time [ms]'"),
        ("time;P\n0;1.234,5\n0,1;1.235,5\n", "'P' has '1.234,5'; write its numbers without marks between thousands"),
        ('time,P\n0.0,"1,234"\n0.1,999\n', "without marks between thousands"),
        ("time,f\n0.0,1\n0.1,bad\n", "column 'f' has 'bad' among numbers; leave such cells empty"),
        ("time;f\n01.05.2025 12:00:00;1\n01.05.2025 12:00:01;2\n", "or as dates such as 2025-03-01 12:00:00.020"),
        ("", "cannot be read as CSV"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=r"ring\.csv: ") as caught:
            read_csv(path)
        assert words in str(caught.value)
    (tmp_path / "ring.txt").write_text("no recording")
    with pytest.raises(InputError, match=r"in CSV \(.csv\)") as caught:
        identify(tmp_path / "ring.txt", "f")
    assert "xarray" not in str(caught.value)
