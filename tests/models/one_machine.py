"""A machine of DYR records beside an infinite bus, whose network changes at an instant: small enough for a test."""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import fsolve

from fmus.synchronous_generator.composed import synchronous_generator_phasor
from fmus.toolchain.frames import Phasor
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from tests.models.closed import Moved, closed
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
        numbers = ("open_re", "open_im", "impedance_re", "impedance_im")
        self._model = closed(self.device.model, numbers, _seen, at=0.0)

    def _moved(self):
        moved = Moved(self._model, self.device)
        moved.inputs[:] = _parts(self.network.seen(self.network.lines)[:2])
        return moved

    def eigenvalues(self, step=1e-7):
        """Eigenvalues [rad/s] of the machine at its network, by differences about the start."""
        return self._moved().eigenvalues(step)

    def run(self, lines, until, event=1.0, every=0.02, changed=None):
        """Outputs and voltages at every so many seconds; the network is ``lines`` alone after the event [s].

        ``changed``: values that parameters take at the event."""
        names = [v.name for v in self.device.model.parameters]
        seen, moved = self.network.seen(self.network.lines), self._moved()
        last, at_event, between = (round(t / STEP) for t in (until, event, every))
        stops = sorted({*range(0, last + 1, between), *([at_event] if at_event <= last else [])})
        rows = []
        for k, then in zip(stops, [*stops[1:], last], strict=True):
            if k == at_event:
                seen = self.network.seen(lines)
                moved.inputs[:] = _parts(seen[:2])
                for name, value in (changed or {}).items():
                    moved.parameters[names.index(name)] = value
            if k % between == 0:
                out = moved.outputs()
                i = complex(out["bus.i_re"], out["bus.i_im"])
                buses = {bus: a + b * i for bus, (a, b) in seen[2].items()}
                rows.append((k * STEP, out, buses))
            moved.advance(STEP, then - k)
        return rows


def _seen(still, seen):
    """Bus voltage of a machine behind its admittance, and the current that the network then sees of it."""
    open_voltage, impedance = Phasor(*seen[:2]), Phasor(*seen[2:])
    current, Y = Phasor(still["i_re"], still["i_im"]), Phasor(still["y_re"], still["y_im"])
    v = (open_voltage + impedance * current) / (Phasor(1.0, 0.0) + impedance * Y)
    through = current - Y * v
    return v, {"bus.i_re": through.re, "bus.i_im": through.im}


def _parts(numbers):
    return [part for number in numbers for part in (number.real, number.imag)]
