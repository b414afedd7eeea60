"""Findings of a study of machines as places of a POD: in Python, in words, as JSON, as rows, and as a page."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from html import escape
from typing import Any

from orchestrator.cases.case import as_typed
from orchestrator.core.errors import few
from orchestrator.output.report.column_table import ShownTable
from orchestrator.output.report.html.elements import document, verdict_paragraph
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.points.code import code_hash
from orchestrator.studies.siting.confirmation import Confirmation, how_sure
from orchestrator.studies.siting.machines import CONTROLLER, PART, MachineSites
from orchestrator.studies.siting.place_ranking import PlaceRanking
from orchestrator.studies.siting.view import (
    confirmation_json,
    end_of_search,
    least_then,
    with_damping,
    with_it,
)

UNIT = "points of damping by 1 pu of voltage for 1 pu of speed, with its phase tuned"
_SHOWN = 12  # machines in a table, best first
_NAMED = 4  # things in a sentence; the others are counted


class MachineSiting(PlaceRanking[MachineSites]):
    """How far a POD at each machine's voltage regulator moves the poorly damped modes, best machine first.

    Attributes
    ----------
    result
        All that was computed.
    """

    json_name = "machines.json"
    table_name = "machines.csv"
    page_name = "machines.html"

    @property
    def answer(self) -> str:
        """The best machines in one sentence."""
        return answer(self.result)

    @property
    def remarks(self) -> list[str]:
        """Return what coupled FMUs say of the best machines, and which were left out."""
        return [*sureness(self.result), *remarks(self.result)]

    @property
    def without_device(self) -> ModesResult:
        return self.result.found

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor site --json`` prints, as JSON's types."""
        return as_json(self.result)

    def rows(self) -> list[dict[str, Any]]:
        """One row for each machine and mode, best machine first, as ``machines.csv`` has them."""
        return rows(self.result)

    def best_table(self) -> ShownTable:
        """Return the best machines, as the terminal shows them."""
        title = f"{UNIT}, and the angle to turn to 180°; best first"
        return _table_of(self.result, title, self.result.ranking[:_SHOWN])

    def page_title(self) -> str:
        """Return the heading in a notebook."""
        return f"Machines of {self.result.case.name} as places of a POD"

    def page_text(self) -> str:
        """Return the page for a browser."""
        return _page(self.result)


def answer(result: MachineSites) -> str:
    label = result.first
    mode = result.modes[label]
    best = result.ranking[:3]
    figures = ", ".join(f"{name} {result.shifts[label][name].damping:+.3g}" for name in best)
    return (
        f"{best[0]} is the machine where a POD at the voltage regulator helps most, for the least damped mode "
        f"({with_damping(label, mode)}): {figures} {UNIT}{_command(result)}"
    )


def _command(result: MachineSites) -> str:
    """The command that designs the POD at the best machine that can have one; "" where none can."""
    if not result.free:
        return ""
    request, name = result.request, result.free[0]
    words = ["--scenario", result.prepared.name]
    for key, value in {**request.overrides, f"{name}.stabilizer": PART}.items():
        words += ["--set", f"{key}={str(value).lower() if isinstance(value, bool) else value}"]
    words += ["--component", name, "--controller", CONTROLLER]
    return f"; design one at {name} with: gfor design {as_typed(result.case)} {shlex.join(words)}"


def sureness(result: MachineSites) -> list[str]:
    before = result.modes[result.first].damping_percent
    unstable = result.found.stability.stable is False
    said = [f"UNSTABLE without a POD: {result.found.stability.because()}"] if unstable else []
    found = [_confirmed(result, one, before) for one in result.confirmations]
    return [*said, *how_sure(found, result.unconfirmed)]


def _confirmed(result: MachineSites, one: Confirmation, before: float) -> str:
    if one.failure:
        return f"{one.bus}: NOT CONFIRMED: {one.failure}"
    word = "confirmed" if one.agrees else "NOT CONFIRMED"
    if one in result.breaking:
        word += ", but UNSTABLE with it"
    gain = "" if one.setting is None else f" (K {one.setting.gain:g} pu{end_of_search(one)})"
    off = f"prediction off by {100 * one.error:.2g} %"
    steps = f"{before:.2f} % → {one.damping:.2f} % with a POD{gain}"
    stable = "" if one in result.breaking else f"; {with_it(one)}"
    then = f"{least_then(one, before)}{stable}"
    return f"{one.bus}: {word} by coupled FMUs ({off}): {steps}; {then}"


def remarks(result: MachineSites) -> list[str]:
    said = []
    if result.stabilised:
        there = few(result.stabilised, _NAMED)
        said.append(f"with a stabiliser, which a POD would replace, so not confirmed: {there}")
    if result.fixed:
        there = few(result.fixed, _NAMED)
        said.append(
            f"of a model without a stabiliser to choose, so not confirmed: {there}; take the model "
            "synchronous_generator or synchronous_generator_phasor"
        )
    if result.without:
        there = few(result.without, _NAMED)
        said.append(f"left out, without a voltage regulator to act on: {there}")
    return said


def as_json(result: MachineSites) -> dict[str, Any]:
    return {
        **result.prepared.about,
        "device": result.request.device,
        "units": {
            "damping_points": UNIT,
            "real, imag": "eigenvalue's shift [rad/s] by a gain of 1 pu without lead or lag, through washout and "
            "lag of the POD",
        },
        "answer": answer(result),
        "sure": sureness(result),
        "remarks": remarks(result),
        "agrees": result.agrees,
        "stable": result.found.stability.stable,
        "warnings": list(result.found.warnings),
        "code": code_hash(),
        "modes": [
            {
                "mode": label,
                **eigenvalue_json(mode.eigenvalue, mode.damping_percent),
                "components": dict(list(mode.by_component.items())[:3]),
            }
            for label, mode in result.modes.items()
        ],
        "machines": rows(result),
        "stabilised": list(result.stabilised),
        "left_out": list(result.without),
        "confirmed": [confirmation_json(one, "machine") for one in result.confirmations],
        "unconfirmed": list(result.unconfirmed),
    }


def rows(result: MachineSites) -> list[dict[str, Any]]:
    """One row for each machine and mode, best machine first."""
    return [
        {
            "machine": name,
            "rank": k + 1,
            "mode": label,
            "damping_points": by_machine[name].damping,
            "real": by_machine[name].change.real,
            "imag": by_machine[name].change.imag,
            "angle_deg": by_machine[name].angle,
            "part_of_best": by_machine[name].part,
        }
        for k, name in enumerate(result.ranking)
        for label, by_machine in result.shifts.items()
    ]


def _table_of(result: MachineSites, title: str, machines: Sequence[str]) -> ShownTable:
    cells = [[name, *_cells(result, name)] for name in machines]
    return ShownTable(title, ["Machine", *_headings(result)], cells)


def _headings(result: MachineSites) -> list[str]:
    modes = [f"{label}, {mode.damping_percent:.2f} %" for label, mode in result.modes.items()]
    return [*modes, *(["with a POD [%]"] if result.confirmations else [])]


def _cells(result: MachineSites, name: str) -> list[str]:
    shifts = [result.shifts[label][name] for label in result.modes]
    cells = [f"{one.damping:+.3g} ∠ {one.angle:.0f}°" for one in shifts]
    if not result.confirmations:
        return cells
    one = next((x for x in result.confirmations if x.bus == name and not x.failure), None)
    return [*cells, "–" if one is None else f"{one.damping:.2f}"]


def _page(result: MachineSites) -> str:
    title = f"{result.case.table.title or result.case.name}: machines as places of a POD"
    lines = "".join(f"<li>{escape(text)}</li>" for text in (*sureness(result), *remarks(result)))
    shade = "good" if result.agrees and result.confirmations else "soft"
    verdict = verdict_paragraph(shade, escape(answer(result)))
    findings = f'<div class="findings">{verdict}<ul class="soft">{lines}</ul></div>'
    content = [("All machines", _table_of(result, UNIT, result.ranking).html())]
    kind, names = f"{result.prepared.title}; code {code_hash()[:12]}", result.prepared.names
    return document(title, kind, findings, content, names=names)
