"""The server of the page: on loopback alone, and for nobody who does not know the token in its address."""

import json
import math
import queue
import secrets
import sys
import threading
import time
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.face.explore.computing import Answer, Computing
from orchestrator.face.explore.files import FILES, PAGE, content_of

LOOPBACK = "127.0.0.1"
LINGER = 60.0  # how long the server goes on after the last page was closed [s]
_MOST_BYTES = 1_000_000  # of a question
_BEAT = 2.0  # between two signs of life to a page [s]
# questions that other processes answer than that of the modes, which a slider waits for
_BESIDE = {"slopes": "slopes", "run": "run", "movers": "first", "first": "first"}
_POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:"


class Explorer:
    """The server, its pages, and the processes that compute: for what is asked, and beside it for slopes, for runs, and
    for what the first screen has besides the modes.

    ``beginning``: what the page begins with, as JSON's types."""

    def __init__(
        self,
        case: str,
        beginning: Answer,
        *,
        port: int = 0,
        trust_fmus: bool = False,
        linger: float = LINGER,
    ) -> None:
        self.beginning, self.token = beginning, secrets.token_urlsafe(24)
        kinds, recorded = {"modes", *_BESIDE.values()}, beginning.get("recorded")
        self.computing = {
            kind: Computing(case, trust_fmus=trust_fmus, recorded=recorded) for kind in kinds
        }
        self._linger = linger
        self._pages: dict[str, queue.SimpleQueue[Answer]] = {}
        self._last_seen = float("inf")  # nobody was there yet
        try:
            self._server = _Server((LOOPBACK, port), partial(_Handler, self))
        except OSError as error:
            text = f"--port {port}: nothing can listen there: {error.strerror}; give another port, or none"
            raise InputError(text) from error
        self._server.daemon_threads = True
        self.port = int(self._server.server_address[1])
        self.address = f"http://{LOOPBACK}:{self.port}/{self.token}/"
        # what a browser that was led here by the address sends as host; one that was led here by another name does not
        self.hosts = (f"{LOOPBACK}:{self.port}", f"localhost:{self.port}")

    def serve(self) -> None:
        """Answer until the last page was closed for a while, or an interrupt comes."""
        threading.Thread(
            target=self._server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True
        ).start()
        try:
            while self._pages or time.monotonic() < self._last_seen + self._linger:
                time.sleep(0.2)
        finally:
            self.close()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        for computing in self.computing.values():
            computing.close()
        for computing in self.computing.values():
            computing.wait_for_its_end()

    def opened(self, page: str) -> "queue.SimpleQueue[Answer]":
        self._last_seen = time.monotonic()
        for computing in self.computing.values():
            computing.welcome(page)
        self._pages[page] = queue.SimpleQueue()
        return self._pages[page]

    def close_page(self, page: str, told: "queue.SimpleQueue[Answer]") -> None:
        """A page was closed, unless it came again meanwhile; nobody waits any more for what it asked."""
        self._last_seen = time.monotonic()
        if self._pages.get(page) is told:
            del self._pages[page]
            for computing in self.computing.values():
                computing.cancel(page, math.inf)

    def tell(self, page: str, what: Answer) -> None:
        told = self._pages.get(page)
        if told is not None:
            told.put(what)

    def answer(self, page: str, question: Answer) -> Answer:
        if question.get("ask") == "cancel":
            for computing in self.computing.values():
                computing.cancel(page, question["number"])
            return {"answer": {}}
        computing = self.computing[_BESIDE.get(str(question.get("ask")), "modes")]
        return computing.ask(
            page, question, lambda part: self.tell(page, {"of": question.get("ask"), **part})
        )


class _Server(ThreadingHTTPServer):
    """With a queue for the questions of a page that come at once, of which the usual one of 5 resets some."""

    request_queue_size = 128

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a page that went away; the rest is said as the library says it."""
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """One request of a browser, answered by the explorer that the address' token belongs to."""

    protocol_version = "HTTP/1.1"

    def __init__(self, explorer: Explorer, *connection: Any) -> None:
        self._explorer = explorer
        super().__init__(*connection)  # which answers

    def do_GET(self) -> None:
        name = self._authorised_path()
        if name is None:
            return
        name, _, page = name.partition("?page=")
        if name == "events" and page:
            self._events(page)
        elif name == "beginning":
            self._send(
                HTTPStatus.OK, json.dumps(self._explorer.beginning).encode(), "application/json"
            )
        elif (file := name or PAGE) in FILES:
            self._send(HTTPStatus.OK, content_of(file), FILES[file])
        else:
            self._refuse(HTTPStatus.NOT_FOUND)

    def do_POST(self) -> None:
        name = self._authorised_path()
        if name is None:
            return
        length = self.headers.get("Content-Length", "")
        if name != "ask" or not length.isdecimal() or int(length) > _MOST_BYTES:
            self._refuse(HTTPStatus.BAD_REQUEST)
            return
        try:
            question = json.loads(self.rfile.read(int(length)))
            page, question["number"] = str(question["page"]), float(question["number"])
        except (ValueError, KeyError, TypeError, RecursionError):
            self._refuse(HTTPStatus.BAD_REQUEST)
            return
        found = self._explorer.answer(page, question)
        self._send(HTTPStatus.OK, json.dumps(found).encode(), "application/json")

    def _authorised_path(self) -> str | None:
        """Return what is asked for behind the token; None where it is refused."""
        _, token, *rest = (*self.path.split("/", 2), "")[:3]
        known = secrets.compare_digest(token.encode(), self._explorer.token.encode())
        origin = self.headers.get("Origin")
        ours = origin is None or origin in [f"http://{host}" for host in self._explorer.hosts]
        if not known or self.headers.get("Host") not in self._explorer.hosts or not ours:
            self._refuse(HTTPStatus.FORBIDDEN)
            return None
        return rest[0]

    def _events(self, page: str) -> None:
        """Tell a page what comes up, for as long as it is open."""
        told = self._explorer.opened(page)
        try:
            self._head(HTTPStatus.OK, "text/event-stream", None)
            while True:
                try:
                    text = f"data: {json.dumps(told.get(timeout=_BEAT))}\n\n"
                except queue.Empty:
                    text = ": still here\n\n"
                self.wfile.write(text.encode())
                self.wfile.flush()
        except OSError:
            self.close_connection = True
        finally:
            self._explorer.close_page(page, told)

    def _head(self, status: HTTPStatus, kind: str, length: int | None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is None:
            self.send_header("Connection", "close")
        else:
            self.send_header("Content-Length", str(length))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", _POLICY)
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()

    def _send(self, status: HTTPStatus, content: bytes, kind: str) -> None:
        try:
            self._head(status, kind, len(content))
            self.wfile.write(content)
        except OSError:  # the page was closed meanwhile
            self.close_connection = True

    def _refuse(self, status: HTTPStatus) -> None:
        self.close_connection = True
        self._send(status, status.phrase.encode(), "text/plain")

    def version_string(self) -> str:
        return "gfor"

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing: standard error is for what is wrong."""
