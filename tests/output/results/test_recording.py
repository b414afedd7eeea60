"""A recording that grows on the disk: what is read at any moment is what was recorded until then."""

import json
import multiprocessing
import os
import resource
import sys
import time

import h5py
import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import InputError, ResultsError
from orchestrator.output.results import file_writers, recording_reader
from orchestrator.output.results.file_writers import save_csv, trajectory_dataset
from orchestrator.output.results.recording_reader import open_recording, open_whole
from orchestrator.output.results.recording_writer import RecordingFolder, parts_of
from orchestrator.output.results.signals import signal as signal_of
from tests.support.scenarios import bare_scenario, prepare_one

NAMES = ("gfor.p", "gfor.omega", "grid.v")


class Rows:
    """Rows as a recorder keeps them."""

    def __init__(self, count, seed=1):
        self.names = NAMES
        self.times = 1e-4 * np.arange(count)
        self.values = np.random.default_rng(seed).normal(size=(count, len(NAMES))).cumsum(axis=0)


@pytest.fixture(scope="module")
def prepared():
    ready = prepare_one("infinite_bus", "dip")
    return ready


def keep(recording, rows, block):
    """As a recorder hands blocks over, each of them twice: first when it is not full."""
    recording.begin(rows.names)
    for begin in range(0, len(rows.times), block):
        for count in (max(1, block // 3), block):
            part = slice(begin, begin + count)
            recording.keep(begin, rows.times[part], rows.values[part])


@pytest.mark.parametrize("count", [1, 99, 100, 101, 950])
def test_a_joined_recording_is_what_memory_would_have_kept(tmp_path, prepared, count):
    rows, recording = Rows(count), RecordingFolder(tmp_path / "recording", prepared)
    keep(recording, rows, 100)
    assert len(parts_of(tmp_path / "recording")) == -(-count // 100)
    while_it_grows = open_recording(tmp_path / "recording").load()
    recording.join(tmp_path / "trajectory.nc")
    assert not (tmp_path / "recording").exists()
    expected = trajectory_dataset(rows, prepared)
    for found in (
        while_it_grows,
        open_whole(tmp_path / "trajectory.nc"),
        xr.load_dataset(tmp_path / "trajectory.nc"),
    ):
        assert list(found.data_vars) == list(NAMES)
        assert found.attrs == expected.attrs
        for name in ("time", *NAMES):
            assert found[name].values.tobytes() == expected[name].values.tobytes(), name
            assert found[name].attrs == expected[name].attrs


def test_chunks_are_copied_as_they_are(tmp_path, prepared):
    rows, recording = Rows(250), RecordingFolder(tmp_path / "recording", prepared)
    keep(recording, rows, 100)
    with h5py.File(parts_of(tmp_path / "recording")[1]) as part:
        kept = part["gfor.p"].id.read_direct_chunk((0,))
    recording.join(tmp_path / "trajectory.nc")
    with h5py.File(tmp_path / "trajectory.nc") as whole:
        assert whole["gfor.p"].id.read_direct_chunk((100,)) == kept
        assert whole["gfor.p"].compression == "gzip"


def test_of_a_long_recording_only_the_rows_that_are_asked_for_are_read(
    tmp_path, prepared, monkeypatch
):
    rows, recording = Rows(950), RecordingFolder(tmp_path / "recording", prepared)
    keep(recording, rows, 100)
    grows = open_recording(tmp_path / "recording")
    recording.join(tmp_path / "elsewhere" / "trajectory.nc")
    (tmp_path / "recording").mkdir()
    keep(RecordingFolder(tmp_path / "recording", prepared), rows, 100)
    monkeypatch.setattr(recording_reader, "IN_MEMORY", 1000)
    monkeypatch.setattr(xr, "open_dataset", None)
    whole = open_whole(tmp_path / "elsewhere" / "trajectory.nc")
    assert not recording_reader.in_memory(whole)
    keys = (
        0,
        -1,
        slice(None),
        slice(95, 305),
        slice(None, None, 7),
        slice(900, 3, -13),
        slice(5, 5),
        [3, 700, 101],
    )
    for found in (grows, whole):
        assert np.array_equal(found["time"], rows.times)
        for key in keys:
            assert np.array_equal(found["gfor.omega"][key], rows.values[key, 1]), key
    difference = signal_of(whole.isel(time=slice(200, 400)), "gfor.p - gfor.omega")
    assert np.array_equal(difference, rows.values[200:400, 0] - rows.values[200:400, 1])


def test_a_netcdf_file_of_another_form_is_read_as_well(tmp_path):
    data = xr.Dataset({"a": (("x", "y"), np.eye(3))}, coords={"x": [1.0, 2.0, 3.0]}, attrs={"n": 1})
    data.to_netcdf(tmp_path / "four.nc", engine="h5netcdf")
    data.to_netcdf(tmp_path / "three.nc", engine="scipy")
    for name in ("four.nc", "three.nc"):
        assert np.array_equal(open_whole(tmp_path / name)["a"], np.eye(3))


def test_another_programs_file_over_time_is_read_with_its_packing(tmp_path):
    """Whole numbers with a scale, as archives keep them; a recording of ours has none."""
    data = xr.Dataset({"v": ("time", [1.01, 0.98, 1.03])}, coords={"time": [0.0, 0.1, 0.2]})
    packed = {"v": {"dtype": "int16", "scale_factor": 0.01, "add_offset": 1.0, "_FillValue": -999}}
    data.to_netcdf(tmp_path / "packed.nc", engine="h5netcdf", encoding=packed)
    assert open_whole(tmp_path / "packed.nc")["v"].values == pytest.approx([1.01, 0.98, 1.03])


def test_no_rows_at_all(tmp_path, prepared):
    recording = RecordingFolder(tmp_path / "recording", prepared)
    recording.begin(NAMES)
    recording.join(tmp_path / "trajectory.nc")
    assert open_whole(tmp_path / "trajectory.nc").sizes["time"] == 0
    with pytest.raises(InputError, match="nothing was recorded yet"):
        open_recording(tmp_path / "recording")


def test_a_part_that_is_missing_or_torn_is_named(tmp_path, prepared):
    recording = RecordingFolder(tmp_path / "recording", prepared)
    keep(recording, Rows(300), 100)
    middle = parts_of(tmp_path / "recording")[1]
    middle.write_bytes(middle.read_bytes()[:500])
    with pytest.raises(
        InputError, match=r"000000000100\.nc: it cannot be read as part of a recording"
    ):
        open_recording(tmp_path / "recording")
    middle.unlink()
    with pytest.raises(InputError, match="the rows from number 100 on are missing"):
        open_recording(tmp_path / "recording")


def test_nan_and_infinity_stay(tmp_path, prepared):
    rows, recording = Rows(5), RecordingFolder(tmp_path / "recording", prepared)
    rows.values[2] = np.nan, np.inf, -np.inf
    keep(recording, rows, 100)
    recording.join(tmp_path / "trajectory.nc")
    assert np.array_equal(
        xr.load_dataset(tmp_path / "trajectory.nc")["gfor.p"], rows.values[:, 0], equal_nan=True
    )
    assert xr.load_dataset(tmp_path / "trajectory.nc")["grid.v"].values[2] == -np.inf


def test_the_table_has_a_heading_for_each_column_whatever_a_variable_is_called(tmp_path):
    import csv  # noqa: PLC0415

    names = ["a[1,2]", "=cmd|x", '"quoted"', "plain"]
    data = {name: ("time", np.arange(25_001.0), {"units": "pu"}) for name in names}
    save_csv(xr.Dataset(data, coords={"time": np.arange(25_001) * 1e-4}), tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == ["time [s]", "a[1,2] [pu]", "'=cmd|x [pu]", '"quoted" [pu]', "plain [pu]"]
    assert {len(row) for row in rows} == {5}
    assert len(rows) == 25_001
    assert rows[-1] == ["2.5", "25000", "25000", "25000", "25000"]


# -- faults ----------------------------------------------------------------------------------------


@pytest.fixture
def file_limit():
    """Let no file grow above a size; the system answers as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_no_room_for_a_part(tmp_path, prepared, file_limit):
    rows, recording = Rows(3000), RecordingFolder(tmp_path / "recording", prepared)
    keep(recording, Rows(1000), 1000)
    file_limit(20_000)
    with pytest.raises(
        ResultsError,
        match=r"000000001000\.nc: it cannot be written: File too large; raise the limit",
    ):
        recording.keep(1000, rows.times[1000:], rows.values[1000:])
    assert open_recording(tmp_path / "recording").sizes["time"] == 1000
    assert [p.name for p in (tmp_path / "recording").iterdir()] == ["000000000000.nc"]


def test_no_room_for_the_whole(tmp_path, prepared, file_limit):
    """HDF5 would end the process here; its file's place is reserved before, and the parts stay."""
    rows, recording = Rows(3000), RecordingFolder(tmp_path / "recording", prepared)
    keep(recording, rows, 1000)
    file_limit(60_000)
    with pytest.raises(ResultsError, match=r"trajectory\.nc: it cannot be written"):
        recording.join(tmp_path / "trajectory.nc")
    assert not (tmp_path / "trajectory.nc").exists()
    assert np.array_equal(open_recording(tmp_path / "recording")["gfor.p"], rows.values[:, 0])


def test_the_folder_is_removed_meanwhile(tmp_path, prepared):
    rows, recording = Rows(10), RecordingFolder(tmp_path / "run" / "recording", prepared)
    recording.begin(NAMES)
    os.rename(tmp_path / "run", tmp_path / "elsewhere")
    with pytest.raises(ResultsError, match="the folder was removed meanwhile"):
        recording.keep(0, rows.times, rows.values)


def write_all(folder, prepared, rows, begun):
    """The first process: a recording from its begin to the joined file."""
    recording = RecordingFolder(folder, prepared)
    begun.set()
    keep(recording, rows, 1000)
    recording.join(folder.parent / "trajectory.nc")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the writer is a copy of this process")
def test_what_is_read_while_it_is_written_and_after_a_kill(tmp_path, prepared):
    """A second process reads while the first writes; the first is killed at moments that chance chooses."""
    chance, rows, lengths = np.random.default_rng(5), Rows(200_000), []
    copies = multiprocessing.get_context("fork")
    for number in range(8):
        folder = tmp_path / str(number) / "recording"
        begun = copies.Event()
        writer = copies.Process(target=write_all, args=(folder, prepared, rows, begun))
        writer.start()
        assert begun.wait(60)
        count = int(chance.integers(0, 12))  # of parts: how long they take is the disk's
        while len(parts_of(folder)) < count and writer.is_alive():
            time.sleep(0.002)
        lengths += [check_read(folder, rows)]
        time.sleep(chance.uniform(0, 0.2))
        writer.kill()
        writer.join()
        lengths += [check_read(folder, rows)]
    assert len(set(lengths)) > 5
    assert max(lengths) > 0


def check_read(folder, rows):
    """Rows that can be read, each of them as it was recorded."""
    whole = folder.parent / "trajectory.nc"
    if whole.exists():
        found = open_whole(whole)
    elif parts_of(folder):
        found = open_recording(folder).load()
    else:
        return 0
    count = found.sizes["time"]
    assert np.array_equal(found["time"], rows.times[:count])
    for k, name in enumerate(NAMES):
        assert np.array_equal(found[name], rows.values[:count, k])
    return count


def test_the_attributes_say_of_which_run_a_part_is(tmp_path, prepared):
    recording = RecordingFolder(tmp_path / "recording", prepared, {"run": "r1"})
    keep(recording, Rows(3), 10)
    found = open_recording(tmp_path / "recording").attrs
    assert (found["run"], found["scenario"]) == ("r1", "dip")
    assert json.loads(found["values"]) == prepared.values


def test_a_recording_says_how_far_its_rows_are_apart(monkeypatch):
    monkeypatch.setattr(file_writers, "provenance", lambda prepared: {})
    monkeypatch.setattr(file_writers, "measuring_places", lambda prepared: {})
    prepared = bare_scenario(record_filtered=True, record_every=40, step_size=1e-4)
    assert file_writers.origin_of_rows(prepared)["record_interval_s"] == pytest.approx(4e-3)
