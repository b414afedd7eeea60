"""The errors a user can meet. Each message says what failed, where, the value seen, the rule and the remedy."""

import copyreg
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self

from orchestrator.core.given_files import ShownFile
from orchestrator.core.options import Option
from orchestrator.core.spelling import Text, for_python, joined, parts_of, spelled

NOT_MET = 3  # exit code where a requirement is not met, or is not known to be
INTERRUPTED = 130  # exit code after Ctrl-C
TERMINATED = 143  # exit code after SIGTERM


_IN_FULL = ContextVar("lists in messages are complete", default=False)


@contextmanager
def listing_all(*, in_full: bool = True) -> Iterator[None]:
    """Have the lists of refusals complete while it lasts, where they would end with a count of the others."""
    before = _IN_FULL.set(in_full)
    try:
        yield
    finally:
        _IN_FULL.reset(before)


def first_of(lines: Sequence[str], most: int, how: str) -> list[str]:
    """The first lines of a list, and one that counts the others and says ``how`` to see them; or all of them."""
    hidden = 0 if _IN_FULL.get() else len(lines) - most
    return [*lines] if hidden <= 0 else [*lines[:most], f"and {hidden} more; {how}"]


def few(texts: Iterable[str], most: int, between: str = ", ") -> str:
    """The first of some texts; the others are counted."""
    texts = list(texts)
    more = f"{between.strip(', ')} and {len(texts) - most} more" if len(texts) > most else ""
    return between.join(texts[:most]) + more


def number_of(number: int, what: str) -> str:
    """``3 points``."""
    if number == 1:
        return f"{number} {what}"
    return f"{number} {what}{'es' if what.endswith('s') else 's'}"


class ErrorKind(StrEnum):
    """Kind of a mistake. Programs decide by the kind; the text is for people."""

    INPUT = "input"
    VALUES = "values"
    UNITS = "units"
    ISLANDING = "islanding"
    POWER_FLOW = "power flow"
    START = "start"
    STEADY_STATE = "steady state"
    HIDDEN_STATES = "hidden states"
    ANALYSIS = "analysis"
    FMU = "FMU"
    NOT_FINITE = "not finite"
    HANG = "hang"
    WORKER_LOST = "worker lost"
    OTHER = "other"

    @property
    def lasting(self) -> bool:
        """Return whether the same would come out again: an FMU, a worker or the machine may do better another time."""
        return self in _LASTING


_LASTING = {
    ErrorKind.VALUES,
    ErrorKind.UNITS,
    ErrorKind.ISLANDING,
    ErrorKind.POWER_FLOW,
    ErrorKind.START,
    ErrorKind.STEADY_STATE,
    ErrorKind.HIDDEN_STATES,
    ErrorKind.ANALYSIS,
}


class CosimError(Exception):
    """Base of all errors that are the user's to mend; the command line prints them without a traceback.

    Parameters
    ----------
    message
        What failed, where, the value seen, the rule and the remedy.
    kind
        The class's own where None.
    """

    exit_code = 1
    kind = ErrorKind.OTHER
    place = ""  # file and record that the message begins with

    def __init__(self, message: str = "", *, kind: ErrorKind | None = None) -> None:
        super().__init__(message)
        if kind is not None:
            self.kind = kind

    def __reduce__(self) -> tuple[Any, ...]:
        make = copyreg.__newobj__  # type: ignore[attr-defined]  # it may have been made from other arguments
        return make, (type(self), *self.args), self.__dict__

    def __str__(self) -> str:
        # not that of another base, such as KeyError, which quotes
        return spelled(self.message)

    @property
    def message(self) -> str:
        """The message as it was put together, with its options as values."""
        first = self.args[0] if self.args else ""
        return first if isinstance(first, str) else Exception.__str__(self)

    def _render_traceback_(self) -> list[str]:
        """Return what a notebook shows of an uncaught error: the sentence, without the calls inside of this package."""
        return [f"{type(self).__name__}: {self}"]


class InputError(CosimError):
    """Something given to the program cannot be used; nothing was run."""

    exit_code = 2
    kind = ErrorKind.INPUT

    @classmethod
    def at(cls, place: str, text: str) -> Self:
        """Return the error of a record: ``place`` names its file, and its line where it has one."""
        error = cls(Text(place, ": ", text))
        error.place = place
        return error


class ResultsError(CosimError):
    """Results cannot be written: the disk is full, or the folder is gone or closed to the user."""


class FmuFileError(InputError):
    """A file is not an FMU that can be loaded here."""


class UnsupportedFmuError(FmuFileError):
    """An FMU cannot be run by this program, or on this machine, and may be sound; ``fault`` names what is missing."""

    def __init__(self, evidence: str, fault: str, remedy: str) -> None:
        super().__init__(f"{evidence}; {remedy}")
        self.evidence, self.fault, self.remedy = evidence, fault, remedy


class HostileFmuError(FmuFileError):
    """A file is made so that unpacking or reading it would do harm; ``fault`` says how."""

    def __init__(self, message: str, fault: str = "hostile archive") -> None:
        super().__init__(message)
        self.fault = fault


@dataclass(frozen=True, slots=True)
class QuestionTopic:
    """Subject of a question; of questions of one kind a command shows the first, and counts the others.

    Attributes
    ----------
    kind : str
        The same for questions that one answer could settle; it has no figure and no name of an element.
    about : str
        The element in question, as a list of such elements names it.
    variables : tuple of str
        The variables, ``component.variable``, that ``meant`` in the case file names to answer the question.
    """

    kind: str
    about: str = ""
    variables: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake in a case: its place, and what is wrong with the remedy."""

    place: str
    text: str
    kind: ErrorKind = ErrorKind.VALUES
    besides: bool = False  # a question that stands beside a failure, as its likely reason
    topic: QuestionTopic | None = None  # of a question that several elements can raise
    record: str = ""  # file and record that the text begins with, where ``place`` is the key that names the file
    # the place with the first of many records that it lists, and how many more there are; "" where it lists few
    place_in_short: str = ""
    cause: str = ""  # the text without the scenario that it names first; "" where it names none

    @classmethod
    def of_scenario(
        cls, place: str, scenario: str, cause: str, kind: ErrorKind = ErrorKind.VALUES
    ) -> Self:
        """Return the problem of one scenario, which its text names first."""
        return cls(place, f"scenario {scenario!r}: " + cause, kind, cause=cause)

    @property
    def message(self) -> str:
        """The problem at its place, with the options as values."""
        return Text(self.place, ": ", self.text) if self.place else self.text

    def __str__(self) -> str:
        return spelled(self.message)

    def as_json(self) -> dict[str, str | bool]:
        return {
            "place": self.place,
            "text": self.text,
            "kind": self.kind,
            "besides": self.besides,
        }


# so many mistakes of one case are listed; looking for more would take long and help nobody
MOST_PROBLEMS = 200

TOO_MANY = Problem("", "there are more problems than are listed; mend these first")


_GIVEN = {
    Option.SET,
    Option.STEP,
    Option.STOP,
    Option.VARY,
    Option.SCENARIO,
    Option.FAULT,
    Option.FORCE,
}
"""Places of problems that lie in what a call was given."""


def _option_at(problem: Problem) -> str:
    return parts_of(problem.place)[0]


def _for_python(problem: Problem) -> str:
    """Return a problem in what a call was given; values are named as one mapping."""
    if _option_at(problem) is not Option.SET:
        return str(problem)
    _, *key = parts_of(problem.place)
    return spelled(Text("values: ", "".join(key).lstrip(), ": ", problem.text))


class CaseError(InputError):
    """A case cannot be used; all its mistakes are listed together. Mistakes of several kinds make it `VALUES`."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        kinds = {problem.kind for problem in problems}
        asked = sum(problem.besides for problem in problems)
        count = number_of(len(problems) - asked, "problem")
        count += f", and {number_of(asked, 'question')} besides" if asked else ""
        lines = joined(
            "\n  - ",
            [f"{ShownFile.of(source)}: {count}", *(problem.message for problem in problems)],
        )
        super().__init__(lines, kind=kinds.pop() if len(kinds) == 1 else ErrorKind.VALUES)

    def __str__(self) -> str:
        """Give the message; where what Python gave is all that is wrong, the file is not blamed."""
        if for_python() and all(_option_at(one) in _GIVEN for one in self.problems):
            return "\n".join(_for_python(one) for one in self.problems)
        return super().__str__()


class StartError(CaseError):
    """A component refuses to start with its values, or from its operating point.

    ``others``: of components that do so as well; ``wider``: values of limits, by ``component.variable``, with which all
    of them start, empty where one of them has another cause."""

    def __init__(
        self,
        source: str,
        problem: Problem,
        component: str,
        others: Sequence[Problem] = (),
        *,
        wider: Mapping[str, float] | None = None,
    ) -> None:
        self.component = component
        self.wider = dict(wider or {})
        super().__init__(source, [problem, *others])


class BindingError(CaseError):
    """A binding cannot be used; all its mistakes are listed together."""


class PowerFlowError(InputError):
    """There is no power flow."""

    kind = ErrorKind.POWER_FLOW


class ComponentError(CosimError):
    """A running FMU refused a call; the message carries the FMU's own log text."""

    kind = ErrorKind.FMU

    def __init__(
        self,
        component: str,
        call: str,
        status: str,
        log: str,
        time: float | None = None,
        kind: ErrorKind | None = None,
    ) -> None:
        self.component, self.call, self.status, self.log, self.time = (
            component,
            call,
            status,
            log,
            time,
        )
        when = "" if time is None else f" at t = {time:.6g} s"
        said = log or "the FMU logged no text"
        super().__init__(
            f"component {component!r}{when}: {call} returned {status}: {said}", kind=kind
        )


class NotFiniteError(ComponentError):
    """A running FMU gave an output that is no finite number, and said nothing itself."""

    kind = ErrorKind.NOT_FINITE

    def __init__(
        self, component: str, variable: str, value: float | None, time: float | None
    ) -> None:
        self.variable, self.value = variable, value
        seen = "" if value is None else f" ({value})"
        said = f"{variable} is no finite number{seen}"
        super().__init__(component, "fmi2GetReal", "not a number", said, time)


class CouplingError(CosimError):
    """The components of a step do not come to an agreement."""


class EndedError(CosimError):
    """A running FMU ended its simulation by itself, as FMI allows; ``ended_at`` is when [s].

    ``status``, ``log``: what the call returned, and the FMU's own words; ``time``: of the step that it did not make
    [s]."""

    def __init__(self, component: str, status: str, log: str, time: float, ended_at: float) -> None:
        self.component, self.status, self.log, self.time, self.ended_at = (
            component,
            status,
            log,
            time,
            ended_at,
        )
        said = f" (it says: {log})" if log else ""
        super().__init__(
            f"component {component!r}: it ended its simulation at t = {ended_at:.6g} s by itself, which is no error"
            f"{said}; let the run stop by then"
        )


class NotTakenUpError(CosimError):
    """A component does not go on from a state that was kept of another instance of it."""

    def __init__(self, component: str, reason: str) -> None:
        self.component, self.reason = component, reason
        super().__init__(
            f"component {component!r} does not go on from its state in a checkpoint: {reason}"
        )


class RunInterruptedError(CosimError):
    """Ctrl-C ended a run before its time."""

    exit_code = INTERRUPTED


class AnalysisError(CosimError):
    """An operating point or a linear model cannot be computed."""

    kind = ErrorKind.ANALYSIS
