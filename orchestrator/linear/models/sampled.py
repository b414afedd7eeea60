"""Sampled controllers: after how many communication steps a running system repeats.

A controller that is sampled beside the communication step, or that works on phase quantities, does not do the same in
each step. At rest it repeats after a common multiple of the step, its sample time and the network's period."""

from collections.abc import Iterable
from fractions import Fraction
from math import gcd, lcm

from orchestrator.core.errors import AnalysisError
from orchestrator.devices.fmi.component import Component
from orchestrator.systems.coupling.master import Master

LONGEST = 1.0  # common periods above this [s] are refused
_FINEST = 10**12  # times and frequencies are taken as fractions with denominators up to this


def repeating(master: Master) -> dict[str, tuple[Fraction, ...]]:
    """By name of a sampled component: the times after which something in it repeats [s]."""
    times = {name: times_of(component) for name, component in master.components.items()}
    return {name: found for name, found in times.items() if found}


def times_of(component: Component) -> tuple[Fraction, ...]:
    """Times after which something in a component repeats [s]: its sample time and the network's period."""
    d = component.description
    times = [Fraction(d.sample_time).limit_denominator(_FINEST)] if d.sample_time else []
    if d.frequency:
        value = float(component.values([d.frequency])[d.frequency])
        times.append(1 / Fraction(value).limit_denominator(10**6))
    return tuple(times)


def steps_of_times(times: Iterable[Fraction], step_size: float) -> int:
    """Communication steps [s] after which all of these times end together; 1 where each step is like every other."""
    step = Fraction(step_size).limit_denominator(_FINEST)
    known = tuple(times)
    if all(step % time == 0 for time in known):
        return 1
    common = step
    for time in known:
        common = Fraction(
            lcm(common.numerator, time.numerator), gcd(common.denominator, time.denominator)
        )
    return int(common / step)


def steps_of_period(master: Master, step_size: float, without: Iterable[str] = ()) -> int:
    """Communication steps [s] after which all components repeat; 1 where each step is like every other."""
    times = {name: t for name, t in repeating(master).items() if name not in set(without)}
    steps = steps_of_times((time for found in times.values() for time in found), step_size)
    if steps > 1 and steps * step_size > LONGEST * (1 + 1e-9):
        told = "; ".join(
            f"{name}: {', '.join(f'{float(t):.6g} s' for t in found)}"
            for name, found in times.items()
        )
        raise AnalysisError(
            f"sampled components and the communication step of {step_size:g} s repeat together after "
            f"{steps * step_size:.4g} s only, more than {LONGEST:g} s ({told}); take a step that divides these times, "
            "or that they divide"
        )
    return steps
