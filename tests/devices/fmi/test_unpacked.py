"""FMUs of our own are unpacked once, and nothing of one system shows in the next."""

import os

import pytest

from orchestrator.devices.fmi import unpacked as module
from orchestrator.devices.fmi.unpacked import unpacked
from orchestrator.studies.modes.modes import running
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu


@pytest.fixture(autouse=True)
def nothing_kept(monkeypatch):
    monkeypatch.setattr(module, "_folders", {})


@pytest.fixture
def fmu(tmp_path):
    path = tmp_path / "integrator.fmu"
    path.write_bytes(small_fmu("integrator").path.read_bytes())
    return path


def test_the_same_file_has_the_same_folder_as_long_as_it_is_the_same(fmu):
    with unpacked(fmu) as first, unpacked(fmu) as second:
        assert first == second
        assert (first / "modelDescription.xml").exists()
    with unpacked(fmu) as again:
        assert again == first
    other = small_fmu("integrator").path.read_bytes()
    fmu.unlink()
    fmu.write_bytes(other)
    os.utime(fmu, ns=(1, 1))
    with unpacked(fmu) as changed:
        assert changed != first


def test_a_folder_that_somebody_removed_is_unpacked_anew(fmu):
    with unpacked(fmu) as first:
        pass
    module.remove(first)
    with unpacked(fmu) as again:
        assert (again / "modelDescription.xml").exists()


def test_the_oldest_that_nobody_uses_goes(fmu, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_MOST_UNUSED", 1)
    others = [tmp_path / f"{k}.fmu" for k in range(3)]
    for other in others:
        other.write_bytes(fmu.read_bytes())
    with unpacked(fmu) as used:
        folders = []
        for other in others:
            with unpacked(other) as folder:
                folders.append(folder)
        assert [folder.exists() for folder in folders] == [False, False, True]
        assert used.exists()


def test_a_copy_of_the_process_removes_nothing_of_the_first(fmu, monkeypatch):
    monkeypatch.setattr(module, "_MOST_UNUSED", 0)
    with unpacked(fmu) as first:
        monkeypatch.setattr(module, "_process", -1)  # as in the other process
    assert first.exists()
    module.remove(first)


def test_a_second_system_begins_as_the_first_did_beside_it_and_after_it():
    """Same outputs at the start and after steps, though binaries and Python modules are those of the first."""
    prepared = prepare_one("two_area", "pod_pq")

    def outputs(master):
        begun = master.y.copy()
        master.run(20 * prepared.step_size)
        return begun.tolist(), master.y.tolist()

    with running(prepared) as first:
        expected = outputs(first)
        with running(prepared) as beside:
            assert outputs(beside) == expected
    with running(prepared) as later:
        assert outputs(later) == expected


def test_what_others_packed_has_a_new_folder_each_time(fmu, monkeypatch):
    prepared, seen = prepare_one("two_area", "base"), []
    opened = module.extract

    def noted(path):
        seen.append(path)
        return opened(path)

    monkeypatch.setattr(module, "extract", noted)
    for _ in range(2):
        with running(prepared):
            pass
    assert (
        len(seen)
        == len(set(seen))
        == len({c.description.path for c in prepared.system.components.values()})
    )
    monkeypatch.setattr("orchestrator.systems.coupling.coupled.is_ours", lambda path: False)
    fresh = []
    monkeypatch.setattr(
        "orchestrator.systems.coupling.coupled.extract",
        lambda path: fresh.append(path) or opened(path),
    )
    for _ in range(2):
        with running(prepared):
            pass
    assert len(fresh) == 2 * len(set(fresh))
