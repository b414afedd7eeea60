"""The criteria of the norm on modes: of the linear model, and of a recorded signal."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Complex
from orchestrator.core.errors import AnalysisError
from orchestrator.core.threads import one_thread
from orchestrator.linear.signals.identification import IdentifiedMode, identify_modes
from orchestrator.linear.spectra.mode_names import CLEAR
from orchestrator.linear.spectra.mode_tracking import THRESHOLD, ModeSet, similarities
from orchestrator.linear.spectra.modes import ZERO, OfEigenvalue, damping_percent, damping_ratio
from orchestrator.output.results.mode_json import eigenvalue_json

FREQUENCIES = (0.1, 1.5)  # range of frequencies of the judged modes [Hz], both ends included
# range of frequencies in which a judged mode may lie in the other system [Hz]
PAIRED = (0.08, 1.875)
LEAST_DAMPING = 0.05  # damping ratio that a judged mode needs
# smaller parts of a signal's largest oscillation are ignored: they fit its remainder
LEAST_AMPLITUDE = 0.01

NAMES = ("off", "on", "response")
# more points between the dampings of an eigenvalue and of the recorded response are a finding
AGREED = 5.0


@dataclass(frozen=True, slots=True)
class ModeVerdict(OfEigenvalue):
    eigenvalue: complex
    # eigenvalue of the same mode without the converter; None where the converter introduces the mode.
    before: complex | None
    # similarity of the two modes, from 0 to 1, by their shapes over the states that both systems have. If the converter
    # introduces the mode, the similarity of the best candidate that is not matched with another mode.
    similarity: float
    accepted: bool
    reason: str
    components: str = ""
    doubt: str = ""  # which other mode without the converter it may be as well

    @property
    def before_percent(self) -> float | None:
        """Damping of the same mode without the converter [%]; None if there is no such mode."""
        return None if self.before is None else 100 * damping_ratio(self.before)


@dataclass(frozen=True)
class PodEffect:
    """``modes``: the electromechanical mode ``off``, ``on``, and nearest to it in the ``response``, where known.

    ``better_off``: how many times better the modes without the controllers fit the response."""

    modes_off: Complex
    modes: Mapping[str, complex]
    better_off: float | None = None
    unknown: str = ""  # why there is nothing of all that

    def apart(self, one: str, other: str) -> float | None:
        """Damping of a mode less that of another [points]."""
        a, b = self.modes.get(one), self.modes.get(other)
        return None if a is None or b is None else damping_percent(a) - damping_percent(b)

    @property
    def disagrees(self) -> bool | None:
        apart = self.apart("response", "on")
        return None if apart is None else abs(apart) > AGREED

    def as_json(self) -> dict[str, Any]:
        shown = {k: eigenvalue_json(x, damping_percent(x)) for k, x in self.modes.items()}
        modes = {k: shown.get(k) for k in NAMES}
        found = {
            "better_off": self.better_off,
            "raised": self.apart("on", "off"),
            "disagrees": self.disagrees,
        }
        return {
            "modes_off": [[x.real, x.imag] for x in self.modes_off],
            "modal": {**modes, **found},
            "unknown": self.unknown,
        }


@dataclass(frozen=True)
class ModalTest:
    modes: tuple[IdentifiedMode, ...]
    accepted: bool
    reason: str


def is_judged(frequency_hz: float) -> bool:
    return FREQUENCIES[0] <= frequency_hz <= FREQUENCIES[1]


def is_near(frequency_hz: float) -> bool:
    """Tell if a judged mode may have this frequency without the converter, or a mode of this frequency may become a
    judged one."""
    return PAIRED[0] <= frequency_hz <= PAIRED[1]


def critical_mode(modes: ModeSet) -> complex | None:
    judged = [value for value in modes.eigenvalues.tolist() if is_judged(value.imag / (2 * np.pi))]
    return min(judged, key=damping_ratio, default=None)


def judged_modes(matched: Iterable[ModeVerdict]) -> list[ModeVerdict]:
    """Those of the judged range, least damped first.

    A mode below 5 % is accepted only where the same mode had less than 5 % without the converter already: the norm
    asks that the converter introduces none and takes none below."""
    return sorted(
        (m for m in matched if is_judged(m.frequency_hz)), key=lambda v: v.damping_percent
    )


def neighbouring_modes(matched: Iterable[ModeVerdict]) -> list[ModeVerdict]:
    """Known modes outside the judged range, by frequency. They are listed only, without a judgement."""
    found = sorted(
        (m for m in matched if not is_judged(m.frequency_hz)), key=lambda m: m.frequency_hz
    )
    return [replace(m, accepted=True, reason="outside the judged range") for m in found]


def matched_modes(
    having: ModeSet, lacking: ModeSet, components: list[str] | None = None
) -> Iterator[ModeVerdict]:
    """Each mode with the converter, and which it was without. Where another one is about as like, it is told; of
    both the better damped one counts where a mode has not enough damping: it excuses nothing."""
    alike = np.zeros((len(having.eigenvalues), len(lacking.eigenvalues)))
    if alike.size:
        alike = np.where(_comparable(having, lacking), similarities(having, lacking), 0.0)
    partners = _partners(alike)
    left = [column for column in range(alike.shape[1]) if column not in partners.values()]
    for k, value in enumerate(having.eigenvalues.tolist()):
        partner, doubt = partners.get(k), ""
        rivals = [
            j for j in left if partner is not None and alike[k, j] >= CLEAR * alike[k, partner]
        ]
        if partner is not None and rivals:
            both = [partner, max(rivals, key=lambda j: alike[k, j])]
            if damping_ratio(value) < LEAST_DAMPING:
                both.sort(key=lambda j: -damping_ratio(complex(lacking.eigenvalues[j])))
            partner, other = both[0], complex(lacking.eigenvalues[both[1]])
            doubt = (
                f"or {other.imag / (2 * np.pi):.3f} Hz, {100 * damping_ratio(other):.2f} %, as like"
            )
            left = [j for j in (*left, both[1]) if j != partner]
        before = None if partner is None else complex(lacking.eigenvalues[partner])
        likeness = float(alike[k, left].max(initial=0.0) if partner is None else alike[k, partner])
        accepted, reason = judge_mode(value, before)
        yield ModeVerdict(
            value,
            before,
            similarity=likeness,
            accepted=accepted,
            reason=reason,
            components=components[k] if components else "",
            doubt=doubt,
        )


def _comparable(having: ModeSet, lacking: ModeSet) -> NDArray[np.bool_]:
    """Mask of the pairs that may be one mode: a judged mode and a mode that is not judged must have near
    frequencies."""
    judged = [[is_judged(hz) for hz in s.frequencies] for s in (having, lacking)]
    near = [[is_near(hz) for hz in s.frequencies] for s in (having, lacking)]
    forbidden = np.logical_and.outer(judged[0], np.logical_not(near[1]))
    forbidden |= np.logical_and.outer(np.logical_not(near[0]), judged[1])
    return np.logical_not(forbidden)


def _partners(alike: NDArray[np.float64]) -> dict[int, int]:
    """Column for each row. Each column is used once, the sum of the similarities is largest, and pairs below the
    threshold are left out. If each row took its largest similarity, one mode without the converter could excuse several
    modes with it."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - half a second to import

    enough = np.where(alike >= THRESHOLD, alike, 0.0)
    rows, columns = linear_sum_assignment(enough, maximize=True)
    return {int(k): int(j) for k, j in zip(rows, columns, strict=True) if enough[k, j] > 0}


def judge_mode(value: complex, before: complex | None) -> tuple[bool, str]:
    percent = 100 * damping_ratio(value)
    limit = 100 * LEAST_DAMPING
    if damping_ratio(value) >= LEAST_DAMPING:
        return True, f"{percent:.2f} % ≥ {limit:g} %"
    if before is None:
        return False, f"the converter introduces a mode with {percent:.2f} % < {limit:g} %"
    was = 100 * damping_ratio(before)
    if damping_ratio(before) < LEAST_DAMPING:
        return True, f"{percent:.2f} %, and already {was:.2f} % < {limit:g} % without the converter"
    return False, f"the converter takes a mode from {was:.2f} % to {percent:.2f} % < {limit:g} %"


def stability_fault(
    growth_with: float,
    growth_without: float,
    with_converter: Mapping[str, Any] | None = None,
    without: Mapping[str, Any] | None = None,
) -> str | None:
    """The fault of a converter that makes the system unstable at any frequency; None without such a fault. A system
    that was unstable without the converter excuses it."""
    if not np.isfinite(growth_with):
        return "the largest growth rate with the converter is not a number, so that nothing shows that it is stable"
    if growth_with > ZERO >= growth_without:
        return f"the converter makes the system unstable: an eigenvalue has a real part of {growth_with:+.3g} 1/s"
    if (
        with_converter
        and with_converter["stable"] is False
        and not (without and without["stable"] is False)
    ):
        return f"the converter makes the system unstable: {with_converter['sentence']}"
    return None


def modal_test(times: NDArray[np.float64], signal: NDArray[np.float64], start: float) -> ModalTest:
    if not np.isfinite(signal).all():
        return ModalTest((), False, "the signal is not finite")
    window = times >= start
    try:
        with one_thread():
            found = identify_modes(times[window], signal[window])
    except AnalysisError as error:
        return ModalTest((), False, str(error))
    except np.linalg.LinAlgError:
        return ModalTest(
            (), False, "the signal grows beyond all bounds; no modes can be read from it"
        )
    oscillating = [m for m in found if m.eigenvalue.imag > 0]
    largest = max((m.amplitude for m in oscillating), default=0.0)
    judged = tuple(
        m
        for m in oscillating
        if is_judged(m.frequency_hz) and m.amplitude >= LEAST_AMPLITUDE * largest
    )
    bad = [m for m in judged if not m.damping_percent > 100 * LEAST_DAMPING]
    if bad:
        worst = min(bad, key=lambda m: m.damping_percent)
        return ModalTest(
            judged, False, f"{worst.frequency_hz:.3f} Hz has {worst.damping_percent:.2f} % ≤ 5 %"
        )
    if not judged:
        return ModalTest(judged, True, "no oscillation from 0.1 to 1.5 Hz")
    least = min(judged, key=lambda m: m.damping_percent)
    return ModalTest(
        judged, True, f"least {least.damping_percent:.2f} % at {least.frequency_hz:.3f} Hz > 5 %"
    )
