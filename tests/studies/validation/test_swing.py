"""The plant's own swing as a yardstick: known parts of it are planted as errors, and nothing is judged by it."""

import re

import numpy as np
import pytest

import orchestrator as gfor_in_python
from tests.studies.validation.recordings import run, table, with_noise

ON = {"pod_p.enabled": True}
MODEL, STEP = "gfor_phasor", "1 ms"


@pytest.fixture(scope="module")
def clean():
    return table(run())


def swings(frame):
    found = gfor_in_python.validate(MODEL, frame.set_index("time"), values=ON, step=STEP)
    return found, found.as_json()["events"][0]["swings"]


def smaller(frame, column, part):
    """The same with so much of a column's movement from the event on."""
    before = frame[column][frame.time < 0.99].mean()
    return frame.assign(**{column: before + part * (frame[column] - before)})


def test_an_error_is_counted_as_a_part_of_the_plants_swing(clean):
    """A model that moves as 1 where the plant moves as 0.8 misses a quarter of the plant's swing."""
    found, of = swings(with_noise(smaller(clean, "p_mw", 0.8)))
    moved = clean.p_mw[clean.time > 1.02] - clean.p_mw[0]
    assert of["p"]["swing_pu"] == pytest.approx(0.8 * np.abs(moved).max() / 1500, rel=0.01)
    assert of["p"]["max_error_percent"] == pytest.approx(25, abs=3)
    assert of["p"]["rms_error_percent"] == pytest.approx(25, abs=1)
    assert of["q"]["rms_error_percent"] < 10
    assert found.verdict is None


def test_a_signal_that_the_event_does_not_move_has_no_part(clean):
    """Noise over noise would be a hundred per cent of nothing."""
    _, of = swings(with_noise(smaller(clean, "q_mvar", 0.0)))
    assert of["q"]["swing_pu"] < 2 * of["q"]["swing_of_noise_pu"]
    assert of["q"]["max_error_percent"] is None
    assert of["q"]["rms_error_percent"] is None


def test_samples_before_the_event_or_missing_do_not_enlarge_the_swing(clean):
    """A larger swing would make the error look smaller."""
    good = with_noise(clean)
    jump = good.time.between(0.3, 0.302)
    hole = good.time.between(3.0, 3.05)
    spoilt = good.assign(p_mw=(good.p_mw + 1200 * jump).mask(hole))
    _, of = swings(spoilt)
    _, right = swings(good)
    assert of["p"]["swing_pu"] == pytest.approx(right["p"]["swing_pu"], rel=0.02)


def test_the_first_line_lays_the_error_beside_the_swing_and_judges_nothing(gfor, clean, tmp_path):
    path = tmp_path / "rec.csv"
    with_noise(smaller(clean, "p_mw", 0.8)).to_csv(path, index=False)
    code, out, _ = gfor("validate", MODEL, str(path), "--set", "pod_p.enabled=true", "--step", STEP)
    first = " ".join(out.partition("Events")[0].split())
    assert code == 0
    (megawatts,) = re.findall(r"\((\S+) MW\)", first)
    moved = clean.p_mw[clean.time > 1.02] - clean.p_mw[0]
    assert float(megawatts) == pytest.approx(0.2 * np.abs(moved).max(), rel=0.1)
    assert "From the event on the model misses P by up to 2" in first
    assert "pu that the plant swings (25 % in the mean)" in first
    assert "Without --limits there is no verdict." in first
