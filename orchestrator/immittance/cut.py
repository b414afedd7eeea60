"""A cut through a running system: some devices against all that is left, from the linear models of its components."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.analysis.device_start import misfits_of, sentences
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.linearization import Blocks, continuous
from orchestrator.analysis.stability import judge, whole_spectrum
from orchestrator.analysis.steady_state import find_operating_point
from orchestrator.arrays import Complex, Matrix
from orchestrator.cases.facts import rated_frequency
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.master import Master
from orchestrator.errors import InputError
from orchestrator.immittance.sides import Exact
from orchestrator.immittance.together import Behind, Rows, SideBySide, Unit
from orchestrator.study.modes import running

_PORT = ("v_re", "v_im"), ("i_re", "i_im")
_NOTHING = 1e-9  # size of a coupling that is none
_ALIKE = 1e-6  # relative difference between two devices' currents for the network, which are perturbed one by one


@dataclass(frozen=True)
class Cut:
    """Both sides at a cut [pu on the system base], and the verdict of the closed system's own modes."""

    devices: tuple[str, ...]
    # device, network: admittance of the devices, with currents into them, and impedance of the rest at their buses.
    device: Exact | SideBySide
    network: Exact | Behind
    modes_stable: bool | None
    # voltages, currents: at the operating point, by device; currents out of it.
    voltages: dict[str, complex]
    currents: dict[str, complex]
    rated_hz: float | None  # None where no component has one
    warnings: tuple[str, ...]
    eigenvalues: Complex  # of the closed system [rad/s]; empty where it is too large for all of them
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
        if silent := [d for d, c in blocks.components.items() if c.A_c is None]:
            raise InputError(f"component {silent[0]!r} gives no derivatives; scan its FMU and give that in its place")
        model = continuous(blocks)
        spectrum = whole_spectrum(model)
        opened = _Opened(blocks, model, tuple(homes))
        values = dict(zip(master.output_names, master.y.tolist(), strict=True))
        fed = {str(c.target): str(c.source) for c in master.system.connections}
        voltages = {d: complex(*(values[fed[f"{d}.{v}"]] for v in _PORT[0])) for d in devices}
        currents = {d: complex(*(values[f"{d}.{i}"] for i in _PORT[1])) for d in devices}
    device, network, units, ports = opened.sides(devices)
    places, found = {homes[name] for name in devices}, np.zeros(0, dtype=complex)
    return Cut(devices, device, network, judge(model, spectrum).stable, voltages, currents, rated_frequency(prepared),
               said, spectrum.eigenvalues if spectrum else found, places.pop() if len(places) == 1 else "",
               tuple((homes[at[0]], at) for at in ports), units)  # fmt: skip


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
            "the case has no device that takes a voltage (v_re, v_im) and gives a current (i_re, i_im); phasor models "
            "have another port: cut its EMT models, such as by --set models=emt"
        )
    if unknown := [name for name in names if name not in homes]:
        raise InputError(
            f"--component {unknown[0]}: it is no device with a voltage and a current in this scenario (--scenario "
            f"chooses another); there are: {', '.join(homes)}"
        )
    if bus is None:
        return names or tuple(homes)
    wanted = [one.strip() for one in bus.split(",")]
    for one in wanted:
        if not any(one in (home, home.rpartition(".")[2]) for home in homes.values()):
            raise InputError(
                f"--bus {one}: no device stands there; devices stand at {', '.join(sorted(set(homes.values())))}"
            )
    found = tuple(name for name, home in homes.items() if {home, home.rpartition(".")[2]} & set(wanted))
    return tuple(name for name in found if not names or name in names)


class _Opened:
    """The closed model, to be opened between devices and all else.

    With the devices' currents given, the network stands alone; with their voltages given, the devices do."""

    def __init__(self, blocks: Blocks, model: LinearModel, devices: tuple[str, ...]) -> None:
        self._names = {full: k for k, full in enumerate(blocks.output_names)}
        self._matrices = [M.toarray() for M in (model.F, model.G, model.H, model.K)]
        self._read = {
            d: np.array([int(blocks.sources[d][blocks.components[d].inputs.index(v)]) for v in _PORT[0]])
            for d in devices
        }
        self._given = {d: np.array([self._names[f"{d}.{i}"] for i in _PORT[1]]) for d in devices}
        self._clusters = _clusters(blocks, self._read)
        windows = blocks.state_windows()
        states = np.arange(len(model.names))
        self._states = {
            cluster: np.concatenate([states[windows[name]] for name in cluster]) for cluster in self._clusters
        }

    def sides(
        self, devices: tuple[str, ...]
    ) -> tuple[Exact | SideBySide, Exact | Behind, tuple[Unit, ...], list[tuple[str, ...]]]:
        """Those of a cut at some devices, the units at it, and the devices at each port."""
        self._check(devices)
        ports = self._ports()
        mine = [k for k, at in enumerate(ports) if set(at) & set(devices)]
        net, alone = self._network(ports)
        own = [c for c in self._clusters if set(c) & set(devices)]
        chosen = tuple(self._unit(cluster, [ports[k] for k in mine], net) for cluster in own)
        at = [tuple(d for d in ports[k] if d in devices) for k in mine]
        together = SideBySide(", ".join(devices), chosen, 2 * len(mine))
        one = chosen[0].side if len(chosen) == 1 else together
        device = one if isinstance(one, Exact) and len(mine) == 1 else together
        rest = tuple(self._unit(c, ports, net) for c in self._clusters if c not in own)
        if not rest:
            return device, alone, chosen, at
        rows = _rows(mine)
        poles = np.linalg.eigvals(self._rest(devices, own))
        others = SideBySide("the others", rest, 2 * len(ports))
        return device, Behind("the network", alone, others, rows, poles), chosen, at

    def _check(self, devices: tuple[str, ...]) -> None:
        for cluster in self._clusters:
            inside = [d for d in cluster if d in self._given]
            if (left := [d for d in inside if d not in devices]) and len(left) < len(inside):
                raise InputError(
                    f"{', '.join(d for d in inside if d in devices)} and {', '.join(left)} are connected by other "
                    "signals than the network's voltages and currents; cut at all of them"
                )

    def _ports(self) -> list[tuple[str, ...]]:
        """Devices that see one voltage, and whose currents the network takes alike."""
        found: list[list[str]] = []
        _, G, _, K = self._matrices
        taken = {d: np.concatenate([G[:, given], K[:, given]]) for d, given in self._given.items()}
        for d, read in self._read.items():
            for at in found:
                apart = np.abs(taken[d] - taken[at[0]]).max()
                if (read == self._read[at[0]]).all() and apart <= _ALIKE * np.abs(taken[d]).max():
                    at.append(d)
                    break
            else:
                found.append([d])
        return [tuple(at) for at in found]

    def _opened(self, rows: Sequence[int]) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """A, and B, C, D of all outputs, where some of them are given instead of computed."""
        F, G, H, K = self._matrices
        H, K = H.copy(), K.copy()
        H[rows], K[rows] = 0.0, 0.0
        whole = np.linalg.inv(np.eye(len(K)) - K)
        return F + G @ whole @ H, G @ whole, whole @ H, whole

    def _network(self, ports: list[tuple[str, ...]]) -> tuple[Matrix, Exact]:
        """States of the network, and its impedance at all ports."""
        A, B, C, D = self._opened(np.concatenate(list(self._given.values())).tolist())
        of_units = np.concatenate(list(self._states.values()))
        net = np.setdiff1d(np.arange(len(A)), of_units)
        given = np.concatenate([self._given[at[0]] for at in ports])
        read = np.concatenate([self._read[at[0]] for at in ports])
        _check_alone("the network", "a device", A[np.ix_(net, of_units)], C[np.ix_(read, of_units)])
        return net, _settled("the network", A, B[:, given], C[read], D[np.ix_(read, given)], net)

    def _unit(self, cluster: tuple[str, ...], ports: list[tuple[str, ...]], net: Matrix) -> Unit:
        """A cluster's devices with their voltages given; its currents count into it."""
        inside = tuple(d for d in cluster if d in self._given)
        A, B, C, D = self._closed_units
        mine = [k for k, at in enumerate(ports) if set(at) & set(inside)]
        read = np.concatenate([self._read[ports[k][0]] for k in mine])
        adds = [[self._given[d] for d in inside if d in ports[k]] for k in mine]
        rows = self._states[cluster]
        currents = np.concatenate([sum(C[given] for given in at) for at in adds])
        through = np.concatenate([sum(D[given] for given in at) for at in adds])
        _check_alone(", ".join(cluster), "the network", A[np.ix_(rows, net)], currents[:, net])
        side = _settled(", ".join(inside), A, B[:, read], currents, through[:, read], rows)
        return Unit(inside, _rows(mine), side.negated())

    @property
    def _closed_units(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        if not hasattr(self, "_of_units"):
            self._of_units = self._opened(np.unique(np.concatenate(list(self._read.values()))).tolist())
        return self._of_units

    def _rest(self, devices: tuple[str, ...], own: list[tuple[str, ...]]) -> Matrix:
        """A of all that is left, with the others connected."""
        A = self._opened(np.concatenate([self._given[d] for d in devices]).tolist())[0]
        kept = np.setdiff1d(np.arange(len(A)), np.concatenate([self._states[c] for c in own]))
        return A[np.ix_(kept, kept)]


def _rows(ports: Sequence[int]) -> Rows:
    return (2 * np.array(ports, dtype=np.int64)[:, None] + np.arange(2)).ravel()


def _settled(name: str, A: Matrix, B: Matrix, C: Matrix, D: Matrix, kept: Rows) -> Exact:
    """Some of the states; clocks among them say nothing."""
    moved = np.abs(A[np.ix_(kept, kept)]).sum(axis=1) + np.abs(B[kept]).sum(axis=1) > 0
    kept = kept[moved | (np.abs(A[np.ix_(kept, kept)]).sum(axis=0) > 0)]
    return Exact(name, A[np.ix_(kept, kept)], B[kept], C[:, kept], D)


def _check_alone(what: str, other: str, *couplings: Matrix) -> None:
    if any(np.abs(M).max(initial=0.0) > _NOTHING for M in couplings):
        raise InputError(
            f"the cut does not separate {what} from {other}: they are connected by other signals than the voltage and "
            "the current at a bus, such as a remote measurement; `gfor modes` judges such a case"
        )


def _clusters(blocks: Blocks, read: dict[str, Rows]) -> list[tuple[str, ...]]:
    """Devices with what is connected to them otherwise than by the components that give their voltages."""
    owner = {i: name for name in blocks.components for i in range(len(blocks.output_names))[blocks.window[name]]}
    networks = {owner[int(i)] for rows in read.values() for i in rows}
    home = {name: name for name in blocks.components if name not in networks}

    def root(name: str) -> str:
        while home[name] != name:
            name = home[name]
        return name

    for name in home:
        for source in blocks.sources[name].tolist():
            if (other := owner.get(source)) in home:
                home[root(other)] = root(name)
    found: dict[str, list[str]] = {}
    for name in home:
        found.setdefault(root(name), []).append(name)
    return [tuple(names) for names in found.values() if set(names) & set(read)]
