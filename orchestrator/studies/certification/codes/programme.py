"""Programme of the test bench in one row of a code: its operating point, and what changes when."""

from dataclasses import dataclass, field
from itertools import pairwise
from math import hypot, radians, sqrt

import numpy as np

from orchestrator.cases.form.schema import Value
from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import InputError

# rating that the plant under test is given [MVA], so that its per unit are the bench's
RATING_MVA = 100.0
FIRST = 1.0  # when the first thing happens [s]


@dataclass(frozen=True, slots=True)
class BenchChange:
    time: float
    parameter: str
    value: Value


@dataclass(frozen=True)
class BenchProgramme:
    # short-circuit ratio at the connection point: 1/|R + jX| in per unit of the plant's rating
    scr: float
    power: float  # active power of the plant at the start [pu of its rating]
    changes: tuple[BenchChange, ...]
    stop: float
    x_r: float = 6.0
    # active power of the load [pu of the plant's rating], and its power factor (lagging).
    load: tuple[float, float] = (0.0, 1.0)
    # active power of the duplicate of half rating [pu of its own rating]; None without one.
    duplicate: float | None = None

    @property
    def impedance(self) -> complex:
        """R + jX of the source at the start [pu of the plant's rating]."""
        X = 1 / self.scr / hypot(1, 1 / self.x_r)
        return complex(X / self.x_r, X)

    @property
    def times(self) -> tuple[float, ...]:
        return tuple(dict.fromkeys(change.time for change in self.changes))

    def source_angle(self, times: Numbers, f_n: float) -> Numbers | None:
        """Angle of the source against one that turns at the rated frequency [rad]; None where the source is lost."""
        if any(change.parameter == "source.connected" for change in self.changes):
            return None
        angle = np.zeros(times.shape)
        for parameter, power in (("source.jump", 0), ("source.rise", 2)):
            before = 0.0
            for change in (c for c in self.changes if c.parameter == parameter):
                since = np.maximum(times - change.time, 0)
                by = float(change.value) - before
                angle += (
                    by * (times >= change.time) if power == 0 else np.pi * f_n * by * since**power
                )
                before = float(change.value)
        return angle

    @property
    def load_mvar(self) -> float:
        """Reactive power of the load [Mvar]."""
        power, factor = self.load
        return RATING_MVA * power * sqrt(1 / factor**2 - 1)


@dataclass
class _Ramps:
    rated: float
    changes: list[BenchChange] = field(default_factory=list)
    time: float = FIRST

    def to(self, rate: float, by: float) -> None:
        """Move the frequency by so many Hz at a rate [Hz/s]."""
        signed = abs(rate) if by > 0 else -abs(rate)
        self.changes.append(BenchChange(self.time, "source.rise", signed / self.rated))
        self.time = round(self.time + by / signed, 6)
        self.changes.append(BenchChange(self.time, "source.rise", 0.0))


def jumps(
    scr: float, power: float, degrees: tuple[float, ...], hold: float = 5.0
) -> BenchProgramme:
    """The source's angle jumps by each of the angles in turn [°]; they add up, and each holds so long [s]."""
    total, changes = 0.0, []
    for k, angle in enumerate(degrees):
        total += angle
        changes.append(BenchChange(FIRST + k * hold, "source.jump", radians(total)))
    return BenchProgramme(scr, power, tuple(changes), FIRST + len(degrees) * hold)


def ramps(
    scr: float, power: float, rated: float, rate: float, steps: tuple[float, ...], hold: float = 5.0
) -> BenchProgramme:
    """The source's frequency moves by each of the steps in turn [Hz], at a rate [Hz/s], and holds after each [s]."""
    made = _Ramps(rated)
    for by in steps:
        made.to(rate, by)
        made.time = round(made.time + hold, 6)
    return BenchProgramme(scr, power, tuple(made.changes), made.time)


def weakening(
    start: float,
    power: float,
    ratios: tuple[float, ...],
    conductance: float,
    lasts: float,
    hold: float = 3.0,
) -> BenchProgramme:
    """The short-circuit ratio steps down, each time as a balanced fault at the bus is cleared.

    ``conductance``: Of the fault, in parts of the source's admittance before it, so that its depth is the same each
    time.
    ``hold``: Time between two clearances [s]."""
    changes, before = [], start
    for k, ratio in enumerate(ratios):
        cleared = FIRST + k * hold
        changes.append(BenchChange(round(cleared - lasts, 6), "fault.G", conductance * before))
        changes += [BenchChange(cleared, "fault.G", 0.0)]
        changes += [BenchChange(cleared, f"{name}_factor", start / ratio) for name in ("X", "R")]
        before = ratio
    return BenchProgramme(start, power, tuple(changes), FIRST + len(ratios) * hold)


def voltage(
    scr: float, power: float, factors: tuple[tuple[float, float], ...], stop: float
) -> BenchProgramme:
    """The source's voltage takes one factor after the other.

    ``factors``: pairs of a time and a factor, in this order: the time after the first event from which it holds [s],
    and the voltage in parts of that at the start. The first time is 0, and times rise.
    ``stop``: when the run ends; the first event is at 1 s [s].

    Raises an `InputError` for other times, as a pair has that is written the other way round."""
    times = [after for after, _ in factors]
    if times[:1] != [0.0] or any(later <= sooner for sooner, later in pairwise(times)):
        raise InputError(
            f"voltage: the factors' times are {', '.join(f'{t:g}' for t in times) or 'missing'} s; "
            "give pairs (time, factor) whose first time is 0 and whose times rise"
        )
    changes = tuple(
        BenchChange(round(FIRST + after, 6), "source.factor", factor) for after, factor in factors
    )
    return BenchProgramme(scr, power, changes, stop)


def last_machine(
    plant: float, duplicate: float, load: float, factor: float = 0.95
) -> BenchProgramme:
    """The source is disconnected; the plant and a duplicate of half its rating are left with the load.

    ``plant``, ``duplicate``: Active power of each at the start [pu of its own rating].
    ``load``: Active power of the load [pu of the plant's rating]."""
    return BenchProgramme(
        10.0,
        plant,
        (BenchChange(FIRST, "source.connected", False),),
        11.0,
        load=(load, factor),
        duplicate=duplicate,
    )
