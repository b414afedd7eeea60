"""Compiled programs that a closed process uses: they are made before it closes itself off.

No library but Python's own is imported here: numpy brings threads, and Landlock binds only the one that asks."""

from functools import cache
from pathlib import Path

from fmus.toolchain.compiler import TARGETS, compile_for, compile_here, joined_source
from orchestrator.core.errors import InputError
from orchestrator.devices.sandbox import wine

_HERE = Path(__file__).parent
_MAILBOX = _HERE / "mailbox.c"
_BOTH = (_MAILBOX, _HERE / "wine_talk.c")


@cache
def mailbox_path() -> Path:
    """The compiled mailbox."""
    return compile_here(_MAILBOX)


@cache
def proxy_path() -> Path:
    """The compiled functions of FMI 2.0 that ask the program under Wine."""
    return compile_here(*_BOTH, _HERE / "wine_proxy.c")


@cache
def host_path() -> Path:
    """The program under Wine."""
    source = "#define UNDER_WINE\n" + joined_source(*_BOTH, _HERE / "wine_host.c")
    return compile_for(source, TARGETS[wine.PLATFORM][0], ".exe")


def compile_programs() -> list[Path]:
    """Compile what a library for Windows needs on Linux, once; a process that is closed off reads these files."""
    try:
        wine.find_wine()
        return [mailbox_path(), proxy_path(), host_path()]
    except (OSError, RuntimeError) as error:
        raise InputError(
            f"libraries for Windows run under Wine, by a compiled program: {error}"
        ) from error
