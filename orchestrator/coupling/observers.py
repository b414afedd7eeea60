"""Observers watch a run from outside: recording, progress and anything a user adds."""

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from orchestrator.coupling.master import Master


class Observer(Protocol):
    """Called by the master at communication points.

    Attributes
    ----------
    every
        Number of communication steps between two calls of `observe`.
    """

    every: int

    def begin(self, master: "Master", stop_index: int) -> None:
        """Called once, when the run is about to start."""

    def observe(self, master: "Master") -> None:
        """Called at the first communication point and after every ``every`` steps."""

    def end(self, master: "Master") -> None:
        """Called once, also after a failure; what was observed so far must survive."""
