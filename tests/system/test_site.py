"""The built site in a real browser: silent, asks for nothing outside, fits; no link is dead.

It is the site that `make docs` built, or that in the folder which TACTSTRIP_SITE names; without
either these tests are skipped.
"""

from __future__ import annotations

import os
from html.parser import HTMLParser
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit
from zipfile import ZipFile

import pytest

from tests.system.browser import REQUEST, SAID, Browser, keep_screenshot, opened

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.process

ROOT = Path(__file__).resolve().parents[2]
SITE = Path(os.environ.get("TACTSTRIP_SITE") or ROOT / "site").resolve()
PAGES = [
    page
    for page in sorted(SITE.rglob("*.html"))
    if not any(part.startswith("_") for part in page.relative_to(SITE).parts)
]

RESULTS = """
new Promise((done) => {
  const look = (tries) => {
    const told = document.querySelector("#search-results").innerText;
    told.includes("Keys of study.toml") || tries === 0
      ? done(told)
      : setTimeout(look, 50, tries - 1);
  };
  look(200);
})
"""
"""Results come one by one; what is there after ten seconds is what the test gets."""
CELLS = "document.querySelectorAll('.stacked td:not(.is-empty)').length"
CELLS_IN_SIGHT = """
[...document.querySelectorAll(".stacked td:not(.is-empty)")].filter(
  (cell) => cell.getBoundingClientRect().right <= 360 && cell.scrollWidth <= cell.clientWidth
).length
"""
TOO_WIDE = """
[...document.querySelectorAll("table.stacked")].map((table) => table.parentElement).filter(
  (box) => box.scrollWidth > box.clientWidth
).map((box) => box.scrollWidth)
"""
LAID_OUT = """
new Promise((done) => {{
  const page = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const look = (frames) => {{
    const scheme = page.dataset.theme ?? (dark.matches ? "dark" : "light");
    scheme === "{scheme}" || frames === 0
      ? done({{ width: page.scrollWidth, scheme }})
      : requestAnimationFrame(() => look(frames - 1));
  }};
  look(60);
}})
"""
"""The theme follows the screen within a frame or two; a report has none, and its style does so."""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    if not PAGES:
        pytest.skip(f"no site in {SITE}: make docs")
    yield from opened(tmp_path_factory.mktemp("browser"))


def show(browser: Browser, url: str, width_px: int, scheme: str) -> None:
    browser.ask(
        "Emulation.setDeviceMetricsOverride",
        width=width_px, height=800, deviceScaleFactor=1, mobile=width_px < 600,
    )  # fmt: skip
    turn(browser, scheme)
    browser.events.clear()
    browser.ask("Page.navigate", url=url)
    browser.wait_for("Page.loadEventFired")


def turn(browser: Browser, scheme: str) -> None:
    """Make the screen light or dark; a page that is shown is not loaded again."""
    features = [{"name": "prefers-color-scheme", "value": scheme}]
    browser.ask("Emulation.setEmulatedMedia", media="screen", features=features)


def value(browser: Browser, expression: str) -> Any:
    found = browser.ask(
        "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
    )
    return found["result"]["value"]


@pytest.mark.parametrize(("width_px", "schemes"), [(360, ("light", "dark")), (1280, ("dark",))])
def test_every_page_is_silent_asks_for_nothing_outside_and_fits(
    browser: Browser, width_px: int, schemes: tuple[str, ...]
) -> None:
    for page in PAGES:
        name = page.relative_to(SITE).as_posix()
        show(browser, page.as_uri(), width_px, schemes[0])
        for scheme in schemes:
            turn(browser, scheme)
            laid_out = value(browser, LAID_OUT.format(scheme=scheme))
            assert laid_out["scheme"] == scheme, name
            assert laid_out["width"] <= width_px, (name, scheme)
            keep_screenshot(browser, f"{name.replace('/', '-')}-{scheme}-{width_px}")
        asked = {e["params"]["request"]["url"] for e in browser.events if e["method"] == REQUEST}
        assert not [u for u in asked if not u.startswith((SITE.as_uri(), "data:"))], name
        said = [event for event in browser.events if event["method"] in SAID]
        assert said == [], name


def test_every_cell_of_the_reference_is_in_sight(browser: Browser) -> None:
    for name in ("json", "journal", "study", "tables", "api/stimuli.MATERIALS"):
        show(browser, (SITE / f"reference/{name}.html").as_uri(), 360, "dark")
        assert value(browser, CELLS) > 0, name
        assert value(browser, f"{CELLS} - {CELLS_IN_SIGHT}") == 0, name
        show(browser, (SITE / f"reference/{name}.html").as_uri(), 1280, "light")
        assert value(browser, TOO_WIDE) == [], name


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_are_light_or_dark_as_the_screen_is(browser: Browser, scheme: str) -> None:
    show(browser, (SITE / "index.html").as_uri(), 1280, scheme)
    assert value(browser, "document.documentElement.dataset.theme") == scheme


def test_the_search_finds_a_key_of_the_study(browser: Browser) -> None:
    show(browser, f"{(SITE / 'search.html').as_uri()}?q=foreperiod_s", 1280, "light")
    assert "Keys of study.toml" in value(browser, RESULTS)


class _Links(HTMLParser):
    """What a page links to, and the places in it that can be linked to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.targets: set[str] = set()
        self.places: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, text in attrs:
            if name == "id" and text:
                self.places.add(text)
            if name in {"href", "src"} and text and tag != "base":
                self.targets.add(text)


@pytest.fixture
def _built() -> None:
    if not PAGES:
        pytest.skip(f"no site in {SITE}: make docs")


@pytest.mark.usefixtures("_built")
def test_no_file_tells_where_the_site_was_built() -> None:
    """The checkout is beside the site, or around it."""
    files = [path for path in SITE.rglob("*") if path.is_file()]
    shown = [path for path in files if not path.relative_to(SITE).parts[0].startswith(".")]
    here = [f"{place}/".encode() for place in {ROOT, SITE.parent}]
    assert [path for path in shown if any(place in path.read_bytes() for place in here)] == []


@pytest.mark.usefixtures("_built")
def test_every_script_of_the_gallery_is_offered_with_what_it_imports() -> None:
    figures = [page for page in PAGES if page.match("figures/*_*_*.html")]
    assert figures
    for page in figures:
        offered = {Path(target).name for target in _Links(page).targets if "_downloads" in target}
        assert offered == {f"{page.stem}.py", f"{page.stem}.zip", "paper_plate.py"}
        (archive,) = (SITE / "_downloads").rglob(f"{page.stem}.zip")
        with ZipFile(archive) as inside:
            assert set(inside.namelist()) == {f"{page.stem}.py", "paper_plate.py"}


@pytest.mark.usefixtures("_built")
def test_no_link_is_dead() -> None:
    links = {page: _Links(page) for page in PAGES}
    dead = []
    for page, found in links.items():
        for target in found.targets:
            parts = urlsplit(target)
            if parts.scheme:
                continue
            file = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            place = unquote(parts.fragment)
            known = links[file].places if file in links else {place}
            if not file.is_file() or (place and place not in known):
                dead.append(f"{page.relative_to(SITE)}: {target}")
    assert dead == []
