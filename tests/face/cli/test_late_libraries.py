"""Libraries that take a second to import are left out by commands that do without them."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
HEAVY = {
    *("dask", "h5py", "matplotlib", "pandapower", "pandas", "pint", "xarray"),
    *("scipy.optimize", "scipy.signal", "scipy.stats"),
}
PARTS = {"numpy.f2py.f2py2e", "numpy.testing._private.utils", "unittest"}
USED = "numpy.testing.assert_array_equal([1], [1]); assert numpy.f2py.f2py2e.run_main"


@pytest.mark.parametrize("case", ["two_area", "ieee39"])
def test_modes_from_kept_fmus_import_no_heavy_library(case, gfor):
    """Neither does it build a model or read a network anew; what was put off is there once it is used."""
    code, _, error = gfor("modes", case, "--scenario", "base", "--json")
    assert code == 0, error
    script = (
        "import sys\nfrom orchestrator.face.cli import main\n"
        f"assert main(['modes', {case!r}, '--scenario', 'base']) == 0\n"
        f"found = {HEAVY | PARTS!r} & set(sys.modules)\nassert not found, found\n"
        f"import numpy.f2py, numpy.testing\n{USED}"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert done.returncode == 0, done.stderr
