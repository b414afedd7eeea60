"""Runs made by hand: signals by formula, as the watch would see them."""

from functools import cache

import numpy as np

from fmus.toolchain.exporter import cached
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.simulation.watch.seen import Seen
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu

LOOK = 5e-3
STEP = 1e-4


def system(*names):
    """Components with an input ``u`` and an output ``y``."""
    made = System()
    for name in names:
        made.add(name, small_fmu("gain"))
    return made


def seen_of(signals, stop):
    """What the watch sees of outputs given as functions of time, every step of `STEP`, until ``stop`` [s]."""
    times = np.arange(round(stop / STEP) + 1) * STEP
    every = round(LOOK / STEP)
    parts = {"last": {}, "low": {}, "high": {}, "turns": {}}
    for name, function in signals.items():
        y = function(times)
        change = np.diff(y, prepend=y[0])
        turned = np.concatenate([[0.0], (change[1:] * change[:-1] < 0)]).astype(float)
        inner = y[1:].reshape(-1, every)
        parts["last"][name] = y[::every]
        parts["low"][name] = np.concatenate([[y[0]], np.minimum(inner.min(axis=1), y[:-1:every])])
        parts["high"][name] = np.concatenate([[y[0]], np.maximum(inner.max(axis=1), y[:-1:every])])
        parts["turns"][name] = np.concatenate([[0.0], turned[1:].reshape(-1, every).sum(axis=1)])
    return Seen(
        times[::every],
        dict(parts["last"]),
        parts["last"],
        parts["low"],
        parts["high"],
        parts["turns"],
    )


@cache
def unit_fmu():
    """A unit with a breaker: its speed, its angle and its voltage are what a test says."""
    m = ModelBuilder("small_unit", "A unit")
    m.parameter("S_n", 100.0, "MVA", "Rated power")
    on = m.switch("connected", True, "Breaker", tunable=True)
    u = m.input("u", "1", "Input")
    for name, what in (("omega", "pu"), ("delta", "rad"), ("v_re", "pu"), ("v_im", "pu")):
        m.output(name, u * on, what, name, base="S_n")
    return read_description(cached(PythonFmu(m.build())))


def units(**ratings):
    """Units on the grid, with their ratings [MVA]."""
    made = System()
    for name, rating in ratings.items():
        made.add(name, unit_fmu(), {"S_n": rating})
    return made


@cache
def source_fmu():
    """A grid whose stiff source has a breaker of its own."""
    m = ModelBuilder("small_source", "A grid with a source")
    u = m.input("u", "1", "Input")
    with m.scope("source"):
        closed = m.switch("connected", True, "Breaker of the source", tunable=True)
    m.output("source.theta", u * closed, "rad", "Angle of the source", base="S_n")
    return read_description(cached(PythonFmu(m.build())))


@cache
def foreign_fmu():
    """A unit of others at 60 Hz that shows its frequency, not its angle."""
    m = ModelBuilder("small_foreign_unit", "A unit of others")
    f_n = m.parameter("f_n", 60.0, "Hz", "Rated frequency")
    m.parameter("theta_0", 0.0, "rad", "Angle at the start")
    m.parameter("S_n", 100.0, "MVA", "Rated power")
    on = m.switch("connected", True, "Breaker", tunable=True)
    m.output("omega", m.input("u", "1", "Input") * on * f_n / f_n, "pu", "Frequency", base="S_n")
    return read_description(cached(PythonFmu(m.build())))
