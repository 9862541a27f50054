"""The pages of docs/explanation: their pictures are drawn by scripts, their numbers computed."""

from __future__ import annotations

import csv
import functools
import importlib
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner

from tactstrip import main

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = pytest.mark.gallery

PAGES = Path(__file__).resolve().parents[1] / "docs" / "explanation"
SCRIPTS = sorted(path.stem for path in PAGES.glob("*.py"))
WINDOWS = {"none": "no window", "tukey": "Tukey", "hann": "Hann"}


@pytest.fixture(autouse=True)
def _pages_on_the_path() -> Iterator[None]:
    """As when a script is run: its folder comes first."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(PAGES)
        yield


@functools.cache
def numbers() -> Any:
    return importlib.import_module("energy").numbers()


def page(name: str) -> str:
    return " ".join((PAGES / name).read_text(encoding="utf-8").split())


@pytest.mark.parametrize("name", SCRIPTS)
def test_script_draws_to_the_file_it_is_given(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "figure.png"
    monkeypatch.setattr(sys, "argv", [name, str(path)])
    importlib.import_module(name).main()
    assert path.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out == f"{path}\n"
    assert f"({name}.png)" in page(f"{name.replace('_', '-')}.md")


def decibels(energy: float) -> str:
    return f"{10 * math.log10(energy):.1f} dB"


def row(found: Any) -> str:
    low_hz, high_hz = found.burst.band_hz()
    n = found.burst.cycles
    cells = (
        f"{WINDOWS[found.burst.window]}, {n} cycle{'s' * (n > 1)}",
        f"{low_hz:.0f} to {high_hz:.0f} Hz",
        decibels(found.energy),
        f"{found.level_db:.1f} dB",
        decibels(found.steps_energy),
        f"{found.steps_level_db:.1f} dB",
    )
    return f"| {' | '.join(cells)} |"


def test_the_table_of_bursts_says_what_the_script_computes() -> None:
    lines = (PAGES / "energy.md").read_text(encoding="utf-8").splitlines()
    body = [line for line in lines if line.startswith("|")][2:]
    assert body == [row(found) for found in numbers().rows]


def test_the_text_on_energy_says_what_the_script_computes() -> None:
    found, text = numbers(), page("energy.md")
    paper, higher = found.rows[0], found.higher
    little, much = found.at_losses_db
    for told in (
        f"That band ends at {paper.burst.band_hz()[1]:.0f} Hz",
        f"cut-off of the paper's plate is {found.cutoff_hz:.0f} Hz",
        f"Only {100 * paper.energy:.2g} % of it",
        (
            f"the peak is {-found.motion.whole_db:.1f} dB below that at the own finger, "
            f"without them {-found.motion.below_db:.1f} dB"
        ),
        f"arrives {-found.tone_db:.1f} dB weaker",
        (
            f"1200 Hz has its band below {higher.burst.band_hz()[1]:.0f} Hz, "
            f"{100 * higher.energy:.2g} % of its energy"
        ),
        f"`check` finds {found.higher_db:.1f} dB, the worse of two loss factors, and refuses it",
        (
            f"arrives with {found.endless_db:.1f} dB, on the plate of 200 mm with "
            f"{paper.level_db:.1f} dB"
        ),
        f"the level is {little:.1f} and {much:.1f} dB",
    ):
        assert told in text
    assert higher.energy < 0.01 < min(one.steps_energy for one in found.rows)
    assert found.higher_db > -20
    assert sum(one.steps_level_db > -20 for one in found.rows) == 4
    steps_db = [abs(one.fine_steps_level_db - one.level_db) for one in found.rows]
    assert max(steps_db) < 0.1


def test_the_burst_that_the_page_calls_refused_is_refused_with_that_level(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text("[burst]\nfrequency_hz = 1200\n", encoding="utf-8")
    done = CliRunner().invoke(main, ["check", str(study)])
    assert done.exit_code == 1
    assert f"{numbers().higher_db:.1f} dB at the right finger (loss factor 0.005)" in done.stdout


def test_the_band_and_the_energy_of_a_hann_window_say_the_opposite() -> None:
    bare, hann = (numbers().rows[place] for place in (0, 3))
    assert hann.burst.band_hz()[1] > bare.burst.band_hz()[1]
    assert hann.energy < bare.energy / 100
    assert "Judged by the band, the window makes things worse" in page("energy.md")


def test_the_page_on_intervals_says_what_a_dry_run_prints(tmp_path: Path) -> None:
    done = CliRunner().invoke(main, ["dry-run", "--seed", "7", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.stderr
    results = tmp_path / "out" / "analysis"
    with (results / "thresholds.csv").open(encoding="utf-8", newline="") as file:
        printed = {line["participant"]: line["printed"] for line in csv.DictReader(file)}
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    (group,), level = summary["groups"], summary["levels"][1]
    threshold, spread = group["printed"].split("; between people ")
    middle = threshold.split(" (")[0]
    spread_db, spread_low_high = spread.removesuffix(")").split(" dB (")
    text = page("intervals.md")
    for told in (
        f"| {printed['01']} |",
        f"| {threshold} |",
        f"| {middle} (< 60 to {group['new_high_vpp']:.1f}) |",
        f'participant 03 only "{printed["03"]}"',
        f"detected {level['p_mean']:.3f} of the stimuli at {level['level_vpp']:g} V",
        f"from {level['group_low']:.3f} to {level['group_high']:.3f} for the mean",
        f"threshold was {middle} peak-to-peak (posterior median; 95 % interval below 60 to ",
        f"participants by {spread_db} dB (standard deviation; {spread_low_high} dB)",
        f"people like these: {level['group_low']:.3f} to {level['group_high']:.3f}",
    ):
        assert told in text
    assert printed["04"].startswith("no threshold")
    assert group["new_low_vpp"] is None
