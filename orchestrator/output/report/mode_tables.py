"""Modes in tables: with how many digits an eigenvalue, its frequency and its damping stand there, and tables of them.

The tables are over the JSON of scenarios: a terminal shows them of what was computed, a page of what was kept."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

from orchestrator.output.report.column_table import Column, Marked, ShownCell, ShownTable

Content = Mapping[str, Any]
"""The JSON of a scenario, or a part of it."""

Row = TypeVar("Row")

LEAST_DAMPING = 5.0
"""Damping ratio [%] below which it is marked: what a certificate asks for."""


def eigenvalue_text(value: complex, digits: int = 4) -> str:
    """``-0.3892 ± j3.6551``."""
    return f"{value.real:+.{digits}f} ± j{abs(value.imag):.{digits}f}"


def damping(percent: float | None) -> ShownCell:
    """Return the damping ratio [%] with two digits, marked if it is poor."""
    text = "–" if percent is None else f"{percent:.2f}"
    return Marked(text, "bad") if percent is not None and percent < LEAST_DAMPING else text


def verdict(stable: bool | None) -> str | Marked:
    words: dict[bool | None, str | Marked] = {
        True: "stable",
        False: Marked("UNSTABLE", "bad"),
        None: "not known",
    }
    return words[stable]


def mode_columns(mode_of: Callable[[Row], Any]) -> list[Column[Row]]:
    """Columns of an eigenvalue [rad/s], its frequency [Hz] and its damping ratio [%]."""
    return [
        Column("Mode [rad/s]", lambda row: mode_of(row).eigenvalue, eigenvalue_text),
        Column("", lambda row: mode_of(row).eigenvalue.real, name="real"),
        Column("", lambda row: mode_of(row).eigenvalue.imag, name="imag"),
        Column("f [Hz]", lambda row: mode_of(row).frequency_hz, ".4f", name="frequency_hz"),
        Column(
            "Damping [%]", lambda row: mode_of(row).damping_percent, damping, name="damping_percent"
        ),
    ]


_ELECTROMECHANICAL = "electromechanical"  # the name of most cases for the swing that they look for


def title_of_mode(name: str) -> str:
    """Return the title of a table on one mode, with the name that the case gives to it."""
    named = name and name != _ELECTROMECHANICAL
    return f"Electromechanical mode: {name}" if named else "Electromechanical mode"


def named_modes(
    scenarios: Sequence[Content], reference: str | None, *, with_names: bool = False
) -> ShownTable:
    """The modes that a case looks for, beside somebody else's figures if there are any, whose title is given.

    ``with_names``: shows a mode's name also if there is no other."""
    keys = ("modes", "unnamed", "references")
    found = [(name, s) for s in scenarios for key in keys for name in s.get(key, ())]
    names = list(dict.fromkeys(name for name, _ in found))
    several = len(names) > 1
    compared = any(s["references"] for s in scenarios)
    rows = []
    for name in names:
        for s in scenarios:
            row: list[ShownCell] = [s["title"]]
            if several or with_names:
                row = [f"{name}: {s['title']}"]
            absence = "not known" if name in s.get("unnamed", ()) else "none in range"
            row += _figures(s["modes"].get(name), absence)
            theirs = s["references"].get(name)
            if theirs:
                row += [f"{theirs['frequency_hz']:.2f}", damping(theirs["damping_percent"])]
            rows.append([*row, "", ""] if compared and not theirs else row)
    headings = ["Scenario", "Mode [rad/s]", "f [Hz]", "Damping [%]"]
    headings += [f"{reference}: f [Hz]", "Damping [%]"] if compared else []
    return ShownTable(
        "Electromechanical modes" if several else title_of_mode("".join(names)),
        headings,
        rows,
        parts=[name for name in names for _ in scenarios],
    )


def _figures(mode: Content | None, absence: str) -> list[ShownCell]:
    if mode is None:
        return [absence, "", ""]
    value = complex(mode["real"], mode["imag"])
    return [eigenvalue_text(value), f"{mode['frequency_hz']:.3f}", damping(mode["damping_percent"])]


def ring_downs(scenarios: Sequence[Content]) -> ShownTable | None:
    """The swing that each response shows, beside the mode of the system that rings; None if no response shows one."""
    rows = []
    for s in scenarios:
        seen, mode = s["ring_down"], s["ring_down_mode"]
        if seen and mode:
            hertz = [f"{one['frequency_hz']:.4f}" for one in (seen, mode)]
            percent = [damping(one["damping_percent"]) for one in (seen, mode)]
            rows.append([s["title"], *hertz, *percent])
    title = "Ring-down of the simulated response against the eigenvalue"
    headings = [
        "Scenario",
        "f simulated [Hz]",
        "f mode [Hz]",
        "Damping simulated [%]",
        "Damping mode [%]",
    ]
    return ShownTable(title, headings, rows) if rows else None


def mode_shifts(shifts: Iterable[tuple[str, str, float, float]]) -> ShownTable:
    """The shift of the electromechanical mode by each step.

    ``shifts``: scenario, schedule, communication step [s], shift [rad/s]."""
    found: dict[tuple[str, str], dict[float, float]] = {}
    for scenario, schedule, step, shift in shifts:
        found.setdefault((scenario, schedule), {})[step] = shift
    steps = sorted({step for by_step in found.values() for step in by_step})
    rows = [[*key, *(f"{by_step[step]:.1e}" for step in steps)] for key, by_step in found.items()]
    return ShownTable(
        "How far each communication step moves the electromechanical mode [rad/s]",
        ["Scenario", "Schedule", *(f"{1e6 * step:g} µs" for step in steps)],
        rows,
        left=2,
    )
