"""Warnings of limiters of excitation that act where a machine starts, or would act there in time."""

from collections.abc import Iterator
from dataclasses import dataclass

from orchestrator.core.options import Option
from orchestrator.systems.coupling.master import Master

_KINDS = {"oel": "overexcitation", "uel": "underexcitation"}
_ACTS = "acts"  # output of a limiter: 1 while it acts
_SIGNAL = "signal"  # what it adds to the voltage reference [pu]
_LATER = {
    "moved": "its edge is taken {} pu farther out",
    "lowered": "its signal is taken {} pu lower",
}
"""Variables by how much a limiter acts later than its data say, in words; 0 where the start is within its edge."""

_YES = 0.5  # above it an output says yes


@dataclass(frozen=True)
class _Limit:
    """A limit that an operating point may lie beyond; ``taken``: the same as it is taken; ``then``: its effect."""

    name: str
    taken: str
    words: str
    then: str


_LIMITS = (
    _Limit("EFD1", "first_point", "the first point", "the time runs beyond"),
    _Limit("I_TFpu", "I_TFpu_taken", "the pickup", "the time runs beyond"),
    _Limit("I_inst", "I_inst_taken", "the instantaneous limit", "it holds beyond"),
    _Limit("I_lim", "I_lim_taken", "the thermal limit", "it holds beyond"),
)


def limiter_warnings(master: Master) -> tuple[str, ...]:
    """Warn of limiters that are beyond their limits; for a master at its start."""
    return tuple(text for name in master.components for text in _of_machine(master, name))


def _of_machine(master: Master, name: str) -> Iterator[str]:
    component = master.components[name]
    variables = component.description.variables
    for scope, kind in _KINDS.items():
        acts, signal = f"{scope}.{_ACTS}", f"{scope}.{_SIGNAL}"
        if not {acts, signal} <= variables.keys():
            continue
        limits = [one for one in _LIMITS if f"{scope}.{one.taken}" in variables]
        names = [f"{scope}.{name}" for one in limits for name in (one.name, one.taken)]
        later = {f"{scope}.{one}": words for one, words in _LATER.items()}
        later = {one: words for one, words in later.items() if one in variables}
        found = component.values([acts, signal, *names, *later])
        without = f"{Option.SET} {name}.{scope}=none"
        remedy = f"correct its data, or the operating point; without it: {without}"
        if found[acts] > _YES:
            yield (
                f"{name}: its limiter of {kind} acts at the operating point and adds "
                f"{found[signal]:+.4g} pu to the voltage reference ({scope}.{_SIGNAL}): modes are those with it "
                f"acting; {remedy}"
            )
            continue
        for variable in (one for one in later if found[one] > 0):
            words = later[variable].format(f"{found[variable]:.4g}")
            yield (
                f"{name}: the operating point is beyond the edge of its limiter of {kind}: it is let rest, and {words} "
                f"({variable}); {remedy}"
            )
        for one in limits:
            limit, taken = f"{scope}.{one.name}", f"{scope}.{one.taken}"
            if found[taken] > found[limit]:
                yield (
                    f"{name}: the operating point is beyond {one.words} of its limiter of {kind}, {limit} = "
                    f"{found[limit]:g}: it is let rest, and {one.then} {found[taken]:.4g} ({taken}) only; {remedy}"
                )
