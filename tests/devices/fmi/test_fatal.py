"""After ``fmi2Fatal`` no call is allowed, not even to free the instance."""

import subprocess
import sys
from dataclasses import replace

import pytest

from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.members import LAG, small

_STEPS = """
import sys
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component

try:
    with open_component("one", read_description(sys.argv[1]), isolated=sys.argv[2] == "True") as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        for k in range(100):
            component.step(0.01 * k, 0.01)
except ComponentError as error:
    print(error.status, error.log, error.time)
"""


@pytest.mark.parametrize("isolated", [False, True])
def test_an_fmu_that_gave_itself_up_is_left_alone(isolated, tmp_path):
    """This one ends its process at the next call."""
    source = small("gives_up", "LAG", LAG, step_size="1e-2", stop_time="2")
    fmu = build(replace(source, defines={**source.defines, "FAULT_FATAL_AT": 0.055}), tmp_path)
    call = [sys.executable, "-c", _STEPS, str(fmu), str(isolated)]
    result = subprocess.run(call, capture_output=True, text=True, check=False, timeout=60)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout == "fmi2Fatal out of its mind 0.05\n"
