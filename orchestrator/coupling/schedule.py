"""In which order the components of a system step within one communication step, and what they know of one another.

Components of one group step side by side: all take their inputs, all step, all give their outputs.
Groups follow one another, and each sees the new outputs of those before it. One group is the Jacobi
scheme; several are Gauss-Seidel.
"""

from dataclasses import dataclass
from typing import Literal

from orchestrator.errors import InputError

SCHEDULES = ("gauss-seidel", "jacobi")

FirstInputs = Literal["consistent", "once", "start", "zero"]
"""What connected inputs hold in the first step.

``consistent``: outputs were propagated until nothing changed any more (what this master does). Others', which propagate
nothing before initialisation has ended: ``once``: outputs as read then, with inputs still at their start values;
``start``: the inputs' start values; ``zero``: 0.
"""


@dataclass(frozen=True, slots=True)
class Schedule:
    """Groups of component names, in order.

    Parameters
    ----------
    first_inputs
        What connected inputs hold in the first step.
    extrapolation
        Inputs are held at y + extrapolation·(y − y before), y being the output that feeds them at a communication point
        and the one before it; 0 takes y itself.
    wire_by_wire
        Between two steps connections are served one after the other, in the order in which they were made: an output
        that depends directly on inputs is read after those that were set before it. This needs a single group, and
        inputs that are held.
    ticks_per_second
        Of a master that keeps time in whole ticks: its FMUs are told differences of times, which rounding makes not
        quite equal. None tells them the communication step itself.
    """

    name: str
    groups: tuple[tuple[str, ...], ...]
    first_inputs: FirstInputs = "consistent"
    extrapolation: float = 0.0
    wire_by_wire: bool = False
    ticks_per_second: int | None = None

    @property
    def is_plain(self) -> bool:
        """Whether nothing but the order of the components is special about the steps."""
        return not (self.extrapolation or self.wire_by_wire or self.ticks_per_second)

    def check(self, components: set[str]) -> None:
        """Raise unless every component is in exactly one group.

        Raises
        ------
        InputError
            Naming the components that are missing, unknown or repeated.
        """
        listed = [name for group in self.groups for name in group]
        wrong = {
            "not in any group": components - set(listed),
            "not components": set(listed) - components,
            "listed more than once": {name for name in listed if listed.count(name) > 1},
        }
        if self.wire_by_wire and (len(self.groups) > 1 or self.extrapolation):
            raise InputError(f"schedule {self.name!r}: wire_by_wire needs a single group and no extrapolation")
        faults = [f"{what}: {', '.join(sorted(names))}" for what, names in wrong.items() if names]
        if faults:
            raise InputError(f"schedule {self.name!r}: {'; '.join(faults)}; list every component exactly once")


def jacobi(components: tuple[str, ...]) -> Schedule:
    """All components side by side, each with the others' outputs of the step before."""
    return Schedule("jacobi", (components,))


def gauss_seidel(groups: tuple[tuple[str, ...], ...]) -> Schedule:
    """Groups one after the other; the default of this project is devices, then grid."""
    return Schedule("gauss-seidel", groups)
