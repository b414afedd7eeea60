"""GAST2A: a gas turbine with a governor, a temperature control and a fuel system.

    reference − (w − 1) → W·(1+sX)/(Z+sY), within MIN and MAX → lower of this and temperature control → times w
    → K_3 → delay T → + K_6 − K_f·fuel → a/(c+sb) → 1/(1+sT_f) = fuel → delay E_CR = burnt
    P_m = w·f_2 of burnt through 1/(1+sT_CD),    f_2 = a_f2 + b_f2·flow − c_f2·(w − 1)
    f_1 of burnt after the delay E_TD = T_R − a_f1·(1 − flow) − b_f1·(w − 1)
    f_1 → K_4 + K_5/(1+sT_3) → 1/(1+sT_4) = temperature
    T_C − temperature → (1+sT_5)/(sT_t) = temperature control, at most MAX

Z = 1 is a governor with a droop 1/W, Z = 0 one that holds the speed. Powers are on T_rate, or on S_n where that is 0.
The temperature control's integral stays at the governor's output while the temperature is below T_C, so that it takes
over at once, as PSS/E's does. Delays are Padé's of second order.

Source: OPAL-RT's modelica-ephasor-components at 6dc8ca5."""

from fmus.synchronous_generator.data_lines import Given, declared, number, power, seconds
from fmus.synchronous_generator.turbines.curves import share_of_rating
from fmus.synchronous_generator.turbines.governors import (
    LONGEST_DELAY,
    SOURCE,
    power_reference,
    require_within,
)
from fmus.synchronous_generator.variants import Shaft
from fmus.toolchain.blocks import (
    RETURN_TIME,
    clamp,
    low_pass,
    low_pass_or_nothing,
    second_order,
)
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, fabs, fmin, if_else, logic_and, logic_or

GAST2A = (
    number("W", 25.0, "Gain of the governor", 1e-3),
    seconds("X", 0.0, "Governor, lead"),
    seconds("Y", 0.05, "Governor, lag", 1e-3),
    number("Z", 1.0, "Governor: 1 with a droop, 0 holds the speed", 0),
    seconds("E_TD", 0.04, "Delay of the exhaust; 0 leaves it out"),
    seconds("T_CD", 0.2, "Turbine; 0 leaves its lag out"),
    number("T_rate", 0.0, "Rating of the turbine; 0: S_n", 0, "MVA"),
    seconds("T", 0.0, "Delay of the fuel's control; 0 leaves it out"),
    power("MAX", 1.5, "Highest fuel that is asked for"),
    power("MIN", -0.1, "Lowest fuel that is asked for"),
    seconds("E_CR", 0.01, "Delay of the combustion; 0 leaves it out"),
    number("K_3", 0.77, "Gain of the fuel's control", 1e-3),
    number("a", 1.0, "Valve positioner, gain", 1e-3),
    seconds("b", 0.05, "Valve positioner, integral", 1e-3),
    number("c", 1.0, "Valve positioner: 1 is a lag, 0 an integral", 0),
    seconds("T_f", 0.4, "Fuel system", 1e-3),
    number("K_f", 0.0, "Feedback of the fuel", 0),
    number("K_5", 0.2, "Radiation shield, part behind the lag", 0),
    number("K_4", 0.8, "Radiation shield, direct part", 0),
    seconds("T_3", 15.0, "Radiation shield", 1e-3),
    seconds("T_4", 2.5, "Thermocouple; 0 leaves it out"),
    number("T_t", 450.0, "Temperature control, integral: a degree's seconds", 1e-3, "s"),
    seconds("T_5", 3.3, "Temperature control, lead"),
    number("a_f1", 700.0, "Exhaust's temperature by fuel, in degrees"),
    number("b_f1", 550.0, "Exhaust's temperature by speed, in degrees"),
    power("a_f2", -0.3, "Power without fuel"),
    number("b_f2", 1.3, "Power by fuel", 1e-3),
    number("c_f2", 0.5, "Power by speed"),
    number("T_R", 950.0, "Rated temperature of the exhaust, in degrees"),
    power("K_6", 0.23, "Least fuel"),
    number("T_C", 950.0, "Temperature that its control holds, in degrees"),
)


def gast2a(m: ModelBuilder, shaft: Shaft) -> Expr:
    """Declare governor and turbine and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        p = declared(m, GAST2A, SOURCE)
        share, speed = share_of_rating(shaft, p.T_rate), shaft.w - 1
        flow_0 = (shaft.P_m_0 / share - p.a_f2) / p.b_f2
        asked_0 = ((p.c / p.a + p.K_f) * flow_0 - p.K_6) / p.K_3
        require_within(m, asked_0, p.MIN, p.MAX, ("governor.MIN", "governor.MAX"))
        governed = _governor(m, p, shaft.P_m_0 / share, asked_0, speed)
        burnt = m.algebraic("burnt")
        limited = _temperature_control(m, p, burnt, governed, (flow_0, asked_0), speed)
        wanted = p.K_3 * shaft.w * fmin(governed, limited)
        late = _delayed(m, "control", wanted, p.T, p.K_3 * asked_0)
        fuel = m.state("fuel", flow_0, "pu", "Fuel", base="S_n")
        valve = m.state("valve", flow_0, "pu", "Valve", base="S_n")
        m.derivative(valve, (p.a * (late + p.K_6 - p.K_f * fuel) - p.c * valve) / p.b)
        m.derivative(fuel, (valve - fuel) / p.T_f)
        m.close(burnt, _delayed(m, "combustion", fuel, p.E_CR, flow_0))
        flow = low_pass_or_nothing(m, "turbine", burnt, p.T_CD, flow_0)
        return share * shaft.w * (p.a_f2 + p.b_f2 * flow - p.c_f2 * speed)


def _governor(m: ModelBuilder, p: Given, P_0: Expr, asked_0: Expr, speed: Expr) -> Expr:
    """W·(1+sX)/(Z+sY) within its limits, at which its integral stops. A change of power is one of the fuel for it."""
    m.require(0.5 - fabs(p.Z * (p.Z - 1)), "governor.Z must be 1 or 0")
    by_power = p.Z / p.W * (p.c / p.a + p.K_f) / (p.K_3 * p.b_f2)
    moved = power_reference(m, P_0) - P_0
    pushed = p.Z * asked_0 + p.W * (by_power * moved - speed)
    ratio = p.X / p.Y
    x = m.state("governor", (1 - ratio * p.Z) * asked_0, "pu", "Governor", base="S_n")
    free = x + ratio * pushed
    governed = clamp(free, p.MIN, p.MAX)
    rate = (pushed * (1 - ratio * p.Z) - p.Z * x) / p.Y
    outward = logic_or(logic_and(free > governed, rate > 0), logic_and(free < governed, rate < 0))
    m.derivative(x, if_else(outward, 0, rate))
    return governed


def _temperature_control(
    m: ModelBuilder, p: Given, burnt: Expr, governed: Expr, start: tuple[Expr, Expr], speed: Expr
) -> Expr:
    """Fuel that the temperature permits.

    ``burnt``: fuel behind the combustion; ``start``: fuel and what is asked for at the operating point."""
    flow_0, asked_0 = start
    exhaust_0 = p.T_R - p.a_f1 * (1 - flow_0)
    whole_0 = (p.K_4 + p.K_5) * exhaust_0
    m.require(
        p.T_C - whole_0,
        "governor.T_C: at the operating point of the power flow the exhaust is as hot as its control permits, "
        "or hotter; raise T_C or the rating, or lower the generator's active power",
    )
    seen = _delayed(m, "exhaust", burnt, p.E_TD, flow_0)
    exhaust = p.T_R - p.a_f1 * (1 - seen) - p.b_f1 * speed
    shield = low_pass(m, "radiation", exhaust, p.T_3, exhaust_0)
    whole = p.K_4 * exhaust + p.K_5 * shield
    rest = p.T_C - low_pass_or_nothing(m, "thermocouple", whole, p.T_4, whole_0)
    y = m.state("temperature", asked_0, "pu", "Integral of the temperature's control", base="S_n")
    most = fmin(governed, p.MAX)
    held = logic_and(y >= most, rest > 0)
    m.derivative(y, if_else(held, (most - y) / RETURN_TIME, rest / p.T_t))
    return fmin(y + p.T_5 / p.T_t * rest, p.MAX)


def _delayed(m: ModelBuilder, name: str, u: Expr, T: Expr, start: Expr) -> Expr:
    m.require(LONGEST_DELAY - T, f"{T.name()} must be below {LONGEST_DELAY:g} s")
    half, square = T / 2, T**2 / 12
    return start + second_order(m, name, u - start, (half, square), (-half, square))
