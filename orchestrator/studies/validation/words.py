"""Sentences of a validation: questions about the model, and the one that answers what was asked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from orchestrator.core.errors import number_of
from orchestrator.core.options import Option
from orchestrator.core.units import whole_percent
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.studies.validation.asked_first import AskedFirst
from orchestrator.studies.validation.beside import WindowApart
from orchestrator.studies.validation.causes import (
    Bound,
    CauseKind,
    Explanation,
    nothing_to_explain,
)
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import EventComparison, JumpDoubt
from orchestrator.studies.validation.fit import Fit, FittedParameter, Untold
from orchestrator.studies.validation.lasting import LastingError
from orchestrator.studies.validation.limits import Criterion, LimitVerdict, OpenCause
from orchestrator.studies.validation.plain_part import PlainPart
from orchestrator.studies.validation.questions import Question, QuestionKind
from orchestrator.studies.validation.recorder_words import (
    RECORDER_SENTENCES,
    Figures,
    Sentence,
    fall_of_error,
)
from orchestrator.studies.validation.swing import PlantSwing, swings_of
from orchestrator.studies.validation.trials import RefusedTrial

_COUPLED_STEP = 100.0  # communication step of a coupled run [us]


def sentence(question: Question) -> str:
    """A question with its figures and what to type."""
    return _SENTENCES[question.kind](question.figures)


def _bases_assumed(x: Figures) -> str:
    return (
        f"the device has no {x['missing']}: {x['assumed']} stands for it, and per unit is of that. Another one goes "
        "into the [rating] of a binding: --binding vendor.toml"
    )


def _no_steady_state(x: Figures) -> str:
    return (
        f"P or Q moves by {x['moves']:.3g} pu before the event: the device starts at the mean, and the event began "
        "outside of steady state. Give an earlier or longer part, or where the event is, with --event"
    )


def _no_event(x: Figures) -> str:
    return (
        f"neither voltage nor power shows an event in {x['last']:.4g} s: the windows are thirds. Give begin and end of "
        "one, as in --event 2.0:2.15"
    )


def _doubt_unknown(x: Figures) -> str:
    return (
        f"the device does not run again as it must to show what the {x['of']} makes of the error where the voltage "
        f"jumps ({x['said']}): no error around the jump is judged. Give a recording in which the voltage moves without "
        "a jump"
    )


def _plant_out_of_step(x: Figures) -> str:
    return (
        f"from {x['at']:.4g} s on the plant itself falls out of step: its current turns by {x['turns']:.2g} turns "
        "beside its own voltage. When that happens hangs on what no recording holds, and the right model may fall a "
        "little earlier, later or not at all: no error after it is judged. Give the part before, with "
        + Option.STOP
        + f" {x['at']:.4g}"
    )


def _start(x: Figures) -> str:
    return (
        f"at rest before the event the device feeds P = {x['p']:.4g}, Q = {x['q']:.4g} pu, and the plant fed "
        f"{x['p_measured']:.4g}, {x['q_measured']:.4g}: it does not start where it is told. Does its binding have "
        "P_0, Q_0, v_0 and theta_0 (gfor fmu bind), and its rating?"
    )


def _meter_elsewhere(x: Figures) -> str:
    side = "the grid's side" if x["reactance"] > 0 else "the device's side"
    meters = {"": "the meter", "V": "the meter of the voltage alone", "PQ": "that of P and Q alone"}
    given = f"X {x['reactance']:.3g}" + (f" of {x['of']}" if x["of"] else "")
    return (
        f"is {meters[x['of']]} at {side} of a transformer that the model does not hold? With a reactance of "
        f"{abs(x['reactance']):.3g} pu between meter and port {fall_of_error(x)}. If it is so, give its own, such as "
        f"--transformer '{given}'; if not, a reactance of the model is wrong"
    )


def _setpoint(x: Figures) -> str:
    name = x["signal"].upper()
    if x.get("within"):
        return (
            f"from {x['at']:.4g} s on {name} is {x['offset']:+.3g} pu off the model's and stays so, whatever frequency "
            "and voltage do: did a setpoint change during the event? " + _without_step(x)
        )
    if x.get("drifts"):
        return (
            f"from {x['at']:.4g} to {x['until']:.4g} s {name} leaves the model's along a straight line, by "
            f"{x['offset']:+.3g} pu, while the angle of the voltage drifts: did a setpoint ramp, or did a control "
            "beyond the plant (AGC) move it? " + _before_setpoint(x)
        )
    if "until" in x:
        return (
            f"from {x['at']:.4g} to {x['until']:.4g} s {name} leaves the model's along a straight line, by "
            f"{x['offset']:+.3g} pu, which the voltage does not explain: did a setpoint ramp? "
            + _before_setpoint(x)
        )
    return (
        f"at {x['at']:.4g} s {name} leaves the model's by {x['offset']:+.3g} pu and stays, and the "
        "voltage does nothing then: did a setpoint change? " + _before_setpoint(x)
    )


def _without_step(x: Figures) -> str:
    if x.get("tried"):
        return "No cause that was tried explains it; causes are those of the rest, without the step"
    return f"Type {Option.EXPLAIN}: it tries what else explains it, and looks at the rest without the step"


def _before_setpoint(x: Figures) -> str:
    """The remedy: causes are looked for before a setpoint changed, and a fit is given that part."""
    given = Option.STOP + f" {x['stop']:.4g}"
    if x.get("tried"):
        return (
            f"No cause that was tried explains it. Give the part before to the rest, with {given}"
        )
    return (
        f"Type {Option.EXPLAIN}: it tries what else explains it. If it was a setpoint, give the part before, with "
        f"{given}"
    )


def _out_of_step(x: Figures) -> str:
    return (
        f"from {x['at']:.4g} s on the model falls out of step (its P is {x['own']:.3g} pu in the mean of the end, the "
        f"plant's {x['seen']:.3g} pu), and a recorded voltage does not bring it back: near its limit of the current "
        "little makes it fall, and what comes after tells no value. "
        + Option.EXPLAIN
        + " looks at the part before; "
        "give it to " + Option.FIT + " as well, with " + Option.STOP + f" {x['at']:.4g}"
    )


def _slip(x: Figures) -> str:
    return (
        f"from {x['at']:.4g} s on the model falls out of step: its current turns past the opposite of the plant's. "
        "What comes after tells no value: "
        + Option.EXPLAIN
        + " looks at the part before; give it to "
        + Option.FIT
        + " as well, with "
        + Option.STOP
        + f" {x['at']:.4g}"
    )


def _second_event(x: Figures) -> str:
    return (
        f"at about {x['at']:.4g} s a second event begins, after that at {x['first']:.4g} s: errors, ring-down and "
        "step are those before it. Give what comes later as a recording of its own, with "
        + Option.START
        + " in the quiet before it"
    )


def _over_limit(x: Figures) -> str:
    return (
        f"from {x['at']:.4g} s on the model's current is above its limit for {x['length']:.3g} s in all, up to "
        f"{x['largest']:.3g} times (current_limit), and the model does not limit it: what it does from there on is not "
        f"the plant's, whose largest current is {x['plant']:.3g} pu. Give the EMT model as well, with "
        + Option.BESIDE
    )


def _other_event(x: Figures) -> str:
    moves = f"P and Q move by {x['moves']:.3g} pu and more at {x['at']:.4g} s"
    if "voltage_at" in x:
        return (
            f"the voltage jumps at {x['voltage_at']:.4g} s, where the model moves by {x['asked']:.3g} pu and the plant "
            f"does nothing; {moves}, where the voltage does nothing: are they of another event, or do the clocks "
            f"differ by {abs(x['at'] - x['voltage_at']):.3g} s? Give voltage, P and Q of one event and one clock, with "
            + Option.CHANNEL
        )
    return (
        f"{moves} and the voltage does not, neither its magnitude nor its angle: are P and Q of another event, or of "
        "another plant? Through any line they would move the voltage as well. Give voltage, P and Q of one event, with "
        + Option.CHANNEL
    )


def _too_good(x: Figures) -> str:
    return (
        f"the model agrees to {x['error']:.1g} pu (median) with a recording that scatters by {x['scatter']:.1g} pu: "
        "was it made by this model? It proves nothing of a plant then"
    )


def _no_noise(x: Figures) -> str:
    return (
        f"before the event P and Q scatter by {x['scatter']:.1g} pu, which is less than an instrument's noise: the "
        "recording is a simulation, or holds what changes little"
    )


def _noise(x: Figures) -> str:
    return (
        f"the recording's own noise is {x['scatter']:.2g} pu, more than the largest error allowed: it allows no "
        "verdict"
    )


def _short_before(x: Figures) -> str:
    return (
        f"{x['length']:.3g} s before the event show neither its operating point nor its noise well: figures of noise "
        "are uncertain"
    )


_SENTENCES: Mapping[QuestionKind, Sentence] = {
    **RECORDER_SENTENCES,
    QuestionKind.BASES_ASSUMED: _bases_assumed,
    QuestionKind.NO_STEADY_STATE: _no_steady_state,
    QuestionKind.NO_EVENT: _no_event,
    QuestionKind.DOUBT_UNKNOWN: _doubt_unknown,
    QuestionKind.PLANT_OUT_OF_STEP: _plant_out_of_step,
    QuestionKind.START: _start,
    QuestionKind.METER_ELSEWHERE: _meter_elsewhere,
    QuestionKind.SETPOINT: _setpoint,
    QuestionKind.OUT_OF_STEP: _out_of_step,
    QuestionKind.SECOND_EVENT: _second_event,
    QuestionKind.SLIP: _slip,
    QuestionKind.OVER_LIMIT: _over_limit,
    QuestionKind.OTHER_EVENT: _other_event,
    QuestionKind.TOO_GOOD: _too_good,
    QuestionKind.NOISE: _noise,
    QuestionKind.NO_NOISE: _no_noise,
    QuestionKind.SHORT_BEFORE: _short_before,
}


def sentences(questions: Sequence[Question]) -> list[str]:
    return [sentence(one) for one in questions]


def untold_words(one: FittedParameter) -> str:
    """Say if the recordings can tell a parameter, and why not."""
    match one.untold:
        case None:
            return "yes"
        case Untold.ALIKE:
            return f"no: not apart from {', '.join(one.alike)}"
        case Untold.NO_EFFECT:
            return "no: it moves nothing that the recordings hold"
        case Untold.TOO_FAST:
            return "no: it is shorter than the interval between samples"
        case Untold.AT_BOUND:
            return "no: it ends at its bound"
        case Untold.NO_BETTER:
            return "no: no value that was found leaves clearly less of the error"
        case Untold.INTERRUPTED:
            return "not told: the fit was interrupted before it had an interval"
        case Untold.WIDE:
            return "no: its interval is as large as itself"


_UNITS = {"p": "MW", "q": "Mvar"}


def worst_of(comparisons: Sequence[EventComparison]) -> EventComparison:
    """The event, and of two models the one, with the largest error of P or Q."""
    return max(comparisons, key=lambda each: each.largest_error[2].max_error)


def error_sentence(comparisons: Sequence[EventComparison]) -> str:
    """Say how large the largest error of P or Q is, and where."""
    one = worst_of(comparisons)
    window, signal, figures = one.largest_error
    size = (
        f"{figures.max_error:.3g} pu ({figures.max_error * one.device.rating:.3g} {_UNITS[signal]})"
    )
    text = (
        f"the largest error is {size}, of {signal.upper()} {window} the event of "
        f"{one.event.recording.label}, at {figures.max_at:.4g} s"
    )
    if one.doubt is JumpDoubt.SAMPLES and figures.max_of_noise >= figures.max_error:
        text += ", which is no more than the moment of the voltage's jump between two samples makes"
    return text


def lasting_sentence(errors: Sequence[LastingError], *, explained: bool) -> str:
    """Say that errors within the limits are no noise, and what looks for their cause; empty where there are none.

    ``explained``: whether that was asked for already."""
    if not errors:
        return ""
    worst, more = errors[0], len(errors) - 1
    part = "" if worst.part is None else f", {whole_percent(worst.part)} of its swing (rms)"
    others = f", and {number_of(more, 'signal')} more" if more else ""
    hint = "" if explained else f": type {Option.EXPLAIN}, which looks for the cause"
    return (
        f"within the limits, but clearly more than the recording's noise, is the error of {worst.signal.upper()} after "
        f"the event of {worst.recording}: {worst.mean:+.2g} pu in the mean, {worst.usual:.2g} pu in magnitude{part}"
        f"{others}{hint}"
    )


def yardstick_sentence(comparisons: Sequence[EventComparison]) -> str:
    """Lay the errors of the worst event beside its own swing and beside what the recording leaves open."""
    one = worst_of(comparisons)
    swings = swings_of(one)
    seen = [f"{name.upper()} by {_off(swing)}" for name, swing in swings.items() if swing.seen]
    still = [name.upper() for name, swing in swings.items() if not swing.seen]
    said = []
    if seen:
        said.append(f"From the event on the model misses {', and '.join(seen)}.")
    if still:
        said.append(f"The event moves {' and '.join(still)} by no more than instruments do.")
    figures = one.largest_error[2]
    said.append(
        f"Of the largest error, up to {figures.max_of_noise:.2g} pu may be the recording's noise and samples, and none "
        "of the model's."
    )
    return " ".join(said)


def _off(swing: PlantSwing) -> str:
    part, mean = 100 * (swing.part or 0.0), 100 * (swing.rms_part or 0.0)
    return f"up to {part:.0f} % of the {swing.largest:.3g} pu that the plant swings ({mean:.0f} % in the mean)"


def rating_words(device: PlayedDevice) -> str:
    """The rating, and from where it is if nobody gave it."""
    own = "" if device.rating_is_told else ", the start value of its file's S_n"
    return f"{device.rating:g} MVA{own}"


def swing_cell(comparison: EventComparison) -> str:
    """The rms errors of P and Q as parts of the plant's own swing; a dash where it has none."""
    parts = [one.rms_part for one in swings_of(comparison).values()]
    return ", ".join("–" if part is None else f"{part:.0%}" for part in parts)


_WHY_OPEN = {
    OpenCause.SCATTER: "the recording's own noise is as large as the limit",
    OpenCause.SAMPLES: "between two samples it is not known when the voltage jumped",
    OpenCause.STEP: "the device sees a jump of the voltage only at the begin of its step",
    OpenCause.FIXED_STEP: "the device sees a jump of the voltage only at the begin of its step, and refuses a "
    "shorter one",
    OpenCause.LOW_VOLTAGE: "the voltage is near zero there, and the noise of P and Q over it is a current by itself; "
    "no option decides it, and limits of P and Q do",
    OpenCause.RING_DOWN: "seen from a little later on, or by a model of another order, the ring-down has another mode; "
    "no option decides it, and a recording that shows more of the swing may",
    OpenCause.FEW_PERIODS: "the recording holds too little of the swing",
    OpenCause.NO_FIGURE: "the recording shows none, or no shift of it fits the model",
    OpenCause.NO_SUCH_MODE: "the plant rings with a mode that the model does not show",
}


def open_sentence(criteria: Sequence[Criterion], devices: Sequence[PlayedDevice]) -> str:
    """Say how many limits are met, which stay open, why, and what would help; empty where none is open."""
    left = [one for one in criteria if one.verdict is LimitVerdict.OPEN]
    if not left:
        return ""
    said = []
    for cause in OpenCause:
        own = [one for one in left if one.why_open is cause]
        if not own:
            continue
        names = _names_by_place(own, criteria)
        hint = ""
        if cause is OpenCause.STEP:
            hint = "; give " + Option.STEP + f" '{_finer_step(devices):g} us'"
        if cause is OpenCause.FEW_PERIODS:
            doubts = dict.fromkeys(text for one in own for text in one.doubts)
            hint += f": {'; '.join(doubts)}"
        hint += "".join(dict.fromkeys(map(_rings, own)))
        said.append(f"{names} ({_WHY_OPEN[cause]}{hint})")
    met = sum(one.verdict is LimitVerdict.MET for one in criteria)
    return f"{met} of {len(criteria)} limits are met, and these stay open: {'; '.join(said)}"


def _names_by_place(own: Sequence[Criterion], criteria: Sequence[Criterion]) -> str:
    """The names of criteria; with the recording and the model where there are several of those."""
    several = len({one.recording for one in criteria}) > 1
    models = len({one.device for one in criteria}) > 1
    by_place: dict[str, dict[str, None]] = {}
    for one in own:
        shown = one.place if models else one.recording
        place = f" of {shown}" if several or models else ""
        by_place.setdefault(place, {})[one.shown_name] = None
    return ", ".join(f"{', '.join(names)}{place}" for place, names in by_place.items())


def _rings(one: Criterion) -> str:
    """Name the modes that another look may take for the strongest one, of both; empty where the plant has one."""
    measured, own = one.rings
    if len(measured) < 2:
        return ""
    signal = one.name.rpartition(" ")[0]
    return f"; {signal}: the plant has {_frequencies(measured)}, the model {_frequencies(own)}"


def _frequencies(modes: Sequence[IdentifiedMode]) -> str:
    return " and ".join(
        f"{one.frequency_hz:.3g} Hz at {one.damping_percent:.3g} %" for one in modes
    )


def _finer_step(devices: Sequence[PlayedDevice]) -> float:
    """A communication step [us] in which a jump is seen in time: that of a coupled run, or half a stranger's own."""
    if all(one.takes_any_step for one in devices):
        return _COUPLED_STEP
    return 0.5e6 * devices[0].step_size


def difference_sentence(places: Sequence[WindowApart]) -> str:
    """Say that two models of a plant differ from each other more than from the recording, and where the most."""
    worst = max(places, key=lambda one: one.apart)
    many = "" if len(places) == 1 else f", and in {len(places) - 1} more of the table's rows"
    return (
        f"The two models differ from each other more than from the record: {worst.signal.upper()} {worst.window} the "
        f"event of {worst.recording} by {worst.apart:.3g} pu (rms), from the record by {worst.first:.3g} and "
        f"{worst.second:.3g} pu{many}."
    )


EXPLANATION_COLUMNS = ("Cause", "Now", "Instead", "rms error left [pu]", "Explains", "Likely")
"""Heads of `explanation_cells`."""


_HELD = (
    "For that the model was held in step: the voltage's angle gives way to the model's current, and what it gives way "
    "counts as an error."
)


def value_text(value: float | bool | None) -> str:
    """Write a value with four digits; a dash where there is none."""
    if value is None:
        return "–"
    return str(value).lower() if isinstance(value, bool) else f"{value:.4g}"


def bound_text(bound: Bound) -> str:
    """Write a bound with two digits."""
    return f"at {'least' if bound.is_least else 'most'} {float(f'{bound.value:.2g}'):g}"


def explanation_cells(one: Explanation) -> tuple[str, ...]:
    """Cells of a table's row: the cause, its values, the error left and the part that it explains."""
    unit = f" [{one.unit}]" if one.unit not in ("", "1") else ""
    beside = "".join(f", {name} = {value_text(x)}" for name, x in one.beside.items())
    return (
        f"{one.name}{unit}",
        value_text(one.now),
        f"{value_text(one.value) if one.bound is None else bound_text(one.bound)}{beside}",
        f"{one.left:.4g} of {one.error:.4g}",
        whole_percent(one.share),
        _likely(one),
    )


def _likely(one: Explanation) -> str:
    if one.outdone:
        return "no: another leaves clearly less"
    if one.stands_in:
        return "no: the model lacks a limit"
    if one.hardly_beyond:
        return "no: the error is hardly more than noise"
    if one.explains:
        return "only if the answer is no" if one.behind_question else "yes"
    return "no"


def explanation_sentence(
    explanations: Sequence[Explanation],
    *,
    finished: bool = True,
    in_step: bool = False,
    plain: PlainPart | None = None,
    unreached: Sequence[str] = (),
    first: AskedFirst | None = None,
) -> str:
    """Name the cause that explains the most, and those that explain nearly as much.

    ``first``: what explains more than they do if the answer is yes;
    ``finished``: whether all causes were tried; ``in_step``: whether the model was held in step for them; ``plain``: up
    to where the first one holds without that; ``unreached``: limits beside it that the model does not reach with it."""
    if nothing_to_explain(explanations):
        said = _said_of_noise(explanations[0])
        return said if finished else f"Interrupted before all causes were tried. {said}"
    said = _said_of_causes(explanations, finished=finished, in_step=in_step)
    if in_step:
        said += f" {_HELD}"
    if plain is not None:
        said += f" {_plainly(plain)}"
    if unreached:
        said += (
            f" With it the model does not come near {' and '.join(unreached)}: the recording does not tell whether "
            "that is right."
        )
    if first is not None:
        said = f"{_said_of_questions(first)} If the answer is no, {said[0].lower()}{said[1:]}"
    return said if finished else f"Interrupted before all causes were tried. {said}"


def _said_of_noise(one: Explanation) -> str:
    """Say that there is nothing to explain, and lay the error beside the recording's own noise."""
    return (
        f"There is nothing to explain: without what the voltage's jumps between samples make, the error is "
        f"{one.error:.3g} pu (rms), hardly more than the recording's own noise of {one.noise:.3g} pu. No cause is "
        "likely."
    )


def _said_of_questions(first: AskedFirst) -> str:
    """Say what is asked as the likeliest explanation."""
    asked = "; of ".join(f"{label}: {sentence(question)}" for label, question in first.asked)
    return f"The likeliest explanation is a yes to what is asked of {asked}."


def _plainly(part: PlainPart) -> str:
    """Say up to where a cause holds in plain play-back, with which value, and what confirms it."""
    stop = Option.STOP + f" {part.until:.4g}"
    given = " ".join(f"{Option.SET} {name}={value_text(x)}" for name, x in part.values.items())
    if not part.shows:
        return (
            f"Without that it leaves the plant at once, at {part.until:.4g} s of {part.recording}: no part of the "
            "recording confirms the cause. Give a recording of a smaller event as well."
        )
    leaves = f"{part.left:.2g} of {part.error:.2g} pu (rms)"
    if not part.confirms:
        return (
            f"Without that it leaves the plant at {part.until:.4g} s of {part.recording}, and up to there {leaves} "
            f"are left: the recording does not confirm the cause. {Option.EXPLAIN} {stop} looks at that part alone."
        )
    values = " and ".join(f"{name} = {value_text(x)}" for name, x in part.values.items())
    if part.to_end:
        stays = f"to the end of {part.recording} with {values}, which leaves {leaves}"
        confirm = given
    else:
        stays = f"up to {part.until:.4g} s of {part.recording} with {values}, which leaves {leaves} up to there"
        confirm = f"{given} {stop}"
    return (
        f"Without that the model stays beside the plant {stays}: confirm it with {confirm}. An interval is not given: "
        "what the voltage does between the samples moves the value by more than their noise."
    )


def _said_of_causes(explanations: Sequence[Explanation], *, finished: bool, in_step: bool) -> str:
    if not explanations:
        return "No cause that was tried leaves less of the error."
    best = explanations[0]
    part = f"{whole_percent(best.share)} of the squared error beyond the recording's own noise"
    if best.cause in (CauseKind.LAG, CauseKind.CLOCK):
        return f"The likeliest cause is {_cause(best)}: it explains {part}, and no parameter was tried beside it."
    if best.stands_in:
        return (
            "No cause is named: the model's current is above a limit that it lacks, as the note says, and values only "
            f"stand in for that limit. The nearest is {_cause(best)}, with {part}. Give the EMT model, or a recording "
            "of a smaller event."
        )
    if not best.explains:
        return f"No cause by itself explains most of the error; the nearest is {_cause(best)}, with {part}."
    are, they = ("causes are", "they explain") if best.beside_now else ("cause is", "it explains")
    said = f"The likeliest {are} {_cause(best)}: {they} {part}{_first_alone(explanations)}."
    alike = [one for one in explanations[1:] if one.name != best.name and one.explains]
    if not in_step:  # what gives way leaves something of the right value as well
        said += _left_over(best, finished=finished)
    if alike:
        said += f" The recordings tell it hardly apart from {'; '.join(map(_cause, alike))}."
    return said


def _first_alone(explanations: Sequence[Explanation]) -> str:
    """Say which part the first of two causes explains by itself; empty where there is one."""
    best, *others = explanations
    alone = next((one for one in others if one.name == best.name and one.takes_second), None)
    if not best.beside_now or alone is None:
        return ""
    return f", {best.name} by itself {100 * alone.share:.1f} % and leaves {alone.left:.2g} pu (rms)"


def _left_over(best: Explanation, *, finished: bool) -> str:
    """Say what the likeliest cause leaves, where that stands above the recording's own noise.

    ``finished``: whether a second one was looked for."""
    left = f" {best.left:.2g} pu (rms) are left"
    if best.leaves_much:
        times = f", {_times_noise(best)}" if best.noise > 0 else ""
        return (
            f"{left}{times}: something else may be off as well, and its part is in this value; "
            + Option.FIT
            + " finds several values together."
            + (_no_second(best) if finished and best.takes_second else _second_cause(best))
        )
    if best.leaves_some:
        return f"{left}, {_times_noise(best)}, as samples and steps make as well." + _second_cause(
            best
        )
    return ""


def _times_noise(one: Explanation) -> str:
    return f"{one.left / one.noise:.0f} times the recording's own noise"


def _no_second(one: Explanation) -> str:
    """Say that no cause was found beside the first, and what tries all of them there."""
    return (
        f" No second number or switch beside it explains most of that; {_options_of(one)} {Option.EXPLAIN} tries all "
        "causes from there."
    )


def _second_cause(one: Explanation) -> str:
    """Say how another cause beside the first is looked for; empty where that is no value of a parameter."""
    given = _options_of(one)
    return f" A second cause is looked for with {given} {Option.EXPLAIN}." if given else ""


def _options_of(one: Explanation) -> str:
    """The options with which a device has a cause; empty where that is no value of a parameter."""
    return " ".join(f"{Option.SET} {name}={value_text(x)}" for name, x in one.values.items())


def _cause(one: Explanation) -> str:
    unit = f" {one.unit}" if one.unit not in ("", "1") else ""
    beside = "".join(f" with {name} = {value_text(x)}" for name, x in one.beside.items())
    match one.cause:
        case CauseKind.DELAY:
            way = "later" if one.value > 0 else "earlier"
            what = one.name.removeprefix("delay of ").removeprefix("delay before ")
            return f"{what} coming {abs(one.value):.3g} s {way} in the plant"
        case CauseKind.LIMIT:
            return f"a current that the plant limits to {one.value:.4g}{unit}"
        case CauseKind.LAG:
            which = one.name.removeprefix("lag of ")
            return f"{which} behind a lag of {1000 * one.value:.3g} ms, which the question above asks about"
        case CauseKind.CLOCK:
            way = "later" if one.value > 0 else "earlier"
            which = one.name.removeprefix("delay of ")
            return f"{which} coming {1000 * abs(one.value):.3g} ms {way}, which the question above asks about"
        case CauseKind.PAIR:
            others = [
                f" together with {name} = {value_text(x)} (now {value_text(one.beside_now[name])})"
                for name, x in one.beside.items()
            ]
            first = f"{one.name} = {value_text(one.value)}{unit} (now {value_text(one.now)})"
            return first + "".join(others)
        case _ if one.bound is not None:
            of = f"{one.name} of {bound_text(one.bound)}{unit} (now {value_text(one.now)})"
            return f"{of}, {_beyond(one.bound)}"
        case _:
            return f"{one.name} = {value_text(one.value)}{unit}{beside} (now {value_text(one.now)})"


def _beyond(bound: Bound) -> str:
    """Say why no single value is told."""
    if not bound.is_reached:
        return "which the recording does not reach"
    return f"of which the recording tells no {'larger' if bound.is_least else 'smaller'} one apart"


_NAMED = 2  # trials that did not run, in the sentence that counts them


def refused_sentence(refused: Sequence[RefusedTrial]) -> str:
    """Name the first trials that did not run, and count the others: nothing vanishes."""
    many = number_of(len(refused), "trial")
    named = "; ".join(f"{one.tried} ({one.reason})" for one in refused[:_NAMED])
    more = len(refused) - _NAMED
    others = f"; JSON and the page name {more} more" if more > 0 else ""
    return f"{many} of other readings or values did not run: {named}{others}."


def interval_head(fit: Fit) -> str:
    """The head of a column with intervals, which says if they do not hold."""
    return "95 %" if fit.holds else "95 %, does not hold"


_AGREEMENT = {
    True: "agrees with it",
    False: "does NOT agree with it: with the fitted values its error falls by far less",
    None: "tells nothing of it: the fit lowers the error by too little",
}


def fit_sentence(fit: Fit, kept_back: Mapping[str, bool | None]) -> str:
    """Say on what a fit rests, and if an event that it did not see confirms it.

    ``kept_back``: whether each such event agrees; None where the fit changes too little to tell."""
    seen = ", ".join(fit.fitted_to)
    said = f"Fitted to {seen} in {fit.runs} runs"
    if not fit.finished:
        said += ", interrupted: the best values so far, without intervals"
    if not fit.reached:
        said += f"; the error that is left is {fit.error_after:.3g} times the recording's own noise"
    if not fit.reached and fit.finished:
        said += (
            ": another parameter is wrong, or the fit ended at the wrong values, or the samples hold too little of "
            "what drove the plant. The intervals do not hold then: start elsewhere, with --set"
        )
    if kept_back:
        words = [
            f"{name} was kept back, and {_AGREEMENT[word]}" for name, word in kept_back.items()
        ]
        return f"{said}; {'; '.join(words)}."
    said += "; no other event confirms it: give one with --hold-back."
    return f"{said} Intervals hold if the model has the right form." if fit.holds else said
