"""A study of interactions as Python has it, as tables, as JSON, as files and as a page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from pathlib import Path
from typing import Any, TypeVar

from orchestrator.core.late import pd
from orchestrator.core.safe_files import made_folder, write_text
from orchestrator.core.truth import NoTruth
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.output.report.explorer_cells import CELLS, Cell, CellLine, Cells
from orchestrator.output.report.html.elements import Figures, document, paragraphs
from orchestrator.output.report.mode_tables import mode_columns, verdict
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.report.short_texts import first_few
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.interactions.following import Follow, FollowedMode
from orchestrator.studies.interactions.judgement import (
    JudgedInteractions,
    JudgedMode,
    JudgedPair,
    JudgedSystem,
    doubts_of,
    place_of,
    plan_text,
)
from orchestrator.studies.interactions.places import by_group
from orchestrator.studies.interactions.point import SharedMode
from orchestrator.studies.interactions.study import InteractionsResult
from orchestrator.studies.interactions.systems import Kind, SystemName
from orchestrator.studies.interactions.words import (
    damping_text,
    frequency_text,
    sentences,
    stand_in_sentence,
    verdict_word,
)

# names of the files in a folder of results
MODES = "modes.csv"
PAIRS = "pairs.csv"
ASSIGNMENTS = "assignments.csv"
SUMMARY = "interactions.json"
PAGE = "interactions.html"

_UNFOLLOWED = "not followed"
_LEAST = "; least: of the vendors' modes, if it cannot be followed"

_OF_MODE = (
    "mode_hz",
    "mode_together_percent",
    "mode_first_alone_percent",
    "mode_second_alone_percent",
    "mode_neither_percent",
    "mode_not_followed",
)
"""Names of a followed mode's figures in the JSON of a pair."""

_LEAST_SHARE = 0.005
_CELL = 96  # side of a square of the matrix [px]
_NAME = 12  # size of the names' type [px]
_CAPITAL = 8.6  # width of a capital letter in it [px]
_GAP = 8  # between a name and a square, or another name [px]
_LONGEST = 21  # characters of a name: above the matrix it has two squares' width, where neighbours stand in turns

_GOOD, _MIDDLE, _BAD, _UNKNOWN = (86, 180, 233), (255, 255, 255), (213, 94, 0), "#d9d9d9"
_FULL = 20.0  # damping [%] with the full colour of good ones; −20 % has that of bad ones

Row = TypeVar("Row")


class Interactions(NoTruth):
    """Who takes part in which mode, and which vendors' converters do not agree. `Case.interactions` makes it.

    Attributes
    ----------
    result
        All systems.
    judgement
        What they come to.
    """

    def __init__(self, result: InteractionsResult, follow: Follow | None = None) -> None:
        self.result = result
        self.judgement = JudgedInteractions(result, follow)

    @property
    def stable(self) -> bool | None:
        """Return whether nothing grows in the system as it is; None where that is not known."""
        return self.judgement.whole.stable

    @property
    def worst_pair(self) -> tuple[str, str] | None:
        """The vendors whose joint damping falls most below that of each alone; None where none falls."""
        worst = self.judgement.worst_pair
        return None if worst is None else worst.vendors

    @property
    def worst_assignment(self) -> dict[str, str] | None:
        """The device at each place where the system is damped least; None without a swap, or without a verdict."""
        worst = self.judgement.worst_assignment
        return (
            None
            if worst is None
            else dict(zip(self.result.plan.swapped, worst.name.names, strict=True))
        )

    @property
    def sentences(self) -> list[str]:
        """Return what was found, the verdict on the system as it is first."""
        return sentences(self.judgement)

    @property
    def warnings(self) -> list[str]:
        """Return what is to be borne in mind, with the systems that it is of."""
        return warnings_of(self.judgement)

    def modes(self) -> pd.DataFrame:
        """One row for each mode of the system as it is: figures, participation of each group, who shares it."""
        return modes_table(self.judgement).frame()

    def pairs(self) -> pd.DataFrame:
        """One row for each pair of vendors, the worst first."""
        return pd.DataFrame(map(_pair, self.judgement.pairs))

    def assignments(self) -> pd.DataFrame:
        """One row for each assignment of devices to places, the worst first; empty without a swap."""
        return assignments_table(self.judgement).frame()

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor interactions --json`` prints, as JSON's types."""
        return as_json(self.judgement)

    def save(self, folder: str | Path) -> list[Path]:
        """Write tables, ``interactions.json`` and the page ``interactions.html`` into a folder; give their paths."""
        judgement, place = self.judgement, made_folder(folder)
        tables = {
            MODES: modes_table(judgement).records(),
            PAIRS: [_pair(pair) for pair in judgement.pairs],
            ASSIGNMENTS: assignments_table(judgement).records(),
        }
        wanted = {name: rows for name, rows in tables.items() if rows}
        with staged(place, new_run_id()) as staging:
            for name, rows in wanted.items():
                save_table(rows, staging / name)
            save_json(self.as_json(), staging / SUMMARY)
            write_text(staging / PAGE, _page(self))
            self._cells().save(staging, place)
        return [place / name for name in (*wanted, SUMMARY, CELLS, PAGE)]

    def _cells(self) -> Cells:
        """The vendors by the vendors: each alone on the diagonal, and each pair."""
        plan = self.result.plan

        def cell(system: JudgedSystem) -> Cell:
            return Cell(
                f"{verdict_word(system)}, {damping_text(system)} %",
                system.least_damping,
                system.stable,
            )

        sides = [CellLine(vendor, None) for vendor in plan.vendors]
        pairs = [
            [cell(_together(self.judgement, a, b)) for b in plan.vendors] for a in plan.vendors
        ]
        title = f"Least damping of vendors alone and in pairs; {stand_in_sentence(self.judgement)}"
        values = {key: value for layer in plan.layers for key, value in layer.values.items()}
        return Cells(
            title,
            plan.case,
            scenario=plan.prepared.name,
            frequencies=plan.request.frequencies,
            rows=sides,
            columns=sides,
            cells=pairs,
            values=values,
            step=plan.step_size,
        )

    def __repr__(self) -> str:
        plan = self.result.plan
        return f"<Interactions of {', '.join(plan.vendors)} in {plan.case.name}>"

    def _repr_html_(self) -> str:
        first, *more = self.sentences
        top = headline(first, self.stable)
        return page(repr(self).strip("<>"), more, self.pairs(), verdict=top)


def modes_table(judgement: JudgedInteractions) -> ColumnTable[JudgedMode]:
    plan = judgement.result.plan
    groups = [
        *plan.vendors,
        *(g for g in dict.fromkeys(plan.groups.values()) if g not in plan.vendors),
    ]

    def share_of(group: str) -> Column[JudgedMode]:
        return Column(
            group,
            lambda judged: judged.groups.get(group, 0.0),
            lambda x: f"{x:.0%}" * (x >= _LEAST_SHARE),
            f"share.{group}",
        )

    return ColumnTable(
        "As in the case",
        (
            *mode_columns(lambda judged: judged.mode),
            *map(share_of, groups),
            Column("", lambda judged: judged.is_interaction, name="interaction"),
            Column("", lambda judged: ", ".join(judged.vendors), name="shared_by"),
            Column(
                "Shared by",
                lambda judged: ", ".join(judged.vendors) if judged.is_interaction else "",
            ),
        ),
        judgement.modes,
    )


def _figures(of: Callable[[Row], JudgedSystem]) -> list[Column[Row]]:
    def frequency(row: Row) -> float | None:
        mode = of(row).critical
        return None if mode is None else mode.frequency_hz

    return [
        Column("Verdict", lambda row: of(row).stable, verdict, "stable"),
        Column("Vendors' modes [%]", of, damping_text),
        Column("", lambda row: of(row).least_damping, name="least_damping_percent"),
        Column("Mode", of, frequency_text),
        Column("", frequency, name="frequency_hz"),
        Column("All modes [%]", lambda row: least_percent(of(row)), _percent_cell),
        Column("", lambda row: least_percent(of(row)), name="least_damping_of_all_percent"),
        Column("Mode of all", lambda row: _least_place(of(row))),
    ]


def least_percent(system: JudgedSystem) -> float | None:
    """Damping [%] of the least damped of all modes of the range; None if there is none or the system failed."""
    least = system.least_of_all
    return None if least is None else least.damping_percent


def _percent_cell(percent: float | None) -> str:
    return "none" if percent is None else f"{percent:.2f}"


def _least_place(system: JudgedSystem) -> str:
    least = system.least_of_all
    return "" if least is None else place_of(least)


def systems_table(judgement: JudgedInteractions) -> ColumnTable[tuple[str, JudgedSystem]]:
    rows = [("no vendor", judgement.none)]
    rows += [(f"{vendor} alone", system) for vendor, system in judgement.alone.items()]
    rows += [(pair.text, pair.joint) for pair in judgement.pairs]
    name = Column[tuple[str, JudgedSystem]]("System", lambda r: r[0])
    columns = (name, *_figures(lambda r: r[1]))
    return ColumnTable(
        "Least damping of vendors alone and in pairs: of the modes that count, and of all",
        columns,
        rows,
        left=2,
    )


def pairs_table(judgement: JudgedInteractions) -> ColumnTable[JudgedPair]:
    """One mode of each pair, followed: its damping with neither vendor, with each alone, and together."""

    def column(title: str, of: Callable[[FollowedMode], float | None]) -> Column[JudgedPair]:
        def text(pair: JudgedPair) -> str:
            return "none" if pair.mode is None else _followed_cell(of(pair.mode))

        return Column(title, text)

    def alone(title: str, k: int) -> Column[JudgedPair]:
        def text(pair: JudgedPair) -> str:
            percent = None if pair.mode is None else pair.mode.alone_percent[k]
            least = pair.alone[k].critical
            if pair.falls_unfollowed and percent is None and least is not None:
                return f"{_UNFOLLOWED}; least {least.damping_percent:.2f}"
            return "none" if pair.mode is None else _followed_cell(percent)

        return Column(title, text)

    def fall(pair: JudgedPair) -> str:
        if pair.fall is None:
            return "–"
        return f"{'least ' * pair.falls_unfollowed}{pair.fall:+.2f}"

    def place(pair: JudgedPair) -> str:
        return "" if pair.mode is None else place_of(pair.mode.together)

    columns: tuple[Column[JudgedPair], ...] = (
        Column("Pair", lambda pair: pair.text),
        Column("Mode", place),
        column("Neither [%]", lambda mode: mode.neither_percent),
        alone("First alone [%]", 0),
        alone("Second alone [%]", 1),
        column("Together [%]", lambda mode: mode.together.damping_percent),
        Column("Falls by [points]", fall),
    )
    least = any(pair.falls_unfollowed for pair in judgement.pairs)
    title = f"One mode of each pair, followed{_LEAST * least}"
    return ColumnTable(title, columns, judgement.pairs)


def _followed_cell(percent: float | None) -> str:
    return _UNFOLLOWED if percent is None else f"{percent:.2f}"


def assignments_table(judgement: JudgedInteractions) -> ColumnTable[JudgedSystem]:
    swapped = judgement.result.plan.swapped

    def at(k: int, place: str) -> Column[JudgedSystem]:
        return Column(place, lambda one: one.name.names[k], name=f"at.{place}")

    columns = [*(at(k, place) for k, place in enumerate(swapped)), *_figures(lambda one: one)]
    return ColumnTable(
        "Each device at each place", columns, judgement.assignments, left=len(swapped) + 1
    )


def warnings_of(judgement: JudgedInteractions) -> list[str]:
    """Doubts of the study, and the warnings of its systems, each once with the systems that have it."""
    result = judgement.result
    having: dict[str, list[str]] = {}
    for name, record in result.records.items():
        for text in record.warnings:
            systems = having.setdefault(text, [])
            called = plan_text(result.plan.swapped, name)
            if called not in systems:
                systems.append(called)
    return [
        *doubts_of(judgement),
        *(f"{first_few(systems, str)}: {text}" for text, systems in having.items()),
    ]


def _pair(pair: JudgedPair) -> dict[str, Any]:
    each = zip(("first", "second"), pair.vendors, pair.alone, strict=True)
    return {
        "vendors": pair.text,
        "stable": pair.joint.stable,
        "least_damping_percent": pair.joint.least_damping,
        "frequency_hz": None if pair.joint.critical is None else pair.joint.critical.frequency_hz,
        **_figures_of_mode(pair.mode),
        "falls_by_points": pair.fall,
        "falls_by_least_damping": pair.falls_unfollowed,
        "unstable_though_stable_alone": pair.fights,
        **{
            f"{which}_alone_{key}": value
            for which, _, record in each
            for key, value in (("stable", record.stable), ("damping_percent", record.least_damping))
        },
    }


def _figures_of_mode(mode: FollowedMode | None) -> dict[str, Any]:
    """One mode followed through a pair's systems; each figure is None where no mode is."""
    if mode is None:
        return dict.fromkeys(_OF_MODE)
    values = (
        mode.together.frequency_hz,
        mode.together.damping_percent,
        *mode.alone_percent,
        mode.neither_percent,
        mode.unknown or None,
    )
    return dict(zip(_OF_MODE, values, strict=True))


def as_json(judgement: JudgedInteractions) -> dict[str, Any]:
    plan, worst, swap = judgement.result.plan, judgement.worst_pair, judgement.worst_assignment
    groups = plan.groups
    pairs = [
        _pair(pair)
        | {"vendors": list(pair.vendors), "sentence": pair.sentence()}
        | _system(pair.joint, groups)
        for pair in judgement.pairs
    ]
    unknown = [
        list(pair.vendors) for pair in (*judgement.unknown_pairs, *judgement.uncompared_pairs)
    ]
    found: dict[str, Any] = {
        **plan.prepared.about,
        "stand_in": plan.stand_in,
        "threshold_percent": 100 * plan.request.threshold,
        "range_hz": list(plan.request.frequencies),
        "vendors": list(plan.vendors),
        "places": {name: place.vendor for name, place in plan.places.items()},
        "groups": groups,
        "as_in_the_case": _system(judgement.whole, groups),
        "interaction_modes": list(map(_shared, judgement.interaction_modes)),
        "no_vendor": _system(judgement.none, groups),
        "alone": {vendor: _system(system, groups) for vendor, system in judgement.alone.items()},
        "pairs": pairs,
        "worst_pair": None,
        "unknown_pairs": unknown,
    }
    if worst is not None:
        found["worst_pair"] = list(worst.vendors)
    if plan.swapped:
        found["assignments"] = [
            {"at": dict(zip(plan.swapped, system.name.names, strict=True))}
            | _system(system, groups, modes=False)
            for system in judgement.assignments
        ]
        found["worst_assignment"] = (
            None if swap is None else dict(zip(plan.swapped, swap.name.names, strict=True))
        )
    return found | {"warnings": warnings_of(judgement)}


def _shared(judged: JudgedMode) -> dict[str, Any]:
    mode = judged.mode
    return eigenvalue_json(mode.eigenvalue, mode.damping_percent) | {
        "vendors": list(judged.vendors)
    }


def _system(system: JudgedSystem, groups: dict[str, str], *, modes: bool = True) -> dict[str, Any]:
    critical = system.critical
    found: dict[str, Any] = {
        "stable": system.stable,
        "stability": system.record.stability,
        "least_damping_percent": system.least_damping,
        "least_damping_of_all_percent": least_percent(system),
        "critical": None
        if critical is None
        else eigenvalue_json(critical.eigenvalue, critical.damping_percent),
        "error": system.record.error,
    }
    return found | (
        {"modes": [_mode(mode, groups) for mode in system.record.modes]} if modes else {}
    )


def _mode(mode: SharedMode, groups: dict[str, str]) -> dict[str, Any]:
    return eigenvalue_json(mode.eigenvalue, mode.damping_percent) | {
        "groups": by_group(mode.components, groups),
        "components": mode.components,
    }


def _page(found: Interactions) -> str:
    judgement, plan, figures = found.judgement, found.result.plan, Figures()
    content = [("Modes and who takes part", modes_table(judgement).html())]
    if len(plan.vendors) > 1:
        content.append(("Pairs", _pairs(judgement, figures)))
    if plan.swapped:
        content.append(("Each device at each place", _swap(judgement, figures)))
    if found.warnings:
        content.append(
            (
                "Warnings",
                f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in found.warnings)}</ul>",
            )
        )
    title = f"{plan.case.table.title or plan.case.name}: interactions"
    kind = f"{plan.prepared.title}, {len(plan.vendors)} vendors at {len(plan.places)} places"
    names = plan.prepared.names
    findings = f'<div class="findings">{paragraphs(found.stable, found.sentences)}</div>'
    return document(title, kind, findings, content, names=names)


def _pairs(judgement: JudgedInteractions, figures: Figures) -> str:
    vendors = judgement.result.plan.vendors
    text = (
        "Least damping [%] of each vendor alone, on the diagonal, and of each pair. "
        "U: unstable; ?: not known."
    )
    cells = [[_together(judgement, row, column) for column in vendors] for row in vendors]
    picture = _heat_picture("Least damping of vendors alone and in pairs", vendors, cells)
    return (
        figures.add(picture, text)[0]
        + pairs_table(judgement).html()
        + systems_table(judgement).html()
    )


def _together(judgement: JudgedInteractions, a: str, b: str) -> JudgedSystem:
    pair = (a,) if a == b else tuple(sorted((a, b), key=judgement.result.plan.vendors.index))
    return judgement.systems[SystemName(Kind.PAIR if len(pair) > 1 else Kind.ALONE, pair)]


def _swap(judgement: JudgedInteractions, figures: Figures) -> str:
    swapped, found = (
        judgement.result.plan.swapped,
        {system.name: system for system in judgement.assignments},
    )
    text = assignments_table(judgement).html()
    if len(swapped) != 2:
        return text
    devices = sorted({name.names[0] for name in found})
    cells = [
        [found[SystemName(Kind.ASSIGNMENT, (row, column))] for column in devices] for row in devices
    ]
    picture = _heat_picture("Least damping of each assignment", devices, cells)
    words = f"Least damping [%]; row: the device at {swapped[0]}, column: at {swapped[1]}. U: unstable; ?: not known."
    return figures.add(picture, words)[0] + text


def _heat_picture(name: str, labels: Sequence[str], cells: Sequence[Sequence[JudgedSystem]]) -> str:
    """A square for each system, coloured by its least damping; the figure, and U where it is unstable, stand in it."""
    longest = _CAPITAL * min(_LONGEST, max(map(len, labels)))  # [px]
    lines = 1 if longest + _GAP <= _CELL else 2
    left, top = longest + 2 * _GAP, lines * (_NAME + _GAP) + _GAP
    parts = []
    for k, label in enumerate(labels):
        above = top - _GAP - k % lines * (_NAME + _GAP)
        parts.append(_name(left + (k + 0.5) * _CELL, above, label))
    for i, label in enumerate(labels):
        middle = top + (i + 0.5) * _CELL
        parts.append(_name(left - _GAP, middle + 4, label, "end"))
        for k, system in enumerate(cells[i]):
            x, y = round(left) + k * _CELL, top + i * _CELL
            told = f"{label}, {labels[k]}: {verdict_word(system)}, {damping_text(system)} %"
            parts.append(
                f'<rect x="{x + 1}" y="{y + 1}" width="{_CELL - 2}" height="{_CELL - 2}" fill="{_colour(system)}" '
                f'stroke="#888"><title>{escape(told)}</title></rect>'
            )
            sign = {True: "", False: "U", None: "?"}[system.stable]
            parts.append(_text(x + _CELL / 2, y + _CELL / 2, damping_text(system)))
            parts.append(_text(x + _CELL / 2, y + _CELL / 2 + 18, sign))
    width, height = (round(x + len(labels) * _CELL + _GAP) for x in (left, top))
    return (
        f'<svg viewBox="0 0 {width} {height}" style="max-width:{width}px" role="img" aria-label="{escape(name)}">'
        f"{''.join(parts)}</svg>"
    )


def _name(x: float, y: float, name: str, anchor: str = "middle") -> str:
    """A name in small type; a long one is shortened, and whole under the pointer."""
    shown = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
    told = "" if shown == name else f"<title>{escape(name)}</title>"
    return (
        f'<text x="{x:.0f}" y="{y:.0f}" font-size="{_NAME}" text-anchor="{anchor}" fill="#000">{escape(shown)}'
        f"{told}</text>"
    )


def _text(x: float, y: float, text: str) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="middle" fill="#000">{escape(text)}</text>'


def _colour(system: JudgedSystem) -> str:
    """Grey without a verdict; the bad colour in full where it is unstable, else between it and the good one."""
    if system.stable is None or system.least_damping is None:
        return _UNKNOWN
    share = -1.0 if system.stable is False else max(-1.0, min(1.0, system.least_damping / _FULL))
    end = _GOOD if share > 0 else _BAD
    mixed = (round(m + (e - m) * abs(share)) for m, e in zip(_MIDDLE, end, strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)
