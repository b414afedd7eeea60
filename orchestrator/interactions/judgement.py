"""What a study of interactions says: the modes that vendors share, the worst pair, the worst assignment.

A mode is one of interaction between two subsystems where both take part in it by more than a threshold: J. Beerten,
S. D'Arco and J. A. Suul, "Identification and small-signal analysis of interaction modes in VSC MTDC systems", IEEE
Trans. Power Delivery 31(2), 2016. The participation of a subsystem is the sum of its states' factors, and all of them
sum to 1."""

from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.errors import ErrorKind
from orchestrator.interactions.exchange import settings_of
from orchestrator.interactions.places import NOT_VENDORS, by_group, first_of
from orchestrator.interactions.point import SharedMode, SystemRecord
from orchestrator.interactions.study import InteractionsResult
from orchestrator.interactions.systems import NONE, WHOLE, Kind, SystemName

# A damping that falls by no more than this [points] is the same: what a perturbation leaves open
SAME = 0.01


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
    damped. A mode that grows counts in any case."""

    name: SystemName
    record: SystemRecord
    converters: frozenset[str]
    threshold: float

    @property
    def stable(self) -> bool | None:
        return self.record.stable

    @property
    def critical(self) -> SharedMode | None:
        """The least damped of the modes that count; None where none does. Without any converter all modes count."""
        counting = [mode for mode in self.record.modes if self._share(mode) >= self.threshold]
        growing = [] if self.record.growing is None else [self.record.growing]
        return min([*counting, *growing], key=lambda mode: mode.damping_percent, default=None)

    @property
    def least_damping(self) -> float | None:
        """Damping [%] of the critical mode, 100 where none counts; None where the system was not computed."""
        if self.record.error is not None:
            return None
        return 100.0 if self.critical is None else self.critical.damping_percent

    @property
    def is_known(self) -> bool:
        return self.stable is not None and self.least_damping is not None

    @property
    def why_unknown(self) -> str:
        return self.record.error or str(self.record.stability.get("reason") or "no verdict")

    def _share(self, mode: SharedMode) -> float:
        if not self.converters:
            return 1.0
        return sum(share for name, share in mode.components.items() if name in self.converters)


@dataclass(frozen=True)
class JudgedPair:
    vendors: tuple[str, str]
    joint: JudgedSystem
    alone: tuple[JudgedSystem, JudgedSystem]

    @property
    def fall(self) -> float | None:
        """How far [points] the least damping of both lies below the lesser one of each alone; None if not known."""
        joint, each = self.joint.least_damping, [one.least_damping for one in self.alone]
        if joint is None or each[0] is None or each[1] is None:
            return None
        return min(each[0], each[1]) - joint

    @property
    def fights(self) -> bool | None:
        """Whether both are stable alone and not together; None if a verdict that decides it is not known."""
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
        if self.fall is None or not self.is_known:
            return f"{self.text}: not known: {self._missing()}"
        joint, least = self.joint.least_damping, min(one.least_damping or 0.0 for one in self.alone)
        figures = f"least damping {joint:.2f} % together, {least:.2f} % alone at worst"
        if self.fights:
            return f"{self.text}: UNSTABLE together, though stable alone; {figures}{_where(self.joint)}"
        if self.joint.stable is False:
            those = " and ".join(
                v for v, one in zip(self.vendors, self.alone, strict=True) if one.stable is False
            )
            return f"{self.text}: UNSTABLE together, and {those} alone as well; {figures}{_where(self.joint)}"
        word = "lower together" if self.fall > SAME else "no lower together"
        return f"{self.text}: stable, {word}: {figures}{_where(self.joint)}"

    def _missing(self) -> str:
        systems = zip(
            (self.text, *(f"{v} alone" for v in self.vendors)),
            (self.joint, *self.alone),
            strict=True,
        )
        return "; ".join(f"{name}: {one.why_unknown}" for name, one in systems if not one.is_known)


def _where(system: JudgedSystem) -> str:
    critical = system.critical
    return "" if critical is None else f", at {place_of(critical)}"


def place_of(mode: SharedMode) -> str:
    return f"{mode.frequency_hz:.4g} Hz" if mode.imag else "no oscillation"


class JudgedInteractions:
    def __init__(self, result: InteractionsResult) -> None:
        self.result = result
        plan = result.plan
        self.systems = {
            name: JudgedSystem(name, record, plan.converters(name), plan.request.threshold)
            for name, record in result.records.items()
        }
        self.modes = [self._judged(mode) for mode in self.whole.record.modes]
        alone = self.alone
        found = [
            JudgedPair((a, b), system, (alone[a], alone[b]))
            for name, system in self.systems.items()
            if name.kind is Kind.PAIR
            for a, b in [name.names]
        ]
        self.pairs = sorted(found, key=_rank)

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
        if first is None or first.fall is None:
            return None
        return first if first.fights or first.fall > SAME else None

    @property
    def least_damped_pair(self) -> JudgedPair | None:
        """The known pair with the lowest damping, alone or not; None where none has a mode that counts."""
        known = [pair for pair in self.pairs if pair.is_known and pair.joint.critical is not None]
        return min(known, key=lambda pair: pair.joint.least_damping or 0.0, default=None)

    @property
    def unknown_pairs(self) -> list[JudgedPair]:
        return [pair for pair in self.pairs if not pair.is_known]

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
        """Whether no system of the study grows; None where one has no verdict and none grows."""
        verdicts = [record.stable for record in self.result.records.values()]
        return False if False in verdicts else None if None in verdicts else True

    def participation(self, mode: SharedMode) -> dict[str, float]:
        return by_group(mode.components, self.result.plan.groups)

    def _judged(self, mode: SharedMode) -> JudgedMode:
        groups = self.participation(mode)
        threshold = self.result.plan.request.threshold
        vendors = tuple(
            name for name, share in groups.items() if name not in NOT_VENDORS and share >= threshold
        )
        return JudgedMode(mode, groups, vendors)


def _rank(pair: JudgedPair) -> tuple[bool, bool, float]:
    known = pair.is_known and pair.fall is not None
    return not known, not (known and pair.fights), -(pair.fall or 0.0) if known else 0.0


def doubts_of(judgement: JudgedInteractions) -> Sequence[str]:
    result, found = judgement.result, []
    plan = result.plan
    if identified := list(
        dict.fromkeys(name for one in result.records.values() for name in one.identified)
    ):
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
