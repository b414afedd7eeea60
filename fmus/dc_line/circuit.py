"""The DC circuit: current and voltage that the controls of both ends give.

    rectifier   V_r = V_i + R·I;  it holds the order I_o with α ≥ α_min, so V_r ≤ V_0r·cos α_min − R_cr·I
    inverter    V_i ≤ V_o − R_comp·I (its order) and V_i ≤ V_0i·cos γ_min − R_ci·I

Where α_min does not drive I_o, the inverter lowers its voltage so that (1 − Δ)·I_o flows. Where neither controls the
current, it is between both, where the ends' voltages meet. Voltages are not below 0.

Source: P. Kundur, "Power System Stability and Control" (1994), section 10.3; MDC, DELTI, RCOMP as PSS/E's files have
them."""

from dataclasses import dataclass

from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and


@dataclass(frozen=True)
class Far:
    """Signals of an inverter about itself.

    ``most_kv``: DC voltage at its least angle without a current; ``drop``: of commutation [ohm]; ``v``: voltage of its
    bus [pu]; ``beyond``: by how much its voltage may exceed its order [kV]: 0, or much where it holds its angle."""

    most_kv: Expr
    drop: Expr
    v: Expr
    beyond: Expr


@dataclass(frozen=True)
class Orders:
    """Orders of the current [kA], and of the inverter's voltage at no current [kV]."""

    current: Expr
    kilovolts: Expr


@dataclass(frozen=True)
class Flow:
    """Current [kA] and inverter's voltage [kV]; ``left``: what its order and the rectifier leave for it at most [kV].

    The voltage is the lesser of that and what the inverter's least angle gives, of which its own station decides: so
    the least angle acts there at once."""

    current: Expr
    kilovolts: Expr
    left: Expr


@dataclass(frozen=True)
class Circuit:
    """Resistance of the line, compounding [ohm], and margin of the current [1]."""

    ohm: Expr
    compounding: Expr
    margin: Expr

    def solve(self, most_kv: Expr, drop: Expr, far: Far, orders: Orders) -> Flow:
        """Return what flows.

        ``most_kv``, ``drop``: of the rectifier at its least angle, as of the inverter."""

        def at_inverter(current: Scalar) -> tuple[Expr, Expr]:
            by_angle = far.most_kv - far.drop * current
            return by_angle, orders.kilovolts - self.compounding * current

        def rest_at(current: Scalar) -> Expr:
            """Return the voltage [kV] that the rectifier's least angle leaves for the inverter."""
            return most_kv - (drop + self.ohm) * current

        whole, reduced = orders.current, (1 - self.margin) * orders.current
        part = Expr(0)
        for at_whole, at_reduced in zip(at_inverter(whole), at_inverter(reduced), strict=True):
            above, below = at_whole - rest_at(whole), at_reduced - rest_at(reduced)
            within = logic_and(above > 0, below < 0)
            meets = -below / if_else(within, above - below, 1)
            part = fmax(part, if_else(above <= 0, 1, if_else(within, meets, 0)))
        current = reduced + part * (whole - reduced)
        current = fmax(fmin(current, most_kv / (drop + self.ohm)), 0)
        by_angle, ordered = at_inverter(current)
        rest = fmax(fmin(ordered, rest_at(current)), 0)
        return Flow(current, fmax(fmin(by_angle, rest), 0), rest)
