"""A cut through a running system: some devices against all that is left, from the linear models of its components."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse.csgraph

from orchestrator.cases.scenario.facts import rated_frequency
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Complex, Matrix
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.linear.models.device_start import misfits_of, sentences
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, continuous
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.stability import judge, whole_spectrum
from orchestrator.studies.immittance.sides import Behind, Exact, Rows, Sampled, Together, Unit
from orchestrator.studies.modes.modes import running
from orchestrator.systems.coupling.master import Master

_PORT = ("v_re", "v_im"), ("i_re", "i_im")
# relative difference between two devices' currents for the network, which are perturbed one by one
_ALIKE = 1e-6


@dataclass(frozen=True)
class Cut:
    """Both sides at a cut [pu on the system base], and the verdict of the closed system's own modes."""

    devices: tuple[str, ...]
    # device, network: admittance of the devices, with currents into them, and impedance of the rest at their buses.
    device: Exact | Together | Sampled
    network: Exact | Behind
    modes_stable: bool | None
    # voltages, currents: at the operating point, by device; currents out of it.
    voltages: dict[str, complex]
    currents: dict[str, complex]
    rated_hz: float | None  # None where no component has one
    warnings: tuple[str, ...]
    # of the closed system [rad/s]; empty where it is too large for all of them
    eigenvalues: Complex
    bus: str  # where the devices stand; "" where at several
    ports: tuple[tuple[str, tuple[str, ...]], ...]  # bus and devices of each pair of rows
    units: tuple[Unit, ...]  # that the device side is made of


def cut_of(prepared: PreparedScenario, bus: str | None, names: tuple[str, ...]) -> Cut:
    with running(prepared) as master:
        said = sentences(misfits_of(master))
        homes = buses_of(master)
        devices = _devices(homes, bus, names)
        find_operating_point(master)
        blocks = Blocks(master, without_step=True)
        silent = [d for d, c in blocks.components.items() if c.A_c is None]
        if silent:
            raise InputError(
                f"component {silent[0]!r} gives no derivatives; scan its FMU and give that in its place"
            )
        model = continuous(blocks)
        spectrum = whole_spectrum(model)
        opened = _Opened(blocks, model, tuple(homes))
        values = dict(zip(master.output_names, master.y.tolist(), strict=True))
        fed = {str(c.target): str(c.source) for c in master.system.connections}
        voltages = {d: complex(*(values[fed[f"{d}.{v}"]] for v in _PORT[0])) for d in devices}
        currents = {d: complex(*(values[f"{d}.{i}"] for i in _PORT[1])) for d in devices}
    device, network, units, ports = opened.sides(devices)
    places, found = {homes[name] for name in devices}, np.zeros(0, dtype=complex)
    named_ports = tuple((homes[at[0]], at) for at in ports)
    return Cut(
        devices,
        device,
        network=network,
        modes_stable=judge(model, spectrum).stable,
        voltages=voltages,
        currents=currents,
        rated_hz=rated_frequency(prepared),
        warnings=said,
        eigenvalues=spectrum.eigenvalues if spectrum else found,
        bus=places.pop() if len(places) == 1 else "",
        ports=named_ports,
        units=units,
    )


def buses_of(master: Master) -> dict[str, str]:
    """Bus of every component that has our port: the scope of the voltages that feed it."""
    fed = {str(c.target): str(c.source) for c in master.system.connections}
    return {
        name: fed[f"{name}.v_re"].rpartition(".")[0]
        for name, e in master.exchanges.items()
        if set(_PORT[0]) <= set(e.inputs.names) and set(_PORT[1]) <= set(e.outputs.names)
    }


def _devices(homes: dict[str, str], bus: str | None, names: tuple[str, ...]) -> tuple[str, ...]:
    if not homes:
        raise InputError(
            "the case has no device that takes a voltage (v_re, v_im) and gives a "
            "current (i_re, i_im); phasor models have another port: cut its EMT models, "
            "such as by " + Option.SET + " models=emt"
        )
    unknown = [name for name in names if name not in homes]
    if unknown:
        raise InputError(
            Option.COMPONENT
            + f" {unknown[0]}: it is no device with a voltage and a current in this "
            "scenario (" + Option.SCENARIO + f" chooses another); there are: {', '.join(homes)}"
        )
    if bus is None:
        return names or tuple(homes)
    wanted = [one.strip() for one in bus.split(",")]
    for one in wanted:
        if not any(one in (home, home.rpartition(".")[2]) for home in homes.values()):
            raise InputError(
                Option.BUS + f" {one}: no device stands there; devices stand at "
                f"{', '.join(sorted(set(homes.values())))}"
            )
    found = tuple(
        name for name, home in homes.items() if {home, home.rpartition(".")[2]} & set(wanted)
    )
    return tuple(name for name in found if not names or name in names)


class _Opened:
    """The closed model with all devices' voltages and currents given: it falls apart into the network and the units."""

    def __init__(self, blocks: Blocks, model: LinearModel, devices: tuple[str, ...]) -> None:
        place = {full: k for k, full in enumerate(blocks.output_names)}
        self._matrices = [M.toarray() for M in (model.F, model.G, model.H, model.K)]
        inputs = {d: [blocks.components[d].inputs.index(v) for v in _PORT[0]] for d in devices}
        read = [int(blocks.sources[d][k]) for d in devices for k in inputs[d]]
        self._given = [place[f"{d}.{i}"] for d in devices for i in _PORT[1]]
        self._devices, self._read = devices, read
        self.A, self.B, self.C, self.D = self._open([*read, *self._given])
        self._v = {d: 2 * k + np.arange(2) for k, d in enumerate(devices)}
        self._i = {d: rows + len(read) for d, rows in self._v.items()}
        self._ports: list[list[str]] = []
        for d in devices:
            at = next((at for at in self._ports if self._is_alike(d, at[0])), None)
            self._ports.append([d]) if at is None else at.append(d)
        self._units = self._separate()

    def _open(self, rows: list[int]) -> list[Matrix]:
        """A, B, C and D from some outputs that are given to those that are computed in their place."""
        F, G, H, K = self._matrices
        H_0, K_0 = H.copy(), K.copy()
        H_0[rows] = 0.0
        K_0[rows] = 0.0
        whole = np.linalg.inv(np.eye(len(K)) - K_0)
        through = K[rows] @ whole
        return [
            F + G @ whole @ H_0,
            (G @ whole)[:, rows],
            H[rows] + through @ H_0,
            through[:, rows],
        ]

    def _is_alike(self, one: str, other: str) -> bool:
        """Return whether two devices see one voltage, and the network takes their currents alike."""
        a, b = (
            np.concatenate([self.B[:, self._i[d]], self.D[:, self._i[d]]]) for d in (one, other)
        )
        seen = [[self._read[k] for k in self._v[d]] for d in (one, other)]
        return seen[0] == seen[1] and bool(np.abs(a - b).max() <= _ALIKE * np.abs(a).max())

    def _separate(self) -> list[tuple[tuple[str, ...], Rows]]:
        """Devices and states of each unit: what hangs together without the voltages and currents at the buses."""
        n, p = self.B.shape
        # voltages come first; what they reach is joined by the currents that it gives
        half = p // 2
        # states, what is given, what is computed in its place
        joined = np.zeros((n + 2 * p, n + 2 * p), dtype=bool)
        joined[:n, :n], joined[:n, n + half : n + p] = self.A != 0, self.B[:, half:] != 0
        joined[n + p :, :n], joined[n + p :, n + half : n + p] = self.C != 0, self.D[:, half:] != 0
        for d in self._devices:
            joined[np.ix_(n + p + self._i[d], n + p + self._i[d])] = True
        _, label = scipy.sparse.csgraph.connected_components(joined, directed=False)
        network = set(label[n + half : n + p].tolist()) | set(label[n + p : n + p + half].tolist())
        found: dict[int, list[str]] = {}
        for d in self._devices:
            found.setdefault(int(label[n + p + self._i[d][0]]), []).append(d)
        units = [(one, tuple(ds), np.flatnonzero(label[:n] == one)) for one, ds in found.items()]
        for one, ds, states in units:
            own = {self._read[k] for d in ds for k in self._v[d]}
            others = np.array([k for k in range(half) if self._read[k] not in own], dtype=np.int64)
            currents = np.concatenate([self._i[d] for d in ds])
            if (
                one in network
                or self.B[np.ix_(states, others)].any()
                or self.D[np.ix_(currents, others)].any()
            ):
                raise InputError(
                    f"no cut separates {', '.join(ds)} from the network: other signals than voltage and current "
                    "at its bus connect them, such as a remote measurement; `gfor modes` judges such a case"
                )
        return [(ds, states) for _, ds, states in units]

    def sides(
        self, devices: tuple[str, ...]
    ) -> tuple[Any, Any, tuple[Unit, ...], list[tuple[str, ...]]]:
        """Those of a cut at some devices, the units at it, and the devices at each port."""
        own = [unit for unit in self._units if set(unit[0]) & set(devices)]
        left = [d for unit in own for d in unit[0] if d not in devices]
        if left:
            raise InputError(
                f"{', '.join(left)}: other signals connect it to what is cut; cut there, too"
            )
        mine = [k for k, at in enumerate(self._ports) if set(at) & set(devices)]
        states = np.concatenate([kept for _, kept in self._units])
        net = np.setdiff1d(np.arange(len(self.A)), states)
        v, i = (np.concatenate([x[at[0]] for at in self._ports]) for x in (self._v, self._i))
        alone = self._submodel("the network", net, i, self.C[v], self.D[v])
        units = tuple(self._unit(*unit, mine) for unit in own)
        together = Together(", ".join(devices), units, 2 * len(mine))
        at = [tuple(d for d in self._ports[k] if d in devices) for k in mine]
        device = units[0].side if len(units) == len(mine) == 1 else together
        every = list(range(len(self._ports)))
        rest = tuple(
            self._unit(*unit, every) for unit in self._units if not set(unit[0]) & set(devices)
        )
        if not rest:
            return device, alone, units, at
        closed = self._open([self._given[k] for d in devices for k in self._v[d]])[0]
        kept = np.setdiff1d(np.arange(len(closed)), np.concatenate([states for _, states in own]))
        others = Together("the others", rest, 2 * len(every))
        poles = np.linalg.eigvals(closed[np.ix_(kept, kept)]).astype(complex)
        return device, Behind("the network", alone, others, _rows(mine), poles), units, at

    def _unit(self, inside: tuple[str, ...], states: Rows, ports: list[int]) -> Unit:
        """Its currents count into it."""
        mine = [k for k, port in enumerate(ports) if set(self._ports[port]) & set(inside)]
        at = [[d for d in self._ports[ports[k]] if d in inside] for k in mine]
        rows = [[self._i[d] for d in devices] for devices in at]
        C = np.concatenate([sum(self.C[i] for i in own) for own in rows])
        D = np.concatenate([sum(self.D[i] for i in own) for own in rows])
        v = np.concatenate([self._v[ds[0]] for ds in at])
        B, D = self.B[np.ix_(states, v)], D[:, v]
        side = Exact(", ".join(inside), self.A[np.ix_(states, states)], B, C[:, states], D)
        return Unit(inside, _rows(mine), side.negated())

    def _submodel(self, name: str, kept: Rows, given: Rows, C: Matrix, D: Matrix) -> Exact:
        """Some of the states; clocks among them say nothing."""
        A, B = self.A[np.ix_(kept, kept)], self.B[np.ix_(kept, given)]
        told = (np.abs(A).sum(axis=1) + np.abs(B).sum(axis=1) > 0) | (np.abs(A).sum(axis=0) > 0)
        return Exact(name, A[np.ix_(told, told)], B[told], C[:, kept[told]], D[:, given])


def _rows(ports: Sequence[int]) -> Rows:
    return (2 * np.array(ports, dtype=np.int64)[:, None] + np.arange(2)).ravel()
