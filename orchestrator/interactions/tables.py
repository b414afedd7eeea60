"""A study of interactions as tables for a terminal, as rows for files, and as JSON."""

from typing import Any

from orchestrator.interactions.judgement import (
    JudgedInteractions,
    JudgedMode,
    JudgedPair,
    JudgedSystem,
    doubts_of,
    plan_text,
)
from orchestrator.interactions.places import by_group
from orchestrator.interactions.point import SharedMode
from orchestrator.interactions.words import damping_text, frequency_text, verdict_word
from orchestrator.report.tables import PlainTable, eigenvalue_text, first_few, make_table
from orchestrator.results.mode_json import eigenvalue_json

_LEAST_SHARE = 0.005
_VERDICT = ("Verdict", "Least damping [%]", "Mode")


def modes_table(judgement: JudgedInteractions) -> PlainTable:
    """The modes of the system as it is, with the participation of every group."""
    groups = groups_shown(judgement)
    columns = ("Mode [rad/s]", "f [Hz]", "Damping [%]", *groups, "Shared by")
    rows = [
        (
            eigenvalue_text(judged.mode.eigenvalue),
            f"{judged.mode.frequency_hz:.4f}",
            f"{judged.mode.damping_percent:.2f}",
            *(_share(judged.groups.get(group, 0.0)) for group in groups),
            ", ".join(judged.vendors) if judged.is_interaction else "",
        )
        for judged in judgement.modes
    ]
    return make_table("As in the case", *columns, rows=rows)


def groups_shown(judgement: JudgedInteractions) -> list[str]:
    """The vendors, and then the other groups that the system has."""
    plan = judgement.result.plan
    return [*plan.vendors, *(g for g in dict.fromkeys(plan.groups.values()) if g not in plan.vendors)]


def _share(share: float) -> str:
    return f"{share:.0%}" if share >= _LEAST_SHARE else ""


def systems_table(judgement: JudgedInteractions) -> PlainTable:
    """Nobody, each vendor alone, and each pair, at the same power flow."""
    columns = ("System", *_VERDICT, "Falls by [points]")
    rows = [("no vendor", *_figures(judgement.none), "")]
    rows += [(f"{vendor} alone", *_figures(system), "") for vendor, system in judgement.alone.items()]
    rows += [
        (pair.text, *_figures(pair.joint), "–" if pair.fall is None else f"{pair.fall:+.2f}")
        for pair in judgement.pairs
    ]
    return make_table("Vendors alone and in pairs", *columns, left=2, rows=rows)


def assignments_table(judgement: JudgedInteractions) -> PlainTable:
    """All assignments, the worst first."""
    swapped = judgement.result.plan.swapped
    columns, rows = (*swapped, *_VERDICT), [(*one.name.names, *_figures(one)) for one in judgement.assignments]
    return make_table("Each device at each place", *columns, left=len(swapped) + 1, rows=rows)


def _figures(system: JudgedSystem) -> tuple[str, str, str]:
    return verdict_word(system), damping_text(system), frequency_text(system)


def warnings_of(judgement: JudgedInteractions) -> list[str]:
    """Doubts of the study, and the warnings of its systems, each once with the systems that have it."""
    result = judgement.result
    having: dict[str, list[str]] = {}
    for name, record in result.records.items():
        for text in record.warnings:
            systems = having.setdefault(text, [])
            if (called := plan_text(result.plan.swapped, name)) not in systems:
                systems.append(called)
    return [*doubts_of(judgement), *(f"{first_few(systems, str)}: {text}" for text, systems in having.items())]


def mode_rows(judgement: JudgedInteractions) -> list[dict[str, Any]]:
    """A row for each mode of the system as it is: figures, participation by group, and who shares it."""
    groups = groups_shown(judgement)
    return [
        eigenvalue_json(judged.mode.eigenvalue, judged.mode.damping_percent)
        | {f"share.{group}": judged.groups.get(group, 0.0) for group in groups}
        | {"interaction": judged.is_interaction, "shared_by": ", ".join(judged.vendors)}
        for judged in judgement.modes
    ]


def pair_rows(judgement: JudgedInteractions) -> list[dict[str, Any]]:
    """A row for each pair, the worst first."""
    return [_pair(pair) for pair in judgement.pairs]


def _pair(pair: JudgedPair) -> dict[str, Any]:
    each = zip(("first", "second"), pair.vendors, pair.alone, strict=True)
    return {
        "vendors": pair.text,
        "stable": pair.joint.stable,
        "least_damping_percent": pair.joint.least_damping,
        "frequency_hz": None if pair.joint.critical is None else pair.joint.critical.frequency_hz,
        "falls_by_points": pair.fall,
        "unstable_though_stable_alone": pair.fights,
        **{f"{which}_alone_{key}": value for which, _, record in each
           for key, value in (("stable", record.stable), ("damping_percent", record.least_damping))},
    }  # fmt: skip


def assignment_rows(judgement: JudgedInteractions) -> list[dict[str, Any]]:
    """A row for each assignment, the worst first."""
    swapped = judgement.result.plan.swapped
    return [
        {f"at.{place}": device for place, device in zip(swapped, system.name.names, strict=True)}
        | {
            "stable": system.stable,
            "least_damping_percent": system.least_damping,
            "frequency_hz": None if system.critical is None else system.critical.frequency_hz,
        }
        for system in judgement.assignments
    ]


def as_json(judgement: JudgedInteractions) -> dict[str, Any]:
    """All of it as JSON's types."""
    plan, worst, swap = judgement.result.plan, judgement.worst_pair, judgement.worst_assignment
    groups = plan.groups
    found: dict[str, Any] = {
        "case": plan.case.name,
        "scenario": plan.prepared.name,
        "stand_in": plan.stand_in,
        "threshold_percent": 100 * plan.request.threshold,
        "range_hz": list(plan.request.frequency_range),
        "vendors": list(plan.vendors),
        "places": {name: place.vendor for name, place in plan.places.items()},
        "groups": groups,
        "as_in_the_case": _system(judgement.whole, groups),
        "interaction_modes": [_shared(judged) for judged in judgement.interaction_modes],
        "no_vendor": _system(judgement.none, groups),
        "alone": {vendor: _system(system, groups) for vendor, system in judgement.alone.items()},
        "pairs": [
            _pair(pair) | {"vendors": list(pair.vendors), "sentence": pair.sentence()} | _system(pair.joint, groups)
            for pair in judgement.pairs
        ],
        "worst_pair": None if worst is None else list(worst.vendors),
        "unknown_pairs": [list(pair.vendors) for pair in judgement.unknown_pairs],
    }
    if plan.swapped:
        found["assignments"] = [
            {"at": dict(zip(plan.swapped, system.name.names, strict=True))} | _system(system, groups, modes=False)
            for system in judgement.assignments
        ]
        found["worst_assignment"] = None if swap is None else dict(zip(plan.swapped, swap.name.names, strict=True))
    return found | {"warnings": warnings_of(judgement)}


def _shared(judged: JudgedMode) -> dict[str, Any]:
    mode = judged.mode
    return eigenvalue_json(mode.eigenvalue, mode.damping_percent) | {"vendors": list(judged.vendors)}


def _system(system: JudgedSystem, groups: dict[str, str], *, modes: bool = True) -> dict[str, Any]:
    critical = system.critical
    found: dict[str, Any] = {
        "stable": system.stable,
        "stability": system.record.stability,
        "least_damping_percent": system.least_damping,
        "critical": None if critical is None else eigenvalue_json(critical.eigenvalue, critical.damping_percent),
        "error": system.record.error,
    }
    return found | ({"modes": [_mode(mode, groups) for mode in system.record.modes]} if modes else {})


def _mode(mode: SharedMode, groups: dict[str, str]) -> dict[str, Any]:
    return eigenvalue_json(mode.eigenvalue, mode.damping_percent) | {
        "groups": by_group(mode.components, groups),
        "components": mode.components,
    }
