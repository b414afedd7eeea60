"""The page of a study of interactions: shared modes, the pairs as a picture, and each device at each place."""

from html import escape
from pathlib import Path

from orchestrator.interactions.judgement import JudgedInteractions, JudgedSystem
from orchestrator.interactions.systems import Kind, SystemName
from orchestrator.interactions.tables import groups_shown, warnings_of
from orchestrator.interactions.words import damping_text, frequency_text, sentences, stand_in_sentence, verdict_word
from orchestrator.report.html.document import document
from orchestrator.report.html.elements import Figures, damping, eigenvalue, number, table
from orchestrator.safe_files import write_text

_CELL, _MARGIN = 96, 120
_LONGEST = 13  # characters that fit above a square, and left of it

_GOOD, _MIDDLE, _BAD, _UNKNOWN = (86, 180, 233), (255, 255, 255), (213, 94, 0), "#d9d9d9"
_FULL = 20.0  # damping [%] with the full colour of good ones; −20 % has that of bad ones


def write_page(judgement: JudgedInteractions, path: Path) -> None:
    """Write the page as one file that needs no other."""
    plan, figures = judgement.result.plan, Figures()
    shade = {True: "good", False: "bad", None: "soft"}[judgement.whole.stable]
    first, *rest = sentences(judgement)
    findings = f'<p class="{shade}">{escape(first)}</p>' + "".join(f"<p>{escape(text)}</p>" for text in rest)
    content = [("Modes and who takes part", _modes(judgement))]
    if len(plan.vendors) > 1:
        content.append(("Pairs", _pairs(judgement, figures)))
    if plan.swapped:
        content.append(("Each device at each place", _swap(judgement, figures)))
    if warnings := warnings_of(judgement):
        content.append(("Warnings", f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in warnings)}</ul>"))
    title = f"{plan.case.table.title or plan.case.name}: interactions"
    kind = f"{plan.prepared.title}, {len(plan.vendors)} vendors at {len(plan.places)} places"
    write_text(path, document(title, kind, findings, content))


def _modes(judgement: JudgedInteractions) -> str:
    groups = groups_shown(judgement)
    rows = [
        [
            eigenvalue(judged.mode.real, judged.mode.imag),
            f"{judged.mode.frequency_hz:.3f}",
            damping(judged.mode.damping_percent),
            *(f"{judged.groups.get(group, 0.0):.1%}" for group in groups),
            f"<b>{escape(', '.join(judged.vendors))}</b>" if judged.is_interaction else "",
        ]
        for judged in judgement.modes
    ]
    columns = ["λ [rad/s]", "f [Hz]", "Damping [%]", *groups, "Shared by"]
    return table("Modes of the system as it is, with the participation of each vendor", columns, rows)


def _pairs(judgement: JudgedInteractions, figures: Figures) -> str:
    vendors, systems = judgement.result.plan.vendors, judgement.systems

    def at(row: int, column: int) -> JudgedSystem:
        a, b = sorted((row, column))
        name = SystemName(Kind.ALONE, (vendors[a],)) if a == b else SystemName(Kind.PAIR, (vendors[a], vendors[b]))
        return systems[name]

    cells = [[at(row, column) for column in range(len(vendors))] for row in range(len(vendors))]
    picture = heat_picture("Least damping of vendors alone and in pairs", vendors, vendors, cells)
    text = (
        "Least damping [%] of each vendor alone, on the diagonal, and of each pair; "
        f"{stand_in_sentence(judgement)}. U: unstable; ?: not known."
    )
    rows = [
        [
            escape(pair.text),
            verdict_word(pair.joint),
            damping_text(pair.joint),
            *(f"{verdict_word(one)}, {damping_text(one)}" for one in pair.alone),
            "–" if pair.fall is None else number(pair.fall, 2),
            escape(frequency_text(pair.joint)),
        ]
        for pair in judgement.pairs
    ]
    columns = ["Pair", "Together", "Damping [%]", "First alone", "Second alone", "Falls by [points]", "Mode"]
    return figures.add(picture, text)[0] + table("Pairs, the worst first", columns, rows, left=2)


def _swap(judgement: JudgedInteractions, figures: Figures) -> str:
    swapped, found = judgement.result.plan.swapped, {system.name: system for system in judgement.assignments}
    rows = [
        [*map(escape, name.names), verdict_word(system), damping_text(system), escape(frequency_text(system))]
        for name, system in found.items()
    ]
    columns = [*swapped, "Verdict", "Least damping [%]", "Mode"]
    text = table("All assignments, the worst first", columns, rows, left=len(swapped) + 1)
    if len(swapped) != 2:
        return text
    devices = sorted({name.names[0] for name in found})
    cells = [[found[SystemName(Kind.ASSIGNMENT, (row, column))] for column in devices] for row in devices]
    picture = heat_picture("Least damping of each assignment", devices, devices, cells)
    words = f"Least damping [%]; row: the device at {swapped[0]}, column: at {swapped[1]}. U: unstable; ?: not known."
    return figures.add(picture, words)[0] + text


def heat_picture(
    name: str, rows: tuple[str, ...] | list[str], columns: tuple[str, ...] | list[str], cells: list[list[JudgedSystem]]
) -> str:
    """A square for each system, coloured by its least damping; the figure, and U where it is unstable, stand in it."""
    parts = []
    for k, label in enumerate(columns):
        parts.append(_text(_MARGIN + (k + 0.5) * _CELL, 20, label))
    for i, label in enumerate(rows):
        middle = 30 + (i + 0.5) * _CELL
        parts.append(_text(_MARGIN - 8, middle + 4, label, "end"))
        for k, system in enumerate(cells[i]):
            x, y = _MARGIN + k * _CELL, 30 + i * _CELL
            told = f"{label}, {columns[k]}: {verdict_word(system)}, {damping_text(system)} %"
            parts.append(
                f'<rect x="{x + 1}" y="{y + 1}" width="{_CELL - 2}" height="{_CELL - 2}" fill="{_colour(system)}" '
                f'stroke="#888"><title>{escape(told)}</title></rect>'
            )
            sign = {True: "", False: "U", None: "?"}[system.stable]
            parts.append(_text(x + _CELL / 2, y + _CELL / 2, damping_text(system)))
            parts.append(_text(x + _CELL / 2, y + _CELL / 2 + 18, sign))
    width, height = _MARGIN + len(columns) * _CELL + 8, 38 + len(rows) * _CELL
    return (
        f'<svg viewBox="0 0 {width} {height}" style="max-width:{width}px" role="img" aria-label="{escape(name)}">'
        f"{''.join(parts)}</svg>"
    )


def _text(x: float, y: float, text: str, anchor: str = "middle") -> str:
    """A text; a long one is shortened, and whole under the pointer."""
    shown = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    told = "" if shown == text else f"<title>{escape(text)}</title>"
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" fill="#000">{escape(shown)}{told}</text>'


def _colour(system: JudgedSystem) -> str:
    """Grey without a verdict; the bad colour in full where it is unstable, else between it and the good one."""
    if system.stable is None or system.least_damping is None:
        return _UNKNOWN
    share = -1.0 if system.stable is False else max(-1.0, min(1.0, system.least_damping / _FULL))
    end = _GOOD if share > 0 else _BAD
    mixed = (round(m + (e - m) * abs(share)) for m, e in zip(_MIDDLE, end, strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)
