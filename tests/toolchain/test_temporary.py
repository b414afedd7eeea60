"""Temporary folders: those of the living stay, those of the dead go."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from fmus.toolchain import temporary
from fmus.toolchain.temporary import own_folder, remove, sweep, sweep_partial_files

pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="no locks there: folders go after a week"
)

_OWNER = """
import sys, tempfile, time
from fmus.toolchain.temporary import own_folder
tempfile.tempdir = sys.argv[1]
print(own_folder("test"), flush=True)
time.sleep(60)
"""


@pytest.fixture
def owner(tmp_path):
    """A process with a folder of its own."""
    with subprocess.Popen(
        [sys.executable, "-c", _OWNER, str(tmp_path)], stdout=subprocess.PIPE, text=True
    ) as process:
        process.folder = tmp_path / process.stdout.readline().strip()
        (process.folder / "file").write_text("content")
        yield process
        process.kill()


def test_a_folder_stays_as_long_as_its_owner_lives(owner, tmp_path):
    assert sweep(tmp_path) == []
    assert (owner.folder / "file").exists()
    owner.kill()
    owner.wait()
    assert sweep(tmp_path) == [owner.folder]
    assert list(tmp_path.iterdir()) == []


def test_own_folders_stay_until_they_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(temporary.tempfile, "tempdir", str(tmp_path))
    folder = own_folder("test")
    assert sweep(tmp_path) == []
    assert folder.is_dir()
    remove(folder)
    assert list(tmp_path.iterdir()) == []
    folder = own_folder("test")
    folder.rmdir()  # by other means
    before = len(os.listdir("/dev/fd"))
    remove(own_folder("test"))
    assert len(os.listdir("/dev/fd")) <= before


def test_folders_of_others_are_left_alone(owner, tmp_path, monkeypatch):
    owner.kill()
    owner.wait()
    (tmp_path / "gfor_like").mkdir()
    (tmp_path / "gfor_locked_link").symlink_to(tmp_path / "gfor_like")
    (tmp_path / "gfor_new_test_1").mkdir()  # may be about to get its lock
    with monkeypatch.context() as other_user:
        other_user.setattr(os, "getuid", lambda: -1)
        assert sweep(tmp_path) == []
    assert sweep(tmp_path) == [owner.folder]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "gfor_like",
        "gfor_locked_link",
        "gfor_new_test_1",
    ]
    long_ago = time.time() - 1000.0
    os.utime(tmp_path / "gfor_new_test_1", (long_ago, long_ago))
    assert sweep(tmp_path) == [tmp_path / "gfor_new_test_1"]


def test_the_next_start_sweeps(owner, tmp_path, monkeypatch):
    owner.kill()
    owner.wait()
    monkeypatch.setattr(temporary.tempfile, "tempdir", str(tmp_path))
    remove(own_folder("test"))
    assert not owner.folder.exists()


def _deep(folder, levels=3000):
    """Folders in folders, made as an FMU makes them: by one name each, as no system takes a path of that length."""
    folder.mkdir()
    place = os.open(folder, os.O_RDONLY)
    for _ in range(levels):
        os.mkdir("d", dir_fd=place)
        inner = os.open("d", os.O_RDONLY, dir_fd=place)
        os.close(place)
        place = inner
    os.close(place)


def _closed(folder, levels=6):
    folder.mkdir()
    names = [folder.joinpath(*["d"] * level) for level in range(1, levels)]
    for name in names:
        name.mkdir()
        (name / "file").write_text("x")
    for name in reversed(names):
        name.chmod(0)


def _strange(folder):
    folder.mkdir()
    for name in (b"\xff\xfe", b"a\nb\x1b[2J", b"-rf", b"x" * 255):
        os.makedirs(os.path.join(os.fsencode(folder), name, name))


def _many(folder):
    folder.mkdir()
    for k in range(1000):
        (folder / f"{k}").touch()


def _pipe(folder):
    folder.mkdir()
    os.mkfifo(folder / "pipe")
    (folder / "loop").symlink_to(folder)
    (folder / "none").symlink_to("nowhere")


@pytest.mark.parametrize(
    "make", [pytest.param(_deep, marks=pytest.mark.slow), _closed, _strange, _many, _pipe]
)
def test_whatever_an_fmu_left_goes(make, tmp_path, monkeypatch):
    monkeypatch.setattr(temporary.tempfile, "tempdir", str(tmp_path))
    make(tmp_path / "gfor_locked_evil")
    folder = own_folder("test")
    make(folder / "work")
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]
    remove(folder)
    assert list(tmp_path.iterdir()) == []


def test_what_links_lead_to_stays(tmp_path):
    (tmp_path / "users").mkdir(mode=0o750)
    (tmp_path / "users" / "file").write_text("mine")
    (tmp_path / "gfor_locked_evil" / "in").mkdir(parents=True)
    for place in (tmp_path / "gfor_locked_evil", tmp_path / "gfor_locked_evil" / "in"):
        (place / "folder").symlink_to(tmp_path / "users")
        (place / "file").symlink_to(tmp_path / "users" / "file")
    assert sweep(tmp_path) == [tmp_path / "gfor_locked_evil"]
    assert [path.name for path in tmp_path.iterdir()] == ["users"]
    assert (tmp_path / "users" / "file").read_text() == "mine"
    assert (tmp_path / "users").stat().st_mode & 0o777 == 0o750


@pytest.mark.parametrize(
    "error", [RecursionError, OSError, UnicodeEncodeError("x", "", 0, 0, "x"), MemoryError]
)
def test_a_folder_that_cannot_go_keeps_no_other(error, tmp_path, monkeypatch):
    def remove_tree(folder):
        if folder.name.endswith("_bad"):
            raise error
        folder.rmdir()

    monkeypatch.setattr(temporary, "remove_tree", remove_tree)
    for name in ("bad", "good", "also"):
        (tmp_path / f"gfor_locked_{name}").mkdir()
    assert {path.name for path in sweep(tmp_path)} == {"gfor_locked_good", "gfor_locked_also"}
    assert [path.name for path in tmp_path.iterdir()] == ["gfor_locked_bad"]


def test_files_that_nobody_finished_go(tmp_path):
    (tmp_path / "libraries").mkdir()
    old, young, whole = (tmp_path / "libraries" / name for name in ("a.1.part", "b.2.part", "c.so"))
    for path in (old, young, whole):
        path.write_text("x")
    long_ago = time.time() - 4000.0
    for path in (old, whole):
        os.utime(path, (long_ago, long_ago))
    sweep_partial_files(tmp_path)
    assert sorted((tmp_path / "libraries").iterdir()) == [young, whole]


_SWEEP = """
import os, sys, tempfile
tempfile.tempdir = sys.argv[1]
from orchestrator.studies.points.processes import Processes

if __name__ == "__main__":
    executor = Processes(1)
    print(list(executor.run(abs, [-1])), flush=True)
    os.kill(os.getpid(), 9)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="workers have sockets on Linux")
def test_a_killed_study_leaves_nothing_for_long():
    tmp_path = Path(tempfile.mkdtemp(prefix="t"))  # the path of a socket must be short
    subprocess.run(
        [sys.executable, "-c", _SWEEP, str(tmp_path)], check=False, capture_output=True, text=True
    )
    left = {path.name.split("_")[2] for path in tmp_path.iterdir()}
    assert left == {"sockets"}
    end = time.monotonic() + 60.0
    while not sweep(tmp_path) and time.monotonic() < end:
        time.sleep(0.1)
    assert not list(tmp_path.iterdir())
    tmp_path.rmdir()


def test_threads_may_make_folders_while_others_disappear(tmp_path, monkeypatch):
    """Many at a time, as the checks of several FMUs do; each finds the folders that were removed by other means."""
    monkeypatch.setattr(temporary.tempfile, "tempdir", str(tmp_path))

    def one(_):
        for _ in range(40):
            shutil.rmtree(own_folder("threads"))

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(one, range(8)))
    assert not list(tmp_path.iterdir())


def test_an_interrupt_leaves_no_folder_that_is_only_half_made(tmp_path, monkeypatch):
    monkeypatch.setattr(temporary.tempfile, "tempdir", str(tmp_path))
    for planted, name in (
        (temporary.os, "open"),
        (temporary.Path, "rename"),
        (temporary.fcntl, "flock"),
    ):
        with monkeypatch.context() as context:

            def interrupts(*_, context=context):
                context.undo()
                raise KeyboardInterrupt

            context.setattr(planted, name, interrupts)
            with pytest.raises(KeyboardInterrupt):
                own_folder("test")
    assert [path.name for path in tmp_path.iterdir()] == []


_ENDS = """
import os, sys, tempfile
from fmus.toolchain.temporary import own_folder
tempfile.tempdir = sys.argv[1]
own_folder("test")
if not os.fork():
    sys.exit()  # a copy of it removes nothing
os.wait()
print(os.listdir(sys.argv[1]))
raise KeyboardInterrupt
"""


def test_a_process_removes_its_folders_at_its_end(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", _ENDS, str(tmp_path)], check=False, capture_output=True, text=True
    )
    assert done.stdout.startswith("['gfor_locked_test_")
    assert not list(tmp_path.iterdir())
