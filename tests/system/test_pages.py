"""Tutorial and how-tos: their commands run, print what they show and draw their pictures."""

from __future__ import annotations

import importlib
import os
import re
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

pytest.importorskip("termios", reason="pages are run by bash, on pseudo-terminals")

pytestmark = pytest.mark.gallery
ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([DOCS / "tutorial.md", DOCS / "plate.md", *DOCS.glob("howto/*.md")])
MOST_S = 150.0
"""Processor time of a page, of which the tutorial takes 25 to 80 s: an older server needs 2.7 times
as long as a newer one, and more beside others."""


@pytest.fixture(autouse=True)
def _extensions_on_the_path() -> Iterator[None]:
    """As when the script is run: its folder comes first."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS / "_ext")
        yield


def pages() -> Any:
    return importlib.import_module("pages")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_shows_what_happens(page: Path, tmp_path: Path) -> None:
    if "fuser" in page.read_text(encoding="utf-8") and shutil.which("fuser") is None:
        pytest.skip("fuser (psmisc) is missing")
    before = os.times()
    pages().Page(page, tmp_path).run()
    after = os.times()
    spent_s = after.children_user + after.children_system
    assert spent_s - before.children_user - before.children_system < MOST_S


@pytest.fixture
def run(tmp_path: Path) -> Any:
    """Run a page of this text; return it as it is then."""

    def run_text(text: str, *, rewrite: bool = False) -> str:
        page, folder = tmp_path / "page.md", tmp_path / "folder"
        page.write_text(text, encoding="utf-8")
        folder.mkdir()
        pages().Page(page, folder, rewrite=rewrite).run()
        return page.read_text(encoding="utf-8")

    return run_text


def block(*lines: str, above: str = "", language: str = "console") -> str:
    return "\n".join([*([above] if above else []), f"```{language}", *lines, "```", ""])


TRUE = [
    block("$ echo one; echo two >&2", "one", "two", "$ echo three", "three"),
    block("$ seq 9", "1", "...", "8", "9", "$ echo took 0.3 s", "took ... s"),
    block("$ echo one \\", "    two", "one two"),
    block("$ true", "$ echo no; exit 4", "no", above="<!-- exit 4 -->"),
    block("a = 1", above="<!-- file: in/a.toml -->", language="toml")
    + block("$ cat in/*", "a = 1"),
    block("a = 1", language="python") + block("print(a)\nprint()", language="python")
    + block("1", above="<!-- prints -->", language="text"),
    "<!-- copy: docs/examples/paper-table1.csv -->\n" + block("$ ls", "paper-table1.csv"),
    block("shown only", language="toml") + block("sudo rm -rf /nothing", language="sh"),
    block("$ read -n 1 a; read -n 1 b; echo; tput cols; echo $a$b", "kj", "80", "kj",
          above="<!-- keys: > k j -->"),
    block("$ sh -c 'echo $$ > pid; echo on; exec sleep 60'", "on", "Killed",
          above="<!-- exit 137 -->\n<!-- keys: on > -->")
    + block("$ kill -9 $(cat pid)", above="<!-- meanwhile -->"),
]  # fmt: skip
FALSE = {
    "wrong printout": (block("$ echo one", "two"), r"line 3: (?s:.*)^-two\n\+one"),
    "a line too few": (block("$ seq 2", "1"), r"line 3: "),
    "a line too many": (block("$ seq 1", "1", "2"), r"line 3: "),
    "wrong exit code": (block("$ exit 1"), r"line 2: \$ exit 1\nexit code 1, not 0"),
    "exit code before the last": (
        block("$ exit 4", "$ exit 4", above="<!-- exit 4 -->"), r"line 3: .*\nexit code 4, not 0"),
    "missing file": (block("$ cat nothing.toml"), r"No such file or directory"),
    "missing picture": ("<!-- picture: a.png -->\n![a](page/a.png)\n", r"no file a\.png was made"),
    "picture that is not kept": (
        block("$ touch a.svg") + "<!-- picture: a.svg -->\n![a](page/a.svg)\n", r"is not there"),
    "Python that raises": (block("1 / 0", language="python"), r"line 2: (?s:.*)ZeroDivisionError"),
    "wrong print": (
        block("print(1)", language="python")
        + block("2", above="<!-- prints -->", language="text"), r"\+1"),
    "text that never appears": (
        block("$ true", above="<!-- keys: never > enter -->"), r"'never' never appeared"),
    "comment above nothing": ("<!-- exit 4 -->\n\n" + block("$ exit 4"), r"directly above"),
}  # fmt: skip


@pytest.mark.parametrize("text", TRUE, ids=range(len(TRUE)))
def test_what_is_true_passes_and_is_not_rewritten(run: Any, text: str, tmp_path: Path) -> None:
    assert run(text) == text
    (tmp_path / "folder").rename(tmp_path / "before")
    assert run(text, rewrite=True) == text


@pytest.mark.parametrize("name", FALSE)
def test_what_is_false_is_told_with_its_line(run: Any, name: str) -> None:
    text, told = FALSE[name]
    with pytest.raises(pages().PageError) as failed:
        run(text)
    assert re.search(told, str(failed.value), re.MULTILINE), failed.value


def test_printouts_and_pictures_are_rewritten(run: Any, tmp_path: Path) -> None:
    draw = block("$ python -c \"import PIL.Image as p; p.new('RGB', (9, 9)).save('a.png')\"")
    draw += "<!-- picture: a.png -->\n![a](page/a.png)\n"
    was = block("$ echo one", "$ echo two", "too") + draw + block("$ seq 2", "1", "2", "3")
    now = block("$ echo one", "one", "$ echo two", "two") + draw + block("$ seq 2", "1", "2")
    assert run(was, rewrite=True) == now
    assert (tmp_path / "page" / "a.png").is_file()


def test_lines_are_those_that_a_terminal_shows() -> None:
    assert pages().shown("a\r\nbad\r\x1b[Kgood\r\n\x1b[1mc\x1b[0m  \r\nab\rc\r\n\r\n") == [
        *("a", "good", "c", "cb")
    ]
    assert pages().shown("bar\r\n\r\x1b[1A\x1b[2Kend\r\n") == ["end"]
