"""pythonfmu's binaries, which go into every Python-backed FMU, with a fault of the Linux one mended.

When a process ends, that library releases its interpreter twice: once by the destructor of a static C++ object, and
once in its function ``finalizePythonInterpreter``, which then changes a counter in freed memory. Now and then this
aborts the process after complete results. The second release is left out.
"""

import struct
from pathlib import Path

import pythonfmu

from fmus.toolchain.extras import SetupError

_SECOND_TIME = b"finalizePythonInterpreter"
_ENTRY, _RETURN = b"\xf3\x0f\x1e\xfa", b"\xc3"  # x86-64: endbr64, ret
_X86_64, _DYNAMIC_SYMBOLS = 62, 11


def wrapper_binaries() -> dict[Path, bytes]:
    """FMI platform and file name → contents.

    Raises
    ------
    SetupError
        If pythonfmu is not there as a whole, as while it is being installed: an FMU without them would be kept and
        could run nowhere.
    """
    root = Path(pythonfmu.__file__).parent / "resources" / "binaries"
    found = {file.relative_to(root): _mended(file.read_bytes()) for file in sorted(root.rglob("*.*"))}
    if not found:
        raise SetupError(
            f"pythonfmu: there are no binaries in {root}; install it again: pip install --force-reinstall pythonfmu"
        )
    return found


def _mended(binary: bytes) -> bytes:
    if binary[:5] != b"\x7fELF\x02" or struct.unpack_from("<H", binary, 18)[0] != _X86_64:
        return binary
    at = _offset_of(binary, _SECOND_TIME)
    if at is None or not binary.startswith(_ENTRY, at):
        return binary
    at += len(_ENTRY)
    return binary[:at] + _RETURN + binary[at + 1 :]


def _offset_of(binary: bytes, function: bytes) -> int | None:
    """Offset of an exported function in a 64-bit ELF file."""
    (table,) = struct.unpack_from("<Q", binary, 40)
    size, count = struct.unpack_from("<HH", binary, 58)
    # of every section: type, address, offset, size, link, size of an entry
    sections = [struct.unpack_from("<4xI8xQQQI12xQ", binary, table + size * n) for n in range(count)]
    for kind, _, start, length, link, entry in sections:
        if kind != _DYNAMIC_SYMBOLS:
            continue
        names = sections[link][2]
        for symbol in range(start, start + length, entry):
            name, section, value = struct.unpack_from("<I2xHQ", binary, symbol)
            if binary.startswith(function + b"\0", names + name) and 0 < section < count:
                return int(value - sections[section][1] + sections[section][2])
    return None
