"""What is noted of a model is used again only where all that it follows from is the same."""

import os
from importlib.metadata import EntryPoint

import pytest

from fmus.toolchain import notes
from fmus.toolchain.cache import CacheError
from fmus.toolchain.notes import note_of, noted

OURS = EntryPoint("probe_a", "fmus.probe.probe:probe_a", "gfor_cosim.models")


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))


def never():
    raise AssertionError("it is noted, and need not be found again")


def test_what_is_noted_is_not_found_again():
    assert noted(OURS, "a", lambda: ["x", 1]) == ["x", 1]
    assert noted(OURS, "a", never) == ["x", 1]


def test_what_is_asked_and_of_which_code_names_the_note():
    other = EntryPoint("probe_a", "fmus.probe.probe:probe_b", "gfor_cosim.models")
    assert len({note_of(OURS, "a"), note_of(OURS, "b"), note_of(other, "a")}) == 3


@pytest.mark.parametrize("library", notes._LIBRARIES)
def test_another_version_of_a_library_names_another_note(monkeypatch, library):
    before = note_of(OURS, "a")
    installed = notes.installed_version
    monkeypatch.setattr(
        notes, "installed_version", lambda name: "0.0.1" if name == library else installed(name)
    )
    assert note_of(OURS, "a") != before


@pytest.mark.parametrize("part", ["machine", "_code_loaded"])
def test_another_machine_or_other_code_names_another_note(monkeypatch, part):
    before = note_of(OURS, "a")
    monkeypatch.setattr(notes, part, lambda: ("other",) if part == "machine" else "other")
    assert note_of(OURS, "a") != before


def test_every_file_of_the_models_counts(tmp_path, monkeypatch):
    names = set(notes.code_files())
    assert {
        "fmus/toolchain/slave.py",
        "fmus/toolchain/c/instance.c",
        "fmus/grid/elements.py",
    } <= names
    assert {"gfor_fmu/droop.py", "fmus/toolchain/c/clock.h"} <= names
    file = tmp_path / "model.py"
    monkeypatch.setattr(notes, "_places", lambda: {"fmus/model.py": str(file)})
    hashes = []
    for text in ("T = 1.0", "T = 2.0", "T = 1.0"):
        file.write_text(text, encoding="utf-8")
        hashes.append(notes._code_now())
    assert hashes[0] == hashes[2] != hashes[1]


@pytest.fixture
def loaded(tmp_path, monkeypatch):
    """The one file of a model's code, as this process has loaded it."""
    file = tmp_path / "model.py"
    file.write_text("T = 1.0", encoding="utf-8")
    monkeypatch.setattr(notes, "_places", lambda: {"fmus/model.py": str(file)})
    monkeypatch.setattr(notes, "_touched_at_import", notes._touched())
    found = notes._code_now()
    monkeypatch.setattr(notes, "_code_loaded", lambda: found)
    return file


def test_nothing_is_noted_of_code_that_was_changed_since_it_was_loaded(loaded):
    loaded.write_text("T = 2.05", encoding="utf-8")
    assert noted(OURS, "a", lambda: 1) == 1
    assert noted(OURS, "a", lambda: 2) == 2


def test_code_that_is_written_again_as_it_was_is_no_change(loaded):
    loaded.unlink()
    loaded.write_text("T = 1.0", encoding="utf-8")
    os.utime(loaded, (0, 0))
    assert noted(OURS, "a", lambda: 1) == 1
    assert noted(OURS, "a", never) == 1


def test_code_is_not_read_again_where_no_file_was_touched(loaded, monkeypatch):
    monkeypatch.setattr(notes, "_code_now", never)
    assert noted(OURS, "a", lambda: 1) == 1
    assert noted(OURS, "a", never) == 1


def test_nothing_is_noted_of_a_model_of_another_distribution():
    other = EntryPoint("motor", "vendor.models:motor", "gfor_cosim.models")
    assert note_of(other, "a") is None
    assert [noted(other, "a", lambda k=k: k) for k in (1, 2)] == [1, 2]


@pytest.mark.parametrize("content", [b"", b'["y", 1]'])
def test_a_damaged_note_is_found_anew(caplog, content):
    noted(OURS, "a", lambda: ["x", 1])
    note_of(OURS, "a").write_bytes(content)
    assert noted(OURS, "a", lambda: ["x", 1]) == ["x", 1]
    assert "it is built again" in caplog.text
    assert noted(OURS, "a", never) == ["x", 1]


def test_a_cache_that_cannot_be_written_costs_time_alone(monkeypatch):
    def full(*_):
        raise CacheError("full")

    monkeypatch.setattr(notes, "keep", full)
    assert noted(OURS, "a", lambda: 1) == 1
