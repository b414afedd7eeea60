"""A validation as a page that an owner can hand to a planner."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

from orchestrator.core.file_hashes import sha256_of
from orchestrator.output.report.colours import colour
from orchestrator.output.report.html.charts import ChartCurve, legend, line_chart, thinned
from orchestrator.output.report.html.elements import (
    SHADES,
    Figures,
    bullet_list,
    document,
    table,
    verdict_paragraph,
)
from orchestrator.studies.validation.answer import (
    error_alone,
    of_both,
    verdict_of,
    worst_device,
)
from orchestrator.studies.validation.causes import nothing_to_explain
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.figures import SIGNALS
from orchestrator.studies.validation.limits import LimitVerdict
from orchestrator.studies.validation.study import ValidationResult
from orchestrator.studies.validation.tables import (
    beside_table,
    confirmation_table,
    criteria_table,
    explanation_table,
)
from orchestrator.studies.validation.words import (
    difference_sentence,
    explanation_sentence,
    fit_sentence,
    interval_head,
    rating_words,
    sentence,
    untold_words,
    yardstick_sentence,
)

_POWERS = ("p", "q")
_NAMES = {"p": "P", "q": "Q", "i_p": "active current", "i_q": "reactive current"}
_PROCEDURE = (
    "The recorded voltage alone drives the model, which starts at the operating point before the event. Errors are the "
    "simulated less the measured value in pu of the rating, by windows before, during and after the event. Windows and "
    "errors follow published descriptions of the play-back procedure of IEC 61400-27-2; the standard itself was not at "
    "hand when this was written, and nothing here says that it is met."
)


def validation_page(result: ValidationResult) -> str:
    """The whole page."""
    figures = Figures()
    device = result.request.device
    chapters = [("Model", _model(result))]
    for k, one in enumerate(result.comparisons):
        chapters.append((one.event.recording.label, _event(one, figures, result.others[k : k + 1])))
    if result.others:
        chapters.append(("Two models of one plant", _beside(result)))
    if result.criteria:
        chapters.append(("Limits", _limits(result)))
    if result.request.explain:
        chapters.append(("One cause that would explain the error", _explained(result)))
    if result.fit is not None:
        chapters.append(("Fit", _fit(result)))
    chapters.append(("Procedure, and what was not judged", _not_judged(result)))
    told = verdict_of(result)
    answer = (
        error_alone(result)
        if told is None
        else f"{told.word}: {worst_device(result)}: {told.text}."
    )
    shade = SHADES[None if told is None else told.good]
    says = [] if told is None else [yardstick_sentence(of_both(result))]
    places = [one for one in result.apart if one.more_than_from_record]
    if places:
        says.insert(0, difference_sentence(places))
    says += [_causes_said(result)] if result.request.explain else []
    listed_says = "".join(f"<li>{escape(one)}</li>" for one in says)
    below = f"<ul>{listed_says}</ul>" if says else ""
    findings = f'<div class="findings">{verdict_paragraph(shade, escape(answer))}{below}</div>'
    return document(f"Validation of {device.name}", "by recordings", findings, chapters)


def _model(result: ValidationResult) -> str:
    return "".join(map(_model_table, result.devices))


def _model_table(device: PlayedDevice) -> str:
    rows = [
        ["File", escape(device.path.name)],
        ["SHA-256", sha256_of(device.path)],
        ["Model", escape(device.description.model_name)],
        ["Rating", f"{rating_words(device)}; {device.rated_hz:g} Hz"],
        ["Communication step", f"{1e6 * device.step_size:g} µs"],
    ]
    rows += [[escape(name), escape(str(value))] for name, value in device.values.items()]
    return table(f"{device.name} and the values that it was given", ["", ""], rows, left=2)


def _event(one: EventComparison, figures: Figures, others: Sequence[EventComparison]) -> str:
    return "".join(
        [
            _recording(one),
            *_charts(one, figures, others),
            *(_errors(each, by_device=bool(others)) for each in (one, *others)),
            bullet_list(map(sentence, one.questions)),
        ]
    )


def _recording(one: EventComparison) -> str:
    recording, start = one.event.recording, one.event.start
    channels = ", ".join(channel.as_text() for channel in recording.channels.values())
    rows = [
        ["SHA-256", recording.sha256 or "not a file"],
        ["Samples", f"{len(recording.voltage)}, every {1000 * recording.interval:.4g} ms"],
        ["Channels", escape(channels)],
        ["Before the event", f"{abs(start.voltage):.4f} pu, {recording.frame_hz:.4f} Hz"],
        ["P and Q before", f"{start.power.real:.4f} pu, {start.power.imag:.4f} pu"],
    ]
    return table("The recording", ["", ""], rows, left=2)


def _charts(
    one: EventComparison, figures: Figures, others: Sequence[EventComparison]
) -> Iterator[str]:
    """P and Q over the time, of the recording and of each model; the window during the event is shaded."""
    recording = one.event.recording
    times = recording.times + recording.begin
    low, high = one.event.windows.parts["during"]
    during = (recording.begin + low, recording.begin + high, "during the event")
    drawn = [("measured", one.measured), (one.device.name, one.simulated)]
    drawn += [(other.device.name, other.simulated) for other in others]
    for signal in _POWERS:
        curves = [
            ChartCurve(name, colour(k), *thinned(times, values[signal]))
            for k, (name, values) in enumerate(drawn)
        ]
        chart = legend((c.label, c.colour) for c in curves)
        label = f"{_NAMES[signal]} [pu]"
        chart += line_chart(signal, "Time [s]", label, curves, bands=[during])
        yield figures.add(chart, f"{_NAMES[signal]}, measured and simulated.")[0]


def _errors(one: EventComparison, *, by_device: bool) -> str:
    begin = one.event.recording.begin
    rows = []
    for window, of in one.errors.items():
        low, high = one.event.windows.parts[window]
        for signal, found in of.items():
            figures = (found.max_error, found.mean_error, found.mean_abs_error, found.max_of_noise)
            place = f"{window}, {begin + low:.4g} to {begin + high:.4g} s"
            rows.append([place, _NAMES[signal], *(f"{x:.4f}" for x in figures)])
    columns = ["Window", "Signal", "Largest", "Mean", "Mean magnitude", "Largest by noise alone"]
    model = f" of {one.device.name}" if by_device else ""
    return table(f"Errors{model} [pu of the rating]", columns, rows, left=2)


def _beside(result: ValidationResult) -> str:
    places = [one for one in result.apart if one.more_than_from_record]
    said = f"<p>{escape(difference_sentence(places))}</p>" if places else ""
    return said + beside_table(result).html()


def _limits(result: ValidationResult) -> str:
    limits = result.request.limits
    title = f"Limits: {limits.source if limits else ''}"
    return criteria_table(title, result.criteria, by_device=True).html()


def _fit(result: ValidationResult) -> str:
    fit = result.fit
    if fit is None:
        return ""
    rows = [
        [
            escape(one.name),
            str(one.start),
            f"{one.value:.5g}",
            "–" if one.low is None else f"{one.low:.5g} to {one.high:.5g}",
            escape(untold_words(one)),
        ]
        for one in fit.parameters
    ]
    columns = [
        "Parameter",
        "In the model",
        "Fitted",
        interval_head(fit),
        "Can the recordings tell it?",
    ]
    kept = {one.recording: one.agrees for one in result.confirmations if not one.fitted}
    said = f"<p>{escape(fit_sentence(fit, kept))}</p>"
    checks = confirmation_table(result.confirmations).html()
    return table("Fitted parameters", columns, rows) + said + checks


def _explained(result: ValidationResult) -> str:
    said = f"<p>{escape(_causes_said(result))}</p>"
    if not result.explanations or nothing_to_explain(result.explanations):
        return said
    return said + explanation_table(result.explanations).html()


def _causes_said(result: ValidationResult) -> str:
    return explanation_sentence(
        result.explanations,
        finished=not result.interrupted,
        in_step=result.explained_in_step,
        plain=result.plain_part,
        unreached=result.unreached,
        first=result.asked_first,
    )


def _not_judged(result: ValidationResult) -> str:
    texts = [_PROCEDURE]
    if result.request.limits is None:
        texts.append("No limit was given, and nothing was judged.")
    else:
        texts += _left_open(result)
    if result.fit is None:
        texts.append("No parameter was fitted.")
    if not result.request.explain:
        texts.append("No cause of the errors was looked for.")
    texts += [
        f"Tried, and it did not run: {one.tried} ({one.reason})."
        for one in result.refused
        if one.matters
    ]
    return bullet_list(texts)


def _left_open(result: ValidationResult) -> Iterator[str]:
    """Yield what has no limit, what its limit does not decide, and the questions for which a verdict waits."""
    limits = result.request.limits
    judged = {} if limits is None else limits.windows
    without = [
        f"{_NAMES[signal]} {window} the event"
        for window in ("before", "during", "after")
        for signal in SIGNALS
        if signal not in judged.get(window, {})
    ]
    if without:
        yield f"Without a limit, and not judged: {', '.join(without)}."
    for one in result.criteria:
        if one.verdict is LimitVerdict.OPEN:
            yield f"Open: {one.shown_name} of {one.place}; the recording does not decide it."
    for comparison in result.comparisons:
        for asked in comparison.questions:
            if asked.keeps_open:
                yield f"The verdict waits for an answer about {comparison.event.recording.label}: {asked.kind}."
