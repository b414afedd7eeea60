"""The place between two values where a condition ends, by halving the distance between them."""

from collections.abc import Callable


def halve_towards(
    holds_at: float,
    fails_at: float,
    holds: Callable[[float], bool],
    *,
    goes_on: Callable[[float, float], bool] | None = None,
    most: int | None = None,
    rounded: Callable[[float], float] = float,
) -> tuple[float, float]:
    """Narrow two values, at one of which a condition holds, down on the place where it ends.

    Parameters
    ----------
    holds_at, fails_at
        The value at which the condition holds, and the one at which it fails; either may be the larger.
    holds
        Whether the condition holds at a value between them.
    goes_on
        Whether the two values are to be narrowed further; by default always.
    most
        The largest number of halvings; by default no limit, so that ``goes_on`` has to end them.
    rounded
        Rounds the value in the middle before it is tried.

    Returns
    -------
    tuple of float
        The last value at which it holds, and the nearest one at which it fails.
    """
    if goes_on is None and most is None:
        raise ValueError("nothing ends the halving: give goes_on, or most")
    done = 0
    while (most is None or done < most) and (goes_on is None or goes_on(holds_at, fails_at)):
        done += 1
        middle = rounded((holds_at + fails_at) / 2)
        holds_at, fails_at = (middle, fails_at) if holds(middle) else (holds_at, middle)
    return holds_at, fails_at
