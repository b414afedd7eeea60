"""A name stays with its mode, whatever a gain makes of the shapes.

Where two modes fit a name, their shapes do not tell which of them it is. The mode is then followed from where the name
is clear: another scenario of the case, or the values of the case's file. On the way the linear models of both are
mixed. Where only gains differ, that is the way of the gains from one value to the other.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from orchestrator.analysis.continuation import CAREFUL, Eigenpair, ModesMeetError, between, follow_along, pair_of
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.mode_names import LEFT_OVER, Naming
from orchestrator.analysis.modes import Mode, damping_percent
from orchestrator.analysis.steady_state import OperatingPoint
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.schedule import SCHEDULES
from orchestrator.errors import CosimError
from orchestrator.fmi.instance import is_isolated

DAMPING_CONTROLLERS = ("pod_p", "pod_q")
"""Parts of converters that act by a gain ``K`` and have no effect at rest."""

_STAYS = 1e-6
"""A state that changes by less than this part of max(1, |value|) stays where it is."""

_SAME = 1e-6
"""Two eigenvalues that differ by less than this part of their size are one, computed in two ways."""


@dataclass(frozen=True)
class NamedSystem:
    """A scenario's linear model at its operating point, the modes that can bear a name, and those that do."""

    prepared: PreparedScenario
    point: OperatingPoint
    model: LinearModel
    modes: Sequence[Mode]
    naming: Naming


Computed = Callable[[PreparedScenario], NamedSystem]
"""Gives the model of a scenario, with the names that its shapes give."""


def settled(
    system: NamedSystem, computed: Computed, known: Mapping[str, NamedSystem], *, far: bool = True
) -> NamedSystem:
    """A scenario's names, where two modes fit a name by following the one that it was.

    Parameters
    ----------
    system
        The scenario, with the names that its shapes give.
    computed
        Gives others where they are needed.
    known
        Scenarios that are settled already, by name, with the values that hold for all.
    far
        Whether to look beyond earlier scenarios where no mode would get a name.
    """
    others = _Others(system, computed, known)
    for name in system.naming.contested:
        if (origin := others.origin(name, far=far and name in system.naming.reasons)) is not None:
            system = replace(system, naming=_settle(name, system, origin))
    return system


@dataclass(frozen=True)
class _Origin:
    """A mode where its name is clear, and the way from there."""

    place: str
    mode: Mode
    start: Eigenpair
    model_at: Callable[[float], LinearModel]


def _settle(name: str, system: NamedSystem, origin: _Origin) -> Naming:
    naming, modes = system.naming, system.modes
    best, measure = naming.fits[name]
    was = f"the mode of {_figures(origin.mode.eigenvalue)} {origin.place}"
    try:
        value = follow_along(origin.start, origin.model_at, 0.0, 1.0, CAREFUL).eigenvalue
    except ModesMeetError as error:
        where = f"meets another one {error.beyond:.0%} of the way from there, at {_figures(error.eigenvalue)}"
        return _freed(naming, name, f"{was} {where}, and cannot be told from it beyond")
    led = f"{was} is followed to {_figures(value)}"
    mode = next((mode for mode in modes if abs(mode.eigenvalue - value) <= _SAME * abs(value)), None)
    if mode is None:
        return _freed(naming, name, f"{led}, out of the range in which names are given")
    if any(mode is bearer for other, bearer in naming.named.items() if other != name):
        return _freed(naming, name, f"{led}, which has another name")
    if measure(mode) < LEFT_OVER * measure(best):
        exchanged = f"on the way it exchanges its nature with the one of {_figures(best.eigenvalue)}"
        return _freed(naming, name, f"{led}; {exchanged}, which fits the name better now")
    rivals = [one for one in modes if one is not mode and measure(one) >= LEFT_OVER * measure(mode)]
    weaker = min(rivals, key=lambda one: one.damping_ratio, default=mode)
    told: tuple[str, ...] = ()
    if weaker.damping_ratio < mode.damping_ratio:
        told = (f"{name!r}: {led}; the mode of {_figures(weaker.eigenvalue)}, which fits too, is damped less",)
    elif mode is not best:
        told = (f"{name!r}: {led}; the mode of {_figures(best.eigenvalue)} fits about as well",)
    reasons = {other: text for other, text in naming.reasons.items() if other != name}
    return replace(naming, named={**naming.named, name: mode}, reasons=reasons, remarks=(*naming.remarks, *told))


def _freed(naming: Naming, name: str, reason: str) -> Naming:
    """The naming without a name, and with the reason."""
    named = {other: mode for other, mode in naming.named.items() if other != name}
    return replace(naming, named=named, reasons={**naming.reasons, name: f"no mode is named {name!r}: {reason}"})


def _figures(eigenvalue: complex) -> str:
    return f"{eigenvalue.imag / (2 * math.pi):.3f} Hz, {damping_percent(eigenvalue):.2f} %"


class _Others:
    """Where else a scenario's names may be clear; each is computed once at most."""

    def __init__(self, system: NamedSystem, computed: Computed, known: Mapping[str, NamedSystem]) -> None:
        self._system, self._computed, self._known = system, computed, known
        self._kept: dict[tuple[str, bool], NamedSystem | None] = {}
        order = system.prepared.case.scenarios
        own, here = system.prepared.name, list(order).index(system.prepared.name)
        alike = [name for name, table in order.items() if set(table.remove) == set(order[own].remove) and name != own]
        self._earlier = [name for name in alike if list(order).index(name) < here]
        self._later = [name for name in alike if name not in self._earlier]

    def origin(self, name: str, *, far: bool) -> _Origin | None:
        """The mode of a name in the first scenario from which a way leads here."""
        for place, system in self._systems(far=far):
            mode = system.naming.named.get(name)
            if mode is not None and (way := self._way_from(system)) is not None:
                return _Origin(place, mode, pair_of(mode, system.model.names), way)
        return None

    def _way_from(self, other: NamedSystem) -> Callable[[float], LinearModel] | None:
        """None where the operating point moves: then a mixture of both models is none that a parameter takes."""
        one, two = other.point.states, self._system.point.states
        if one.keys() != two.keys() or any(abs(one[k] - x) > _STAYS * max(1.0, abs(x)) for k, x in two.items()):
            return None
        return between(other.model, self._system.model)

    def _systems(self, *, far: bool) -> Iterator[tuple[str, NamedSystem]]:
        """Earlier scenarios with the names that they have got. Of all others only those count that are clear by shape,
        and they are worth their time only where no mode would get the name.
        """
        yield from self._computed_of([(name, False) for name in self._earlier])
        if not far:
            return
        if (undamped := self._undamped()) is not None:
            yield "without its damping controllers", undamped
        plain = [(name, True) for name in (self._system.prepared.name, *self._earlier[:1])]
        yield from self._computed_of([*((name, False) for name in self._later[:1]), *plain])

    def _computed_of(self, wanted: Sequence[tuple[str, bool]]) -> Iterator[tuple[str, NamedSystem]]:
        for name, plain in wanted:
            if (name, plain) not in self._kept:
                self._kept[name, plain] = self._other(name, plain=plain)
            if (found := self._kept[name, plain]) is not None:
                yield f"in {name!r}" + (" with the values of its file" if plain else ""), found

    def _undamped(self) -> NamedSystem | None:
        """The scenario itself with the gains of all damping controllers at 0, where any is on."""
        prepared = self._system.prepared
        gains = {
            f"{component}.{controller}.K": 0.0
            for component, plan in prepared.system.components.items()
            for controller in DAMPING_CONTROLLERS
            if {f"{controller}.K", f"{controller}.enabled"} <= plan.description.variables.keys()
            and plan.value(f"{controller}.K")
            and plan.value(f"{controller}.enabled")
        }
        if not gains or prepared.beside is None:
            return None
        try:
            other = prepared.beside(prepared.name, False, gains)
            return None if other is None or not _runs_beside(other) else self._computed(other)
        except CosimError:  # a gain of 0 need not be allowed
            return None

    def _other(self, name: str, *, plain: bool) -> NamedSystem | None:
        if not plain and name in self._known:
            return self._known[name]
        prepared = self._system.prepared
        try:
            other = None if prepared.beside is None else prepared.beside(name, plain)
            if other is None or not _runs_beside(other) or not _same_flow(other, prepared):
                return None
            for schedule in SCHEDULES:
                if schedule == prepared.schedule.name != other.schedule.name:
                    other = other.rescheduled(schedule)
            found = self._computed(other)
        except CosimError:  # values that fit the one need not fit the other
            return None
        if not plain and name in self._earlier:
            return settled(found, self._computed, self._known, far=False)
        clear = {key: mode for key, mode in found.naming.named.items() if key not in found.naming.contested}
        return replace(found, naming=replace(found.naming, named=clear))


def _runs_beside(prepared: PreparedScenario) -> bool:
    """Whether its FMUs can be instantiated beside those of another scenario: our own, and those with a process each."""
    plans = prepared.system.components.values()
    return all(plan.isolated is not False or is_isolated(plan.description, None) is False for plan in plans)


def _same_flow(one: PreparedScenario, other: PreparedScenario) -> bool:
    """Whether both start from the same voltages, as far as a power flow tells."""
    if one.power_flow is None or other.power_flow is None:
        return one.power_flow is other.power_flow
    a, b = one.power_flow.voltages, other.power_flow.voltages
    return a.keys() == b.keys() and all(abs(a[bus] - b[bus]) <= _STAYS for bus in a)
