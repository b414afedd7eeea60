"""Libraries that a command never needs are not imported."""

import json
import subprocess
import sys

WRITES = """
import json, sys
from pathlib import Path
from orchestrator.core.late import import_xarray_alone, xr
from orchestrator.output.results.file_writers import save_netcdf
import_xarray_alone()
table = xr.Dataset({"damping": ("point", [1.0, 2.0])}).assign_attrs(case="own")
save_netcdf(table, Path(sys.argv[1]))
heavy = ("dask", "distributed", "pint")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""


def test_a_table_is_written_without_dask(tmp_path):
    file = tmp_path / "table.nc"
    words = [sys.executable, "-c", WRITES, str(file)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []
    assert file.read_bytes().startswith(b"CDF")
