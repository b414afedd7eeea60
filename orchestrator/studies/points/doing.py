"""Progress within a count that stands still, for whoever waits: in words, and as a part of the next one."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Doing:
    """A stage of a study in words, "" where nobody tells, and the part of what is counted next that is done, 0 to 1."""

    text: str = ""
    part: float = 0.0


class _Now:
    doing = Doing()


def tell_doing(text: str = "", part: float = 0.0) -> None:
    """Tell what this process is doing from now on, and the part of what is counted next that is done before it."""
    _Now.doing = Doing(text, part)


def doing() -> Doing:
    """Return the stage that was told last."""
    return _Now.doing
