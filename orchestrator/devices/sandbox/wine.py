"""Wine on Linux: where it is, and how a program for Windows is started in it, closed off like every foreign FMU.

A program under Wine opens files through Wine's server. So the server is closed off as well: it is started after
Landlock and before the filter of system calls, which lets nobody open sockets; the one connection that the program
needs is made before (`Server`).

No library but Python's own is imported here, as the process that closes itself off needs it."""

import contextlib
import os
import platform
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from orchestrator.devices.sandbox.kernel_calls import die_with_parent

PLATFORM = "win64"  # FMI's name of the platform whose libraries Wine runs
_LOADERS = ("wine64", "/usr/lib/wine/wine64", "wine")
_SERVERS = ("/usr/lib/wine/wineserver64", "/usr/lib/wine/wineserver", "wineserver")
PREFIX = "wine"
_LIBRARIES = "x86_64-windows"
_WHERE = (
    "/usr/lib/x86_64-linux-gnu/wine",
    "/usr/lib/wine",
    "/usr/lib64/wine",
    "/usr/local/lib/wine",
    "/usr/local/lib64/wine",
)
# from the folder above the loader's, where Wine is not one of the system's own
_BESIDE = ("lib64/wine", "lib/wine")
NOTE = "wine-socket"
"""Debian's server has its sockets in such a folder in the place that TMPDIR names; its name stands in the prefix."""
_LONGEST = 20.0  # for the server to begin [s]
# size of the memory that a program shares with whoever asks it [bytes]; a mailbox and no more
SHARED = 24 * 1024**2
_LEFT_BEHIND = 86_400.0  # age of an empty folder for sockets at which nobody is about to use it [s]
_NOT_STARTED = "wineboot.exe,services.exe,explorer.exe,winedevice.exe=d"
"""Programs of Windows that a library has no use for."""

MISSING = (
    "Windows libraries of 64 bits run under Wine here, and there is none; "
    "install it (Debian, Ubuntu: apt install wine)"
)


class NoWineError(RuntimeError):
    """There is no Wine, or it does not start."""


@dataclass(frozen=True)
class Wine:
    loader: str
    server: str
    libraries: Path


@cache
def find_wine() -> Wine:
    if sys.platform != "linux" or platform.machine() != "x86_64":
        raise NoWineError(
            f"Windows libraries run on Windows, or on Linux for x86_64 under Wine; this is {sys.platform}"
        )
    loader = next(filter(None, map(shutil.which, _LOADERS)), None)
    server = next(filter(None, map(shutil.which, _SERVERS)), None)
    above = [Path(loader).resolve().parents[1]] if loader else []
    places = [*(folder / beside for folder in above for beside in _BESIDE), *map(Path, _WHERE)]
    libraries = [place / _LIBRARIES for place in places]
    found = next((path for path in libraries if (path / "kernel32.dll").is_file()), None)
    if loader is None or server is None or found is None:
        raise NoWineError(MISSING)
    return Wine(loader, server, found)


def runs_here(platforms: tuple[str, ...], own: str, fmi_version: str) -> bool:
    """Return whether an FMU is one for Wine: for Windows alone, of FMI 2.0, and Wine is there."""
    if own in platforms or PLATFORM not in platforms or not fmi_version.startswith("2"):
        return False
    try:
        find_wine()
    except NoWineError:
        return False
    return True


def make_prefix(folder: Path) -> Path:
    """A Windows of a few files in a folder, whose own libraries are those of the installation."""
    prefix = folder / PREFIX
    (prefix / "dosdevices").mkdir(parents=True)
    windows = prefix / "drive_c" / "windows"
    (windows / "temp").mkdir(parents=True)
    (windows / "system32").symlink_to(find_wine().libraries)
    (prefix / "dosdevices" / "c:").symlink_to("../drive_c")
    (prefix / "dosdevices" / "z:").symlink_to("/")
    (prefix / ".update-timestamp").write_text("disable\n", encoding="ascii")
    for name in ("system", "user", "userdef"):
        (prefix / f"{name}.reg").write_text(
            "WINE REGISTRY Version 2\n#arch=win64\n", encoding="ascii"
        )
    note = prefix / "wineserver"
    note.write_text(NOTE, encoding="ascii")
    note.chmod(0o400)
    return prefix


def environment(prefix: Path, given: Mapping[str, str]) -> dict[str, str]:
    """Give the environment of a program in a prefix, from a process's own without what belongs to another Wine."""
    kept = {
        name: value
        for name, value in given.items()
        if not name.startswith("WINE") and name != "DISPLAY"
    }
    own = {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": _NOT_STARTED}
    own |= {
        "WINESERVER": find_wine().server,
        "TMP": "C:\\windows\\temp",
        "TEMP": "C:\\windows\\temp",
    }
    return kept | own | {"TMPDIR": str(prefix)}


def socket_bases() -> list[Path]:
    """Folders outside of a prefix where some builds of Wine's server have its sockets, made where they are missing."""
    user = os.getuid()
    run = Path(f"/run/user/{user}")
    folders = [Path(f"/tmp/.wine-{user}"), *([run / "wine"] if run.is_dir() else [])]
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, exist_ok=True)
    return [folder for folder in folders if folder.is_dir()]


def _socket_folders(prefix: Path) -> list[Path]:
    found = prefix.stat()
    place = f"server-{found.st_dev:x}-{found.st_ino:x}"
    return [prefix / NOTE / place, *(folder / place for folder in socket_bases())]


def prepare(folder: Path) -> list[Path]:
    """Make a prefix, before the process closes itself off; returns what Wine writes outside of the folder."""
    folders = _socket_folders(make_prefix(folder))[1:]
    for path in folders:
        for other in path.parent.glob("server-*"):  # a closed process cannot remove its own
            with contextlib.suppress(OSError):
                if time.time() - other.stat().st_mtime > _LEFT_BEHIND:
                    other.rmdir()
        path.mkdir(mode=0o700, exist_ok=True)
    return folders


@contextlib.contextmanager
def _opened(folder: Path) -> Iterator[str]:
    """A short name of a folder: that of a socket may have 107 bytes."""
    number = os.open(folder, os.O_PATH | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{number}"
    finally:
        os.close(number)


def _end_with_parent() -> None:
    die_with_parent(signal.SIGKILL)


class Server:
    """Wine's server for one prefix, with a connection that one program can use.

    ``folder``: where `prepare` made the prefix.
    ``tied``: whether the kernel ends it, and its programs, with the thread that started them."""

    def __init__(self, folder: Path, *, tied: bool, programs: int = 1) -> None:
        self.tied = tied
        self.prefix = folder / PREFIX
        self.shared = [self.prefix / f"shared{k}" for k in range(programs)]
        for path in self.shared:
            with path.open("wb") as file:
                file.truncate(SHARED)
        self.environment = environment(self.prefix, os.environ)
        self.process = subprocess.Popen(
            [find_wine().server, "-f", "-p"],
            env=self.environment,
            preexec_fn=_end_with_parent if tied else None,  # noqa: PLW1509 - tied: there is one thread
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._connections: list[socket.socket] = []
        self._paths = _socket_folders(self.prefix)
        end = time.monotonic() + _LONGEST
        while not self._connected(programs):
            if time.monotonic() > end or self.process.poll() is not None:
                self.close()
                raise NoWineError(
                    "Wine's server does not start: its folder for sockets cannot be written"
                )
            time.sleep(0.005)

    def _connected(self, wanted: int) -> bool:
        for path in self._paths:
            with contextlib.suppress(OSError), _opened(path) as place:
                while len(self._connections) < wanted:
                    connection = socket.socket(socket.AF_UNIX)
                    connection.connect(f"{place}/socket")
                    self._connections.append(connection)
                return True
        return False

    def next_shared(self) -> Path:
        if not self.shared:
            raise NoWineError(
                "this process has as many programs under Wine as it may; use fewer instances at once"
            )
        return self.shared.pop()

    def start(self, program: Path, *words: str) -> "subprocess.Popen[bytes]":
        with self._connections.pop() as connection:
            return subprocess.Popen(
                [find_wine().loader, str(program), *words],
                env=self.environment | {"WINESERVERSOCKET": str(connection.fileno())},
                preexec_fn=_end_with_parent if self.tied else None,  # noqa: PLW1509 - as above
                pass_fds=(connection.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )

    def close(self) -> None:
        for connection in self._connections:
            connection.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for path in self._paths:
            shutil.rmtree(path, ignore_errors=True)


# the server of this process, which closed itself off after its start; none elsewhere
in_process: list[Server] = []
# that a process which closed itself off can start: instances at once, and those that crashed
PROGRAMS = 16
