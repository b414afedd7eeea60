"""A machine of DYR records beside an infinite bus, whose network changes at an instant: small enough for a test."""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import fsolve

from fmus.synchronous_generator.composed import synchronous_generator_phasor
from fmus.toolchain.symbols import Function, symbols
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from tests.support.evaluated import Evaluated

S_BASE = 100.0  # of networks here [MVA]
STEP = 2e-3  # of the integration [s]


@dataclass(frozen=True)
class Network:
    """Buses by number; impedances between them and powers that stay constant impedances [pu on 100 MVA].

    ``lines``: (from, to, Z), of a transformer (from, to, Z, ratio, ratio); ``loads``: P + jQ at the bus' voltage of the
    power flow; ``infinite``: its bus; ``machine``: the bus of the one machine."""

    voltages: dict[int, complex]
    lines: tuple[tuple[int, int, complex], ...]
    infinite: int
    machine: int
    loads: dict[int, complex] = field(default_factory=dict)
    behind: complex = 1e-5j  # what the infinite emf lies behind

    def injected(self) -> complex:
        """P + jQ of the machine in the power flow [pu]."""
        Y, at = self._admittances(self.lines)
        v = np.array([self.voltages[bus] for bus in at])
        here = list(at).index(self.machine)
        return complex(v[here] * np.conj(Y[here] @ v))

    def seen(self, lines) -> tuple[complex, complex, dict[int, tuple[complex, complex]]]:
        """Open-circuit voltage and impedance at the machine's bus; and every bus' voltage as a + b·i of the machine."""
        Y, at = self._admittances(lines)
        rows = list(at)
        slack, here = rows.index(self.infinite), rows.index(self.machine)
        v0 = np.array([self.voltages[bus] for bus in at])
        emf = v0[slack] + self.behind * (self._admittances(self.lines)[0] @ v0)[slack]
        Y[slack, slack] += 1 / self.behind
        source = np.zeros(len(rows), complex)
        source[slack] = emf / self.behind
        unit = np.zeros(len(rows), complex)
        unit[here] = 1.0
        constant, slope = np.linalg.solve(Y, source), np.linalg.solve(Y, unit)
        buses = {bus: (constant[k], slope[k]) for k, bus in enumerate(rows)}
        return constant[here], slope[here], buses

    def _admittances(self, lines):
        at = {bus: k for k, bus in enumerate(self.voltages)}
        Y = np.zeros((len(at), len(at)), complex)
        for start, end, Z, *ratios in lines:
            turns = np.zeros(len(at))
            turns[at[start]], turns[at[end]] = 1 / (ratios or [1.0])[0], -1 / (ratios or [1.0])[-1]
            Y += np.outer(turns, turns) / Z
        for bus, load in self.loads.items():
            Y[at[bus], at[bus]] += np.conj(load) / abs(self.voltages[bus]) ** 2
        return Y, at


def four_buses():
    """The buses of PowerSimulationsDynamics.jl's TVC_System_32.raw, and what is left after the trip of a line 1-4."""
    angles = {1: (1.08, 0.0), 2: (1.01, -14.7847), 3: (1.02393, -20.8224), 4: (1.02001, -17.5621)}
    line = (1, 4, 0.0554j)
    step_up, step_down = (2, 4, 0.016j, 1.0, 1.04), (4, 3, 0.004j, 0.99, 1.0)
    voltages = {bus: v * np.exp(1j * np.radians(angle)) for bus, (v, angle) in angles.items()}
    lines = (line, line, step_up, step_down)
    load = 15.0 + 7.5j - 6j * abs(voltages[3]) ** 2
    return Network(voltages, lines, infinite=1, machine=2, loads={3: load}, behind=0.01j), lines[1:]


def three_buses(tripped=((101, 102),), given=1.0, drawn=2.5):
    """The three buses of PowerSimulationsDynamics.jl's ThreeBusMulti.raw, and the lines that stay after the trip.

    ``given``, ``drawn``: power of the machine and of the load [pu], which differ from file to file."""
    Z = 0.01 + 0.12j
    lines = ((101, 102, Z), (101, 103, Z), (102, 103, Z))
    voltages = _solved(lines, given, drawn)
    network = Network(voltages, lines, infinite=101, machine=102, loads={103: drawn + 0.3j})
    return network, tuple(line for line in lines if line[:2] not in tripped)


def _solved(lines, given, drawn):
    """Power flow: 1.05 at bus 101, power and 1.02 at bus 102, power and 30 Mvar at bus 103."""

    def misfit(x):
        v = {101: 1.05 + 0j, 102: 1.02 * np.exp(1j * x[0]), 103: x[1] * np.exp(1j * x[2])}
        flow = dict.fromkeys(v, 0j)
        for start, end, Z in lines:
            current = (v[start] - v[end]) / Z
            flow[start] += v[start] * np.conj(current)
            flow[end] -= v[end] * np.conj(current)
        return [flow[102].real - given, flow[103].real + drawn, flow[103].imag + 0.3]

    x = fsolve(misfit, [0.0, 1.0, -0.1], xtol=1e-13)
    return {101: 1.05 + 0j, 102: 1.02 * np.exp(1j * x[0]), 103: x[1] * np.exp(1j * x[2])}


class OneMachine:
    """A generator of DYR records at a network."""

    def __init__(self, dyr, folder, network, *, rating=S_BASE, source=0.0, f_n=60.0, torque=False):
        place = folder / "one.dyr"
        place.write_text(dyr, encoding="utf-8")
        power = network.injected()
        v = network.voltages[network.machine]
        machine = Machine(
            network.machine, "1", 1, power.real * S_BASE, abs(v), rating, source, -9e3, 9e3
        )
        model = machine_models(read_dyr(place), [machine])[network.machine, "1"]
        parts = {
            "exciter": "manual",
            "governor": "constant_power",
            "stabilizer": "none",
            **model.parts,
        }
        self.network = network
        self.device = Evaluated(
            synchronous_generator_phasor(**parts),
            {
                "S_n": rating,
                "S_base": S_BASE,
                "f_n": f_n,
                "v_0": abs(v),
                "theta_0": float(np.angle(v)),
                "P_0": power.real * S_BASE / rating,
                "Q_0": power.imag * S_BASE / rating,
                "machine.speed_in_emf": 0,
                "governor.output_is_torque": torque,
                **model.parameters,
            },
        )

    def eigenvalues(self, step=1e-7):
        """Eigenvalues [rad/s] of the machine at its network, by differences about the start."""
        seen = _parts(self.network.seen(self.network.lines)[:2])
        x0, (rates, _) = np.array(self.device.x, dtype=float), self._at_network(self.device.p)

        def rate(x):
            return np.array(rates.values([x.tolist(), seen])[0])

        columns = [
            (rate(x0 + step * unit) - rate(x0 - step * unit)) / (2 * step)
            for unit in np.eye(len(x0))
        ]
        return np.linalg.eigvals(np.array(columns).T)

    def _at_network(self, p):
        """Rates, and outputs with the machine's current behind its admittance, as functions at these parameters.

        Their arguments: the states; real and imaginary part of the network's open-circuit voltage, and of its
        impedance."""
        model, c = self.device.model, self.device.c
        x, seen = symbols("x", len(model.states)), symbols("seen", 4)
        still = _by_name(model, model.outputs_function.of(x, [0.0, 0.0], p, c))
        current, y = (still["i_re"], still["i_im"]), (still["y_re"], still["y_im"])
        dropped, turned = _product(seen[2:], current), _product(seen[2:], y)
        below = 1 + turned[0], -turned[1]  # conjugate
        size = below[0] * below[0] + below[1] * below[1]
        v = [part / size for part in _product((seen[0] + dropped[0], seen[1] + dropped[1]), below)]
        through = _product(y, v)
        out = [*model.outputs_function.of(x, v, p, c)[0]]
        out += [current[0] - through[0], current[1] - through[1]]
        rates = model.derivatives.of(x, v, p, c)[0]
        return Function("rates", [x, seen], [rates]), Function("outputs", [x, seen], [out])

    def run(self, lines, until, event=1.0, every=0.02, changed=None):
        """Outputs and voltages at every so many seconds; the network is ``lines`` alone after the event [s].

        ``changed``: values that parameters take at the event."""
        model, p = self.device.model, self.device.p.copy()
        names = [v.name for v in model.outputs]
        seen = self.network.seen(self.network.lines)
        given, (rates, outputs) = _parts(seen[:2]), self._at_network(p)
        x = np.array(self.device.x, dtype=float)
        rows = []

        def rate(x):
            return np.array(rates.values([x.tolist(), given])[0])

        for k in range(round(until / STEP) + 1):
            if k == round(event / STEP):
                seen = self.network.seen(lines)
                given = _parts(seen[:2])
                for name, value in (changed or {}).items():
                    p[[v.name for v in model.parameters].index(name)] = value
                    rates, outputs = self._at_network(p)
            if k % round(every / STEP) == 0:
                *out, re, im = outputs.values([x.tolist(), given])[0]
                buses = {bus: a + b * complex(re, im) for bus, (a, b) in seen[2].items()}
                rows.append((k * STEP, dict(zip(names, out, strict=True)), buses))
            k1 = rate(x)
            k2 = rate(x + STEP / 2 * k1)
            k3 = rate(x + STEP / 2 * k2)
            k4 = rate(x + STEP * k3)
            x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return rows


def _by_name(model, outputs):
    return dict(zip([v.name for v in model.outputs], outputs[0], strict=True))


def _product(a, b):
    """The product of two complex numbers, each as its parts."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _parts(numbers):
    return [part for number in numbers for part in (number.real, number.imag)]
