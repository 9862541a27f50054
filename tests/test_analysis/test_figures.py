"""The figures: what they show, that they name their axes, and the same bytes on every run."""

from __future__ import annotations

import html
import itertools
import re
import subprocess
import sys
import warnings
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from scipy.stats import beta, norm

from analysis import level_table
from analysis.answers.choice import confusion_table
from analysis.answers.counting import REACTION_COLUMNS
from analysis.answers.detection import cells, participants_of
from analysis.answers.doubts import Doubt
from analysis.answers.dprime import sensitivity_table
from analysis.axis import VOLTS, Axis
from analysis.groups.tables import difference_table, group_table
from analysis.results.figures.composed import START
from analysis.results.figures.confusion import draw as draw_confusion
from analysis.results.figures.curves import function_table, group_curves, person_curves
from analysis.results.figures.d_prime import sheets as draw_d_prime
from analysis.results.figures.detection import draw, residual_words
from analysis.results.figures.drawing import level_axis, panels, plain, written
from analysis.results.figures.figures import FIGURES
from analysis.results.figures.participants import sheets as draw_participants
from analysis.results.figures.reaction import draw as draw_reaction
from analysis.results.figures.thresholds import draw as draw_thresholds
from analysis.results.tables import Analysis, analyse
from analysis.thresholds.goodness import deviance_residuals
from analysis.thresholds.people import people_of
from analysis.thresholds.probit import deviance
from analysis.thresholds.table import thresholds_of
from tests.test_analysis.shared import LEAST, PAPER, felt, loaded

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.figure import Figure


class Tables:
    """Tables in the place of an analysis, which are, as one is, equal to nothing else."""

    def __init__(self, **tables: object) -> None:
        vars(self).update(tables)


def analysis_of(**tables: object) -> Analysis:
    """Return an analysis that has nothing but these tables."""
    others = {"ci": "wilson", "axis": VOLTS, "mark": "", "one_place": ""}
    return cast("Analysis", Tables(**(others | tables)))


def data(
    people: int = 3,
    conditions: tuple[str, ...] = ("main",),
    levels: Sequence[float] = PAPER,
    *,
    own_levels: bool = False,
    forced_choice: bool = False,
    name: str = "S",
) -> Analysis:
    rng = np.random.default_rng(5)
    trials = pd.concat([
        felt(np.sort(rng.binomial(12, 0.7, len(levels))),
             [x + (n / 8 if own_levels else 0) for x in levels], n=12, missed="right",
             participant=f"{name}{n:02d}", condition=condition)
        for condition in conditions for n in range(people)
    ])  # fmt: skip
    return tabulated(trials.assign(none_offered=not forced_choice))


def tabulated(trials: pd.DataFrame, axis: Axis = VOLTS) -> Analysis:
    """Return an analysis that has what the figures of functions show."""
    people = people_of(trials)
    thresholds = thresholds_of(people, seed=0, axis=axis)
    return analysis_of(
        levels=level_table(trials),
        participants=participants_of(cells(trials)),
        thresholds=thresholds,
        groups=group_table(people, thresholds, axis),
        differences=difference_table(people, axis),
        counts=SimpleNamespace(conditions=trials["condition"].nunique()),
        people=people,
        axis=axis,
    )


def render(shown: Analysis) -> tuple[bytes, bytes]:
    png, svg = written(lambda: draw(shown))
    return png, svg


def texts(shown: Analysis) -> str:
    """Return the SVG; matplotlib writes each text beside its glyphs as a comment."""
    return render(shown)[1].decode()


AXES = ("Level, logarithmic (V peak-to-peak)", "Detection probability", "(detected / presented)")
TICKS = tuple(f"<!-- {level:g} -->" for level in PAPER)
NO_MEAN = "no level was given to everybody"


@pytest.mark.parametrize(
    ("of", "present", "absent"),
    [
        ({}, (*AXES, *TICKS), ("<!-- 100 -->", "guessing")),
        ({"levels": (100.0, 101.0, 200.0)}, ("<!-- 100 -->",), ("<!-- 101 -->",)),
        ({"levels": (60.0,)}, ("<!-- 60 -->",), ()),
        ({"people": 1}, ("95 % interval (Wilson)",), ("mean of participants",)),
        ({"own_levels": True}, (NO_MEAN,), ("95 % interval of the group",)),
        ({"forced_choice": True}, ("guessing: 1/2",), ()),
        ({"people": 2, "conditions": ("a", "b")}, ("b against a: ", "<!-- a: "), ()),
        ({"people": 20}, ("each of 20 participants", "mean of participants"), ()),
    ],
)
@pytest.mark.slow
def test_detection_is_drawn_with_its_words(
    of: dict[str, Any], present: tuple[str, ...], absent: tuple[str, ...]
) -> None:
    svg = texts(data(**of))
    assert [text for text in present if text not in svg] == []
    assert [text for text in absent if text in svg] == []


PEOPLE = {
    "below": [30] * 5,
    "above": [0] * 5,
    "flat": [15, 14, 16, 15, 16],
    "falls": [28, 22, 15, 8, 3],
    "one step": [0, 0, 30, 30, 30],
    "probably below": [20, 24, 29, 30, 30],
    "open": [15, 24, 28, 30, 30],
    "found": [2, 5, 15, 27, 30],
}
GIVEN = [(60 + 10 * i, "left" if i > 2 else "none") for i in range(6)] * 4
TOLD = (
    "< 60 V", "> 200 V", "no threshold: does not rise", "no threshold: falls with",
    "(101.4 to 121.9),", "slope unknown", "at most ", "(< 60 to ", "no threshold",
)  # fmt: skip


@pytest.mark.slow
def test_who_has_no_number_is_drawn_with_a_bound_or_words() -> None:
    shown = tabulated(pd.concat([felt(k, participant=name) for name, k in PEOPLE.items()]))
    (sheet,) = draw_participants(shown)
    svg = html.unescape(written(sheet.draw)[1].decode())
    assert [text for text in (*PEOPLE, *TOLD) if text not in svg] == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("status", "with_function"), [("found", True), ("open", True), ("one step", False),
                                  ("below", False), ("probably below", False), ("flat", False)],
)  # fmt: skip
def test_a_function_is_drawn_only_where_the_table_tells_one(
    status: str, *, with_function: bool
) -> None:
    curve = person_curves(tabulated(felt(PEOPLE[status])), "1")["main"]
    assert (curve.function is not None) == with_function
    assert (curve.residuals is not None) == with_function


@pytest.mark.slow
@pytest.mark.parametrize(
    ("k", "told"), [((3, 9, 22, 28, 30), "none lie"), ((3, 28, 8, 28, 30), "4 lie")]
)
def test_the_caption_counts_the_bars_that_lie_wholly_off_0(k: tuple[int, ...], told: str) -> None:
    shown = tabulated(pd.concat([felt(list(k), participant=name) for name in "abcdefgh"]))
    (curve,) = group_curves(shown).values()
    assert curve.residuals is not None
    low, high = curve.residuals.low, curve.residuals.high
    assert low is not None
    assert high is not None
    off = np.sum((low > 0) | (high < 0))
    assert f"{off or 'none'} lie" == told
    assert f" Of the 5 bars at the foot {told} wholly off 0; " in residual_words(shown)


@pytest.mark.slow
def test_the_function_that_is_drawn_can_be_drawn_again() -> None:
    shown = data(people=6, conditions=("bare", "covered"))
    table = function_table(shown)
    assert [*table["condition"].unique()] == ["bare", "covered"]
    for condition, curve in group_curves(shown).items():
        rows = table[table["condition"].eq(condition)]
        assert {*PAPER} <= {*rows["level_vpp"]}
        assert rows["level_vpp"].is_monotonic_increasing
        assert curve.function is not None
        line = curve.function.line
        rises = norm.cdf(np.log10(rows["level_vpp"]), line.mu, line.sigma)
        felt_at = line.guess_rate + (1 - line.guess_rate - line.lapse_rate) * rises
        assert rows["function"].to_numpy() == pytest.approx(felt_at, abs=1e-12)
        assert (rows["function_low"] < rows["function"]).all()
        assert (rows["function"] < rows["function_high"]).all()


@pytest.mark.slow
def test_no_letter_of_the_panels_of_people_is_too_small_for_print() -> None:
    trials = [
        felt(k, participant=name, condition=condition)
        for name, k in PEOPLE.items()
        for condition in ("bare", "covered")
    ]
    figure = draw_participants(tabulated(pd.concat(trials)))[0].draw()
    figure.draw_without_rendering()
    shown = [one for one in figure.findobj(Text) if one.get_visible() and one.get_text()]
    assert len(shown) > 40
    assert min(float(one.get_fontsize()) for one in shown) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("people", ["a", "ab"])
@pytest.mark.parametrize(
    ("sides", "start"),
    [
        (("left",), "the share of blank trials that were answered as felt, as counted"),
        (("left", "right"), "half of the share of blank trials that were answered left or right"),
    ],
)
def test_the_caption_says_whose_function_it_is_and_where_it_starts(
    people: str, sides: tuple[str, ...], start: str, tmp_path: Path
) -> None:
    rows = [
        f"{who},{side},{level},{side if answer == 'left' else answer}"
        for who in people
        for side in sides
        for level, answer in GIVEN
    ]
    rows += [f"{who},none,,{answer}" for who in people for answer in ("none", "left", "none")]
    analysis = analyse(loaded(tmp_path, LEAST + "\n".join(rows)))
    (sheet,) = FIGURES["detection"](analysis)
    of_group = "may lie above or below the points of single people"
    assert (of_group in sheet.caption) is (len(people) > 1)
    assert f"The filled sign at the left edge is {start}" in sheet.caption
    assert "A function starts at the posterior mean of the guess rate" in sheet.caption


@pytest.mark.slow
def test_the_guess_rate_of_blank_trials_stands_at_the_left_edge(tmp_path: Path) -> None:
    told = {"a": 1, "b": 6}
    rows = [f"{who},left,{level},{answer}" for who in told for level, answer in GIVEN]
    rows += [f"{who},none,,left" for who, number in told.items() for _ in range(number)]
    rows += [f"{who},none,,none" for who, number in told.items() for _ in range(20 - number)]
    analysis = analyse(loaded(tmp_path, LEAST + "\n".join(rows)))
    for who, number in told.items():
        start = person_curves(analysis, who)["main"].start
        assert start == pytest.approx(
            [number / 20, *beta(number + 0.5, 20.5 - number).ppf([0.025, 0.975])]
        )
    (group,) = group_curves(analysis).values()
    assert group.start is not None
    assert group.start[0] == pytest.approx((1 + 6) / 2 / 20)
    drawn = [tuple(np.ravel(line.get_xydata())) for line in draw(analysis).axes[0].lines]
    assert (START, group.start[0]) in drawn
    assert "left edge: mean false-alarm rate, as counted" in texts(analysis)
    (page,) = draw_participants(analysis)
    assert "left edge: false-alarm rate, as counted" in written(page.draw)[1].decode()


@pytest.mark.parametrize("forced_choice", [False, True])
def test_no_guess_rate_is_drawn_where_no_blank_trial_told_it(*, forced_choice: bool) -> None:
    analysis = data(forced_choice=forced_choice)
    assert [one.start for one in group_curves(analysis).values()] == [None]
    assert [one.start for one in person_curves(analysis, "S00").values()] == [None]


@pytest.mark.slow
def test_the_only_person_of_a_condition_has_residuals_on_the_scale_of_the_others_means() -> None:
    trials = [felt([3, 9, 14], n=15, participant=f"S{n}", condition="a") for n in range(3)]
    trials.append(felt([2, 7, 13], n=15, participant="S0", condition="b"))
    analysis = tabulated(pd.concat(trials))
    only = group_curves(analysis)["b"]
    assert only.function is not None
    assert only.residuals is not None
    assert only.residuals.value == pytest.approx(only.p - only.function.at(only.level_vpp))
    render(analysis)


def test_every_page_has_eight_people() -> None:
    few = pd.concat([felt([3, 9, 14], n=15, participant=f"S{n:02d}") for n in range(9)])
    first, second = draw_participants(tabulated(few))
    assert (first.title, second.title) == ("Each participant (1 of 2)", "Each participant (2 of 2)")
    assert "8 participants, S00 to S07" in first.alt


def test_of_very_many_people_one_page_has_those_to_look_at_first() -> None:
    names = [f"{n:02d}" for n in range(60)]
    thresholds = pd.DataFrame({"participant": names, "status": "ok", "deviance_p": 0.5,
                               "guess_basis": "forced choice"})  # fmt: skip
    thresholds.loc[[7, 9], "status"] = "flat", "decreasing"
    thresholds.loc[20:50, "deviance_p"] = np.linspace(0.01, 0.4, 31)
    thresholds.loc[55:, "deviance_p"] = np.nan  # nothing to fit, as of who felt everything
    (page,) = draw_participants(analysis_of(
        participants=thresholds, thresholds=thresholds, doubts=[
            Doubt(kind="guessing", words="", participant="21"),
            Doubt(kind="drifting", words="", participant="58"),
            Doubt(kind="drifting", words="", participant="31"),
            Doubt(kind="guessing", words="", participant="08"),
            Doubt(kind="swapped", words="", participant="59"),
        ],
    ))  # fmt: skip
    assert page.title == "Participants to look at first"
    assert "59, 31, 58, 21, 08, 07, 09, 20, in panels" in page.alt
    assert "The first 8 of 60 are shown" in page.caption
    assert "thresholds.csv and participants.csv" in page.caption


def test_residuals_add_up_to_the_deviance() -> None:
    k, n = np.array([0.0, 7, 22, 30]), np.full(4, 30.0)
    p = np.array([0.02, 0.3, 0.7, 0.97])
    expected = float(deviance(k[None], n[None], p[None], 1 - p[None])[0])
    assert (deviance_residuals(k, n, p) ** 2).sum() == pytest.approx(expected, rel=1e-12)


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
    assert f"<!-- {plain(levels[0])} -->" in texts(data(levels=levels))


@pytest.mark.slow
def test_levels_that_are_nearly_the_same_have_one_tick() -> None:
    assert texts(data(levels=(60.0, 60.00000000000001))).count("<!-- 60 -->") == 1


@pytest.mark.slow
def test_no_warning_is_hidden_but_that_the_font_lacks_a_letter() -> None:
    def draw_warning() -> Figure:
        figure, axes = panels(["main"], [2.0])
        axes[0].set_title("参")
        warnings.warn("something else is amiss", UserWarning, stacklevel=1)
        return figure

    with pytest.warns(UserWarning, match="amiss") as caught:
        written(draw_warning)
    # who imports an old matplotlib first also meets what it uses that is deprecated
    told = [str(one.message) for one in caught if one.category is UserWarning]
    assert told == ["something else is amiss"]


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


NAN = float("nan")
FOUND = ("ok", 90.0, 80.0, 101.0, "")
BELOW = ("threshold_below_levels", NAN, NAN, NAN, "< 60 V")
ABOVE = ("threshold_above_levels", NAN, NAN, NAN, "> 200 V")
SENTENCES = ("below the lowest tested level", "above the highest tested level", "group of 4")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("people", "present", "absent"),
    [
        (
            [FOUND, ("ok", 100.0, NAN, 900.0, "")],
            (
                "Threshold (V peak-to-peak, log.)",
                "threshold, 95 % interval",
                "group of 2",
                "another person's threshold, 95 %",
            ),
            (),
        ),
        ([("separated", 90.0, 80.0, 101.0, "")], ("slope unknown",), ("group of",)),
        ([FOUND, BELOW, BELOW, ABOVE], SENTENCES, ()),
        ([FOUND, ("flat", NAN, NAN, NAN, "")], ("<!-- S01 -->", "none: flat"), ()),
        ([FOUND] * 61, ("61 participants",), ("<!-- S01 -->",)),
        ([FOUND], (), ("group of",)),
    ],
    ids=["interval and unit", "one step", "censored", "none: why", "a crowd", "one person"],
)
def test_thresholds_are_drawn_with_their_words(
    people: list[tuple[Any, ...]], present: tuple[str, ...], absent: tuple[str, ...]
) -> None:
    limits = ("threshold_vpp", "threshold_low_vpp", "threshold_high_vpp")
    news = ("new_low_vpp", "new_high_vpp")
    group = dict(zip(("status", *limits, *news), ("ok", 95.0, NAN, 120.0, NAN, 160), strict=True))
    thresholds = pd.DataFrame(people, columns=["status", *limits, "printed"])
    names = [f"S{number:02d}" for number in range(len(people))]
    thresholds = thresholds.assign(participant=names, condition="main")
    shown = analysis_of(
        thresholds=thresholds,
        groups=pd.DataFrame([group | {"condition": "main", "participants": len(people)}]),
        participants=pd.DataFrame({"level_vpp": PAPER}),
        differences=pd.DataFrame(columns=["participant", "condition_a", "condition_b"]),
    )
    svg = written(lambda: draw_thresholds(shown))[1].decode()
    assert [text for text in present if text not in svg] == []
    assert [text for text in absent if text in svg] == []


@pytest.mark.slow
def test_differences_of_thresholds_are_drawn_below_them() -> None:
    ends = ("difference_db", "low_db", "high_db")
    each = {
        "S1": ("ok", 1.4, -0.3, 3.1),
        "S2": ("at_least", NAN, 0.5, NAN),
        "S3": ("undetermined", NAN, NAN, NAN),
        "all": ("ok", 1.7, 1.1, 2.3),
    }
    rows = [
        dict(zip(("status", *ends), row, strict=True)) | {"participant": name}
        for name, row in each.items()
    ]
    pair = {"condition_a": "bare", "condition_b": "gloved"}
    limits = ("threshold_vpp", "threshold_low_vpp", "threshold_high_vpp")
    found = dict(zip(limits, (95.0, 80.0, 120.0), strict=True)) | {"status": "ok"}
    shown = analysis_of(
        thresholds=pd.DataFrame([
            found | {"participant": name, "condition": condition}
            for condition in pair.values() for name in ("S1", "S2", "S3")
        ]),
        groups=pd.DataFrame([
            found | {"condition": one, "participants": 3, "new_low_vpp": NAN, "new_high_vpp": NAN}
            for one in pair.values()
        ]),
        participants=pd.DataFrame({"level_vpp": PAPER}),
        differences=pd.DataFrame(rows).assign(**pair),
    )  # fmt: skip
    figure = draw_thresholds(shown)
    svg = written(lambda: figure)[1].decode()
    above = "above 0: higher in gloved"
    for text in ("gloved against bare", "Difference of thresholds (dB)", above, "undetermined"):
        assert text in svg
    assert "at least" not in svg  # an arrow instead
    axes = figure.axes[-1]
    least, most = axes.get_xlim()
    assert least < -0.3 < 3.1 < most
    assert axes.get_yticklabels()[-1].get_text() == "group of 3"


def test_each_cell_of_the_answers_has_share_count_and_interval() -> None:
    shown = analysis_of(confusion=confusion_table(felt([15], n=20, missed="both")))
    svg = written(lambda: draw_confusion(shown))[1].decode()
    for text in ("75 %", "53–89 %", "25 %", "n = 20", "Answer (% of the stimulus's trials)"):
        assert f"<!-- {text} -->" in svg
    assert "ignores that participants differ" in svg


@pytest.mark.slow
def test_d_prime_is_drawn_where_nobody_shares_a_level() -> None:
    trials = pd.concat([
        part for n in range(2) for part in (
            felt([9, 27], [60.0 + n, 95.0 + n], participant=str(n)),
            felt([2], [60.0], n=20, participant=str(n), kind="blank", side="none").assign(
                level_vpp=NAN),
        )
    ])  # fmt: skip
    shown = analysis_of(
        sensitivity=sensitivity_table(trials), levels=level_table(trials),
        counts=SimpleNamespace(conditions=1),
    )  # fmt: skip
    (sheet,) = draw_d_prime(shown)
    assert "mean of participants, false alarms 4 of 40" in written(sheet.draw)[1].decode()


def test_reaction_times_are_of_each_side_in_seconds() -> None:
    rows = [("main", v, side, 9, 0.5, 0.4, 0.8) for v in PAPER for side in ("left", "right")]
    rows.append(("main", 220.0, "left", 0, NAN, NAN, NAN))
    shown = analysis_of(reaction_times=pd.DataFrame(rows, columns=list(REACTION_COLUMNS)))
    svg = written(lambda: draw_reaction(shown))[1].decode()
    assert "Reaction time of correct answers (s)" in svg
    assert re.search(r"left: median, 10–90 % of \d+(?: to \d+)? answers a level", svg)
    assert "right: median" in svg
    assert "finger" not in svg
    assert "<!-- 220 -->" not in svg


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_the_same_data_give_the_same_bytes(name: str, tmp_path: Path) -> None:
    answers = ["left", "none", "left", "right", "left", "left"]
    rows = [
        f"{who},left,{60 + 10 * i},{answer},0.{i + 2}"
        for who in ("a", "b") for i, answer in enumerate(answers)
    ]  # fmt: skip
    rows += [f"{who},none,,{answer},0.5" for who in ("a", "b") for answer in ("none", "left")]
    text = f"{LEAST[:-1]},rt_s\n" + "\n".join(rows)
    analysis = analyse(loaded(tmp_path, text))
    (sheet,) = FIGURES[name](analysis)
    assert written(sheet.draw, pdf=True) == written(sheet.draw, pdf=True)
    *_, page = written(sheet.draw, pdf=True)
    assert page.startswith(b"%PDF")
    assert b"CreationDate" not in page
    assert sheet.title
    assert sheet.caption.endswith(".")
    assert "table" in sheet.alt


@pytest.mark.parametrize(
    ("levels", "told"),
    [
        ((0.01, 0.02, 0.03, 0.045, 0.067, 0.1), 6),
        ((0.0101, 0.0102, 0.0103, 0.0104, 0.0105, 0.0106, 0.0107, 0.0108, 0.0109, 0.011), 5),
    ],
)
def test_levels_have_labels_where_there_is_room_and_always_at_both_ends(
    levels: tuple[float, ...], told: int
) -> None:
    figure, (axes,) = panels([""], [4.0], "")
    level_axis(axes, levels, Axis(unit="um"))
    ticks = axes.get_xticks().tolist()
    assert (ticks[0], ticks[-1]) == (levels[0], levels[-1])
    assert len(ticks) >= told
    figure.canvas.draw()
    boxes = [one.get_window_extent() for one in axes.get_xticklabels()]
    assert all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))
