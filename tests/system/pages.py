r"""Run what a page of docs/ shows, and compare or rewrite what it prints.

``python -m tests.system.pages docs/tutorial.md`` runs a page and rewrites printouts and pictures;
tests/system/test_docs.py runs them all and compares. A page lives in one empty folder, with
tactstrip on the PATH, 80 columns and no colour. In it

- a ``console`` block is run: a line ``$ command`` by a bash of its own (a ``\`` at its end goes on
  in the next line), and the lines up to the next ``$`` are what it prints, on stdout and stderr.
  A line ``...`` stands for any lines, ``...`` in a line for any characters; a printout that
  matches is never rewritten. Each exit code has to be 0;
- a ``python`` block is run, all of a page in one namespace.

Comments directly above a block, a line each, ask for something else:

- ``<!-- exit 4 -->``: the exit code of the block's last command;
- ``<!-- file: study.toml -->``: the block, of any language, is not run: it becomes that file;
- ``<!-- prints -->``: a ``text`` block is what the last ``python`` block before it prints;
- ``<!-- keys: goes on > enter enter; ? > left right; ? > -->``: the block's one command is run on a
  terminal; whenever the text before ``>`` appears anew, the next key after it is pressed, 0.3 s
  later. A text without a key is only waited for. A key is one of KEYS or a letter;
- ``<!-- meanwhile -->``: the block is run when the keys of the block before it are all pressed, and
  before that ends: what somebody does in a second terminal.

And anywhere, in a line of its own,

- ``<!-- copy: docs/examples/paper-table1.csv -->``: that file of the repository is copied;
- ``<!-- picture: results/field.png -->`` directly above ``![text](tutorial/field.png)``: the page's
  picture is that file of the folder.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final

from tests.system.attended import PageError, Terminal, shown

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT: Final = Path(__file__).resolve().parents[2]
MOST_PIXELS: Final = 8
"""By which a picture may be larger or smaller, with other letters in it."""
MOST_DIFFERENT: Final = 2.0
"""Of 255, on average over a quarter of the pixels each way."""
_NOTE: Final = re.compile(r"<!-- (exit|file|prints|keys|meanwhile|copy|picture):? ?(.*?) ?-->")
_FENCE: Final = re.compile(r"```(\w*)")
_PICTURE: Final = re.compile(r"!\[.*\]\((.+?)\)")
_INTERPRETER: Final = """
import contextlib, io, json, sys, traceback
names = {"__name__": "__main__"}
for line in sys.stdin:
    out, error = io.StringIO(), ""
    with contextlib.redirect_stdout(out):
        try:
            exec(compile(json.loads(line), "the page", "exec"), names)
        except BaseException:
            error = traceback.format_exc()
    print(json.dumps([out.getvalue(), error]), flush=True)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """What stands between two fences, or a comment on its own; lines counted from 0."""

    language: str
    notes: dict[str, str]
    first: int
    lines: list[str]


@dataclass(slots=True, kw_only=True)
class Command:
    """A command of a console block, and what it prints."""

    text: str
    printed: list[str]


def blocks_of(lines: list[str]) -> Iterator[Block]:
    """Yield the blocks of a page, and the comments that are steps by themselves."""
    notes: dict[str, str] = {}
    at = 0
    while at < len(lines):
        if fence := _FENCE.match(lines[at]):
            end = lines.index("```", at + 1)
            yield Block(language=fence[1], notes=notes, first=at + 1, lines=lines[at + 1 : end])
            at, notes = end, {}
        elif note := _NOTE.fullmatch(lines[at]):
            if note[1] in {"copy", "picture"}:
                yield Block(language="", notes={note[1]: note[2]}, first=at, lines=[])
            else:
                notes = {**notes, note[1]: note[2]}
        elif notes:
            raise PageError(f"line {at + 1}: a comment belongs directly above a block")
        at += 1


def commands_of(lines: list[str]) -> list[Command]:
    """Return the commands of a console block."""
    found: list[Command] = []
    for line in lines:
        if line.startswith("$ "):
            found.append(Command(text=line[2:], printed=[]))
        elif found and found[-1].text.endswith("\\") and not found[-1].printed:
            found[-1].text += "\n" + line
        elif found:
            found[-1].printed.append(line)
        else:
            raise PageError(f"no command prints {line!r}: the first line begins with '$ '")
    return found


def matches(expected: list[str], printed: list[str]) -> bool:
    """Tell whether lines are those expected, ``...`` standing for anything."""
    wanted = "".join(
        "(?:[^\n]*\n)*?"
        if line.strip() == "..."
        else ".*".join(re.escape(part) for part in line.rstrip().split("...")) + "\n"
        for line in expected
    )
    return re.fullmatch(wanted, "".join(f"{line}\n" for line in printed)) is not None


class Page:
    """A Markdown page that is run in an empty folder.

    With ``rewrite`` what is printed and drawn is then what the page shows.
    """

    def __init__(self, path: Path, folder: Path, *, rewrite: bool = False) -> None:
        self._path, self._folder, self._rewrite = path, folder, rewrite
        self._lines = path.read_text(encoding="utf-8").split("\n")
        self._environment = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("PYTHON", "TACTSTRIP", "COV_"))
        } | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "LC_ALL": "C.UTF-8",
            "COLUMNS": "80",
            "NO_COLOR": "1",
            "MPLBACKEND": "Agg",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self._python: subprocess.Popen[str] | None = None
        self._told_by_python: list[str] = []
        self._new: dict[int, tuple[int, list[str]]] = {}

    def run(self) -> None:
        """Run all of it; rewrite the page if that was asked for."""
        blocks = list(blocks_of(self._lines))
        try:
            for block, after in zip(blocks, [*blocks[1:], None], strict=False):
                if "meanwhile" not in block.notes:
                    meanwhile = after if after and "meanwhile" in after.notes else None
                    self._step(block, meanwhile)
        finally:
            if self._python is not None:
                self._python.kill()
                self._python.communicate()
        for first, (count, lines) in sorted(self._new.items(), reverse=True):
            self._lines[first : first + count] = lines
        if self._rewrite:
            self._path.write_text("\n".join(self._lines), encoding="utf-8")

    def _step(self, block: Block, meanwhile: Block | None) -> None:
        notes = block.notes
        if "copy" in notes:
            shutil.copy(ROOT / notes["copy"], self._folder)
        elif "picture" in notes:
            self._see(block, notes["picture"])
        elif "file" in notes:
            path = self._folder / notes["file"]
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("".join(f"{line}\n" for line in block.lines), encoding="utf-8")
        elif "prints" in notes:
            self._compare(block, block.first, block.lines, self._told_by_python)
        elif block.language == "python":
            self._interpret(block)
        elif block.language == "console":
            self._command(block, meanwhile)

    def _command(self, block: Block, meanwhile: Block | None) -> None:
        commands, at = commands_of(block.lines), block.first
        for command in commands:
            if "keys" in block.notes:
                raw, code = self._attend(command.text, block.notes["keys"], meanwhile)
            else:
                done = subprocess.run(
                    ["bash", "-c", command.text],
                    cwd=self._folder,
                    env=self._environment,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.STDOUT,
                    text=True,
                    check=False,
                )
                raw, code = done.stdout, done.returncode
            wanted = int(block.notes.get("exit", 0)) if command is commands[-1] else 0
            if code != wanted:
                self._fail(at, f"$ {command.text}\nexit code {code}, not {wanted}:\n{raw}")
            at += command.text.count("\n") + 1
            self._compare(block, at, command.printed, shown(raw) if raw.strip() else [])
            at += len(command.printed)

    def _attend(self, command: str, keys: str, meanwhile: Block | None) -> tuple[str, int]:
        terminal = Terminal(command, self._folder, self._environment)
        try:
            terminal.press(keys)
            if meanwhile is not None:
                self._command(meanwhile, None)
            return terminal.ended()
        finally:
            terminal.close()

    def _interpret(self, block: Block) -> None:
        if self._python is None:
            self._python = subprocess.Popen(
                [sys.executable, "-c", _INTERPRETER],
                cwd=self._folder,
                env=self._environment,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
        print(json.dumps("\n".join(block.lines)), file=_pipe(self._python.stdin), flush=True)
        told, error = json.loads(_pipe(self._python.stdout).readline())
        if error:
            self._fail(block.first, error)
        self._told_by_python = shown(told) if told.strip() else []

    def _see(self, block: Block, name: str) -> None:
        link = _PICTURE.match(self._lines[block.first + 1])
        made = self._folder / name
        if link is None or not made.is_file():
            self._fail(block.first, f"no picture below the comment, or no file {name} was made")
            return
        kept = self._path.parent / link[1]
        if kept.is_file() and alike(kept, made):
            return
        if not self._rewrite:
            self._fail(block.first, f"{link[1]} is not there, or not the picture {name}")
        kept.parent.mkdir(exist_ok=True)
        keep(made, kept)

    def _compare(self, block: Block, at: int, expected: list[str], printed: list[str]) -> None:
        if matches(expected, printed):
            return
        if not self._rewrite:
            difference = difflib.unified_diff(expected, printed, "page", "printed", lineterm="")
            self._fail(at, "\n".join(difference))
        self._new[at] = (len(expected), printed)

    def _fail(self, line: int, what: str) -> None:
        raise PageError(f"{self._path.name}, line {line + 1}: {what}")


def alike(kept: Path, made: Path) -> bool:
    """Tell whether two pictures show the same, whatever drew their letters and colours."""
    from PIL import Image, ImageChops, ImageStat

    if kept.suffix != ".png":
        return kept.suffix == made.suffix
    with Image.open(kept) as a, Image.open(made) as b:
        if max(abs(one - other) for one, other in zip(a.size, b.size, strict=True)) > MOST_PIXELS:
            return False
        small = (a.width // 4, a.height // 4)
        difference = ImageChops.difference(*(x.convert("RGB").resize(small) for x in (a, b)))
        return max(ImageStat.Stat(difference).mean) < MOST_DIFFERENT


def keep(made: Path, kept: Path) -> None:
    """Copy a picture, of few colours if it is a PNG."""
    from PIL import Image

    if kept.suffix != ".png":
        shutil.copy(made, kept)
        return
    with Image.open(made) as picture:
        picture.convert("RGB").quantize(128).save(kept, optimize=True)


def _pipe(pipe: IO[str] | None) -> IO[str]:
    if pipe is None:
        raise RuntimeError("no pipe was asked for")
    return pipe


if __name__ == "__main__":
    for page in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as place:
            try:
                Page(Path(page), Path(place), rewrite=True).run()
            except PageError as error:
                sys.exit(str(error))
