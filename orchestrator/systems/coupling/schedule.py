"""In which order the components of a system step within one communication step, and what they know of one another.

Components of one group step side by side: all take their inputs, all step, all give their outputs.
Groups follow one another, and each sees the new outputs of those before it. One group is the Jacobi
scheme; several are Gauss-Seidel. Both hold what an output was at one instant and are of first order in the step. Two
schedules of second order let inputs follow straight lines: ``midpoint`` extrapolates them, ``newton`` repeats the step
until they end at the new outputs."""

import math
from dataclasses import dataclass
from typing import Literal

from orchestrator.core.errors import InputError

ScheduleName = Literal["gauss-seidel", "jacobi", "midpoint", "newton"]

SCHEDULES: tuple[ScheduleName, ...] = ("gauss-seidel", "jacobi", "midpoint", "newton")

# inputs follow straight lines in a step
SECOND_ORDER: tuple[ScheduleName, ...] = ("midpoint", "newton")

FirstInputs = Literal["consistent", "once", "start", "zero"]
"""What connected inputs hold in the first step.

``consistent``: outputs were propagated until nothing changed any more (what this master does). Others', which propagate
nothing before initialisation has ended: ``once``: outputs as read then, with inputs still at their start values;
``start``: the inputs' start values; ``zero``: 0.
"""


Coupling = Literal["held", "midpoint", "newton"]
"""What inputs do during a step.

``held``: they keep what an output was at one instant. ``midpoint``: they follow a straight line, of components that
have stepped already to their new output, of the others on with the slope of the last step. ``newton``: the straight
line to the new output of all, for which the step is taken back and repeated. After the last two, all outputs are read
anew with the inputs of the step's end.
"""


TOLERANCES = (1e-8, 0.1)  # smallest and largest tolerance of a step's error


def check_tolerance(tolerance: float) -> None:
    least, most = TOLERANCES
    is_number = isinstance(tolerance, int | float) and not isinstance(tolerance, bool)
    if not is_number or not least <= tolerance <= most:
        raise InputError(
            f"tolerance = {tolerance!r}: give a number from {least:g} to {most:g}, such as 1e-4"
        )


@dataclass(frozen=True, slots=True)
class Schedule:
    """Groups of component names, in order.

    ``first_inputs``: what connected inputs hold in the first step.
    ``extrapolation``: inputs are held at y + extrapolation·(y − y before), y being the output that feeds them at a
    communication point and the one before it; 0 takes y itself.
    ``wire_by_wire``: between two steps connections are served one after the other, in the order in which they were
    made: an output that depends directly on inputs is read after those that were set before it. This needs a single
    group, and inputs that are held.
    ``ticks_per_second``: of a master that keeps time in whole ticks: its FMUs are told differences of times, which
    rounding makes not quite equal. None tells them the communication step itself.
    ``micro_step``: of second order: an FMU does a step in parts of at most this [s]; None does it in one.
    ``tolerance``: largest error of a coupled output in a pair of steps, of 1 or of its value: steps are as long as it
    allows. None takes each communication step as it is. Only for schedules of second order."""

    name: str
    groups: tuple[tuple[str, ...], ...]
    first_inputs: FirstInputs = "consistent"
    extrapolation: float = 0.0
    wire_by_wire: bool = False
    ticks_per_second: int | None = None
    coupling: Coupling = "held"
    micro_step: float | None = None
    tolerance: float | None = None

    @property
    def is_plain(self) -> bool:
        """Return whether nothing but the order of the components is special about the steps."""
        return (
            not (self.extrapolation or self.wire_by_wire or self.ticks_per_second)
            and self.coupling == "held"
        )

    @property
    def is_second_order(self) -> bool:
        """Return whether inputs follow straight lines during a step.

        Components that know the communication step give their outputs for the middle of the next one, because inputs
        are held. Here they are told 0: the schedule itself finds the middle."""
        return self.coupling != "held"

    def parts(self, step_size: float) -> int:
        """In how many parts an FMU does a communication step [s]."""
        if self.micro_step is None or not self.is_second_order:
            return 1
        return max(1, math.ceil(step_size / self.micro_step - 1e-6))

    def check(self, components: set[str]) -> None:
        listed = [name for group in self.groups for name in group]
        wrong = {
            "not in any group": components - set(listed),
            "not components": set(listed) - components,
            "listed more than once": {name for name in listed if listed.count(name) > 1},
        }
        if self.tolerance is not None:
            check_tolerance(self.tolerance)
            if not self.is_second_order:
                raise InputError(
                    f"schedule {self.name!r} with tolerance = {self.tolerance:g}: a tolerance goes with midpoint or "
                    "newton, in which no component is told the length of the step; take one of them"
                )
        if self.wire_by_wire and (len(self.groups) > 1 or self.extrapolation):
            raise InputError(
                f"schedule {self.name!r}: wire_by_wire needs a single group and no extrapolation"
            )
        if self.is_second_order and (
            self.wire_by_wire
            or self.extrapolation
            or self.ticks_per_second
            or self.first_inputs != "consistent"
        ):
            raise InputError(
                f"schedule {self.name!r}: {self.coupling} needs consistent first inputs, and no extrapolation, "
                "wire_by_wire or ticks beside it"
            )
        faults = [f"{what}: {', '.join(sorted(names))}" for what, names in wrong.items() if names]
        if faults:
            raise InputError(
                f"schedule {self.name!r}: {'; '.join(faults)}; list every component exactly once"
            )


def jacobi(components: tuple[str, ...]) -> Schedule:
    """All components side by side, each with the others' outputs of the step before."""
    return Schedule("jacobi", (components,))


def gauss_seidel(groups: tuple[tuple[str, ...], ...]) -> Schedule:
    """Groups one after the other; the default of this project is devices, then grid."""
    return Schedule("gauss-seidel", groups)


def midpoint(groups: tuple[tuple[str, ...], ...], micro_step: float | None = None) -> Schedule:
    """Groups one after the other, with inputs on straight lines as far as they are known; of second order."""
    return Schedule("midpoint", groups, coupling="midpoint", micro_step=micro_step)


def newton(groups: tuple[tuple[str, ...], ...], micro_step: float | None = None) -> Schedule:
    """Inputs on straight lines between both ends of the step, found by Newton's method on the repeated step.

    Of second order. Every FMU must save and restore its state. The groups say only in which order initial values are
    exchanged."""
    return Schedule("newton", groups, coupling="newton", micro_step=micro_step)


def of_kind(
    name: ScheduleName, groups: tuple[tuple[str, ...], ...], micro_step: float | None = None
) -> Schedule:
    """The schedule of a name, with its groups; ``jacobi`` makes one of them all."""
    match name:
        case "jacobi":
            return jacobi(tuple(component for group in groups for component in group))
        case "gauss-seidel":
            return gauss_seidel(groups)
        case "midpoint" | "newton":
            return Schedule(name, groups, coupling=name, micro_step=micro_step)
