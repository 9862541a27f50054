"""The detection figure: what it shows, that it names its axes, and the same bytes on every run."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from analysis import level_table
from analysis.detection import participant_table
from analysis.figures import NAMES, DetectionData, write_figures

if TYPE_CHECKING:
    from pathlib import Path

LEVELS_VPP = (60.0, 95.0, 130.0, 165.0, 200.0)


def data(
    people: int = 3,
    conditions: tuple[str, ...] = ("main",),
    levels: tuple[float, ...] = LEVELS_VPP,
    *,
    own_levels: bool = False,
    forced_choice: bool = False,
    name: str = "S",
) -> DetectionData:
    rng = np.random.default_rng(5)
    rows = [
        (f"{name}{person:02d}", condition, level + (person / 8 if own_levels else 0), answer)
        for condition in conditions
        for person in range(people)
        for level in levels
        for answer in rng.choice(["left", "right"], 12, p=[0.7, 0.3])
    ]
    columns = ["participant", "condition", "level_vpp", "response"]
    trials = pd.DataFrame(rows, columns=columns).assign(
        kind="single", side="left", status="ok", anticipated=False, noise_ok=True
    )
    return DetectionData(
        levels=level_table(trials),
        participants=participant_table(trials),
        forced_choice=forced_choice,
        ci="wilson",
    )


def texts(shown: DetectionData, folder: Path) -> str:
    """Return the SVG; matplotlib writes each text beside its glyphs as a comment."""
    write_figures(shown, folder)
    return (folder / "detection.svg").read_text(encoding="utf-8")


def test_the_same_data_give_the_same_bytes(tmp_path: Path) -> None:
    written = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_figures(data(), tmp_path / name)
        written.append([(tmp_path / name / file).read_bytes() for file in NAMES])
    assert written[0] == written[1]


def test_both_axes_are_named_with_their_units(tmp_path: Path) -> None:
    svg = texts(data(), tmp_path)
    assert "Level, logarithmic (V peak-to-peak)" in svg
    assert "Detection probability (detected / presented)" in svg


def test_the_ticks_are_the_levels(tmp_path: Path) -> None:
    svg = texts(data(), tmp_path)
    for level in LEVELS_VPP:
        assert f"<!-- {level:g} -->" in svg
    assert "<!-- 100 -->" not in svg


def test_ticks_that_would_cover_each_other_are_left_out(tmp_path: Path) -> None:
    svg = texts(data(levels=(100.0, 101.0, 200.0)), tmp_path)
    assert "<!-- 100 -->" in svg
    assert "<!-- 101 -->" not in svg


def test_few_participants_are_named_and_many_are_not(tmp_path: Path) -> None:
    assert "participant S05" in texts(data(6), tmp_path)
    crowd = texts(data(20), tmp_path)
    assert "participant S05" not in crowd
    assert "each of 20 participants" in crowd
    assert "mean of participants" in crowd


def test_one_participant_has_the_intervals_of_the_cells_and_no_mean(tmp_path: Path) -> None:
    svg = texts(data(1), tmp_path)
    assert "95 % interval (Wilson)" in svg
    assert "mean of participants" not in svg


def test_no_mean_is_drawn_over_different_people(tmp_path: Path) -> None:
    svg = texts(data(3, own_levels=True), tmp_path)
    assert "no level was given to everybody" in svg
    assert "95 % interval of the group" not in svg


def test_guessing_is_marked_only_in_a_forced_choice(tmp_path: Path) -> None:
    assert "guessing left or right: 1/2" in texts(data(forced_choice=True), tmp_path)
    assert "guessing" not in texts(data(), tmp_path)


def test_conditions_have_a_panel_each(tmp_path: Path) -> None:
    svg = texts(data(2, ("bare", "covered", "x", "y")), tmp_path)
    assert all(f"condition {name}" in svg for name in ("bare", "covered", "x", "y"))


def test_one_level_is_drawn(tmp_path: Path) -> None:
    assert "<!-- 60 -->" in texts(data(levels=(60.0,)), tmp_path)


@pytest.mark.parametrize("name", ["$\\frac{", "参加者", "_", "<b>&"])
def test_any_name_can_be_drawn(tmp_path: Path, name: str) -> None:
    write_figures(data(2, name=name), tmp_path)
    assert all((tmp_path / file).stat().st_size > 1000 for file in NAMES)


def test_settings_of_the_user_neither_show_nor_change(tmp_path: Path) -> None:
    import matplotlib as mpl

    plain = texts(data(), tmp_path)
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        assert texts(data(), tmp_path) == plain
        assert mpl.rcParams["font.size"] == 30.0


def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = "import sys, analysis.figures; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
