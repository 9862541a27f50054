"""A headless Chromium for tests, and what a page of it says and asks for.

Chromium is driven over its own debugging pipe (file descriptors 3 and 4), which needs neither a
port nor a driver program. Without Chromium these tests are skipped; TACTSTRIP_REQUIRED=browser
makes that a failure. Screenshots go into the folder that TACTSTRIP_SCREENSHOTS names.
"""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import signal
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from tests.processes import require

if TYPE_CHECKING:
    from collections.abc import Iterator

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PROGRAM = next(filter(None, map(shutil.which, NAMES)), "")
OPTIONS = (
    *("--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu"),
    *("--disable-dev-shm-usage", "--disable-background-networking"),
    *("--no-first-run", "--hide-scrollbars"),
)
REQUEST = "Network.requestWillBeSent"
SAID = {
    *("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown"),
    "Page.javascriptDialogOpening",
}


class Browser:
    """A headless Chromium, its messages kept."""

    def __init__(self, home: Path) -> None:
        to_child, from_us = os.pipe()
        to_us, from_child = os.pipe()
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 50) for fd in (to_child, from_child)]
        command = [PROGRAM, *OPTIONS, f"--user-data-dir={home}", "about:blank"]
        quiet = (os.POSIX_SPAWN_OPEN, 2, os.devnull, os.O_WRONLY, 0)
        ends = [(os.POSIX_SPAWN_DUP2, fd, place) for fd, place in zip(high, (3, 4), strict=True)]
        self.pid = os.posix_spawn(
            PROGRAM, command, os.environ, file_actions=[quiet, *ends], setsid=True
        )
        for fd in (to_child, from_child, *high):
            os.close(fd)
        self._orders: IO[bytes] = os.fdopen(from_us, "wb", buffering=0)
        self._answers: IO[bytes] = os.fdopen(to_us, "rb")
        self.events: list[dict[str, Any]] = []
        self._number = 0
        self._session: dict[str, str] = {}
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        attached = self.ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = {"sessionId": attached["sessionId"]}
        for part in ("Page", "Runtime", "Log", "Network", "Security"):
            self.ask(f"{part}.enable")

    def ask(self, method: str, **parameters: Any) -> Any:
        self._number += 1
        order = {"id": self._number, "method": method, "params": parameters, **self._session}
        self._orders.write(json.dumps(order).encode() + b"\0")
        while (answer := self._next()).get("id") != self._number:
            self.events.append(answer)
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def wait_for(self, method: str) -> None:
        while self.events[-1:] == [] or self.events[-1].get("method") != method:
            self.events.append(self._next())

    def _next(self) -> dict[str, Any]:
        told = bytearray()
        while (byte := self._answers.read(1)) != b"\0":
            assert byte, "the browser is gone"
            told += byte
        answer: dict[str, Any] = json.loads(told)
        return answer

    def close(self) -> None:
        self._orders.close()
        os.killpg(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        self._answers.close()


def opened(home: Path) -> Iterator[Browser]:
    """Start a browser, and close it; skip the test where there is none."""
    require("browser", [] if PROGRAM else [" or ".join(NAMES)])
    started = Browser(home)
    yield started
    started.close()


def keep_screenshot(browser: Browser, name: str) -> None:
    folder = os.environ.get("TACTSTRIP_SCREENSHOTS")
    if folder:
        taken = browser.ask("Page.captureScreenshot", captureBeyondViewport=True)
        (Path(folder) / f"{name}.png").write_bytes(base64.b64decode(taken["data"]))
