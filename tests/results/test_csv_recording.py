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


def test_what_is_no_table_over_the_time_is_refused_in_own_words(tmp_path):
    path = tmp_path / "ring.csv"
    for text, words in (
        ("f,time\n1,2\n", "its first column is 'f'; it must be the time"),
        ("time [h],f\n1,2\n2,3\n", "must be the time, as numbers below"),
        ("time,f\n1,2\n1,3\n", "the time of its 2 rows does not rise"),
        ("time,f\n1,2\n2,3,4,5\n", "its lines do not have the columns of the first one"),
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
