"""A universal Mach-O binary: libraries for several Mac processors in one file, as Apple's `lipo` joins them."""

import struct
from collections.abc import Sequence

_MAGIC = 0xCAFEBABE
_ALIGNMENT = 14  # alignment of each library in the file, as a power of two: the page size of the newer processors
_THIN = b"\xcf\xfa\xed\xfe"


def universal_binary(libraries: Sequence[bytes]) -> bytes:
    """Join thin 64-bit libraries, one per processor."""
    step = 1 << _ALIGNMENT
    header, body = struct.pack(">II", _MAGIC, len(libraries)), b""
    offset = step
    for library in libraries:
        if library[:4] != _THIN:
            raise ValueError("a universal binary is made of thin 64-bit Mach-O files")
        processor, variant = struct.unpack("<II", library[4:12])
        header += struct.pack(">IIIII", processor, variant, offset, len(library), _ALIGNMENT)
        padded = library + bytes(-len(library) % step)
        body += padded
        offset += len(padded)
    return header + bytes(step - len(header)) + body
