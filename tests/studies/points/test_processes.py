"""Worker processes of a study."""

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize("first", ["multiprocessing.util", "fmus.toolchain.temporary"])
def test_the_end_of_a_process_removes_its_sockets_once(first, tmp_path):
    """Whichever module was imported first, and so ends last."""
    program = (
        f"import {first}; from orchestrator.studies.points import processes; "
        "processes._sockets_in_an_own_folder()"
    )
    own = os.environ | {"TMPDIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", program], env=own, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert not [*tmp_path.iterdir()]
