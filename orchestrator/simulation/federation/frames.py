"""Frames between gfor and the hub, the process that speaks HELICS for it: a kind, a length and bytes over loopback."""

import secrets
import socket
import struct
from contextlib import suppress
from time import monotonic
from typing import Self

_HEAD = struct.Struct("<cI")

JOIN = b"J"
COMMAND = b"C"
FIRST = b"1"
STEP = b"S"
END = b"E"
FAULT = b"F"
"""Kinds: wait for all federates; a command to one of them; outputs before the first step; a step; the end; an error."""


# for who has called to say the word [s]: the hub may wait for a processor meanwhile
_TO_SPEAK = 10.0
# of one frame [bytes]: a hundred times the outputs of the largest component, or the text of an error
_LARGEST = 64 * 1024**2


class Frames:
    def __init__(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket, self._rest = connection, b""

    def send(self, kind: bytes, content: bytes = b"") -> None:
        self._socket.sendall(_HEAD.pack(kind, len(content)) + content)

    def receive(self, seconds: float | None = None, most: int = _LARGEST) -> tuple[bytes, bytes]:
        """Receive a frame; after a TimeoutError the same call can be made again.

        ``seconds``: within which the whole frame must come, however many parts it comes in; None for no limit.
        ``most``: bytes that it may have.

        Raises a `TimeoutError` if no whole frame came within the time [s].
        Raises an `EOFError` if the other side is gone, or announces a longer frame."""
        end_of_wait = None if seconds is None else monotonic() + seconds
        while True:
            if len(self._rest) >= _HEAD.size:
                kind, length = _HEAD.unpack_from(self._rest)
                if length > most:
                    raise EOFError(f"a frame of {length} bytes, where {most} are the most")
                end = _HEAD.size + length
                if len(self._rest) >= end:
                    content, self._rest = self._rest[_HEAD.size : end], self._rest[end:]
                    return kind, content
            self._socket.settimeout(_time_left(end_of_wait))
            try:
                more = self._socket.recv(1 << 16)
            except ConnectionError:
                more = b""
            if not more:
                raise EOFError
            self._rest += more

    def close(self) -> None:
        self._socket.close()


def _time_left(end: float | None) -> float | None:
    """Time until then [s], for a socket's timeout."""
    if end is None:
        return None
    left = end - monotonic()
    if left <= 0:
        raise TimeoutError("timed out")
    return left


class Door:
    """Where the hub calls gfor: a port of this machine alone, and a word that only the two know."""

    def __init__(self) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self.word = secrets.token_hex(16)

    def accept(self, seconds: float) -> Frames:
        self._server.settimeout(seconds)
        while True:
            frames = Frames(self._server.accept()[0])
            with suppress(TimeoutError, EOFError):  # a stranger that says nothing
                if frames.receive(_TO_SPEAK, len(self.word)) == (JOIN, self.word.encode()):
                    return frames
            frames.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._server.close()


def call(port: int, word: str) -> Frames:
    frames = Frames(socket.create_connection(("127.0.0.1", port), timeout=10.0))
    frames.send(JOIN, word.encode())
    return frames
