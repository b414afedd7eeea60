"""Where built kernels and FMUs are kept between runs."""

import os
import sys
from pathlib import Path


def cache_directory(kind: str) -> Path:
    """Folder for one kind of built file; ``GFOR_COSIM_CACHE`` overrides its parent.

    Contents are named by a hash of what they were made from: deleting the folder is always safe.
    """
    root = os.environ.get("GFOR_COSIM_CACHE")
    if root:
        return Path(root) / kind
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "gfor-cosim" / kind
