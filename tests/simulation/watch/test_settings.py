"""What is set over a run, as the watch sees it."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.simulation.watch.settings import Settings
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu

TIMES = np.array([0.0, 1.0, 2.0])


def system(start):
    """One component with a breaker that starts so."""
    description = small_fmu("gain")
    breaker = replace(description.variables["K"], name="connected", type="Boolean", start=start)
    made = System()
    made.add(
        "unit", replace(description, variables={**description.variables, "connected": breaker})
    )
    return made


@pytest.mark.parametrize(("start", "closed"), [(True, 1.0), (False, 0.0), (None, 1.0)])
def test_a_breaker_is_closed_unless_it_says_otherwise(start, closed):
    assert Settings(system(start), [], TIMES).connected("unit").tolist() == [closed] * 3


def test_an_event_counts_after_its_time():
    opens = ParameterChange(1.0, "unit", "connected", False)
    assert Settings(system(True), [opens], TIMES).connected("unit").tolist() == [1.0, 1.0, 0.0]
