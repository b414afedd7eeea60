"""The negative- and the zero-sequence network of a scenario, with what its events have switched until then.

Lines, transformers and shunts are those of the power flow; in the negative sequence they have the impedances of the
positive one. Loads are impedances there at the voltage of the power flow, and have no path to earth. Capacitors have
none either. What no file and no key says is taken by a default, and every default that counted is kept for a
question."""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from fmus.grid.element_data import Line
from fmus.grid.network import Network
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.draft import Draft
from orchestrator.cases.events.zero_sequence_transformers import (
    add_transformer,
    has_delta_at_network,
    unit_side,
    usual_leg,
    usual_transformer,
)
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.flow.induction_impedances import negative_admittance
from orchestrator.cases.flow.power_flow import PowerFlow
from orchestrator.cases.flow.sequence_impedances import SequenceNetwork
from orchestrator.cases.flow.source_impedances import (
    external_impedance,
    machine_base,
    machine_impedance,
    transformer_impedance,
)
from orchestrator.cases.form.schema import SequencesTable
from orchestrator.cases.networks import sequence_data as usual
from orchestrator.cases.networks.sequence_data import (
    DELTA,
    EARTHED,
    SequenceData,
    ZeroLine,
    windings_of,
)
from orchestrator.cases.networks.transformer_kinds import is_known_transformer
from orchestrator.systems.coupling.system import ComponentPlan

FAULT = "the fault's place"
"""Bus of a sequence network at a fault along a line, or at the end of a line that is away from its own bus."""


@dataclass(frozen=True)
class Changed:
    """The line of a fault or an open pole: it is split at a part of the way, or its series impedance is open, or one of
    its ends, ``"from"`` or ``"to"``, is away from its bus."""

    line: str = ""
    at: float | None = None
    end: str | None = None


@dataclass
class SequenceAssembly:
    """Both networks, and which elements had to be taken by a default, by the key of the case that says otherwise."""

    draft: Draft
    flow: PowerFlow
    values: Mapping[str, object]
    changed: Changed = Changed()
    assumed: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    read: set[str] = field(default_factory=set)  # kinds of elements of which the file has data
    # step-up transformers whose delta is at the network's side, by their file
    turned: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        network = self.draft.network
        assert network is not None
        self.network: Network = network
        table = self.draft.given.case.network
        self.table = table.sequences if table else SequencesTable()
        self.data = (self.draft.data.sequences if self.draft.data else None) or SequenceData()
        buses = [*self.flow.voltages]
        if self.changed.at is not None or self.changed.end is not None:
            buses.append(FAULT)
        self.negative, self.zero = SequenceNetwork(buses), SequenceNetwork([*buses])
        self._lines = {line.name: line for line in network.lines}
        for branch in self.flow.lines:
            self._add_branch(self._as_left(branch))
        self._couple()
        self._add_loads_and_shunts()
        for port in network.ports:
            plan = self.draft.system.components.get(port.name)
            if plan is not None and self._holds(f"{port.name}.connected"):
                self._add_unit(port.name, port.bus, plan)

    def series(self, name: str) -> tuple[complex, complex]:
        """Return the series impedances of a line in both sequences [pu, 100 MVA]."""
        branch = next(x for x in self.flow.lines if x.name == name)
        return self._impedance(branch), self._zero_line(branch, self._lines[name]).z

    def _as_left(self, branch: FlowLine) -> FlowLine:
        """Return a branch with the end that is away from its bus at a bus of its own."""
        if branch.name != self.changed.line or self.changed.end is None:
            return branch
        if self.changed.end == "from":
            return replace(branch, from_bus=FAULT)
        return replace(branch, to_bus=FAULT)

    def _holds(self, switch: str) -> bool:
        return bool(self.values.get(switch, True))

    def _impedance(self, branch: FlowLine) -> complex:
        """Return R + jX of a branch; an event may have changed them."""
        line = self._lines.get(branch.name)
        R, X = branch.R, branch.X
        if line is not None:
            R = _number(self.values.get(line.variable("R")), R)
            X = _number(self.values.get(line.variable("X")), X + line.X_C) - line.X_C
        return complex(R, X)

    def _add_branch(self, branch: FlowLine) -> None:
        line = self._lines.get(branch.name)
        if line is None:
            self._add_leg(branch)
            return
        if not self._holds(line.variable("connected")):
            return
        closed = tuple(self._holds(line.variable(f"{end}_connected")) for end in ("from", "to"))
        z, ratio = self._impedance(branch), branch.tap * _turn(-branch.shift)
        self._add_line(self.negative, branch, z, branch.B, closed, ratio)
        known = self.data.branches.get(line.name)
        if known is not None:
            self.read.add("transformers")
            if has_delta_at_network(self.network, line, known):
                self.turned.append(line.name)
        elif self._is_transformer(line):
            known, missing = usual_transformer(self.network, line, z, self.table)
            if missing:
                self._assume(missing, line.name)
        if known is not None:
            add_transformer(self.zero, branch, known)
            return
        zero = self._zero_line(branch, line)
        self._add_line(self.zero, branch, zero.z, zero.b, closed, 1.0)
        for bus, y in ((branch.from_bus, zero.y_from), (branch.to_bus, zero.y_to)):
            self.zero.add_shunt(bus, y)

    def _add_line(
        self,
        network: SequenceNetwork,
        branch: FlowLine,
        z: complex,
        B: float,
        closed: tuple[bool, ...],
        ratio: complex,
    ) -> None:
        """Add a π section, or what of it is still joined to a bus."""
        half = 0.5j * B
        is_changed = branch.name == self.changed.line and self.changed.end is None
        if is_changed and self.changed.at is not None:
            self._add_split(network, branch, z, half, closed, ratio)
            return
        ends = (branch.from_bus, abs(ratio) ** 2), (branch.to_bus, 1.0)
        for (bus, square), own, far in zip(ends, closed, reversed(closed), strict=True):
            if not own:
                continue
            network.add_shunt(bus, half / square)
            if not far and half:
                network.add_shunt(bus, 1 / (z + 1 / half) / square)
        if not all(closed) or is_changed:
            return
        network.add_series(branch.from_bus, branch.to_bus, z, ratio)

    def _add_split(
        self,
        network: SequenceNetwork,
        branch: FlowLine,
        z: complex,
        half: complex,
        closed: tuple[bool, ...],
        ratio: complex,
    ) -> None:
        """Add both parts of a line with a fault along it, each a π section, or what of it the fault alone feeds.

        ``half``: the charging of one end of the whole line. A line that is open at both ends is away."""
        at = self.changed.at or 0.0
        ends = (branch.from_bus, ratio), (branch.to_bus, 1.0)
        if not any(closed):
            return
        for (bus, own_ratio), part, own in zip(ends, (at, 1 - at), closed, strict=True):
            part_z, part_half = part * z, part * half
            network.add_shunt(FAULT, part_half)
            if own:
                network.add_shunt(bus, part_half / abs(own_ratio) ** 2)
                network.add_series(bus, FAULT, part_z, own_ratio)
            elif half:
                network.add_shunt(FAULT, 1 / (part_z + 1 / part_half))

    def _zero_line(self, branch: FlowLine, line: Line) -> ZeroLine:
        known = self.data.lines.get(line.name)
        if known is not None:
            self.read.add("lines")
            return known
        by_z, by_b = self.table.line_z0, self.table.line_b0
        if by_z is None:
            self._assume("line_z0", line.name)
        return ZeroLine(
            (by_z or usual.LINE_Z0) * complex(branch.R, branch.X),
            (usual.LINE_B0 if by_b is None else by_b) * branch.B,
        )

    def _is_transformer(self, line: Line) -> bool:
        """Return whether a branch is a transformer: by its file, by the case, or by a ratio or a unit at its end."""
        of_file = self.data.transformers
        if is_known_transformer(line, of_file, self.table.groups) or of_file is not None:
            return is_known_transformer(line, of_file, self.table.groups)
        return not line.B and unit_side(self.network, line) is not None

    def _add_leg(self, branch: FlowLine) -> None:
        """Add a leg of a transformer with three windings that is an element of its own."""
        owner, _, leg = branch.name.partition(".leg_")
        if not self._holds(f"{owner}.connected"):
            return
        z, ratio = complex(branch.R, branch.X), branch.tap * _turn(-branch.shift)
        self.negative.add_series(branch.from_bus, branch.to_bus, z, ratio)
        bus, star = branch.from_bus.removeprefix("bus_"), owner.removeprefix("transformer_")
        known = self.data.branches.get(f"line_{bus}_{star}")
        if known is None and leg.isdigit():
            known, missing = usual_leg(owner, int(leg), z, self.table)
            if missing:
                self._assume(missing, owner)
        if known is None:  # the part of a leg that carries its ratio
            self.zero.add_series(branch.from_bus, branch.to_bus, z, branch.tap)
            return
        if branch.name in self.data.branches:
            self.read.add("transformers")
        add_transformer(self.zero, branch, known)

    def _couple(self) -> None:
        """Add the mutual impedances between lines that are whole."""
        whole = {
            line.name
            for line in self.network.lines
            if line.name != self.changed.line
            and self._holds(line.variable("connected"))
            and all(self._holds(line.variable(f"{end}_connected")) for end in ("from", "to"))
        }
        pairs = {pair: z for pair, z in self.data.mutuals.items() if set(pair) <= whole}
        lines = {name: self._lines[name] for pair in pairs for name in pair}
        own = {name: self.series(name)[1] for name in lines}
        ends = {name: (line.from_bus, line.to_bus) for name, line in lines.items()}
        self.zero.couple(ends, own, pairs)

    def _add_loads_and_shunts(self) -> None:
        for load in self.network.loads:
            if load.bus in self.data.negative or load.p_mw < 0:
                continue
            P = _number(self.values.get(f"{load.name}.P"), load.p_mw)
            Q = _number(self.values.get(f"{load.name}.Q"), load.q_mvar) if load.q_mvar else 0.0
            scale = _number(self.values.get(f"{load.name}.scale"), 1.0)
            square = abs(self.flow.voltages[load.bus]) ** 2
            self.negative.add_to_earth(load.bus, scale * complex(P, -Q) / SYSTEM_BASE_MVA / square)
        for shunt in self.network.shunts:
            if self._holds(f"{shunt.name}.connected"):
                y = complex(
                    _number(self.values.get(f"{shunt.name}.G"), shunt.g_mw),
                    _number(self.values.get(f"{shunt.name}.B"), shunt.b_mvar),
                )
                self.negative.add_to_earth(shunt.bus, y / SYSTEM_BASE_MVA)
        for known, network in (
            (self.data.negative, self.negative),
            (self.data.zero, self.zero),
        ):
            for bus in (bus for bus in known if bus in self.flow.voltages):
                network.add_shunt(bus, known[bus])

    def _add_unit(self, name: str, bus: str, plan: ComponentPlan) -> None:
        external = external_impedance(plan)
        machine = machine_impedance(plan)
        power, voltage = self.flow.powers.get(name, 0j), abs(self.flow.voltages[bus])
        induction = negative_admittance(plan, -power, voltage)
        if machine is not None:
            self._add_machine(name, bus, plan, machine)
        elif induction is not None:
            self._add_induction_machine(name, bus, plan, induction)
        elif external is not None:
            self.negative.add_to_earth(bus, 1 / external)
            if self.table.external_z0 is None:
                self._assume("external_z0", name)
            self.zero.add_to_earth(
                bus, 1 / (external * (self.table.external_z0 or usual.EXTERNAL_Z0))
            )
        elif self.table.converter_x2 is None:
            self._assume("converter_x2", name)
        else:
            rating = plan.number("S_n") if "S_n" in plan.description.variables else 0.0
            self.negative.add_to_earth(
                bus, rating / SYSTEM_BASE_MVA / (1j * self.table.converter_x2)
            )

    def _add_machine(self, name: str, bus: str, plan: ComponentPlan, machine: complex) -> None:
        known, base = self.data.machines.get(name), SYSTEM_BASE_MVA / machine_base(plan)
        transformer = transformer_impedance(plan)
        if known is not None and known.negative:
            negative = base * known.negative
            self.read.add("machines")
        else:
            if self.table.machine_x2 is None:
                self._assume("machine_x2", name)
            by = self.table.machine_x2 or usual.MACHINE_X2
            negative = complex(machine.real, by * machine.imag)
        self.negative.add_to_earth(bus, 1 / (negative + transformer))
        if transformer:
            if self.table.step_up is None:
                self._assume("step_up", name)
            if windings_of(self.table.step_up or usual.STEP_UP)[:2] == (EARTHED, DELTA):
                self.zero.add_to_earth(bus, 1 / transformer)
            return
        if known is not None and known.zero is not None:
            self.zero.add_to_earth(bus, 1 / (base * known.zero))
        elif known is None and self.table.machine_x0 is not None:
            self.zero.add_to_earth(bus, 1 / (1j * base * self.table.machine_x0))
        elif known is None:
            self._assume("machine_x0", name)

    def _add_induction_machine(
        self, name: str, bus: str, plan: ComponentPlan, own: complex
    ) -> None:
        """Add a motor or a generator; what the file has in its place stands for it. Its neutral is not earthed."""
        known = self.data.machines.get(name)
        if known is not None and known.negative:
            own = plan.number("S_n") / SYSTEM_BASE_MVA / known.negative
            self.read.add("machines")
        elif plan.description.kind == "load" and bus in self.data.negative:
            return
        self.negative.add_to_earth(bus, own)
        if known is not None and known.zero is not None:
            self.zero.add_to_earth(bus, plan.number("S_n") / SYSTEM_BASE_MVA / known.zero)

    def _assume(self, key: str, name: str) -> None:
        if name not in self.assumed[key]:
            self.assumed[key].append(name)


def _number(value: object, otherwise: float) -> float:
    return float(value) if isinstance(value, int | float) else otherwise


def _turn(angle: float) -> complex:
    """Return e^{j·angle} of an angle [rad]."""
    return complex(math.cos(angle), math.sin(angle))
