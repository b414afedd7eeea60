"""RAW and DYR files read, solved and linearised once more, with nothing of the product: for ieee_pes.py.

Power flow, GENROU, GENROE, GENSAE, GENCLS without inertia, ESST1A, SEXS, SCRX fed from the bus, IEEEST with no filter,
loads of constant power or impedance. Eigenvalues follow from differences of the equations. Limits are left out: none
acts at the start in the files that this is for. What else a record says is refused by an assertion."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import root

STEP = 1e-6  # of the differences
INFINITE_H = 1e9  # inertia constant that holds an infinite bus [s]
Words = Sequence[float]


@dataclass
class System:
    """Buses by row, admittances [pu on ``base`` MVA], loads, and the machines' rows, ratings, impedances, records."""

    base: float
    Y: np.ndarray
    load: np.ndarray
    kind: np.ndarray
    magnitude: np.ndarray
    power: np.ndarray
    at: list[int]
    ratio: list[float]
    source: list[complex]
    records: list[dict[str, Words]]


def read(raw: Path, dyr: Path) -> System:
    """Read both files, revision 33."""
    sections: list[list[list[str]]] = [[]]
    head, *lines = raw.read_text().splitlines()
    base = float(head.split(",")[1])
    for line in lines[2:]:
        if line.lstrip().startswith("0 /"):
            sections.append([])
        elif line.strip() != "Q":
            sections[-1].append([cell.strip().strip("'").strip() for cell in line.split(",")])
    buses, loads, shunts, generators, branches, transformers = sections[:6]
    row = {cells[0]: k for k, cells in enumerate(buses)}
    Y = np.zeros((len(row), len(row)), complex)
    load, power = np.zeros(len(row), complex), np.zeros(len(row), complex)
    magnitude = np.ones(len(row))
    for cells in loads:
        load[row[cells[0]]] += complex(float(cells[5]), float(cells[6])) / base * int(cells[2])
    for cells in shunts:
        Y[row[cells[0]], row[cells[0]]] += complex(float(cells[3]), float(cells[4])) / base
    for cells in branches:
        i, k = row[cells[0]], row[cells[1]]
        y, half = 1 / complex(float(cells[3]), float(cells[4])), 0.5j * float(cells[5])
        Y[[i, k], [i, k]] += y + half
        Y[[i, k], [k, i]] -= y
    for first, Z, winding, _ in zip(*(transformers[k::4] for k in range(4)), strict=True):
        i, k = row[first[0]], row[first[1]]
        to_base = base / float(Z[2]) if first[5] == "2" else 1.0
        y, tap = 1 / (complex(float(Z[0]), float(Z[1])) * to_base), float(winding[0])
        Y[i, i] += y / tap**2
        Y[k, k] += y
        Y[[i, k], [k, i]] -= y / tap
    for cells in generators:
        power[row[cells[0]]] += float(cells[2]) / base
        magnitude[row[cells[0]]] = float(cells[6])
    words = [record.split() for record in dyr.read_text().replace("\n", " ").split("/")]
    by_bus: dict[str, dict[str, Words]] = {cells[0]: {} for cells in generators}
    for w in words:
        if w:
            by_bus[w[0]][w[1].strip("'")] = [float(x) for x in w[3:]]
    return System(
        base,
        Y,
        load,
        np.array([int(cells[3]) for cells in buses]),
        magnitude,
        power,
        [row[cells[0]] for cells in generators],
        [float(cells[8]) / base for cells in generators],
        [complex(float(cells[9]), float(cells[10])) for cells in generators],
        [by_bus[cells[0]] for cells in generators],
    )


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


def exponential(record: Words) -> Callable[[float], float]:
    """S(ψ) through S(1.0) and S(1.2) as a power of ψ."""
    s_10, s_12 = record
    power = math.log(s_12 / s_10) / math.log(1.2)
    return lambda flux: s_10 * flux**power


def unsaturated(_: float) -> float:
    return 0.0


@dataclass
class Round:
    """A round rotor: ψd, E'q, E'd, ψ1d, ψ2q; the flux linkages are given in the rotor's frame, q axis real."""

    record: Words
    saturation: Callable[[float], float]

    def __post_init__(self):
        T1, T2, Tq1, Tq2, self.H, self.D, Xd, Xq, X1, Xq1, X2, Xl = self.record[:12]
        self.T, self.X = (T1, Tq1, T2, Tq2), (Xd, Xq, X1, Xq1, X2, Xl)
        self.Xq, self.X2 = Xq, X2
        self.q_part = (Xq - Xl) / (Xd - Xl)

    def flux(self, x):
        _, _, X1, Xq1, X2, Xl = self.X
        E1q, E1d, psi_1d, psi_2q = x
        psi_d = ((X2 - Xl) * E1q + (X1 - X2) * psi_1d) / (X1 - Xl)
        return psi_d, (-(X2 - Xl) * E1d + (Xq1 - X2) * psi_2q) / (Xq1 - Xl)

    def start(self, psi_d, psi_q, i_d, i_q):
        Xd, Xq, X1, Xq1, X2, Xl = self.X
        S = self.saturation(math.hypot(psi_d, psi_q))
        E1q = psi_d + (X1 - X2) * i_d
        E1d = (Xq - Xq1) * i_q + S * self.q_part * psi_q
        field = E1q + (Xd - X1) * i_d + S * psi_d
        return [E1q, E1d, E1q - (X1 - Xl) * i_d, -E1d - (Xq1 - Xl) * i_q], field

    def rates(self, x, i_d, i_q, field):
        Xd, Xq, X1, Xq1, X2, Xl = self.X
        T1, Tq1, T2, Tq2 = self.T
        E1q, E1d, psi_1d, psi_2q = x
        psi_d, psi_q = self.flux(x)
        S = self.saturation(math.hypot(psi_d, psi_q))
        k_d, k_q = (X1 - X2) / (X1 - Xl) ** 2, (Xq1 - X2) / (Xq1 - Xl) ** 2
        d_axis = (Xd - X1) * (i_d - k_d * (psi_1d + (X1 - Xl) * i_d - E1q)) + S * psi_d
        q_axis = (Xq - Xq1) * (i_q - k_q * (psi_2q + (Xq1 - Xl) * i_q + E1d))
        return [
            (field - E1q - d_axis) / T1,
            (-E1d + q_axis + S * self.q_part * psi_q) / Tq1,
            (-psi_1d + E1q - (X1 - Xl) * i_d) / T2,
            (-psi_2q - E1d - (Xq1 - Xl) * i_q) / Tq2,
        ]


@dataclass
class Salient:
    """A salient rotor: E'q, ψ1d, ψ"q; both axes saturate on |ψ"|."""

    record: Words
    saturation: Callable[[float], float]

    def __post_init__(self):
        T1, T2, Tq2, self.H, self.D, Xd, Xq, X1, X2, Xl = self.record[:10]
        self.T, self.X = (T1, T2, Tq2), (Xd, X1, Xl)
        self.Xq, self.X2 = Xq, X2
        self.q_part = (Xq - Xl) / (Xd - Xl)

    def flux(self, x):
        _, X1, Xl = self.X
        E1q, psi_1d, psi_q = x
        return ((self.X2 - Xl) * E1q + (X1 - self.X2) * psi_1d) / (X1 - Xl), psi_q

    def start(self, psi_d, psi_q, i_d, i_q):
        Xd, X1, Xl = self.X
        S = self.saturation(math.hypot(psi_d, psi_q))
        E1q = psi_d + (X1 - self.X2) * i_d
        return [E1q, E1q - (X1 - Xl) * i_d, psi_q], E1q + (Xd - X1) * i_d + S * psi_d

    def rates(self, x, i_d, i_q, field):
        Xd, X1, Xl = self.X
        T1, T2, Tq2 = self.T
        E1q, psi_1d, psi_q = x
        psi_d, _ = self.flux(x)
        S = self.saturation(math.hypot(psi_d, psi_q))
        k_d = (X1 - self.X2) / (X1 - Xl) ** 2
        d_axis = (Xd - X1) * (i_d - k_d * (psi_1d + (X1 - Xl) * i_d - E1q)) + S * psi_d
        return [
            (field - E1q - d_axis) / T1,
            (-psi_1d + E1q - (X1 - Xl) * i_d) / T2,
            (-psi_q * (1 + S * self.q_part) - (self.Xq - self.X2) * i_q) / Tq2,
        ]


class Classical:
    """A constant flux behind X", held in speed: GENCLS without inertia."""

    H, D, q_part = INFINITE_H, 0.0, 0.0
    saturation = staticmethod(unsaturated)

    def __init__(self, X: float):
        self.Xq = self.X2 = X

    def flux(self, x):
        return tuple(x)

    def start(self, psi_d, psi_q, i_d, i_q):
        return [psi_d, psi_q], 0.0

    def rates(self, x, i_d, i_q, field):
        return [0.0, 0.0]


def rotor(records: dict[str, Words], source: complex):
    """The machine of one bus's records."""
    if "GENROU" in records:
        assert list(records["GENROU"][12:]) == [0, 0]
        return Round(records["GENROU"], unsaturated)
    if "GENROE" in records:
        return Round(records["GENROE"], exponential(records["GENROE"][12:]))
    if "GENSAE" in records:
        return Salient(records["GENSAE"], exponential(records["GENSAE"][10:]))
    assert records["GENCLS"][0] == 0
    return Classical(source.imag)


@dataclass
class Lags:
    """Lead-lags, lags and washouts in a row, each (1 + s·T_1)/(1 + s·T_2) or s·T/(1 + s·T), with a gain behind them."""

    blocks: list[tuple[float, float]]
    gain: float = 1.0
    washout: float = 0.0

    @property
    def states(self) -> int:
        return len(self.blocks) + bool(self.washout)

    def settled(self, entry: float) -> list[float]:
        return [entry] * self.states

    def answer(self, x, entry):
        """Rates of the states, and what leaves the row."""
        rates = []
        for state, (lead, lag) in zip(x, self.blocks, strict=False):
            rates.append((entry - state) / lag)
            entry = state + lead * rates[-1]
        if self.washout:
            rates.append((entry - x[-1]) / self.washout)
            entry = (entry - x[-1]) * self.gain
            return rates, entry
        return rates, entry * self.gain


def stabiliser(records: dict[str, Words]) -> Lags:
    """IEEEST on the speed; nothing without its record or without an exciter."""
    if "IEEEST" not in records or not {"ESST1A", "SEXS", "SCRX"} & set(records):
        return Lags([], 0.0)
    code, _, *rest = records["IEEEST"]
    assert code == 1
    assert not any(rest[:6])
    T1, T2, T3, T4, T5, T6, gain = rest[6:13]
    assert T5 == T6
    return Lags([(T1, T2), (T3, T4)], gain, T6)


@dataclass
class Exciter:
    """A measurement's lag, lead-lags, and an amplifier with a lag; no exciter: a constant field voltage."""

    measured: Lags
    forward: Lags

    @property
    def states(self) -> int:
        return self.measured.states + self.forward.states

    def start(self, v: float, field: float) -> tuple[list[float], float]:
        """States at rest, and the reference."""
        error = field / self.forward.gain if self.forward.gain else 0.0
        return [*self.measured.settled(v), *self.forward.settled(error)], v + error

    def answer(self, x, v, reference, signal):
        k = self.measured.states
        followed, seen = self.measured.answer(x[:k], v)
        rates, field = self.forward.answer(x[k:], reference - seen + signal)
        return [*followed, *rates], field


def exciter(records: dict[str, Words]) -> Exciter | None:
    if "ESST1A" in records:
        UEL, VOS, TR, _, _, TC, TB, TC1, TB1, KA, TA, *rest = records["ESST1A"]
        assert (UEL, VOS, TA, rest[4], rest[5], rest[7]) == (1, 1, 0, 0, 0, 0)  # KC, KF, KLR
        return Exciter(Lags([(0.0, TR)]), Lags([(TC, TB), (TC1, TB1)], KA))
    if "SEXS" in records or "SCRX" in records:
        ratio, TB, K, TE, *_ = records["SEXS"] if "SEXS" in records else records["SCRX"]
        assert "SCRX" not in records or records["SCRX"][6] == 1
        return Exciter(Lags([]), Lags([(ratio * TB, TB), (0.0, TE)], K))
    return None


class Unit:
    """A machine with its exciter and stabiliser; x is δ, w and theirs in turn."""

    def __init__(self, records, source, convention, omega_b):
        self.rotor, self.exciter = rotor(records, source), exciter(records)
        self.stabiliser = stabiliser(records)
        self.convention, self.omega_b = convention, omega_b
        self.Z = complex(source.real, self.rotor.X2)

    def start(self, v: complex, i: complex) -> list[float]:
        """States at rest [own base]."""
        flux = v + self.Z * i
        S = self.rotor.saturation(abs(flux))
        at = flux * (1 + S * self.rotor.q_part) + 1j * (self.rotor.Xq - self.rotor.X2) * i
        delta = float(np.angle(at))
        flux, i = flux * np.exp(-1j * delta), i * np.exp(-1j * delta)
        inside, self.field = self.rotor.start(flux.real, flux.imag, -i.imag, i.real)
        self.torque = flux.real * i.real + flux.imag * i.imag
        self.n = len(inside)
        outside: list[float] = []
        if self.exciter is not None:
            outside, self.reference = self.exciter.start(abs(v), self.field)
        return [delta, 1.0, *inside, *outside, *self.stabiliser.settled(0.0)]

    def answer(self, x, v: complex) -> tuple[list[float], complex]:
        """Rates of the states, and the current [own base]."""
        delta, w, inside = x[0], x[1], x[2 : 2 + self.n]
        psi_d, psi_q = self.rotor.flux(inside)
        turn = np.exp(1j * delta)
        emf = (w if self.convention == "exact" else 1.0) * complex(psi_d, psi_q)
        i = (emf - v / turn) / self.Z
        i_q, i_d = i.real, -i.imag
        given = self.torque if self.convention == "andes" else self.torque / w
        torque = psi_d * i_q + psi_q * i.imag
        swing = (given - torque - self.rotor.D * (w - 1)) / (2 * self.rotor.H)
        k, field = 2 + self.n, self.field
        after = k + (self.exciter.states if self.exciter else 0)
        stabilised, signal = self.stabiliser.answer(x[after:], w - 1)
        excited: list[float] = []
        if self.exciter is not None:
            excited, field = self.exciter.answer(x[k:after], abs(v), self.reference, signal)
        moved = self.rotor.rates(inside, i_d, i_q, field)
        return [self.omega_b * (w - 1), swing, *moved, *excited, *stabilised], i * turn


def spectrum(s: System, convention: str, loads: str, hertz: float) -> np.ndarray:
    """All eigenvalues [rad/s] of dx/dt = f(x, V), 0 = g(x, V)."""
    V_0 = solved(s)
    injected = s.Y @ V_0 + np.conj(s.load / V_0)
    units = [
        Unit(records, source, convention, 2 * np.pi * hertz)
        for records, source in zip(s.records, s.source, strict=True)
    ]
    starts = [
        unit.start(V_0[at], injected[at] / ratio)
        for unit, at, ratio in zip(units, s.at, s.ratio, strict=True)
    ]
    ends = np.cumsum([0, *map(len, starts)])
    n, start = ends[-1], np.concatenate([*starts, V_0.real, V_0.imag])

    def answers(z):
        V = z[n : n + len(V_0)] + 1j * z[n + len(V_0) :]
        rates, current = [], np.zeros(len(V), complex)
        for k, unit in enumerate(units):
            own, i = unit.answer(z[ends[k] : ends[k + 1]], V[s.at[k]])
            rates += own
            current[s.at[k]] += s.ratio[k] * i
        constant = s.load if loads == "power" else s.load * abs(V / V_0) ** 2
        rest = current - s.Y @ V - np.conj(constant / V)
        return np.concatenate([rates, rest.real, rest.imag])

    assert abs(answers(start)).max() < 1e-8
    ahead = (answers(start + e) - answers(start - e) for e in STEP * np.eye(len(start)))
    J = np.column_stack(list(ahead)) / (2 * STEP)
    A = J[:n, :n] - J[:n, n:] @ np.linalg.solve(J[n:, n:], J[n:, :n])
    return np.linalg.eigvals(A)
