"""The figures: what they show, that they name their axes, and the same bytes on every run."""

from __future__ import annotations

import subprocess
import sys
import warnings
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pandas as pd
import pytest

from analysis import level_table
from analysis.answers.choice import confusion_table
from analysis.answers.counting import REACTION_COLUMNS
from analysis.answers.detection import cells, participants_of
from analysis.axis import VOLTS
from analysis.reading.columns import ColumnMap
from analysis.reading.load import read_inputs
from analysis.results.figures.confusion import draw as draw_confusion
from analysis.results.figures.detection import draw
from analysis.results.figures.drawing import panels, written
from analysis.results.figures.figures import FIGURES
from analysis.results.figures.reaction import draw as draw_reaction
from analysis.results.figures.thresholds import draw as draw_thresholds
from analysis.results.tables import Analysis, analyse
from analysis.thresholds.table import group_table

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

LEVELS_VPP = (60.0, 95.0, 130.0, 165.0, 200.0)


def analysis_of(**tables: object) -> Analysis:
    """Return an analysis that has nothing but these tables."""
    others = {"ci": "wilson", "axis": VOLTS, "simulated": ""}
    return cast("Analysis", SimpleNamespace(**others, **tables))


def data(
    people: int = 3,
    conditions: tuple[str, ...] = ("main",),
    levels: tuple[float, ...] = LEVELS_VPP,
    *,
    own_levels: bool = False,
    forced_choice: bool = False,
    name: str = "S",
) -> Analysis:
    rng = np.random.default_rng(5)
    rows = [
        (f"{name}{person:02d}", condition, level + (person / 8 if own_levels else 0), answer)
        for condition in conditions
        for person in range(people)
        for level in levels
        for answer in rng.choice(["left", "right"], 12, p=[0.7, 0.3])
    ]
    columns = ["participant", "condition", "level_vpp", "response"]
    trials = pd.DataFrame(rows, columns=columns).assign(kind="single", side="left", reason="")
    return analysis_of(
        levels=level_table(trials),
        participants=participants_of(cells(trials)),
        detected_any=None if forced_choice else trials,
    )


def render(shown: Analysis) -> tuple[bytes, bytes]:
    return written(lambda: draw(shown))


def texts(shown: Analysis) -> str:
    """Return the SVG; matplotlib writes each text beside its glyphs as a comment."""
    return render(shown)[1].decode()


def test_both_axes_are_named_with_their_units() -> None:
    svg = texts(data())
    assert "Level, logarithmic (V peak-to-peak)" in svg
    assert "Detection probability" in svg
    assert "(detected / presented)" in svg


def test_the_ticks_are_the_levels() -> None:
    svg = texts(data())
    for level in LEVELS_VPP:
        assert f"<!-- {level:g} -->" in svg
    assert "<!-- 100 -->" not in svg


def test_ticks_that_would_cover_each_other_are_left_out() -> None:
    svg = texts(data(levels=(100.0, 101.0, 200.0)))
    assert "<!-- 100 -->" in svg
    assert "<!-- 101 -->" not in svg


@pytest.mark.slow
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


@pytest.mark.slow
def test_guessing_is_marked_only_in_a_forced_choice() -> None:
    assert "guessing left or right: 1/2" in texts(data(forced_choice=True))
    assert "guessing" not in texts(data())


def test_conditions_have_a_panel_each() -> None:
    svg = texts(data(2, ("bare", "covered")))
    assert all(f"condition {name}" in svg for name in ("bare", "covered"))


def test_one_level_is_drawn() -> None:
    assert "<!-- 60 -->" in texts(data(levels=(60.0,)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["$\frac{", "参加者", "_", "<b>&", "W" * 64, "参" * 64])
@pytest.mark.parametrize("people", [2, 6])
def test_any_name_can_be_drawn_without_a_warning(name: str, people: int) -> None:
    assert all(len(file) > 1000 for file in render(data(people, ("main", name), name=name)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "levels", [(60.0, 60.00000000000001), (60.0, 60.001), (1e-6, 1e6), (1e-6,), (1e6,)]
)
def test_any_levels_can_be_drawn_without_a_warning(levels: tuple[float, ...]) -> None:
    assert f"<!-- {levels[0]:g} -->" in texts(data(levels=levels))


def test_levels_that_are_nearly_the_same_have_one_tick() -> None:
    assert texts(data(levels=(60.0, 60.00000000000001))).count("<!-- 60 -->") == 1


def test_no_warning_is_hidden_but_that_the_font_lacks_a_letter() -> None:
    def draw_warning() -> Figure:
        figure, axes = panels(["main"], [2.0])
        axes[0].set_title("参")
        warnings.warn("something else is amiss", UserWarning, stacklevel=1)
        return figure

    with pytest.warns(UserWarning, match="amiss") as caught:
        written(draw_warning)
    assert [str(one.message) for one in caught] == ["something else is amiss"]


@pytest.mark.slow
def test_settings_of_the_user_neither_show_nor_change() -> None:
    import matplotlib as mpl

    plain = texts(data())
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        assert texts(data()) == plain
        assert mpl.rcParams["font.size"] == 30.0


@pytest.mark.process
def test_importing_the_module_does_not_import_matplotlib() -> None:
    code = (
        "import sys, analysis.results.figures.figures, analysis.results.figures.drawing; "
        "sys.exit('matplotlib' in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def people(*rows: tuple[str, float, float, float], condition: str = "main") -> pd.DataFrame:
    """Return thresholds: status, threshold and limits of each participant."""
    volts = {"threshold_below_levels": "< 60 V", "threshold_above_levels": "> 200 V"}
    columns = ["status", "threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"]
    return pd.DataFrame(rows, columns=columns).assign(
        participant=[f"S{number:02d}" for number in range(len(rows))],
        condition=condition,
        printed=[volts.get(row[0], "") for row in rows],
    )


def threshold_texts(thresholds: pd.DataFrame) -> str:
    shown = analysis_of(
        thresholds=thresholds,
        groups=group_table(thresholds),
        participants=pd.DataFrame({"level_vpp": LEVELS_VPP}),
    )
    return written(lambda: draw_thresholds(shown))[1].decode()


NAN = float("nan")
FOUND = ("ok", 90.0, 80.0, 101.0)
BELOW = ("threshold_below_levels", NAN, NAN, NAN)


def test_a_threshold_has_its_interval_and_its_unit() -> None:
    svg = threshold_texts(people(FOUND, ("ok", 100.0, 20.0, 900.0)))
    assert "Threshold (V peak-to-peak, log.)" in svg
    assert "threshold, 95 % interval" in svg
    assert "mean of 2" in svg


def test_a_censored_threshold_is_an_arrow_and_forbids_a_mean() -> None:
    svg = threshold_texts(people(FOUND, BELOW, BELOW, ("threshold_above_levels", NAN, NAN, NAN)))
    assert "below the lowest tested level" in svg
    assert "above the highest tested level" in svg
    assert "median of 4" in svg
    assert "mean of" not in svg


def test_who_has_no_threshold_is_named_with_the_reason() -> None:
    svg = threshold_texts(people(FOUND, ("flat", NAN, NAN, NAN)))
    assert "<!-- S01 -->" in svg
    assert "none: flat" in svg


def test_a_crowd_is_ordered_and_not_named() -> None:
    svg = threshold_texts(people(*[FOUND] * 61))
    assert "<!-- S01 -->" not in svg
    assert "61 participants" in svg


def test_a_figure_of_censored_thresholds_alone_is_drawn() -> None:
    assert "median of 2" in threshold_texts(people(BELOW, BELOW))


def test_each_cell_of_the_answers_has_share_count_and_interval() -> None:
    trials = pd.DataFrame({
        "condition": "main", "kind": "single", "side": "left", "reason": "",
        "response": ["left"] * 15 + ["both"] * 5,
    })  # fmt: skip
    shown = analysis_of(confusion=confusion_table(trials))
    svg = written(lambda: draw_confusion(shown))[1].decode()
    for text in ("75 %", "53–89 %", "25 %", "n = 20", "Answer (% of the stimulus's trials)"):
        assert f"<!-- {text} -->" in svg
    assert "ignores that participants differ" in svg


def test_reaction_times_are_of_each_side_in_seconds() -> None:
    rows = [("main", v, side, 9, 0.5, 0.4, 0.8) for v in LEVELS_VPP for side in ("left", "right")]
    rows.append(("main", 220.0, "left", 0, NAN, NAN, NAN))
    shown = analysis_of(reaction_times=pd.DataFrame(rows, columns=list(REACTION_COLUMNS)))
    svg = written(lambda: draw_reaction(shown))[1].decode()
    assert "Reaction time of correct answers (s)" in svg
    assert "left finger: median, 10–90 % of answers" in svg
    assert "right finger" in svg
    assert "<!-- 220 -->" not in svg


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_the_same_data_give_the_same_bytes(name: str, tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    answers = ["left", "none", "left", "right", "left", "left"]
    rows = [f"a,left,{60 + 10 * i},{answer},0.{i + 2}" for i, answer in enumerate(answers)]
    table.write_text("participant,side,level_vpp,response,rt_s\n" + "\n".join(rows), "utf-8")
    analysis = analyse(read_inputs([table], ColumnMap()))
    alt, drawn = FIGURES[name]
    assert written(lambda: drawn(analysis)) == written(lambda: drawn(analysis))
    assert "the" in alt(analysis)
    assert "table" in alt(analysis)
