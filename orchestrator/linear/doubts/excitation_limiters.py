"""Warnings of limiters of excitation: those that act where a machine starts, or would in time, and those that at the
end of a run hold what needs no limit, or rest although it needs one."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from orchestrator.core.options import Option
from orchestrator.systems.coupling.master import Master

_KINDS = {"oel": "overexcitation", "uel": "underexcitation"}
_ACTS = "acts"  # output of a limiter: 1 while it acts
_SIGNAL = "signal"  # what it adds to the voltage reference [pu]
_LEAST = 1e-6  # signal [pu] from which a limiter acts, as its model has it
_LATER = {
    "moved": "its edge is taken {} pu farther out",
    "lowered": "its signal is taken {} pu lower",
}
"""Variables by how much a limiter acts later than its data say, in words; 0 where the start is within its edge."""

_FIELD = "E_fd"
"""Output of a machine: its field voltage [pu], which in steady state is the field current."""

_YES = 0.5  # above it an output says yes

_OF_REACTIVE_POWER = ("excess", "Q_ref", "T_delay", "beyond_for", _SIGNAL)
"""Variables of a limiter of overexcitation that limits the reactive power: how far it is beyond Q_ref [pu], Q_ref, its
delay [s], how much of that has passed [s], and its signal."""

_AWAY = 0.01
"""Distance [pu] from a limit from which on a machine at the end of a run is not at it: the swings that are left of an
event are below."""


@dataclass(frozen=True)
class _Limit:
    """A limit that an operating point may lie beyond.

    ``taken``: the same as it is taken; ``then``: its effect there; ``would``: what it would do as it is given;
    ``base``: the parameter that it is per unit of, where it is in parts of another."""

    name: str
    taken: str
    words: str
    then: str
    would: str
    base: str = ""

    def level(self, scope: str, found: Mapping[str, float]) -> str:
        """Return the limit as the data have it, in pu of the field voltage too where it is per unit of another."""
        limit = found[f"{scope}.{self.name}"]
        told = f"{scope}.{self.name} = {limit:g}"
        if not self.base:
            return told
        base = found[f"{scope}.{self.base}"]
        return f"{told} of {scope}.{self.base} = {base:g}, which is {limit * base:.4g} pu"


_RUNS_OUT = "its time would run out, and it would pull the field down"
_AT_ONCE = "it would pull the field down"

_LIMITS = (
    _Limit("EFD1", "first_point", "the first point", "the time runs beyond", _RUNS_OUT, "EFDRATED"),
    _Limit("I_TFpu", "I_TFpu_taken", "the pickup", "the time runs beyond", _RUNS_OUT),
    _Limit("I_inst", "I_inst_taken", "the instantaneous limit", "it holds beyond", _AT_ONCE),
    _Limit("I_lim", "I_lim_taken", "the thermal limit", "it holds beyond", _AT_ONCE),
)


def limiter_warnings(master: Master, setting: str = Option.SET) -> tuple[str, ...]:
    """Warn of limiters that are beyond their limits; for a master at its start.

    ``setting``: what is typed before a value by name: where the command itself has no such option, with another."""
    return tuple(text for name in master.components for text in _of_machine(master, name, setting))


def warnings_at_end(master: Master) -> tuple[str, ...]:
    """Warn of limiters that hold the reactive power far below their limit, or rest beyond it; at the end of a run."""
    return tuple(filter(None, (_at_end(master, name) for name in master.components)))


def _at_end(master: Master, name: str) -> str:
    component = master.components[name]
    wanted = [f"oel.{variable}" for variable in _OF_REACTIVE_POWER]
    if not {*wanted} <= component.description.variables.keys():
        return ""
    values = component.values(wanted)
    excess, limit, delay, passed, signal = (float(values[each]) for each in wanted)
    when = f"at t = {master.time:.4g} s, the end of the run"
    limiter = f"limiter of {_KINDS['oel']}"
    of_limit = f"oel.Q_ref = {limit:g} pu"
    if signal < -_LEAST and excess < -_AWAY:
        return (
            f"{name}: {when}, its {limiter} still holds the voltage reference {-signal:.4g} pu lower, and its reactive "
            f"power is {-excess:.4g} pu below {of_limit}: the integral does not let go by itself unless oel.T_delay, "
            f"here {delay:g} s, is 0"
        )
    if signal >= -_LEAST and excess > _AWAY:
        left = max(delay - passed, 0.0)
        return (
            f"{name}: {when}, its {limiter} rests, and its reactive power is {excess:.4g} pu beyond {of_limit}: "
            f"{passed:.3g} s of oel.T_delay = {delay:g} s have passed; let the run go on beyond t = "
            f"{master.time + left:.4g} s to see it act"
        )
    return ""


def _of_machine(master: Master, name: str, setting: str) -> Iterator[str]:
    component = master.components[name]
    variables = component.description.variables
    for scope, kind in _KINDS.items():
        acts, signal = f"{scope}.{_ACTS}", f"{scope}.{_SIGNAL}"
        if not {acts, signal} <= variables.keys():
            continue
        limits = [one for one in _LIMITS if f"{scope}.{one.taken}" in variables]
        names = [
            f"{scope}.{name}" for one in limits for name in (one.name, one.taken, one.base) if name
        ]
        later = {f"{scope}.{one}": words for one, words in _LATER.items()}
        later = {one: words for one, words in later.items() if one in variables}
        found = component.values([acts, signal, _FIELD, *names, *later])
        without = f"{setting} {name}.{scope}=none"
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
                    f"{name}: the operating point is beyond {one.words} of its limiter of {kind}: {_FIELD} = "
                    f"{found[_FIELD]:.4g} pu at the start, and {one.level(scope, found)}; in PSS/E {one.would}; here "
                    f"it is let rest, and {one.then} {found[taken]:.4g} ({taken}) only, and modes are those without "
                    f"it; {remedy}"
                )
