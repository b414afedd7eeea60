"""Records whose source is known: a case's linear model, forced at any reference, with noise of loads and of measuring.

The model is kept with its slow eigenvalues alone (tests/studies/oscillations/models); `python -m
tests.benchmarks.sources --models` makes them anew.
"""

from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np

import orchestrator as gfor
from orchestrator.studies.oscillations.measurements import Site, made_ready
from orchestrator.studies.oscillations.models import UnitModel, UnitModels

MODELS = Path(__file__).parents[1] / "studies" / "oscillations" / "models"
FASTEST = 80.0
"""Largest size of an eigenvalue that is kept [1/s]; of the others their gain at rest."""


@dataclass(frozen=True)
class Model:
    """dz/dt = Λz + Bu and y = Re(Cz) + Du, with conjugate pairs by one of the two.

    The outputs are i_re, i_im and v_re, v_im at every unit.
    """

    units: tuple[str, ...]
    buses: tuple[str, ...]
    inputs: tuple[str, ...]
    eigenvalues: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    v_0: np.ndarray
    i_0: np.ndarray

    @property
    def references(self):
        """``unit.reference`` of everything that can be forced."""
        return [name for name in self.inputs if not name.startswith("grid.")]

    def at(self, s):
        """Outputs, shape (current or voltage, unit, part, inputs), at a complex frequency."""
        parts = [
            C / (s - values) @ B
            for values, B, C in (
                (self.eigenvalues, self.B, self.C),
                (self.eigenvalues.conj(), self.B.conj(), self.C.conj()),
            )
        ]
        return (0.5 * (parts[0] + parts[1]) + self.D).reshape(2, len(self.units), 2, -1)

    def response(self, inputs, times):
        """Outputs, shape (n, m), for inputs, shape (n, k), along straight lines between the times."""
        step = times[1] - times[0]
        decay = np.exp(self.eigenvalues * step)
        now = (decay - 1) / self.eigenvalues
        slope = (now - step) / self.eigenvalues / step
        driven = inputs @ self.B.T
        z = np.zeros(len(self.eigenvalues), complex)
        states = np.empty((len(times), len(z)), complex)
        for k in range(len(times)):
            states[k] = z
            if k + 1 < len(times):
                z = decay * z + now * driven[k] + slope * (driven[k + 1] - driven[k])
        return np.real(states @ self.C.T) + inputs @ self.D.T


def make_model(case, scenario, values=None):
    """Linearise a case and keep what is slow."""
    ready = gfor.load(case).scenario(scenario, values or {})
    plans, flow = ready.prepared.system.components, ready.prepared.power_flow
    ports = {
        c.target.component: c.source.variable.removesuffix(".v_re")
        for c in ready.prepared.system.connections
        if c.target.variable == "v_re"
    }
    units = [name for name in plans if name in ports]
    references = ("delta_P_ref", "delta_V_ref", "delta_U_ref")
    inputs = [
        f"{u}.{v}" for u in units for v in plans[u].description.variables if v.endswith(references)
    ]
    inputs += [f"grid.{v}" for v in plans["grid"].description.variables if v.endswith(".scale")]
    outputs = [f"{u}.{part}" for u in units for part in ("i_re", "i_im")]
    outputs += [f"grid.{ports[u]}.{part}" for u in units for part in ("v_re", "v_im")]
    once = list(dict.fromkeys(outputs))  # units may share a bus
    rows = [once.index(name) for name in outputs]
    linear = ready.linearize(inputs, once, continuous=True)
    values, right = np.linalg.eig(linear.A)
    left = np.linalg.inv(right) @ linear.B
    seen = (linear.C @ right)[rows]
    slow = (np.abs(values) < FASTEST) & (values.imag >= 0)
    fast = np.abs(values) >= FASTEST
    D = linear.D[rows] - np.real((seen[:, fast] / values[fast]) @ left[fast])
    twice = np.where(values[slow].imag > 0, 2.0, 1.0)
    values = np.where(np.abs(values) < 1e-6, -1e-6, values)  # the angle that nothing holds
    v_0 = np.array([flow.voltages[ports[u]] for u in units])
    power = np.array([flow.powers[u] * plans[u].number("S_n") / 100 for u in units])
    return Model(
        tuple(units),
        tuple(ports[u] for u in units),
        tuple(inputs),
        values[slow],
        left[slow],
        seen[:, slow] * twice,
        D,
        v_0,
        np.conj(power / v_0),
    )


def save(model, name):
    small = {key: np.asarray(getattr(model, key)) for key in Model.__dataclass_fields__}
    small |= {key: small[key].astype(np.complex64) for key in ("B", "C")} | {
        "D": small["D"].astype(np.float32)
    }
    MODELS.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(MODELS / f"{name}.npz", **small)


def unit_models_of(system):
    """Each unit's own model, as the whole one implies it: what its currents do where something else is forced."""
    firsts = {bus: system.buses.index(bus) for bus in dict.fromkeys(system.buses)}

    def parts(unit, s):
        k, (current, voltage) = system.units.index(unit), outputs_at(system, s)
        own = np.array([name.startswith(f"{unit}.") for name in system.inputs])
        admittance = current[k][:, ~own] @ np.linalg.pinv(voltage[k][:, ~own])
        beside = current[k][:, own] - admittance @ voltage[k][:, own]
        reach = np.concatenate(
            [voltage[first][:, own] for first in firsts.values()]
        ) @ np.linalg.pinv(beside)
        return admittance, reach

    def load(name, s):
        voltage = outputs_at(system, s)[1][..., system.inputs.index(name)]
        return np.concatenate([voltage[first] for first in firsts.values()])[:, None]

    return UnitModels(
        {
            unit: UnitModel(
                bus,
                complex(system.v_0[k]),
                complex(system.i_0[k]),
                *(
                    partial(lambda unit, part, s: parts(unit, s)[part], unit, part)
                    for part in range(2)
                ),
            )
            for k, (unit, bus) in enumerate(zip(system.units, system.buses, strict=True))
        },
        tuple(firsts),
        {
            name.removesuffix(".scale"): partial(load, name)
            for name in system.inputs
            if name.startswith("grid.")
        },
    )


_AT = {}


def outputs_at(system, s):
    key = (id(system), s)
    if key not in _AT:
        _AT[key] = system.at(s)
    return _AT[key]


@cache
def model(name):
    with np.load(MODELS / f"{name}.npz") as kept:
        found = dict(kept)
    texts = {key: tuple(map(str, found.pop(key))) for key in ("units", "buses", "inputs")}
    return Model(
        **texts,
        **{
            key: value.astype(complex if value.dtype.kind == "c" else float)
            for key, value in found.items()
        },
    )


def sine(times, frequency, amplitude, begin=10.0, shape="sine"):
    wave = np.sin(2 * np.pi * frequency * (times - begin))
    return amplitude * (times >= begin) * (np.sign(wave) if shape == "square" else wave)


def times_of(length=70.0, rate=30.0):
    return np.arange(round(length * rate)) / rate


def load_noise(count, columns, rate, size, seed):
    """Powers of loads that wander: white noise through a first-order low-pass of 1 Hz, with a standard deviation."""
    white = np.random.default_rng(seed).standard_normal((count, columns))
    keep = np.exp(-2 * np.pi / rate)
    found = np.zeros_like(white)
    for k in range(1, count):
        found[k] = keep * found[k - 1] + np.sqrt(1 - keep**2) * white[k]
    return size * found


def record(name, forced, *, times=None, loads=0.0, measuring=0.0, seed=1, without=(), change=None):
    """Measurements at the units of a case.

    Parameters
    ----------
    forced
        Input → its values over the time.
    loads
        Standard deviation of all loads, as a part of their power.
    measuring
        Standard deviation of voltages [pu], angles [rad], and of currents as a part of their value.
    without
        Buses that are not observed.
    change
        Called with the list of places, to spoil them.
    """
    system = model(name)
    times = times_of() if times is None else times
    inputs = np.zeros((len(times), len(system.inputs)))
    for key, values in forced.items():
        inputs[:, system.inputs.index(key)] += values
    if loads:
        columns = [k for k, key in enumerate(system.inputs) if key.startswith("grid.")]
        inputs[:, columns] += load_noise(
            len(times), len(columns), 1 / (times[1] - times[0]), loads, seed
        )
    y = system.response(inputs, times).reshape(len(times), 2, len(system.units), 2)
    deviation = y[..., 0] + 1j * y[..., 1]
    # In each bus' own frame: what turns all angles changes no power and no magnitude, as in the grid.
    moved = deviation[:, 1] / system.v_0
    voltage = system.v_0 * np.exp(moved)
    turned = 1j * moved.imag
    current = np.exp(turned) * (system.i_0 + deviation[:, 0] - turned * system.i_0)
    rng = np.random.default_rng(seed + 1000)

    def noise():
        return measuring * rng.standard_normal(current.shape)

    v, angle = np.abs(voltage) + noise(), np.angle(voltage) + noise()
    current = current * (1 + noise() + 1j * noise())
    power = v * np.exp(1j * angle) * np.conj(current)
    places = [
        Site(
            unit,
            "unit",
            bus,
            v[:, k].copy(),
            angle[:, k].copy(),
            power[:, k].real.copy(),
            power[:, k].imag.copy(),
        )
        for k, (unit, bus) in enumerate(zip(system.units, system.buses, strict=True))
        if bus not in without
    ]
    places = places if change is None else change(places)
    return made_ready(name, times, places)
