"""How much memory a process has in use, and how many files."""

import ctypes
import gc
import sys
from pathlib import Path

_MALLINFO2 = ["arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost"]


class _MallocInfo(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_size_t) for name in _MALLINFO2)


def memory_in_use() -> int | None:
    """Bytes that are allocated now; the resident size where the C library does not tell, None where nothing does.

    Garbage of Python is freed before, so that it does not matter when Python would have done so."""
    gc.collect()
    try:
        info = ctypes.CDLL(None).mallinfo2
        info.restype = _MallocInfo
        now = info()
        # An interpreter keeps small objects in blocks of its own, which malloc does not see.
        return int(now.uordblks + now.hblkhd) + 32 * sys.getallocatedblocks()
    except (AttributeError, OSError, TypeError):
        pass
    if sys.platform == "linux":
        import resource  # noqa: PLC0415 - only where it exists

        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    return None


def open_files() -> int:
    """Files that this process has open; 0 where the platform does not tell."""
    try:
        return len(list(Path("/proc/self/fd").iterdir()))
    except OSError:
        return 0
