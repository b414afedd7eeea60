"""Questions of the live page that a saved page answers too: what a line out, and the converter, do to the modes.

The page needs of each answer what one sentence tells: whether the system is stable, and its least damped mode."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from orchestrator.core.errors import CosimError
from orchestrator.face.explore.smaller import rounded
from orchestrator.output.report.short_texts import first_sentence, short
from orchestrator.studies.points.failure import Failure

_FIGURES = ("frequency_hz", "damping_percent")
_DIGITS = 10  # significant ones of a mode's figures, as in all answers of the page
_TRIED = 40  # lines with the largest flows that are looked at for one without which the network hangs together
_LONGEST_REASON = 200  # characters of why a question has no answer
_SHARE = "units.alpha."  # begin of the values that give a unit's bus a converter

Computed = Callable[[str, Mapping[str, Any]], dict[str, Any]]
"""The answer to ``modes`` of a scenario with some values."""


def answered_questions(
    begun: Mapping[str, Any],
    shown: Mapping[str, Any],
    opened: Mapping[str, Any],
    computed: Computed,
) -> list[dict[str, Any]]:
    """Return the questions with their answers, at the values with which the page begins.

    Parameters
    ----------
    begun
        Scenario and values with which the page begins.
    shown
        Answer to ``parameters``: the diagram, and the values.
    opened
        Answer to ``open``, with all scenarios of the case."""
    scenario, values = str(begun["scenario"]), dict(begun["values"])
    other = converter_apart(opened.get("systems", {}), scenario)
    if other is None and not shown.get("diagram"):
        return []
    now = computed(scenario, values)
    found = []
    line = line_to_lose(shown, now["modes"]["scenarios"][0].get("power_flow"))
    if line is not None:
        lost = {**values, str(line["open"]): False}
        found.append(
            {
                "question": f"What if line {line['name']} is out?",
                "words": f"Without line {line['name']}",
                **_answered(computed, scenario, lost),
            }
        )
    if other is not None:
        found.append(
            {
                "question": "What does the converter do?",
                "words": opened["scenarios"][other],
                "other": other,
                **_answered(computed, other, {}),
            }
        )
    return [{**one, "now": _swing(now)} for one in found]


def line_to_lose(
    shown: Mapping[str, Any], flow: Mapping[str, Any] | None
) -> Mapping[str, Any] | None:
    """Return the line with the largest flow without which the network still hangs together."""
    diagram = shown.get("diagram")
    if not diagram:
        return None
    own = {one["parameter"]: one["value"] for one in shown.get("parameters", ())}
    carried = {one["name"]: abs(one["p_from_mw"]) for one in (flow or {}).get("branches", ())}
    buses = [bus["name"] for bus in diagram["buses"]]
    closed = [line for line in diagram["lines"] if own.get(line["open"]) is not False]
    closed.sort(key=lambda line: -carried.get(line["name"], 0.0))
    switched = [line for line in closed if line["open"] in own]
    return next(
        (
            line
            for line in switched[:_TRIED]
            if _hangs_together(buses, [one for one in closed if one is not line])
        ),
        None,
    )


def converter_apart(systems: Mapping[str, str], scenario: str) -> str | None:
    """Return the scenario that has no converter where this one has one, or the other way round, and is else most alike.

    ``systems``: what each scenario removes and sets, as JSON."""
    read = {name: json.loads(text) for name, text in systems.items()}
    if scenario not in read:
        return None
    own = read[scenario]
    apart = [name for name in read if _converters(read[name]) != _converters(own)]
    return min(apart, key=lambda name: len([*_differences(read[name], own)]), default=None)


def _converters(system: Mapping[str, Any]) -> tuple[list[str], list[str]]:
    return system["remove"], [key for key in system["set"] if key.startswith(_SHARE)]


def _differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> Iterator[Any]:
    for kind in ("remove", "parameters"):
        yield from (entry for entry in one[kind] if entry not in other[kind])
        yield from (entry for entry in other[kind] if entry not in one[kind])
    a, b = one["set"], other["set"]
    yield from (key for key in {**a, **b} if a.get(key) != b.get(key))


def _hangs_together(buses: Sequence[str], lines: Sequence[Mapping[str, Any]]) -> bool:
    beside: dict[str, list[str]] = {}
    for line in lines:
        beside.setdefault(line["from"], []).append(line["to"])
        beside.setdefault(line["to"], []).append(line["from"])
    reached, todo = {buses[0]}, [buses[0]]
    while todo:
        new = {*beside.get(todo.pop(), ())} - reached
        reached |= new
        todo += new
    return len(reached) == len(buses)


def _answered(computed: Computed, scenario: str, values: Mapping[str, Any]) -> dict[str, Any]:
    try:
        return {"answer": _swing(computed(scenario, values))}
    except CosimError as error:
        failure = Failure.of(error)
        said = first_sentence(str(failure.cause or failure.text))
        return {"reason": short(said.rstrip("."), _LONGEST_REASON)}


def _swing(answer: Mapping[str, Any]) -> dict[str, Any]:
    """Keep what a sentence tells of an answer, in the form of the whole one."""
    (one,) = answer["modes"]["scenarios"]
    least = sorted(one["modes"], key=lambda mode: mode["damping_percent"])[:1]
    modes = [rounded({key: mode[key] for key in _FIGURES}, _DIGITS) for mode in least]
    return {"modes": {"scenarios": [{"stable": one["stable"], "modes": modes}]}}
