"""Names that FMI allows and NetCDF does not: a recording gives them back as they are."""

import numpy as np
import pytest
import xarray as xr

from orchestrator.output.results.file_writers import save_dataset, save_netcdf
from orchestrator.output.results.netcdf import join_netcdf, name_of, netcdf_image, stored_name
from orchestrator.output.results.recording_reader import open_recording, open_whole

NAMES = ("unit.bus/1/v", "unit.share%", "unit.a%2Fb", "unit.plain")
TIMES = np.arange(4) * 0.1
VALUES = np.arange(16.0).reshape(4, 4)


@pytest.mark.parametrize("name", [*NAMES, "%25", "a/%/b", "%2525/%2F"])
def test_a_name_comes_back(name):
    assert name_of(stored_name(name)) == name
    assert "/" not in stored_name(name)


def test_a_plain_name_stays():
    assert stored_name("sg1.machine.omega") == "sg1.machine.omega"


def assert_all_there(dataset):
    assert list(map(str, dataset.data_vars)) == list(NAMES)
    assert np.array_equal(np.column_stack([dataset[name].values for name in NAMES]), VALUES)


def test_a_recording_while_it_grows_and_when_it_is_joined(tmp_path):
    part = tmp_path / "000000000000.nc"
    part.write_bytes(netcdf_image(NAMES, TIMES, VALUES, {"time": {"units": "s"}}, {}, 4))
    assert sorted(map(str, open_recording(tmp_path).data_vars)) == sorted(NAMES)
    join_netcdf([part], tmp_path / "joined.nc", NAMES, {"time": {"units": "s"}}, {})
    assert_all_there(open_whole(tmp_path / "joined.nc"))


@pytest.mark.parametrize("save", [save_netcdf, save_dataset])
def test_a_dataset_in_memory(tmp_path, save):
    data = {name: ("time", VALUES[:, k], {"units": "1"}) for k, name in enumerate(NAMES)}
    save(xr.Dataset(data, coords={"time": ("time", TIMES, {"units": "s"})}), tmp_path / "kept.nc")
    assert_all_there(open_whole(tmp_path / "kept.nc"))
