"""Links of Markdown files hold where these are read in git: without the site, which is built."""

from __future__ import annotations

import re
from functools import cache
from os.path import normpath
from pathlib import Path, PurePosixPath
from urllib.parse import urlsplit

import pytest

from tests.test_packaging import tracked

ROOT = Path(__file__).parents[1]
LINK = re.compile(r"\]\(\s*<?([^)>\s]+)|^\[[^]]+\]:\s+(\S+)", re.MULTILINE)
BLOCK = re.compile(r"^( *)```.*?^\1```", re.DOTALL | re.MULTILINE)
"""Code, in which brackets are none of a link."""


def text_of(path: Path) -> str:
    return BLOCK.sub("", path.read_text(encoding="utf-8"))


def place_of(heading: str) -> str:
    """Return the name by which a heading is linked to."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@cache
def places_in(path: Path) -> frozenset[str]:
    return frozenset(map(place_of, re.findall(r"^#+ (.+)$", text_of(path), re.MULTILINE)))


def dead_links(root: Path, name: str, kept: set[str]) -> list[str]:
    """List what a file links to that is not kept, or has no heading of that name."""
    dead = []
    for link in ("".join(found) for found in LINK.findall(text_of(root / name))):
        parts = urlsplit(link)
        if parts.scheme:
            continue
        there = normpath(PurePosixPath(name).parent / parts.path) if parts.path else name
        place = parts.fragment if there.endswith(".md") else ""
        if there not in kept or (place and place not in places_in(root / there)):
            dead.append(link)
    return dead


def test_every_link_leads_to_what_is_kept_in_git_and_to_a_heading_in_it() -> None:
    names = tracked()
    kept = {*names, *(str(parent) for name in names for parent in PurePosixPath(name).parents)}
    pages = [name for name in names if name.endswith(".md")]
    assert len(pages) > 30
    assert {page: dead for page in pages if (dead := dead_links(ROOT, page, kept))} == {}


LINKS = ["docs/model.md#3-bursts", "docs", "https://keepachangelog.com"]
DEAD = ["docs/reference/index.md", "docs/model.md#no-such-heading", "nowhere.md"]


@pytest.mark.parametrize("link", [*LINKS, *DEAD])
def test_a_dead_link_is_found(link: str, tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "model.md").write_text("# Model\n\n## 3. Bursts\n", encoding="utf-8")
    page = f"[in\ntwo lines]({link})\n\n```sh\n[not](a-link)\n```\n"
    (tmp_path / "page.md").write_text(page, encoding="utf-8")
    kept = {"docs", "docs/model.md"}
    assert dead_links(tmp_path, "page.md", kept) == [link] * (link in DEAD)
