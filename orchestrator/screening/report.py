"""The page of a screening: what is worst, when, with which outage, and where a damping controller helps."""

from html import escape
from pathlib import Path

import numpy as np

from orchestrator.operating_points.item import Status
from orchestrator.report.html.charts import ChartCurve, Mark, complex_plane, legend, line_chart
from orchestrator.report.html.document import document
from orchestrator.report.html.elements import Figures, colour, damping, eigenvalue, number, table
from orchestrator.safe_files import write_text
from orchestrator.screening.stress import by_outage
from orchestrator.screening.summary import ScreenedMode, Summary, duration
from orchestrator.screening.words import verdict_sentence, what_was_counted

_CURVES, _ROWS = 6, 20
_MOST_MARKS = 4000


def write_page(summary: Summary, path: Path) -> None:
    """Write the page as one file that needs no other."""
    plan, figures = summary.result.plan, Figures()
    shade = {True: "good", False: "bad", None: "soft"}[summary.stable]
    findings = f'<p class="{shade}">{escape(verdict_sentence(summary))}</p><p>{escape(what_was_counted(summary))}</p>'
    content = [("Outages", _outages(summary))] if len(plan.outages) > 1 else []
    content += [("Modes", _modes(summary)), ("Damping and how long", _durations(summary, figures))]
    if len(plan.points) > 1:
        content.append(("Damping over the points", _over_points(summary, figures)))
    content.append(("All critical modes", _plane(summary, figures)))
    content.append(("Where a damping controller helps", _ranking(summary)))
    if any(True for _ in summary.failures()):
        content.append(("Not computed", _failures(summary)))
    title = f"{plan.case.table.title or plan.case.name}: screening"
    kind = f"{plan.prepared.title}, {len(plan.points)} operating points, {len(plan.outages) - 1} outages"
    write_text(path, document(title, kind, findings, content))


def _modes(summary: Summary) -> str:
    rows = [
        [
            escape(mode.name),
            escape(mode.worst.item.point.name),
            escape(mode.worst.item.outage.name),
            eigenvalue(mode.worst.value.real, mode.worst.value.imag),
            damping(mode.worst.damping),
            escape(", ".join(f"{name} {share:.2f}" for name, share in mode.worst.participation(4))),
            str(len(mode.at)),
        ]
        for mode in summary.modes[:_ROWS]
    ]
    columns = ["Mode", "Worst point", "Outage", "λ [rad/s]", "Damping [%]", "Participation", "Items"]
    return table("Each mode where it is damped least", columns, rows, left=3) + _more(len(summary.modes))


def _more(count: int) -> str:
    return f"<p>{count - _ROWS} more are in the files.</p>" if count > _ROWS else ""


def _durations(summary: Summary, figures: Figures) -> str:
    parts = []
    for outages, text in ((False, "the intact network"), (True, "the worst outage of each point")):
        if outages and len(summary.result.plan.outages) < 2:
            continue
        curves = []
        for k, mode in enumerate(_longest(summary)):
            hours, percent = duration(mode, outages=outages)
            if len(hours):
                steps = np.repeat(np.concatenate([[0.0], hours]), 2)[1:-1]
                curves.append(ChartCurve(mode.name, colour(k + 1), steps, np.repeat(percent, 2)))
        if curves:
            key = legend((curve.label, curve.colour) for curve in curves)
            chart = line_chart(f"Damping and duration, {text}", "Hours with at most this damping", "Damping [%]",
                               curves, 260)  # fmt: skip
            picture, _ = figures.add(key + chart, f"For how long each mode is damped by at most so much, {text}.")
            parts.append(picture)
    return "".join(parts) or "<p>No critical mode was found.</p>"


def _longest(summary: Summary) -> list[ScreenedMode]:
    """The least damped of those that are there most of the time."""
    most = max((len(mode.at) for mode in summary.modes), default=0)
    return [mode for mode in summary.modes if len(mode.at) >= most / 4][:_CURVES]


def _over_points(summary: Summary, figures: Figures) -> str:
    place = {point.name: float(k) for k, point in enumerate(summary.result.plan.points)}
    curves = []
    for k, mode in enumerate(_longest(summary)):
        intact = [one for one in mode.at if not one.item.outage.elements]
        if len(intact) > 1:
            at = np.array([place[one.item.point.name] for one in intact])
            curves.append(ChartCurve(mode.name, colour(k + 1), at, np.array([one.damping for one in intact])))
    if not curves:
        return "<p>No critical mode was followed over several points.</p>"
    key = legend((curve.label, curve.colour) for curve in curves)
    chart = line_chart("Damping over the points", "Operating point, in the file's order", "Damping [%]", curves, 260)
    return figures.add(key + chart, "Damping of the modes in the intact network.")[0]


def _plane(summary: Summary, figures: Figures) -> str:
    every = [(k, one) for k, mode in enumerate(summary.modes) for one in mode.at]
    shown = every if len(every) <= _MOST_MARKS else every[:: len(every) // _MOST_MARKS + 1]
    marks = [
        Mark(
            one.value.real, one.frequency, colour(k + 1),
            f"{one.item.point.name}, {one.item.outage.name}\n{one.frequency:.3f} Hz, {one.damping:.2f} %",
            "dot" if one.item.outage.elements else "cross",
        )
        for k, one in shown
    ]  # fmt: skip
    text = "Critical modes of all points and outages; crosses: the intact network, dots: outages."
    if len(shown) < len(every):
        text += f" {len(shown)} of {len(every)} are shown."
    return figures.add(complex_plane("Critical modes", marks), text)[0]


def _outages(summary: Summary) -> str:
    """The outages by the least damping that they leave."""
    found, rows = by_outage(summary), []
    for row in found[:_ROWS]:
        least = row.least
        figures = ["", "", ""] if least is None else [
            damping(least.damping), f"{least.frequency:.3f}", escape(", ".join(n for n, _ in least.participation(2)))
        ]  # fmt: skip
        point = (row.worst or row.unjudged[0]).point.name
        lost = f"{len(row.unjudged)} of {row.points}" if row.unjudged else ""
        grows = "UNSTABLE" if row.unstable else ""
        rows.append([escape(row.name), escape(point), *figures, grows, lost])
    columns = ["Outage", "Worst point", "Damping [%]", "f [Hz]", "Who", "", "Not judged"]
    return table("Outages, worst first", columns, rows, left=2) + _more(len(found))


def _ranking(summary: Summary) -> str:
    parts = [
        "<p>Size of the residue from a converter's power reference to its own frequency: so far a damping controller "
        "there moves the eigenvalue by unit gain [pu of its rating by pu of frequency], if its phase is right and its "
        "gain small.</p>"
    ]
    for mode in summary.modes[:_CURVES]:
        found = mode.worst.ranking()
        if found:
            rows = [[escape(name), number(abs(p), 4), number(abs(q), 4)] for name, p, q in found]
            where = f"{mode.name}, at {mode.worst.item.point.name}, {mode.worst.item.outage.name}"
            parts.append(table(where, ["Converter", "through P [rad/s]", "through Q [rad/s]"], rows))
    return "".join(parts) if len(parts) > 1 else "<p>No converter of this scenario can be ranked.</p>"


def _failures(summary: Summary) -> str:
    rows = []
    for status in (status for status in Status if status in summary.counts and status is not Status.COMPUTED):
        first = [item for item in summary.failures() if item.record.status is status]
        for item in first[:_ROWS]:
            rows.append([escape(str(status)), escape(item.point.name), escape(item.outage.name),
                         escape(item.record.text)])  # fmt: skip
        if len(first) > _ROWS:
            rows.append([escape(str(status)), "", f"and {len(first) - _ROWS} more", ""])
    return table("Points and outages without modes", ["What", "Point", "Outage", "Why"], rows, left=4)
