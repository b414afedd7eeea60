"""Built files that were damaged or altered since are never run: they are built again, and one line says so."""

import hashlib
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fmus.toolchain.cache import CacheError, intact, keep, key_of, key_of_digest
from fmus.toolchain.compiler import compile_library, host_platform
from orchestrator.devices.fmi.instance import is_ours

ROOT = Path(__file__).parents[2]
SOURCE = '__attribute__((visibility("default"))) int number(void) { return 7; }\n'


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    """An empty cache."""
    folder = tmp_path / "cache"
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(folder))
    return folder


def flip_bit(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def zero_half(path):
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2] + bytes(len(content) - len(content) // 2))


DAMAGE = {
    "bit flipped": flip_bit,
    "cut": lambda path: path.write_bytes(path.read_bytes()[:100]),
    "empty": lambda path: path.write_bytes(b""),
    "zeroed": zero_half,
    "hash lost": lambda path: path.with_name(f"{path.name}.sha256").unlink(),
    "hash torn": lambda path: path.with_name(f"{path.name}.sha256").write_bytes(b"\xff\xfe"),
}


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_damaged_library_is_compiled_again(own_cache, damage, caplog):
    library = compile_library(SOURCE, host_platform())
    good = library.read_bytes()
    damage(library)
    assert compile_library(SOURCE, host_platform()) == library
    assert library.read_bytes() == good
    assert "it is built again" in caplog.text
    assert str(library) in caplog.text
    caplog.clear()
    assert intact(library)
    assert not caplog.text


def test_a_key_follows_from_each_text_and_from_where_one_ends():
    key = hashlib.sha256(b"source\0linux64\0-O2").hexdigest()
    assert key_of("source", "linux64", "-O2") == key_of_digest(key) == key[:32]
    others = [("source", "linux64"), ("sourc", "elinux64", "-O2"), ("source", "win64", "-O2")]
    assert len({key_of(*texts) for texts in others} - {key[:32]}) == len(others)


def test_a_file_is_intact_at_each_moment_of_its_being_written_anew(tmp_path, monkeypatch, caplog):
    """Two versions of gfor in one home folder build the same file with different bytes."""
    path = keep(tmp_path / "library.so", b"version 0")
    seen = []
    move = Path.replace

    def look_and_move(partial, target):
        seen.append(intact(path))
        moved = move(partial, target)
        seen.append(intact(path))
        return moved

    monkeypatch.setattr(Path, "replace", look_and_move)
    for version in range(200):  # the list of SHA-256 begins anew on the way
        keep(path, b"version %d" % version)
    assert all(seen)
    assert not caplog.text
    assert path.with_name("library.so.sha256").stat().st_size < 5000


def gfor_in(folder, *arguments):
    """`gfor` in a process of its own: there nothing is known to be intact yet."""
    environment = {**os.environ, "GFOR_COSIM_CACHE": str(folder)}
    command = [sys.executable, "-m", "orchestrator.face.cli", *arguments]
    return subprocess.run(
        command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A cache with all that the infinite bus needs, and what its modes are."""
    folder = tmp_path_factory.mktemp("filled")
    done = gfor_in(folder, "modes", "infinite_bus", "--json")
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


@pytest.mark.slow
def test_damage_anywhere_in_the_cache_changes_no_result(filled, tmp_path):
    """By one bit in each file; each kind of damage is that of `test_a_damaged_library_is_compiled_again`."""
    folder = shutil.copytree(filled[0], tmp_path / "cache")
    files = [
        path for path in sorted(folder.rglob("*")) if path.is_file() and path.suffix != ".sha256"
    ]
    for path in files:
        flip_bit(path)
    done = gfor_in(folder, "modes", "infinite_bus", "--json")
    assert done.returncode == 0, done.stderr
    assert done.stdout == filled[1]
    assert "Traceback" not in done.stderr
    assert done.stderr.count("it is built again") >= 2
    again = gfor_in(folder, "modes", "infinite_bus", "--json")
    assert (again.stdout, again.stderr) == (filled[1], "")


@pytest.mark.slow
def test_code_added_to_a_kept_fmu_is_never_run(filled, tmp_path):
    folder = shutil.copytree(filled[0], tmp_path / "cache")
    (fmu,) = folder.glob("fmus/*/gfor.fmu")
    trace = tmp_path / "ran"
    with zipfile.ZipFile(fmu) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    added = f"open({str(trace)!r}, 'w').close()\n".encode()
    members = {
        name: added + content if name.endswith(".py") else content
        for name, content in members.items()
    }
    with zipfile.ZipFile(fmu, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    done = gfor_in(folder, "modes", "infinite_bus", "--json")
    assert done.returncode == 0, done.stderr
    assert "gfor.fmu differs from the SHA-256 kept beside it" in done.stderr
    assert done.stdout == filled[1]
    assert not trace.exists()


def test_an_altered_fmu_in_the_cache_is_a_stranger(own_cache):
    path = keep(own_cache / "fmus" / "python_0" / "thing.fmu", b"as it was built")
    copy = own_cache.parent / "copy.fmu"
    copy.write_bytes(b"as it was built")
    assert is_ours(path)
    assert is_ours(copy)
    path.write_bytes(b"as it was bUilt")
    copy.write_bytes(b"as it was bUilt")
    assert not is_ours(path)
    assert not is_ours(copy)


def test_a_cache_that_cannot_be_written_is_one_clear_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("not a folder", encoding="utf-8")
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "file"))
    with pytest.raises(
        CacheError, match=r"cannot be written.*Not a directory.*set GFOR_COSIM_CACHE"
    ):
        compile_library(SOURCE, host_platform())
    # this process may have its FMUs open already
    done = gfor_in(tmp_path / "file", "modes", "infinite_bus")
    assert done.returncode == 2
    assert done.stderr.startswith("error: the cache cannot be written")
    assert done.stderr.count("\n") == 1


def test_without_a_home_the_error_names_the_variable(monkeypatch, gfor):
    monkeypatch.delenv("GFOR_COSIM_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", lambda: (_ for _ in ()).throw(RuntimeError("no home")))
    code, _, error = gfor("modes", "infinite_bus")
    assert code == 2
    assert "set GFOR_COSIM_CACHE to a folder" in error


def test_nothing_half_written_stays_when_the_disk_is_full(own_cache, monkeypatch):
    def full(path, content):
        with path.open("wb") as file:
            file.write(content[:3])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(CacheError, match="No space left on device"):
        keep(own_cache / "libraries" / "x.so", b"some library")
    assert [path for path in own_cache.rglob("*") if path.is_file()] == []
