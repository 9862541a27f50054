"""The report in a real browser: silent, no request, as wide as the screen, every figure shown.

What markup alone can promise is in test_report.py.
"""

from __future__ import annotations

import csv
import io
import random
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ColumnMap, write_analysis
from tests.system.browser import REQUEST, SAID, Browser, keep_screenshot, opened
from tests.test_analysis.shared import put

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

SCREENS = [(360, "screen"), (800, "screen"), (1100, "screen"), (1280, "screen"), (718, "print")]
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
    scrolled: [...document.querySelectorAll(".answer .scroll")].filter(
      (one) => one.scrollWidth > one.clientWidth + 1).length,
    wide: wide.map((one) => one.outerHTML.slice(0, 80)),
    figures: images.length,
    hidden: images.filter((image) => !shown(image)).length,
    unnamed: images.filter((image) => !image.alt).length,
    scripts: document.scripts.length,
  };
})()
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    yield from opened(tmp_path_factory.mktemp("browser"))


def many(path: Path) -> Path:
    """Write a forced choice of 40 participants in two conditions, some with hostile names."""
    rng, text = random.Random(5), io.StringIO()
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


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    write_analysis([many(folder / "table.csv")], folder / "out", columns=ColumnMap())
    return folder / "out" / "report.html"


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
        width=width_px,
        height=800,
        deviceScaleFactor=1,
        mobile=width_px < 600,
    )
    browser.ask("Emulation.setEmulatedMedia", media=medium)
    found, said, asked = shown(browser, report)
    keep_screenshot(browser, f"{report.parent.name}-{medium}-{width_px}")
    assert found["scroll"] <= width_px
    figures = len([*report.parent.glob("*.svg")])
    assert figures >= 4
    expected = {"width": width_px, "wide": [], "boxes": 0, "figures": figures}
    expected |= {"hidden": 0, "unnamed": 0, "scripts": 0, "scrolled": 0}
    assert found == expected | {"scroll": found["scroll"]}
    assert said == set()
    assert [url for url in asked if not url.startswith("data:")] == [report.as_uri()]


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
