"""Another date and time of day for an FMU's process, by a library that is loaded before the C library (Linux)."""

import ctypes
import os
from pathlib import Path

from fmus.toolchain.compiler import compile_here

_SOURCE = Path(__file__).with_name("shifted_clock.c")
_SHIFT = "GFOR_COSIM_CLOCK_SHIFT"
"""Variable of the environment by which the library knows the shift; what the process starts has it as well."""


def for_shifts() -> dict[str, str]:
    """Variables of the environment of a process that can shift its clock.

    Raises
    ------
    RuntimeError
        If the library is not in the package and there is no compiler.
    """
    return {"LD_PRELOAD": str(compile_here(_SOURCE))}


def shift_clock(seconds: int) -> None:
    """Have the clock of this process, and of what it starts, be so much later."""
    os.environ[_SHIFT] = str(seconds)
    ctypes.CDLL(None).gfor_read_clock_shift()
