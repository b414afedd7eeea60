"""What FMUs make of the parameters that they are given before they are initialised."""

import pytest

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import jacobi
from orchestrator.systems.coupling.system import System
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import LAG, small


def lag(folder, name, **defines):
    return build(small(name, "LAG", LAG, defines=defines, step_size="1e-3", stop_time="2"), folder)


def system(path):
    made = System()
    made.add("lag", read_description(path), {"d": 0.25}, {"u": 1.0}, isolated=False)
    return made


def test_an_fmu_that_forgets_them_when_it_is_set_up_keeps_them(tmp_path):
    """As exports of a well-known tool do: they ran with the values of their file, and nobody was told."""
    path = lag(tmp_path, "forgets_at_setup", FORGETS_AT_SETUP=1)
    with Master(system(path), jacobi(("lag",)), 1e-3) as master:
        assert master.components["lag"].values(["d"]) == {"d": 0.25}
    (_, found) = check_fmu(path, None, Limits(seconds=6.0), ("start_values",), run_for=0.3).results
    assert found.verdict == "pass"


def test_an_fmu_that_does_not_take_them_is_named(tmp_path):
    path = lag(tmp_path, "forgets_at_entry", FAULT_FORGETS_AT_ENTRY=1)
    with pytest.raises(
        ComponentError, match=r"'lag'.*the parameter d was set to 0\.25 and reads 0\.5"
    ):
        Master(system(path), jacobi(("lag",)), 1e-3)
