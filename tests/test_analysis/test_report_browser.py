"""The report in a real browser: silent, no request, as wide as the screen, every figure shown.

Chromium is driven over its own debugging pipe (file descriptors 3 and 4), which needs neither a
port nor a driver program. Without Chromium these tests are skipped; TACTSTRIP_BROWSER=required
makes that a failure. Screenshots go into the folder that TACTSTRIP_SCREENSHOTS names. What markup
alone can promise is in test_report.py.
"""

from __future__ import annotations

import base64
import csv
import fcntl
import io
import json
import os
import random
import shutil
import signal
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import pytest

from analysis import ColumnMap, write_analysis
from tests.test_analysis.shared import put

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

pytestmark = pytest.mark.process
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
PROGRAM = next(filter(None, map(shutil.which, NAMES)), "")
OPTIONS = (
    *("--headless=new", "--remote-debugging-pipe", "--no-sandbox", "--disable-gpu"),
    *("--disable-dev-shm-usage", "--disable-background-networking"),
    *("--no-first-run", "--hide-scrollbars"),
)
SCREENS = [(360, "screen"), (800, "screen"), (1280, "screen"), (718, "print")]
"""The last is a sheet of A4 with margins of a centimetre."""
HOSTILE = (
    *("<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "=1+1", "אבגד-7", "W" * 64),
    "</style><script>",
)
MEASURE = """
(() => {
  const shown = (image) => image.complete && image.naturalWidth > 0 && image.clientWidth > 100;
  const images = [...document.images];
  // A wide table may be scrolled in its own box, but on paper nobody can.
  const boxed = matchMedia("print").matches ? "none" : ".scroll";
  const wide = [...document.querySelectorAll("body *")].filter(
    (one) => one.closest(boxed) === null
      && one.getBoundingClientRect().right > document.documentElement.clientWidth + 0.5);
  return {
    width: document.documentElement.clientWidth,
    scroll: document.documentElement.scrollWidth,
    boxes: [...document.querySelectorAll("*")].filter(
      (one) => one.closest(boxed) === null && one.scrollWidth > one.clientWidth + 1
        && getComputedStyle(one).overflowX !== "visible").length,
    wide: wide.map((one) => one.outerHTML.slice(0, 80)),
    figures: images.length,
    hidden: images.filter((image) => !shown(image)).length,
    unnamed: images.filter((image) => !image.alt).length,
    scripts: document.scripts.length,
  };
})()
"""


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


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if not PROGRAM:
        reason = f"none of {', '.join(NAMES)} is installed"
        if os.environ.get("TACTSTRIP_BROWSER") == "required":
            pytest.fail(reason)
        pytest.skip(reason)
    started = Browser(tmp_path_factory.mktemp("browser"))
    yield started
    started.close()


def many(path: Path) -> Path:
    """Write a forced choice of 40 participants in two conditions, some with hostile names."""
    rng = random.Random(5)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["participant", "trial", "condition", "side", "level_vpp", "response", "rt_s"])
    for name in (*HOSTILE, *(f"participant-number-{n:04d}" for n in range(40 - len(HOSTILE)))):
        number = 0
        for condition in ("bare plate", "@condition with a name of many words " + "x" * 26):
            for level, p in ((60, 0.5), (95, 0.7), (130, 0.85), (165, 0.95), (200, 0.97)):
                for side, other in (("left", "right"), ("right", "left")) * 4:
                    number += 1
                    answer = side if rng.random() < p else rng.choice((other, "both"))
                    cells = (name, number, condition, side, level, answer, rng.uniform(0.3, 0.9))
                    writer.writerow(cells)
    return put(path, text.getvalue())


def few(path: Path) -> Path:
    """Write one participant with blank and both-finger trials, practice and a time-out."""
    rows = ["participant,kind,side,level_vpp,response,rt_s"]
    for level, hits in ((60, 2), (90, 11), (120, 20)):
        rows += [f"S1,single,left,{level},{'left' if n < hits else 'none'},0.5" for n in range(20)]
    rows += ["S1,single,right,120,timeout,", "S1,practice,right,120,right,0.4"]
    rows += ["S1,both,both,120,both,0.6", "S1,both,both,120,left,0.6"]
    rows += [f"S1,blank,none,0,{'left' if n < 2 else 'none'},0.5" for n in range(25)]
    return put(path, "\n".join(rows) + "\n")


@pytest.fixture(scope="module", params=[few, many], ids=["few", "many"])
def report(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    write: Callable[[Path], Path] = request.param
    out = folder / write.__name__
    write_analysis([write(folder / "table.csv")], out, columns=ColumnMap())
    return out / "report.html"


REQUEST = "Network.requestWillBeSent"
SAID = {
    *("Log.entryAdded", "Runtime.consoleAPICalled", "Runtime.exceptionThrown"),
    "Page.javascriptDialogOpening",
}


def shown(browser: Browser, page: Path) -> tuple[dict[str, Any], set[str], list[str]]:
    """Return what is measured of a page, what it says and what it asks for."""
    browser.events.clear()
    browser.ask("Page.navigate", url=page.as_uri())
    browser.wait_for("Page.loadEventFired")
    measured = browser.ask("Runtime.evaluate", expression=MEASURE, returnByValue=True)
    said = {e["method"] for e in browser.events} & SAID
    asked = [e["params"]["request"]["url"] for e in browser.events if e["method"] == REQUEST]
    return measured["result"]["value"], said, asked


@pytest.mark.parametrize(("width_px", "medium"), SCREENS)
def test_the_report_is_silent_asks_for_nothing_and_fits(
    browser: Browser, report: Path, width_px: int, medium: str
) -> None:
    browser.ask(
        "Emulation.setDeviceMetricsOverride",
        width=width_px, height=800, deviceScaleFactor=1, mobile=width_px < 600,
    )  # fmt: skip
    browser.ask("Emulation.setEmulatedMedia", media=medium)
    found, said, asked = shown(browser, report)
    keep_screenshot(browser, f"{report.parent.name}-{medium}-{width_px}")
    assert found["scroll"] <= width_px
    figures = len([*report.parent.glob("*.svg")])
    assert figures >= 4
    expected = {"width": width_px, "wide": [], "boxes": 0, "figures": figures}
    expected |= {"hidden": 0, "unnamed": 0, "scripts": 0}
    assert found == expected | {"scroll": found["scroll"]}
    assert said == set()
    assert [url for url in asked if not url.startswith("data:")] == [report.as_uri()]


def keep_screenshot(browser: Browser, name: str) -> None:
    folder = os.environ.get("TACTSTRIP_SCREENSHOTS")
    if folder:
        taken = browser.ask("Page.captureScreenshot", captureBeyondViewport=True)
        (Path(folder) / f"{name}.png").write_bytes(base64.b64decode(taken["data"]))


def test_messages_requests_and_pages_too_wide_are_noticed(browser: Browser, tmp_path: Path) -> None:
    page = put(
        tmp_path / "bad.html",
        "<meta name=viewport content='width=device-width'><img src='http://127.0.0.1:9/x.png'>"
        "<div style='width:2000px'>wide</div><script>console.log('said')</script>",
    )
    found, said, asked = shown(browser, page)
    assert found["scroll"] >= 2000
    assert len(found["wide"]) == 1
    assert found["hidden"] == 1
    assert said >= {"Log.entryAdded", "Runtime.consoleAPICalled"}
    assert "http://127.0.0.1:9/x.png" in asked
