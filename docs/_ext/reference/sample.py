"""Small studies of several kinds, checked, simulated, planned: what the reference is read from."""

from __future__ import annotations

import shutil
import subprocess
import sys
import textwrap
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from reference.marked import alter, practise

PLATE = (
    *("--preset", "plate", "--width-mm", "30", "--thickness-mm", "0.5", "--length-mm", "150"),
    *("--material", "steel", "--edge", "clamped", "--actuator", "disc:12.8@35"),
    *("--ceiling-vpp", "113"),
)
"""A plate of one's own, as the README has it."""
_EXAMPLES = Path(__file__).parents[2] / "examples"
_ELSEWHERE = {
    "jspsych": (_EXAMPLES / "jspsych-trials.csv", _EXAMPLES / "jspsych-columns.toml"),
    "synthetic": (_EXAMPLES / "synthetic-trials.csv", _EXAMPLES / "synthetic-columns.toml"),
    "one-place": ("one-place-trials.csv", "one-place-columns.toml"),
    "no-blanks": ("one-place-trials.csv", "no-blanks-columns.toml"),
    "counts": ("counts-trials.csv", "counts-columns.toml"),
}
"""Tables made elsewhere, with their maps: in per cent, in volts, of one place in micrometres with
and without blanks, and of counts."""
STUDIES = Path(__file__).parent / "studies"
"""Studies that have what those of `tactstrip init` have not."""
_CONDITIONS = """
[[condition]]
name = "one-cycle"
cycles = 1
[[condition]]
name = "two-cycles"
cycles = 2
"""
_FIELDS = {"map": (), "band": ("--band", "100", "1000")}


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """What the commands wrote and printed.

    `results` is the folder of the plate of one's own, which the example is of; `printed` its
    commands, each with what it prints. `elsewhere` has the analyses of tables made elsewhere,
    `marked` one of sessions of several sorts; `fields` are CSVs in micrometres, and per unit load,
    by what they are of.
    """

    results: Path
    printed: tuple[tuple[str, str], ...]
    field: Path
    elsewhere: Path
    marked: Path
    fields: dict[str, tuple[Path, Path]]

    @property
    def analysis(self) -> Path:
        """The folder of the analysis."""
        return self.results / "analysis"


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
    """Make a study of a plate of one's own, draw its field, simulate five people, analyse them.

    Other studies are run beside it, for what that one does not have.
    """
    shutil.copytree(STUDIES, folder, dirs_exist_ok=True)
    printed = [_done(folder, "init", "plate.toml", *PLATE)]
    path = folder / "plate.toml"
    text = path.read_text(encoding="utf-8")
    text = text.replace(
        "\n[design]\n", "\n[design]\nhands_off_trials_before = 10\nhands_off_trials_after = 10\n"
    )
    path.write_text(f"{text}{_CONDITIONS}", encoding="utf-8")
    _done(folder, "init", "paper.toml")
    with ThreadPoolExecutor() as beside:
        others = beside.submit(_simulate_and_analyze, folder)
        printed.append(_done(folder, "check", "plate.toml"))
        printed.append(_done(folder, "field", "plate.toml", "--out", "field.png"))
        printed.append(_simulated(folder, "plate", people=5, out="results"))
        alone = ("--allow-simulated", "--no-figures", "--out", "alone")
        _done(folder, "analyze", "results/sub-01", *alone)
        others.result()
    return Sample(
        results=folder / "results",
        printed=tuple(printed),
        field=folder / "field.png",
        elsewhere=folder / "elsewhere",
        marked=folder / "marked-analysis",
        fields={
            what: (folder / f"paper-{what}.csv", folder / f"plate-{what}.csv") for what in _FIELDS
        },
    )


def _simulate_and_analyze(folder: Path) -> None:
    """Simulate, analyse and draw what the example does not have."""
    _simulated(folder, "layered", people=3, out="layered")
    _simulated(folder, "paper", people=2, out="paper")
    _done(folder, "analyze", "layered", "--allow-simulated", "--out", "population")
    for name, (table, columns) in _ELSEWHERE.items():
        out = ("--out", f"elsewhere/{name}", "--no-figures")
        _done(folder, "analyze", str(table), "--columns", str(columns), *out)
    for what, options in _FIELDS.items():
        for name in ("paper", "plate"):
            _done(folder, "field", f"{name}.toml", *options, "--out", f"{name}-{what}.csv")
    _marked(folder)


def _simulated(folder: Path, name: str, *, people: int, out: str) -> tuple[str, str]:
    drawn = ("--participants", str(people), "--seed", "7", "--out", out)
    return _done(folder, "dry-run", f"{name}.toml", *drawn)


def _marked(folder: Path) -> None:
    """Analyse sessions of simulated people, one of them altered, and of somebody who practised."""
    _simulated(folder, "marked", people=2, out="marked")
    practise(folder / "marked.toml", folder / "marked", "03")
    alter(folder / "marked" / "sub-02" / "ses-01" / "trials.csv")
    accepted = ("--allow-simulated", "--accept-altered", "--no-figures")
    _done(folder, "analyze", "marked", *accepted, "--out", "marked-analysis")


def _done(folder: Path, *arguments: str) -> tuple[str, str]:
    """Run a command that has to succeed; return it with what it prints."""
    words = textwrap.wrap(" ".join(("tactstrip", *arguments)), 74, break_on_hyphens=False)
    command, done = " \\\n    ".join(words), tactstrip(folder, *arguments)
    if done.returncode:
        raise RuntimeError(f"{command}: {done.stderr}")
    return command, done.stdout
