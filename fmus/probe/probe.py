"""The probe pair: a.y feeds b.u and b.y feeds a.u.

Both are slow lags with a gain; b passes part of its input on directly, a passes nothing. Every difference between
masters changes a.y and b.y: the order of the steps, the values of the inputs in the first step (the start values of u
differ from 0 and from the partner's output), the extrapolation of inputs, and the recording of outputs with the inputs
of the step or of the next one."""

from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder


def probe_a() -> Model:
    """T·ẋ = −x + K·u, y = x: nothing passes directly."""
    return _probe("probe_a", x_0=1.0, T=0.35, K=0.8, D=0.0, u_start=0.5)


def probe_b() -> Model:
    """T·ẋ = −x + K·u, y = x + D·u: part of the input passes directly."""
    return _probe("probe_b", x_0=-0.3, T=0.25, K=-1.7, D=0.4, u_start=-0.25)


def _probe(name: str, x_0: float, T: float, K: float, D: float, u_start: float) -> Model:
    m = ModelBuilder(name, f"Probe {name[-1]} of a pair that tells which schedule a master runs")
    u = m.input("u", "1", "Output of the partner", start=u_start)
    x = m.state("x", m.parameter("x_0", x_0, "1", "Start of the lag"), "1", "Lag")
    t = m.state("t", 0.0, "s", "Time that was stepped")
    m.derivative(x, (K * u - x) / T)
    m.derivative(t, 1.0)
    m.output("y", x + D * u, "1", "To the partner")
    m.output("u_held", u, "1", "The input as it is held")
    m.output("stepped", t, "s", "Time that was stepped")
    return m.build()
