"""Findings of a study of places: in Python, in words, as JSON, as rows, and as a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from typing import Any

from orchestrator.core.errors import few
from orchestrator.core.options import Option
from orchestrator.core.truth import all_true
from orchestrator.core.units import whole_percent
from orchestrator.linear.spectra.modes import Mode, damping_percent, damping_ratio
from orchestrator.output.report.column_table import ShownTable
from orchestrator.output.report.html.elements import (
    SHADES,
    Figures,
    damping,
    document,
    table,
    verdict_paragraph,
)
from orchestrator.output.report.html.network_map import network_map
from orchestrator.output.report.short_texts import share_text
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.points.code import code_hash
from orchestrator.studies.siting.confirmation import Confirmation, SmallerDevice, how_sure
from orchestrator.studies.siting.place_ranking import PlaceRanking
from orchestrator.studies.siting.placing import ACTIVE, OURS_MVA, REACTIVE
from orchestrator.studies.siting.residues import SeenMode, Situation
from orchestrator.studies.siting.study import DEVICE, DROOP, HARDLY, SiteResult, SupportShift

TITLES = {"pod_p": "POD-P", "pod_q": "POD-Q", DROOP: "a droop"}
# damping [points] by 1 MW/Hz below which no bus reaches a mode: 1000 give a hundredth of a point
_NONE = 1e-5

_PEOPLE = 100
"""Support [MW/Hz or Mvar/Hz] by which shifts are shown to people."""

_MW = "per_100_MW_per_Hz"
"""Unit in a key of a shift by active power."""

_MVAR = "per_100_Mvar_per_Hz"
"""Unit in a key of a shift by reactive power."""

_SHOWN = 12  # buses in a table, best first
_NAMED = 4  # things in a sentence; the others are counted
_COLUMNS = 6
"""Modes in the terminal's table, the least damped; more columns leave no room for figures."""

_OUTSIDE = f", outside of {Option.RANGE}"


class Siting(PlaceRanking[SiteResult]):
    """How far a device at each bus moves the poorly damped modes, best bus first.

    Attributes
    ----------
    result
        All that was computed.
    """

    json_name = "site.json"
    table_name = "buses.csv"
    page_name = "site.html"

    @property
    def answer(self) -> str:
        """The best places in one sentence."""
        return answer(self.result)

    @property
    def answer_lines(self) -> list[str]:
        """The best place, and behind it what the other places bring."""
        first, further = answer_in_parts(self.result)
        return [first, _as_sentence(further)] if further else [first]

    @property
    def remarks(self) -> list[str]:
        """Return what coupled FMUs say of the best places, which modes these do not reach, and what was not judged."""
        return [*sureness(self.result), *remarks(self.result)]

    @property
    def without_device(self) -> ModesResult:
        return self.result.intact.found

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor site --json`` prints, as JSON's types."""
        return as_json(self.result)

    def rows(self) -> list[dict[str, Any]]:
        """One row for each bus and mode, best bus first, as ``buses.csv`` has them."""
        return rows(self.result)

    def best_table(self) -> ShownTable:
        """Return the best buses, as the terminal shows them."""
        return ranking_table(self.result)

    def page_title(self) -> str:
        """Return the heading in a notebook."""
        return f"Siting in {self.result.case.name}"

    def page_text(self) -> str:
        """Return the page for a browser."""
        return _page(self.result)


def unit(result: SiteResult, times: str = "1") -> str:
    """Return the unit of all shifts of the device, ``times`` as much."""
    if result.request.is_foreign:
        return "points of damping by the device as it is"
    quantity = "Mvar/Hz" if result.request.device == "pod_q" else "MW/Hz"
    phase = "" if result.request.device == DROOP else " with its phase tuned"
    return f"points of damping by {times} {quantity}{phase}"


def shift_text(result: SiteResult, damping: float) -> str:
    """A shift for people, in the unit ``unit(result, "100")``."""
    return f"{damping * (1 if result.request.is_foreign else _PEOPLE):+.3g}"


def device_title(result: SiteResult) -> str:
    return TITLES.get(result.request.name, Path(result.request.device).name)


def answer(result: SiteResult) -> str:
    return "".join(answer_in_parts(result))


def answer_in_parts(result: SiteResult) -> tuple[str, str]:
    """Return the answer, and behind it what the other places bring and how the places were put in order."""
    best = result.ranking[:3]
    most, at = result.least(best[0])
    mode = next(one for one in result.situations if one.name == at).modes[0]
    after = f" after the outage {at}" if at != result.intact.name else ""
    if max(result.least(bus)[0] for bus in result.ranking) < (
        0 if result.request.is_foreign else _NONE
    ):
        none = (
            f"none of the {len(result.ranking)} buses asked for is a"
            if result.request.buses
            else "no bus is a"
        )
        place = f"{best[0]} is no" if len(result.ranking) == 1 else none
        return (
            f"{place} place for {device_title(result)}: it does not help the mode {_called(mode)}{after}",
            "",
        )
    among = " of those asked for" if result.request.buses else ""
    if result.by_coupled:
        return _best_confirmed(result, among)
    parts = [f"{bus} {whole_percent(result.least(bus)[0], most)}" for bus in best[1:]]
    others = ", ".join([*(f"{part} of that" for part in parts[:1]), *parts[1:]])
    tried = [one for one in result.confirmations if one.bus == best[0] and not one.failure]
    then = "".join(f"{_doubt(one)}; as it is now, {with_it(one)}" for one in tried)
    moved = result.shifts[DEVICE][at][mode.label][best[0]]
    is_place = f"is the best place for {device_title(result)}{among}"
    if len(result.ranking) == 1:  # the best and the worst of one
        is_place = f"as a place for {device_title(result)}"
    if moved.hardly and moved.part is not None:
        part = f"{100 * moved.part:.1g} % of what the strongest place does"
        is_place = f"is hardly a place for {device_title(result)}, with {part}"
    return (
        f"{best[0]} {is_place}: {shift_text(result, most)} "
        f"{unit(result, '100')}, for the least damped mode{after} ({_called(mode)}){then}",
        f"; elsewhere less: {others}" if others else "",
    )


def _best_confirmed(result: SiteResult, among: str) -> tuple[str, str]:
    """The best of the places that coupled FMUs confirm, by the damping of the least damped mode there."""
    first, *others = [one for one in result.confirmations if not one.failure]
    seen = result.intact.modes[0]
    pod = "" if result.request.controller is None else " and its POD"
    then = ", ".join(f"{one.damping:.2f} % ({one.bus})" for one in others)
    by_support = sorted(result.ranking, key=lambda bus: -result.least(bus)[0])
    small = ", ".join(f"{bus} {shift_text(result, result.least(bus)[0])}" for bus in by_support[:3])
    before = seen.mode.damping_percent
    lower = first.other is not None and damping_percent(first.other) < before
    but = f", but {least_then(first, before)}" if lower else ""
    steps = f"{before:.2f} % → {first.damping:.2f} % for {title_of_mode(seen.label, seen.mode)}"
    return (
        f"{first.bus} is the best place for {device_title(result)}{among}: {steps}{_doubt(first)}{but}; "
        f"{with_it(first)}",
        f"; the least damped mode without the device is {title_of_mode(seen.label, seen.mode)}. "
        f"With {_rated(result)}{pod} at the next best places it has {then}, as coupled FMUs say. "
        f"By {unit(result, '100')}{_support_alone(result)} the best are {small}",
    )


def _support_alone(result: SiteResult) -> str:
    """Tell that the ranking's figures are of support without the converter that gives it; "" of a foreign device."""
    if result.request.is_foreign:
        return ""
    return " (support alone: the converter's voltage and delays, which move the mode as well, are not in it)"


def _doubt(one: Confirmation) -> str:
    """Tell of a place that coupled FMUs do not confirm; "" of one that they do."""
    return (
        ""
        if one.agrees
        else f" (NOT CONFIRMED: the prediction is off by {100 * one.error:.2g} %{_too_large(one)})"
    )


def _too_large(one: Confirmation) -> str:
    """Tell whether it is the device's size for which a prediction is off, by what a smaller one gave there."""
    smaller = one.smaller
    if smaller is None:
        return ""
    trial = f"{Option.RATING} {smaller.rating_mva:g}"
    if smaller.found.failure:
        return f"; with {trial} nothing is known: {smaller.found.failure}"
    off = f"off by {100 * smaller.found.error:.2g} %"
    if smaller.found.agrees:
        power = f"{smaller.short_circuit_mva:.0f} MVA short-circuit power"
        return f", as {smaller.larger_mva:g} MVA is much for a bus of {power}; {trial} is confirmed, {off}"
    return f"; its size is not the cause: {trial} is {off}"


def with_it(one: Confirmation) -> str:
    """Tell whether the system is stable with the device, and which swing that was not looked at has less damping."""
    return f"{_stable_with_it(one)}{_lower_beside(one)}"


def _stable_with_it(one: Confirmation) -> str:
    if one.stable is None:
        return "whether the system is stable with it is not known"
    return f"the system is {'stable' if one.stable else 'UNSTABLE'} with it"


def _lower_beside(one: Confirmation) -> str:
    beside = one.lower_beside
    if beside is None:
        return ""
    hertz = f"{beside.imag / math.tau:.3f} Hz"
    return (
        ", and a swing outside of "
        + Option.RANGE
        + f" has less: {damping_percent(beside):.2f} % at {hertz}"
    )


def _as_sentence(part: str) -> str:
    """Let a part behind a semicolon stand alone."""
    text = part.removeprefix("; ")
    return text[:1].upper() + text[1:]


def title_of_mode(label: str, mode: Mode) -> str:
    """Name a mode by its label and its frequency, which the label may tell already."""
    hertz = f"{mode.frequency_hz:.3f} Hz"
    return label if hertz in label else f"{label}, {hertz}"


def with_damping(label: str, mode: Mode) -> str:
    """Name a mode by its label, frequency and damping."""
    return f"{title_of_mode(label, mode)}, {mode.damping_percent:.2f} %"


def _called(seen: SeenMode) -> str:
    return with_damping(seen.label, seen.mode)


def sureness(result: SiteResult) -> list[str]:
    before = result.intact.modes[0].mode.damping_percent
    found = [_confirmed(result, one, before) for one in result.confirmations]
    return [*_unstable(result), *how_sure(found, result.unconfirmed)]


def _unstable(result: SiteResult) -> list[str]:
    """Return a sentence on the situations in which something grows without the device, where there are any."""
    bad = [
        f"{at.name} ({_growing(at)})"
        for at in result.worst_first
        if at.found.stability.stable is False
    ]
    return [f"UNSTABLE without the device: {few(bad, _NAMED)}"] if bad else []


def _growing(at: Situation) -> str:
    """Name the mode that grows there, or what grows beside the modes of the range, which are all damped."""
    least = at.modes[0]
    if least.mode.damping_percent < 0:
        return _called(least)
    stability = at.found.stability
    grows = stability.growth(stability.mode) if stability.mode else stability.because()
    return f"{grows}; least damped in the range: {_called(least)}"


def _confirmed(result: SiteResult, one: Confirmation, before: float) -> str:
    if one.failure:
        return f"{one.bus}: NOT CONFIRMED: {one.failure}"
    word = "confirmed" if one.agrees else "NOT CONFIRMED"
    device = "the device" if result.by_coupled else _rated(result)  # whose rating the answer tells
    steps = f"{before:.2f} % → {one.damping_alone:.2f} % with {device}"
    if one.setting is not None:
        steps += (
            f" → {one.damping:.2f} % with its POD (K {one.setting.gain:g} pu{end_of_search(one)})"
        )
    if one in result.breaking:
        word += ", but UNSTABLE with it (`gfor modes` of a case with it tells the cause, often the step)"
    if one.damping < before:
        steps += ", LESS than without it"
    stable = "" if one in result.breaking else f"; {_stable_with_it(one)}"
    then = f"{least_then(one, before)}{stable}{_lower_beside(one)}"
    return f"{one.bus}: {word} by coupled FMUs ({_prediction(one)}): {steps}; {then}"


def _prediction(one: Confirmation) -> str:
    """Tell what of the mode was predicted, and how far it is off: never the figure of the ranking by support."""
    off = f"off by {100 * one.error:.2g} %"
    off += _too_large(one)
    if one.setting is not None:
        return f"the mode's shift by a small gain, as predicted, is {off}"
    predicted = f"the device's own response predicts {one.damping_predicted:.2f} %"
    return f"{predicted}, the mode's shift is {off}"


def end_of_search(one: Confirmation) -> str:
    """Tell whether the search for the gain ended at its bound, or where more gain brings nothing."""
    if one.search is None:
        return ""
    if one.search.next_gain is None:
        return ", the largest that --gain allows"
    least = one.search.next_mode
    if least is None:
        return f"; with {one.search.next_gain:g} something grows"
    mode = f"{least.imag / math.tau:.3f} Hz, has {damping_percent(least):.2f} %"
    return f"; with {one.search.next_gain:g} the least damped mode, {mode}"


def least_then(one: Confirmation, before: float) -> str:
    """The least damped mode with the device: whether it is another one, and has less than the least before."""
    if one.other is None:
        among = "" if one.lower_beside is None else " of the range"
        return f"it stays the least damped{among}"
    percent = damping_percent(one.other)
    worse = f", LESS than the least before, {before:.2f} %" if percent < before else ""
    return f"least damped then is another mode: {one.other.imag / math.tau:.3f} Hz, {percent:.2f} %{worse}"


def _rated(result: SiteResult) -> str:
    given = result.request.rating or (None if result.request.is_foreign else OURS_MVA)
    return f"the device of {'its own rating' if given is None else f'{given:g} MVA'}"


def remarks(result: SiteResult) -> list[str]:
    """Modes that the best bus, or no bus, reaches; what was not judged."""
    said, out_of_reach, best = [], list[tuple[str, str]](), result.ranking[0]
    for seen in result.intact.modes:
        shifts = result.shifts[DEVICE][result.intact.name][seen.label]
        top = max(shifts, key=lambda bus: abs(shifts[bus].change))
        strongest = top if top in result.ranking else "the strongest place"
        reach = max(
            abs(s.damping) for s in result.shifts[ACTIVE][result.intact.name][seen.label].values()
        )
        share = shifts[best].part
        if share is None:
            continue
        if reach < _NONE:
            said.append(
                f"{_called(seen)}: no bus reaches this mode; it cannot be damped from the network"
            )
        elif shifts[best].hardly:
            out_of_reach.append((_called(seen), f"{100 * share:.1g} % of {strongest}"))
    said += [*_not_controllable(out_of_reach, best), *_what_was_looked_at(result)]
    said += [
        f"outage {at.name}: {', '.join(map(str, at.widenings))}, so that it starts"
        for at in result.situations
        if at.widenings
    ]
    said += _not_judged(result)
    if result.terminals:
        there = few(result.terminals, _NAMED)
        said.append(f"left out: the terminals of units, {there}; --buses 'bus_*' takes all buses")
    return said


def _what_was_looked_at(result: SiteResult) -> list[str]:
    """Say of a large network what is not known of all its buses."""
    network = result.prepared.network
    if not result.intact.knows_all and network is not None:
        number = f"{len(result.intact.voltages)} of {len(network.buses)} buses"
        return [
            f"looked at: the {number} that {Option.BUSES} names; what the others would do is not known"
        ]
    behind = [bus for bus in result.ranking if bus not in result.intact.looked_into]
    if not behind:
        return []
    return [
        f"{len(behind)} of the {len(result.ranking)} buses, which move the least damped mode less than the first ones, "
        "were not looked into: their figures leave out what support does to the voltage of its own bus"
    ]


def _not_controllable(modes: Sequence[tuple[str, str]], bus: str) -> list[str]:
    """Say which modes, each with its part of the best, a bus hardly moves: one by one, or many in one sentence."""
    if len(modes) <= _NAMED:
        return [f"{mode}: not controllable at {bus} ({part})" for mode, part in modes]
    named = few([mode for mode, _ in modes], _NAMED, "; ")
    return [
        f"{len(modes)} modes are not controllable at {bus} (each at most {100 * HARDLY:g} % of the strongest place): "
        f"{named}"
    ]


def _not_judged(result: SiteResult) -> list[str]:
    """Say what the study did not judge: one by one, or many swings outside of its range in one sentence."""
    beyond, outages = _swings_beyond(result), _outages_without(result)
    if len(beyond) <= _NAMED:
        return [f"not judged: {point}" for point in (*beyond, *outages)]
    swings = few([text.removesuffix(_OUTSIDE) for text in beyond], _NAMED, "; ")
    many = f"not judged: {len(beyond)} swings{_OUTSIDE}, least damped first: {swings}"
    return [many, *(f"not judged: {point}" for point in outages)]


def open_points(result: SiteResult) -> list[str]:
    """Modes, outages and places that the study did not judge, each with the reason."""
    return [
        *_swings_beyond(result),
        *_outages_without(result),
        *(f"{bus}: interrupted before coupled FMUs confirmed it" for bus in result.unconfirmed),
    ]


def _swings_beyond(result: SiteResult) -> list[str]:
    hidden = result.intact.found.hidden
    values = sorted(hidden.electromechanical, key=damping_ratio) if hidden else []
    return [
        f"{value.imag / math.tau:.3f} Hz, {damping_percent(value):.2f} %{_OUTSIDE}"
        for value in values
    ]


def _outages_without(result: SiteResult) -> list[str]:
    return [f"outage {name}: {why}" for name, why in result.not_judged.items()]


def _unit_in_keys(result: SiteResult) -> str:
    """Return the unit of the device's shifts for a key; "" for a foreign device, which is counted as it is."""
    if result.request.is_foreign:
        return ""
    return _MVAR if result.request.device == "pod_q" else _MW


def as_json(result: SiteResult) -> dict[str, Any]:
    here, stable = result.intact.name, [at.found.stability.stable for at in result.situations]
    ranked_by = "damping with the device, by coupled FMUs" if result.by_coupled else unit(result)
    return {
        **result.prepared.about,
        "device": result.request.device,
        "units": {
            "damping_points": unit(result),
            "real, imag": "eigenvalue's shift [rad/s] by 1 MW/Hz or 1 Mvar/Hz in phase with the bus's frequency, P "
            "withdrawn and Q injected while it is high; or by the device",
            "p, q": "the same for active and for reactive power; 1 pu of gain on 100 MVA is 100 MW by the rated Hz",
        },
        "answer": answer(result),
        "sure": sureness(result),
        "remarks": remarks(result),
        "open_points": open_points(result),
        "agrees": result.agrees,
        "ranked_by": ranked_by,
        "terminals_left_out": list(result.terminals),
        "stable": all_true(stable),
        "warnings": list(result.intact.found.warnings),
        "code": code_hash(),
        "modes": _modes(result.intact.modes),
        "buses": [_bus_json(result, bus, k + 1) for k, bus in enumerate(result.ranking)],
        "outages": [_outage_json(result, at) for at in result.worst_first if at.name != here],
        "not_judged": dict(result.not_judged),
        "confirmed": list(map(confirmation_json, result.confirmations)),
        "unconfirmed": list(result.unconfirmed),
    }


def _bus_json(result: SiteResult, bus: str, rank: int) -> dict[str, Any]:
    """Return the shifts of each mode by support at a bus."""

    def shifts(of: str, unit: str) -> dict[str, Any]:
        by_mode = result.shifts[of][result.intact.name]
        return {mode: _shift(by_bus[bus], unit) for mode, by_bus in by_mode.items()}

    points, situation = result.least(bus)
    return {
        "bus": bus,
        "rank": rank,
        "looked_into": bus in result.intact.looked_into,
        "shift": shifts(DEVICE, _unit_in_keys(result)),
        "p": shifts(ACTIVE, _MW),
        "q": shifts(REACTIVE, _MVAR),
        "least": {"damping_points": points, "situation": situation},
    }


def _outage_json(result: SiteResult, at: Situation) -> dict[str, Any]:
    """Return the modes after an outage, and the best buses for the least damped one."""
    best = _best(result, at.name, at.modes[0].label)
    limits = [asdict(one) for one in at.widenings]
    widened = {"widened_limits": limits} if limits else {}
    return {"outage": at.name, "modes": _modes(at.modes), "best": best, **widened}


def _modes(modes: tuple[SeenMode, ...]) -> list[dict[str, Any]]:
    return [
        {
            "mode": seen.label,
            **eigenvalue_json(seen.mode.eigenvalue, seen.mode.damping_percent),
            "components": dict(list(seen.mode.by_component.items())[:3]),
        }
        for seen in modes
    ]


def _shift(shift: SupportShift, unit: str = "") -> dict[str, Any]:
    """One shift by one MW/Hz or Mvar/Hz, and, with its unit in the key, by the 100 of them that people are shown."""
    return {
        "damping_points": shift.damping,
        **({f"damping_points_{unit}": _PEOPLE * shift.damping} if unit else {}),
        "real": shift.change.real,
        "imag": shift.change.imag,
        "part_of_best": shift.part,
        "controllable": None if shift.part is None else not shift.hardly,
    }


def _best(result: SiteResult, situation: str, mode: str) -> dict[str, float]:
    shifts = result.shifts[DEVICE][situation][mode]
    return {
        bus: shifts[bus].damping
        for bus in sorted(result.ranking, key=lambda bus: -shifts[bus].damping)[:3]
    }


def confirmation_json(one: Confirmation, place: str = "bus") -> dict[str, Any]:
    """A confirmation as JSON's types; ``place``: key of the bus, or of the machine."""
    if one.failure:
        return {place: one.bus, "agrees": False, "failure": one.failure}
    pod = (
        {}
        if one.setting is None
        else {
            "K": one.setting.gain,
            "search_ended_at_bound": one.search is not None and one.search.next_gain is None,
            "T_S1": one.setting.filters.T_S1,
            "T_S2": one.setting.filters.T_S2,
            "N_S": one.setting.filters.N_S,
        }
    )
    device = eigenvalue_json(one.with_device, damping_percent(one.with_device))
    return {
        place: one.bus,
        "agrees": one.agrees,
        "error_percent": 100 * one.error,
        "predicted": {"real": one.predicted.real, "imag": one.predicted.imag},
        "coupled": {"real": one.coupled.real, "imag": one.coupled.imag},
        "with_device": device,
        "damping_percent_of_device_alone": one.damping_alone,
        "damping_percent": one.damping,
        "least_damping_percent": one.least_damping,
        "least_damped": None
        if one.least is None
        else eigenvalue_json(one.least, damping_percent(one.least)),
        "least_damped_is_another_mode": one.other is not None,
        "least_damped_outside_of_range": None
        if one.beside is None
        else eigenvalue_json(one.beside, damping_percent(one.beside)),
        "stable": one.stable,
        "pod": pod,
        "smaller_device": _smaller_json(one.smaller),
    }


def _smaller_json(smaller: SmallerDevice | None) -> dict[str, Any] | None:
    """Return as JSON's types what a smaller device at the bus gave; None where none was tried."""
    if smaller is None:
        return None
    found = smaller.found
    return {
        "rating_mva": smaller.rating_mva,
        "short_circuit_mva": smaller.short_circuit_mva,
        "agrees": found.agrees,
        "error_percent": None if found.failure else 100 * found.error,
        "failure": found.failure or None,
    }


def rows(result: SiteResult) -> list[dict[str, Any]]:
    """One row for each bus and mode, best bus first."""
    content = as_json(result)
    return [
        {"bus": bus["bus"], "rank": bus["rank"], "mode": mode, **shift}
        for bus in content["buses"]
        for mode, shift in bus["shift"].items()
    ]


def ranking_table(result: SiteResult) -> ShownTable:
    """The best buses, and what they do to the least damped modes."""
    title, number = f"{unit(result, '100')}; best first", len(result.intact.modes)
    if any("hardly" in _cells(result, bus) for bus in result.ranking[:_SHOWN]):
        title += f"; hardly: less than {100 * HARDLY:g} % of what the best bus does"
    if number > _COLUMNS:
        title += f"; the {_COLUMNS} least damped of {number} modes, {Option.JSON} has all"
    return _table_of(result, title, result.ranking[:_SHOWN], _COLUMNS)


def _table_of(
    result: SiteResult, title: str, buses: Sequence[str], most: int | None = None
) -> ShownTable:
    """Return the shifts of the modes, of at most so many where a number is given, by bus."""
    seen_modes = result.intact.modes[:most]
    modes = [f"{seen.label}, {seen.mode.damping_percent:.2f} %" for seen in seen_modes]
    rows = [[bus, *_cells(result, bus)[:most], *_confirmed_cells(result, bus)] for bus in buses]
    return ShownTable(title, ["Bus", *modes, *_confirmed_headings(result)], rows)


def _confirmed_headings(result: SiteResult) -> list[str]:
    """Return the headings of the damping by coupled FMUs; none where nothing is confirmed."""
    if not result.confirmations:
        return []
    label = result.intact.modes[0].label
    pod = [] if result.request.controller is None else ["with its POD [%]"]
    return [f"{label} with the device alone [%]", *pod, "least damped then [%]", "at [Hz]"]


def _confirmed_cells(result: SiteResult, bus: str) -> list[str]:
    headings = _confirmed_headings(result)
    one = next((x for x in result.confirmations if x.bus == bus and not x.failure), None)
    if one is None:
        return ["–" for _ in headings]
    pod = [] if result.request.controller is None else [f"{one.damping:.2f}"]
    least = "–" if one.least_damping is None else f"{one.least_damping:.2f}"
    hertz = "–" if one.least is None else f"{one.least.imag / math.tau:.3f}"
    return [f"{one.damping_alone:.2f}", *pod, least, hertz]


def _cells(result: SiteResult, bus: str) -> list[str]:
    shifts = (
        result.shifts[DEVICE][result.intact.name][seen.label][bus] for seen in result.intact.modes
    )
    return ["hardly" if one.hardly else shift_text(result, one.damping) for one in shifts]


def _page(result: SiteResult) -> str:
    figures, title = (
        Figures(),
        f"{result.case.table.title or result.case.name}: where to put {device_title(result)}",
    )
    sure = result.agrees and all(one.stable for one in result.confirmations[:1])
    shade = "good" if sure and result.confirmations else "soft"
    unconfirmed = [] if result.confirmations else sureness(result)[-1:]
    lines = "".join(f"<li>{escape(text)}</li>" for text in (*unconfirmed, *remarks(result)))
    unstable = "".join(f'<p class="bad">{escape(text)}</p>' for text in _unstable(result))
    first, further = answer_in_parts(result)
    behind = f"<p>{escape(_as_sentence(further))}</p>" if further else ""
    findings = (
        f'<div class="findings">{verdict_paragraph(shade, escape(first))}{unstable}{behind}'
        f'{_confirmed_table(result)}<ul class="soft">{lines}</ul></div>'
    )
    content = [("Map", "".join(_map(result, seen, figures) for seen in result.intact.modes[:3]))]
    all_buses = _table_of(result, unit(result, "100"), result.ranking)
    content.append(("All buses", all_buses.html()))
    outages = [at for at in result.worst_first if at.name != result.intact.name]
    if outages:
        best = []
        for at in outages:
            mode = at.modes[0]
            there = ", ".join(
                f"{bus} {shift_text(result, x)}"
                for bus, x in _best(result, at.name, mode.label).items()
            )
            best.append(
                [
                    escape(at.name),
                    escape(mode.label),
                    damping(mode.mode.damping_percent),
                    escape(there),
                ]
            )
        content.append(
            (
                "After outages",
                table("Worst first", ["Outage", "Mode", "Damping [%]", "Best"], best, left=2),
            )
        )
    kind, names = f"{result.prepared.title}; code {code_hash()[:12]}", result.prepared.names
    return document(title, kind, findings, content, names=names)


def _confirmed_table(result: SiteResult) -> str:
    """The places that coupled FMUs tried, a line each: the verdict, and the damping without, with device and POD."""
    if not result.confirmations:
        return ""
    seen = result.intact.modes[0]
    before = f"{seen.mode.damping_percent:.2f}"
    rows = []
    for one in result.confirmations:
        verdict, good = _verdict_on(result, one)
        cells = [escape(one.bus), f'<b class="{SHADES[good]}">{escape(verdict)}</b>', before]
        others = _confirmed_cells(result, one.bus)
        off = "–" if one.failure else f"{100 * one.error:.2g}"
        rows.append([*cells, *others, off])
    headings = ["Bus", "By coupled FMUs", f"{seen.label} without [%]"]
    headings += [*_confirmed_headings(result), "prediction off by [%]"]
    return table(f"With {_rated(result)}", headings, rows, left=2)


def _verdict_on(result: SiteResult, one: Confirmation) -> tuple[str, bool]:
    if one.failure:
        return f"NOT CONFIRMED: {one.failure}", False
    if one in result.breaking:
        return "UNSTABLE with it", False
    word = "confirmed" if one.agrees else "NOT CONFIRMED"
    return f"{word}; {_stable_with_it(one)}", one.agrees and one.stable is True


def _map(result: SiteResult, seen: SeenMode, figures: Figures) -> str:
    shifts: Mapping[str, SupportShift] = result.shifts[DEVICE][result.intact.name][seen.label]
    network = result.prepared.network
    assert network is not None
    branches = [(line.from_bus, line.to_bus) for line in network.lines]
    branches += [(x.buses[0], bus) for x in network.transformers for bus in x.buses[1:]]
    most = max(abs(one.change) for one in shifts.values()) or 1.0
    heat = dict.fromkeys(network.buses, 0.0)
    heat |= {bus: abs(one.change) / most for bus, one in shifts.items()}
    texts = {bus: f"{result.prepared.names.of(bus)}: not looked at" for bus in network.buses} | {
        bus: f"{result.prepared.names.of(bus)}: {shift_text(result, one.damping)} {unit(result, '100')}"
        for bus, one in shifts.items()
    }
    who = ", ".join(share_text(entry) for entry in list(seen.mode.by_component.items())[:3])
    text = f"{_called(seen)} ({who}): the redder and larger a bus, the farther support there moves the mode."
    if result.terminals:
        text += " The terminals of units are drawn, and are no candidates."
    return figures.add(
        network_map(
            seen.label,
            branches,
            heat,
            texts,
            labels=result.prepared.names.of,
        ),
        text,
    )[0]
