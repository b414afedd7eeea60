"""Stretches that are too short to tell a lasting motion from one that still decays."""

from collections.abc import Sequence

from orchestrator.watch.finding import Finding
from orchestrator.watch.stretches import Stretch

SETTLING = 2.0
"""Shortest stretch in which a swing that goes on is a fault [s]. In a shorter one it may be what an event excites in
the network, such as a current's offset, which takes up to a second to decay; growth is a fault in any."""


def is_short(stretch: Stretch) -> bool:
    """Whether only growth can be judged in a stretch."""
    return stretch.end - stretch.begin < SETTLING * (1 - 1e-9)


def too_short(stretches: Sequence[Stretch]) -> list[Finding]:
    """One remark on stretches whose end shows a motion, or has too few looks to show any, and which are too short.

    Parameters
    ----------
    stretches
        In the order of their beginning.
    """
    if not stretches:
        return []
    spans = " and ".join(
        f"between t = {s.begin:.4g} s and {'the end' if s.last else 'the event'} at t = {s.end:.4g} s"
        for s in stretches
    )
    last = stretches[-1]
    remedy = f"let the run go on to t = {last.begin + SETTLING:.4g} s" if last.last else "give the events more distance"
    message = (
        f"whether the response settles is not judged {spans}: what an event excites may still decay after less than "
        f"{SETTLING:g} s; {remedy}"
    )
    return [Finding("not_judged", stretches[0].begin, "", "", message, None if last.last else last.end)]
