"""Archives and model descriptions that nobody should trust: no harm, and one clear error each."""

import json
import os
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor

import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.compiler import host_platform
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.core.errors import FmuFileError, HostileFmuError
from orchestrator.devices.fmi import archive
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.description import read_description
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.hostile import HOSTILE, liar
from tests.devices.acceptance.gallery.members import good


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    member = next(m for m in good() if m.name == "gain")
    return build(member.source, tmp_path_factory.mktemp("plain"))


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_and_nothing_is_written(name, plain, tmp_path):
    make, kind = HOSTILE[name]
    path = make(tmp_path, plain)
    inner = tmp_path / "some" / "folder"
    for opened in (lambda: extract(path, inner), lambda: read_description(path)):
        if (
            name in ("entity_expansion", "external_entity", "deep_nesting")
            and opened.__code__.co_names[0] == "extract"
        ):
            continue  # an archive like any other, with a document that is not read here
        with pytest.raises(HostileFmuError) as caught:
            opened()
        assert caught.value.fault == kind
        assert str(caught.value).startswith(f"{path}: ")
        assert not inner.exists()
    assert not list(tmp_path.rglob("outside.txt"))


def test_a_size_that_is_a_lie_is_damage(plain, tmp_path):
    path = liar(tmp_path, plain)
    with pytest.raises(FmuFileError, match="damaged"):
        extract(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_is_unpacked_is_what_was_packed(plain, tmp_path):
    folder = extract(plain, tmp_path / "out")
    with zipfile.ZipFile(plain) as packed:
        names = packed.namelist()
        assert sorted(
            p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()
        ) == sorted(names)
        for name in names:
            assert (folder / name).read_bytes() == packed.read(name)


@pytest.mark.parametrize("limit", ["MOST_FILES", "MOST_BYTES", "MOST_XML_BYTES"])
def test_every_limit_is_kept(limit, plain, monkeypatch):
    monkeypatch.setattr(archive, limit, 1)
    with pytest.raises(HostileFmuError, match="at most 1"):
        read_description(plain)


@pytest.mark.parametrize("identifier", ["../../lib", "", "a b", "..", "-x", "x/y", "x" * 300])
def test_a_model_identifier_leads_nowhere_else(identifier, plain, tmp_path):
    path = tmp_path / "other.fmu"
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            content = source.read(name).replace(
                b'modelIdentifier="gain"', f'modelIdentifier="{identifier}"'.encode()
            )
            target.writestr(name, content)
    with pytest.raises(FmuFileError, match="C identifier"):
        read_description(path)


@pytest.mark.parametrize("name", ["resources/table.", "resources/aux.c"])
def test_names_of_windows_are_refused_on_windows_alone(name, plain, tmp_path, monkeypatch):
    path = tmp_path / "other.fmu"
    path.write_bytes(plain.read_bytes())
    with zipfile.ZipFile(path, "a") as target:
        target.writestr(name, "x")
    assert (extract(path) / name).read_text() == "x"
    monkeypatch.setattr(archive, "_ON_WINDOWS", True)
    with pytest.raises(HostileFmuError, match="Windows gives to something else"):
        read_description(path)


def _fuzz(seed, count, folder, sources):
    """Mutate in a process that can write in one folder only, with a gigabyte of memory."""
    command = [
        sys.executable,
        "-m",
        "tests.devices.fmi.fuzz",
        str(seed),
        str(count),
        str(folder),
        *map(str, sources),
    ]
    environment = {**os.environ, "PYTHONPATH": os.getcwd()}
    ended = subprocess.run(
        command, capture_output=True, text=True, timeout=900, env=environment, check=False
    )
    assert ended.returncode == 0, ended.stderr[-1500:]
    return json.loads(ended.stdout)


def test_mutated_files_are_read_or_refused(plain, tmp_path):
    found = _fuzz(0, 300, tmp_path, [plain])
    assert found["accepted"] + found["refused"] == 300
    assert min(found.values()) > 30  # the mutations are neither harmless nor hopeless


def test_mutated_files_of_fmi_3_are_read_or_refused(tmp_path):
    source = export(NativeFmu(build_model("infinite_bus"), "3.0"), tmp_path, (host_platform(),))
    folder = tmp_path / "mutated"
    folder.mkdir()
    found = _fuzz(1, 300, folder, [source])
    assert found["accepted"] + found["refused"] == 300
    assert min(found.values()) > 30


@pytest.mark.slow
@pytest.mark.parametrize("count", [1_000, pytest.param(10_000, marks=pytest.mark.nightly)])
def test_thousands_of_mutated_files_are_read_or_refused(plain, fmu_path, tmp_path, count):
    slim = tmp_path / "slim.fmu"
    with (
        zipfile.ZipFile(fmu_path("gfor")) as source,
        zipfile.ZipFile(slim, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for name in source.namelist():
            if not name.startswith("binaries/"):
                target.writestr(name, source.read(name))
            elif "64" in name:
                target.writestr(name, b"binary")
    folders = [tmp_path / str(k) for k in range(2)]
    for folder in folders:
        folder.mkdir()
    half = count // 2
    with ThreadPoolExecutor() as pool:
        found = list(
            pool.map(lambda k: _fuzz(1000 + half * k, half, folders[k], [plain, slim]), range(2))
        )
    assert sum(sum(counts.values()) for counts in found) == count
    assert all(min(counts.values()) > count // 20 for counts in found)
