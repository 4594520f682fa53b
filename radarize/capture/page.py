"""A local web page that shows the newest state of things: one file, server-sent events, nothing from the network."""

import contextlib
import ipaddress
import json
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socket import socket
from urllib.parse import urlsplit

from radarize.evaluation.report.page import STYLE
from radarize.io.errors import InputError

#: Events (HTML standard, section 9.2); a comment now and then tells whether the browser is still there.
_KEEP_ALIVE = 5.0
#: Connections at a time: each browser holds one, and a second while it loads the page.
_CLIENTS = 32
#: What socketserver hands its methods.
_Request = socket | tuple[bytes, socket]


class Unwatched:
    """Stands for a page that nobody asked for."""

    watched = False

    def send(self, name: str, content: dict[str, object]) -> None:
        """Nothing."""


class LivePage:
    """Serves the page; use as a context manager.

    What is sent under a name replaces what was sent before: a browser that cannot keep up, or comes later, gets the
    newest of every name, and nothing piles up.

    Args:
        address: to listen on, ``HOST:PORT``; port 0 takes a free one.

    Attributes:
        url: to open in a browser.

    Raises:
        InputError: the address cannot be used.
    """

    def __init__(self, address: str = "127.0.0.1:8470"):
        host, _, port = address.rpartition(":")
        try:
            self._server = _Server((host or "127.0.0.1", int(port)), _Handler)
        except (OSError, ValueError, OverflowError) as error:
            why = getattr(error, "strerror", None) or "no port number"
            raise InputError(f"--address {address}: {why}, expected HOST:PORT to show the page at") from error
        self._server.page, self._server.name = self, host or "127.0.0.1"
        self.url = f"http://{host or '127.0.0.1'}:{self._server.server_address[1]}/"
        self._changed = threading.Condition()
        self._newest: dict[str, tuple[int, str]] = {}
        self._count = self._watching = 0
        self._closed = False
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def __enter__(self) -> "LivePage":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()  # waits until the browsers have the last events

    @property
    def watched(self) -> bool:
        """Whether a browser looks on."""
        return self._watching > 0

    def send(self, name: str, content: dict[str, object]) -> None:
        """Show new content (plain data) under a name."""
        data = json.dumps(content)
        with self._changed:
            self._count += 1
            self._newest[name] = self._count, data
            self._changed.notify_all()

    def follow(self, write: Callable[[bytes], object]) -> None:
        """Write events as they come until the page closes; runs in a browser's thread."""
        seen = 0
        with self._changed:
            self._watching += 1
        try:
            while True:
                with self._changed:
                    if not self._closed and self._count == seen:
                        self._changed.wait(_KEEP_ALIVE)
                    news = sorted((at, name, data) for name, (at, data) in self._newest.items() if at > seen)
                    closed, seen = self._closed, self._count
                events = "".join(f"event: {name}\ndata: {data}\n\n" for _, name, data in news)
                write((events or ": still here\n\n").encode())
                if closed:
                    return
        finally:
            with self._changed:
                self._watching -= 1


class _Server(ThreadingHTTPServer):
    page: LivePage
    name: str  # of the address that was given
    daemon_threads = False  # so that closing waits for the last events

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]):
        self._room = threading.BoundedSemaphore(_CLIENTS)
        super().__init__(address, handler)

    def process_request(self, request: _Request, client_address: object) -> None:
        """Answer in a thread of its own, while there is room."""
        if self._room.acquire(blocking=False):
            super().process_request(request, client_address)
            return
        words = f"{_CLIENTS} connections are open already, which is as many as this page serves; close one\n"
        assert isinstance(request, socket)  # over TCP; over UDP it would be a pair
        with contextlib.suppress(OSError):
            request.sendall(f"HTTP/1.0 503 Service Unavailable\r\nContent-Type: text/plain\r\n\r\n{words}".encode())
        self.shutdown_request(request)

    def process_request_thread(self, request: _Request, client_address: object) -> None:
        """Make room again when a connection ends."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: _Request, client_address: object) -> None:
        """A browser that went away is no error."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = 10.0  # a browser that takes nothing is let go

    def do_GET(self) -> None:
        if not self._ours():
            self.send_error(403, explain="expected the address that radarize printed, and no other site's page asking")
        elif self.path == "/":
            html = Path(__file__).with_name("live.html").read_text().replace("/* STYLE */", STYLE)
            self._head("text/html; charset=utf-8")
            self.wfile.write(html.encode())
        elif self.path == "/events":
            self._head("text/event-stream")
            self.server.page.follow(self.wfile.write)
        else:
            self.send_error(404)

    def _ours(self) -> bool:
        """Whether the user's browser asks for this very page: by address, or a name that nobody else can point here
        (DNS rebinding), and not on behalf of another site."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            ours = name in ("localhost", self.server.name) or bool(ipaddress.ip_address(name))
        except ValueError:
            return False
        return ours and origin in (None, f"http://{host}")

    def _head(self, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """The terminal is for the user's own."""
