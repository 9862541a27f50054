"""Thresholds of participants and groups: guess rates, printed words, censoring, invariances."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis import fit_psychometric, group_table, threshold_table
from analysis.axis import Axis
from analysis.thresholds.people import BLANKS_NEEDED, guessing
from analysis.thresholds.table import GROUP_COLUMNS, THRESHOLD_COLUMNS, WORDS, printed
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


def group_of(*people: tuple[str, str, float, str]) -> pd.Series[Any]:
    columns = ["participant", "status", "threshold_vpp", "printed"]
    return group_table(pd.DataFrame(people, columns=columns).assign(condition="main")).iloc[0]


def ok(name: str, volts: float) -> tuple[str, str, float, str]:
    return (name, "ok", volts, f"{volts} V (1 to 2)")


def below(name: str, words: str = "< 60 V") -> tuple[str, str, float, str]:
    return (name, "threshold_below_levels", math.nan, words)


def above(name: str, words: str = "> 200 V") -> tuple[str, str, float, str]:
    return (name, "threshold_above_levels", math.nan, words)


def test_the_table_says_what_the_fit_says() -> None:
    row = table_of(person("1", GOOD)).iloc[0]
    fit = fit_psychometric(PAPER, GOOD, [30] * 5, guess_rate=0.0)
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


@pytest.mark.parametrize(
    ("detected", "words"),
    [
        ([30] * 5, "< 60 V"),
        ([26, 26, 29, 27, 29], "< 60 V"),
        ([0] * 5, "> 200 V"),
        ([15] * 5, WORDS["flat"]),
        ([29, 24, 15, 6, 1], WORDS["decreasing"]),
        ([0, 0, 0, 30, 30], WORDS["separated"]),
        ([11], WORDS["one_level"]),
    ],
)
def test_without_a_threshold_words_say_so_and_no_number(detected: list[int], words: str) -> None:
    row = table_of(person("1", detected)).iloc[0]
    assert row["printed"] == words
    numbers = [name for name in THRESHOLD_COLUMNS if name.startswith(("threshold_", "mle_"))]
    kept = [name for name in numbers if "guess" not in name]
    assert row[[*kept, "sigma", "deviance", "deviance_p"]].isna().all()


def test_only_levels_that_were_presented_bound_a_threshold() -> None:
    placed = person("2", [30, 30, 30])
    found = table_of(person("1", GOOD), placed[placed["level_vpp"] > 60])
    assert found["printed"].iloc[1] == "< 95 V"


def test_a_guess_rate_needs_blanks_and_the_answer_none() -> None:
    assert guessing(none_offered=False, sided_answers=30, blanks=60).rate.mean == 0.5
    few = guessing(none_offered=True, sided_answers=9, blanks=BLANKS_NEEDED - 1)
    assert (few.rate.mean, few.rate.known, few.basis) == (0.0, True, "none offered")
    enough = guessing(none_offered=True, sided_answers=9, blanks=BLANKS_NEEDED)
    assert enough.rate.beta == (0.5 + 4.5, 0.5 + 20 - 4.5)


def test_blanks_tell_the_guess_rate_of_their_participant_only() -> None:
    answers = ["left"] * 5 + ["right"] * 3 + ["both"] * 2 + ["none"] * 30
    same = [6, 14, 22, 28, 29]
    people = (person("1", same), person("2", same), blanks("1", answers))
    table = table_of(*people).set_index("participant")
    assert table["guess_basis"].to_dict() == {"1": "blanks", "2": "none offered"}
    assert table["guess_rate"]["1"] == pytest.approx((0.5 + 4) / 41)
    assert float(table["threshold_vpp"]["1"]) > float(table["threshold_vpp"]["2"])


def test_one_trial_without_the_answer_none_makes_it_a_forced_choice() -> None:
    trials = person("1", GOOD)
    trials.loc[0, "none_offered"] = False
    assert table_of(trials)["guess_basis"].tolist() == ["forced choice"]


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


def test_conditions_are_never_mixed() -> None:
    alone = table_of(person("1", GOOD))
    both = table_of(person("1", GOOD), person("1", GOOD, condition="control plate"))
    assert both["condition"].tolist() == ["control plate", "main"]
    assert both["trials"].tolist() == [150, 150]
    pd.testing.assert_frame_equal(both.iloc[1:].reset_index(drop=True), alone)
    assert group_table(both)["participants"].tolist() == [1, 1]


def test_left_and_right_trials_count_alike() -> None:
    left = person("1", GOOD)
    mirrored = left.replace({"side": MIRROR, "response": MIRROR})
    pd.testing.assert_frame_equal(table_of(mirrored), table_of(left))


def test_without_single_trials_there_is_an_empty_table() -> None:
    table = table_of(blanks("1", ["none"] * 30))
    assert table.empty
    assert tuple(table.columns) == THRESHOLD_COLUMNS
    assert group_table(table).empty


def test_a_linear_axis_has_no_decibels_and_keeps_its_unit() -> None:
    row = table_of(person("1", GOOD), axis=Axis(x_scale="linear")).iloc[0]
    assert math.isnan(row["threshold_db"])
    assert 80 < row["threshold_vpp"] < 120
    assert row["sigma"] > 10
    assert row["printed"].startswith(f"{row['threshold_vpp']:.1f} V (")


def test_the_group_has_a_median_and_where_nobody_is_censored_a_t_interval() -> None:
    volts = [80.0, 90.0, 120.0, 150.0]
    row = group_of(*(ok(str(i), value) for i, value in enumerate(volts)))
    assert tuple(row.index) == GROUP_COLUMNS
    x = np.log10(volts)
    low, high = stats.t.interval(0.95, 3, loc=x.mean(), scale=x.std(ddof=1) / 2)
    assert row["median_vpp"] == pytest.approx(math.sqrt(90 * 120))
    mean = [row[f"mean_{name}vpp"] for name in ("low_", "", "high_")]
    assert mean == pytest.approx([10**low, 10 ** x.mean(), 10**high])
    assert row["status"] == "ok"


@pytest.mark.parametrize(
    ("people", "status", "median", "words"),
    [
        ([ok("1", 100), ok("2", 90), below("3")], "ok", 90.0, "median 90.0 V"),
        ([ok("1", 100), below("2"), below("3")], "threshold_below_levels", None, "median < 60 V"),
        ([above("1"), above("2"), ok("3", 90)], "threshold_above_levels", None, "median > 200 V"),
        ([below("1"), above("2"), ok("3", 90)], "ok", 90.0, "median 90.0 V"),
        ([ok("1", 100)], "ok", 100.0, "median 100.0 V"),
        ([ok("1", 100), ok("2", 110), below("3"), below("4"), ok("5", 70)],
         "ok", 70.0, "median 70.0 V"),
        ([ok("1", 100), below("2")], "threshold_below_levels", None, "median < 77.5 V"),
        ([ok("1", 100), above("2")], "threshold_above_levels", None, "median > 141.4 V"),
        ([below("1"), above("2")], "none", None, "no median"),
        ([below("1", "< 60 V"), below("2", "< 80 V")],
         "threshold_below_levels", None, "median < 69.3 V"),
        ([below("1", "< 80 V"), ok("2", 70), ok("3", 100)],
         "none", None, "median between 70.0 and 80.0 V"),
        ([below("1", "< 80 V"), ok("2", 90), ok("3", 100)], "ok", 90.0, "median 90.0 V"),
    ],
)  # fmt: skip
def test_censored_thresholds_take_part_in_the_median_and_spoil_the_mean(
    people: list[tuple[str, str, float, str]], status: str, median: float | None, words: str
) -> None:
    row = group_of(*people)
    assert row["status"] == status
    assert row["median_vpp"] == pytest.approx(math.nan if median is None else median, nan_ok=True)
    assert math.isnan(row["mean_vpp"])
    assert row["printed"].startswith(words)


def test_who_has_none_for_another_reason_is_listed() -> None:
    lost = ("9", "flat", math.nan, WORDS["flat"])
    row = group_of(ok("1", 100), ok("2", 90), below("3"), lost)
    assert (row["participants"], row["below"], row["above"], row["without"]) == (4, 1, 0, "9")
    assert row["printed"].endswith("without one: 9")
    assert group_of(lost)["printed"].startswith("no threshold")
    assert math.isnan(group_of(ok("1", 100), ok("2", 90), lost)["mean_vpp"])


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
    if not math.isnan(fit.threshold):
        low, high = map(math.log10, fit.threshold_limits)
        fit = replace(fit, threshold=math.log10(fit.threshold), threshold_limits=(low, high))
    assert printed(fit, np.array(levels), Axis()) == words


def test_a_group_is_told_to_the_digits_of_its_levels() -> None:
    small = group_of(ok("1", 0.01505), ok("2", 0.0152))
    assert small["printed"].startswith("median 0.0151 V; mean 0.0151 V (0.0142 to 0.0161)")
    far = group_of(below("1", "< 1000060.37 V"), below("2", "< 1000060.37 V"))
    assert far["printed"] == "median < 1000060.4 V"
