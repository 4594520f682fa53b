"""Headless Chromium, driven over its debugging pipe (Chrome DevTools Protocol), which needs no library."""

import base64
import contextlib
import json
import os
import shutil
import subprocess
import time
from pathlib import Path

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
#: How answers begin while the page is left for another.
_LEAVING = ("Inspected target navigated or closed", "Execution context was destroyed", "Cannot find context")
_FLAGS = "--headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-sync"


class Leaving(Exception):
    """The page is replaced by another and does not answer."""


class Browser:
    """One page in a browser that reaches nothing but this machine; use as a context manager.

    Attributes:
        errors: exceptions, errors on the console, and failed requests so far.
    """

    def __init__(self, url: str, profile: Path, size: tuple[int, int] = (1400, 1150)):
        self.errors: list[str] = []
        self._number, self._buffer = 0, b""
        command_out, self._out = os.pipe()
        self._in, answer_in = os.pipe()
        # The protocol's descriptors are 3 and 4.
        wiring = f'exec 3<&{command_out} 4>&{answer_in}; exec "$@"'
        flags = [*_FLAGS.split(), f"--user-data-dir={profile}", "--window-size={},{}".format(*size)]
        local = ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", "--remote-debugging-pipe", "about:blank"]
        self._process = subprocess.Popen(
            ["bash", "-c", wiring, "bash", CHROMIUM, *flags, *local],
            pass_fds=(command_out, answer_in),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(command_out)
        os.close(answer_in)
        targets = self._call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = None
        self._session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page"):
            self._call(f"{domain}.enable")
        self._call("Page.navigate", url=url)

    def __enter__(self) -> "Browser":
        return self

    def __exit__(self, *_) -> None:
        self._process.terminate()
        self._process.wait(20)
        os.close(self._in)
        os.close(self._out)

    def evaluate(self, expression: str):
        """Value of an expression in the page."""
        return self._call("Runtime.evaluate", expression=expression, returnByValue=True)["result"].get("value")

    def wait(self, expression: str, patience: float = 60.0) -> None:
        """Wait until an expression is true in the page."""
        deadline = time.monotonic() + patience
        while True:
            with contextlib.suppress(Leaving):
                if self.evaluate(expression):
                    return
            assert time.monotonic() < deadline, f"{expression} did not become true; {self.errors}"
            time.sleep(0.1)

    def screenshot(self, path: Path) -> None:
        """Write what the page looks like (PNG)."""
        path.write_bytes(base64.b64decode(self._call("Page.captureScreenshot", format="png")["data"]))

    def _call(self, method: str, **parameters) -> dict:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if getattr(self, "_session", None):
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._message()
            if answer.get("id") == self._number:
                if answer.get("error", {}).get("message", "").startswith(_LEAVING):
                    raise Leaving(answer)
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def _message(self) -> dict:
        while b"\0" not in self._buffer:
            data = os.read(self._in, 1 << 20)
            assert data, "the browser has died"
            self._buffer += data
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def _note(self, event: dict) -> None:
        parameters = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            self.errors.append(str(parameters["exceptionDetails"]))
        if event.get("method") == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.errors.append(parameters["entry"]["text"])
        if event.get("method") == "Runtime.consoleAPICalled" and parameters["type"] == "error":
            self.errors.append(str(parameters["args"]))
