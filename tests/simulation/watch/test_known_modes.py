"""A fast oscillation beside the modes of the run's own linear model: offsets in stators that decay and beat."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.simulation.watch.settings import Settings
from orchestrator.simulation.watch.watch import judge_run
from orchestrator.systems.coupling.events import BusFault, ParameterChange
from orchestrator.systems.coupling.system import System
from tests.simulation.watch.seen import seen_of, system
from tests.systems.coupling.small_fmus import small_fmu

EVENT = 1.0
OFFSETS = [
    complex(rate, 2 * np.pi * hertz)
    for rate, hertz in ((-0.05, 50.0), (-0.12, 50.03), (-0.2, 50.05))
]
GROWS = [complex(0.3, 2 * np.pi * 50.6)]


def found(course, lasts, eigenvalues=(), *, passes=True):
    """``course`` of the time since a pulse of one step, after which the system is the one of the start again."""
    events = [
        ParameterChange(EVENT - 0.1, "a", "offset", 1.0),
        ParameterChange(EVENT, "a", "offset", 0.0),
    ]
    y = lambda t: 0.9 + (t > EVENT) * course(np.maximum(t - EVENT, 0.0))  # noqa: E731
    return judge_run(
        seen_of({"a.y": y}, EVENT + lasts), system("a"), events[: 1 + passes], eigenvalues
    )


def sum_of(modes, sizes, phases):
    def course(t):
        parts = [s * np.exp(m * t + 1j * p) for m, s, p in zip(modes, sizes, phases, strict=True)]
        return np.real(sum(parts))

    return course


# grows for some seconds before it decays
BEATS = sum_of(OFFSETS, (0.06, 0.03, 0.03), (0.0, 2.6, 2.4))
KINDS = {"not_judged"}
V, START = small_fmu("gain").variables["K"], {"on": 0.0, "R": 0.0, "X": 1.0}


@pytest.mark.parametrize("lasts", [2.0, 4.0, 5.0, 7.0, 9.0, 14.0])
def test_offsets_that_beat_are_never_unstable_however_long_the_run_is(lasts):
    # more than twofold
    assert {f.kind for f in found(BEATS, lasts, OFFSETS)} <= (KINDS if 5 < lasts < 10 else set())
    assert {f.kind for f in found(BEATS, lasts)} <= KINDS
    assert {f.kind for f in found(BEATS, lasts, OFFSETS, passes=False)} <= KINDS


def test_what_the_response_alone_cannot_tell_is_said_with_a_remedy():
    (finding,) = found(BEATS, 4.0)
    assert "no model tells, as none holds here" in finding.message
    assert "let the run go on to t = " in finding.message


@pytest.mark.parametrize("lasts", [2.0, 4.0, 9.0])
def test_a_growth_that_the_model_has_is_told_at_once(lasts):
    (finding,) = found(sum_of(GROWS, (1e-3,), (0.0,)), lasts, [*OFFSETS, *GROWS])
    assert (finding.kind, finding.time) == ("growing_oscillation", EVENT)


@pytest.mark.parametrize("eigenvalues", [(), OFFSETS])
@pytest.mark.parametrize(("rate", "lasts"), [(0.2, 8.0), (1.0, 4.0), (3.0, 2.0)])
def test_a_growth_that_no_model_has_is_told_once_it_is_more_than_a_beat(eigenvalues, rate, lasts):
    (finding,) = found(
        sum_of([complex(rate, 2 * np.pi * 50.3)], (1e-3,), (0.0,)), lasts, eigenvalues
    )
    assert finding.kind == "growing_oscillation"


def test_what_lasts_longer_than_every_mode_there_is_told():
    modes = [complex(-2.0, 2 * np.pi * 50.0)]
    (finding,) = found(sum_of([complex(0.0, 2 * np.pi * 50.0)], (0.02,), (0.0,)), 4.0, modes)
    assert finding.kind == "sustained_oscillation"


def test_begin_and_end_of_one_fault_are_one_event():
    """Its R and X stay set, and act no more."""
    made = System()
    variables = {
        f"bus_1.fault.{name}": replace(V, name=name, start=start) for name, start in START.items()
    }
    made.add("grid", replace(small_fmu("gain"), variables=small_fmu("gain").variables | variables))
    fault = [BusFault(t, "grid", "bus_1", on=t < 1.2, R=0.1, X=0.1) for t in (1.0, 1.45)]
    settings = Settings(made, fault, np.zeros(1))
    assert [settings.ends_fault(t) for t in (1.0, 1.45, 2.0)] == [False, True, False]
    assert [settings.as_at_start(t) for t in (0.5, 1.0, 1.45)] == [True, False, True]
