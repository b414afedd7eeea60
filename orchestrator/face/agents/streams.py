"""The streams between a client and the server: what is no JSON is answered, and no question is left at the end."""

import contextvars
import threading
from types import TracebackType
from typing import Any, Self

import anyio
from mcp.shared.message import SessionMessage
from mcp.types import (
    INVALID_PARAMS,
    INVALID_REQUEST,
    PARSE_ERROR,
    ErrorData,
    JSONRPCError,
    JSONRPCNotification,
    JSONRPCRequest,
    JSONRPCResponse,
)
from pydantic import ValidationError

_CANCELLED = "notifications/cancelled"


class Open:
    """The questions that have no answer yet, by their ids.

    Parameters
    ----------
    seconds
        How long they are waited for, once no further ones come [s].
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._ids: set[int | str] = set()
        self._cancelled: dict[str, threading.Event] = {}
        self._changed = anyio.Event()

    def came(self, message: Any) -> None:
        """Take a message of the client; one that it cancels gets no answer."""
        if isinstance(message, JSONRPCRequest):
            self._ids.add(message.id)
            self._cancelled[str(message.id)] = threading.Event()
        elif isinstance(message, JSONRPCNotification) and message.method == _CANCELLED:
            cancelled = (message.params or {}).get("requestId")
            if isinstance(cancelled, int | str):
                if str(cancelled) in self._cancelled:
                    self._cancelled[str(cancelled)].set()
                self._close(cancelled)

    def cancelled(self, one: str) -> threading.Event | None:
        """The event that is set once the client cancels a question; None where there is no such question."""
        return self._cancelled.get(one)

    def went(self, message: Any) -> None:
        """Take a message of the server."""
        if isinstance(message, JSONRPCResponse | JSONRPCError):
            self._close(message.id)

    async def answered(self) -> None:
        """Wait until every question has its answer."""
        with anyio.move_on_after(self._seconds):
            while self._ids:
                self._changed = anyio.Event()
                await self._changed.wait()

    def _close(self, one: int | str | None) -> None:
        if one is not None:
            self._ids.discard(one)
            self._cancelled.pop(str(one), None)
        self._changed.set()


class _Wrapped:
    """A stream around another one, which it closes."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    async def aclose(self) -> None:
        """Close it."""
        await self._inner.aclose()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.aclose()


class Outgoing(_Wrapped):
    """Messages of the server, on their way to the client."""

    def __init__(self, inner: Any, questions: Open) -> None:
        super().__init__(inner)
        self._questions = questions

    async def send(self, item: SessionMessage, /) -> None:
        """Send a message to the client."""
        await self._inner.send(item)
        self._questions.went(item.message)


class Incoming(_Wrapped):
    """Messages of the client; they end when the client has ended and all its questions are answered."""

    def __init__(self, inner: Any, outgoing: Any, questions: Open) -> None:
        super().__init__(inner)
        self._outgoing, self._questions = outgoing, questions

    @property
    def last_context(self) -> contextvars.Context | None:
        """The sender's context, which the library restores."""
        context: contextvars.Context | None = getattr(self._inner, "last_context", None)
        return context

    async def receive(self) -> SessionMessage:
        """Return the next message; what is none is answered at once."""
        while True:
            try:
                item = await self._inner.receive()
            except anyio.EndOfStream:
                await self._questions.answered()
                raise
            if not isinstance(item, Exception):
                refusal = wrong_token(item.message)
                if refusal is not None:
                    await self._outgoing.send(SessionMessage(refusal))
                    continue
                self._questions.came(item.message)
                message: SessionMessage = item
                return message
            await self._outgoing.send(SessionMessage(_refusal(item)))

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> SessionMessage:
        try:
            return await self.receive()
        except anyio.EndOfStream:
            raise StopAsyncIteration from None


def wrong_token(message: Any) -> JSONRPCError | None:
    """The answer to a question whose token of progress is none; the library says only that something is invalid."""
    if not isinstance(message, JSONRPCRequest):
        return None
    about = (message.params or {}).get("_meta")
    if not isinstance(about, dict) or "progressToken" not in about:
        return None
    token = about["progressToken"]
    if isinstance(token, int | str) and not isinstance(token, bool):
        return None
    said = "_meta.progressToken: give a text or a whole number, or leave it out"
    return JSONRPCError(
        jsonrpc="2.0", id=message.id, error=ErrorData(code=INVALID_PARAMS, message=said)
    )


def _refusal(error: Exception) -> JSONRPCError:
    """The answer to a line that is no message; its id is not known."""
    kinds = {one["type"] for one in error.errors()} if isinstance(error, ValidationError) else set()
    code, said = INVALID_REQUEST, "the line is no JSON-RPC message"
    if kinds == {"json_invalid"}:
        code, said = PARSE_ERROR, "the line is no JSON"
    return JSONRPCError(jsonrpc="2.0", id=None, error=ErrorData(code=code, message=said))
