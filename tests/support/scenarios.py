"""Prepared scenarios for tests: one of a case, or a bare one that has only what a test is about.

`prepare_one("two_area", "gfor")` reads a case, built in or a file, and prepares one of its scenarios. `bare_scenario`
makes a scenario without a case file, for a test of what comes behind: of pictures, answers or tables. Its fields are
those of `PreparedScenario`, so that a test cannot go on with a field that the product no longer has; what is not given
is empty, and a part that the test never asks for may be a stand-in.
"""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.prepare import PreparedScenario


def prepare_one(
    case: str | Path, scenario: str | None = None, *settings: Any, **options: Any
) -> PreparedScenario:
    """Prepare one scenario of a case: the only one where none is named.

    ``settings``, ``options``: as `Case.prepare` takes them behind the scenarios: values first, then the step and the
    stop [s]."""
    (ready,) = load_case(case).prepare([scenario] if scenario else (), *settings, **options)
    return ready


def bare_scenario(name: str = "base", **fields: Any) -> PreparedScenario:
    """Make a scenario of an empty system that steps by 1 ms for 1 s; ``fields`` replace what is empty."""
    nothing: dict[str, Any] = {
        "case": SimpleNamespace(name="case"),
        "title": name,
        "system": SimpleNamespace(components={}),
        "schedule": None,
        "step_size": 1e-3,
        "stop_time": 1.0,
        "record": (),
        "record_every": 1,
        "events": (),
        "power_flow": None,
        "values": {},
    }
    return PreparedScenario(name=name, **nothing | fields)
