"""Another date and time of day for an FMU's process, by a library that is loaded before the C library (Linux)."""

from pathlib import Path

from fmus.toolchain.compiler import compile_here

_SOURCE = Path(__file__).with_name("shifted_clock.c")


def with_shift(seconds: int) -> dict[str, str]:
    """Variables of the environment of a process whose clock is so much later.

    Raises
    ------
    RuntimeError
        If the library is not in the package and there is no compiler.
    """
    return {
        "LD_PRELOAD": str(compile_here(_SOURCE)),
        "GFOR_COSIM_CLOCK_SHIFT": str(seconds),
    }
