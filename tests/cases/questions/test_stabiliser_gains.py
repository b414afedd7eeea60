"""A stabiliser that the least change of its signal limits is asked about, with what makes its gain."""

import re

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from tests.cases.networks.psse import raw
from tests.cases.networks.psse.test_dyr import CASE, DYR
from tests.support.late import LateLibrary

signal = LateLibrary("scipy.signal")

IEEEST = "1 'IEEEST' 1 1 0 {filter} {stages} 1.65 1.65 3 {limit} -{limit} 0 0 /\n"
TYPICAL = "1.013 0.013 0 0 1.013 0.113"
"""A_1 to A_6."""


@pytest.fixture
def asked(tmp_path):
    def ask(record, values=()):
        (tmp_path / "grid.raw").write_text(raw(33))
        (tmp_path / "grid.dyr").write_text(DYR + record)
        (tmp_path / "case.toml").write_text(CASE)
        (ready,) = load_case(tmp_path / "case.toml").prepare(["plain"], dict(values))
        return [" ".join(q.text.split()) for q in ready.questions if "reaches the limit" in q.text]

    return ask


def test_a_limit_that_the_least_change_reaches_is_asked_about_with_what_makes_the_gain(asked):
    """SciPy has the gain at 1 Hz; of a jump it is the product of the leads over their lags."""
    record = IEEEST.format(filter=TYPICAL, stages="10 0.02 0 0", limit=0.1)
    (text,) = asked(record)
    jump = 0.113 / 0.013 * 10 / 0.02 * 3
    above = np.polymul([0.113, 1.013, 1], np.polymul([10, 1], [3 * 1.65, 0]))
    below = np.polymul([0.013, 1.013, 1], np.polymul([0.02, 1], [1.65, 1]))
    swing = abs(signal.freqs(above, below, [2 * np.pi])[1][0])
    assert (
        f"by 13038 (K_S = 3, leads of the filter = 8.692, T_1/T_2 = 500): one of {0.1 / jump:.2g} pu reaches the limit"
        in text
    )
    assert f"a swing of 1 Hz from {0.1 / swing:.2g} pu on" in text
    assert "is the lead pss.T_1 = 10 s over pss.T_2 = 0.02 s right?" in text
    (setting,) = re.findall(r"--set (\S+)=false", text)
    assert asked(record, {setting: False}) == []


@pytest.mark.parametrize(
    ("filter", "stages", "limit"),
    [
        (TYPICAL, "0 0.02 0 0", 0.1),
        (TYPICAL, "1 0.02 0 0", 0.1),
        (TYPICAL, "10 0.02 0 0", 5),
        ("1.013 0.013 0 0 1.013 0", "10 0.02 0 0", 0.1),
    ],
    ids=["no lead", "a shorter lead", "a limit that is far", "lags in the filter"],
)
def test_a_limit_further_away_is_not_asked_about(asked, filter, stages, limit):
    assert asked(IEEEST.format(filter=filter, stages=stages, limit=limit)) == []


def test_the_lead_that_makes_most_of_the_gain_is_named_at_another_stabiliser(asked):
    """STAB1 has K/T, T, T1/T3, T3, T2/T4, T4 and its limit."""
    (text,) = asked("1 'STAB1' 1 30 10 2 0.02 300 5 0.1 /\n")
    assert "a jump of the speed by 18000 (K_S = 30, T_1/T_2 = 2, T_3/T_4 = 300)" in text
    assert "is the lead pss.T_3 = 1500 s over pss.T_4 = 5 s right?" in text
