"""A device with three phases at a source of three phases: behind nothing, or behind an impedance.

The source has three wires and no zero sequence: a device behind a transformer's delta winding sees none. Phase
quantities turn while they are held, so each voltage is that of the middle of its step."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import atan2, hypot

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Numbers
from orchestrator.devices.acceptance.checks.port import present_current, rating_of
from orchestrator.devices.acceptance.checks.sequences import (
    THIRD,
    Ripple,
    SequencePair,
    in_phases,
    pair_of,
    remainder_of,
    ripple_of,
)
from orchestrator.devices.acceptance.checks.subject import Running, Subject
from orchestrator.devices.acceptance.linear_network import LinearNetwork
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.port_mapping import BoundDescription, Form

SCR = 10.0
"""Short-circuit ratio of the source's impedance, as in the bench of `gfor certify --code`."""

X_R = 6.0
"""Ratio of its reactance to its resistance at rated frequency, as there."""

COARSEST = 1 / 40
"""Periods in a communication step from which on held phase quantities say nothing of a negative sequence: 0.5 ms."""


def omega_of(subject: Subject) -> float | None:
    """Rated angular frequency [rad/s] of a device that takes and gives phase quantities; None of any other."""
    described = subject.description
    if not subject.port or not isinstance(described, BoundDescription):
        return None
    forms = {described.port.voltage.form, described.port.current.form}
    return described.port.omega if forms == {Form.ABC} else None


def lead_of(subject: Subject) -> float:
    """Angle [rad] by which the device's phases lead those of the network, by its binding."""
    described = subject.description
    assert isinstance(described, BoundDescription)
    matrix = described.port.voltage.matrix
    return atan2(matrix[2], matrix[0])


def why_not(subject: Subject) -> str:
    """The reason why a device is not tried at phases of its own; "" where it is."""
    omega = omega_of(subject)
    if omega is None:
        return "because it takes and gives no phase quantities (form abc in its binding)"
    if omega * subject.step_size > 2 * np.pi * COARSEST:
        return f"because phase quantities are held for {1000 * subject.step_size:g} ms: give a --step of 0.1 ms"
    return ""


@dataclass(frozen=True)
class Course:
    """Voltage [pu] and injected current [pu, S_n] in the network's frame, each at its own times [s]."""

    v: Complex
    v_times: Numbers
    i: Complex
    i_times: Numbers
    omega: float
    lead: float = 0.0  # of the device's phases [rad]

    def between(self, begin: float, end: float) -> "Course":
        """The part of it between two times [s] after its first step's begin."""
        step = 2 * (self.i_times[0] - self.v_times[0])
        part = slice(round(begin / step), round(end / step))
        return Course(
            self.v[part],
            self.v_times[part],
            self.i[part],
            self.i_times[part],
            omega=self.omega,
            lead=self.lead,
        )

    @property
    def voltage(self) -> SequencePair:
        """Both sequences of the voltage [pu]."""
        return pair_of(self.v, self.v_times, self.omega)

    @property
    def current(self) -> SequencePair:
        """Both sequences of the current [pu, S_n]."""
        return pair_of(self.i, self.i_times, self.omega)

    @property
    def remainder(self) -> float:
        """The part of the current that swings otherwise than both sequences do, r.m.s. [pu, S_n]."""
        return remainder_of(self.i, self.i_times, self.omega)

    @property
    def phase_currents(self) -> Numbers:
        """Instantaneous currents of the device's phases [pu of the rated peak], shape (n, 3)."""
        return in_phases(self.i * np.exp(1j * self.lead), self.i_times, self.omega)

    @property
    def ripple(self) -> Ripple:
        """Swing of the power at twice the frequency [pu, S_n]."""
        return ripple_of(self.voltage, self.current)


def at_ideal_source(running: Running, seconds: float, factor: Mapping[float, complex]) -> Course:
    """Step at an ideal voltage: that of its start times a sum of turning numbers.

    ``factor``: angular frequency in the frame [rad/s] → amplitude [1]."""
    subject = running.subject
    omega = omega_of(subject)
    assert omega is not None
    h, steps = subject.step_size, max(1, round(seconds / subject.step_size))
    times: Numbers = running.time + (np.arange(steps, dtype=float) + 0.5) * h
    terms = [np.asarray(size) * np.exp(1j * rate * times) for rate, size in factor.items()]
    wanted = (running.point or subject.point).voltage * np.sum(terms, axis=0)
    names = subject.inputs
    rows = np.zeros((steps, len(names)))
    for name, part in (("v_re", wanted.real), ("v_im", wanted.imag)):
        rows[:, names.index(name)] = part - running.rest[names.index(name)]
    values = running.hold(rows, steps, h)
    columns = [subject.watched.index(name) for name in ("i_re", "i_im")]
    current = values[:, columns] @ np.array([1, 1j]) * SYSTEM_BASE_MVA / rating_of(running)
    return Course(wanted, times, current, times + h / 2, omega)


@dataclass
class PhaseSource:
    """A source of three phases behind an inductance with a resistance beside it, and the device at its end.

    The impedance is R ∥ jX: |Z| = 1/SCR at rated frequency, and X/R as a line's. Its state is the inductance's current;
    with it move the source's two sequences and the currents that were read last."""

    running: Running
    scr: float = SCR
    E: complex = field(init=False)  # positive sequence of the source at rest [pu]

    def __post_init__(self) -> None:
        running, omega = self.running, omega_of(self.running.subject)
        assert omega is not None
        self.omega, h = omega, running.subject.step_size
        X = hypot(1, X_R) / X_R / self.scr
        R = X_R * X
        self.impedance = 1j * X * R / (R + 1j * X)
        i = present_current(running)
        start = (running.point or running.subject.point).voltage
        self.E = start - self.impedance * i
        in_inductance = i * R / (R + 1j * X)
        rate = -omega * complex(R / X, 1)

        def parts_after(time: float) -> tuple[complex, complex]:
            """Part of its own current, and of the device's, that the inductance has after so long [1]."""
            own = np.exp(rate * time)
            return own, (own - 1) / rate * omega * R / X

        own, fed = parts_after(h)
        half_own, half_fed = parts_after(h / 2)
        turn = np.exp(-2j * omega * h)
        # states: the inductance's current, both sequences of the source, the currents that were read last and before
        A = np.diag([own, 1, turn, 0, 0]).astype(complex)
        A[0, 3] = fed / 2
        A[4, 3] = 1
        scale = SYSTEM_BASE_MVA / rating_of(running)
        B = np.array([[scale * fed / 2], [0], [0], [scale], [0]])
        # the current in the middle of the step, and its mean until then, by a straight line through the last two
        C = np.array(
            [
                [
                    -R * half_own,
                    1,
                    np.exp(-1j * omega * h),
                    R * (1.5 - 1.25 * half_fed),
                    R * (-0.5 + 0.25 * half_fed),
                ]
            ]
        )
        names = running.subject.inputs
        inputs: Numbers = np.zeros((len(names), 10))
        inputs[[names.index("v_re"), names.index("v_im")]] = _real(C)
        self._out = RealBatch(running.component, ("i_re", "i_im", "v_re", "v_im"))
        read: Numbers = np.hstack([_real(B), np.zeros((10, 2))])
        state = _real(np.array([[in_inductance], [self.E], [0], [i], [i]]))[:, 0]
        self.network = LinearNetwork(_real(A), read, inputs, state)

    def set_sequences(self, source: SequencePair) -> None:
        """Give the source another voltage from now on: both sequences in parts of its voltage at rest.

        They are those of the device's own phases: what turns these ahead turns the negative sequence back."""
        lead = lead_of(self.running.subject)
        now = np.exp(-2j * (self.omega * self.running.time + lead))
        negative = (source.negative * self.E).conjugate() * now
        for place, value in ((2, source.positive * self.E), (4, negative)):
            self.network.x[place : place + 2] = value.real, value.imag

    def run(self, seconds: float) -> Course:
        """Step for a while."""
        running, h = self.running, self.running.subject.step_size
        steps = max(1, round(seconds / h))
        begin = running.time
        values = running.coupled(self.network, self._out, steps)
        times: Numbers = begin + (np.arange(steps, dtype=float) + 0.5) * h
        scale = SYSTEM_BASE_MVA / rating_of(running)
        current, voltage = values[:, :2] @ np.array([1, 1j]), values[:, 2:] @ np.array([1, 1j])
        lead = lead_of(running.subject)
        return Course(voltage, times, scale * current, times + h / 2, omega=self.omega, lead=lead)


def of_phase_factors(factors: tuple[complex, complex, complex]) -> SequencePair:
    """Both sequences of a source whose phases are multiplied by one factor each; the zero sequence stays away."""
    turn = np.exp(1j * THIRD * np.arange(3))
    phases = np.array(factors) / turn
    return SequencePair(complex((phases * turn).mean()), complex((phases / turn).mean()))


def _real(matrix: Complex) -> Numbers:
    """A complex matrix as one of real numbers, two for each."""
    rows, columns = matrix.shape
    found: Numbers = np.empty((2 * rows, 2 * columns))
    found[0::2, 0::2] = found[1::2, 1::2] = matrix.real
    found[1::2, 0::2], found[0::2, 1::2] = matrix.imag, -matrix.imag
    return found
