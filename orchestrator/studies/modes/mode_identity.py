"""A name stays with its mode, whatever a gain makes of the shapes.

Where two modes fit a name, their shapes do not tell which of them it is. The mode is then followed from where the name
is clear: the same system without its damping controllers, another scenario of the case, or the values of the case's
file. Where the operating point stays, the linear models of both are mixed on the way; where only gains differ, that is
the way of the gains. Else the values that differ go from one side to the other, and each system on the way is started.

A clear shape is not believed where a damping controller, or a value of somebody else's FMU, may have made it."""

import fnmatch
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from orchestrator.cases.questions.idle_values import DAMPING_CONTROLLERS
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import AnalysisError, CosimError
from orchestrator.core.units import whole_percent
from orchestrator.devices.fmi.instance import is_isolated, is_ours
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.models.steady_state import OperatingPoint
from orchestrator.linear.spectra import continuation
from orchestrator.linear.spectra.mode_names import LEFT_OVER, Naming
from orchestrator.linear.spectra.modes import Mode, damping_percent
from orchestrator.systems.coupling.schedule import SCHEDULES
from orchestrator.systems.coupling.system import ComponentPlan

_STAYS = 1e-6  # A state that changes by less than this part of max(1, |value|) stays where it is
# of a system that is started on the way, or whose clear names are looked at again
MOST_STATES = 600
_MOST_STARTS = 12  # systems that are started on one way at most
_MOST_FITTED = 6  # the same where each of them has a component to identify
# two eigenvalues that differ by less than this part of their size are one, computed in two ways
_SAME = 1e-6


@dataclass(frozen=True)
class NamedSystem:
    """A scenario's linear model at its operating point, the modes that can bear a name, and those that do."""

    prepared: PreparedScenario
    point: OperatingPoint
    model: LinearModel
    modes: Sequence[Mode]
    naming: Naming


Computed = Callable[[PreparedScenario], NamedSystem]

Undamped = Callable[[Mapping[str, float]], NamedSystem]  # gives the system itself with other gains


def settle_names(
    system: NamedSystem,
    computed: Computed,
    known: Mapping[str, NamedSystem],
    *,
    undamped: Undamped | None = None,
    far: bool = True,
    near: continuation.Near = continuation.pairs_near,
) -> NamedSystem:
    """A scenario's names, where shapes do not tell by following the mode that it was.

    ``known``: scenarios that are settled already, by name, with the values that hold for all.
    ``undamped``: gives it with other gains, where it still runs.
    ``far``: whether to look beyond earlier scenarios where no mode would get a name.
    ``near``: as `continuation.follow_along` takes it."""
    others = _Others(system, computed, known, undamped)
    for name in dict.fromkeys((*system.naming.contested, *system.naming.named)):
        contested = name in system.naming.contested
        origin = others.origin(name, contested=contested, far=far)
        if origin is not None:
            system = replace(system, naming=_settle(name, system, origin, near))
        elif (
            (lost := others.lost) and name in system.naming.named and (contested or others.checked)
        ):
            system = replace(
                system, naming=_unfollowed(name, system.naming, lost, freed=others.checked)
            )
    return system


@dataclass(frozen=True)
class _Way:
    """From another system (0) to this one (1); ``common`` as `follow_along`."""

    model_at: Callable[[float], LinearModel]
    strides: continuation.Strides = continuation.CAREFUL
    common: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Origin:
    """A mode where its name is clear, and the way from there; ``sure`` if only that tells what it is here."""

    place: str
    mode: Mode
    start: continuation.Eigenpair
    way: _Way
    sure: bool


def _settle(name: str, system: NamedSystem, origin: _Origin, near: continuation.Near) -> Naming:
    naming, modes, way, sure = system.naming, system.modes, origin.way, origin.sure
    best, measure = naming.fits[name]
    was = f"the mode of {_figures(origin.mode.eigenvalue)} {origin.place}"
    try:
        value = continuation.follow_along(
            origin.start, way.model_at, 0.0, 1.0, way.strides, way.common, near=near
        ).eigenvalue
    except continuation.ModesMeetError as error:
        meeting = f"{whole_percent(error.beyond)} of the way from there"
        where = f"meets another one {meeting}, at {_figures(error.eigenvalue)}"
        return _without(
            naming, name, f"{was} {where}, and cannot be told from it beyond", sure=sure
        )
    except CosimError as error:
        text = str(error).splitlines()[0]
        return _without(naming, name, f"{was} cannot be followed from there: {text}", sure=sure)
    led = f"{was} is followed to {_figures(value)}"
    mode = next(
        (mode for mode in modes if abs(mode.eigenvalue - value) <= _SAME * abs(value)), None
    )
    if mode is None:
        return _without(
            naming, name, f"{led}, out of the range in which names are given", sure=sure
        )
    if any(mode is bearer for other, bearer in naming.named.items() if other != name):
        return _without(naming, name, f"{led}, which has another name", sure=sure)
    if measure(mode) < LEFT_OVER * measure(best):
        exchanged = (
            f"on the way it exchanges its nature with the one of {_figures(best.eigenvalue)}"
        )
        return _without(
            naming, name, f"{led}; {exchanged}, which fits the name better now", sure=sure
        )
    rivals = [one for one in modes if one is not mode and measure(one) >= LEFT_OVER * measure(mode)]
    weaker = min(rivals, key=lambda one: one.damping_ratio, default=mode)
    told: tuple[str, ...] = ()
    if weaker.damping_ratio < mode.damping_ratio:
        told = (
            f"{name!r}: {led}; the mode of {_figures(weaker.eigenvalue)}, which fits too, is damped less",
        )
    elif mode is not best:
        told = (f"{name!r}: {led}; the mode of {_figures(best.eigenvalue)} fits about as well",)
    reasons = {other: text for other, text in naming.reasons.items() if other != name}
    return replace(
        naming,
        named={**naming.named, name: mode},
        reasons=reasons,
        remarks=(*naming.remarks, *told),
    )


def _without(naming: Naming, name: str, reason: str, *, sure: bool) -> Naming:
    """The naming without a name, and with the reason; where that is not ``sure`` a clear shape keeps it."""
    if sure:
        return _freed(naming, name, reason)
    return replace(
        naming,
        remarks=(
            *naming.remarks,
            f"{name!r}, by its shape, may be another mode than there: {reason}",
        ),
    )


def _unfollowed(name: str, naming: Naming, lost: str, *, freed: bool) -> Naming:
    """The naming where a mode could not be followed from a place at which it has the name."""
    if freed:
        return _freed(
            naming,
            name,
            f"whether it is the mode that has the name {lost} is not known; look at its shape",
        )
    text = (
        f"{name!r}, by its shape, which another mode has in part, may be another mode than {lost}"
    )
    return replace(naming, remarks=(*naming.remarks, text))


def _freed(naming: Naming, name: str, reason: str) -> Naming:
    named = {other: mode for other, mode in naming.named.items() if other != name}
    return replace(
        naming,
        named=named,
        reasons={**naming.reasons, name: f"no mode is named {name!r}: {reason}"},
    )


def _figures(eigenvalue: complex) -> str:
    return f"{eigenvalue.imag / (2 * math.pi):.3f} Hz, {damping_percent(eigenvalue):.2f} %"


class _Others:
    """Where else a scenario's names may be clear; each is computed once at most.

    ``checked``: Whether even a clear name is to be followed: something acts that may have made the shape.
    ``lost``: Where the name last looked for is borne by a mode from which no way leads here; empty if nowhere."""

    def __init__(
        self,
        system: NamedSystem,
        computed: Computed,
        known: Mapping[str, NamedSystem],
        undamped: Undamped | None = None,
    ) -> None:
        self._system, self._computed, self._known, self._by_gains = (
            system,
            computed,
            known,
            undamped,
        )
        self._kept: dict[tuple[str, bool], NamedSystem | None] = {}
        self._ways: dict[str, _Way | None] = {}
        order = system.prepared.case.scenarios
        own, here = system.prepared.name, list(order).index(system.prepared.name)
        alike = [
            name
            for name, table in order.items()
            if set(table.remove) == set(order[own].remove) and name != own
        ]
        self._earlier = [name for name in alike if list(order).index(name) < here]
        self._later = [name for name in alike if name not in self._earlier]
        self._small = len(system.model.names) <= MOST_STATES
        self._without_damping: list[NamedSystem | None] = []
        self.checked = False
        self.lost = ""

    def origin(self, name: str, *, contested: bool, far: bool) -> _Origin | None:
        """The mode of a name in the first system from which a way leads here."""
        self.checked = False
        self.lost = ""
        if contested or self._small:
            system = self._undamped()
            if system is not None and name in system.naming.named:
                self.checked = True
                found = self._from("without its damping controllers", system, name, sure=True)
                if found is not None:
                    return found
        self.checked = self.checked or self._differs_in_foreign()
        tied = name in self._system.naming.reasons
        for place, system, sure in self._systems(contested=contested, tied=tied, far=far):
            if (
                name in system.naming.named
                and (found := self._from(place, system, name, sure=sure)) is not None
            ):
                return found
        return None

    def _from(self, place: str, system: NamedSystem, name: str, *, sure: bool) -> _Origin | None:
        if place not in self._ways:
            self._ways[place] = self._way_from(system)
        way = self._ways[place]
        if way is None:
            self.lost = self.lost or place
            return None
        mode, names = system.naming.named[name], system.model.names
        start = continuation.pair_of(mode, names)
        if way.common:
            start = start.within([names.index(state) for state in way.common])
        return _Origin(place, mode, start, way, sure)

    def _way_from(self, other: NamedSystem) -> _Way | None:
        """Where the operating point moves, a mixture of both models is none that a parameter takes."""
        one, two = other.point.states, self._system.point.states
        stays = one.keys() == two.keys() and all(
            abs(one[k] - x) <= _STAYS * max(1.0, abs(x)) for k, x in two.items()
        )
        if stays and (mixed := continuation.between(other.model, self._system.model)) is not None:
            return _Way(mixed)
        return self._way_of_values(other)

    def _way_of_values(self, other: NamedSystem) -> _Way | None:
        """The values that differ go from the other system's to ours, and every system on the way is started."""
        a, b = other.prepared, self._system.prepared
        values = None if b.beside is None or not self._small else _differing(a, b)
        if not values:
            return None
        models, starts = (other.model, self._system.model), 0
        fitted = {
            name for model in models for name, how in model.sources.items() if how == IDENTIFIED
        }
        most = _MOST_FITTED if fitted else _MOST_STARTS

        def model_at(part: float) -> LinearModel:
            nonlocal starts
            if part == 1:
                return self._system.model
            starts = starts + 1
            if starts > most:
                raise AnalysisError(f"{most} steps on the way did not do")
            mixed = {
                name: x if x == y else (1 - part) * x + part * y for name, (x, y) in values.items()
            }
            return self._computed(_as(b.beside(b.name, False, mixed), b)).model  # type: ignore[misc]

        ours = set(self._system.model.names)
        common = tuple(
            n for n in other.model.names if n in ours and n.partition(".")[0] not in fitted
        )
        return _Way(
            model_at,
            continuation.COSTLY,
            common if fitted or models[0].names != models[1].names else (),
        )

    def _differs_in_foreign(self) -> bool:
        """Tell if a value of somebody else's FMU is another than in the scenario before, or in the case's file."""
        b = self._system.prepared
        paths = {name: plan.description.path for name, plan in b.system.components.items()}
        foreign = {path for path in set(paths.values()) if not is_ours(path)}
        if not foreign:
            return False
        a = self._beside(self._earlier[0], False) if self._earlier else self._beside(b.name, True)
        values = {} if a is None else _differing(a, b) or {}
        return any(paths[name.partition(".")[0]] in foreign for name in values)

    def _systems(
        self, *, contested: bool, tied: bool, far: bool
    ) -> Iterator[tuple[str, NamedSystem, bool]]:
        """Earlier scenarios with the names that they have got; of all others those names that are clear by shape.
        Behind each, whether a clear shape here is not believed where the mode from there has another."""
        doubted = tied or self.checked
        for name in self._earlier if contested or doubted else self._earlier[-1:]:
            if contested or doubted or (self._small and name in self._known):
                yield from self._at(name, plain=False, sure=contested or doubted)
        if not far or not (contested or doubted):
            return
        for name in self._later[:1] if doubted else ():
            yield from self._at(name, plain=False, sure=True)
        for name in (self._system.prepared.name, *(self._earlier[:1] if doubted else ())):
            yield from self._at(name, plain=True, sure=doubted)

    def _at(self, name: str, *, plain: bool, sure: bool) -> Iterator[tuple[str, NamedSystem, bool]]:
        if (name, plain) not in self._kept:
            self._kept[name, plain] = self._other(name, plain=plain)
        found = self._kept[name, plain]
        if found is not None:
            yield f"in {name!r}" + (" with the values of its file" if plain else ""), found, sure

    def _undamped(self) -> NamedSystem | None:
        """The scenario itself with the gains of all damping controllers at 0, where any is on."""
        if not self._without_damping:
            self._without_damping.append(self._at_rest())
        return self._without_damping[0]

    def _at_rest(self) -> NamedSystem | None:
        prepared = self._system.prepared
        gains = dict.fromkeys(damping_gains(prepared), 0.0)
        if not gains:
            return None
        try:
            if self._by_gains is not None:
                return self._by_gains(gains)
            other = (
                None if prepared.beside is None else prepared.beside(prepared.name, False, gains)
            )
            return None if other is None or not _runs_beside(other) else self._computed(other)
        except CosimError:  # a gain of 0 need not be allowed
            return None

    def _beside(self, name: str, plain: bool) -> PreparedScenario | None:
        prepared = self._system.prepared
        try:
            other = None if prepared.beside is None else prepared.beside(name, plain)
        except CosimError:  # values that fit the one need not fit the other
            return None
        return None if other is None or not _runs_beside(other) else _as(other, prepared)

    def _other(self, name: str, *, plain: bool) -> NamedSystem | None:
        if not plain and name in self._known:
            return self._known[name]
        try:
            other = self._beside(name, plain)
            found = None if other is None else self._computed(other)
        except CosimError:
            return None
        if found is None:
            return None
        if not plain and name in self._earlier:
            return settle_names(found, self._computed, self._known, far=False)
        clear = {
            key: mode
            for key, mode in found.naming.named.items()
            if key not in found.naming.contested
        }
        return replace(found, naming=replace(found.naming, named=clear))


def _as(other: PreparedScenario | None, prepared: PreparedScenario) -> PreparedScenario:
    assert other is not None
    for schedule in SCHEDULES:
        if schedule == prepared.schedule.name != other.schedule.name:
            return other.rescheduled(schedule)
    return other


def _differing(a: PreparedScenario, b: PreparedScenario) -> dict[str, tuple[float, float]] | None:
    """The values in which two scenarios of a case differ because somebody gave them, with both sides; None where the
    difference is none of numbers. A damping controller that is off counts as one with gain 0."""
    found: dict[str, tuple[float, float]] = {}
    for key in dict.fromkeys((*a.given, *b.given)):
        pattern, _, variable = key.partition(".")
        plans = b.system.components
        names = [
            n for n in fnmatch.filter(plans, pattern) if variable in plans[n].description.variables
        ]
        if not names and a.given.get(key) != b.given.get(key):
            return None
        for name in names:
            one, two = (p.system.components[name] for p in (a, b))
            controller, _, part = variable.rpartition(".")
            if controller in DAMPING_CONTROLLERS and part in ("enabled", "K"):
                x, y = _gain(one, controller), _gain(two, controller)
                if x != y:
                    found |= {
                        f"{name}.{controller}.enabled": (True, True),
                        f"{name}.{controller}.K": (x, y),
                    }
                continue
            p, q = one.value(variable), two.value(variable)
            if p == q:
                continue
            if isinstance(p, bool | str | None) or isinstance(q, bool | str | None):
                return None
            found[f"{name}.{variable}"] = (p, q)
    return found


def damping_gains(prepared: PreparedScenario) -> list[str]:
    """The gains of the damping controllers that are on, by ``component.variable``."""
    plans = prepared.system.components.items()
    return [
        f"{name}.{controller}.K"
        for name, plan in plans
        for controller in DAMPING_CONTROLLERS
        if _gain(plan, controller)
    ]


def _gain(plan: ComponentPlan, controller: str) -> float:
    """Gain of a damping controller; 0 where it is off, or is not there."""
    names = (f"{controller}.enabled", f"{controller}.K")
    known = plan.description.variables.keys()
    return plan.number(names[1]) if known >= set(names) and plan.number(names[0]) else 0.0


def _runs_beside(prepared: PreparedScenario) -> bool:
    """Tell if the FMUs can be instantiated beside those of another scenario: our own, and those with a process each."""
    plans = prepared.system.components.values()
    return all(
        plan.isolated is not False or is_isolated(plan.description, None) is False for plan in plans
    )
