"""Phase-locked loop in the synchronous reference frame (SRF-PLL): the frame in which a voltage has no d component."""

from dataclasses import dataclass
from math import pi

from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar

STRUCTURE = "structure and damping: Chung 2000; 10 Hz chosen here"


@dataclass(frozen=True)
class Frame:
    """The converter's frame: its angle in the network frame [rad], a state, and its frequency [pu, f_n]."""

    theta: Expr
    w: Expr


@dataclass(frozen=True)
class LoopDefaults:
    """Default natural frequency [Hz] and damping ratio at 1 pu, and where they come from."""

    f_0: float = 10.0
    xi: float = 0.707
    source: str = STRUCTURE


def phase_locked_loop(
    m: ModelBuilder,
    angle_0: Scalar,
    omega_b: Expr,
    measured: Phasor,
    defaults: LoopDefaults = LoopDefaults(),
    running: Expr | None = None,
) -> Frame:
    """Declare the loop: w = 1 + k_p·u_⊥ + x, dx/dt = k_i·u_⊥, dθ/dt = ω_b·(w − 1), with u_⊥ = −u_d.

    For a voltage of 1 pu the angle follows as (2ξω_0·s + ω_0²)/(s² + 2ξω_0·s + ω_0²).

    ``angle_0``: angle of the frame at the start [rad], a calculated value; ``omega_b``: base angular frequency [rad/s];
    ``measured``: voltage in the converter's own frame [pu], a function of states; ``defaults``: of its parameters;
    ``running``: factor of u_⊥ and of dθ/dt: 1, or 0 while the loop stands; None for a loop that always runs."""
    seen = measured.im if running is None else measured.im * running
    with m.scope("pll"):
        f_0 = m.parameter(
            "f_0",
            defaults.f_0,
            "Hz",
            "Natural frequency at 1 pu",
            minimum=0.1,
            maximum=200,
            source=defaults.source,
        )
        xi = m.parameter(
            "xi",
            defaults.xi,
            "1",
            "Damping ratio at 1 pu",
            minimum=0.05,
            maximum=5,
            source=defaults.source,
        )
        omega_0 = 2 * pi * f_0
        x = m.state("x", 0, "pu", "Integrator, deviation of the frequency", base="f_n")
        theta = m.state(
            "theta", angle_0, "rad", "Angle of the converter's frame in the network frame"
        )
        w = 1 + 2 * xi * omega_0 / omega_b * seen + x
        m.derivative(x, omega_0**2 / omega_b * seen)
        turning = omega_b * (w - 1)
        m.derivative(theta, turning if running is None else turning * running)
    return Frame(theta, w)
