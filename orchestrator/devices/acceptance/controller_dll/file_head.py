"""The head of a library file: kind, bits, processor and exports, read without running any of its code.

Source: the published forms of ELF files and of Windows' portable executables."""

import re
import struct
from dataclasses import dataclass
from pathlib import Path

_PROCESSORS = {
    ("ELF", 3): "x86",
    ("ELF", 62): "x86-64",
    ("ELF", 183): "ARM64",
    ("PE", 0x14C): "x86",
    ("PE", 0x8664): "x86-64",
    ("PE", 0xAA64): "ARM64",
}
"""Kind and number in the head → processor."""
_DIRECTORIES = {0x10B: (32, 96), 0x20B: (64, 112)}
"""Mark of a PE file's second head → bits, and place of its table of directories from there [bytes]."""
_MOST_EXPORTS = 100_000  # more than this and the table is damaged
_MANGLED = re.compile(rb"(?:_Z(\d+)|\?)(Model_[A-Za-z]+)")
"""A name as C++ compilers write it: that of GCC and Clang has its length in front."""
_DECORATED = re.compile(r"_?(Model_\w+)@\d+")


@dataclass(frozen=True)
class FileHead:
    kind: str  # ELF, PE or Mach-O; empty for anything else
    bits: int
    processor: str  # empty where its number is not known
    # names of exported functions in the file; None where the file is not read for them
    exports: tuple[str, ...] | None
    # functions of the interface that stand there under a C++ compiler's name
    mangled: tuple[str, ...]

    @property
    def decorated(self) -> tuple[str, ...]:
        """Functions of the interface whose exported name is that of the calling convention stdcall."""
        found = (_DECORATED.fullmatch(name) for name in self.exports or ())
        return tuple(match[1] for match in found if match)


def read_head(path: Path) -> FileHead:
    content = path.read_bytes()
    mangled = tuple(sorted({_plain_name(found) for found in _MANGLED.finditer(content)}))
    if content[:4] == b"\x7fELF" and len(content) > 20:
        machine = int.from_bytes(content[18:20], "little")
        bits = 64 if content[4] == 2 else 32
        return FileHead("ELF", bits, _PROCESSORS.get(("ELF", machine), ""), None, mangled)
    if content[:4] == b"\xcf\xfa\xed\xfe":
        return FileHead("Mach-O", 64, "", None, mangled)
    if content[:2] == b"MZ":
        try:
            return _windows_head(content, mangled)
        except (struct.error, IndexError, ValueError):
            return FileHead("", 0, "", None, mangled)
    return FileHead("", 0, "", None, mangled)


def _plain_name(found: re.Match[bytes]) -> str:
    length = int(found[1]) if found[1] else None
    return found[2][:length].decode()


def _windows_head(content: bytes, mangled: tuple[str, ...]) -> FileHead:
    (at,) = struct.unpack_from("<I", content, 60)
    if content[at : at + 4] != b"PE\0\0":
        return FileHead("", 0, "", None, mangled)
    machine, sections = struct.unpack_from("<HH", content, at + 4)
    (size,) = struct.unpack_from("<H", content, at + 20)
    (mark,) = struct.unpack_from("<H", content, at + 24)
    if mark not in _DIRECTORIES:
        return FileHead("", 0, "", None, mangled)
    bits, directories = _DIRECTORIES[mark]
    (table,) = struct.unpack_from("<I", content, at + 24 + directories)
    rows = [
        struct.unpack_from("<4I", content, at + 24 + size + 40 * k + 8) for k in range(sections)
    ]

    def place(address: int) -> int:
        """Place in the file of what lies at an address in memory."""
        for length, start, stored, raw in rows:
            if start <= address < start + max(length, stored):
                return int(address - start + raw)
        raise IndexError

    names: list[str] = []
    if table:
        count, _, addresses = struct.unpack_from("<3I", content, place(table) + 24)
        if count > _MOST_EXPORTS:
            raise IndexError
        for k in range(count):
            (address,) = struct.unpack_from("<I", content, place(addresses) + 4 * k)
            begin = place(address)
            names.append(content[begin : content.index(b"\0", begin)].decode("ascii", "replace"))
    return FileHead("PE", bits, _PROCESSORS.get(("PE", machine), ""), tuple(names), mangled)
