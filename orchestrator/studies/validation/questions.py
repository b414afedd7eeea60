"""Doubts about a recording, or between it and the model, as kinds with figures; `words` says it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any


class QuestionKind(StrEnum):
    """Programs decide by the kind; the sentence is for people."""

    VOLTAGE_LEVEL = "voltage level"
    RATING = "rating"
    RATED_FREQUENCY = "rated frequency"
    FRAMES = "phasors of another grid"
    ANGLE_UNIT = "angle unit"
    ANGLE_HELD = "angle held"
    POWER_HELD = "power held"
    MAGNITUDE_HELD = "magnitude held"
    SMOOTHED = "smoothed"
    ANGLE_AND_FREQUENCY = "angle and frequency differ"
    FREQUENCY_ALONE = "frequency alone"
    PHASE_ORDER = "phase order"
    TIME_UNIT = "time unit"
    BASES_ASSUMED = "bases assumed"
    NO_STEADY_STATE = "no steady state before"
    NO_EVENT = "no event"
    SLOW_SAMPLES = "slow samples"
    DOUBT_UNKNOWN = "doubt unknown"
    MISSING = "missing samples"
    MISSING_CODE = "code for missing"
    FILLED = "filled samples"
    UNMEASURED = "P or Q missing"
    GAP_AT_EVENT = "gap at the event"
    GAP_IN_RING_DOWN = "gap in the ring-down"
    LOST_JUMP = "angle lacks a jump"
    LOST_STEP = "magnitude lacks a step"
    ANGLE_JUMP = "angle jumps alone"
    ANGLE_REFERENCE = "angle reference"
    STORED_TWICE = "stored twice"
    LAGGED = "behind a lag"
    PLANT_OUT_OF_STEP = "plant out of step"
    START = "starts elsewhere"
    STUCK = "channel does not move"
    SPIKE = "spike"
    CLIPPED = "clipped"
    MAGNITUDE = "magnitude"
    READ_OTHERWISE = "read otherwise"
    CLOCKS = "clocks"
    METER_ELSEWHERE = "meter elsewhere"
    SETPOINT = "setpoint"
    OUT_OF_STEP = "out of step"
    OTHER_EVENT = "another event"
    SECOND_EVENT = "second event"
    SLIP = "slips"
    OVER_LIMIT = "above a limit"
    TOO_GOOD = "too good"
    NO_NOISE = "no noise"
    NOISE = "noise"
    SHORT_BEFORE = "short before"


FIGURES_HOLD = {
    QuestionKind.BASES_ASSUMED,
    QuestionKind.MISSING,
    QuestionKind.MISSING_CODE,
    QuestionKind.FILLED,
    QuestionKind.GAP_IN_RING_DOWN,
    QuestionKind.SLOW_SAMPLES,
    QuestionKind.NOISE,
    QuestionKind.NO_NOISE,
    QuestionKind.SHORT_BEFORE,
    QuestionKind.SECOND_EVENT,
    QuestionKind.SLIP,
    QuestionKind.OVER_LIMIT,
    QuestionKind.FRAMES,
}
"""Kinds that are borne in mind, and leave a verdict standing; every other one keeps it open."""


@dataclass(frozen=True)
class Question:
    kind: QuestionKind
    # what the sentence needs, as JSON's types
    figures: Mapping[str, Any] = field(default_factory=dict)

    @property
    def keeps_open(self) -> bool:
        """Return whether a verdict has to wait for its answer."""
        return self.kind not in FIGURES_HOLD
