"""The figures: they draw the numbers of the tables, can be read, and are the same on every run."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from scipy.special import rel_entr
from scipy.stats import norm

from analysis import ColumnMap, Style, analyse, plot_detection, plot_thresholds
from analysis.results.figures.axes import alike_labels, round_ticks
from analysis.results.figures.curves import by_threshold, residual_table
from analysis.results.figures.detection import PEOPLE_PER_PAGE, pages_of
from analysis.results.figures.figures import FIGURES, NAMES, drawings, pictures
from analysis.results.figures.reaction_times import MIN_ANSWERS
from analysis.results.findings import estimates
from tests.test_analysis.shared import PAPER, felt, loaded
from tests.test_analysis.tables import curves_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from analysis import Analysis

    Analysed = Callable[..., Analysis]

PEOPLE = {
    "below": [30] * 5,
    "above": [0] * 5,
    "flat": [15, 14, 16, 15, 16],
    "falls": [28, 22, 15, 8, 3],
    "one step": [0, 0, 30, 30, 30],
    "open": [15, 24, 28, 30, 30],
    "rises": [2, 5, 15, 27, 30],
}


@pytest.fixture
def analysed(tmp_path: Path) -> Analysed:
    """Analyse trials as an external table."""
    number = itertools.count()

    def analysed(*tables: pd.DataFrame, **columns: Any) -> Analysis:
        trials = pd.concat(tables, ignore_index=True)
        names = ["participant", "condition", "side", "level_vpp", "response"]
        table = trials[[*names, *(["rt_s"] if "rt_s" in trials else [])]]
        folder = tmp_path / f"{next(number)}"
        folder.mkdir()
        text = table.to_csv(index=False, na_rep="n/a")
        return analyse(loaded(folder, text, ColumnMap(**columns)))

    return analysed


def group(
    people: int = 3,
    conditions: Sequence[str] = ("main",),
    levels: Sequence[float] = PAPER,
    name: str = "S",
    **same: Any,
) -> pd.DataFrame:
    rng = np.random.default_rng(5)
    return pd.concat(
        felt(
            rng.binomial(12, np.linspace(0.1, 0.95, len(levels))),
            levels,
            n=12,
            participant=f"{name}{n:02d}",
            condition=condition,
            **same,
        )
        for condition in conditions
        for n in range(people)
    )


def blanks(participant: str, answered: int, n: int = 20, **same: Any) -> pd.DataFrame:
    rows = felt([answered], [60.0], n=n, participant=participant, side="none", **same)
    return rows.assign(level_vpp=np.nan)


def everything(conditions: Sequence[str] = ("main",), people: int = 3, **same: Any) -> pd.DataFrame:
    """Return trials of which all figures are drawn."""
    left, right = (group(people, conditions, side=side, **same) for side in ("left", "right"))
    rows = [left, right.replace({"response": {"left": "right"}})]
    rows += [
        blanks(f"{same.get('name', 'S')}{n:02d}", n + 1, condition=condition)
        for n in range(people)
        for condition in conditions
    ]
    return pd.concat(rows).assign(rt_s=np.tile([0.4, 0.5, 0.7], 10_000)[: sum(map(len, rows))])


def drawn(analysis: Analysis, name: str, style: Style | None = None) -> Figure:
    style = style or Style()
    drawing = next(each for each in drawings(analysis) if each.name == name)
    with style.applied():
        figure = drawing.draw(style=style)
        figure.canvas.draw()
    return figure


def texts(figure: Figure) -> list[Any]:
    shown = (text for text in figure.findobj(Text) if text.get_visible())
    return [text for text in shown if getattr(text, "get_text", str)().strip()]


def points(figure: Figure) -> set[float]:
    """Return the heights of all drawn points."""
    axes = figure.axes[0]
    heights = [np.asarray(line.get_ydata(), dtype=float).ravel() for line in axes.lines]
    heights += [np.asarray(each.get_offsets())[:, 1] for each in axes.collections]
    return {round(float(height), 9) for height in np.concatenate(heights)}


FIVE = ("bare", "thin glove", "thick glove", "a mitten of wool", "a ring")
SHAPES: dict[str, Callable[[], pd.DataFrame]] = {
    "one person": lambda: everything(people=1),
    "five people": lambda: everything(people=5),
    "two conditions": lambda: everything(("one cycle", "three cycles"), 12),
    "five conditions": lambda: everything(FIVE),
    "one stimulus": lambda: group(missed="right"),
    "long numbers": lambda: everything(("bare", "covered"), 5, levels=[60.05, 95, 130, 165, 200.5]),
    "long names": lambda: everything(("W" * 62, "M" * 62), 2, name="W" * 40),
}


def covers(text: Any, figure: Figure) -> bool:
    """Return whether a text covers a point."""
    box = text.get_window_extent()
    lines = [line for axes in figure.axes for line in axes.lines if line.get_marker() != "None"]
    at = np.concatenate([line.get_transform().transform(line.get_xydata()) for line in lines])
    x, y = at.T
    return bool(((x > box.x0) & (x < box.x1) & (y > box.y0) & (y < box.y1)).any())


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("width_mm", [85, 170])
def test_every_letter_is_inside_the_figure_and_covers_no_text_and_no_point(
    analysed: Analysed, shape: str, width_mm: float
) -> None:
    analysis = analysed(SHAPES[shape]())
    for drawing in drawings(analysis):
        figure = drawn(analysis, drawing.name, Style(width_mm=width_mm))
        canvas = figure.bbox
        boxes = [(text.get_text(), text.get_window_extent()) for text in texts(figure)]
        shown = [(name, box) for name, box in boxes if box.width > 0]
        outside = [
            name
            for name, box in shown
            if box.x0 < -1 or box.y0 < -1 or box.x1 > canvas.width + 1 or box.y1 > canvas.height + 1
        ]
        assert (drawing.name, outside) == (drawing.name, [])
        overlapping = [
            (a, b)
            for (a, first), (b, second) in itertools.combinations(shown, 2)
            if min(first.x1, second.x1) - max(first.x0, second.x0) > 1
            and min(first.y1, second.y1) - max(first.y0, second.y0) > 1
        ]
        assert (drawing.name, overlapping) == (drawing.name, [])
        if drawing.name != "confusion":
            over_points = [text.get_text() for text in texts(figure) if covers(text, figure)]
            assert (drawing.name, over_points) == (drawing.name, [])
        assert min(text.get_fontsize() for text in texts(figure)) >= 6.9
        legends = [axes.get_legend() for axes in figure.axes] + figure.legends
        assert all(len(each.get_texts()) <= 3 for each in legends if each is not None)
        assert figure.get_figwidth() * 25.4 == pytest.approx(width_mm)


@pytest.mark.slow
@pytest.mark.parametrize("width_mm", [85, 170])
def test_panels_have_the_same_size_and_a_tick_for_each_level_on_every_page(
    analysed: Analysed, width_mm: float
) -> None:
    analysis = analysed(group(25))
    style = Style(width_mm=width_mm)
    pages = [drawn(analysis, f"participants{page}", style) for page in ("", "-2", "-3")]
    assert [len(page.axes) for page in pages] == [12, 12, 1]
    panels = [(axes, page.get_size_inches()) for page in pages for axes in page.axes]
    sizes = {tuple(np.round(axes.get_position().size * inches, 9)) for axes, inches in panels}
    assert len(sizes) == 1
    for axes, _ in panels:
        assert axes.get_xticks() == pytest.approx(PAPER)
    for page in pages:
        corners = [axes.get_position().corners()[0].round(9) for axes in page.axes]
        lowest = {x: min(y for left, y in corners if left == x) for x, _ in corners}
        for axes, (x, y) in zip(page.axes, corners, strict=True):
            has_labels = any(label.get_visible() for label in axes.get_xticklabels())
            assert has_labels == (y == lowest[x])


@pytest.mark.slow
def test_captions_have_at_most_three_sentences_and_all_files_are_named(analysed: Analysed) -> None:
    for shape in SHAPES.values():
        for picture in drawings(analysed(shape())):
            assert 1 <= len(re.findall(r"[.](?= |$)", picture.caption)) <= 3
            assert picture.title
            assert picture.alt
            assert {f"{picture.name}.{ending}" for ending in ("png", "svg", "pdf")} <= {*NAMES}


@pytest.mark.slow
def test_detection_draws_the_numbers_of_the_tables_and_no_interval_but_the_band(
    analysed: Analysed,
) -> None:
    analysis = analysed(everything(("bare", "covered")))
    figure = drawn(analysis, "detection")
    numbers = [*analysis.levels["p_mean"], *analysis.participants["p"]]
    numbers += [guess.share_of_blanks for guess in analysis.people.guesses]
    assert {round(float(number), 9) for number in numbers} <= points(figure)
    from matplotlib.collections import LineCollection

    assert not [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
    legend = figure.axes[0].get_legend()
    assert legend is not None
    entries = [text.get_text() for text in legend.get_texts()]
    assert entries == [f"{row['condition']}: {row['short']}" for row in estimates(analysis)]


@pytest.mark.slow
def test_a_function_can_be_drawn_again_from_its_numbers(analysed: Analysed) -> None:
    for people in (1, 6):
        analysis = analysed(group(people, ("bare", "covered")))
        for condition, curve in curves_of(analysis).items():
            line, at = curve.function.line, curve.function.level_vpp
            rises = norm.cdf(np.log10(at), line.mu, line.sigma)
            expected = line.guess_rate + (1 - line.guess_rate - line.lapse_rate) * rises
            assert curve.function.at(at) == pytest.approx(expected, abs=1e-12)
            low, high = curve.function.low, curve.function.high
            assert ((low < expected) & (expected < high)).all()
            rows = analysis.thresholds if people == 1 else analysis.groups
            row = rows[rows["condition"].eq(condition)].iloc[0]
            assert 10**line.mu == pytest.approx(row["threshold_vpp"], rel=1e-9)


@pytest.mark.slow
def test_residuals_are_signed_roots_of_what_proportions_add_to_the_deviance(
    analysed: Analysed,
) -> None:
    analysis = analysed(*(felt([3, 9, 14], n=15, participant=f"S{n}") for n in range(2)))
    for name, rows in residual_table(analysis).groupby("participant"):
        curve = curves_of(analysis, str(name))["main"]
        k, p = 15 * curve.p, curve.function.at(curve.level_vpp)
        deviance = 2 * (rel_entr(k, 15 * p) + rel_entr(15 - k, 15 * (1 - p)))
        assert rows["residual"].to_numpy() ** 2 == pytest.approx(deviance, rel=1e-6)
        assert (np.sign(rows["residual"]) == np.sign(curve.p - p)).all()


@pytest.mark.slow
def test_who_has_no_threshold_has_no_function_and_stands_with_a_bound(analysed: Analysed) -> None:
    tables = [felt(k, participant=name, missed="right") for name, k in PEOPLE.items()]
    analysis = analysed(*tables)
    for name in PEOPLE:
        has_function = curves_of(analysis, name)["main"].function is not None
        assert has_function == (name in ("rises", "open"))
    names = by_threshold(analysis)
    assert {*names} == {*PEOPLE}
    assert names.index("below") < names.index("rises") < names.index("above")
    labels = [text.get_text() for text in drawn(analysis, "thresholds").axes[0].get_yticklabels()]
    assert labels[:-1] == names
    titles = [axes.get_title(loc="left") for axes in drawn(analysis, "participants").axes]
    assert titles[: len(names)] == names


@pytest.mark.slow
def test_pages_hold_everybody_once_and_of_very_many_the_doubtful(analysed: Analysed) -> None:
    analysis = analysed(*(felt([3, 9, 14], n=15, participant=f"S{n:02d}") for n in range(14)))
    pages = pages_of(analysis)
    assert [len(page) for page in pages] == [PEOPLE_PER_PAGE, 2]
    assert sorted(itertools.chain(*pages)) == sorted(analysis.thresholds["participant"])
    many = analysed(
        *(felt([3, 9, 14], n=15, participant=f"S{n:02d}") for n in range(48)),
        felt([14, 9, 3], n=15, participant="falls"),
    )
    (page,) = pages_of(many)
    assert len(page) == PEOPLE_PER_PAGE
    assert "falls" in page


@pytest.mark.slow
@pytest.mark.parametrize("name", [r"$\frac{", "参加者", "_", "<b>&"])
def test_any_name_and_the_users_settings_leave_no_warning_and_no_trace(
    analysed: Analysed, name: str
) -> None:
    analysis = analysed(group(2, ("main", name), name=name))
    first = {each.name: each.files for each in pictures(analysis)}
    assert all(len(file) > 1000 for files in first.values() for file in files.values())
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        again = {each.name: each.files for each in pictures(analysis)}
        assert mpl.rcParams["font.size"] == 30.0
    assert again == first


@pytest.mark.slow
def test_the_same_data_give_the_same_bytes_of_every_figure(analysed: Analysed) -> None:
    analysis = analysed(everything())
    first = [*pictures(analysis, Style(pdf=True))]
    assert [each.figure for each in first] == [name for name in FIGURES if name != "tracks"]
    assert first == [*pictures(analysis, Style(pdf=True))]
    pdfs = [each.files["pdf"] for each in first]
    assert all(pdf.startswith(b"%PDF") and b"CreationDate" not in pdf for pdf in pdfs)


@pytest.mark.slow
def test_style_sheets_and_axes_of_the_caller_are_used(analysed: Analysed, tmp_path: Path) -> None:
    analysis = analysed(group(2, ("a", "b")))
    sheet = tmp_path / "journal.mplstyle"
    sheet.write_text("font.size: 12\n")
    large = plot_detection(analysis, style=Style(style=sheet))
    assert large.axes[0].yaxis.label.get_fontsize() == 12
    for plot in (plot_detection, plot_thresholds):
        figure = Figure()
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2)
        assert plot(analysis, left) is figure
        assert not right.lines
        figure.canvas.draw()


@pytest.mark.slow
def test_confusion_and_times_leave_out_what_nobody_did(analysed: Analysed) -> None:
    trials = everything()
    analysis = analysed(trials)
    shown = [text.get_text() for text in drawn(analysis, "confusion").axes[0].get_xticklabels()]
    assert shown == [name for name in shown if analysis.confusion[name].any()]
    counts = " ".join(
        text.get_text() for text in drawn(analysis, "confusion").axes[0].texts
    ).split()
    assert {str(n) for n in analysis.confusion[shown].to_numpy().ravel()} <= {*counts}
    table = analysis.reaction_times
    medians = {round(float(each), 9) for each in table.loc[table["n"].ge(MIN_ANSWERS), "median"]}
    assert medians <= points(drawn(analysis, "reaction_times"))


def test_few_trials_have_no_figure(analysed: Analysed) -> None:
    assert [*drawings(analysed(felt([1, 2], n=3)))] == []


@pytest.mark.parametrize("seed", range(20))
def test_ticks_are_round_few_and_within_the_axis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    low = 10 ** rng.uniform(-4, 4)
    high = low * 10 ** rng.uniform(0.05, 3)
    for log in (True, False):
        ticks = round_ticks(low, high, log=log)
        assert 1 <= len(ticks) <= 7
        assert ((ticks >= low * (1 - 1e-9)) & (ticks <= high * (1 + 1e-9))).all()
        assert len({len(label.partition(".")[2]) for label in alike_labels(ticks)}) == 1
