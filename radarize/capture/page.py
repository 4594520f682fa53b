"""Local web page that shows the newest state of a session: one file, server-sent events, no external resources."""

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

#: Events (HTML standard, section 9.2); a periodic comment detects whether the browser is still connected.
_KEEP_ALIVE = 5.0
#: Largest number of connections: each browser has one, and a second while it loads the page.
_CLIENTS = 32
#: Request type of socketserver's methods.
_Request = socket | tuple[bytes, socket]


class Unwatched:
    """Placeholder for a page that is not requested."""

    watched = False

    def send(self, name: str, content: dict[str, object]) -> None:
        """Discard the content."""


class LivePage:
    """Server of the page; a context manager.

    Content replaces earlier content of the same name: a slow browser, or one that connects later, gets the
    newest content of every name, and nothing accumulates.

    Args:
        address: address to listen on, ``HOST:PORT``; port 0 selects a free one.

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
        self._server.server_close()  # waits until the last events are sent

    @property
    def watched(self) -> bool:
        """Whether a browser is connected."""
        return self._watching > 0

    def send(self, name: str, content: dict[str, object]) -> None:
        """Set new content (plain data) of a name."""
        data = json.dumps(content)
        with self._changed:
            self._count += 1
            self._newest[name] = self._count, data
            self._changed.notify_all()

    def follow(self, write: Callable[[bytes], object]) -> None:
        """Write events to a browser until the page closes; runs in the connection's thread."""
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
        """Answer in a separate thread, unless there are too many connections."""
        if self._room.acquire(blocking=False):
            super().process_request(request, client_address)
            return
        words = f"{_CLIENTS} connections are open already, which is as many as this page serves; close one\n"
        assert isinstance(request, socket)  # over TCP; over UDP it would be a pair
        with contextlib.suppress(OSError):
            request.sendall(f"HTTP/1.0 503 Service Unavailable\r\nContent-Type: text/plain\r\n\r\n{words}".encode())
        self.shutdown_request(request)

    def process_request_thread(self, request: _Request, client_address: object) -> None:
        """Release the connection's slot when it ends."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request: _Request, client_address: object) -> None:
        """Ignore disconnected browsers."""


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = 10.0  # disconnects a browser that does not read

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
        """Whether the request is for this page: by address, or by a local name (against DNS rebinding), and not from
        another site."""
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
        """Keep the terminal free of the server's log."""
