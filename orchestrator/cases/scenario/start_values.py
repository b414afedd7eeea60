"""Start values of every component, from a power flow with the values that are set."""

import cmath
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from fmus.grid.network import OPEN_CHARGING, Line, Network, Shunt, ThreeWinding
from fmus.toolchain.port_variables import (
    LARGEST_POWER,
    LARGEST_POWER_ON_BASE,
    SYSTEM_BASE_MVA,
)
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt, inner_buses, legs_of
from orchestrator.cases.flow.limits import Limits
from orchestrator.cases.flow.power_flow import FlowUnit, PowerFlow, solve_power_flow
from orchestrator.cases.flow.sharing import Dispatch, Room, shared_flow
from orchestrator.cases.form.remedies import KEEPING_LIMITS
from orchestrator.cases.networks.controls import Control, solve_with_controls
from orchestrator.cases.networks.load_models import FlowLaws
from orchestrator.cases.scenario.flow_units import flow_unit
from orchestrator.core.errors import ErrorKind, InputError, few
from orchestrator.systems.coupling.system import ComponentPlan, System

# lower limits of the power of governors without losses
_LEAST_POWER = ("governor.V_MIN", "governor.P_MIN")
# such a limit of a unit that is out of service [pu]: not at its edge while it turns idle
_IDLE = -0.1
_SHOWN = 8  # further units beyond what they can be asked for that one error names


@dataclass(frozen=True)
class FollowingLoad:
    """How a load follows the voltage in the power flow, and the voltage [pu] at which it draws what is set."""

    laws: FlowLaws
    reference: float


def start_from_power_flow(
    system: System,
    network: Network,
    grid: str,
    units: Mapping[str, str],
    slack: str,
    limits: Mapping[str, tuple[float, float]] | None = None,
    *,
    keep_limits: bool = False,
    returning: Collection[str] = (),
    dispatch: Dispatch | None = None,
    active: Mapping[str, tuple[float, float]] | None = None,
    following: Mapping[str, FollowingLoad] | None = None,
    ratings: Mapping[str, float] | None = None,
    controls: Sequence[Control] = (),
) -> PowerFlow:
    """Solve the power flow and set the start values of the grid and of all units.

    Lines, loads and units have the values that are set in the system. Every override therefore moves the operating
    point as well. A unit whose ``Q_0`` is set feeds it; every other holds its ``v_0``.

    ``limits``: least and most reactive power of all units of a bus together [Mvar], by bus. Where some of them are
    disconnected, the limits shrink with the rating.
    ``returning``: units that an event connects; a limit of theirs must stay.
    ``active``: least and most active power of units that share [MW], beside their models' own limits.
    ``following``: loads that follow the voltage, by name; they are set to what they draw in the solution.
    ``controls``: taps and shunts that move until voltages are in their bands; the grid gets their positions.
    ``ratings``: likely ratings [MVA] of units whose S_n is only the base of their data; they may feed more than twice
    S_n."""
    loads = _loads(network, system.components[grid], following or {})
    feeding = [
        _unit(name, bus, system.components[name], system.components[grid])
        for name, bus in units.items()
    ]

    def solve(fed: Sequence[FlowUnit]) -> PowerFlow:
        return solve_power_flow(
            (*network.buses, *(bus for x in network.transformers for bus in inner_buses(x))),
            [*_lines(network, system.components[grid]), *_legs(network, system.components[grid])],
            loads=[*loads.values()],
            units=fed,
            slack_bus=slack,
            shunts=_shunts(network, system.components[grid]),
            limits=_limits(limits or {}, fed),
            keep_limits=keep_limits,
        )

    def find() -> PowerFlow:
        if dispatch is None:
            return solve(feeding)
        plans = system.components
        above = {n: mva for n, mva in (ratings or {}).items() if mva > plans[n].number("S_n")}
        room = Room(active or {}, above, {name: load.p_mw for name, load in loads.items()})
        return shared_flow(solve, feeding, plans, slack, dispatch, room)

    flow = solve_with_controls(
        find, system.components[grid], _acting(controls, feeding, system, grid)
    )
    for bus, voltage in ((bus, flow.voltages[bus]) for bus in network.buses):
        system.components[grid].parameters |= {
            f"{bus}.v_0": abs(voltage),
            f"{bus}.theta_0": cmath.phase(voltage),
        }
    _set_following(system.components[grid], loads, flow.voltages)
    excesses: dict[str, _Excess] = {}
    for name, bus in units.items():
        most = LARGEST_POWER_ON_BASE if name in (ratings or {}) else LARGEST_POWER
        excess = _start_unit(system.components[name], flow.voltages[bus], flow.powers[name], most)
        excesses |= {name: excess} if excess else {}
    _refuse(excesses, keep_limits=keep_limits)
    for name in (
        unit.name for unit in feeding if not unit.connected and unit.name not in returning
    ):
        _let_idle(system.components[name])
    return flow


def _acting(
    controls: Sequence[Control], units: Sequence[FlowUnit], system: System, grid: str
) -> list[Control]:
    """Return the controls in service whose bus no unit holds."""
    held = {unit.bus for unit in units if unit.connected and unit.Q_0 is None}
    return [
        x
        for x in controls
        if x.bus not in held and is_connected(system.components[grid], f"{x.element}.connected")
    ]


def _lines(network: Network, grid: ComponentPlan) -> list[FlowLine]:
    return [_flow_line(line, grid) for line in network.lines]


def _flow_line(line: Line, grid: ComponentPlan) -> FlowLine:
    """A line with the values that the grid has now; it declares none that the network leaves out."""

    def number(quantity: str, otherwise: float, *, declared: object = True) -> float:
        return grid.number(line.variable(quantity)) if declared else otherwise

    return FlowLine(
        line.name,
        line.from_bus,
        line.to_bus,
        R=number("R", 0.0),
        X=number("X", 0.0) - number("X_C", 0.0, declared=line.X_C),
        B=number("B", 0.0, declared=line.B),
        tap=number("tap", 1.0, declared=line.has_ratio),
        shift=number("shift", 0.0, declared=line.has_ratio),
        closed=all(is_connected(grid, switch) for switch in _switches(line)),
    )


def _switches(line: Line) -> tuple[str, ...]:
    """Switches that all have to be closed for a line to carry a current from end to end."""
    ends = ("from_connected", "to_connected") if line.has_ends else ()
    return tuple(line.variable(name) for name in ("connected", *ends))


def _charged_lines(network: Network, grid: ComponentPlan) -> list[FlowShunt]:
    """Return what lines that are open at one end draw at the other, beside the charging that open lines keep."""
    found = []
    for line in (line for line in network.lines if line.has_ends and line.B):
        whole, one, other = (is_connected(grid, switch) for switch in _switches(line))
        if not whole or one == other:
            continue
        jb = 0.5j * grid.number(line.variable("B")) * (1 - OPEN_CHARGING)
        X = grid.number(line.variable("X")) - (
            grid.number(line.variable("X_C")) if line.X_C else 0.0
        )
        z = complex(grid.number(line.variable("R")), X)
        square = grid.number(line.variable("tap")) ** 2 if line.has_ratio and one else 1.0
        y = (jb + 1 / (z + 1 / jb)) / square
        found.append(FlowShunt(line.from_bus if one else line.to_bus, g=y.real, b=y.imag))
    return found


def _legs(network: Network, grid: ComponentPlan) -> list[FlowLine]:
    """Legs of the transformers with three windings, as they are set."""
    return [
        leg
        for transformer in network.transformers
        for leg in legs_of(
            _as_set(transformer, grid), closed=is_connected(grid, f"{transformer.name}.connected")
        )
    ]


def _as_set(x: ThreeWinding, grid: ComponentPlan) -> ThreeWinding:
    def values(
        quantity: str, given: tuple[float, float, float] | None = None
    ) -> tuple[float, float, float]:
        """Return the values of the three windings; those of a ratio are parameters only where there is one."""
        one, two, three = (
            grid.number(f"{x.name}.{quantity}_{k + 1}")
            if given is None or x.has_ratio(k)
            else given[k]
            for k in range(3)
        )
        return one, two, three

    return replace(
        x, X=values("X"), R=values("R"), tap=values("tap", x.tap), shift=values("shift", x.shift)
    )


def _loads(
    network: Network, grid: ComponentPlan, following: Mapping[str, FollowingLoad]
) -> dict[str, FlowLoad]:
    """The loads by name, as they are set."""
    loads = {}
    for load in network.loads:
        scale = grid.number(f"{load.name}.scale")
        p_mw = scale * grid.number(f"{load.name}.P")
        q_mvar = scale * grid.number(f"{load.name}.Q") if load.q_mvar else 0.0
        loads[load.name] = FlowLoad(load.bus, p_mw, q_mvar)
        own = following.get(load.name)
        if own is not None:
            loads[load.name] = FlowLoad(
                load.bus, p_mw, q_mvar, own.laws.active, own.laws.reactive, own.reference
            )
    return loads


def _set_following(
    grid: ComponentPlan, loads: Mapping[str, FlowLoad], voltages: Mapping[str, complex]
) -> None:
    """Set loads that follow the voltage to what they draw in the solution."""
    for name, load in loads.items():
        scale = grid.number(f"{name}.scale")
        if not load.follows or not scale:
            continue
        drawn = load.drawn(abs(voltages[load.bus])) / scale
        grid.parameters[f"{name}.P"] = drawn.real
        if load.q_mvar:
            grid.parameters[f"{name}.Q"] = drawn.imag


def _shunts(network: Network, grid: ComponentPlan) -> list[FlowShunt]:
    shunts = []
    for shunt in network.shunts:
        closed = not shunt.switched or is_connected(grid, f"{shunt.name}.connected")
        g = grid.number(f"{shunt.name}.G") / SYSTEM_BASE_MVA * closed if shunt.g_mw else 0.0
        b = _susceptance(shunt, grid, closed) if shunt.b_mvar else 0.0
        shunts.append(FlowShunt(shunt.bus, g=g, b=b))
    stray = [bus for bus in network.buses if network.needs_stray(bus)]
    shunts += _charged_lines(network, grid)
    return shunts + [FlowShunt(bus, g=0.0, b=grid.number("stray_B"), stray=True) for bus in stray]


def _susceptance(shunt: Shunt, grid: ComponentPlan, closed: bool) -> float:
    """Return the susceptance of a shunt [pu, 100 MVA]; of an open capacitor the part that the grid model keeps."""
    rest = OPEN_CHARGING if shunt.b_mvar > 0 else 0.0
    return grid.number(f"{shunt.name}.B") / SYSTEM_BASE_MVA * (1.0 if closed else rest)


def _unit(name: str, bus: str, plan: ComponentPlan, grid: ComponentPlan) -> FlowUnit:
    connected = is_connected(plan, "connected") and is_connected(grid, f"{name}.connected")
    return flow_unit(name, bus, plan, connected=connected)


def _limits(limits: Mapping[str, tuple[float, float]], units: Sequence[FlowUnit]) -> Limits:
    """The limits of the units that are connected [pu, 100 MVA]."""
    found = {}
    for bus, both in limits.items():
        whole = sum(u.S_n for u in units if u.bus == bus)
        feeding = sum(u.S_n for u in units if u.bus == bus and u.connected)
        if feeding:
            least, most = (q * feeding / whole / SYSTEM_BASE_MVA for q in both)
            found[bus] = (least, most)
    return found


def is_connected(plan: ComponentPlan, switch: str) -> bool:
    """Return whether a component's breaker is closed; an FMU without a breaker counts as connected."""
    state = plan.value(switch) if switch in plan.description.variables else None
    return state is None or bool(state)


def _let_idle(plan: ComponentPlan) -> None:
    """Let a unit that stays out of service turn idle, though its governor's lower limit is 0: it feeds nothing."""
    for limit in _LEAST_POWER:
        least = plan.value(limit) if limit in plan.description.variables else None
        if least is not None and float(least) >= 0:
            plan.parameters[limit] = _IDLE


@dataclass(frozen=True)
class _Excess:
    """A power at the start [pu of its rating] beyond what a unit can be asked for."""

    variable: str
    value: float
    most: float


def _start_unit(
    plan: ComponentPlan, voltage: complex, power: complex, usual: float
) -> _Excess | None:
    """Give a unit its start, or return what it cannot be asked for."""
    start = {
        "P_0": power.real,
        "Q_0": power.imag,
        "v_0": abs(voltage),
        "theta_0": cmath.phase(voltage),
    }
    for variable in ("P_0", "Q_0"):
        declared = plan.description.variables[variable].maximum
        most = math.inf if declared is None else min(declared, usual)
        if abs(start[variable]) > most:
            return _Excess(variable, start[variable], most)
    plan.parameters |= start
    return None


def _refuse(excesses: Mapping[str, _Excess], *, keep_limits: bool) -> None:
    """Refuse units that cannot be asked for what the power flow gives them, all together.

    ``keep_limits``: whether limits of reactive power are kept, which is then no remedy."""
    if not excesses:
        return
    (name, one), *others = excesses.items()
    is_remedy = one.variable == "Q_0" and not keep_limits
    kept = f", or keep its limits: {KEEPING_LIMITS}" * is_remedy
    text = (
        f"{name} would have to feed {one.variable} = {one.value:.4g} pu of its rating, more than {one.most:g}; "
        f"raise its S_n, or move load and generation{kept}"
    )
    if others:
        told = [f"{unit} ({x.variable} = {x.value:.4g})" for unit, x in others]
        text += f"; so would {few(told, _SHOWN)}"
    raise InputError(text, kind=ErrorKind.START)
