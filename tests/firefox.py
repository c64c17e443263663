"""Headless Firefox through WebDriver BiDi, over a socket of our own: no driver, no package besides
the browser. It does what `browser.Browser` does with Chromium."""

from __future__ import annotations

import base64
import json
import os
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from browser import Page

FIREFOX = next(filter(None, map(shutil.which, ("firefox-esr", "firefox"))), None)
NO_FIREFOX = (
    "no browser: needs firefox on a system with Unix processes"
    if FIREFOX is None or sys.platform == "win32"
    else None
)
PREFERENCES = {
    "browser.download.folderList": 2,
    "browser.download.useDownloadDir": True,
    "browser.download.alwaysOpenPanel": False,
    "browser.shell.checkDefaultBrowser": False,
    "browser.aboutwelcome.enabled": False,
    "browser.startup.homepage_override.mstone": "ignore",
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.enabled": False,
    "app.normandy.enabled": False,
    "app.update.enabled": False,
    "extensions.update.enabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "gfx.color_management.mode": 0,
}
KEYS = {
    "Escape": "\ue00c", "Delete": "\ue017", "ArrowDown": "\ue015", "ArrowUp": "\ue013",
    "ArrowLeft": "\ue012", "ArrowRight": "\ue014", "Home": "\ue011", "End": "\ue010", " ": " ",
}  # fmt: skip
HELD = {1: "\ue00a", 2: "\ue009", 4: "\ue03d", 8: "\ue008"}  # Alt, Ctrl, Meta, Shift


class Firefox(Page):
    """A browser with one page. Used as a context; `downloads` is the folder that saved files go
    to."""

    def __init__(self, timeout: float = 60.0):
        self.timeout = timeout

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="firefox-", ignore_cleanup_errors=True)
        profile = Path(self.folder.name, "profile")
        self.downloads = Path(self.folder.name, "downloads")
        profile.mkdir()
        self.downloads.mkdir()
        wanted = PREFERENCES | {"browser.download.dir": str(self.downloads)}
        lines = (f"user_pref({json.dumps(k)}, {json.dumps(v)});" for k, v in wanted.items())
        Path(profile, "user.js").write_text("\n".join(lines))
        self.process = subprocess.Popen(
            [FIREFOX, "--headless", "--no-remote", "--remote-debugging-port=0"]
            + ["--profile", str(profile), "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            env=os.environ | {"HOME": self.folder.name},
        )
        self.number, self.buffer, self.events = 0, b"", []
        try:
            self._connect(self._port())
            self.send("session.new", capabilities={})
            self.context = self.send("browsingContext.getTree")["contexts"][0]["context"]
            self.send("session.subscribe", events=["log.entryAdded", "network.beforeRequestSent"])
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *error):
        try:
            self.send("browser.close")
            self.process.wait(10)
        except (AttributeError, OSError, RuntimeError, subprocess.TimeoutExpired):
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        self.process.stderr.close()
        if hasattr(self, "socket"):
            self.socket.close()
        self.folder.cleanup()

    def _port(self) -> int:
        """The port that it says it listens on."""
        said, end = b"", time.monotonic() + self.timeout
        while not (found := re.search(rb"listening on ws://127\.0\.0\.1:(\d+)\s", said)):
            ready, _, _ = select.select([self.process.stderr], [], [], end - time.monotonic())
            more = os.read(self.process.stderr.fileno(), 1 << 16) if ready else b""
            if not more:
                raise RuntimeError("the browser does not listen")
            said += more
        return int(found[1])

    def _connect(self, port: int) -> None:
        """Open a web socket (RFC 6455)."""
        self.socket = socket.create_connection(("127.0.0.1", port), self.timeout)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET /session HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\n"
            f"Connection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n"
            "Sec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        while b"\r\n\r\n" not in self.buffer:
            self._more()
        answer, self.buffer = self.buffer.split(b"\r\n\r\n", 1)
        if b" 101 " not in answer.split(b"\r\n")[0]:
            raise RuntimeError(f"no web socket: {answer[:80]!r}")

    def _more(self) -> None:
        data = self.socket.recv(1 << 20)
        if not data:
            raise RuntimeError("the browser does not answer")
        self.buffer += data

    def _take(self, count: int) -> bytes:
        while len(self.buffer) < count:
            self._more()
        taken, self.buffer = self.buffer[:count], self.buffer[count:]
        return taken

    def _receive(self) -> dict:
        """The next message, of one or more frames."""
        message = b""
        while True:
            first, length = self._take(2)
            if length == 126:
                length = struct.unpack(">H", self._take(2))[0]
            elif length == 127:
                length = struct.unpack(">Q", self._take(8))[0]
            data = self._take(length)
            if first & 15 == 8:
                raise RuntimeError("the browser closed the socket")
            if first & 15 < 3:
                message += data
                if first & 128:
                    return json.loads(message)

    def send(self, method: str, **parameters) -> dict:
        """Send a command and return its result; what happens meanwhile is kept in `events`."""
        self.number += 1
        told = {"id": self.number, "method": method, "params": parameters}
        data, mask = json.dumps(told).encode(), os.urandom(4)
        if len(data) < 126:
            size = struct.pack(">BB", 0x81, 0x80 | len(data))
        elif len(data) < 1 << 16:
            size = struct.pack(">BBH", 0x81, 0x80 | 126, len(data))
        else:
            size = struct.pack(">BBQ", 0x81, 0x80 | 127, len(data))
        masked = bytes(a ^ mask[i % 4] for i, a in enumerate(data))
        self.socket.sendall(size + mask + masked)
        while True:
            answer = self._receive()
            if answer.get("id") == self.number:
                if answer["type"] == "error":
                    raise RuntimeError(f"{method}: {answer['message']}")
                return answer["result"]
            self.events.append(answer)

    def run(self, script: str):
        """The value of JavaScript in the page, that of its last expression; a promise is waited
        for."""
        result = self.send(
            "script.evaluate",
            expression=script,
            target={"context": self.context},
            awaitPromise=True,
        )
        if result["type"] == "exception":
            raise RuntimeError(result["exceptionDetails"]["text"])
        return plain(result["result"])

    def open(
        self, path: str | Path, width: int = 1280, height: int = 800, density: float | None = None
    ):
        """Open a file and wait until it is ready, as its root element's `data-ready` says."""
        self.events.clear()
        viewport = {"width": width, "height": height}
        self.send(
            "browsingContext.setViewport",
            context=self.context,
            viewport=viewport,
            devicePixelRatio=density,
        )
        url = Path(path).resolve().as_uri()
        self.opened = int(1000 * time.time())  # ms, as its log counts
        self.send("browsingContext.navigate", context=self.context, url=url, wait="complete")
        self.wait_for("document.documentElement?.dataset.ready === 'yes'")

    def _act(self, kind: str, actions: list[dict]) -> None:
        source = {"type": kind, "id": kind, "actions": actions}
        self.send("input.performActions", context=self.context, actions=[source])

    def mouse(self, kind: str, x: float, y: float, **more):
        move = {"type": "pointerMove", "x": x, "y": y}
        if kind == "mouseWheel":
            turn = {"type": "scroll", "x": round(x), "y": round(y)} | more
            self._act("wheel", [turn])
        elif kind == "mouseMoved":
            self._act("pointer", [move])
        else:
            press = "pointerDown" if kind == "mousePressed" else "pointerUp"
            self._act("pointer", [move, {"type": press, "button": 0}])

    def key(self, key: str, modifiers: int = 0):
        """Press a key; modifiers are 1 Alt, 2 Ctrl, 4 Meta, 8 Shift."""
        pressed = [value for bit, value in HELD.items() if modifiers & bit] + [KEYS.get(key, key)]
        down = [{"type": "keyDown", "value": value} for value in pressed]
        up = [{"type": "keyUp", "value": value} for value in reversed(pressed)]
        self._act("key", down + up)
        self.frame()

    def screenshot(self) -> bytes:
        shot = self.send("browsingContext.captureScreenshot", context=self.context)
        return base64.b64decode(shot["data"])

    def troubles(self) -> list[str]:
        """Errors and warnings that the page met, in words. Firefox tells of them late, of a page
        that is gone too: an error of our own that comes behind them all ends the list, and what was
        met before the page was opened is not this page's."""
        last = f"no more troubles, {self.number}"
        self.run(f"void setTimeout(() => {{ throw {json.dumps(last)}; }})")

        def met() -> list[str]:
            self.run("0")
            entries = (e["params"] for e in self.events if e.get("method") == "log.entryAdded")
            return [
                entry["text"]
                for entry in entries
                if entry["level"] in ("error", "warn") and entry["timestamp"] >= self.opened
            ]

        self.wait_for(lambda: any(last in text for text in met()))
        return [text for text in met() if "no more troubles, " not in text]

    def requests(self) -> list[str]:
        """The addresses that the page asked for. Firefox tells of no file among them, and of a font
        of its own, which lies in its address."""
        sent = (e["params"] for e in self.events if e.get("method") == "network.beforeRequestSent")
        urls = (told["request"]["url"] for told in sent)
        return [url for url in urls if not url.startswith("data:font/")]


def plain(told: dict):
    """The value that BiDi tells of: text, numbers, truth values, lists and objects of them."""
    value = told.get("value")
    if told["type"] == "array":
        return [plain(item) for item in value]
    if told["type"] == "object":
        return {key: plain(item) for key, item in value}
    return float(value) if told["type"] == "number" and isinstance(value, str) else value
