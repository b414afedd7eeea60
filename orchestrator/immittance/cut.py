"""A cut through a running system: some devices against all that is left, from the linear models of its components."""

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from orchestrator.analysis.device_start import misfits_of, sentences
from orchestrator.analysis.linear_model import LinearModel
from orchestrator.analysis.linearization import Blocks, continuous
from orchestrator.analysis.stability import judge, whole_spectrum
from orchestrator.analysis.steady_state import find_operating_point
from orchestrator.arrays import Complex
from orchestrator.cases.facts import rated_frequency
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.coupling.master import Master
from orchestrator.errors import InputError
from orchestrator.immittance.sides import Exact
from orchestrator.study.modes import running

_PORT = ("v_re", "v_im"), ("i_re", "i_im")


@dataclass(frozen=True)
class Cut:
    """Both sides at a cut [pu on the system base], and the verdict of the closed system's own modes."""

    devices: tuple[str, ...]
    # device, network: admittance of the devices, with currents into them, and impedance of the rest at their buses.
    device: Exact
    network: Exact
    modes_stable: bool | None
    # voltages, currents: at the operating point, by device; currents out of it.
    voltages: dict[str, complex]
    currents: dict[str, complex]
    rated_hz: float | None  # None where no component has one
    warnings: tuple[str, ...]
    eigenvalues: Complex  # of the closed system [rad/s]; empty where it is too large for all of them
    bus: str  # where the devices stand; "" where at several


def cut_of(prepared: PreparedScenario, bus: str | None, names: tuple[str, ...]) -> Cut:
    with running(prepared) as master:
        said = sentences(misfits_of(master))
        homes = buses_of(master)
        devices = _devices(homes, bus, names)
        find_operating_point(master)
        blocks = Blocks(master, without_step=True)
        model = continuous(blocks)
        spectrum = whole_spectrum(model)
        device, network = _sides(blocks, model, devices)
        values = dict(zip(master.output_names, master.y.tolist(), strict=True))
        fed = {str(c.target): str(c.source) for c in master.system.connections}
        voltages = {d: complex(*(values[fed[f"{d}.{v}"]] for v in _PORT[0])) for d in devices}
        currents = {d: complex(*(values[f"{d}.{i}"] for i in _PORT[1])) for d in devices}
    places, found = {homes[name] for name in devices}, np.zeros(0, dtype=complex)
    return Cut(devices, device, network, judge(model, spectrum).stable, voltages, currents, rated_frequency(prepared),
               said, spectrum.eigenvalues if spectrum else found, places.pop() if len(places) == 1 else "")  # fmt: skip


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
    found = tuple(name for name, home in homes.items() if bus in (home, home.rpartition(".")[2]))
    if not found:
        raise InputError(
            f"--bus {bus}: no device stands there; devices stand at {', '.join(sorted(set(homes.values())))}"
        )
    return tuple(name for name in found if not names or name in names)


def _sides(blocks: Blocks, model: LinearModel, devices: tuple[str, ...]) -> tuple[Exact, Exact]:
    """The devices side by side, and the rest as seen from them: the closed model with their currents given."""
    names = {full: k for k, full in enumerate(blocks.output_names)}
    given = np.array([names[f"{d}.{i}"] for d in devices for i in _PORT[1]])
    read: list[int] = []
    parts = []
    for d in devices:
        c = blocks.components[d]
        if c.A_c is None or c.B_c is None:
            raise InputError(f"component {d!r} gives no derivatives; scan its FMU and give that in its place")
        columns = [c.inputs.index(v) for v in _PORT[0]]
        rows = [c.outputs.index(i) for i in _PORT[1]]
        read += [int(blocks.sources[d][k]) for k in columns]
        parts.append((c.A_c, c.B_c[:, columns], c.C[rows], c.D[np.ix_(rows, columns)]))
    together = Exact(", ".join(devices), *(scipy.linalg.block_diag(*matrices) for matrices in zip(*parts, strict=True)))
    F, G, H, K = (M.toarray() for M in (model.F, model.G, model.H, model.K))
    H[given], K[given] = 0.0, 0.0
    windows = blocks.state_windows()
    whole = np.linalg.inv(np.eye(len(K)) - K)
    kept = np.setdiff1d(np.arange(len(F)), np.concatenate([np.arange(len(F))[windows[d]] for d in devices]))
    A, B = F + G @ whole @ H, G @ whole[:, given]
    C, D = (whole @ H)[read], whole[read][:, given]
    moved = np.abs(A.diagonal()[kept]) + np.abs(A[kept][:, kept]).sum(axis=1) + np.abs(B[kept]).sum(axis=1) > 0
    kept = kept[moved | (np.abs(A[:, kept]).sum(axis=0) > 0)]  # clocks say nothing
    rest = Exact("the network", A[np.ix_(kept, kept)], B[kept], C[:, kept], D)
    return together.negated(), rest
