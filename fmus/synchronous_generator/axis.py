"""One axis of a synchronous machine: a magnetising reactance with rotor windings beside it, seen through flux linkages.

Per unit on the stator base; the windings' reactances are leakage reactances on that base."""

from dataclasses import dataclass
from functools import reduce
from operator import add

from fmus.toolchain.port import BREAKER_TIME
from fmus.toolchain.symbols import Expr, Scalar


@dataclass(frozen=True)
class Winding:
    """A rotor winding: leakage reactance and resistance [pu], and its flux linkage.

    ``saturation_current`` [pu] is what iron draws beside the winding's own current."""

    X: Expr
    R: Expr
    psi: Expr
    saturation_current: Scalar = 0.0


@dataclass(frozen=True)
class Axis:
    """Magnetising reactance, rotor windings from slow to fast, stator flux, and quantities that follow from them.

    ``X_subtransient`` is the reactance of the air gap with every winding a perfect conductor, ``X_between`` that
    between the emf and the bus. An axis without windings has a ``fixed_emf``."""

    X_m: Expr
    windings: tuple[Winding, ...]
    psi: Expr
    X_subtransient: Expr
    X_between: Expr
    fixed_emf: Expr | None = None

    @property
    def emf(self) -> Expr:
        """Flux behind the subtransient reactance [pu]; current and air-gap flux are linear in it and the stator's."""
        if self.fixed_emf is not None:
            return self.fixed_emf
        return reduce(add, (self._weight(winding) * winding.psi for winding in self.windings))

    @property
    def i(self) -> Expr:
        """Stator current of this axis [pu]."""
        return (self.emf - self.psi) / self.X_between

    @property
    def psi_airgap(self) -> Expr:
        """Flux in the air gap [pu]."""
        return self.emf - self.X_subtransient * self.i

    def current(self, number: int) -> Expr:
        """Current of a rotor winding [pu], counted from the slowest, with what iron draws."""
        winding = self.windings[number]
        return (winding.psi - self.psi_airgap) / winding.X + winding.saturation_current

    def current_rate(self, psi_rate: Expr, rotor_rates: tuple[Expr, ...]) -> Expr:
        """di/dt from the rates of stator flux and windings' fluxes."""
        return (self._emf_rate(rotor_rates) - psi_rate) / self.X_between

    def open_rate(self, rotor_rates: tuple[Expr, ...]) -> Expr:
        """Rate of the stator flux for which di/dt = −i/τ, as behind an open breaker."""
        return self._emf_rate(rotor_rates) + self.X_between * self.i / BREAKER_TIME

    def _weight(self, winding: Winding) -> Expr:
        """Part of a winding's flux in the emf."""
        return self.X_subtransient / winding.X

    def _emf_rate(self, rotor_rates: tuple[Expr, ...]) -> Expr:
        parts = [self._weight(w) * rate for w, rate in zip(self.windings, rotor_rates, strict=True)]
        return reduce(add, parts) if parts else Expr(0)
