"""A headless Chromium, driven by the DevTools protocol over two pipes: no library, no port, no network."""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import psutil

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
FLAGS = [
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-dev-shm-usage"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--remote-debugging-pipe"),
]


class Browser:
    """One page of one browser with a profile of its own. Use it in a with statement."""

    def __init__(self, profile: Path, size: tuple[int, int] = (1400, 900)) -> None:
        """profile: a new folder. size: of the window, CSS pixels."""
        assert PROGRAM is not None
        hears, self._to = os.pipe()
        self._from, says = os.pipe()

        def as_3_and_4() -> None:
            spare = os.dup(says)  # `says` may be 3
            os.dup2(hears, 3)
            os.dup2(spare, 4)
            for end in (3, 4):
                os.set_inheritable(end, True)  # which dup2 leaves undone where both are the same

        command = [PROGRAM, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        self._process = subprocess.Popen(
            command, preexec_fn=as_3_and_4, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        os.close(hears)
        os.close(says)
        self._number, self._buffer = 0, b""
        self._session: str | None = None
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self.errors: list[str] = []
        for domain in ("Page", "Runtime", "Network"):
            self.send(f"{domain}.enable")
        self.requested: list[str] = []
        self.resize(*size)

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        helpers = psutil.Process(self._process.pid).children(recursive=True)
        self._process.terminate()
        self._process.wait(20)
        left = psutil.wait_procs(helpers, 20)[1]  # they write into the profile
        for helper in left:
            helper.kill()
        psutil.wait_procs(left, 20)
        os.close(self._to)
        os.close(self._from)

    def resize(self, width: int, height: int, scale: float = 1.0) -> None:
        """A window of another size, CSS pixels; scale: of the screen's pixels."""
        self.send(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=False
        )

    def prefer(self, scheme: str) -> None:
        """`light` or `dark`."""
        self.send("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def open(self, page: Path | str) -> None:
        """Load a file or an address and wait until its scripts have run."""
        self.send("Page.navigate", url=page if isinstance(page, str) else page.resolve().as_uri())
        self._until("Page.loadEventFired")
        self.settle()

    def settle(self) -> None:
        """Wait until what was to be drawn is drawn."""
        self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(0))))")

    def run(self, script: str) -> Any:
        """The value of an expression in the page, promises awaited. Raises RuntimeError for an error in it."""
        told = self.send("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in told:
            raise RuntimeError(json.dumps(told["exceptionDetails"])[:2000])
        return told["result"].get("value")

    def until(self, condition: str, patience_s: float = 120.0) -> None:
        """Wait until an expression holds in the page. Raises RuntimeError if it does not in that time."""
        self.run(
            f"new Promise((done, fail) => {{ const end = performance.now() + {1e3 * patience_s}; (function look() {{"
            f" if ({condition}) done(0); else if (performance.now() > end) fail(new Error('not seen'));"
            f" else setTimeout(look, 20); }})(); }})"
        )

    def press(self, key: str, modifiers: int = 0) -> None:
        """A key, by its DOM name. modifiers: 8 is Shift."""
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.send("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers, **text)

    def click(self, x: float, y: float) -> None:
        """The left button at a place of the window, CSS pixels."""
        self.drag([(x, y)])

    def drag(self, places: Sequence[tuple[float, float]], modifiers: int = 0) -> None:
        """Press at the first place, move over the others, release at the last."""
        kinds = ["mousePressed", *["mouseMoved"] * (len(places) - 1), "mouseReleased"]
        for kind, (x, y) in zip(kinds, [*places, places[-1]], strict=True):
            self.send(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1,
                modifiers=modifiers,
            )  # fmt: skip

    def picture(self, target: Path, whole: bool = True) -> None:
        """A PNG of the page, or of the window alone."""
        data = self.send("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        target.write_bytes(base64.b64decode(data))

    def send(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol and its result. Raises RuntimeError."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            heard = self._hear()
            if heard.get("id") == self._number:
                if "error" in heard:
                    raise RuntimeError(f"{method}: {heard['error']}")
                return dict(heard["result"])

    def _until(self, event: str) -> None:
        while self._hear().get("method") != event:
            pass

    def _hear(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            part = os.read(self._from, 1 << 20)
            if not part:
                raise RuntimeError("the browser ended")
            self._buffer += part
        line, _, self._buffer = self._buffer.partition(b"\0")
        heard = dict(json.loads(line))
        if heard.get("method") == "Runtime.exceptionThrown":
            details = heard["params"]["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        if heard.get("method") == "Network.requestWillBeSent":
            self.requested.append(heard["params"]["request"]["url"])
        return heard
