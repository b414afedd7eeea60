"""An operating point with an outage, and what became of it."""

from dataclasses import dataclass
from enum import StrEnum

from orchestrator.cases.form.schema import Value
from orchestrator.core.errors import ErrorKind
from orchestrator.studies.points.failure import Failure


class Status(StrEnum):
    COMPUTED = "computed"
    ISLANDING = "islanding"
    POWER_FLOW = "no power flow"
    STEADY_STATE = "no steady state"
    VALUES = "values refused"
    MODES = "no modes"
    FMU = "FMU failed"
    LOST = "worker lost"
    INTERNAL = "internal error"

    @classmethod
    def of(cls, failure: Failure) -> "Status":
        """Return what an error of a kind makes of an item; of a kind that is not in the table, an FMU failed."""
        return _STATUS.get(failure.kind, cls.FMU)


_STATUS = {
    ErrorKind.ISLANDING: Status.ISLANDING,
    ErrorKind.INPUT: Status.VALUES,
    ErrorKind.VALUES: Status.VALUES,
    ErrorKind.UNITS: Status.VALUES,
    ErrorKind.POWER_FLOW: Status.POWER_FLOW,
    ErrorKind.START: Status.STEADY_STATE,
    ErrorKind.STEADY_STATE: Status.STEADY_STATE,
    ErrorKind.HIDDEN_STATES: Status.MODES,
    ErrorKind.ANALYSIS: Status.MODES,
    ErrorKind.WORKER_LOST: Status.LOST,
}


@dataclass(frozen=True)
class Item:
    point: int
    outage: int
    values: dict[str, Value]  # of the operating point, by ``component.variable``
    out: tuple[str, ...]  # elements out of service: the point's own and the outage's
    lost: tuple[str, ...] = ()  # those of them that only the outage takes

    @property
    def intact(self) -> bool:
        """Return whether no outage adds to what the point itself has out of service."""
        return self.outage == 0
