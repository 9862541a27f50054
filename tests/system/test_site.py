"""The site is built without a warning; in a browser it is silent and fits."""

from __future__ import annotations

import os
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlsplit

import pytest

from tests.system.browser import REQUEST, SAID, Browser, opened

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.xdist_group("site")  # one build at a time: it writes docs/reference
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site; a warning of Sphinx fails."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "docs", str(folder)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> list[Path]:
    every = sorted(site.rglob("*.html"))
    return [page for page in every if "/_" not in f"/{page.relative_to(site).as_posix()}"]


class Links(HTMLParser):
    """The targets that a page links to, and its anchors."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, text in attrs:
            if name == "id" and text:
                self.anchors.add(text)
            if name in {"href", "src"} and text and tag != "base":
                self.targets.add(text)


def test_no_link_is_dead_and_no_page_names_the_folder_of_the_build(
    site: Path, pages: list[Path]
) -> None:
    links = {page: Links(page) for page in pages}
    assert len(links) > 40
    dead = []
    for page, found in links.items():
        for target in found.targets:
            parts = urlsplit(target)
            file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            anchor = unquote(parts.fragment)
            anchors = links[file].anchors if file in links else {anchor}
            if not parts.scheme and not (file.is_file() and (not anchor or anchor in anchors)):
                dead.append(f"{page.relative_to(site)}: {target}")
        text = page.read_bytes()
        assert not any(f"{folder}/".encode() in text for folder in (ROOT, site.parent)), page
    assert dead == []


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    yield from opened(tmp_path_factory.mktemp("browser"))


@pytest.mark.parametrize("width_px", [360, 1280])
def test_every_page_is_silent_asks_for_nothing_outside_and_fits(
    browser: Browser, site: Path, pages: list[Path], width_px: int
) -> None:
    size = {"width": width_px, "height": 800, "deviceScaleFactor": 1, "mobile": width_px < 600}
    browser.ask("Emulation.setDeviceMetricsOverride", **size)
    width = {"expression": "document.documentElement.scrollWidth", "returnByValue": True}
    for page in pages:
        browser.events.clear()
        browser.ask("Page.navigate", url=page.as_uri())
        browser.wait_for("Page.loadEventFired")
        assert browser.ask("Runtime.evaluate", **width)["result"]["value"] <= width_px, page
        asked = {e["params"]["request"]["url"] for e in browser.events if e["method"] == REQUEST}
        assert not [url for url in asked if not url.startswith((site.as_uri(), "data:"))], page
        assert [event for event in browser.events if event["method"] in SAID] == [], page
