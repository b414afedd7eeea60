"""Nordic 44 written a second time, with the assumptions of TOPS: modes of machines on a network of phasors.

All machines have X''_q = X''_d and no resistance, loads are admittances: the network is linear, v = Z·Σ y·e'', and the
rates of all states are one vector expression. Data come from the tables of the built-in case. Per unit on 100 MVA, a
machine's data on its own rating.

TOPS writes the rotor as a cascade, E_fd → E' → E'', without a leakage reactance; GENROU as windings with one.
"""

import csv
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import root

FOLDER = Path(__file__).parents[2] / "orchestrator" / "cases" / "built_in" / "nordic44"
BASE = 100.0
SLACK = "3300"
NAMES = ("H", "X_d", "X_q", "X_d1", "X_q1", "X_d2", "T_d10", "T_q10", "T_d20", "T_q20")
"""Columns of a machine's data, as the case has them."""

Vector = np.ndarray


def _rows(name: str) -> list[dict[str, str]]:
    with (FOLDER / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@dataclass(frozen=True)
class Nordic44:
    """The system and how it is modelled.

    Attributes
    ----------
    cascade
        The rotor as TOPS has it; otherwise GENROU's windings with ``X_l``.
    X_l
        Leakage reactance of all machines [pu of the rating].
    emf_with_speed
        Whether the emf is in proportion to speed, as in our phasor models.
    constant_torque
        Instead of constant power.
    slack_shared
        Whether the units at the slack bus share what it feeds, or the first one takes the difference, as in TOPS.
    """

    cascade: bool = True
    X_l: float = 0.1
    emf_with_speed: bool = False
    constant_torque: bool = False
    slack_shared: bool = False

    # -- network ---------------------------------------------------------------------------------------

    @cached_property
    def buses(self) -> list[str]:
        return sorted({row[end] for row in _rows("lines") for end in ("from", "to")})

    def _place(self, name: str) -> int:
        return self.buses.index(name)

    @cached_property
    def admittance(self) -> Vector:
        """Of lines and transformers."""
        Y = np.zeros((len(self.buses),) * 2, complex)
        for row in _rows("lines"):
            a, b = self._place(row["from"]), self._place(row["to"])
            y, half = 1 / complex(float(row["R"]), float(row["X"])), 0.5j * float(row["B"])
            Y[[a, b], [a, b]] += y + half
            Y[[a, b], [b, a]] -= y
        return Y

    @cached_property
    def loads(self) -> Vector:
        """P + jQ by bus."""
        s = np.zeros(len(self.buses), complex)
        for row in _rows("loads"):
            s[self._place(row["bus"])] += complex(float(row["p_mw"]), float(row["q_mvar"])) / BASE
        return s

    # -- machines --------------------------------------------------------------------------------------

    @cached_property
    def units(self) -> list[dict[str, str]]:
        return _rows("units")

    @cached_property
    def at(self) -> Vector:
        """Place of each machine's bus."""
        return np.array([self._place(row["bus"]) for row in self.units])

    @cached_property
    def rating(self) -> Vector:
        return self._column("rating_mva") / BASE

    def _column(self, name: str) -> Vector:
        return np.array([float(row[name]) for row in self.units])

    @cached_property
    def data(self) -> dict[str, Vector]:
        return {name: self._column(f"sg.machine.{name}") for name in NAMES}

    # -- power flow ------------------------------------------------------------------------------------

    @cached_property
    def voltages(self) -> Vector:
        """Complex voltages; machines hold theirs, the slack's angle is 0."""
        held = dict(zip(self.at, self._column("v_pu"), strict=True))
        wanted = -self.loads
        np.add.at(wanted, self.at, self._column("p_mw") / BASE)
        n = len(self.buses)
        turned = [k for k in range(n) if k != self._place(SLACK)]
        free = [k for k in range(n) if k not in held]

        def voltages(x: Vector) -> Vector:
            size, angle = np.ones(n), np.zeros(n)
            size[list(held)] = list(held.values())
            angle[turned], size[free] = x[: len(turned)], x[len(turned) :]
            return size * np.exp(1j * angle)

        def mismatch(x: Vector) -> Vector:
            v = voltages(x)
            s = v * np.conj(self.admittance @ v) - wanted
            return np.concatenate([s.real[turned], s.imag[free]])

        found = root(
            mismatch, np.concatenate([np.zeros(len(turned)), np.ones(len(free))]), tol=1e-13
        )
        assert np.abs(mismatch(found.x)).max() < 1e-8, found.message
        return voltages(found.x)

    @cached_property
    def powers(self) -> Vector:
        """P + jQ that each machine feeds; machines of a bus share Q evenly, their ratings there being equal."""
        v = self.voltages
        fed = v * np.conj(self.admittance @ v) + self.loads
        count = np.bincount(self.at, minlength=len(self.buses))
        P = self._column("p_mw") / BASE
        slack = self.at == self._place(SLACK)
        missing = fed[self._place(SLACK)].real - P[slack].sum()
        P[slack] += (
            missing / slack.sum() if self.slack_shared else missing * (np.arange(slack.sum()) == 0)
        )
        return P + 1j * fed.imag[self.at] / count[self.at]

    # -- modes -----------------------------------------------------------------------------------------

    def eigenvalues(self) -> Vector:
        """Of the equations linearised around the power flow, by central differences [rad/s]."""
        start, n, h = self._start, self._start.size, 1e-5
        assert np.abs(self._rates(start)).max() < 1e-8
        A = np.empty((n, n))
        for k in range(n):
            step = np.zeros(n)
            step[k] = h
            A[:, k] = (self._rates(start + step) - self._rates(start - step)) / (2 * h)
        return np.linalg.eigvals(A)

    @cached_property
    def _Z(self) -> Vector:
        Y = self.admittance + np.diag(np.conj(self.loads) / np.abs(self.voltages) ** 2)
        np.add.at(Y, (self.at, self.at), self.rating / (1j * self.data["X_d2"]))
        return np.linalg.inv(Y)

    @cached_property
    def _start(self) -> Vector:
        d, v = self.data, self.voltages[self.at]
        i = np.conj(self.powers / v) / self.rating
        delta = np.angle(v + 1j * d["X_q"] * i)
        turn = np.exp(1j * (delta - np.pi / 2))  # f = f_d + j·f_q in the rotor's frame
        v, i = v / turn, i / turn
        E_q, E_d = v.imag + d["X_d1"] * i.real, v.real - d["X_q1"] * i.imag
        if self.cascade:
            fast = v.imag + d["X_d2"] * i.real, v.real - d["X_d2"] * i.imag
        else:  # fluxes of the dampers
            fast = E_q - (d["X_d1"] - self.X_l) * i.real, E_d + (d["X_q1"] - self.X_l) * i.imag
        return np.concatenate([delta, np.ones_like(delta), E_q, E_d, *fast])

    @cached_property
    def _E_fd(self) -> Vector:
        d, v = self.data, self.voltages[self.at]
        i = np.conj(self.powers / v) / self.rating
        turn = np.exp(1j * (np.angle(v + 1j * d["X_q"] * i) - np.pi / 2))
        return (v / turn).imag + d["X_d"] * (i / turn).real

    def _rates(self, x: Vector) -> Vector:
        d = self.data
        delta, w, E_q, E_d, fast_q, fast_d = x.reshape(6, -1)
        k_d, k_q = ((d["X_d2"] - self.X_l) / (d[name] - self.X_l) for name in ("X_d1", "X_q1"))
        e_q = fast_q if self.cascade else k_d * E_q + (1 - k_d) * fast_q
        e_d = fast_d if self.cascade else k_q * E_d + (1 - k_q) * fast_d
        turn = np.exp(1j * (delta - np.pi / 2))
        e = (e_d + 1j * e_q) * turn
        emf = e * w if self.emf_with_speed else e
        y = 1 / (1j * d["X_d2"])
        injected = np.zeros(len(self.buses), complex)
        np.add.at(injected, self.at, self.rating * y * emf)
        i = y * (emf - (self._Z @ injected)[self.at])
        T_e = (e * np.conj(i)).real
        T_m = self.powers.real / self.rating / (1.0 if self.constant_torque else w)
        i_d, i_q = (i / turn).real, (i / turn).imag
        if self.cascade:
            d_axis, q_axis = (d["X_d"] - d["X_d1"]) * i_d, -(d["X_q"] - d["X_q1"]) * i_q
            damper_d = (E_q - fast_q - (d["X_d1"] - d["X_d2"]) * i_d) / d["T_d20"]
            damper_q = (E_d - fast_d + (d["X_q1"] - d["X_d2"]) * i_q) / d["T_q20"]
        else:
            damper_d = (E_q - fast_q - (d["X_d1"] - self.X_l) * i_d) / d["T_d20"]
            damper_q = (E_d - fast_d + (d["X_q1"] - self.X_l) * i_q) / d["T_q20"]
            far_d, far_q = (
                (d[name] - d["X_d2"]) / (d[name] - self.X_l) ** 2 for name in ("X_d1", "X_q1")
            )
            d_axis = (d["X_d"] - d["X_d1"]) * (k_d * i_d + far_d * (E_q - fast_q))
            q_axis = (d["X_q"] - d["X_q1"]) * (-k_q * i_q + far_q * (E_d - fast_d))
        return np.concatenate(
            [
                2 * np.pi * 50 * (w - 1),
                (T_m - T_e) / (2 * d["H"]),
                (self._E_fd - E_q - d_axis) / d["T_d10"],
                (-E_d - q_axis) / d["T_q10"],
                damper_d,
                damper_q,
            ]
        )
