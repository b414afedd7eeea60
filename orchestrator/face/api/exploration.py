"""A scenario in the explorer, from Python: a notebook shows the page among its cells."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from html import escape
from importlib import import_module
from typing import Any

from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.attributes import KnownNames
from orchestrator.core.closing import Closing
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ

_HEIGHT = 860
"""Height of the page in a notebook [px]: map, table and sliders without scrolling."""


class Exploration(KnownNames, Closing):
    """The page of a scenario, served on this machine. `Scenario.explore` makes one.

    Jupyter and marimo show the page as it is. It ends with the program, by ``close``, or a minute after the last page
    that shows it was closed. Only a browser on the same machine reaches it.
    """

    def __init__(self, case: str, beginning: Mapping[str, Any], *, trust_fmus: bool) -> None:
        # the room above this one: only who explores needs it
        make: Any = import_module("orchestrator.face.explore.server").Explorer
        self._explorer = make(case, dict(beginning), trust_fmus=trust_fmus)
        self._title = f"{beginning['case']}, {beginning['scenario']}"
        self._open = True
        threading.Thread(target=self._serve, daemon=True).start()

    @property
    def address(self) -> str:
        """The page's address, with the word that lets in; whoever knows it on this machine sees the page."""
        return str(self._explorer.address)

    def close(self) -> None:
        """End the server and what it computes with; calling it again does nothing."""
        if self._open:
            self._open = False
            self._explorer.close()

    def _serve(self) -> None:
        self._explorer.serve()
        self._open = False

    def __repr__(self) -> str:
        return f"<Exploration of {self._title}: {self.address if self._open else 'closed'}>"

    def _repr_html_(self) -> str:
        if not self._open:
            return f"<p>{escape(self._title)}: the page is closed; ask .explore() again</p>"
        return (
            f'<iframe src="{escape(self.address)}" title="{escape(self._title)}" width="100%" height="{_HEIGHT}" '
            'referrerpolicy="no-referrer" style="border:0"></iframe>'
        )


def explored(
    scenario: PreparedScenario, values: Mapping[str, Any], step: float | None
) -> Exploration:
    """Serve the page of a scenario that begins with values and a communication step [s], None for the case's."""
    case = scenario.case
    beginning: dict[str, Any] = {
        "case": case.name,
        "scenario": scenario.name,
        "range": list(ELECTROMECHANICAL_HZ),
        "values": dict(values),
    }
    if step is not None:
        beginning["step"] = step
    return Exploration(str(case.path), beginning, trust_fmus=case.trust_fmus)
