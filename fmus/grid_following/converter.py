"""The grid-following converter: filter, phase-locked loop, current control and outer control put together."""

from dataclasses import dataclass

from fmus.converter_parts.current_control import current_control, declare_free_gains
from fmus.converter_parts.filter import APPENDIX, Filter, declare_filter, filter_equations
from fmus.converter_parts.usual_ranges import FOLLOWING
from fmus.grid_following.current_limit import Limited
from fmus.grid_following.outer_control import TRACKING_TIME, Measured, outer_control
from fmus.grid_following.pll import Frame, phase_locked_loop
from fmus.toolchain.frames import Phasor, QdState, power, qd_state
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort, declare_port_outputs, device_port
from fmus.toolchain.symbols import Expr

# the two-area system's converter, whose place it takes
S_N = 1500.0  # default rating [MVA]
P_0 = 0.9  # default dispatch [pu, S_n]
# of filter and transformer [pu, S_n]; such a small one needs a short internal step
LEAST_REACTANCE = 1e-3


@dataclass(frozen=True)
class Signals:
    """Quantities that both variants show beside their port."""

    frame: Frame
    limited: Limited
    u: Expr
    i_s: Expr


def grid_following_converter() -> Model:
    """Average EMT-type model of a grid-following converter with a stiff DC side."""
    title = (
        "Grid-following converter with PLL, current control and P, Q or voltage control (EMT type)"
    )
    m = ModelBuilder("gfl", title, kind="converter", usual=FOLLOWING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    f = declare_filter(m, port, least=LEAST_REACTANCE)
    seen, tau = _declare_measurement(m, f)
    frame = phase_locked_loop(m, f.initial.theta, port.omega_b, seen.value)
    # Behind an open breaker the bus is seen, so that the converter closes in synchronism.
    source = port.through_breaker(f.u, port.v.rotated(-frame.theta))
    seen.set_derivative(m, (source - seen.value) / tau)
    measured = Measured(power(f.u, f.i_g.value), f.u.magnitude(), frame.w)
    limited, i_ref = outer_control(m, f, port, measured, _standby(f, port, frame, seen.value))
    gains = declare_free_gains(m)
    v_c = current_control(m, f, port.omega_b, frame.w, i_ref, seen.value, gains=gains)
    filter_equations(m, f, port, v_c, frame.theta, frame.w)
    declare_port_outputs(m, port, f.i_g.value.rotated(frame.theta))
    declare_signals(m, Signals(frame, limited, f.u.magnitude(), f.i_s.value.magnitude()))
    return m.build()


def declare_signals(m: ModelBuilder, signals: Signals) -> None:
    """Declare the outputs that both variants have beside their port."""
    m.output("omega", signals.frame.w, "pu", "Frequency that the PLL sees", base="f_n")
    m.output("u", signals.u, "pu", "Voltage magnitude at the filter capacitor", base="S_n")
    m.output("i_s", signals.i_s, "pu", "Current magnitude in the converter", base="S_n")
    text = "Current that the outer control asks for, in parts of the limit; above 1 the limit acts"
    m.output("current_demand", signals.limited.share, "1", text)


def _declare_measurement(m: ModelBuilder, f: Filter) -> tuple[QdState, Expr]:
    """Declare the voltage that PLL and feed-forward see, and its lag [s]."""
    with m.scope("feed_forward"):
        tau = m.parameter(
            "tau",
            1e-4,
            "s",
            "Lag of the voltage of PLL and feed-forward",
            minimum=1e-5,
            source=APPENDIX,
        )
        m.require(
            2.5 * tau - m.internal_step,
            "internal_step must be shorter than 2.5 times feed_forward.tau",
        )
        return qd_state(m, "u", f.initial.u, "Measured capacitor voltage"), tau


def _standby(f: Filter, port: DevicePort, frame: Frame, bus: Phasor) -> Phasor:
    """Current behind an open breaker: what the capacitor takes, and what brings its voltage to that of the bus."""
    return Phasor(0, frame.w * f.B_c) * f.u_c.value + (bus - f.u) * (
        f.B_c / port.omega_b / TRACKING_TIME
    )
