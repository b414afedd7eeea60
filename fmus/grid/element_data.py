"""Elements of a network as data."""

from dataclasses import dataclass

from fmus.grid.names import line_variable

SMALLEST_REACTANCE = 1e-5  # smallest reactance of a line [pu, 100 MVA]


@dataclass(frozen=True, slots=True)
class Line:
    """A π section; R, X, B [pu, 100 MVA], B the charging of the whole line.

    ``tap``·e^{j·``shift``} is an ideal ratio at the from side, ``shift`` in rad: MATPOWER's convention, in which
    series impedance and charging lie behind the ratio. ``X_C`` is the reactance of a capacitor in series [pu, 100 MVA].
    ``adjustable``: whether the ratio may move, so that it is a parameter also where it is 1 at first; ``has_ends``:
    whether each end has a breaker of its own; ``has_poles``: whether one phase alone may open at an end;
    ``faulted``: whether there can be a fault along it."""

    name: str
    from_bus: str
    to_bus: str
    X: float
    R: float = 0.0
    B: float = 0.0
    tap: float = 1.0
    shift: float = 0.0
    X_C: float = 0.0
    adjustable: bool = False
    has_ends: bool = False
    has_poles: bool = False
    faulted: bool = False

    @property
    def is_plain(self) -> bool:
        """Return whether it is a series impedance and nothing else between its buses."""
        return not (self.has_ends or self.has_poles or self.faulted)

    @property
    def has_ratio(self) -> bool:
        """Return whether an ideal ratio stands at the from side."""
        return self.adjustable or self.tap != 1.0 or self.shift != 0.0

    def variable(self, quantity: str) -> str:
        """Name of one of its variables in the grid's FMU, such as ``X`` or ``connected``."""
        return line_variable(self.name, quantity)


@dataclass(frozen=True, slots=True)
class Zip:
    """How a power follows the voltage: shares of constant impedance (v²), current (v) and power, which sum to 1."""

    z: float = 0.0
    i: float = 0.0
    p: float = 0.0


# laws of one share only, by name
LAWS = {"impedance": Zip(z=1.0), "current": Zip(i=1.0), "power": Zip(p=1.0)}

IMPEDANCE = LAWS["impedance"]

# default of the voltage [pu] below which a load with a share of constant power is an impedance
LOW_VOLTAGE = 0.7
# least of that voltage [pu]: a constant power draws more than three times its current there
LEAST_LOW_VOLTAGE = 0.3


@dataclass(frozen=True, slots=True)
class Load:
    """A load that draws P + jQ [MW, Mvar] at the power flow's voltage and rated frequency; P < 0 is static generation.

    ``active``, ``reactive``: how P and Q follow the voltage; ``k_pf``, ``k_qf``: change of P and Q [pu of it] by the
    frequency [pu]; ``v_min``: voltage [pu] below which the load is an impedance. None is `LOW_VOLTAGE` where there is a
    share of constant power, else 0: never; ``tau``: lag [s] with which the load follows these laws; None for the
    default of the network's model."""

    name: str
    bus: str
    p_mw: float
    q_mvar: float = 0.0
    active: Zip = IMPEDANCE
    reactive: Zip = IMPEDANCE
    k_pf: float = 0.0
    k_qf: float = 0.0
    v_min: float | None = None
    tau: float | None = None

    @property
    def active_follows(self) -> bool:
        """Return whether P is anything but a constant conductance."""
        return self.p_mw != 0 and (self.active != IMPEDANCE or self.k_pf != 0)

    @property
    def reactive_follows(self) -> bool:
        """Return whether Q is anything but a constant inductor or capacitor."""
        return self.q_mvar != 0 and (self.reactive != IMPEDANCE or self.k_qf != 0)

    @property
    def follows(self) -> bool:
        """Return whether the load is anything but a constant impedance."""
        return self.active_follows or self.reactive_follows

    @property
    def conductance_mw(self) -> float:
        """The part of P that is a conductance at all times; none where the load feeds by a law of its own."""
        return 0.0 if self.active_follows and self.p_mw < 0 else self.p_mw

    @property
    def susceptance_mvar(self) -> float:
        """The part of Q that is an inductor or capacitor at all times; none where the load feeds."""
        return 0.0 if self.reactive_follows and self.p_mw < 0 else self.q_mvar

    @property
    def low_voltage(self) -> float:
        """Voltage [pu] below which it is an impedance; 0 for never."""
        if self.v_min is not None:
            return self.v_min
        return LOW_VOLTAGE if self.active.p or self.reactive.p else 0.0


@dataclass(frozen=True, slots=True)
class Shunt:
    """An admittance to earth, by the power that it draws [MW] and generates [Mvar] at 1 pu; b_mvar < 0 is an
    inductor. A ``switched`` one has a breaker."""

    name: str
    bus: str
    g_mw: float = 0.0
    b_mvar: float = 0.0
    switched: bool = False


@dataclass(frozen=True, slots=True)
class Port:
    """Where one device injects its current."""

    name: str
    bus: str


@dataclass(frozen=True, slots=True)
class ThreeWinding:
    """A three-winding transformer: three windings that meet at a star point which is no bus.

    ``buses``: of windings 1, 2 and 3; ``X``, ``R``: of each winding in the star [pu, 100 MVA]. One X may be negative,
    as long as any two windings together, and all three, have a positive inductance; ``tap``, ``shift``: ideal ratio
    tap·e^{j·shift} [1, rad] between each bus and its winding."""

    name: str
    buses: tuple[str, str, str]
    X: tuple[float, float, float]
    R: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tap: tuple[float, float, float] = (1.0, 1.0, 1.0)
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def is_passive(self) -> bool:
        """Return whether its inductances are those of something that stores energy."""
        a, b, c = self.X
        return a + c > 0 and a * b + b * c + c * a > 0

    def has_ratio(self, winding: int) -> bool:
        """Return whether an ideal ratio stands between a winding and its bus."""
        return self.tap[winding] != 1.0 or self.shift[winding] != 0.0
