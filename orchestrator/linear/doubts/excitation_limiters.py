"""Warnings of limiters of excitation that act where a machine starts, or would act there in time."""

from collections.abc import Iterator

from orchestrator.core.options import Option
from orchestrator.systems.coupling.master import Master

_KINDS = {"oel": "overexcitation", "uel": "underexcitation"}
_ACTS = "acts"  # output of a limiter: 1 while it acts
_LIMIT = "EFD1"  # first point of an inverse time
_TAKEN = "first_point"  # the same as it is taken
_SIGNAL = "signal"  # what it adds to the voltage reference [pu]
_YES = 0.5  # above it an output says yes


def limiter_warnings(master: Master) -> tuple[str, ...]:
    """Warn of limiters that are beyond their limits; for a master at its start."""
    return tuple(text for name in master.components for text in _of_machine(master, name))


def _of_machine(master: Master, name: str) -> Iterator[str]:
    component = master.components[name]
    variables = component.description.variables
    for scope, kind in _KINDS.items():
        acts, signal, limit, taken = (f"{scope}.{x}" for x in (_ACTS, _SIGNAL, _LIMIT, _TAKEN))
        if not {acts, signal} <= variables.keys():
            continue
        timed = [limit, taken] if {limit, taken} <= variables.keys() else []
        found = component.values([acts, signal, *timed])
        without = f"{Option.SET} {name}.{scope}=none"
        remedy = f"correct its data, or the operating point; without it: {without}"
        if found[acts] > _YES:
            yield (
                f"{name}: its limiter of {kind} acts at the operating point and adds "
                f"{found[signal]:+.4g} pu to the voltage reference ({scope}.{_SIGNAL}): modes are those with it "
                f"acting; {remedy}"
            )
        elif timed and found[taken] > found[limit]:
            yield (
                f"{name}: the operating point is beyond the first point of its limiter of {kind}, {limit} = "
                f"{found[limit]:g}: it is let rest, and the time runs beyond {found[taken]:.4g} ({taken}) only; "
                f"{remedy}"
            )
