"""The detection figure: what it shows, that it names its axes, and the same bytes on every run."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from analysis import level_table
from analysis.detection import participant_table
from analysis.figures import DetectionData, render

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


def texts(shown: DetectionData) -> str:
    """Return the SVG; matplotlib writes each text beside its glyphs as a comment."""
    return render(shown)[1].decode()


def test_the_same_data_give_the_same_bytes() -> None:
    assert render(data()) == render(data())


def test_both_axes_are_named_with_their_units() -> None:
    svg = texts(data())
    assert "Level, logarithmic (V peak-to-peak)" in svg
    assert "Detection probability (detected / presented)" in svg


def test_the_ticks_are_the_levels() -> None:
    svg = texts(data())
    for level in LEVELS_VPP:
        assert f"<!-- {level:g} -->" in svg
    assert "<!-- 100 -->" not in svg


def test_ticks_that_would_cover_each_other_are_left_out() -> None:
    svg = texts(data(levels=(100.0, 101.0, 200.0)))
    assert "<!-- 100 -->" in svg
    assert "<!-- 101 -->" not in svg


def test_few_participants_are_named_and_many_are_not() -> None:
    assert "participant S05" in texts(data(6))
    crowd = texts(data(20))
    assert "participant S05" not in crowd
    assert "each of 20 participants" in crowd
    assert "mean of participants" in crowd


def test_one_participant_has_the_intervals_of_the_cells_and_no_mean() -> None:
    svg = texts(data(1))
    assert "95 % interval (Wilson)" in svg
    assert "mean of participants" not in svg


def test_no_mean_is_drawn_over_different_people() -> None:
    svg = texts(data(3, own_levels=True))
    assert "no level was given to everybody" in svg
    assert "95 % interval of the group" not in svg


def test_guessing_is_marked_only_in_a_forced_choice() -> None:
    assert "guessing left or right: 1/2" in texts(data(forced_choice=True))
    assert "guessing" not in texts(data())


def test_conditions_have_a_panel_each() -> None:
    svg = texts(data(2, ("bare", "covered", "x", "y")))
    assert all(f"condition {name}" in svg for name in ("bare", "covered", "x", "y"))


def test_one_level_is_drawn() -> None:
    assert "<!-- 60 -->" in texts(data(levels=(60.0,)))


@pytest.mark.parametrize("name", ["$\frac{", "参加者", "_", "<b>&", "W" * 64, "参" * 64])
@pytest.mark.parametrize("people", [2, 6])
def test_any_name_can_be_drawn_without_a_warning(name: str, people: int) -> None:
    assert all(len(file) > 1000 for file in render(data(people, ("main", name), name=name)))


@pytest.mark.parametrize(
    "levels", [(60.0, 60.00000000000001), (60.0, 60.001), (1e-6, 1e6), (1e-6,), (1e6,)]
)
def test_any_levels_can_be_drawn_without_a_warning(levels: tuple[float, ...]) -> None:
    assert f"<!-- {levels[0]:g} -->" in texts(data(levels=levels))


def test_levels_that_are_nearly_the_same_have_one_tick() -> None:
    assert texts(data(levels=(60.0, 60.00000000000001))).count("<!-- 60 -->") == 1


def test_settings_of_the_user_neither_show_nor_change() -> None:
    import matplotlib as mpl

    plain = texts(data())
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        assert texts(data()) == plain
        assert mpl.rcParams["font.size"] == 30.0


def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = "import sys, analysis.figures; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
