"""Where a device helps: its effect at every bus, intact and after outages, and the best places confirmed."""

import cmath
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import Any, cast

from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import ComponentTable
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.short_circuit import ShortCircuit
from orchestrator.core.asked import (
    DAMPING,
    FILE,
    NAMES,
    OUTAGES,
    POSITIVE,
    RANKED,
    FieldKind,
    Names,
    request_field,
    text_or_none,
)
from orchestrator.core.asked import positive as above_zero
from orchestrator.core.errors import CosimError, InputError, StartError
from orchestrator.core.options import Option
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.studies.modes.modes import running
from orchestrator.studies.operating_points.item import Item
from orchestrator.studies.operating_points.line_ends import lines_with_ends
from orchestrator.studies.operating_points.outages import INTACT, read_outages
from orchestrator.studies.operating_points.preparation import ItemPreparation, failure
from orchestrator.studies.operating_points.widening import widenings_of
from orchestrator.studies.points.request import OfCase, of_frequencies, of_scenario, of_values
from orchestrator.studies.siting import placing
from orchestrator.studies.siting.candidates import candidates, question_about, unit_terminals
from orchestrator.studies.siting.confirmation import (
    Confirmation,
    SmallerDevice,
    confirmed,
    in_turn,
    swings_outside,
)
from orchestrator.studies.siting.residues import (
    BusesAsked,
    SeenMode,
    Situation,
    situation_of,
)

PODS = {"pod_p": placing.ACTIVE, "pod_q": placing.REACTIVE}
DROOP = "droop"
REGULATOR = "regulator"
"""A POD at a machine's voltage regulator: `machines`."""

_RATING = FieldKind(
    "MVA", POSITIVE.read, lambda given, name: None if given is None else above_zero(given, name)
)
_DEVICE = FieldKind("DEVICE", str, lambda given, argument: str(text_or_none(str(given), argument)))
# A bus that moves a mode by less than this part of what the best bus does hardly reaches it
HARDLY = 0.02

_SMALL = 0.05
"""Part of a bus's short-circuit power up to which a converter there is a small device: a short-circuit ratio of 20. A
prediction takes the mode for that without the device, which a larger one changes by its mere presence."""


@dataclass(frozen=True)
class SiteRequest(OfCase):
    """Where to put a converter: how far support at each bus moves each poorly damped mode.

    Residues of the whole linear model between the frequency of a bus and P or Q injected there; the operating
    point stays. The best buses are confirmed: a converter at rest is put there as an FMU, its POD is tuned, and
    the coupled system's mode is compared.

    Raises
    ------
    InputError
        If the case has no network, no oscillation is in the range, or the device cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> places = gfor.load("two_area_rms").site("pod_p", scenario="gfor", confirm=1)
    >>> places.ranking, places.agrees
    (('bus_2', 'bus_3'), True)
    """

    device: str | Path = request_field(
        _DEVICE,
        "pod_p",
        "pod_p (default), pod_q, droop, regulator (a machine's), or a vendor's .fmu",
    )
    scenario: str | None = of_scenario()
    values: Mapping[str, Any] | None = of_values()
    _: KW_ONLY
    binding: str | Path | None = request_field(FILE, None, "binding of the vendor's FMU")
    below: float = request_field(
        DAMPING,
        0.1,
        "damping of poorly damped modes (default: 10)",
        python="damping [%] of the modes that are looked at; the least damped one where none is damped so little",
    )
    frequencies: tuple[float, float] = of_frequencies()
    outages: Names | None = request_field(
        OUTAGES, None, "rank for these as well: n-1, lines, units, or names (repeatable)"
    )
    buses: Sequence[str] = request_field(
        NAMES,
        (),
        "only these may be the place, such as 9, bus_9 or 'bus_1*' (default: all but units' terminals)",
    )
    confirm: int = request_field(
        RANKED,
        3,
        "confirm the best N by coupled FMUs (default: 3)",
        python="how many of the best buses are confirmed by coupled FMUs",
    )
    rating: float | None = request_field(
        _RATING,
        None,
        "of the converter that confirms (default: 100), or of the vendor's FMU (default: its own)",
    )
    gain: float = request_field(
        POSITIVE, 200.0, "largest of its POD [pu of its rating] (default: 200)", "K"
    )

    @property
    def name(self) -> str:
        return str(self.device)

    @property
    def binding_file(self) -> Path | None:
        return None if self.binding is None else Path(self.binding)

    @property
    def controller(self) -> str | None:
        """The POD that is tuned; None for a device that is as it is."""
        return self.name if self.device in PODS else None

    @property
    def is_foreign(self) -> bool:
        return self.device not in (*PODS, DROOP, REGULATOR)


@dataclass(frozen=True)
class SupportShift:
    """Δλ [rad/s] by a device, or by 1 MW/Hz or 1 Mvar/Hz without a phase shift; the change of the damping ratio
    [points], with the phase that a tuned POD gives or by the device as it is; and its part of the best bus's, None
    where not all buses were looked at."""

    change: complex
    damping: float
    part: float | None

    @property
    def hardly(self) -> bool:
        return self.part is not None and self.part < HARDLY


DEVICE = "device"
ByMode = Mapping[str, Mapping[str, SupportShift]]
Shift = Callable[[Situation, str, SeenMode], complex]


@dataclass(frozen=True)
class SiteResult:
    """Shifts of `DEVICE`, of 1 MW/Hz (`ACTIVE`) and of 1 Mvar/Hz (`REACTIVE`), by name of the situation, label of the
    mode, and bus; the buses that may be the place, best first; and the outages without modes, with the reason."""

    case: Case
    request: SiteRequest
    situations: tuple[Situation, ...]
    shifts: Mapping[str, Mapping[str, ByMode]]
    ranking: tuple[str, ...]
    not_judged: Mapping[str, str]
    confirmations: tuple[Confirmation, ...] = ()
    unconfirmed: tuple[str, ...] = ()  # buses before whose confirmation it was interrupted
    terminals: tuple[str, ...] = ()  # buses of units that were left out, as nobody asked for them

    @property
    def intact(self) -> Situation:
        return self.situations[0]

    @property
    def prepared(self) -> PreparedScenario:
        """The scenario without the device, with what is to be asked about the device beside its own questions."""
        prepared = self.intact.found.prepared
        question = question_about(self.request.rating, prepared)
        asked = prepared.questions if question is None else (question, *prepared.questions)
        return replace(prepared, questions=asked)

    @property
    def by_coupled(self) -> bool:
        """True if the places that are confirmed come first, by the damping that coupled FMUs give: without outages,
        for which nothing is confirmed, and of at least two places."""
        return (
            len(self.situations) == 1 and len([x for x in self.confirmations if not x.failure]) > 1
        )

    @property
    def worst_first(self) -> list[Situation]:
        """The situations by the damping of their least damped mode."""
        return sorted(self.situations, key=lambda one: one.modes[0].mode.damping_ratio)

    def least(self, bus: str) -> tuple[float, str]:
        """Return the device's least effect there on the least damped mode [points], and in which situation."""
        return min(
            (self.shifts[DEVICE][s.name][s.modes[0].label][bus].damping, s.name)
            for s in self.situations
        )

    @property
    def agrees(self) -> bool:
        return all(one.agrees for one in self.confirmations)

    @property
    def breaking(self) -> list[Confirmation]:
        """The places at which the device makes a stable system unstable."""
        stable = self.intact.found.stability.stable is True
        return [one for one in self.confirmations if stable and one.stable is False]


def find_sites(
    case: Case, request: SiteRequest, report: Callable[[int, int], None] = lambda a, b: None
) -> SiteResult:
    """Linearise the case with and without outages, shift its modes by a device at every bus, and confirm the best."""
    if request.is_foreign and not request.name.lower().endswith(".fmu"):
        raise InputError(
            Option.DEVICE
            + f" {request.device}: give pod_p, pod_q, droop, regulator or the path of an "
            ".fmu"
        )
    scenario = request.scenario or next(iter(case.scenarios))
    open_case = replace(case, injections=True)
    preparation = ItemPreparation(open_case, scenario, request.layers, request.step_size)
    buses = candidates(request.buses, preparation.base)
    outages = read_outages(cast("str | None", request.outages), preparation.elements)
    opening = lines_with_ends(element for outage in outages for element in outage.elements)
    if opening:
        open_case = replace(open_case, line_ends=opening)
        preparation = ItemPreparation(open_case, scenario, request.layers, request.step_size)
    total = len(outages) + min(request.confirm, len(buses))
    asked = BusesAsked(frozenset(buses), bool(request.buses), request.is_foreign)
    situations, not_judged = [], dict[str, str]()
    for k, outage in enumerate(outages):
        report(k, total)
        item = Item(0, k, {}, outage.elements, outage.elements)
        try:
            one = _situation(preparation, item, outage.name, request, asked)
        except CosimError as error:
            if not outage.elements:
                raise
            not_judged[outage.name] = f"{failure(error, item)[0]}: {error}"
            continue
        if one.modes:
            situations.append(one)
        elif outage.elements:
            not_judged[outage.name] = "no oscillation in the range"
    report(len(outages), total)
    if not situations or situations[0].name != INTACT:
        low, high = request.frequencies
        raise InputError(
            f"scenario {scenario!r} has no oscillation from {low:g} to {high:g} Hz; give "
            "another " + Option.RANGE
        )
    result = _shifted(case, request, situations, not_judged, scenario)
    result = replace(
        result,
        ranking=tuple(bus for bus in result.ranking if bus in buses),
        terminals=() if request.buses else tuple(unit_terminals(preparation.base)),
    )
    if not result.ranking:
        raise InputError(
            Option.BUSES + f": {', '.join(request.buses)}: an outage cuts them off; give others"
        )
    return _with_confirmations(result, scenario, lambda done: report(len(outages) + done, total))


def _situation(
    preparation: ItemPreparation,
    item: Item,
    name: str,
    request: SiteRequest,
    places: BusesAsked,
) -> Situation:
    """The network as it is, or after an outage, which is computed with wider limits of exciters and governors where
    these alone keep it from starting."""
    asked = (name, request.frequencies, 100 * request.below, places)
    if not item.out:
        return situation_of(preparation.base, *asked)
    prepared = preparation.prepared(item).scenario
    try:
        return situation_of(prepared, *asked)
    except StartError as error:
        wider = error.wider
        if not wider:
            raise
    found = situation_of(preparation.prepared(item, wider).scenario, *asked)
    return replace(found, widenings=widenings_of(prepared, wider))


def _shifted(
    case: Case,
    request: SiteRequest,
    situations: list[Situation],
    not_judged: dict[str, str],
    scenario: str,
) -> SiteResult:
    shifts = {
        kind: _all_shifts(situations, _ideal(kind), tuned=True)
        for kind in (placing.ACTIVE, placing.REACTIVE)
    }
    if request.is_foreign:
        shifts[DEVICE] = _of_foreign(case, request, situations, shifts[placing.ACTIVE], scenario)
    elif request.device == DROOP:
        shifts[DEVICE] = _all_shifts(situations, _ideal(placing.ACTIVE), tuned=False)
    else:
        shifts[DEVICE] = shifts[PODS[request.name]]
    found = SiteResult(case, request, tuple(situations), shifts, (), not_judged)
    known = [set(by_bus) for by_mode in shifts[DEVICE].values() for by_bus in by_mode.values()]
    buses = [bus for bus in situations[0].voltages if all(bus in there for there in known)]
    return replace(found, ranking=tuple(sorted(buses, key=lambda bus: -found.least(bus)[0])))


def _ideal(kind: str) -> Shift:
    return lambda at, bus, seen: seen.shift(
        bus, placing.ideal_support(kind, at.voltages[bus], seen.mode.eigenvalue)
    )


def _all_shifts(
    situations: Sequence[Situation], shift: Shift, *, tuned: bool, in_full: bool = False
) -> dict[str, ByMode]:
    """The shifts at all buses, or ``in_full`` at those that were looked into."""
    found: dict[str, ByMode] = {}
    for at in situations:
        by_mode = dict[str, Mapping[str, SupportShift]]()
        for seen in at.modes:
            buses = at.looked_into if in_full else at.voltages
            changes = {bus: shift(at, bus, seen) for bus in at.voltages if bus in buses}
            most = max(map(abs, changes.values()), default=0.0) or 1.0
            eigenvalue, before = seen.mode.eigenvalue, seen.mode.damping_percent
            knows_best = at.knows_all and len(changes) == len(at.voltages)
            by_bus = dict[str, SupportShift]()
            for bus, change in changes.items():
                after = damping_percent(eigenvalue + (-abs(change) if tuned else change))
                part = abs(change) / most if knows_best else None
                by_bus[bus] = SupportShift(change, after - before, part)
            by_mode[seen.label] = by_bus
        found[at.name] = by_mode
    return found


def _of_foreign(
    case: Case,
    request: SiteRequest,
    situations: Sequence[Situation],
    active: Mapping[str, ByMode],
    scenario: str,
) -> dict[str, ByMode]:
    """A foreign device, linearised once at the bus that active power reaches best, and turned to the others."""
    intact = situations[0]
    there = active[intact.name][intact.modes[0].label]
    bus = max(intact.looked_into, key=lambda name: abs(there[name].change))
    device = placing.foreign(Path(request.device), request.binding_file, request.rating)
    prepared = _prepared(placing.with_devices(case, device, [bus]), request, scenario)
    with running(prepared) as master:
        find_operating_point(master)
        model = Blocks(master).components[placing.name_at(bus)]

        def shift(at: Situation, other: str, seen: SeenMode) -> complex:
            ahead = cmath.phase(at.voltages[other] / intact.voltages[bus])
            return seen.final_shift(
                other,
                lambda there: placing.turned(placing.response_of(master, model, there), ahead),
            )

        return _all_shifts(situations, shift, tuned=False, in_full=True)


def _prepared(case: Case, request: SiteRequest, scenario: str) -> PreparedScenario:
    (prepared,) = case.prepare(
        [scenario], request.overrides, request.step_size, None, request.files
    )
    return prepared


def _with_confirmations(
    result: SiteResult, scenario: str, report: Callable[[int], None]
) -> SiteResult:
    request, seen = result.request, result.intact.modes[0]
    device: ComponentTable = (
        placing.foreign(Path(request.device), request.binding_file, request.rating)
        if request.is_foreign
        else placing.converter(
            result.prepared, request.rating or placing.OURS_MVA, request.controller
        )
    )
    outside = swings_outside(result.intact.found) if request.confirm else []

    def with_device(bus: str, device: ComponentTable) -> Confirmation:
        return confirmed(
            _prepared(placing.with_devices(result.case, device, [bus]), request, scenario),
            bus,
            seen,
            request.frequencies,
            request.controller,
            request.gain,
            without=result.intact.found,
            outside=outside,
        )

    def confirm(bus: str) -> Confirmation:
        one = with_device(bus, device)
        if one.agrees or one.failure or request.is_foreign:
            return one
        return replace(one, smaller=_smaller_device(result, bus, with_device))

    best = result.ranking[: request.confirm]
    found = in_turn(best, confirm, report)
    result = replace(result, confirmations=found, unconfirmed=best[len(found) :])
    return _by_coupled(result) if result.by_coupled else result


def _smaller_device(
    result: SiteResult, bus: str, tried: Callable[[str, ComponentTable], Confirmation]
) -> SmallerDevice | None:
    """Try a device of ours that is small for its bus; None where that is known to be so already, or cannot be known."""
    with suppress(CosimError):  # nothing feeds a short circuit where there are converters alone
        strengths = ShortCircuit.of(result.prepared).strengths()
        (power,) = (one.s_sc_mva for one in strengths if one.bus == bus)
        largest = result.request.rating or placing.OURS_MVA
        rating = float(f"{_SMALL * power:.2g}")  # as somebody would type it
        if rating >= largest:
            return None
        device = placing.converter(result.prepared, rating, result.request.controller)
        return SmallerDevice(rating, largest, power, tried(bus, device))
    return None


def _by_coupled(result: SiteResult) -> SiteResult:
    """The confirmed places first, by the damping with the device there as it is shown; behind them those that break
    the system, and those without a figure."""
    ordered = sorted(
        result.confirmations,
        key=lambda one: (bool(one.failure), one in result.breaking, -round(one.damping, 2)),
    )
    first = [one.bus for one in ordered]
    rest = [bus for bus in result.ranking if bus not in first]
    return replace(result, confirmations=tuple(ordered), ranking=(*first, *rest))
