"""Changes that a connection makes to the value that it carries, and which connections of a system do so.

The order along a connection is fixed: the sensor's bias and noise, its quantisation, the way's delay, and last whether
the value arrives at all."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.core.errors import InputError


@dataclass(frozen=True, slots=True)
class Bias:
    """``value`` is added, in the signal's unit."""

    value: float

    def __str__(self) -> str:
        return f"bias {self.value:g}"


@dataclass(frozen=True, slots=True)
class Noise:
    """Normally distributed noise is added: in every communication step a new value.

    ``deviation``: standard deviation, in the signal's unit, with a bandwidth as without.
    ``seed``: together with the connection's name it determines every value.
    ``bandwidth``: cut-off frequency of a first-order low-pass [Hz]; None for noise that is white at the communication
    step."""

    deviation: float
    seed: int
    bandwidth: float | None = None

    def __str__(self) -> str:
        band = "" if self.bandwidth is None else f" up to {self.bandwidth:g} Hz"
        return f"noise of {self.deviation:g}{band}, seed {self.seed}"


@dataclass(frozen=True, slots=True)
class Quantisation:
    """Only multiples of ``step``, in the signal's unit, are carried; a half goes to the even multiple."""

    step: float

    def __str__(self) -> str:
        return f"quantisation in steps of {self.step:g}"


@dataclass(frozen=True, slots=True)
class Delay:
    seconds: float

    def __str__(self) -> str:
        return f"delay of {self.seconds:g} s"


@dataclass(frozen=True, slots=True)
class DropOut:
    """The value is lost, and ``substitute`` arrives in its place; None holds the last value that arrived."""

    substitute: float | None = None

    def __str__(self) -> str:
        return "frozen" if self.substitute is None else f"lost, replaced by {self.substitute:g}"


# what can be wrong with a connection; each at most once
Imperfection = Bias | Noise | Quantisation | Delay | DropOut


@dataclass
class WirePlan:
    """Settings of one connection, now and after later events."""

    name: str  # ``a.out -> b.in``
    # from t = 0 on, by kind
    permanent: dict[type[Imperfection], Imperfection] = field(default_factory=dict)
    later: list[Imperfection] = field(default_factory=list)  # what events may bring

    def disturb(self, imperfection: Imperfection) -> None:
        """From t = 0 on."""
        present = self.permanent.get(type(imperfection))
        if present is not None:
            raise InputError(
                f"connection {self.name} has {present} already, and gets {imperfection}; remove one"
            )
        self.permanent[type(imperfection)] = imperfection

    @property
    def delay(self) -> float:
        """Delay of the permanent settings [s]."""
        found = self.permanent.get(Delay)
        return found.seconds if isinstance(found, Delay) else 0.0

    @property
    def is_cut(self) -> bool:
        return DropOut in self.permanent

    @property
    def delays(self) -> list[float]:
        """All delays that it has or may get [s]."""
        return [i.seconds for i in (*self.permanent.values(), *self.later) if isinstance(i, Delay)]


def described(plans: Mapping[Any, WirePlan]) -> list[str]:
    return [
        f"{plan.name}: {imperfection}"
        for plan in plans.values()
        for imperfection in plan.permanent.values()
    ]
