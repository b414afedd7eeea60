"""The New England system of the IEEE PES benchmarks beside a second computation, which shares nothing with the product.

    python -m tests.benchmarks.ieee_pes FOLDER

FOLDER holds ``ne-ieee39/models/psse`` of ITI/models (electric-grid/physical/smallsignal). Files, power flow, machines
(GENROU without saturation, constant field voltage) and network are read and written here once more; eigenvalues follow
from differences of the equations. gfor reads the files as delivered: generator 30 has T'qo below T''qo, and the ten
stabilisers have no exciter to act on. Each line has the largest difference of an electromechanical mode; the command
fails beyond the limits, and if the slowest mode of the second computation is not the one that is kept here."""

import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import root

from orchestrator.cases.case import load_case
from orchestrator.cases.new_case import WantedCase, write_case
from orchestrator.studies.modes.modes import compute_modes

BAND = 0.5, 2.5  # of the electromechanical modes [Hz]
MOST_HERTZ, MOST_POINTS = 0.005, 0.1
STEP = 1e-6  # of the differences
FREQUENCY = 60.0  # [Hz]
NAME = "ieee 39 bus"
KEPT = {
    ("exact", "impedance"): (0.6132, 8.67),
    ("exact", "power"): (0.6657, 6.34),
    ("psse", "impedance"): (0.6140, 8.30),
    ("psse", "power"): (0.6656, 6.60),
    ("andes", "impedance"): (0.6140, 7.50),
    ("andes", "power"): (0.6654, 5.78),
}
"""Frequency [Hz] and damping [%] of the second computation's slowest mode, by convention and loads."""


@dataclass
class System:
    """Buses by row, admittances [pu on 100 MVA], loads and machines of the files."""

    Y: np.ndarray
    load: np.ndarray
    kind: np.ndarray
    magnitude: np.ndarray
    power: np.ndarray
    at: np.ndarray
    data: np.ndarray
    base: np.ndarray


def read(folder: Path) -> System:
    """Read ``ieee 39 bus.raw`` and ``.dyr``."""
    sections: list[list[list[str]]] = [[]]
    lines = (folder / f"{NAME}.raw").read_text().splitlines()[3:]
    for line in lines:
        if line.lstrip().startswith("0 /"):
            sections.append([])
        elif line.strip() != "Q":
            sections[-1].append([cell.strip().strip("'") for cell in line.split(",")])
    buses, loads, shunts, generators, branches, transformers = sections[:6]
    row = {cells[0]: k for k, cells in enumerate(buses)}
    Y = np.zeros((len(row), len(row)), complex)
    load, power = np.zeros(len(row), complex), np.zeros(len(row), complex)
    magnitude = np.ones(len(row))
    for cells in loads:
        load[row[cells[0]]] += complex(float(cells[5]), float(cells[6])) / 100 * int(cells[2])
    for cells in shunts:
        Y[row[cells[0]], row[cells[0]]] += complex(float(cells[3]), float(cells[4])) / 100
    for cells in branches:
        i, k = row[cells[0]], row[cells[1]]
        y, half = 1 / complex(float(cells[3]), float(cells[4])), 0.5j * float(cells[5])
        Y[[i, k], [i, k]] += y + half
        Y[[i, k], [k, i]] -= y
    for head, Z, winding, _ in zip(*(transformers[k::4] for k in range(4)), strict=True):
        i, k = row[head[0]], row[head[1]]
        y, tap = 1 / complex(float(Z[0]), float(Z[1])), float(winding[0])
        Y[i, i] += y / tap**2
        Y[k, k] += y
        Y[[i, k], [k, i]] -= y / tap
    for cells in generators:
        power[row[cells[0]]] += float(cells[2]) / 100
        magnitude[row[cells[0]]] = float(cells[6])
    at = np.array([row[cells[0]] for cells in generators])
    base = np.array([float(cells[8]) / 100 for cells in generators])
    records = (folder / f"{NAME}.dyr").read_text().replace("\n", " ").split("/")
    words = [record.split() for record in records if "GENROU" in record]
    by_bus = {w[0]: [float(x) for x in w[3:]] for w in words}
    data = np.array([by_bus[cells[0]] for cells in generators]).T
    kind = np.array([int(cells[3]) for cells in buses])
    return System(Y, load, kind, magnitude, power, at, data, base)


def solved(s: System) -> np.ndarray:
    """Voltages of the power flow."""
    pv, free = s.kind > 1, s.kind < 3

    def voltage(x):
        angle, size = np.zeros(len(s.kind)), s.magnitude.copy()
        angle[free], size[~pv] = x[: free.sum()], x[free.sum() :]
        return size * np.exp(1j * angle)

    def misfit(x):
        v = voltage(x)
        rest = v * np.conj(s.Y @ v) + s.load - s.power
        return np.concatenate([rest.real[free], rest.imag[~pv]])

    found = root(misfit, np.concatenate([np.zeros(free.sum()), np.ones((~pv).sum())]), tol=1e-12)
    assert abs(misfit(found.x)).max() < 1e-9
    return voltage(found.x)


class Equations:
    """dx/dt = f(x, V), 0 = g(x, V); x has δ, w, E'q, E'd, ψ1d and ψ2q of every machine in turn."""

    def __init__(self, s: System, convention: str, loads: str):
        self.s, self.convention, self.loads = s, convention, loads
        self.V_0 = v = solved(s)
        T1, T2, Tq1, Tq2, self.H, self.D, Xd, Xq, X1, Xq1, X2, Xl, *_ = s.data
        self.T = T1, Tq1, T2, Tq2
        self.X = Xd, Xq, X1, Xq1, X2, Xl
        i = (s.Y @ v + np.conj(s.load / v))[s.at] / s.base
        delta = np.angle(v[s.at] + 1j * Xq * i)
        turned = i * np.exp(-1j * delta)
        iq, id_ = turned.real, -turned.imag
        vt = v[s.at] * np.exp(-1j * delta)
        psi_d = vt.real + X2 * id_
        E1q = psi_d + (X1 - X2) * id_
        psi_1d = E1q - (X1 - Xl) * id_
        E1d = (Xq - Xq1) * iq
        psi_2q = -E1d - (Xq1 - Xl) * iq
        self.E_fd = E1q + (Xd - X1) * id_
        one = np.ones_like(delta)
        self.x_0 = np.concatenate([delta, one, E1q, E1d, psi_1d, psi_2q])
        self.P_m = self._machine(self.x_0, v)[1]

    def _machine(self, x, V):
        """Current of each machine into its bus, own base, and its torque."""
        _, _, X1, Xq1, X2, Xl = self.X
        delta, w, E1q, E1d, psi_1d, psi_2q = x.reshape(6, -1)
        psi_d = ((X2 - Xl) * E1q + (X1 - X2) * psi_1d) / (X1 - Xl)
        psi_q = (-(X2 - Xl) * E1d + (Xq1 - X2) * psi_2q) / (Xq1 - Xl)
        speed = w if self.convention == "exact" else 1.0
        emf = speed * (psi_d + 1j * psi_q)  # behind X'', q axis real
        i = (emf - V[self.s.at] * np.exp(-1j * delta)) / (1j * X2)
        torque = psi_d * i.real + psi_q * i.imag
        return i, torque

    def f(self, x, V):
        Xd, Xq, X1, Xq1, X2, Xl = self.X
        T1, Tq1, T2, Tq2 = self.T
        _, w, E1q, E1d, psi_1d, psi_2q = x.reshape(6, -1)
        i, torque = self._machine(x, V)
        iq, id_ = i.real, -i.imag
        given = self.P_m if self.convention == "andes" else self.P_m / w
        k_d, k_q = (X1 - X2) / (X1 - Xl) ** 2, (Xq1 - X2) / (Xq1 - Xl) ** 2
        return np.concatenate(
            [
                2 * np.pi * FREQUENCY * (w - 1),
                (given - torque - self.D * (w - 1)) / (2 * self.H),
                (self.E_fd - E1q - (Xd - X1) * (id_ - k_d * (psi_1d + (X1 - Xl) * id_ - E1q))) / T1,
                (-E1d + (Xq - Xq1) * (iq - k_q * (psi_2q + (Xq1 - Xl) * iq + E1d))) / Tq1,
                (-psi_1d + E1q - (X1 - Xl) * id_) / T2,
                (-psi_2q - E1d - (Xq1 - Xl) * iq) / Tq2,
            ]
        )

    def g(self, x, V):
        delta = x.reshape(6, -1)[0]
        injected = np.zeros(len(V), complex)
        np.add.at(injected, self.s.at, self.s.base * self._machine(x, V)[0] * np.exp(1j * delta))
        constant = self.s.load if self.loads == "power" else self.s.load * abs(V / self.V_0) ** 2
        rest = injected - self.s.Y @ V - np.conj(constant / V)
        return np.concatenate([rest.real, rest.imag])

    def eigenvalues(self):
        n, V = len(self.x_0), np.concatenate([self.V_0.real, self.V_0.imag])
        start = np.concatenate([self.x_0, V])

        def all_of(z):
            v = z[n:].reshape(2, -1)
            return np.concatenate([h(z[:n], v[0] + 1j * v[1]) for h in (self.f, self.g)])

        assert abs(all_of(start)).max() < 1e-8
        J = np.column_stack(
            [
                (all_of(start + e) - all_of(start - e)) / (2 * STEP)
                for e in STEP * np.eye(len(start))
            ]
        )
        A = J[:n, :n] - J[:n, n:] @ np.linalg.solve(J[n:, n:], J[n:, :n])
        return np.linalg.eigvals(A)


def product(folder: Path, scratch: Path, convention: str, loads: str) -> np.ndarray:
    """Eigenvalues that gfor finds for the same files."""
    out = scratch / "ne.toml"
    files = folder / f"{NAME}.raw", folder / f"{NAME}.dyr"
    text = write_case(WantedCase(files, out)).text
    keys = f'[network]\nload_model = {{ active = "{loads}", reactive = "{loads}" }}\n'
    if convention != "exact":
        keys = f'[conventions]\nlike = "{convention}"\n\n{keys}'
    out.write_text(text.replace("[network]\n", keys, 1), encoding="utf-8")
    modes = compute_modes(load_case(out).prepare(["base"])[0]).modes
    return np.array([mode.eigenvalue for mode in modes])


def swings(eigenvalues: np.ndarray) -> np.ndarray:
    """The modes of the band, slowest first."""
    hertz = eigenvalues.imag / (2 * np.pi)
    inside = eigenvalues[(hertz > BAND[0]) & (hertz < BAND[1])]
    return inside[np.argsort(inside.imag)]


def damping(eigenvalues: np.ndarray) -> np.ndarray:
    """Of each mode [%]."""
    return -100 * eigenvalues.real / abs(eigenvalues)


def is_kept(convention: str, loads: str, slowest: np.ndarray) -> bool:
    """Return whether the slowest mode of the second computation is the one of ``KEPT``."""
    hertz, percent = KEPT[convention, loads]
    near = abs(slowest.imag / (2 * np.pi) - hertz) < MOST_HERTZ
    return bool(near and abs(damping(slowest) - percent) < MOST_POINTS)


def main() -> None:
    folder = Path(sys.argv[1]) / "ne-ieee39" / "models" / "psse"
    system, failed = read(folder), False
    print(
        "| Convention | Loads | modes | slowest [Hz] | its damping [%] | most [Hz] | most [points] |"
    )
    print("|---|---|---|---|---|---|---|")
    for convention, loads in KEPT:
        own = swings(Equations(system, convention, loads).eigenvalues())
        with tempfile.TemporaryDirectory() as scratch:
            ours = swings(product(folder, Path(scratch), convention, loads))
        pairs = np.array([ours[np.argmin(abs(ours - z))] for z in own])
        hertz = max(abs(own.imag - pairs.imag)) / (2 * np.pi)
        points = max(abs(damping(own) - damping(pairs)))
        failed |= hertz > MOST_HERTZ or points > MOST_POINTS or len(own) != len(ours)
        failed |= len(set(pairs)) < len(own) or not is_kept(convention, loads, own[0])
        counts = f"{len(own)}, ours {len(ours)}"
        slowest = f"{own[0].imag / (2 * np.pi):.4f} | {damping(own[0]):.2f}"
        print(f"| {convention} | {loads} | {counts} | {slowest} | {hertz:.5f} | {points:.3f} |")
    sys.exit(failed)


if __name__ == "__main__":
    main()
