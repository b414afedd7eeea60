"""Strings and integers as SSH lays them out (RFC 4251, section 5)."""

import struct


class WireError(ValueError):
    """Bytes that are not what SSH would have written."""


def packed(content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + content


def packed_integer(value: int) -> bytes:
    """A whole number of 0 or more; a first bit of 1 would make it negative, so that a zero byte goes before."""
    return packed(value.to_bytes(value.bit_length() // 8 + 1, "big") if value else b"")


class Reader:
    """Reads one part after the other, and refuses what is left over."""

    def __init__(self, content: bytes) -> None:
        self._content, self._place = content, 0

    def take(self, count: int) -> bytes:
        end = self._place + count
        if end > len(self._content):
            raise WireError(f"it ends after {len(self._content)} bytes, and {end} are needed")
        part = self._content[self._place : end]
        self._place = end
        return part

    def number(self) -> int:
        return int(struct.unpack(">I", self.take(4))[0])

    def string(self) -> bytes:
        return self.take(self.number())

    def integer(self) -> int:
        return int.from_bytes(self.string(), "big", signed=True)

    def end(self) -> None:
        if self._place != len(self._content):
            raise WireError(f"{len(self._content) - self._place} bytes follow its end")
