"""Sentences of questions about the recorder: units, signs and clocks, and samples that it lost, held or filtered."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from orchestrator.core.options import Option
from orchestrator.core.units import whole_percent
from orchestrator.studies.validation.questions import QuestionKind

Figures = Mapping[str, Any]
Sentence = Callable[[Figures], str]


def fall_of_error(x: Figures) -> str:
    """Say how much of the error a reading takes away."""
    return f"the error falls from {x['error']:.3g} to {x['left']:.3g} pu (rms)"


def _channel(given: str) -> str:
    return Option.CHANNEL + f" '{given}'"


def _frequency(hertz: float) -> str:
    return Option.SET + f" f_n={hertz:g}"


def _voltage_level(x: Figures) -> str:
    cause = f"{x['cause']}? Then give" if x["cause"] else "is the rated voltage right? Else give"
    return f"before the event the voltage is {x['v']:.4g} pu: {cause} " + _channel(x["remedy"])


def _rating(x: Figures) -> str:
    if x["remedy"]:
        given = " ".join(map(_channel, x["remedy"]))
        return (
            f"before the event the plant feeds {x['s']:.4g} pu of its rating of {x['rating']:g} MVA: are P and Q in kW "
            f"and kvar? Then give {given}"
        )
    return (
        f"before the event the plant feeds {x['s']:.3g} pu of its rating of {x['rating']:g} MVA: is the rating that of "
        "the whole plant? Give it with "
        + Option.SET
        + " S_n=…, or the power's unit with "
        + Option.CHANNEL
    )


def _rated_frequency(x: Figures) -> str:
    if "left" in x:
        frames = f"{_usual_frames(x, x['seen'])}, and " if "frames" in x else ""
        return (
            f"is the rated frequency {x['seen']:g} Hz? The device has {x['rated']:g} Hz; {frames}with the other one "
            f"{fall_of_error(x)}. If it is so, give "
            + _frequency(x["seen"])
            + "; if not, a droop of the model is wrong"
        )
    if x.get("said"):
        return (
            f"the recording says that its line has {x['seen']:g} Hz, and the device's is {x['rated']:g} Hz: give its "
            "rated frequency, as in " + _frequency(x["seen"]) + ", or another recording"
        )
    return (
        f"before the event the frequency is {x['seen']:.4g} Hz, and the device's is {x['rated']:g} Hz: give its rated "
        "frequency, as in " + _frequency(60) + ", or the channel's unit"
    )


def _frames(x: Figures) -> str:
    return (
        f"{_usual_frames(x, x['grid'])}, and the device has {x['rated']:g} Hz: if it is of the other grid, give "
        + _frequency(x["grid"])
    )


def _usual_frames(x: Figures, hertz: float) -> str:
    return f"{x['frames']:.3g} phasors a second are usual in grids of {hertz:g} Hz"


def _angle_unit(x: Figures) -> str:
    return (
        f"the angle jumps by {x['jump']:.4g} from one sample to the next, or begins beyond a turn: it looks like "
        f"{x['unit']}. Give " + _channel(x["remedy"]) + " if it is"
    )


def _angle_held(x: Figures) -> str:
    return (
        f"{whole_percent(x['part'])} of the angle's samples are that of the sample before: the recorder holds it, and "
        "the device sees steps that the plant did not. Give a recording with its own samples"
    )


def _angle_and_frequency(x: Figures) -> str:
    return (
        f"the angle turns {x['factor']:.4g} times as fast as the recording's frequency says: unit or sign of one is "
        "wrong. If it is the angle's, give " + _channel(x["remedy"])
    )


def _frequency_alone(x: Figures) -> str:
    return (
        "no angle is read, and the voltage's is the integral of the frequency, which recorders filter for 0.1 s and "
        "longer: steps of the angle are missing. Give the angle where it was recorded"
    )


def _phase_order(x: Figures) -> str:
    what = "voltages" if x["what"] == "v" else "currents"
    given = " ".join(map(_channel, x["remedy"]))
    return f"the phases of the {what} follow each other as a, c, b: are two of them exchanged? If so, give {given}"


def _time_unit(x: Figures) -> str:
    return (
        f"the times look like {_TIMES[x['unit']]}: a sample every {x['interval']:.3g} s, {x['length']:.4g} s in all"
        + (f"; read so, {fall_of_error(x)}" if "left" in x else "")
        + ". If they are, give "
        + _channel(x["remedy"])
    )


_TIMES = {
    "us": "microseconds",
    "ms": "milliseconds",
    "min": "minutes",
    "h": "hours",
    "d": "days, as spreadsheets have them",
}


def _slow_samples(x: Figures) -> str:
    return (
        f"a sample every {1000 * x['interval']:.4g} ms tells nothing of a control whose corner, 1/(2πτ), is above "
        f"{x['fastest']:.3g} Hz: controls that act faster{x['such']} are neither confirmed nor refuted by it"
    )


def _missing(x: Figures) -> str:
    if x["of_power"]:
        return (
            f"P or Q is missing in {x['count']} of {x['of']} samples, for up to {x['longest']:.3g} s, where the "
            "voltage is known: they are not compared"
        )
    return (
        f"{x['count']} of {x['of']} samples are missing, for up to {x['longest']:.3g} s: they are bridged in the "
        "voltage and not compared"
    )


def _missing_code(x: Figures) -> str:
    rows = "row" if x["count"] == 1 else "rows"
    return (
        f"{x['column']!r} is {x['value']:.10g} at {x['at']:g} s ({x['count']} {rows}), far from all its other values: "
        "a code for missing? These samples are taken as missing. Leave the cells empty if it is, or give another "
        "column, with " + _channel(f"{x['role']}=COLUMN")
    )


def _unmeasured(x: Figures) -> str:
    return (
        f"P or Q is missing for {x['length']:.3g} s from {x['at']:.4g} s on, where the voltage is known: what the "
        "plant did there is not compared. Give a recording without the gap, or an event apart from it"
    )


def _filled(x: Figures) -> str:
    whose = f" of {' and '.join(map(repr, x['columns']))}" if x["columns"] else ""
    bridged = "" if x["columns"] else "bridged in the voltage and "
    return (
        f"{x['count']} samples{whose} stand still while those before and after move, from {x['at']:.4g} s on: the "
        f"recorder filled a gap with the last value. They are taken as missing: {bridged}not compared"
    )


def _gap_at_event(x: Figures) -> str:
    if x["of_power"]:
        return (
            f"P or Q is missing for {x['length']:.3g} s from {x['at']:.4g} s on, during the event: what the plant did "
            "there is not known, and the event is not judged. Give a recording without the gap, or another event"
        )
    return (
        f"samples are missing for {x['length']:.3g} s from {x['at']:.4g} s on, where the voltage changes: what drove "
        "the plant there is not known, and the event is not judged. Give a recording without the gap, or another event"
    )


def _gap_in_ring_down(x: Figures) -> str:
    return (
        f"samples are missing after the event: the ring-down is that from {x['begin']:.4g} to {x['end']:.4g} s, as a "
        "straight line between samples rings with nothing"
    )


def _lost_jump(x: Figures) -> str:
    return (
        f"the angle lacks up to {x['jump']:.3g} deg {_smoothed(x)}: was the angle integrated from a filtered "
        "frequency, or filtered by itself? Give the angle as it was measured, with "
        + _channel("angle=COLUMN")
    )


def _lost_step(x: Figures) -> str:
    return (
        f"the magnitude of the voltage lacks up to {x['jump']:.3g} pu {_smoothed(x)}: was it filtered by the recorder? "
        "Give the magnitude as it was measured, with " + Option.CHANNEL + " 'v=COLUMN'"
    )


def _smoothed(x: Figures) -> str:
    return (
        f"from {x['at']:.4g} s on, as one that is smoothed over {1000 * x['length']:.3g} ms does; without that "
        f"{fall_of_error(x)}"
    )


def _angle_jump(x: Figures) -> str:
    return (
        f"the angle jumps by {x['jump']:+.3g} deg at {x['at']:.4g} s, where the magnitude stays, and P and Q move by "
        f"{x['seen']:.2g} pu, the model's by {x['asked']:.2g} pu: did the recorder take another reference for the "
        "angle, or lose the time? What comes after is not judged. Give an angle without the jump, with "
        + Option.CHANNEL
        + " 'angle=COLUMN', or the part before, with "
        + Option.STOP
    )


def _angle_reference(x: Figures) -> str:
    if "remedy" in x:
        return (
            f"the angle leaves the integral of the recording's own frequency by up to {x['apart']:.3g} deg: was it "
            "taken against a bus that swings itself? Give an angle against a clock, with "
            + _channel("angle=COLUMN")
            + ", or the frequency in its place, with "
            + _channel(x["remedy"])
        )
    if "offset" in x:
        return (
            f"from {x['at']:.4g} s on P is {x['offset']:+.3g} pu off the model's in the mean, while the recorded angle "
            f"turns by no more than {1000 * abs(x['hertz']):.2g} mHz, which no droop answers so: was the angle taken "
            "against a bus of the same grid, which moves itself, or did a setpoint change? "
            + _OTHER_ANGLE
        )
    return (
        f"before the event the angle moves the model by {x['asked']:.2g} pu, and P and Q move by {x['seen']:.2g} pu: "
        "was the angle taken against a bus that swings itself, or is a control of the model off in the plant? "
        + _OTHER_ANGLE
    )


_OTHER_ANGLE = (
    "Give an angle against a clock, with "
    + _channel("angle=COLUMN")
    + ", or the frequency in its place, with "
    + _channel("f=COLUMN")
)


def _stored_twice(x: Figures) -> str:
    return (
        f"{x['count']} samples in a row, from {x['first']:.4g} s on, come again to the last digit from {x['at']:.4g} s "
        "on, which no instrument measures: was a block stored twice? Give the samples that were measured there, or the "
        "part before, with " + Option.STOP + f" {x['at']:.4g}"
    )


def _lagged(x: Figures) -> str:
    which = " and ".join(x["signals"]).upper().replace("AND", "and")
    follows = "follow" if len(x["signals"]) > 1 else "follows"
    return (
        f"{which} {follows} the model's like one behind a lag of {1000 * x['lag']:.3g} ms, and beside that "
        f"{fall_of_error(x)}: does the recorder filter it, or has the plant a lag that the model lacks? No option "
        f"takes a lag out: export {which} without the filter, or, if another column holds it so, give "
        + " ".join(f"{Option.CHANNEL} '{one}=COLUMN'" for one in x["signals"])
    )


def _read_otherwise(x: Figures) -> str:
    options = (one if one.startswith("--") else _channel(one) for one in x["remedy"])
    given = " ".join(options)
    said = f"{x['reading']}? Read so, {fall_of_error(x)}. If it is so, give {given}"
    if "rating" not in x:
        return said
    now, other = (f"{x[name]:.4g} MVA" for name in ("rating", "other_rating"))
    return f"{said}; a rating of {other} (S_n) in place of {now} would tell the same"


def _stuck(x: Figures) -> str:
    return (
        f"{x['column']!r} is {x['value']:.4g} in all {x['count']} samples, which no instrument measures: was it "
        f"recorded at all? Give the column that holds it, as in "
        + Option.CHANNEL
        + f" '{x['role']}=COLUMN'"
    )


def _power_held(x: Figures) -> str:
    return (
        f"{x['column']!r} stands still to the last digit {x['count']} times while it moves, for {x['usual']:.3g} s and "
        f"up to {x['longest']:.3g} s, and jumps in between: is it stored only every so often, or only where it has "
        "changed by enough? The errors count that as the model's. Give the measured samples, as in "
        + _channel(f"{x['role']}=COLUMN")
    )


def _smoothed_event(x: Figures) -> str:
    return (
        f"from {x['at']:.4g} s on the voltage leaves its steady state little by little, as behind a filter that passes "
        f"about {x['hertz']:.2g} Hz, though its samples would show {x['fastest']:.3g} Hz: did the recorder filter it, "
        "and P and Q with it? What a model does wrong faster than that is hidden, and the event seems to begin early: "
        "no window brings that back. Give the recording as it was measured"
    )


def _spike(x: Figures) -> str:
    return (
        f"{x['column']!r} leaves both samples beside it by {x['jump']:.3g} pu at {x['at']:g} s: is that a fault of the "
        "recorder? Leave the cell empty if it is"
    )


def _clipped(x: Figures) -> str:
    return (
        f"{x['column']!r} comes to {x['value']:.4g} pu at full speed at {x['at']:.4g} s and stays there to the last "
        f"digit for {x['length']:.3g} s: does the recorder's range end there? Give a recording with a wider range, or "
        "the part before, with " + Option.STOP
    )


def _magnitude(x: Figures) -> str:
    return (
        f"{x['column']!r} never falls below zero, where the model's comes to {x['least']:.3g} pu; without the sign the "
        f"error falls from {x['error']:.3g} to {x['left']:.3g} pu (rms): was a magnitude recorded? Give the column "
        "with the sign, as in " + Option.CHANNEL + f" '{x['role']}=COLUMN'"
    )


def _clocks(x: Figures) -> str:
    late = "after" if x["delay"] > 0 else "before"
    both = " by the same time" if x["together"] > 1 else ""
    comes = "come" if "and" in x["which"] else "comes"
    if not x["together"]:
        return (
            f"{x['which']} {comes} {1000 * abs(x['delay']):.3g} ms {late} the rest of the recording, as jumps show, "
            f"and without that {fall_of_error(x)}: do the clocks of magnitude and angle differ? gfor shifts nothing. "
            "Give an export in which both are of one time"
        )
    return (
        f"{x['which']} {comes} {1000 * abs(x['delay']):.3g} ms {late} the model's{both}, and without that "
        f"{fall_of_error(x)}: do the clocks of voltage and power differ, or has the plant a delay that the model "
        "lacks? gfor shifts nothing"
    )


RECORDER_SENTENCES: Mapping[QuestionKind, Sentence] = {
    QuestionKind.VOLTAGE_LEVEL: _voltage_level,
    QuestionKind.RATING: _rating,
    QuestionKind.RATED_FREQUENCY: _rated_frequency,
    QuestionKind.FRAMES: _frames,
    QuestionKind.ANGLE_UNIT: _angle_unit,
    QuestionKind.ANGLE_HELD: _angle_held,
    QuestionKind.ANGLE_AND_FREQUENCY: _angle_and_frequency,
    QuestionKind.FREQUENCY_ALONE: _frequency_alone,
    QuestionKind.PHASE_ORDER: _phase_order,
    QuestionKind.TIME_UNIT: _time_unit,
    QuestionKind.SLOW_SAMPLES: _slow_samples,
    QuestionKind.MISSING: _missing,
    QuestionKind.MISSING_CODE: _missing_code,
    QuestionKind.UNMEASURED: _unmeasured,
    QuestionKind.FILLED: _filled,
    QuestionKind.GAP_AT_EVENT: _gap_at_event,
    QuestionKind.GAP_IN_RING_DOWN: _gap_in_ring_down,
    QuestionKind.LOST_JUMP: _lost_jump,
    QuestionKind.LOST_STEP: _lost_step,
    QuestionKind.ANGLE_JUMP: _angle_jump,
    QuestionKind.ANGLE_REFERENCE: _angle_reference,
    QuestionKind.STORED_TWICE: _stored_twice,
    QuestionKind.STUCK: _stuck,
    QuestionKind.POWER_HELD: _power_held,
    QuestionKind.MAGNITUDE_HELD: _power_held,
    QuestionKind.SMOOTHED: _smoothed_event,
    QuestionKind.SPIKE: _spike,
    QuestionKind.CLIPPED: _clipped,
    QuestionKind.MAGNITUDE: _magnitude,
    QuestionKind.CLOCKS: _clocks,
    QuestionKind.LAGGED: _lagged,
    QuestionKind.READ_OTHERWISE: _read_otherwise,
}
