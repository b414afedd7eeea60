"""A C compiler without a system compiler: ziglang from PyPI, its results kept between runs."""

import hashlib
import shutil
import subprocess
import sys
import tempfile
import uuid
from pathlib import Path

from fmus.toolchain.cache import cache_directory

TARGETS = {
    # FMI platform -> (zig target, ending of a shared library)
    "linux64": ("x86_64-linux-gnu.2.17", ".so"),
    "win64": ("x86_64-windows-gnu", ".dll"),
    "darwin64": ("x86_64-macos", ".dylib"),
}

FLAGS = ("-O2", "-shared", "-fPIC", "-ffp-contract=off", "-fno-sanitize=undefined", "-g0")
"""No fast-math and no fused operations: a compiled kernel and its Python fallback agree to rounding."""


def host_platform() -> str | None:
    """FMI name of this machine's platform, where the compiler has a target for it."""
    return {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}.get(sys.platform)


def compile_library(source: str, platform: str) -> Path:
    """Compile C source to a shared library, or return what was compiled from it before.

    Parameters
    ----------
    source
        One translation unit.
    platform
        A key of `TARGETS`.

    Raises
    ------
    ValueError
        If the platform is unknown.
    RuntimeError
        If the compiler fails; its own text is in the message.
    """
    if platform not in TARGETS:
        raise ValueError(f"the compiler has no target for platform {platform!r}; choose from {', '.join(TARGETS)}")
    target, ending = TARGETS[platform]
    key = hashlib.sha256("\0".join([source, target, *FLAGS]).encode()).hexdigest()[:32]
    library = cache_directory("libraries") / f"{key}{ending}"
    if library.exists():
        return library
    with tempfile.TemporaryDirectory(prefix="gfor_compile_") as folder:
        c_file, built = Path(folder) / "source.c", Path(folder) / f"library{ending}"
        c_file.write_text(source, encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "ziglang",
            "cc",
            "-target",
            target,
            *FLAGS,
            str(c_file),
            "-o",
            str(built),
            "-lm",
        ]
        result = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
        if result.returncode:
            raise RuntimeError(f"the C compiler (ziglang) failed for {platform}:\n{result.stderr.strip()}")
        library.parent.mkdir(parents=True, exist_ok=True)
        partial = library.with_suffix(f".{uuid.uuid4().hex}.part")
        shutil.copy(built, partial)
        partial.replace(library)  # atomic: others, perhaps on other machines, may be compiling the same
    return library
