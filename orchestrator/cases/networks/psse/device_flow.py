"""The solved state of a PSS/E file's devices: what they feed together with the AC network.

DC lines feed by the voltages at their buses, and others hold a voltage with what reactive power that takes within their
limits. Our network has a load in the place of each end, with the powers of this solution."""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fmus.grid.network import Load
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine, inner_buses
from orchestrator.cases.flow.connected import connected_parts
from orchestrator.cases.flow.equations import FlowEquations
from orchestrator.cases.flow.newton import solve, solve_from
from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.conversion import ImportedNetwork
from orchestrator.cases.networks.imported_flow import flow_lines, imported_equations
from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice
from orchestrator.core.errors import InputError

_ROUNDS = 100
_ACCURATE = 1e-7  # change of a power between two rounds [pu, 100 MVA] at the end
_NEAR = 1e-2  # the same from which limits are looked at [pu, 100 MVA]
_STEP = 1e-5  # of a voltage for the derivative of a power by it [pu]
_CLOSE = 1e-6  # part of a limit or a voltage by which one may be exceeded
_MOST_RELEASES = 3  # of one limit


@dataclass(frozen=True)
class SolvedDevices:
    """Loads in the place of devices, what these feed in words, and what is unusual in them, each with its device.

    ``standing``: the loads by their devices; ``voltages``: of the solution [pu], by the buses' numbers."""

    loads: tuple[Load, ...] = ()
    words: tuple[tuple[HeldDevice, str], ...] = ()
    doubts: tuple[tuple[HeldDevice, str], ...] = ()
    standing: tuple[tuple[HeldDevice, tuple[Load, ...]], ...] = ()
    voltages: Mapping[int, complex] = field(default_factory=dict)

    def loads_without(self, modelled: Collection[HeldDevice]) -> Iterator[Load]:
        """Yield the loads of all devices but those with a model of their own."""
        for device, loads in self.standing:
            yield from () if device in modelled else loads

    def words_of(self, section: str, line: int) -> str:
        """Return what the devices of a section feed whose records stand in a line; in RAWX there may be several."""
        own = (text for x, text in self.words if (x.section, x.line) == (section, line))
        return "; ".join(own)


def solved_devices(
    devices: Sequence[HeldDevice], network: ImportedNetwork, stated: Mapping[int, complex]
) -> SolvedDevices:
    """Solve devices and network together.

    ``network``: its buses are named ``bus_<number>``; ``stated``: the file's voltages [pu] by number.

    Raises an `InputError` where a device cannot feed what its record says, or the file does not tell it."""
    if not devices:
        return SolvedDevices()
    doubts: list[tuple[HeldDevice, str]] = []
    solution = _Solution.of(devices, network, stated)
    state = solution.state()
    if state is None:
        state = solution.at_the_files_voltages()
        text = (
            "the power flow with DC lines, FACTS devices and the like has no solution: they feed what they do at the "
            f"file's voltages, and what holds a voltage feeds no reactive power; {_remedy(devices, network, stated)}"
        )
        doubts.append((devices[0], text))
    loads: list[Load] = []
    words, of_devices, seen, standing = [], [], Counter[str](), set(network.buses)
    for device in devices:
        own = [ending for ending in state.endings if ending.device is device]
        count = len(loads)
        for ending in (x for x in own if f"bus_{x.bus}" in standing):
            seen[ending.name] += 1
            name = ending.name if seen[ending.name] == 1 else f"{ending.name}_{seen[ending.name]}"
            loads.append(Load(name, f"bus_{ending.bus}", -ending.fed.real, -ending.fed.imag))
        of_devices.append((device, tuple(loads[count:])))
        words.append((device, _in_words(device, own)))
        doubts += [(device, text) for text in device.doubts(state.voltages)]
        doubts += [(device, ending.doubt) for ending in own if ending.doubt]
    return SolvedDevices(
        tuple(loads), tuple(words), tuple(doubts), tuple(of_devices), state.voltages
    )


def _remedy(
    devices: Sequence[HeldDevice], network: ImportedNetwork, stated: Mapping[int, complex]
) -> str:
    """Return without which kinds of devices the power flow has a solution."""
    kinds = list(dict.fromkeys(device.section for device in devices))
    for gone in dict.fromkeys([*((kind,) for kind in kinds), tuple(kinds)]):
        rest = [device for device in devices if device.section not in gone]
        if _has_solution(rest, network, stated):
            return (
                f"without {' and '.join(gone)} it has one: look at what these records feed and draw, or let them go: "
                f"write {without_kinds(gone)}"
            )
    return "it has none without them either: look at the rest of the network first"


def _has_solution(
    devices: Sequence[HeldDevice], network: ImportedNetwork, stated: Mapping[int, complex]
) -> bool:
    if not devices:
        return solve(_equations(network)).converged
    return _Solution.of(devices, network, stated).state() is not None


def _in_words(device: HeldDevice, endings: Sequence["_Fed"]) -> str:
    """Return what a device feeds and draws, such as ``feeds 98.7 MW and draws 26.3 Mvar at bus 8``."""
    parts = []
    for ending in endings:
        p, q = ending.fed.real, ending.fed.imag
        active, reactive = ("feeds" if power >= 0 else "draws" for power in (p, q))
        second = "" if reactive == active else f"{reactive} "
        text = f"{active} {abs(p):.4g} MW and {second}{abs(q):.4g} Mvar"
        parts.append(f"{text} at bus {ending.bus}")
    return f"{device.name or device.section}: {', '.join(parts)}"


@dataclass(frozen=True, slots=True)
class _Fed:
    """Power that one end of a device feeds in the solution [MW, Mvar]."""

    device: HeldDevice
    name: str
    bus: int
    fed: complex
    doubt: str = ""


@dataclass(frozen=True, slots=True)
class _State:
    voltages: Mapping[int, complex]
    endings: tuple[_Fed, ...]


@dataclass
class _Limit:
    """A limit at which a voltage is no longer held: reactive power [Mvar], and on which side."""

    most: bool
    releases: int = 0
    acts: bool = True


class _Solution:
    """The network's equations and the devices in it, with the limits that act."""

    def __init__(
        self,
        devices: Sequence[HeldDevice],
        equations: FlowEquations,
        stated: Mapping[int, complex],
        machines: frozenset[int],
    ) -> None:
        self._devices, self._equations = devices, equations
        self._stated, self._machines = stated, machines
        self._place = {
            int(bus.removeprefix("bus_")): k
            for k, bus in enumerate(equations.buses)
            if bus.removeprefix("bus_").isdigit()
        }
        self._limits: dict[int, _Limit] = {}

    @classmethod
    def of(
        cls,
        devices: Sequence[HeldDevice],
        network: ImportedNetwork,
        stated: Mapping[int, complex],
    ) -> "_Solution":
        equations = _equations(network)
        machines = frozenset(int(bus.removeprefix("bus_")) for bus in network.generation)
        return cls(devices, equations, stated, machines)

    def state(self) -> _State | None:
        """Return the common solution; None where none is found."""
        if not self._equations.held[self._equations.slack]:
            return None
        voltages = dict(self._stated)
        start: NDArray[np.complex128] | None = None
        before = np.full(len(self._endings(voltages)), np.inf, dtype=complex)
        for _ in range(_ROUNDS):
            endings = self._endings(voltages)
            equations = self._with(endings, voltages)
            found = solve(equations) if start is None else solve_from(equations, start)
            if not found.converged:
                return None
            start = found.voltages
            for bus, k in self._place.items():
                voltages[bus] = complex(start[k])
            fed = self._fed(endings, equations, start)
            now = np.array([x.fed for x in fed])
            moved = float(np.abs(now - before).max())
            is_near = moved <= _NEAR * SYSTEM_BASE_MVA
            switched = is_near and self._switch(endings, fed, voltages)
            if not switched and moved <= _ACCURATE * SYSTEM_BASE_MVA:
                return _State(voltages, tuple(fed))
            before = now
        return None

    def at_the_files_voltages(self) -> _State:
        """Return what the devices feed at the file's voltages."""
        endings = self._endings(self._stated)
        fed = tuple(_Fed(d, e.name, e.bus, e.fed) for d, e in endings)
        return _State(self._stated, fed)

    def _endings(self, voltages: Mapping[int, complex]) -> list[tuple[HeldDevice, DeviceEnd]]:
        found = []
        for device in self._devices:
            for ending in device.endings(voltages):
                known = (
                    replace(ending, fed=self._balance(device, ending))
                    if ending.is_unknown
                    else ending
                )
                found.append((device, known))
        return found

    def _balance(self, device: HeldDevice, ending: DeviceEnd) -> complex:
        """Return what the file's solution lacks at a bus [MW, Mvar], which the only device there must feed.

        Raises an `InputError` if the file is not solved, or something else may feed it as well."""
        others = [
            other
            for other in self._devices
            if other is not device and any(x.bus == ending.bus for x in other.endings(self._stated))
        ]
        is_solved = any(v.imag for v in self._stated.values())
        if not is_solved or others or ending.bus in self._machines or ending.bus not in self._place:
            raise InputError(
                f"line {device.line}: the file does not hold what the {device.section.upper()} device {device.name!r} "
                f"feeds at bus {ending.bus}: only its solution tells it, and "
                + ("something else stands there" if is_solved else "the file is not solved")
                + f"; write {without_kinds([device.section])}, and put what it feeds or draws into loads"
            )
        voltages = np.array(
            [self._stated.get(self._number(bus), 1 + 0j) for bus in self._equations.buses]
        )
        return complex(SYSTEM_BASE_MVA * self._equations.missing(voltages)[self._place[ending.bus]])

    @staticmethod
    def _number(bus: str) -> int:
        number = bus.removeprefix("bus_")
        return int(number) if number.isdigit() else -1

    def _is_held(self, ending: DeviceEnd) -> bool:
        """Return whether an end holds its bus' voltage: no machine does, and no limit acts."""
        limit = self._limits.get(ending.bus)
        return (
            ending.hold is not None
            and ending.bus not in self._machines
            and ending.bus in self._place
            and not (limit and limit.acts)
        )

    def _limited(self, ending: DeviceEnd) -> float:
        """Return the reactive power of an end at its limit [Mvar]; 0 where none acts."""
        limit = self._limits.get(ending.bus)
        if ending.hold is None or limit is None or not limit.acts or ending.bus in self._machines:
            return 0.0
        return ending.hold.most_mvar if limit.most else ending.hold.least_mvar

    def _with(
        self, endings: Sequence[tuple[HeldDevice, DeviceEnd]], voltages: Mapping[int, complex]
    ) -> FlowEquations:
        """Return the equations with what the devices feed, linear about these voltages."""
        equations = self._equations
        fed = equations.fed.copy()
        held = equations.held.copy()
        magnitudes = equations.magnitudes.copy()
        current = equations.drawn_as_current.copy()
        for device, ending in endings:
            k = self._place.get(ending.bus)
            if k is None:
                continue
            slope = 0j if ending.is_unknown else _slope(device, ending, voltages) / SYSTEM_BASE_MVA
            fed[k] += (ending.fed + 1j * self._limited(ending)) / SYSTEM_BASE_MVA
            fed[k] -= slope * abs(voltages[ending.bus])
            current[k] -= slope
            if self._is_held(ending) and ending.hold is not None:
                held[k], magnitudes[k] = True, ending.hold.v_pu
        return replace(
            equations, fed=fed, held=held, magnitudes=magnitudes, drawn_as_current=current
        )

    def _fed(
        self,
        endings: Sequence[tuple[HeldDevice, DeviceEnd]],
        equations: FlowEquations,
        voltages: NDArray[np.complex128],
    ) -> list[_Fed]:
        """Return what each end feeds; several that hold one voltage share its reactive power equally."""
        lacking = SYSTEM_BASE_MVA * equations.missing(voltages).imag
        holding = Counter(ending.bus for _, ending in endings if self._is_held(ending))
        found = []
        for device, ending in endings:
            doubt = ""
            q = self._limited(ending)
            if self._is_held(ending):
                q = float(lacking[self._place[ending.bus]]) / holding[ending.bus]
            elif q:
                doubt = "a voltage that it cannot hold within its limits of reactive power: it feeds the limit"
            elif ending.hold is not None and ending.bus in self._machines:
                doubt = "it holds the voltage of a bus with machines, which do so here: it feeds no reactive power"
            fed = ending.fed + 1j * q
            found.append(_Fed(device, ending.name, ending.bus, fed, doubt))
        return found

    def _switch(
        self,
        endings: Sequence[tuple[HeldDevice, DeviceEnd]],
        fed: Sequence[_Fed],
        voltages: Mapping[int, complex],
    ) -> bool:
        """Let limits act that are exceeded, and release those behind which the voltage would be held again."""
        switched = False
        for (_, ending), state in zip(endings, fed, strict=True):
            if ending.hold is None or ending.bus in self._machines:
                continue
            limit = self._limits.get(ending.bus)
            if limit is not None and limit.acts:
                apart = abs(voltages[ending.bus]) - ending.hold.v_pu
                if (apart if limit.most else -apart) > _CLOSE and limit.releases < _MOST_RELEASES:
                    limit.acts = False
                    switched = True
                    limit.releases += 1
                continue
            q = (state.fed - ending.fed).imag
            room = _CLOSE * max(1.0, abs(q))
            if q > ending.hold.most_mvar + room or q < ending.hold.least_mvar - room:
                is_most = q > ending.hold.most_mvar
                releases = limit.releases if limit else 0
                self._limits[ending.bus] = _Limit(is_most, releases)
                switched = True
        return switched


def _slope(device: HeldDevice, ending: DeviceEnd, voltages: Mapping[int, complex]) -> complex:
    """Return the derivative of what an end feeds by its own voltage's magnitude [MW, Mvar per pu]."""
    v = voltages[ending.bus]
    moved = {**voltages, ending.bus: v * (1 + _STEP / abs(v))}
    here, there = device.endings(voltages), device.endings(moved)
    return (there[here.index(ending)].fed - ending.fed) / _STEP


def _equations(network: ImportedNetwork) -> FlowEquations:
    """Return the equations of the part of a network in which its slack is."""
    inner = [bus for x in network.transformers for bus in inner_buses(x)]
    buses = [*network.buses, *inner]
    slack = network.slack or max(
        network.generation, key=lambda bus: network.generation[bus].p_mw, default=buses[0]
    )
    reached = _reached(buses, flow_lines(network), slack)
    held = {bus: g.v_pu for bus, g in network.generation.items()}
    return imported_equations(network, [bus for bus in buses if bus in reached], held, slack)


def _reached(buses: Sequence[str], lines: Sequence[FlowLine], slack: str) -> set[str]:
    """Return the buses to which a way leads from the slack."""
    part = connected_parts(buses, [(line.from_bus, line.to_bus) for line in lines])
    return {bus for bus in buses if part[bus] == part[slack]}
