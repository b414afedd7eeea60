"""Virtual impedance: the voltage reference falls with the current into the grid, as behind a real impedance.

It lies between the droops' voltage and the capacitor, and exists in the control alone: it has no synchronous resonance
while it is algebraic. Powers are measured at the capacitor, on its grid side."""

from dataclasses import dataclass

from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else

_FORM = "R_v + j·w·X_v as in PowerSimulationsDynamics.jl; Wang et al. 2015, DOI 10.1109/TPEL.2014.2382565"
_LARGEST = 2.0  # of R_v and X_v [pu]: ten times of what is usual


@dataclass(frozen=True)
class VirtualImpedance:
    """Resistance and reactance at rated frequency [pu, S_n]."""

    R_v: Expr
    X_v: Expr

    @property
    def rated(self) -> Phasor:
        """The impedance at rated frequency [pu, S_n]."""
        return Phasor(self.R_v, self.X_v)

    def drop(self, w: Expr, i_g: Phasor) -> Phasor:
        """Voltage over it [pu, S_n] while the current [pu, S_n] turns with the frequency w [pu]."""
        return Phasor(self.R_v, w * self.X_v) * i_g


def declare_virtual_impedance(m: ModelBuilder) -> VirtualImpedance:
    """Declare both parameters; with 0, the default, the converter has none."""
    with m.scope("virtual_impedance"):
        R_v, X_v = (
            m.parameter(
                name,
                0.0,
                "pu",
                f"Virtual {what} between the droops' voltage and the capacitor",
                base="S_n",
                minimum=0.0,
                maximum=_LARGEST,
                source=_FORM,
            )
            for name, what in (("R_v", "resistance"), ("X_v", "reactance"))
        )
    return VirtualImpedance(R_v, X_v)


def declare_inductive_voltage(
    m: ModelBuilder, Z: VirtualImpedance, omega_b: Expr, slope: Phasor
) -> Phasor:
    """Return X_v/ω_b·di_g/dt [pu, S_n] if the virtual impedance is dynamic, and otherwise 0.

    Parameters
    ----------
    m
        The converter's model.
    Z
        The virtual impedance.
    omega_b
        Base angular frequency [rad/s].
    slope
        Derivative of the current, by the feed-forward's lag [pu/s, S_n].
    """
    with m.scope("virtual_impedance"):
        dynamic = m.switch(
            "dynamic",
            False,
            "Adds X_v/ω_b·di_g/dt, a real inductance's, with the feed-forward's lag",
        )
    factor = if_else(dynamic, Z.X_v / omega_b, 0.0)
    return slope * factor
