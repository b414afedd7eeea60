"""Preparing one operating point with its outage, and what it means where that fails."""

import traceback
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from orchestrator.cases.case import Case
from orchestrator.cases.flow.sharing import Dispatch, SharingRule, in_words, load_of, lost_load
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value
from orchestrator.cases.networks.controls import moves_in_words
from orchestrator.cases.questions.plausibility import overloads
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.service import without_units
from orchestrator.core.errors import CosimError, ErrorKind, InputError, StartError, few
from orchestrator.core.options import Option
from orchestrator.studies.operating_points.item import Item, Status
from orchestrator.studies.operating_points.line_ends import LineEnd, line_of
from orchestrator.studies.operating_points.outages import Remains, what_remains
from orchestrator.studies.operating_points.point_columns import Elements, least_scale
from orchestrator.studies.points.failure import Failure
from orchestrator.systems.coupling.system import System

# largest change of a state over a communication step with which the power flow's point is a steady
# state
ACCEPT = 1e-9

_PACKAGE = Path(__file__).parents[2]

_OPERATING = {"P_0", "Q_0", "v_0", "theta_0", "S_n", "connected"}
"""What a component that refuses others of its values was not given by the power flow."""

_SHOWN = 4

_REGULATOR = {"exciter.delta_V_ref", "exciter.E_fd"}
"""Variables of which a machine with an exciter, its own or one from outside, has one."""

_ASKED_OF_FIELD = (
    0.01  # change of a machine's Q [pu, S_n] from which on its voltage was held for it
)
_HELD_FIELDS = (
    "the new power flow holds the voltages of machines whose field no exciter moves, as a planner's does: it is the "
    "point after somebody has set them, and in a run their fields stay; what the outage itself leaves, a run shows"
)


class IslandingError(InputError):
    """An outage leaves no system."""

    kind = ErrorKind.ISLANDING


@dataclass(frozen=True)
class PreparedItem:
    """The scenario at an item, in words what was lost and who feeds it, "" where nothing is shared, and the buses that
    are cut off."""

    scenario: PreparedScenario
    text: str = ""
    dead: tuple[str, ...] = ()


def with_moving_controls(case: Case) -> Case:
    """Return the case whose taps and switched shunts move in the power flow after an outage.

    Raises an `InputError` if its network is not of PSS/E."""
    network = case.table.network
    if network is None or network.raw is None:
        raise InputError(
            "move_controls ("
            + Option.MOVE_CONTROLS
            + ") is for networks of PSS/E, which [network] has as raw; leave it out"
        )
    moving = network.model_copy(update={"move_controls": True})
    return replace(case, table=case.table.model_copy(update={"network": moving}))


class ItemPreparation:
    def __init__(
        self,
        case: Case,
        scenario: str,
        layers: Sequence[ParameterFile],
        step_size: float | None = None,
        sharing: SharingRule | None = None,
        *,
        move_controls: bool = False,
    ) -> None:
        case = with_moving_controls(case) if move_controls else case
        self._case, self._scenario, self._layers, self._step_size = (
            case,
            scenario,
            tuple(layers),
            step_size,
        )
        self.base = self._prepare({})
        self.elements = Elements.of(self.base)
        self._asked = {str(question) for question in self.base.questions}
        table = case.table.power_flow
        self._sharing = sharing or SharingRule(table.sharing if table else "droop")
        self._before: tuple[int, PreparedScenario] | None = None

    def prepared(self, item: Item, wider: Mapping[str, float] | None = None) -> PreparedItem:
        """The scenario at an item, without the units that are out of service.

        ``wider``: limits of exciters and governors by which the item starts, in the place of the case's own."""
        valued = self._valued(item)
        remains = what_remains(valued, self.elements, item.out)
        if remains.why_none:
            raise IslandingError(remains.why_none)
        own = tuple(name for name in item.out if name not in item.lost)
        without = what_remains(valued, self.elements, own)
        units, loads = ({*getattr(remains, k)} - {*getattr(without, k)} for k in ("units", "loads"))
        dispatch, text, voltages_before = None, "", {}
        if item.lost and (self.base.following_loads or self.base.moving):
            flow_before = self._before_outage(item, own, without).power_flow
            assert flow_before is not None
            voltages_before = flow_before.voltages
        if units or loads:
            before = self._before_outage(item, own, without)
            assert before.power_flow is not None
            fed, drawn = (
                _power_of(units, before),
                load_of(loads, valued.system.components[self.elements.grid]),
            )
            dispatch = Dispatch(self._sharing, before.power_flow.powers, fed - drawn)
        elif new := [bus for bus in remains.dead if bus not in without.dead]:
            text = f"{few(new, _SHOWN)} cut off, with neither load nor unit"
        off = switched_off(item.out, remains, valued, self.elements)
        found = self._prepare({**item.values, **off, **(wider or {})}, dispatch, voltages_before)
        if dispatch is not None:
            assert found.power_flow is not None
            plans, load = (
                valued.system.components,
                load_of(loads, valued.system.components[self.elements.grid]),
            )
            text = in_words(dispatch, found.power_flow.powers, plans, units, lost_load(load))
        if item.lost and self.base.moving:
            text = "; ".join(filter(None, (text, self._moves_text(found))))
        return PreparedItem(without_units(found, remains.units), text, remains.dead)

    def _moves_text(self, found: PreparedScenario) -> str:
        """Return which taps and shunts have moved from where the case has them, and how far."""
        grid = self.elements.grid
        before, now = (x.system.components[grid] for x in (self.base, found))
        moves = moves_in_words(self.base.moving, before, now)
        return few([f"{name} {move}" for name, move in moves.items()], _SHOWN) if moves else ""

    def live(self, item: Item) -> dict[str, Value]:
        """Values by which the case alone is at an item: what is off, and what each unit feeds where others share it.

        Raises as `prepared`."""
        valued = self._valued(item)
        remains = what_remains(valued, self.elements, item.out)
        prepared = self.prepared(item)
        scenario = prepared.scenario
        found = {**item.values, **switched_off(item.out, remains, valued, self.elements)}
        shared = prepared.text or {*item.out, *remains.units} & {*self.elements.units}
        if shared and scenario.power_flow is not None:
            # else the case would share what the item leaves to the slack
            powers = scenario.power_flow.powers
            found |= {
                f"{x}.P_0": powers[x].real for x in scenario.system.components if powers.get(x)
            }
        if item.lost:
            found |= self._as_followed(scenario)
            plan = scenario.system.components[self.elements.grid]
            found |= {f"{self.elements.grid}.{x}": plan.number(x) for x in scenario.moving}
        return found

    def _as_followed(self, scenario: PreparedScenario) -> dict[str, Value]:
        """Return what loads draw that have followed the voltage after an outage [MW, Mvar]."""
        grid = self.elements.grid
        plan = scenario.system.components[grid]
        return {
            f"{grid}.{load}.{power}": plan.number(f"{load}.{power}")
            for load in scenario.following_loads
            for power in ("P", "Q")
            if f"{load}.{power}" in plan.parameters
        }

    def _before_outage(
        self, item: Item, own: tuple[str, ...], without: Remains
    ) -> PreparedScenario:
        """The item's operating point before its outage; that of the last item serves all of one point."""
        if self._before is None or self._before[0] != item.point:
            off = switched_off(own, without, self._valued(item), self.elements)
            self._before = item.point, self._prepare({**item.values, **off})
        return self._before[1]

    def warnings(self, prepared: PreparedScenario) -> tuple[str, ...]:
        """Questions that the scenario without the item's values does not raise."""
        return tuple(
            str(question) for question in prepared.questions if str(question) not in self._asked
        )

    def warnings_of_rating(
        self, prepared: PreparedScenario, units: Collection[str]
    ) -> tuple[str, ...]:
        """Those of the warnings that ask whether the rating of one of these units is meant."""
        rated = {f"{name}.S_n" for name in units}
        asked = {str(q) for q in prepared.questions if q.topic and rated & set(q.topic.variables)}
        return tuple(text for text in self.warnings(prepared) if text in asked)

    def overloads(self, prepared: PreparedScenario) -> dict[str, float]:
        """Units beyond their rating [pu of it], and further than without the item's values."""
        meant = self._case.table.meant
        before = overloads(self.base.system.components, meant, self.base.base_ratings)
        found = overloads(prepared.system.components, meant, prepared.base_ratings)
        return {name: load for name, load in found.items() if load > before.get(name, 0.0) + 0.01}

    def reactive(self, prepared: PreparedScenario) -> str:
        """The bus whose units are furthest beyond their limits of reactive power, and within without the values."""
        limits = self._case.table.power_flow and self._case.table.power_flow.reactive_limits
        before, now = (
            (x.power_flow.beyond_limits if x.power_flow else ()) for x in (self.base, prepared)
        )
        already = {one.bus for one in before}
        found = [] if limits is False else [x for x in now if x.bus not in already]
        return found[0].text(kept=False) if found else ""  # the furthest come first

    def held_fields(self, prepared: PreparedScenario) -> tuple[str, ...]:
        """A sentence where the new power flow asks constant fields of machines for another reactive power."""
        before, now = self.base.power_flow, prepared.power_flow
        if before is None or now is None:
            return ()
        constant = [
            name
            for name, plan in prepared.system.components.items()
            if plan.kind == "machine" and not _REGULATOR & set(plan.description.variables)
        ]
        asked = any(
            abs(now.powers[name].imag - before.powers[name].imag) > _ASKED_OF_FIELD
            for name in constant
            if name in before.powers and name in now.powers
        )
        return (_HELD_FIELDS,) if asked else ()

    def _prepare(
        self,
        values: Mapping[str, Value],
        dispatch: Dispatch | None = None,
        voltages_before: Mapping[str, complex] | None = None,
    ) -> PreparedScenario:
        # what a point has out of service is in its generation
        case = replace(self._case, sharing=SharingRule.SLACK)
        (prepared,) = case.prepare(
            [self._scenario],
            dict(values),
            self._step_size,
            None,
            self._layers,
            dispatch=dispatch,
            voltages_before=voltages_before or {},
        )
        return prepared

    def _valued(self, item: Item) -> PreparedScenario:
        """The base scenario with the item's own values in the grid, for what is said of islands."""
        grid = self.elements.grid
        plan = self.base.system.components[grid]
        own = {
            k.partition(".")[2]: v
            for k, v in item.values.items()
            if k.startswith(f"{grid}.") and "*" not in k
        }
        numbers = {name: value for name, value in own.items() if not isinstance(value, str)}
        system = System()
        system.components.update(self.base.system.components)
        system.connections.extend(self.base.system.connections)
        system.components[grid] = replace(plan, parameters=plan.parameters | numbers)
        return replace(self.base, system=system)


def _power_of(units: Collection[str], before: PreparedScenario) -> float:
    flow, plans = before.power_flow, before.system.components
    return (
        sum(flow.powers[name].real * plans[name].number("S_n") for name in units)
        if flow is not None
        else 0.0
    )


def failure(error: Exception, item: Item) -> tuple[Status, Failure]:
    """Return what becomes of an item that ends with an error, and the error as it is kept."""
    found = Failure.of(error)
    if not isinstance(error, (CosimError, np.linalg.LinAlgError)):
        return Status.INTERNAL, replace(found, text=unexpected(error))
    status = Status.of(found)
    if isinstance(error, StartError) and status is Status.STEADY_STATE:
        given = {
            key.partition(".")[2] for key in item.values if key.partition(".")[0] == error.component
        }
        status = Status.VALUES if given - _OPERATING else status
    return status, found


def unexpected(error: Exception) -> str:
    """An error that is no user's mistake, with its place in our code, in words."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [frame for frame in frames if frame.filename.startswith(str(_PACKAGE))]
    at = (
        f" at {Path(ours[-1].filename).relative_to(_PACKAGE)}, line {ours[-1].lineno}"
        if ours
        else ""
    )
    blame = (
        ""
        if isinstance(error, (MemoryError, OSError))
        else "; gfor-cosim has failed here: please report it"
    )
    return f"{type(error).__name__}{at}: {error}{blame}"


# part of its charging that a dead line keeps: a bus without any has no voltage
_DEAD_CHARGING = 1e-3


def switched_off(
    out: Sequence[str], remains: Remains, prepared: PreparedScenario, elements: Elements
) -> dict[str, Value]:
    """Values that take elements out of service in the power flow and in the grid, with all that is dead then."""
    opened = [
        name
        for name in (*out, *remains.units, *remains.shunts)
        if name not in remains.loads and line_of(name) not in remains.ties
    ]
    grid = elements.grid
    values: dict[str, Value] = {f"{grid}.{_switch(name, elements)}": False for name in opened}
    plan = prepared.system.components[grid]
    values |= {f"{grid}.{name}.scale": least_scale(name, plan) for name in remains.loads}
    return values | {
        f"{grid}.{name}": _DEAD_CHARGING * plan.number(name) for name in remains.charging
    }


def _switch(element: str, elements: Elements) -> str:
    end = LineEnd.of(element)
    return f"{element}.connected" if end is None else end.switch(elements)
