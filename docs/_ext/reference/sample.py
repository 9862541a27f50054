"""A small study of two conditions, simulated and analysed: what the reference takes shapes from."""

from __future__ import annotations

import json
import subprocess
import sys
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Any

PLATE = (
    *("--preset", "plate", "--width-mm", "30", "--thickness-mm", "0.5", "--length-mm", "150"),
    *("--material", "steel", "--edge", "clamped", "--actuator", "disc:12.8@35"),
    *("--ceiling-vpp", "113"),
)
"""A plate of one's own, as the README has it."""
_TABLE = Path(__file__).parents[2] / "examples" / "paper-table1.csv"
CONDITIONS = ("one-cycle", "two-cycles", "main")
_CONDITIONS = """
[[condition]]
name = "one-cycle"
cycles = 1
[[condition]]
name = "two-cycles"
cycles = 2
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What the commands wrote and printed."""

    results: Path
    checks: tuple[Any, ...]
    bursts: Any
    audit: Any
    printed: tuple[tuple[str, str], ...]
    field: Path

    @property
    def session(self) -> Path:
        """The folder of one session."""
        return self.results / "sub-01" / "ses-01"

    @property
    def analysis(self) -> Path:
        """The folder of the analysis."""
        return self.results / "analysis"

    def journal(self) -> list[dict[str, Any]]:
        """Return the lines of the session's journal."""
        text = (self.session / "journal.jsonl").read_text(encoding="utf-8")
        return [json.loads(line) for line in text.splitlines()]


def tactstrip(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, as somebody would."""
    return subprocess.run(
        [sys.executable, "-m", "tactstrip", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def make_sample(folder: Path) -> Sample:
    """Make a study of a plate of one's own, draw its field, simulate five people, analyse them."""
    printed = [_done(folder, "init", "plate.toml", *PLATE)]
    path = folder / "plate.toml"
    text = path.read_text(encoding="utf-8")
    for key in ("audibility_trials", "control_trials"):
        text = text.replace(f"\n{key} = 0", f"\n{key} = 10")
    head, init, rest = text.partition("[init]")
    path.write_text(f"{head}{init}{rest}{_CONDITIONS}", encoding="utf-8")
    _done(folder, "init", "paper.toml")
    checks = [tactstrip(folder, "check", one, "--json") for one in ("plate.toml", "paper.toml")]
    few = ("--frequency-hz", "250,500", "--cycles", "1,2", "--json")
    printed.append(_done(folder, "check", "plate.toml"))
    printed.append(_done(folder, "field", "plate.toml", "--out", "field.png"))
    people = ("--participants", "5", "--seed", "7", "--out", "results")
    printed.append(_done(folder, "dry-run", "plate.toml", *people))
    return Sample(
        results=folder / "results",
        checks=tuple(json.loads(one.stdout) for one in checks),
        bursts=json.loads(tactstrip(folder, "bursts", "plate.toml", *few).stdout),
        audit=json.loads(tactstrip(folder, "audit", str(_TABLE), "--json").stdout),
        printed=tuple(printed),
        field=folder / "field.png",
    )


def _done(folder: Path, *arguments: str) -> tuple[str, str]:
    """Run a command that has to succeed; return it with what it prints."""
    words = textwrap.wrap(" ".join(("tactstrip", *arguments)), 74, break_on_hyphens=False)
    command, done = " \\\n    ".join(words), tactstrip(folder, *arguments)
    if done.returncode:
        raise RuntimeError(f"{command}: {done.stderr}")
    return command, done.stdout
