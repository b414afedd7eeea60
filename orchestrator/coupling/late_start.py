"""An output that was not there when the partners of its component were initialised."""

from dataclasses import dataclass


@dataclass(frozen=True)
class LateStart:
    """An output that is another just after initialisation than just before its end; ``text`` has both values."""

    variable: str
    text: str
