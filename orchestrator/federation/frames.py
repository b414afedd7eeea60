"""Frames between gfor and the hub, the process that speaks HELICS for it: a kind, a length and bytes over loopback."""

import secrets
import socket
import struct
from contextlib import suppress
from typing import Self

_HEAD = struct.Struct("<cI")

JOIN, COMMAND, FIRST, STEP, END, FAULT = b"J", b"C", b"1", b"S", b"E", b"F"
"""Kinds: wait for all federates; a command to one of them; outputs before the first step; a step; the end; an error."""


# for who has called to say the word [s]: the hub may wait for a processor meanwhile
_TO_SPEAK = 10.0


class Frames:
    def __init__(self, connection: socket.socket) -> None:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket, self._rest = connection, b""

    def send(self, kind: bytes, content: bytes = b"") -> None:
        self._socket.sendall(_HEAD.pack(kind, len(content)) + content)

    def receive(self, seconds: float | None = None) -> tuple[bytes, bytes]:
        """Receive a frame; after a TimeoutError the same call can be made again.

        Raises a `TimeoutError` if no whole frame came within the time [s].
        Raises an `EOFError` if the other side is gone."""
        self._socket.settimeout(seconds)
        while True:
            if len(self._rest) >= _HEAD.size:
                kind, length = _HEAD.unpack_from(self._rest)
                end = _HEAD.size + length
                if len(self._rest) >= end:
                    content, self._rest = self._rest[_HEAD.size : end], self._rest[end:]
                    return kind, content
            try:
                more = self._socket.recv(1 << 16)
            except ConnectionError:
                more = b""
            if not more:
                raise EOFError
            self._rest += more

    def close(self) -> None:
        self._socket.close()


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
                if frames.receive(_TO_SPEAK) == (JOIN, self.word.encode()):
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
