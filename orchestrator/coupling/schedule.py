"""In which order the components of a system step within one communication step.

Components of one group step side by side: all take their inputs, all step, all give their outputs.
Groups follow one another, and each sees the new outputs of those before it. One group is the Jacobi
scheme; several are Gauss-Seidel.
"""

from dataclasses import dataclass

from orchestrator.errors import InputError

SCHEDULES = ("gauss-seidel", "jacobi")


@dataclass(frozen=True, slots=True)
class Schedule:
    """Groups of component names, in order."""

    name: str
    groups: tuple[tuple[str, ...], ...]

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
        faults = [f"{what}: {', '.join(sorted(names))}" for what, names in wrong.items() if names]
        if faults:
            raise InputError(f"schedule {self.name!r}: {'; '.join(faults)}; list every component exactly once")


def jacobi(components: tuple[str, ...]) -> Schedule:
    """All components side by side, each with the others' outputs of the step before."""
    return Schedule("jacobi", (components,))


def gauss_seidel(groups: tuple[tuple[str, ...], ...]) -> Schedule:
    """Groups one after the other; the default of this project is devices, then grid."""
    return Schedule("gauss-seidel", groups)
