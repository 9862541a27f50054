"""Thresholds of participants and groups: guess rates, printed words, censoring, invariances."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis import GuessRate, fit_psychometric, threshold_table
from analysis.axis import Axis, with_limits
from analysis.thresholds.people import BLANKS_NEEDED, guessing
from analysis.thresholds.table import THRESHOLD_COLUMNS, WORDS, printed
from tests.test_analysis.shared import PAPER, SINGLE, felt

GOOD = [2, 14, 22, 28, 29]
MIRROR = {"left": "right", "right": "left"}
VALUES = ("threshold_low_", "threshold_", "threshold_high_")


def person(name: str, detected: list[int], **same: Any) -> pd.DataFrame:
    return felt(detected, participant=name, **({"missed": "right"} | same))


def table_of(*people: pd.DataFrame, seed: int = 1, **options: Any) -> pd.DataFrame:
    return threshold_table(pd.concat(people), seed=seed, **options)


def blanks(name: str, answers: list[str]) -> pd.DataFrame:
    same = SINGLE | {"participant": name, "kind": "blank", "side": "none", "level_vpp": math.nan}
    return pd.DataFrame([same | {"response": answer} for answer in answers])


@pytest.mark.slow
def test_the_table_says_what_the_fit_says() -> None:
    row = table_of(person("1", GOOD)).iloc[0]
    fit = fit_psychometric(PAPER, GOOD, [30] * 5, guess_rate=GuessRate(mean=1 / 11, beta=(1, 10)))
    assert tuple(row.index) == THRESHOLD_COLUMNS
    assert row["status"] == "ok"
    low, high = fit.threshold_limits
    limits = [row[f"{name}vpp"] for name in VALUES]
    assert limits == pytest.approx([low, fit.threshold, high])
    decibel = [row[f"{name}db"] for name in VALUES]
    assert decibel == pytest.approx([20 * math.log10(volts) for volts in limits])
    assert row["printed"] == "{1:.1f} V ({0:.1f} to {2:.1f})".format(*limits)
    assert (row["levels"], row["trials"]) == (5, 150)
    assert 0 < row["deviance_p"] <= 1


def test_taking_another_guess_rate_moves_the_threshold_up_with_it() -> None:
    row = table_of(person("1", [12, 17, 22, 29, 29], none_offered=False)).iloc[0]
    assert (row["guess_rate"], row["guess_basis"]) == (0.5, "forced choice")
    assert row["threshold_guess_0_vpp"] < row["threshold_guess_third_vpp"] < row["threshold_vpp"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("detected", "words"),
    [
        ([15] * 5, WORDS["flat"]),
        ([29, 24, 15, 6, 1], WORDS["decreasing"]),
        ([11], WORDS["one_level"]),
    ],
)
def test_without_a_threshold_words_say_so_and_no_number(detected: list[int], words: str) -> None:
    row = table_of(person("1", detected)).iloc[0]
    assert row["printed"] == words
    numbers = [name for name in THRESHOLD_COLUMNS if name.startswith(("threshold_", "mle_"))]
    kept = [name for name in numbers if "guess" not in name]
    assert row[[*kept, "sigma", "deviance", "deviance_p"]].isna().all()


@pytest.mark.parametrize(
    ("detected", "words"),
    [
        ([30] * 5, "< 60 V"),
        ([25, 28, 30, 30, 30], "at most 68.2 V (95 %)"),
        ([0] * 5, "> 200 V"),
        ([0, 0, 0, 30, 30], "147.7 V (137.3 to 158.1), slope unknown"),
    ],
)
def test_limits_outside_the_levels_are_open(detected: list[int], words: str) -> None:
    row = table_of(person("1", detected, none_offered=False)).iloc[0]
    assert row["printed"] == words


def test_only_levels_that_were_presented_bound_a_threshold() -> None:
    placed = person("2", [30, 30, 30])
    found = table_of(person("1", GOOD), placed[placed["level_vpp"] > 60])
    assert found["printed"].iloc[1] == "< 95 V"


def test_a_guess_rate_needs_blanks_and_the_answer_none() -> None:
    assert guessing(none_offered=False, sided_answers=30, blanks=60).rate.mean == 0.5
    few = guessing(none_offered=True, sided_answers=4.5, blanks=BLANKS_NEEDED - 1)
    assert (few.rate.beta, few.basis) == ((5.0, 15.0), "few blanks")
    assert guessing(none_offered=True, sided_answers=0, blanks=0).basis == "assumed"
    enough = guessing(none_offered=True, sided_answers=4.5, blanks=BLANKS_NEEDED)
    assert enough.rate.beta == (0.5 + 4.5, 0.5 + 20 - 4.5)


@pytest.mark.slow
def test_blanks_tell_the_guess_rate_of_their_participant_only() -> None:
    answers = ["left"] * 5 + ["right"] * 3 + ["both"] * 2 + ["none"] * 30
    same = [6, 14, 22, 28, 29]
    people = (person("1", same), person("2", same), blanks("1", answers))
    table = table_of(*people).set_index("participant")
    assert table["guess_basis"].to_dict() == {"1": "blanks", "2": "assumed"}
    assert table["guess_rate"]["1"] == pytest.approx((0.5 + 5) / 41)
    assert table["guess_rate"]["2"] == pytest.approx(1 / 11)


def test_blanks_answered_with_either_side_count_by_half_where_both_have_stimuli() -> None:
    left = person("1", GOOD)
    both = (left, left.replace({"side": MIRROR, "response": MIRROR}))
    table = table_of(*both, blanks("1", ["left"] * 5 + ["right"] * 3 + ["none"] * 32))
    assert table["guess_rate"].tolist() == pytest.approx([(0.5 + 4) / 41])


def test_one_trial_without_the_answer_none_makes_it_a_forced_choice() -> None:
    trials = person("1", GOOD)
    trials.loc[0, "none_offered"] = False
    assert table_of(trials)["guess_basis"].tolist() == ["forced choice"]


@pytest.mark.slow
def test_neither_the_order_of_rows_nor_names_change_a_digit() -> None:
    rng = np.random.default_rng(4)
    detected = np.sort(rng.integers(1, 12, (6, 5)), axis=1).tolist()
    straight, backwards = "123456", "65432="
    here, there = (
        pd.concat([person(name, k, n=12) for name, k in zip(names, detected, strict=True)])
        for names in (straight, backwards)
    )
    known = table_of(here)
    pd.testing.assert_frame_equal(table_of(here.sample(frac=1, random_state=1)), known)
    renamed = table_of(there).set_index("participant").loc[[*backwards]]
    assert renamed.to_csv(index=False) == known.drop(columns="participant").to_csv(index=False)


@pytest.mark.slow
def test_conditions_are_never_mixed() -> None:
    alone = table_of(person("1", GOOD))
    both = table_of(person("1", GOOD), person("1", GOOD, condition="control plate"))
    assert both["condition"].tolist() == ["control plate", "main"]
    assert both["trials"].tolist() == [150, 150]
    pd.testing.assert_frame_equal(both.iloc[1:].reset_index(drop=True), alone)


def test_left_and_right_trials_count_alike() -> None:
    left = person("1", GOOD)
    mirrored = left.replace({"side": MIRROR, "response": MIRROR})
    pd.testing.assert_frame_equal(table_of(mirrored), table_of(left))


def test_without_single_trials_there_is_an_empty_table() -> None:
    table = table_of(blanks("1", ["none"] * 30))
    assert table.empty
    assert tuple(table.columns) == THRESHOLD_COLUMNS


@pytest.mark.slow
def test_a_linear_axis_has_no_decibels_and_keeps_its_unit() -> None:
    row = table_of(person("1", GOOD), axis=Axis(x_scale="linear")).iloc[0]
    assert math.isnan(row["threshold_db"])
    assert 80 < row["threshold_vpp"] < 120
    assert row["sigma"] > 10
    assert row["printed"].startswith(f"{row['threshold_vpp']:.1f} V (")


@pytest.mark.parametrize(
    ("levels", "detected", "words"),
    [
        ([0.01, 0.012, 0.015, 0.02, 0.03], [1, 5, 15, 25, 29], "0.0150 V (0.0139 to 0.0164)"),
        ([1000060.37, 1000095.37], [30, 30], "< 1000060.37 V"),
        ([1000060.37, 1000095.37], [0, 0], "> 1000095.37 V"),
    ],
)
def test_no_digit_that_tells_is_left_out(levels: list[float], detected: Any, words: str) -> None:
    fit = fit_psychometric(levels, detected, [30] * len(levels), guess_rate=0.0)
    low, high = (math.log10(end) if math.isfinite(end) else end for end in fit.threshold_limits)
    fit = replace(fit, threshold=math.log10(fit.threshold), threshold_limits=(low, high))
    assert printed(fit, np.array(levels), Axis()) == words


@pytest.mark.slow
def test_answers_that_vary_more_have_wider_limits_where_none_could_be_answered() -> None:
    with_none = felt([3, 9, 17, 24, 29], [49.0, 57.0, 64.0, 73.0, 91.0])
    row = threshold_table(with_none, seed=1).iloc[0]
    wide = 20 * math.log10(row["varied_high_vpp"] / row["varied_low_vpp"])
    # A likelihood to the power of 1 / 2.8 is as wide as that of 2.8 times fewer answers.
    assert wide / (row["threshold_high_db"] - row["threshold_low_db"]) == pytest.approx(
        math.sqrt(2.8), rel=0.12
    )
    assert row["varied_printed"].endswith(" V")
    forced = with_none.assign(none_offered=False)
    assert threshold_table(forced, seed=1)["varied_printed"].isna().all()


def test_limits_of_answers_that_vary_are_open_where_they_leave_the_levels() -> None:
    row = threshold_table(felt([12, 29, 30, 30, 30]), seed=1).iloc[0]
    assert math.isnan(row["varied_low_vpp"])
    assert row["varied_printed"].startswith("< 60 to ")


@pytest.mark.parametrize("unit", [0.001, 1.0, 10_000.0])
def test_limits_have_the_decimals_of_the_threshold_whatever_the_unit(unit: float) -> None:
    counts = [12, 29, 30, 30, 30], [2, 12, 23, 29, 30], [0, 1, 3, 9, 17]
    levels = [unit * level for level in (0.6, 0.95, 1.3, 1.65, 2.0)]
    for each in counts:
        row = threshold_table(felt(each, levels), seed=1).iloc[0]
        one, other = (
            [word.strip("()") for word in row[name].split() if "." in word]
            for name in ("printed", "varied_printed")
        )
        given = {f"{level:.10g}" for level in levels}
        decimals = {len(word.partition(".")[2]) for word in {*one, *other} - given}
        assert len(decimals) == 1, (row["printed"], row["varied_printed"])
        assert all(float(word) for word in (*one, *other))
    assert math.isnan(row["varied_high_vpp"])


@pytest.mark.parametrize(
    ("ends", "words"),
    [
        ((-math.inf, 0.047, math.inf), "0.047 vol (< 0.02 to > 0.1589)"),
        ((0.0011, 0.003, 0.9), "0.0030 vol (0.0011 to 0.9000)"),
        ((-math.inf, 0.0031, 0.0449), "0.0031 vol (< 0.02 to 0.0449)"),
    ],
)
def test_no_level_above_0_is_rounded_to_0(ends: tuple[float, float, float], words: str) -> None:
    low, at, high = ends
    assert with_limits(at, low, high, "vol", [0.02, 0.1589]) == words
