"""A number that no recording reaches is told by its bound: from there on every value explains as much."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest

from orchestrator.devices.fmi.description import VariableInfo
from orchestrator.studies.validation.causes import Bound, CauseKind, Explanation
from orchestrator.studies.validation.device import Played
from orchestrator.studies.validation.page import _causes_said
from orchestrator.studies.validation.tables import explanation_table
from orchestrator.studies.validation.words import explanation_sentence
from tests.studies.validation.made_device import (
    MadeDevice,
    answer,
    course,
    model,
    recorded,
    validated,
)

TOLD = {"S_n": 450.0}
DAMPER = answer(course() - 1, K=2.0) - answer(course() - 1, K=0.0)
"""What the plant's damper adds [pu], in which its limit acts."""

MOST = float(np.abs(DAMPER.real).max())


def limited(limit):
    """P and Q [pu] of the plant whose damper has a limit."""
    return answer(course() - 1, K=0.0) + np.clip(DAMPER.real, -limit, limit)


@dataclass(frozen=True)
class LimitedDevice(MadeDevice):
    """The plant's model with a limit of its damper, which has a gain of 2."""

    def play(self, recording, start):
        moved = np.abs(recording.voltage) - abs(start.voltage)
        damper, limit = (answer(moved) - answer(moved, K=0.0)).real, self.value("limit")
        power = start.power + answer(moved, K=0.0) - answer(0 * moved, K=0.0)
        return Played(power + np.clip(damper, -limit, limit), 0.5, start.power, still=True)


def limited_model(limit):
    """A model of the plant with this limit, which may be up to 10 pu, and no other number."""
    plain = model(**TOLD)
    kept = {n: v for n, v in plain.description.variables.items() if n not in ("K", "X", "enabled")}
    number = VariableInfo("limit", 99, "Real", "parameter", "fixed", "pu", limit, 0.0, 10.0, "")
    plain.description.variables = {"limit": number, **kept}
    return LimitedDevice(**{one.name: getattr(plain, one.name) for one in fields(plain)})


@pytest.mark.parametrize(("plants", "bounded"), [(10.0, True), (0.5 * MOST, False)])
def test_a_limit_is_told_by_its_bound_where_the_recording_does_not_reach_it(plants, bounded):
    found = validated(limited_model(0.2 * MOST), recorded(limited(plants)), explain=True)
    best = found.result.explanations[0]
    assert best.name == "limit"
    assert best.explains
    told = found.as_json()["explanations"][0]
    words = "likeliest cause is limit of at least 0.079 pu (now 0.01579), which the recording does not reach: it"
    assert (words in _causes_said(found.result)) == bounded
    if bounded:
        assert told["at_least"] == pytest.approx(MOST, rel=0.02)
        assert not told["bound_is_reached"]
        assert "at least" in str(explanation_table([best]).rows)
    else:
        assert told["value"] == pytest.approx(plants, rel=0.01)
        assert told["at_least"] is told["at_most"] is told["bound_is_reached"] is None


@pytest.mark.parametrize(
    ("bound", "said"),
    [
        (Bound(0.1221, True, False), "of at least 0.12 pu (now 0.02), which the recording does"),
        (Bound(251.0, False, True), "of at most 250 pu (now 0.02), of which the recording tells"),
    ],
)
def test_a_bound_is_said_with_two_digits_in_place_of_the_value(bound, said):
    cause = Explanation(CauseKind.VALUE, "pod_p.limit", "pu", 0.02, 0.16017, 0.05, 4e-4, noise=3e-4)
    assert "pod_p.limit = 0.1602 pu" in explanation_sentence([cause])
    sentence = explanation_sentence([replace(cause, bound=bound)])
    assert said in sentence
    assert "0.16" not in sentence
