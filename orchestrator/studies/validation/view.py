"""A validation as Python has it, as JSON, and as the tables of the first screen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.core.asked import whole_number
from orchestrator.core.errors import number_of
from orchestrator.core.late import pd
from orchestrator.core.safe_files import made_folder
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.output.report.column_table import ShownTable
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.report.pdf import print_pdf
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.signals.signal_modes import doubt_text
from orchestrator.studies.validation.answer import (
    error_alone,
    of_both,
    verdict_of,
    worst_device,
)
from orchestrator.studies.validation.causes import nothing_to_explain
from orchestrator.studies.validation.event import EventComparison
from orchestrator.studies.validation.fit import Fit
from orchestrator.studies.validation.limits import Criterion, LimitVerdict
from orchestrator.studies.validation.questions import Question
from orchestrator.studies.validation.study import ValidationResult
from orchestrator.studies.validation.swing import swings_of
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
    refused_sentence,
    sentence,
    swing_cell,
    untold_words,
    value_text,
)

_POWERS = ("p", "q")
_SHOWN = 8  # criteria that are listed on the first screen


class Validation:
    """A device beside recordings of the plant. `validate` makes it.

    Attributes
    ----------
    result
        The comparisons, with measured and simulated signals, criteria and fit.
    """

    def __init__(self, result: ValidationResult) -> None:
        self.result = result

    @property
    def verdict(self) -> str | None:
        """``met``, ``not met`` or ``open``; None without limits."""
        return None if self.result.verdict is None else str(self.result.verdict)

    @property
    def questions(self) -> list[str]:
        """Doubts about the recordings, in sentences."""
        return [text for _, text in self._sentences()]

    @property
    def open_questions(self) -> list[str]:
        """Those that keep a verdict open until they are answered."""
        return [text for asked, text in self._sentences() if asked.keeps_open]

    @property
    def notes(self) -> list[str]:
        """Those to be borne in mind, which leave a verdict standing."""
        return [text for asked, text in self._sentences() if not asked.keeps_open]

    def _sentences(self) -> Iterator[tuple[Question, str]]:
        for one in self.result.comparisons:
            label = one.event.recording.label
            yield from ((asked, f"{label}: {sentence(asked)}") for asked in one.questions)
        for one in self.result.others:
            place = f"{one.event.recording.label}, {one.device.name}"
            own = one.questions[len(one.event.questions) :]
            yield from ((asked, f"{place}: {sentence(asked)}") for asked in own)

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor validate --json`` prints, as JSON's types."""
        device, limits = self.result.request.device, self.result.request.limits
        events = [_event_json(one) for one in self.result.comparisons]
        criteria = [one.as_json() for one in self.result.criteria]
        return {
            "device": device.name,
            "model": device.description.model_name,
            "rating_mva": device.rating,
            "rated_hz": device.rated_hz,
            "step_s": device.step_size,
            "values": dict(device.values),
            "events": events,
            "verdict": self.verdict,
            "limits": None if limits is None else limits.source,
            "criteria": criteria,
            **self._beside_json(),
            **self._fit_json(),
            **self._explained_json(),
            "refused": [one.as_json() for one in self.result.refused],
            "finished": self.result.finished,
        }

    def _beside_json(self) -> dict[str, Any]:
        other = self.result.request.beside
        if other is None:
            return {}
        events = [_event_json(one) for one in self.result.others]
        apart = [one.as_json() for one in self.result.apart]
        return {"beside": {"device": other.name, "events": events, "apart": apart}}

    def _explained_json(self) -> dict[str, Any]:
        if not self.result.request.explain:
            return {}
        part = self.result.plain_part
        return {
            "asked_first": self._asked_json(),
            "explanations": [one.as_json() for one in self.result.explanations],
            "explained_in_step": self.result.explained_in_step,
            "unreached_limits": list(self.result.unreached),
            "explained_plainly": None if part is None else part.as_json(),
        }

    def _asked_json(self) -> dict[str, Any] | None:
        first = self.result.asked_first
        if first is None:
            return None
        asked = [
            {"recording": label, **_question_json(question)} for label, question in first.asked
        ]
        return {"questions": asked, "rms_now_pu": first.error, "rms_left_pu": first.left}

    def _fit_json(self) -> dict[str, Any]:
        fit = self.result.fit
        if fit is None:
            return {}
        parameters = [one.as_json() | {"holds": fit.holds} for one in fit.parameters]
        checks = [one.as_json() for one in self.result.confirmations]
        return {
            "fit": parameters,
            "fit_finished": fit.finished,
            "fit_reached": fit.reached,
            "fit_error_scatters": fit.error_after,
            "fit_error_beyond_jumps_scatters": fit.beyond,
            "fit_runs": fit.runs,
            "fit_events": checks,
        }

    def html(self) -> str:
        """A page with the model, the recordings, errors, pictures, limits, fit, and what was not judged."""
        from orchestrator.studies.validation.page import validation_page  # noqa: PLC0415 - only where it is asked for

        return validation_page(self.result)

    def save(self, folder: str | Path, *, pdf: bool = False) -> list[Path]:
        """Write figures, curves and the page into a folder; returns their paths.

        ``pdf``: whether an installed browser prints the page as well; an `InputError` is raised where there is none."""
        place = made_folder(folder, "folder")
        with staged(place, new_run_id()) as staging:
            save_json(self.as_json(), staging / "validation.json")
            for k in range(len(self.result.comparisons)):
                save_table(self._rows(k), staging / f"curves_{k + 1}.csv")
            (staging / "validation.html").write_text(self.html(), encoding="utf-8")
        names = ["validation.json", "validation.html"]
        names += [f"curves_{k + 1}.csv" for k in range(len(self.result.comparisons))]
        files = [place / name for name in names]
        if pdf:
            files.append(print_pdf(place / "validation.html", place / "validation.pdf"))
        return files

    def _rows(self, number: int) -> list[dict[Any, Any]]:
        rows: list[dict[Any, Any]] = self.curves(number).reset_index().to_dict("records")
        return rows

    def fitted(self) -> pd.DataFrame:
        """One row for each fitted parameter: start, value, interval of 95 %, and whether the recordings can tell it."""
        return pd.DataFrame(self._fit_json().get("fit", []))

    def table(self) -> pd.DataFrame:
        """One row for each recording, window and signal, with its errors [pu of the rating]."""
        rows = [
            {"recording": one.event.recording.label, "window": window, "signal": signal}
            | figures.as_json()
            for one in self.result.comparisons
            for window, of in one.errors.items()
            for signal, figures in of.items()
        ]
        return pd.DataFrame(rows)

    def curves(self, number: int = 0) -> pd.DataFrame:
        """Measured and simulated signals of one recording [pu of the rating], over its time [s]."""
        most = len(self.result.comparisons) - 1
        one = self.result.comparisons[whole_number(number, "number", 0, most)]
        columns = {f"{name}_measured": x for name, x in one.measured.items()}
        columns |= {f"{name}_simulated": x for name, x in one.simulated.items()}
        recording = one.event.recording
        return pd.DataFrame(columns, index=pd.Index(recording.times + recording.begin, name="time"))

    def __repr__(self) -> str:
        many = number_of(len(self.result.comparisons), "recording")
        return f"<Validation of {self.result.request.device.name} by {many}: {self.verdict or 'no limits'}>"

    def _repr_html_(self) -> str:
        told = verdict_of(self.result)
        top = (
            headline(error_alone(self.result), None)
            if told is None
            else headline(str(told), told.good)
        )
        return page(
            repr(self).strip("<>").partition(": ")[0], self.questions, self.table(), verdict=top
        )


def _event_json(one: EventComparison) -> dict[str, Any]:
    event, recording = one.event, one.event.recording
    start = {
        "v_pu": abs(event.start.voltage),
        "p_pu": event.start.power.real,
        "q_pu": event.start.power.imag,
        "frequency_hz": recording.frame_hz,
    }
    channels = {role: channel.as_text() for role, channel in recording.channels.items()}
    signals = {name: figures.as_json() for name, figures in one.signals.items()}
    swings = {name: swing.as_json() for name, swing in swings_of(one).items()}
    return {
        "recording": recording.label,
        "sha256": recording.sha256,
        "samples": len(recording.voltage),
        "interval_s": recording.interval,
        "channels": channels,
        "start": start,
        "settled_after_s": one.played.settled_after,
        "windows_found": not event.windows.chosen,
        "windows": [_window_json(one, name) for name in one.errors],
        "signals": signals,
        "swings": swings,
        "questions": [_question_json(question) for question in one.questions],
    }


def _window_json(one: EventComparison, name: str) -> dict[str, Any]:
    low, high = one.event.windows.parts[name]
    begin = one.event.recording.begin
    figures = {signal: found.as_json() for signal, found in one.errors[name].items()}
    return {"name": name, "begin_s": begin + low, "end_s": begin + high} | figures


def _question_json(question: Question) -> dict[str, Any]:
    return {
        "kind": str(question.kind),
        "keeps_open": question.keeps_open,
        "text": sentence(question),
        "figures": dict(question.figures),
    }


def parts(found: Validation) -> Iterator[RenderableType]:
    """The first screen: whether it is met, the worst error of each event, the windows, and what is asked."""
    result = found.result
    yield from _differences(result)
    yield _answer(found)
    yield _events_table(result)
    yield from _doubted_modes(result)
    for one in of_both(result):
        yield _windows_table(one, by_device=bool(result.others))
    if result.others:
        yield beside_table(result)
    if result.criteria:
        yield _worst_criteria(result.criteria)
    if result.request.explain:
        said = explanation_sentence(
            result.explanations,
            finished=not result.interrupted,
            in_step=result.explained_in_step,
            plain=result.plain_part,
            unreached=result.unreached,
            first=result.asked_first,
        )
        yield escape(said)
    if result.explanations and not nothing_to_explain(result.explanations):
        yield explanation_table(result.explanations[:_SHOWN])
    if result.fit is not None:
        yield _fit_table(result.fit)
        yield confirmation_table(result.confirmations)
        yield escape(
            fit_sentence(
                result.fit, {c.recording: c.agrees for c in result.confirmations if not c.fitted}
            )
        )
    elif result.request.fit and result.interrupted:
        yield "Interrupted before a fit had any values: the figures above are of the recordings alone."
    refused = [one for one in result.refused if one.matters]
    if refused and (result.request.explain or result.request.fit):
        yield escape(refused_sentence(refused))


def _differences(result: ValidationResult) -> Iterator[str]:
    """Where two models differ from each other more than from the recording."""
    places = [one for one in result.apart if one.more_than_from_record]
    if places:
        yield escape(difference_sentence(places))


def _answer(found: Validation) -> str:
    told = verdict_of(found.result)
    return (
        escape(error_alone(found.result))
        if told is None
        else told.markup(worst_device(found.result))
    )


def _doubted_modes(result: ValidationResult) -> Iterator[str]:
    """Yield why a mode that the table marks is in doubt."""
    for one in result.comparisons:
        measured = [mode.modes[0] for mode in one.signals["p"].compared_modes]
        doubted = [mode for mode in measured if mode.doubts]
        if doubted:
            texts = "; ".join(map(doubt_text, doubted))
            yield escape(f"? {one.event.recording.label}: {texts}.")


def _events_table(result: ValidationResult) -> PlainTable:
    columns: tuple[str, ...] = (
        "Recording",
        "Event [s]",
        "P, Q before [pu]",
        "Worst error [pu]",
        "at [s]",
        "P, Q off, of the swing",
        "Rings",
        "Model rings",
    )
    rows = []
    if result.others:
        columns = (columns[0], "Model", *columns[1:])
    for one in of_both(result):
        label = one.event.recording.label
        model = [one.device.name] if result.others else []
        _, signal, figures = one.largest_error
        windows, begin, power = one.event.windows, one.event.recording.begin, one.event.start.power
        compared = one.signals["p"].compared_modes
        rows.append(
            (
                label,
                *model,
                f"{begin + windows.begin:.4g} to {begin + windows.end:.4g}",
                f"{power.real:.3f}, {power.imag:.3f}",
                f"{figures.max_error:.4f} of {signal.upper()}",
                f"{figures.max_at:.4g}",
                swing_cell(one),
                *(_rings([mode.modes[k] for mode in compared]) for k in (0, 1)),
            )
        )
    return make_table("Events", *columns, rows=rows)


def _rings(modes: Sequence[IdentifiedMode | None]) -> str:
    """Frequency and damping of each strong mode, one a line, with a mark if it is in doubt; a dash if there is none."""
    lines = ["–" if one is None else _ring(one) for one in modes]
    return "\n".join(lines) or "–"


def _ring(mode: IdentifiedMode) -> str:
    mark = " ?" if mode.doubts else ""
    return f"{mode.frequency_hz:.3g} Hz, {mode.damping_percent:.3g} %{mark}"


def _windows_table(one: EventComparison, *, by_device: bool) -> PlainTable:
    columns: tuple[str, ...] = ("Window", "from [s]", "to [s]")
    columns += tuple(
        f"{s.upper()} {what}" for s in _POWERS for what in ("largest", "mean", "mean |e|")
    )
    begin, rows = one.event.recording.begin, []
    for name, of in one.errors.items():
        low, high = one.event.windows.parts[name]
        figures = [
            f"{value:.4f}"
            for signal in _POWERS
            for value in (of[signal].max_error, of[signal].mean_error, of[signal].mean_abs_error)
        ]
        rows.append((name, f"{begin + low:.4g}", f"{begin + high:.4g}", *figures))
    place = one.event.recording.label + (f", {one.device.name}" if by_device else "")
    title = f"{place}: simulated less measured [pu of {rating_words(one.device)}]"
    return make_table(title, *columns, rows=rows)


def _fit_table(fit: Fit) -> PlainTable:
    rows = []
    for one in fit.parameters:
        both = "–"
        if one.low is not None and one.high is not None and one.low is not one.high:
            both = f"{one.low:.4g} to {one.high:.4g}"
        rows.append(
            (
                f"{one.name} [{one.unit}]" if one.unit else one.name,
                value_text(one.start),
                value_text(one.value),
                both,
                untold_words(one),
            )
        )
    columns = ("Parameter", "Now", "Fitted", interval_head(fit), "Can the recordings tell it?")
    table = make_table("Fit", *columns, rows=rows)
    table.columns[4].justify = "left"
    return table


def _worst_criteria(criteria: Sequence[Criterion]) -> ShownTable:
    """The criteria that are missed most, above those that are open and met."""
    order = {LimitVerdict.NOT_MET: 0, LimitVerdict.OPEN: 1, LimitVerdict.MET: 2}
    worst = sorted(criteria, key=lambda one: (order[one.verdict], -(one.value or 0) / one.limit))
    met = sum(one.verdict is LimitVerdict.MET for one in criteria)
    several = len({one.device for one in criteria}) > 1
    title = f"Limits: {met} of {len(criteria)} met"
    if len(criteria) > _SHOWN:
        title += (
            f"; the {_SHOWN} nearest to failing are listed, and all of them in JSON and on the page"
        )
    return criteria_table(title, worst[:_SHOWN], by_device=several)
