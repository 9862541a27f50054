"""The pages: their commands run and print what they show, and their links lead somewhere."""

from __future__ import annotations

import functools
import importlib
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote

import pytest

from tests.system.attended import PageError
from tests.system.pages import Page

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tests.conftest import Run

pytest.importorskip("termios", reason="pages are run by bash, on pseudo-terminals")

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
ENTRY = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
PAGES = sorted(
    path
    for folder in ("", "benchmarks", "explanation", "howto")
    for path in (DOCS / folder).glob("*.md")
)
RUN = [
    page
    for page in PAGES
    if page.parent.name == "howto" or page.stem in {"plate", "power", "tutorial"}
]


@pytest.fixture(autouse=True)
def _scripts_on_the_path() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(DOCS / "explanation")
        yield


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def shell_lines(page: Path) -> Iterator[list[str]]:
    """The words of each line in the shell blocks of a page."""
    for block in re.findall(r"(?ms)^```sh\n(.*?)^```", page.read_text("utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            yield shlex.split(line.rpartition("&& .venv/bin/")[2], comments=True)


# Links


@functools.cache
def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings)
    return set(plain)


@pytest.mark.parametrize("page", [*ENTRY, *PAGES], ids=name_of)
def test_every_link_of_a_page_leads_to_a_file_and_a_heading(page: Path) -> None:
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text("utf-8").replace("\n", " ")):
        path, _, anchor = unquote(target).partition("#")
        file = (page.parent / path).resolve() if path else page
        headed = not anchor or file.suffix != ".md" or anchor in anchors(file)
        # the site's own test follows the links into what a build makes
        is_picture = file.suffix == ".png" and file.parent == DOCS / "explanation"
        is_generated = file.is_relative_to(DOCS / "reference") or is_picture
        if ":" not in path and not is_generated and not (file.exists() and headed):
            dead.append(target)
    assert dead == []


# Equations


def test_equations_that_the_code_cites_are_on_the_page_of_the_model() -> None:
    text = (DOCS / "model.md").read_text("utf-8")
    numbers = [int(number) for number in re.findall(r"\\tag\{(\d+)\}", text)]
    assert numbers == [*range(1, len(numbers) + 1)]
    assert [
        path
        for path in re.findall(r"`((?:stimuli|experiment)/[^`]*)`", text)
        if not (ROOT / path).exists()
    ] == []
    cited = {
        int(number)
        for package in ("stimuli", "experiment", "analysis", "device")
        for path in (ROOT / package).rglob("*.py")
        for group in re.findall(
            r"[Ee]quations?((?:(?:,| and| to)?\s+\(\d+\))+)", path.read_text("utf-8")
        )
        for number in re.findall(r"\d+", group)
    }
    assert cited
    assert cited <= {*numbers}


# Commands


@pytest.mark.parametrize("page", [*ENTRY, *PAGES], ids=name_of)
def test_every_command_of_a_page_has_its_options(page: Path, run: Run) -> None:
    for program, *words in filter(None, shell_lines(page)):
        if Path(program).name == "tactstrip" and words:
            options = {word.partition("=")[0] for word in words if word.startswith("--")}
            known = {*re.findall(r"--[a-z-]+", run(words[0], "--help").output)}
            assert options <= known, words


def test_the_commands_of_the_readme_run(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, printed = ENTRY[0].read_text("utf-8"), ""
    shutil.copytree(DOCS / "examples", tmp_path / "docs" / "examples")
    monkeypatch.chdir(tmp_path)
    for program, *words in filter(None, shell_lines(ENTRY[0])):
        if program in {"cp", "mkdir"}:
            subprocess.run([program, *words], check=True)
        if program != "tactstrip":
            continue
        result = run(*words)
        assert result.exit_code == 0, (words, result.output)
        printed += result.stdout
    for block in re.findall(r"(?ms)^```text\n(.*?)^```", text):
        assert [line for line in block.splitlines() if line != "..." and line not in printed] == []


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_the_commands_of_a_page_print_what_it_shows(page: Path, tmp_path: Path) -> None:
    if "fuser" in page.read_text("utf-8") and shutil.which("fuser") is None:
        pytest.skip("fuser (psmisc) is missing")
    Page(page, tmp_path).run()


def test_a_picture_of_an_explanation_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "figure.png"
    monkeypatch.setattr(sys, "argv", ["exactly_once", str(path)])
    importlib.import_module("exactly_once").main()
    assert path.read_bytes().startswith(b"\x89PNG")


# The runner of pages


def block(*lines: str, above: str = "", language: str = "console") -> str:
    return "\n".join([*([above] if above else []), f"```{language}", *lines, "```", ""])


TRUE = [
    block("$ echo one; echo two >&2", "one", "two", "$ echo three", "three"),
    block("$ seq 9", "1", "...", "8", "9", "$ echo took 0.3 s", "took ... s"),
    block("$ true", "$ echo no; exit 4", "no", above="<!-- exit 4 -->"),
    block("a = 1", above="<!-- file: in/a.toml -->", language="toml")
    + block("$ cat in/*", "a = 1"),
    block("a = 1", language="python")
    + block("print(a)\nprint()", language="python")
    + block("1", above="<!-- prints -->", language="text"),
    block("$ read -n 1 a; echo; tput cols; echo $a", "k", "80", "k", above="<!-- keys: > k -->"),
]
FALSE = {
    "printout": (block("$ echo one", "two"), 3),
    "a line too few": (block("$ seq 2", "1"), 3),
    "exit code": (block("$ exit 1"), 2),
    "exit code before the last": (block("$ exit 4", "$ exit 4", above="<!-- exit 4 -->"), 3),
    "picture": ("<!-- picture: a.png -->\n![a](page/a.png)\n", 1),
    "Python that raises": (block("1 / 0", language="python"), 2),
    "comment above nothing": ("<!-- exit 4 -->\n\n" + block("$ exit 4"), 2),
}


@pytest.fixture
def rewritten(tmp_path: Path) -> Callable[..., str]:
    """Run a page of this text; return it as it is then."""

    def run_text(text: str, *, rewrite: bool = False) -> str:
        page, folder = tmp_path / "page.md", tmp_path / f"folder-{rewrite}"
        page.write_text(text, encoding="utf-8")
        folder.mkdir()
        Page(page, folder, rewrite=rewrite).run()
        return page.read_text(encoding="utf-8")

    return run_text


@pytest.mark.parametrize("text", TRUE, ids=range(len(TRUE)))
def test_a_true_page_passes_and_is_not_rewritten(rewritten: Callable[..., str], text: str) -> None:
    assert rewritten(text) == rewritten(text, rewrite=True) == text


@pytest.mark.parametrize("name", FALSE)
def test_a_false_page_fails_at_its_line(rewritten: Callable[..., str], name: str) -> None:
    text, line = FALSE[name]
    with pytest.raises(PageError, match=f"line {line}: "):
        rewritten(text)


def test_printouts_are_rewritten(rewritten: Callable[..., str]) -> None:
    before = block("$ echo one", "$ echo two", "too") + block("$ seq 2", "1", "2", "3")
    after = block("$ echo one", "one", "$ echo two", "two") + block("$ seq 2", "1", "2")
    assert rewritten(before, rewrite=True) == after
