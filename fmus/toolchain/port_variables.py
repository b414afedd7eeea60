"""The variables of a device's port and the system base: names, units, texts and limits as plain data.

Models declare their port from them, and the orchestrator gives a bound foreign FMU the same port. Therefore this module
imports no symbols."""

from fmus.toolchain.variables import Input, Output, Parameter, Usual

# base power of every network: of its powers, currents and admittances in pu
SYSTEM_BASE_MVA = 100.0

SYSTEM_BASE = f"{SYSTEM_BASE_MVA:g} MVA"

V_RE = Input("v_re", "pu", "Bus voltage, real part, network frame", base="bus", start=1.0)
V_IM = Input("v_im", "pu", "Bus voltage, imaginary part, network frame", base="bus")
I_RE = Output("i_re", "pu", "Injected current, real part, network frame", base=SYSTEM_BASE)
I_IM = Output("i_im", "pu", "Injected current, imaginary part, network frame", base=SYSTEM_BASE)
P = Output("p", "pu", "Active power into the bus", base="S_n")
Q = Output("q", "pu", "Reactive power into the bus", base="S_n")

S_N = Parameter(
    "S_n",
    "MVA",
    "Rated apparent power, the device's base",
    minimum=1e-3,
    usual=Usual(0.05, 20_000, "from a distribution converter to a whole area"),
)
"""Each device has its own start value; the same holds for `P_0`."""

# power of a unit at its operating point beyond which its rating is wrong [pu, S_n]
LARGEST_POWER = 2.0
# the same of a machine, whose S_n may be the base of its data alone, as MBASE of PSS/E: 100 MVA for an equivalent of
# 100 GW (the 50-machine system of IEEE has one of 57 GW)
LARGEST_POWER_ON_BASE = 1000.0

P_0 = Parameter(
    "P_0",
    "pu",
    "Power flow: active power into the bus",
    base="S_n",
    minimum=-LARGEST_POWER,
    maximum=LARGEST_POWER,
)
Q_0 = Parameter(
    "Q_0",
    "pu",
    "Power flow: reactive power into the bus",
    base="S_n",
    minimum=-LARGEST_POWER,
    maximum=LARGEST_POWER,
)
V_0 = Parameter(
    "v_0",
    "pu",
    "Power flow: voltage magnitude at the bus",
    base="bus",
    start=1.0,
    minimum=0.1,
    maximum=2.0,
    usual=Usual(0.8, 1.2, "operation within 20 % of the rated voltage"),
)
THETA_0 = Parameter("theta_0", "rad", "Power flow: voltage angle at the bus")

F_N = Parameter(
    "f_n",
    "Hz",
    "Rated frequency",
    start=50.0,
    minimum=1.0,
    maximum=400.0,
    usual=Usual(45, 65, "grids have 50 or 60 Hz"),
)
V_N = Parameter(
    "V_n",
    "kV",
    "Rated voltage at the bus, line to line, rms",
    minimum=1e-3,
    usual=Usual(0.1, 1500, "from low voltage to 1500 kV"),
)

S_BASE = Parameter(
    "S_base", "MVA", "Base power of the network", start=SYSTEM_BASE_MVA, minimum=1e-3
)
"""Parameter of our devices. Coupled devices must leave it at its start value, because networks are in pu of that
base."""

INPUTS = (V_RE, V_IM)
OUTPUTS = (I_RE, I_IM, P, Q)
START_VALUES = (S_N, P_0, Q_0, V_0, THETA_0)
RATED = (S_N, V_N, F_N, V_0)  # with a usual range that holds for every device with such a parameter

_IMPEDANCE = "usual LC filters and transformers of converters"
TRANSFORMER = {
    "transformer.R_t": Usual(0, 0.1, _IMPEDANCE),
    "transformer.X_t": Usual(0.01, 0.6, _IMPEDANCE, or_zero=True),
}
"""Usual ranges of a device's own transformer."""
