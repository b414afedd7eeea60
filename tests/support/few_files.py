"""Libraries of ours for Windows and for a Mac are linked with few files, or not at all.

All of mingw's C library would be compiled for them otherwise, which is 100 s of processor in each new environment, or
zig's runtime library, 4 s for each kind of Mac. The bytes are the same, so that nothing else would tell."""

from collections.abc import Sequence
from functools import wraps
from pathlib import Path

from fmus.toolchain import compiler, windows


def require_few_files() -> None:
    """Make `compiler.compile_for` fail in this process where it would link for them with all files."""
    ways = compiler._ways

    @wraps(ways)
    def first(
        target: str, ending: str, libraries: Sequence[str], built: Path
    ) -> list[list[list[str]]]:
        found = list(ways(target, ending, libraries, built))
        few = target in windows.MACHINES or target.endswith("macos")
        return found[:1] if few else found

    compiler._ways = first  # type: ignore[assignment]
