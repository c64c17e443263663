"""Headless Chromium through its DevTools protocol, over a pipe: no driver, no port, no package
besides the browser."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
NO_BROWSER = (
    "no browser: needs chromium on a system with Unix pipes"
    if CHROMIUM is None or sys.platform == "win32"
    else None
)
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-sync", "--disable-background-networking", "--disable-component-update",
    "--disable-extensions", "--disable-dev-shm-usage",
    "--force-color-profile=srgb", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip
# The browser reads commands from descriptor 3 and answers on 4.
LAUNCH = """
import fcntl, os, sys
ends = [fcntl.fcntl(int(end), fcntl.F_DUPFD, 10) for end in sys.argv[1:3]]
for end, place in zip(ends, (3, 4)):
    os.dup2(end, place)
os.execv(sys.argv[3], sys.argv[3:])
"""


class Page:
    """What is done alike in every browser, by its `run` and `mouse`."""

    def wait_for(self, condition, seconds: float = 30.0):
        """What `condition` returns, once it is true; a string is JavaScript."""
        ask = (lambda: self.run(condition)) if isinstance(condition, str) else condition
        end = time.monotonic() + seconds
        while not (found := ask()):
            if time.monotonic() > end:
                raise TimeoutError(f"not in {seconds} s: {condition}")
            time.sleep(0.02)
        return found

    def frame(self):
        """Wait until what happened so far is painted."""
        self.run(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => "
            "done())))"
        )

    def click(self, x: float, y: float):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)
        self.frame()

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 5):
        self.mouse("mouseMoved", *start)
        self.mouse("mousePressed", *start)
        for k in range(1, steps + 1):
            f = k / steps
            self.mouse(
                "mouseMoved", *(a + f * (b - a) for a, b in zip(start, end, strict=True)), down=True
            )
        self.mouse("mouseReleased", *end)
        self.frame()


class Browser(Page):
    """A browser with one page. Used as a context; `downloads` is the folder that saved files go
    to."""

    def __init__(self, timeout: float = 60.0):
        self.timeout = timeout

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True)
        self.downloads = Path(self.folder.name, "downloads")
        self.downloads.mkdir()
        read, self.output = os.pipe()
        self.input, write = os.pipe()
        launch = [sys.executable, "-c", LAUNCH, str(read), str(write), CHROMIUM, *FLAGS]
        self.process = subprocess.Popen(
            [*launch, f"--user-data-dir={self.folder.name}/profile", "about:blank"],
            pass_fds=(read, write),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(read)
        os.close(write)
        self.number, self.buffer, self.session, self.events = 0, b"", None, []
        target = next(t for t in self.wait_for(self._targets) if t["type"] == "page")["targetId"]
        self.session = self.send("Target.attachToTarget", targetId=target, flatten=True)[
            "sessionId"
        ]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")
        session, self.session = self.session, None
        self.send("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(self.downloads))
        self.session = session
        return self

    def __exit__(self, *error):
        try:
            self.session = None
            self.send("Browser.close")
            self.process.wait(10)
        except (OSError, RuntimeError, subprocess.TimeoutExpired):
            self.process.kill()
            self.process.wait()
        os.close(self.input)
        os.close(self.output)
        self.folder.cleanup()

    def _targets(self):
        return [t for t in self.send("Target.getTargets")["targetInfos"] if t["type"] == "page"]

    def send(self, method: str, **parameters) -> dict:
        """Send a command and return its result; what happens meanwhile is kept in `events`."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.output, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.events.append(answer)

    def _receive(self) -> dict:
        while b"\0" not in self.buffer:
            ready, _, _ = select.select([self.input], [], [], self.timeout)
            data = os.read(self.input, 1 << 20) if ready else b""
            if not data:
                raise RuntimeError("the browser does not answer")
            self.buffer += data
        line, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(line)

    def run(self, script: str):
        """The value of a JavaScript expression in the page; a promise is waited for."""
        result = self.send(
            "Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in result:
            details = result["exceptionDetails"]
            raise RuntimeError(details.get("exception", {}).get("description", details["text"]))
        return result["result"].get("value")

    def open(
        self,
        path: str | Path,
        width: int = 1280,
        height: int = 800,
        dark: bool = False,
        density: float = 1.0,
    ):
        """Open a file and wait until it is ready, as its root element's `data-ready` says."""
        self.events.clear()
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.send("Emulation.setEmulatedMedia", features=[scheme])
        metrics = {"width": width, "height": height, "deviceScaleFactor": density, "mobile": False}
        self.send("Emulation.setDeviceMetricsOverride", **metrics)
        self.send("Page.navigate", url=Path(path).resolve().as_uri())
        self.wait_for("document.documentElement?.dataset.ready === 'yes'")

    def mouse(self, kind: str, x: float, y: float, **more):
        button = "left" if more.pop("down", kind != "mouseMoved") else "none"
        count = 0 if kind == "mouseMoved" or kind == "mouseWheel" else 1
        self.send(
            "Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=count, **more
        )

    def key(self, key: str, modifiers: int = 0):
        """Press a key; modifiers are 1 Alt, 2 Ctrl, 4 Meta, 8 Shift."""
        for kind in ("rawKeyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers)
        self.frame()

    def screenshot(self) -> bytes:
        return base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"])

    def troubles(self) -> list[str]:
        """Errors that the page met, in words: exceptions, errors on the console, refusals of its
        security policy."""
        out = []
        for event in self.events:
            kind, params = event.get("method"), event.get("params", {})
            if kind == "Runtime.exceptionThrown":
                details = params["exceptionDetails"]
                out.append(details.get("exception", {}).get("description", details["text"]))
            elif kind == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
                out.append(params["entry"]["text"])
            elif kind == "Runtime.consoleAPICalled" and params["type"] in (
                "error",
                "warning",
                "assert",
            ):
                out.append(
                    " ".join(
                        str(arg.get("value", arg.get("description"))) for arg in params["args"]
                    )
                )
        return out

    def requests(self) -> list[str]:
        """The addresses that the page asked for."""
        sent = (
            e["params"]["request"]["url"]
            for e in self.events
            if e.get("method") == "Network.requestWillBeSent"
        )
        return list(sent)
