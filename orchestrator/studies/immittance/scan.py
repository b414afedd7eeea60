"""A scan: the admittance matrix of a device or a network at its ports, over frequency.

Inside, every scan is in one form: currents are counted into what is scanned, rows and columns are d and q of one port
after the other, and the q axis leads the d axis. What stands in a file in another form is turned as it is read."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Numbers, Vector
from orchestrator.core.errors import InputError

# units of an admittance
SIEMENS = "S"
PER_UNIT = "pu"

# frequencies down to this part of the highest tell signs: there a device's filter answers, not its
# control
_TOP = 5.0
# part of those at which both resistances must be negative for the sign to be called the generator's
_ACTIVE = 0.5

# Parts of the rated frequency that a scan shows; right ones of devices and networks show 0.4 to 1.03.
_OTHER_AXIS = -0.3  # below it the q axis is the other one
_IN_RAD = 2.0  # above it the frequencies are in rad/s, which show 2.9 to 6.4
_LEFT_OUT = 0.1  # to either side of 0: dq and qd were left out
_COIL = 0.3  # least likeness to a coil from which on it tells
_FEW = 8  # points from which on it tells
# most that an admittance may miss the relation by: resonances between coarse rows miss it by more
_CLEAR = 0.35
# most that both miss a relation by, in their geometric mean, where it tells without a coil
_SURE = 0.2
_TOPS = (_TOP, 2.5, np.inf)  # parts of the highest frequency from which on such a one is looked for

# a step of the frequency this many times as long as each of those beside it may be a hole
_HOLE = 3.0
_BESIDE = 8  # steps to either side with which it is compared


@dataclass(frozen=True)
class PortPoint:
    """Operating point of a port as a file states it; None for what it does not state."""

    kilovolt: float | None = None
    megawatt: float | None = None
    megavar: float | None = None
    angle: float | None = None


@dataclass(frozen=True)
class Scan:
    source: str  # the file's name, or what was scanned
    frequencies: Numbers  # in the dq frame [Hz], rising, shape (f,)
    values: Vector  # [``unit``], shape (f, 2p, 2p)
    ports: tuple[str, ...]  # names, length p
    unit: str = SIEMENS
    # bound of the error of ``values`` in the 2-norm, shape (f,); zeros where none is known.
    bounds: Numbers = field(default_factory=lambda: np.zeros(0))
    points: Mapping[str, PortPoint] = field(default_factory=dict)  # operating points, by port
    questions: tuple[str, ...] = ()  # what is unusual in it, for the user to answer

    def __post_init__(self) -> None:
        if not len(self.bounds):
            object.__setattr__(self, "bounds", np.zeros(len(self.frequencies)))

    @property
    def impedance(self) -> Complex:
        try:
            return np.asarray(np.linalg.inv(self.values))
        except np.linalg.LinAlgError as error:
            raise InputError(
                f"{self.source}: its admittance is singular at some frequency; scan it again"
            ) from error

    def rotated(self, angles: Sequence[float]) -> "Scan":
        """The same in a frame behind which each port's own lies by an angle [rad]: v = T(angle)·v_own."""
        T = block_rotation(angles)
        return replace(self, values=T @ self.values @ T.T)

    def scaled(self, factor: float, unit: str) -> "Scan":
        return replace(self, values=factor * self.values, bounds=factor * self.bounds, unit=unit)

    def in_siemens(self, kilovolt: float) -> "Scan":
        """A scan in per unit of the system base at a rated voltage."""
        return self.scaled(SYSTEM_BASE_MVA / kilovolt**2, SIEMENS)

    def turned_sign(self) -> "Scan":
        """The same with currents counted the other way."""
        return replace(self, values=-self.values)


def block_rotation(angles: Sequence[float]) -> Numbers:
    T = np.zeros((2 * len(angles), 2 * len(angles)))
    for k, angle in enumerate(angles):
        c, s = np.cos(angle), np.sin(angle)
        T[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[c, -s], [s, c]]
    return T


def other_q_axis(values: Vector) -> Complex:
    """The same with each q axis turned round."""
    signs = np.tile([1.0, -1.0], values.shape[-1] // 2)
    return np.asarray(values * signs[:, None] * signs[None, :])


def checked(source: str, frequencies: Numbers, values: Vector) -> tuple[str, ...]:
    if not (np.isfinite(values).all() and np.isfinite(frequencies).all()):
        raise InputError(
            f"{source}: a value is not a finite number; scan that frequency again or leave its row out"
        )
    if len(frequencies) < 8:
        raise InputError(
            f"{source}: there are {len(frequencies)} frequencies above 0; at least 8 are needed"
        )
    steps = np.diff(frequencies)
    if (steps <= 0).any():
        k = int(np.argmax(steps <= 0))
        raise InputError(
            f"{source}: the frequencies do not rise: {frequencies[k + 1]:g} Hz follows {frequencies[k]:g} Hz; sort the "
            "rows, and keep one of each frequency"
        )
    beside = [
        np.r_[steps[max(0, k - _BESIDE) : k], steps[k + 1 : k + 1 + _BESIDE]].max()
        for k in range(len(steps))
    ]
    holes = [
        f"{frequencies[k]:g} to {frequencies[k + 1]:g} Hz"
        for k in np.flatnonzero(steps > _HOLE * np.array(beside))
    ]
    return (
        (f"{source}: are rows missing from {', '.join(holes[:5])}? the steps beside are shorter",)
        if holes
        else ()
    )


def in_own_form(
    source: str, frequencies: Numbers, values: Vector, rated_hz: float, *, q_leads: bool
) -> tuple[Complex, tuple[str, ...]]:
    """Values with the q axis leading, and what is to be asked; at high frequencies a device is a circuit, which shows
    how its frame turns."""
    own = values if q_leads else other_q_axis(values)
    seen = _rated_seen(frequencies, own, rated_hz)
    if seen < _OTHER_AXIS:
        raise InputError(
            f"{source}: by its reactance at high frequencies the q axis {'lags' if q_leads else 'leads'} the d axis, "
            f"where this form has it {'leading' if q_leads else 'lagging'}; turn the sign of the dq and qd elements"
        )
    if seen > _IN_RAD:
        raise InputError(
            f"{source}: by its reactance at high frequencies its frame turns {seen:.2g} times as fast as at the rated "
            f"{rated_hz:g} Hz: are its frequencies in rad/s? Give them in Hz"
        )
    none = f"{source}: were dq and qd left at 0, or has one the wrong sign? They show no reactance where dd and qq do"
    return own, (none,) if abs(seen) < _LEFT_OUT else ()


def _rated_seen(frequencies: Numbers, values: Vector, rated_hz: float) -> float:
    """Rated frequency that a scan shows over the one given, negative where the q axis lags; 1 where none is seen.

    At high frequencies a device is a circuit Z(jω), that dq shows at ω + ω₀ in the one sequence and at ω − ω₀ in the
    other. Half their sum and difference, a and c, then meet a(ω + ω₀) − a(ω − ω₀) = c(ω + ω₀) + c(ω − ω₀). So do those
    of its admittance, which rises where it ends in a capacitor. Where neither rises so, as behind a damped capacitor,
    control may hide the relation: there only one that is met closely tells."""
    forms, seen = (np.linalg.pinv(values), values), 1.0
    for Z, most in zip(forms, (np.inf, _CLEAR), strict=True):
        coil, part, unlike = _turning(frequencies, Z, rated_hz, frequencies[-1] / _TOP)
        if _COIL < coil < 1 / _COIL:
            seen = part if unlike < most else 1.0
            break
    bands = [
        [_turning(frequencies, Z, rated_hz, frequencies[-1] / top)[1:] for Z in forms]
        for top in _TOPS
    ]

    def is_met(sign: int) -> bool:
        apart = ([math.hypot(part - sign, unlike) for part, unlike in band] for band in bands)
        return min(math.sqrt(math.prod(of_band)) for of_band in apart) < _SURE

    met, opposite = is_met(1), is_met(-1)
    if opposite:
        return -1.0
    return 1.0 if met and seen < _OTHER_AXIS else seen


def _turning(
    frequencies: Numbers, Z: Vector, rated_hz: float, start: float
) -> tuple[float, float, float]:
    """Likeness to a coil from a frequency on, the rated frequency that is seen, and by what part the relation fails."""
    f = frequencies[(frequencies >= start) & (frequencies > 2 * rated_hz)]
    f = f[f <= frequencies[-1] - rated_hz]
    if len(f) < _FEW:
        return 0.0, 1.0, np.inf
    along, cross = (Z[:, 0, 0] + Z[:, 1, 1]) / 2, 0.5j * (Z[:, 1, 0] - Z[:, 0, 1])
    a, c = ([np.interp(f + k * rated_hz, frequencies, x) for k in (-1, 1)] for x in (along, cross))
    size = a[0] + a[1] + 1e-300
    rises, turns = (a[1] - a[0]) / size, (c[1] + c[0]) / size
    coil = rises * f / rated_hz  # 1 of an inductance, 0 of a resistance
    seen = float(np.vdot(rises, turns).real / (np.vdot(rises, rises).real + 1e-300))
    unlike = np.linalg.norm(turns - seen * rises) / (np.linalg.norm(rises) + 1e-150)
    return float(np.median(coil.real)), seen, float(unlike)


def is_active(scan: Scan) -> bool:
    """Return whether it would deliver power in both axes at most of the high frequencies: the sign of a generator."""
    top = scan.values[scan.frequencies >= scan.frequencies[-1] / _TOP]
    largest = np.linalg.eigvalsh((top + top.conj().transpose(0, 2, 1)) / 2)[:, -1]
    size = np.linalg.norm(top, ord=2, axis=(1, 2))
    return bool((largest < -1e-4 * size).mean() > _ACTIVE)


def check_sign(scan: Scan, option: str) -> None:
    """Refuse an admittance whose currents are counted out of it."""
    if is_active(scan):
        raise InputError(
            f"{scan.source}: its resistance is negative in both axes at most high frequencies, as if it fed power into "
            f"every oscillation: are its currents counted out of it (generator sign)? Then give "
            + option
        )
