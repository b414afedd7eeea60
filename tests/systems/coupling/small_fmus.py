"""Models of one equation each, as FMUs: loops of them have trajectories that can be computed by hand."""

from functools import cache
from math import ceil

from fmus.toolchain.exporter import cached
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from fmus.toolchain.symbols import sqrt
from orchestrator.devices.fmi.description import FmuDescription, read_description


def integrator() -> Model:
    """ẋ = gain·u, y = x. The input is held, so that one step of any size is exact: x' = x + H·gain·u."""
    m = ModelBuilder("small_integrator", "Integrator with a gain")
    gain = m.parameter("gain", 1.0, "1/s", "Gain", tunable=True)
    x_0 = m.parameter("x_0", 0.0, "1", "Initial value")
    u = m.input("u", "1", "What is integrated")
    x = m.state("x", x_0, "1", "Integral")
    m.derivative(x, gain * u)
    m.output("y", x, "1", "Integral")
    return m.build()


def lag() -> Model:
    """T·ẋ = u − x, y = x; it can be used where T > 0."""
    m = ModelBuilder("small_lag", "First-order lag")
    T = m.parameter("T", 0.01, "s", "Time constant")
    x_0 = m.parameter("x_0", 0.0, "1", "Initial value")
    m.require(T, "T must exceed 0; raise it")
    u = m.input("u", "1", "Input")
    x = m.state("x", x_0, "1", "Output of the lag")
    m.derivative(x, (u - x) / T)
    m.output("y", x, "1", "Output of the lag")
    return m.build()


def lag_chain(stepwise: bool = False) -> Model:
    """T_1·ẋ₁ = u − x₁ and T_2·ẋ₂ = x₁ − x₂, y = x₂; x₂ may be held during a step, and move by its first rate then."""
    m = ModelBuilder("small_held_chain" if stepwise else "small_chain", "Lags in a chain")
    T_1 = m.parameter("T_1", 0.01, "s", "Time constant of the first lag")
    T_2 = m.parameter("T_2", 0.004, "s", "Time constant of the second lag")
    x_0 = m.parameter("x_0", 0.0, "1", "Initial value of both")
    u = m.input("u", "1", "Input")
    x_1 = m.state("x_1", x_0, "1", "Output of the first lag")
    x_2 = m.state("x_2", x_0, "1", "Output of the second lag", stepwise=stepwise)
    m.derivative(x_1, (u - x_1) / T_1)
    m.derivative(x_2, (x_1 - x_2) / T_2)
    m.output("y", x_2, "1", "Output of the second lag")
    return m.build()


def lag_factor(step_size: float, T: float, internal_step: float = 1e-4) -> float:
    """What is left of u − x after one communication step: the Runge-Kutta polynomial of each internal step."""
    parts = max(1, ceil(step_size / internal_step - 1e-9))
    z = -step_size / parts / T
    return (1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24) ** parts


def gain() -> Model:
    """y = K·u at once: direct feed-through and no state."""
    m = ModelBuilder("small_gain", "Gain")
    K = m.parameter("K", 1.0, "1", "Gain", minimum=-100.0, maximum=100.0, tunable=True)
    offset = m.parameter("offset", 0.0, "1", "Added to the output", maximum=10.0)
    u = m.input("u", "1", "Input")
    m.output("y", K * u + offset, "1", "Output")
    return m.build()


def started_gain() -> Model:
    """y = u, from an input that starts at 0.5."""
    m = ModelBuilder("small_started_gain", "Gain with a start value")
    u = m.input("u", "1", "Input", start=0.5)
    m.output("y", u, "1", "Output")
    return m.build()


def guarded_gain() -> Model:
    """y = u/K at once, usable where K > 0."""
    m = ModelBuilder("small_guarded_gain", "Gain with a rule")
    K = m.parameter("K", 1.0, "1", "Divisor", tunable=True)
    m.require(K, "K must exceed 0; raise it")
    u = m.input("u", "1", "Input")
    m.output("y", u / K, "1", "Output")
    return m.build()


def blow_up() -> Model:
    """ẋ = x² + u: at rest for u = 0; for u = r² it is x = r·tan(r·t), infinite at t = π/2r."""
    m = ModelBuilder("small_blow_up", "A state that becomes infinite in finite time")
    u = m.input("u", "1", "Input")
    x = m.state("x", 0.0, "1", "The state")
    m.derivative(x, x**2 + u)
    m.output("y", x, "1", "The state")
    return m.build()


def root() -> Model:
    """y = √(0.05 + offset − u): no number where that is negative."""
    m = ModelBuilder("small_root", "Square root")
    offset = m.parameter("offset", 0.0, "1", "Added to what the root is taken of", tunable=True)
    u = m.input("u", "1", "Input")
    m.output("y", sqrt(0.05 + offset - u), "1", "Root")
    return m.build()


def power_source() -> Model:
    """An output in megawatt, and a switch."""
    m = ModelBuilder("small_power_source", "Constant power")
    P = m.parameter("P", 100.0, "MW", "Power", tunable=True)
    on = m.switch("on", True, "Whether it feeds", tunable=True)
    m.output("p", P * on, "MW", "Power")
    return m.build()


MODELS = {
    "integrator": integrator,
    "lag": lag,
    "chain": lag_chain,
    "held_chain": lambda: lag_chain(stepwise=True),
    "gain": gain,
    "started_gain": started_gain,
    "guarded_gain": guarded_gain,
    "blow_up": blow_up,
    "root": root,
    "power_source": power_source,
}


@cache
def small_fmu(name: str) -> FmuDescription:
    """One of `MODELS`, built once a machine."""
    return read_description(cached(PythonFmu(MODELS[name]())))
