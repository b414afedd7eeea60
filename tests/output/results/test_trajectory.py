"""Recorded runs and what is none: each is opened, or refused with what to give."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import InputError
from orchestrator.output.results.trajectory import open_trajectory


def test_a_folder_of_scenarios_and_a_damaged_file_are_told_apart(tmp_path):
    t = np.linspace(0, 1, 11)
    run = xr.Dataset({"g.x": ("time", t)}, coords={"time": t})
    (tmp_path / "base").mkdir()
    run.to_netcdf(tmp_path / "base" / "trajectory.nc", engine="scipy")
    assert open_trajectory(tmp_path / "base")["g.x"].values.tolist() == t.tolist()
    with pytest.raises(InputError, match="choose a scenario in it: base"):
        open_trajectory(tmp_path)
    (tmp_path / "base" / "trajectory.nc").write_bytes(b"no file of results")
    with pytest.raises(InputError, match="cannot be read as NetCDF"):
        open_trajectory(tmp_path / "base")
