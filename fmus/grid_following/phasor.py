"""The converter without network transients, for RMS tools with steps of milliseconds.

The filter's voltages are algebraic and the current control is a lag; PLL and outer control are those of the EMT
variant. Its emf is the voltage that the converter's current gives at the capacitor, with an extrapolated bus voltage.
"""

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.converter_parts.filter import APPENDIX, FilterData, declare_filter_data
from fmus.converter_parts.usual_ranges import FOLLOWING
from fmus.grid_following.converter import P_0, S_N, Signals, declare_signals
from fmus.grid_following.outer_control import Measured, outer_control
from fmus.grid_following.pll import phase_locked_loop
from fmus.toolchain.frames import Phasor, power, qd_state
from fmus.toolchain.model import Model
from fmus.toolchain.phasor_port import (
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    motion,
    phasor_builder,
)
from fmus.toolchain.port import device_port
from fmus.toolchain.symbols import Expr


def grid_following_converter_phasor() -> Model:
    """PLL and outer control of `grid_following_converter` behind an algebraic electrical side."""
    title = "Grid-following converter with PLL and P, Q or voltage control (phasor type)"
    m = phasor_builder("gfl_phasor", title, kind="converter", usual=FOLLOWING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    f = declare_filter_data(m, port)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    i_s = qd_state(m, "current_control.i_s", f.initial.i_s, "Current of the converter")
    theta = m.algebraic("theta")
    u = _capacitor_voltage(f, seen.value.rotated(-theta), i_s.value)
    frame = phase_locked_loop(m, f.initial.theta, port.omega_b, u)
    m.close(theta, frame.theta)
    seen.follow(m, port.v)
    into_grid = (i_s.value - _capacitor(f) * u) * port.connected
    measured = Measured(power(u, into_grid), u.magnitude(), frame.w)
    limited, i_ref = outer_control(m, f, port, measured, _capacitor(f) * u)
    with m.scope("current_control"):
        tau = m.parameter(
            "tau", 0.001, "s", "Time constant of the current loop", minimum=1e-3, source=APPENDIX
        )
        i_s.set_derivative(m, (i_ref - i_s.value) / tau)
        moving = motion(m, "slow", i_s.value, f.initial.i_s, "Current of the converter")

    def emf(time: Expr) -> Phasor:
        i_then = (i_s.value + moving * time).rotated(
            frame.theta + port.omega_b * (frame.w - 1) * time
        )
        return _capacitor_voltage(f, seen.after(time), i_then)

    source = SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))
    declare_phasor_outputs(m, port, source, Phasor(f.R_t, f.X_t))
    declare_signals(m, Signals(frame, limited, u.magnitude(), i_s.value.magnitude()))
    return m.build()


def _capacitor(f: FilterData) -> Phasor:
    """Admittance of the capacitor with its series resistance, at rated frequency [pu, S_n]."""
    return Phasor(0.0, f.B_c) / Phasor(1.0, f.R_cap * f.B_c)


def _capacitor_voltage(f: FilterData, v: Phasor, i_s: Phasor) -> Phasor:
    """Voltage that the converter's current gives at the capacitor, with a bus voltage behind the transformer [pu]."""
    impedance = Phasor(f.R_t, f.X_t)
    return (v + impedance * i_s) / (Phasor(1, 0) + impedance * _capacitor(f))
