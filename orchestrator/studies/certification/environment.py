"""The environment of a computation: operating system, Python, libraries, and the state of this program."""

import platform
import subprocess
from functools import cache
from pathlib import Path

from fmus.toolchain.extras import installed_version
from orchestrator.output.results.file_writers import versions_of
from orchestrator.studies.points.code import code_hash

CODE = "Code"  # entry with the hash of this program's code

_LIBRARIES = ("numpy", "scipy", "fmpy", "xarray", "scikit-rf")
_ROOT = Path(__file__).parents[3]


def environment() -> dict[str, str]:
    known = {
        "gfor-cosim": installed_version("gfor-cosim"),
        "Commit": commit(),
        CODE: code_hash(),
        "Operating system": platform.platform(),
        "Processor": platform.machine(),
        "Python": platform.python_version(),
    }
    return known | versions_of(_LIBRARIES)


@cache
def commit() -> str:
    """The commit of the checkout that this program runs from, and whether anything in it is not committed; asked once,
    as `code_hash` is of what was loaded."""
    if not (_ROOT / ".git").exists():
        return "none: installed from a package"
    try:
        said = [
            subprocess.run(
                ["git", "-C", str(_ROOT), *words],
                capture_output=True,
                text=True,
                timeout=20,
                check=True,
            ).stdout.strip()
            for words in (("rev-parse", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        ]
    except (OSError, subprocess.SubprocessError):
        return "unknown: git does not say"
    return f"{said[0]} with changes that are not committed" if said[1] else said[0]
