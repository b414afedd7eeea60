"""Verdict of voltage source behaviour from a device's figures at its operating points.

It follows from one number that codes give, MISO's 0.2 pu against a jump of 10° at SCR 3, as it comes to a
spring at the terminals (`asked_stiffness`). No public document at hand gives a limit in frequency; all else is told as
figures."""

from collections.abc import Sequence

from orchestrator.studies.certification.codes.frequency.point import AtPoint

SOURCES = (
    "limit: MISO BPM-015 r32 appendix H, 0.2 pu against a jump of 10° at SCR 3, by this program's derivation for the "
    "impedance of a source, seen in P over the angle and in Q over the magnitude; no code says so in frequency",
    "ESIG (September 2025), arXiv 2605.02131, NERC's and AEMO's specifications: their limits in frequency, if "
    "they have any, were not at hand; impedance, passivity, strength, inertia and damping are figures without verdict",
)


def verdict_of(points: Sequence[AtPoint]) -> bool | None:
    """Tell if it is a voltage source at each point; None where one was not measured, or stands in no network.

    A stiff answer alone is no proof: a derivative of a phase-locked loop opposes the angle too, above the loop's own
    bandwidth. Such a device was found stable at no short-circuit ratio."""
    if any(one.springs is not None and not one.springs.met for one in points):
        return False
    return None if any(map(_open_reason, points)) else True


def _open_reason(one: AtPoint) -> str:
    """Say why a point leaves the verdict open; "" if it does not."""
    if one.springs is None:
        return f"it was not measured: {one.failure}"
    if one.strengths is None or one.strengths.limit is not None:
        return ""
    ratios = one.strengths.ratios
    why = next((ratio.why for ratio in ratios if ratio.why), "")
    reason = f" ({why})" if why else ""
    return (
        f"its loop with a network was found stable at no short-circuit ratio from {ratios[0].scr:g} to "
        f"{ratios[-1].scr:g}{reason}, so what it opposes the angle with is no proof"
    )


def sentence_of(points: Sequence[AtPoint]) -> str:
    found = verdict_of(points)
    if found is None:
        point, reason = next((x.point, _open_reason(x)) for x in points if _open_reason(x))
        return f"not judged: at {point} {reason}"
    worst, at = min(
        ((one.springs, one.point) for one in points if one.springs is not None),
        key=lambda pair: pair[0].least,
    )
    low, high = worst.asked.band
    is_one = "it behaves as a voltage source" if found else "it does not behave as a voltage source"
    return (
        f"{is_one} at {len(points)} operating points: from {low:.3g} to {high:.3g} Hz its powers oppose the angle by "
        f"{worst.angle.value:.3g} pu/rad and the magnitude by {worst.magnitude.value:.3g} pu/pu at least ({at}); asked "
        f"{worst.asked.value:.3g} of both"
    )
