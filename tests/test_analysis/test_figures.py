"""The figures: what they show, that they can be read, and the same bytes on every run."""

from __future__ import annotations

import io
import itertools
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from scipy.special import rel_entr
from scipy.stats import beta, norm

from analysis import ColumnMap, analyse
from analysis.results.figures.figures import FIGURES, Picture, pictures
from tests.test_analysis.shared import PAPER, felt, loaded
from tests.test_analysis.tables import curves_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from analysis import Analysis

PEOPLE = {
    "below": [30] * 5,
    "above": [0] * 5,
    "flat": [15, 14, 16, 15, 16],
    "falls": [28, 22, 15, 8, 3],
    "one step": [0, 0, 30, 30, 30],
    "open": [15, 24, 28, 30, 30],
    "found": [2, 5, 15, 27, 30],
}


@pytest.fixture
def analysed(tmp_path: Path) -> Callable[..., Analysis]:
    """Analyse trials as a table made elsewhere, on an axis of its own."""
    number = itertools.count()

    def analysed(*parts: pd.DataFrame, **columns: Any) -> Analysis:
        trials = pd.concat(parts, ignore_index=True)
        names = ["participant", "condition", "side", "level_vpp", "response"]
        table = trials[[*names, *(["rt_s"] if "rt_s" in trials else [])]]
        folder = tmp_path / f"{next(number)}"
        folder.mkdir()
        return analyse(
            loaded(folder, table.to_csv(index=False, na_rep="n/a"), ColumnMap(**columns))
        )

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
            np.sort(rng.binomial(12, 0.7, len(levels))),
            levels,
            n=12,
            participant=f"{name}{n:02d}",
            condition=condition,
            **same,
        )
        for condition in conditions
        for n in range(people)
    )


def blanks(who: str, answered: int, n: int = 20) -> pd.DataFrame:
    return felt([answered], [60.0], n=n, participant=who, side="none").assign(level_vpp=np.nan)


def drawn(analysis: Analysis, name: str = "detection") -> Figure:
    figure = FIGURES[name](analysis)[0].draw()
    figure.draw_without_rendering()
    return figure


def texts(figure: Figure) -> list[str]:
    shown = (one for one in figure.findobj(Text) if one.get_visible())
    return [text for one in shown if (text := getattr(one, "get_text", str)())]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "ticks", "present", "absent"),
    [
        ({}, [f"{one:g}" for one in PAPER], ["(V)", "95 %"], ["1/2"]),
        ({"levels": (100.0, 101.0, 200.0)}, ["100", "200"], [], ["101"]),
        ({"levels": (60.0, 60.00000000000001)}, ["60"], [], []),
        ({"people": 1}, ["60"], ["Wilson"], []),
        ({"missed": "right"}, ["60"], ["1/2"], []),
        ({"people": 2, "conditions": ("a", "b")}, ["60"], ["a: ", "b against a: "], []),
        ({"people": 20}, ["60"], ["20 participants"], []),
    ],
)
def test_detection_has_levels_unit_and_what_its_signs_mean(
    analysed: Callable[..., Analysis],
    of: Any,
    ticks: list[str],
    present: list[str],
    absent: list[str],
) -> None:
    figure = drawn(analysed(group(**of), axis={"unit": "V"}))
    shown = texts(figure)
    assert [one for one in ticks if shown.count(one) != 1] == []
    assert [one for one in present if one not in " ".join(shown)] == []
    assert [one for one in absent if one in shown] == []


@pytest.mark.slow
def test_who_has_no_number_is_drawn_with_a_bound_and_without_a_function(
    analysed: Callable[..., Analysis],
) -> None:
    parts = [felt(k, participant=name, missed="right") for name, k in PEOPLE.items()]
    analysis = analysed(*parts)
    figure = drawn(analysis, "participants")
    shown = texts(figure)
    assert {*PEOPLE} <= {*shown}
    words = "".join("".join(shown).split())
    printed = analysis.thresholds.set_index("participant")["printed"]
    for name in ("below", "above", "found", "one step"):
        assert "".join(printed[name].split()) in words
    sizes = [float(one.get_fontsize()) for one in figure.findobj(Text) if one.get_text()]
    assert len(sizes) > 40
    assert min(sizes) >= 8  # letters that can be read in print
    for name in PEOPLE:
        curve = curves_of(analysis, name)["main"]
        assert (curve.function is not None) == (name in ("found", "open"))
        assert (curve.residuals is not None) == (name in ("found", "open"))


@pytest.mark.slow
def test_a_function_can_be_drawn_again_from_its_numbers(analysed: Callable[..., Analysis]) -> None:
    for people in (1, 6):
        analysis = analysed(group(people, ("bare", "covered")))
        for condition, curve in curves_of(analysis).items():
            line, at = curve.function.line, curve.function.level_vpp
            rises = norm.cdf(np.log10(at), line.mu, line.sigma)
            expected = line.guess_rate + (1 - line.guess_rate - line.lapse_rate) * rises
            assert curve.function.at(at) == pytest.approx(expected, abs=1e-12)
            assert (np.diff(at) > 0).all()
            assert {*PAPER} <= {*at}
            low, high = curve.function.low, curve.function.high
            assert ((low < expected) & (expected < high)).all()
            rows = analysis.thresholds if people == 1 else analysis.groups
            row = rows[rows["condition"].eq(condition)].iloc[0]
            assert 10**line.mu == pytest.approx(row["threshold_vpp"], rel=1e-9)


@pytest.mark.slow
def test_residuals_of_means_and_of_one_person_are_data_less_function(
    analysed: Callable[..., Analysis],
) -> None:
    parts = [felt([3, 9, 14], n=15, participant=f"S{n}", condition="a") for n in range(3)]
    analysis = analysed(*parts, felt([2, 7, 13], n=15, participant="S0", condition="b"))
    for curve in curves_of(analysis).values():
        expected = curve.p - curve.function.at(curve.level_vpp)
        assert curve.residuals.value == pytest.approx(expected)
    drawn(analysis)
    own = curves_of(analysis, "S0")["b"]
    k, p = 15 * own.p, own.function.at(own.level_vpp)
    deviance = 2 * (rel_entr(k, 15 * p) + rel_entr(15 - k, 15 * (1 - p)))
    assert own.residuals.value**2 == pytest.approx(deviance, rel=1e-9)


@pytest.mark.slow
def test_the_guess_rate_of_blank_trials_stands_at_the_left_edge(
    analysed: Callable[..., Analysis],
) -> None:
    alarms = {"a": 1, "b": 6}
    parts = [felt([0, 0, 4, 4], [60.0, 80.0, 90.0, 110.0], n=4, participant=who) for who in alarms]
    analysis = analysed(*parts, *(blanks(who, k) for who, k in alarms.items()))
    for who, k in alarms.items():
        limits = beta(k + 0.5, 20.5 - k).ppf([0.025, 0.975])
        assert curves_of(analysis, who)["main"].start == pytest.approx([k / 20, *limits])
    (curve,) = curves_of(analysis).values()
    assert curve.start[0] == pytest.approx((1 + 6) / 2 / 20)
    points = [np.ravel(np.asarray(line.get_ydata())) for line in drawn(analysis).axes[0].lines]
    assert curve.start[0] in [float(one[0]) for one in points if len(one) == 1]
    for missed in ("none", "right"):
        without = analysed(group(missed=missed))
        starts = [*curves_of(without).values(), *curves_of(without, "S00").values()]
        assert [one.start for one in starts] == [None, None]


@pytest.mark.slow
def test_pages_have_eight_people_and_of_very_many_those_to_look_at_first(
    analysed: Callable[..., Analysis],
) -> None:
    nine = analysed(*(felt([3, 9, 14], n=15, participant=f"S{n:02d}") for n in range(9)))
    first, second = FIGURES["participants"](nine)
    assert "S00 to S07" in first.alt
    assert (first.title != second.title, "S08" in second.alt) == (True, True)
    names = [f"{n:02d}" for n in range(60)]
    table = pd.DataFrame(
        {"participant": names, "status": "ok", "deviance_p": 0.5, "guess_basis": "forced choice"}
    )
    table.loc[[7, 9], "status"] = "flat", "decreasing"
    table.loc[20:50, "deviance_p"] = np.linspace(0.01, 0.4, 31)
    table.loc[55:, "deviance_p"] = np.nan  # nothing was fitted
    kinds = {
        "21": "guessing",
        "58": "drifting",
        "31": "drifting",
        "08": "guessing",
        "59": "swapped",
    }
    doubts: Any = tuple(SimpleNamespace(kind=kind, participant=who) for who, kind in kinds.items())
    (page,) = FIGURES["participants"](
        replace(nine, participants=table, thresholds=table, doubts=doubts)
    )
    assert "59, 31, 58, 21, 08, 07, 09, 20" in page.alt


@pytest.mark.slow
@pytest.mark.parametrize("name", [r"$\frac{", "参加者", "_", "<b>&", "W" * 62])
def test_any_name_and_the_users_settings_leave_no_warning_and_no_trace(
    analysed: Callable[..., Analysis], name: str
) -> None:
    analysis = analysed(group(2, ("main", name), name=name))
    first = {one.name: (one.png, one.svg) for one in pictures(analysis)}
    assert all(len(file) > 1000 for each in first.values() for file in each)
    with mpl.rc_context({"font.size": 30.0, "axes.facecolor": "red"}):
        again = {one.name: (one.png, one.svg) for one in pictures(analysis)}
        assert mpl.rcParams["font.size"] == 30.0
    assert again == first


@pytest.mark.slow
def test_answers_d_prime_and_times_are_drawn_with_counts_and_units(
    analysed: Callable[..., Analysis],
) -> None:
    parts = [felt([9, 27], [60.0 + n, 95.0 + n], participant=f"{n}") for n in range(2)]
    right = felt([0], n=1, missed="right", side="right")
    trials = pd.concat([*parts, blanks("0", 2), blanks("1", 2), right])
    analysis = analysed(trials.assign(rt_s=0.5))
    shown = " ".join(texts(drawn(analysis, "confusion")))
    assert ("60 %" in shown, "n = 120" in shown) == (True, True)
    assert any("4 of 40" in one for one in texts(drawn(analysis, "d_prime")))
    times = texts(drawn(analysis, "reaction_times"))
    assert any("(s)" in one for one in times)


@pytest.mark.slow
def test_the_same_data_give_the_same_bytes(analysed: Callable[..., Analysis]) -> None:
    parts = [felt([1, 9, 14], n=15, participant=who) for who in "ab"]
    trials = pd.concat([*parts, blanks("a", 1), blanks("b", 2)], ignore_index=True)
    trials.loc[:9:3, ["side", "response"]] = "right"
    trials["rt_s"] = 0.4
    analysis = analysed(trials)
    found: list[Picture] = [*pictures(analysis, pdf=True)]
    assert [one.figure for one in found] == [*FIGURES]
    for one, other in zip(found, pictures(analysis, pdf=True), strict=True):
        assert one == other
        assert one.pdf.startswith(b"%PDF")
        assert b"CreationDate" not in io.BytesIO(one.pdf).getvalue()
        assert all((one.title, one.caption, one.alt))


@pytest.mark.parametrize(
    ("levels", "labels"),
    [
        ((0.01, 0.02, 0.03, 0.045, 0.067, 0.1), 6),
        ((0.0101, 0.0102, 0.0103, 0.0104, 0.0105, 0.0106, 0.0107, 0.0108, 0.0109, 0.011), 5),
    ],
)
def test_levels_have_labels_where_there_is_room_and_always_at_both_ends(
    analysed: Callable[..., Analysis], levels: tuple[float, ...], labels: int
) -> None:
    axes = drawn(analysed(group(levels=levels), axis={"unit": "um"})).axes[0]
    shown = [one for one in axes.get_xticklabels() if one.get_text()]
    ticks = axes.get_xticks().tolist()
    assert (ticks[0], ticks[-1]) == (levels[0], levels[-1])
    assert len(shown) >= labels - 1
    boxes = [one.get_window_extent() for one in shown]
    assert all(a.x1 < b.x0 for a, b in itertools.pairwise(boxes))
