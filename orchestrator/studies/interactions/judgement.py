"""Judgement of a study of interactions: the modes that vendors share, the worst pair, the worst assignment.

A mode is one of interaction between two subsystems where both take part in it by more than a threshold: J. Beerten,
S. D'Arco and J. A. Suul, "Identification and small-signal analysis of interaction modes in VSC MTDC systems", IEEE
Trans. Power Delivery 31(2), 2016. The participation of a subsystem is the sum of its states' factors, and all of them
sum to 1.

What a pair does is told by one mode, followed from the system with both vendors to those with one and with none
(`orchestrator.studies.interactions.following`). If the least damped one cannot be followed to either vendor alone, the
least dampings of the systems are compared, and said to be no figures of one mode. The threshold does not decide if any
followed mode falls: all modes that are not well damped are looked at."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from orchestrator.core.errors import CosimError, ErrorKind
from orchestrator.core.truth import all_true
from orchestrator.studies.interactions.exchange import settings_of
from orchestrator.studies.interactions.following import Follow, FollowedMode, Ways, followed
from orchestrator.studies.interactions.places import NOT_VENDORS, by_group, first_of
from orchestrator.studies.interactions.point import SharedMode, SystemRecord
from orchestrator.studies.interactions.study import InteractionsResult
from orchestrator.studies.interactions.systems import NONE, WHOLE, Kind, SystemName

# A damping that falls by no more than this [points] is the same: what a perturbation leaves open
SAME = 0.01

WELL_DAMPED = 20.0
"""A mode that a pair leaves damped by more than this [%] is not watched for a fall: twice what is asked of a swing."""

_AT_ONE_PLACE = 1e-6  # two eigenvalues are one if they differ by less than this part of their size


@dataclass(frozen=True)
class JudgedMode:
    mode: SharedMode
    groups: dict[str, float]
    vendors: tuple[str, ...]

    @property
    def is_interaction(self) -> bool:
        return len(self.vendors) > 1


@dataclass(frozen=True)
class JudgedSystem:
    """A system with the modes that count for its converters.

    A mode of the network or of a machine in which none of them takes part says nothing of them, however little it is
    damped. A mode that grows counts in any case, and so does one that counts in a pair, or in another assignment, and
    was followed to here. Without any converter only those count that were followed to here."""

    name: SystemName
    record: SystemRecord
    converters: frozenset[str]
    threshold: float
    followed: tuple[complex, ...] = ()  # modes of pairs, as they are here [rad/s]

    @property
    def stable(self) -> bool | None:
        return self.record.stable

    @property
    def critical(self) -> SharedMode | None:
        """The least damped of the modes that count; None where none does."""
        counting = [mode for mode in self.record.modes if self.counts(mode)]
        growing = [] if self.record.growing is None else [self.record.growing]
        return min([*counting, *growing], key=lambda mode: mode.damping_percent, default=None)

    @property
    def least_damping(self) -> float | None:
        """Damping [%] of the critical mode, 100 where none counts; None where the system was not computed."""
        if self.record.error is not None:
            return None
        return 100.0 if self.critical is None else self.critical.damping_percent

    @property
    def least_of_all(self) -> SharedMode | None:
        """The least damped of all modes of the range, whoever holds it; None if there is none."""
        return min(self.record.modes, key=lambda mode: mode.damping_percent, default=None)

    @property
    def is_known(self) -> bool:
        return self.stable is not None and self.least_damping is not None

    @property
    def why_unknown(self) -> str:
        return self.record.error or str(self.record.stability.get("reason") or "no verdict")

    def counts(self, mode: SharedMode) -> bool:
        holds_enough = bool(self.converters) and self._share(mode) >= self.threshold
        return holds_enough or any(_is_at(mode.eigenvalue, value) for value in self.followed)

    def _share(self, mode: SharedMode) -> float:
        return sum(share for name, share in mode.components.items() if name in self.converters)


@dataclass(frozen=True)
class JudgedPair:
    vendors: tuple[str, str]
    joint: JudgedSystem
    alone: tuple[JudgedSystem, JudgedSystem]
    modes: tuple[FollowedMode, ...] = ()  # of both: those that count or are not well damped

    @property
    def mode(self) -> FollowedMode | None:
        """The mode that tells what the pair does: the one that falls furthest, else the least damped that counts."""
        falling = [one for one in self.modes if (self._fall_of(one) or 0.0) > SAME]
        if falling and self.joint.stable is not False:
            return max(falling, key=lambda one: self._fall_of(one) or 0.0)
        return self._critical_mode

    @property
    def fall(self) -> float | None:
        """How far [points] the damping of `mode` lies below the lesser one with a vendor alone; None if not known.

        It is `least_fall` if the mode cannot be followed to either vendor alone."""
        return None if self.mode is None else self._fall_of(self.mode)

    @property
    def least_fall(self) -> float | None:
        """How far [points] the least damping together lies below the lesser one of the vendors alone.

        It compares the least damped of the modes that count, which need not be one mode. None if none counts."""
        alone = [mode.damping_percent for one in self.alone if (mode := one.critical) is not None]
        together = self.joint.critical
        return None if together is None or not alone else min(alone) - together.damping_percent

    @property
    def falls_unfollowed(self) -> bool:
        """Return whether `fall` is `least_fall`, for want of a mode that can be followed."""
        return self.mode is not None and self.mode.fall is None and self.fall is not None

    @property
    def is_compared(self) -> bool:
        """Return whether something tells if the pair is damped less together; so it is if no mode of both counts."""
        return self._critical_mode is None or self._fall_of(self._critical_mode) is not None

    def _fall_of(self, mode: FollowedMode) -> float | None:
        return self.least_fall if mode.fall is None and mode is self._critical_mode else mode.fall

    @property
    def _critical_mode(self) -> FollowedMode | None:
        critical = self.joint.critical
        return next((one for one in self.modes if one.together == critical), None)

    @property
    def unfollowed(self) -> list[FollowedMode]:
        return [one for one in self.modes if one.unknown]

    @property
    def fights(self) -> bool | None:
        """Return whether both are stable alone and not together; None if a verdict that decides it is not known."""
        verdicts = (*(one.stable for one in self.alone), self.joint.stable)
        if verdicts[0] is False or verdicts[1] is False or verdicts[2] is True:
            return False
        return None if None in verdicts else True

    @property
    def is_known(self) -> bool:
        return all(one.is_known for one in (self.joint, *self.alone))

    @property
    def text(self) -> str:
        return " + ".join(self.vendors)

    def sentence(self) -> str:
        if not self.is_known:
            return f"{self.text}: not known: {self._missing()}"
        figures = self._figures()
        if self.fights:
            return f"{self.text}: UNSTABLE together, though stable alone{figures}"
        if self.joint.stable is False:
            those = " and ".join(
                v for v, one in zip(self.vendors, self.alone, strict=True) if one.stable is False
            )
            return f"{self.text}: UNSTABLE together, and {those} alone as well{figures}"
        if self.fall is None:
            return f"{self.text}: stable{figures}"
        word = "lower together" if self.fall > SAME else "no lower together"
        by = ", by the least damping" * self.falls_unfollowed
        return f"{self.text}: stable, {word}{by}{figures}"

    def _figures(self) -> str:
        mode = self.mode
        if mode is None:
            return ""
        head = f": {place_of(mode.together)} has {mode.together.damping_percent:.2f} % together"
        neither = mode.neither_percent
        figures = [
            head,
            *map(_alone_text, self.vendors, mode.alone_percent, self.alone),
            "nor to the system with neither"
            if neither is None
            else f"{neither:.2f} % with neither",
        ]
        if mode.unknown:
            figures[-1] = f"because {mode.unknown}"
        elif neither is None and None not in mode.alone_percent:
            figures[-1] = "cannot be followed to the system with neither"
        return ", ".join(figures) + self._least_text()

    def _least_text(self) -> str:
        if self.fall is None:
            return "; there is no mode alone to compare it with"
        if not self.falls_unfollowed:
            return ""
        way = f"falls by {self.fall:.2f} points" if self.fall > SAME else "does not fall"
        return f"; the least damping of the vendors' modes, which need not be of one mode, {way}"

    def _missing(self) -> str:
        systems = zip(
            (self.text, *(f"{v} alone" for v in self.vendors)),
            (self.joint, *self.alone),
            strict=True,
        )
        return "; ".join(f"{name}: {one.why_unknown}" for name, one in systems if not one.is_known)


def _is_at(one: complex, other: complex) -> bool:
    return abs(one - other) <= _AT_ONE_PLACE * abs(other)


def _alone_text(vendor: str, percent: float | None, alone: JudgedSystem) -> str:
    if percent is not None:
        return f"{percent:.2f} % with {vendor} alone"
    least = alone.critical
    figure = (
        "no vendor's mode counts there"
        if least is None
        else f"the least damped vendor's mode there: {least.damping_percent:.2f} % at {place_of(least)}"
    )
    return f"cannot be followed to {vendor} alone ({figure})"


def place_of(mode: SharedMode) -> str:
    return f"{mode.frequency_hz:.4g} Hz" if mode.imag else "no oscillation"


class JudgedInteractions:
    """``follow``: follows modes from one system to another; along the systems' linear models by default."""

    def __init__(self, result: InteractionsResult, follow: Follow | None = None) -> None:
        self.result = result
        self._follow = follow or Ways(result).follow
        plan = result.plan
        plain = {
            name: JudgedSystem(name, record, plan.converters(name), plan.request.threshold)
            for name, record in result.records.items()
        }
        pairs = {name: self._modes(one) for name, one in plain.items() if name.kind is Kind.PAIR}
        self.systems = {name: _with_followed(one, plain, pairs) for name, one in plain.items()}
        if not pairs:
            self.systems[NONE] = self._none_of_one_vendor()
        self.unfollowed: dict[SystemName, str] = {}
        self.systems |= self._assignments_alike()
        self.modes = [self._judge_mode(mode) for mode in self.whole.record.modes]
        alone = self.alone
        found = [
            JudgedPair((a, b), self.systems[name], (alone[a], alone[b]), modes)
            for name, modes in pairs.items()
            for a, b in [name.names]
        ]
        self.pairs = sorted(found, key=_rank)

    def _modes(self, joint: JudgedSystem) -> tuple[FollowedMode, ...]:
        """The modes of a pair that count or are not well damped, followed."""
        first, second = joint.name.names
        watched = [mode for mode in joint.record.modes if mode.damping_percent <= WELL_DAMPED]
        wanted = dict.fromkeys(mode.eigenvalue for mode in watched)
        critical = joint.critical
        if critical is not None and critical.eigenvalue not in wanted:
            watched.append(critical)
        return tuple(followed(mode, (first, second), self._follow) for mode in watched)

    def _none_of_one_vendor(self) -> JudgedSystem:
        """The system without the only vendor, in which those modes count that do so with it."""
        (alone,) = self.alone.values()
        counting = [mode.eigenvalue for mode in alone.record.modes if alone.counts(mode)]
        try:
            ends = [self._follow(value, alone.name, NONE) for value in counting]
        except CosimError:
            ends = []
        return replace(self.none, followed=tuple(value for value in ends if value is not None))

    def _assignments_alike(self) -> dict[SystemName, JudgedSystem]:
        """The assignments, in which also those modes count that do so in the worst one, and in it those of any other.

        By the share alone the least damping of two assignments would be that of two modes, and an assignment in which
        a mode has less share, and less damping, would not be the worst."""
        known = [
            one
            for name, one in self.systems.items()
            if name.kind is Kind.ASSIGNMENT and one.record.error is None
        ]
        if not known:
            return {}
        worst = min(known, key=lambda one: one.least_damping or 0.0)
        others = [one for one in known if one is not worst]
        worst = self._with_hidden(worst, others)
        return {one.name: self._with_hidden(one, [worst]) for one in others} | {worst.name: worst}

    def _with_hidden(self, system: JudgedSystem, others: Sequence[JudgedSystem]) -> JudgedSystem:
        """A system in which also the least damped of those modes counts that do so in one of the others."""
        hidden = sorted(_hidden(system), key=lambda mode: mode.damping_percent)
        for mode in hidden:
            if any(self._counts_in(other, mode, system.name) for other in others):
                return replace(system, followed=(*system.followed, mode.eigenvalue))
        return system

    def _counts_in(self, other: JudgedSystem, mode: SharedMode, here: SystemName) -> bool:
        """Return whether a mode of one assignment counts in another one; noted if it cannot be followed there."""
        try:
            there = self._follow(mode.eigenvalue, here, other.name)
        except CosimError as error:
            text = f"{place_of(mode)}, {mode.damping_percent:.2f} %: {str(error).splitlines()[0]}"
            self.unfollowed.setdefault(here, text)
            return False
        return there is not None and any(
            _is_at(one.eigenvalue, there) and other.counts(one) for one in other.record.modes
        )

    @property
    def whole(self) -> JudgedSystem:
        return self.systems[WHOLE]

    @property
    def none(self) -> JudgedSystem:
        return self.systems[NONE]

    @property
    def alone(self) -> dict[str, JudgedSystem]:
        return {
            vendor: self.systems[SystemName(Kind.ALONE, (vendor,))]
            for vendor in self.result.plan.vendors
        }

    @property
    def interaction_modes(self) -> list[JudgedMode]:
        return [mode for mode in self.modes if mode.is_interaction]

    @property
    def worst_pair(self) -> JudgedPair | None:
        """The known pair that is unstable though each is stable alone, else the one whose damping falls most.

        None where none falls by more than `SAME`."""
        first = next((pair for pair in self.pairs if pair.is_known), None)
        if first is None:
            return None
        return first if first.fights or (first.fall or 0.0) > SAME else None

    @property
    def least_damped_pair(self) -> JudgedPair | None:
        """The known pair with the lowest damping, alone or not; None where none has a mode that counts."""
        known = [pair for pair in self.pairs if pair.is_known and pair.joint.critical is not None]
        return min(known, key=lambda pair: pair.joint.least_damping or 0.0, default=None)

    @property
    def unknown_pairs(self) -> list[JudgedPair]:
        return [pair for pair in self.pairs if not pair.is_known]

    @property
    def uncompared_pairs(self) -> list[JudgedPair]:
        return [pair for pair in self.pairs if pair.is_known and not pair.is_compared]

    @property
    def assignments(self) -> list[JudgedSystem]:
        """All assignments, the worst first: unstable ones, then the least damped; those without a verdict come last."""
        found = [system for name, system in self.systems.items() if name.kind is Kind.ASSIGNMENT]
        return sorted(
            found,
            key=lambda one: (not one.is_known, one.stable is not False, one.least_damping or 0.0),
        )

    @property
    def worst_assignment(self) -> JudgedSystem | None:
        """The worst of those that have a verdict; None where none has."""
        return next((one for one in self.assignments if one.is_known), None)

    @property
    def stable(self) -> bool | None:
        """Return whether no system of the study grows; None where one has no verdict and none grows."""
        return all_true(record.stable for record in self.result.records.values())

    def participation(self, mode: SharedMode) -> dict[str, float]:
        return by_group(mode.components, self.result.plan.groups)

    def _judge_mode(self, mode: SharedMode) -> JudgedMode:
        groups = self.participation(mode)
        threshold = self.result.plan.request.threshold
        vendors = tuple(
            name for name, share in groups.items() if name not in NOT_VENDORS and share >= threshold
        )
        return JudgedMode(mode, groups, vendors)


def _hidden(system: JudgedSystem) -> list[SharedMode]:
    """The modes that do not count, with less damping than all that do."""
    limit = min(system.least_damping or 0.0, WELL_DAMPED)
    return [
        mode
        for mode in system.record.modes
        if mode.damping_percent < limit - SAME and not system.counts(mode)
    ]


def _with_followed(
    system: JudgedSystem,
    plain: Mapping[SystemName, JudgedSystem],
    pairs: Mapping[SystemName, Sequence[FollowedMode]],
) -> JudgedSystem:
    """A system of one vendor or of none in which also those modes count that do so in a pair."""
    if system.name.kind is Kind.NONE:
        ends = (
            mode.neither
            for name, modes in pairs.items()
            for mode in modes
            if plain[name].counts(mode.together)
        )
        return replace(system, followed=tuple(value for value in ends if value is not None))
    if system.name.kind is not Kind.ALONE:
        return system
    (vendor,) = system.name.names
    found = [
        mode.alone[name.names.index(vendor)]
        for name, modes in pairs.items()
        if vendor in name.names
        for mode in modes
        if plain[name].counts(mode.together)
    ]
    return replace(system, followed=tuple(value for value in found if value is not None))


def _rank(pair: JudgedPair) -> tuple[bool, bool, float]:
    known = pair.is_known
    fall = -math.inf if pair.fall is None else pair.fall
    return not known, not (known and pair.fights), -fall if known else 0.0


def doubts_of(judgement: JudgedInteractions) -> Sequence[str]:
    result, found = judgement.result, []
    plan = result.plan
    identified = list(
        dict.fromkeys(name for one in result.records.values() for name in one.identified)
    )
    if identified:
        found.append(
            f"{', '.join(identified)} was identified from outside: its share in a mode rests on the states of the "
            "model that was fitted to it"
        )
    found += [
        f"the system {plan_text(plan.swapped, name)} was not computed: {record.error}"
        for name, record in result.records.items()
        if record.error is not None
    ]
    kinds = {
        record.failure.kind for record in result.records.values() if record.failure is not None
    }
    if not plan.request.black_box and ErrorKind.HIDDEN_STATES in kinds:
        found.append("here too --black-box identifies the components that hide their states")
    if plan.swapped:
        found += [
            f"{vendor}'s converters have other settings at {name} than at {first.name}; where it is swapped to a place "
            f"of another vendor it has those at {first.name}"
            for vendor, first in first_of(
                {name: plan.places[name] for name in plan.swapped}
            ).items()
            for name, place in plan.places.items()
            if place.vendor == vendor and settings_of(place) != settings_of(first)
        ]
    found += [
        f"{pair.text}: how {place_of(one.together)}, {one.together.damping_percent:.2f} % together, is damped with one "
        f"of them alone is not known: {one.unknown}"
        for pair in judgement.pairs
        for one in pair.unfollowed
        if pair.is_known
    ]
    found += [
        f"{plan_text(plan.swapped, name)}: whether a mode counts there as in another assignment is not known: {text}"
        for name, text in judgement.unfollowed.items()
    ]
    none = judgement.none
    if none.stable is not True:
        why = "is UNSTABLE" if none.stable is False else f"has no verdict ({none.why_unknown})"
        found.append(
            f"the network with {plan.stand_in} at all places {why}: what is found of a vendor alone or of a pair may "
            "come from the places of the others; give another model by --stand-in"
        )
    return tuple(dict.fromkeys(found))


def plan_text(swapped: Sequence[str], name: SystemName) -> str:
    """A system in words; of an assignment with the places: ``west: A, east: B``."""
    if name.kind is not Kind.ASSIGNMENT:
        return name.text
    return ", ".join(
        f"{place}: {device}" for place, device in zip(swapped, name.names, strict=True)
    )
