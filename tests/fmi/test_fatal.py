"""After ``fmi2Fatal`` no call is allowed: an instance that pythonfmu gave up crashes at the next one."""

import subprocess
import sys
from pathlib import Path

import pytest
from pythonfmu import FmuBuilder

_STEPS = """
import sys
from orchestrator.errors import ComponentError
from orchestrator.fmi.description import read_description
from orchestrator.fmi.instance import open_component

try:
    with open_component("one", read_description(sys.argv[1]), isolated=sys.argv[2] == "True") as component:
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        for k in range(100):
            component.step(0.01 * k, 0.01)
except ComponentError as error:
    print(error.call, error.status, error.time)
"""


@pytest.mark.parametrize("isolated", [False, True])
def test_an_fmu_that_gave_itself_up_is_left_alone(isolated, tmp_path):
    fmu = FmuBuilder.build_FMU(Path(__file__).with_name("raising_slave.py"), dest=tmp_path)
    call = [sys.executable, "-c", _STEPS, str(fmu), str(isolated)]
    result = subprocess.run(call, capture_output=True, text=True, check=False, timeout=60)
    assert result.returncode == 0, result.stderr
    assert result.stdout == "fmi2DoStep fmi2Fatal 0.05\n"
