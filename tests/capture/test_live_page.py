"""Access control of the live page."""

import socket

import pytest

from radarize.capture import page as module
from radarize.capture.page import LivePage


def asked(page: LivePage, *headers: str, path: str = "/") -> str:
    """First line of the answer to a request with given headers."""
    with connected(page) as client:
        client.sendall("\r\n".join([f"GET {path} HTTP/1.1", *headers, "", ""]).encode())
        return client.makefile().readline().strip()


def connected(page: LivePage) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port(page)), timeout=10)


def port(page: LivePage) -> int:
    return int(page.url.rstrip("/").rsplit(":", 1)[1])


@pytest.mark.parametrize(
    ("host", "origin", "answer"),
    [
        ("127.0.0.1:{}", None, 200),
        ("localhost:{}", None, 200),
        ("[::1]:{}", None, 200),
        ("127.0.0.1:{}", "http://127.0.0.1:{}", 200),
        ("127.0.0.1:{}", "http://evil.example", 403),
        ("127.0.0.1:{}", "null", 403),
        ("evil.example:{}", None, 403),  # which its owner may point to 127.0.0.1
        ("evil.example:{}", "http://evil.example:{}", 403),
        ("127.0.0.1.evil.example:{}", None, 403),
        ("[::1", None, 403),
        (None, None, 403),
    ],
)
def test_only_the_page_itself_asks(host, origin, answer):
    with LivePage("127.0.0.1:0") as page:
        headers = [("Host", host), ("Origin", origin)]
        given = [f"{name}: {value.format(port(page))}" for name, value in headers if value]
        for path in ("/", "/other") if answer == 403 else ("/",):
            assert asked(page, *given, path=path).startswith(f"HTTP/1.0 {answer} ")


def test_one_connection_too_many_is_refused(monkeypatch):
    monkeypatch.setattr(module, "_CLIENTS", 2)
    with LivePage("127.0.0.1:0") as page:
        held = [connected(page) for _ in range(2)]
        page.send("frame", {})
        with connected(page) as third:
            answer = third.makefile().read()
        assert answer.startswith("HTTP/1.0 503") and "2 connections are open already" in answer
        for client in held:
            client.close()
        good = f"Host: 127.0.0.1:{port(page)}"
        while "503" in (answer := asked(page, good)):
            pass
        assert answer.startswith("HTTP/1.0 200")
