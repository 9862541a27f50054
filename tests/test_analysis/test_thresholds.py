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

PAPER = [60.0, 95.0, 130.0, 165.0, 200.0]
ONE = {
    "condition": "main",
    "kind": "single",
    "side": "left",
    "level_vpp": 60.0,
    "response": "left",
    "reason": "",
    "none_offered": True,
}


def person(name: str, detected: list[int], *, n: int = 30, **same: Any) -> pd.DataFrame:
    """Return single trials, detected and missed."""
    rows = [
        ONE | {"participant": name, "level_vpp": level, "response": answer} | same
        for level, k in zip(PAPER, detected, strict=False)
        for answer in ["left"] * k + ["right"] * (n - k)
    ]
    return pd.DataFrame(rows)


def blanks(name: str, answers: list[str]) -> pd.DataFrame:
    same = ONE | {"participant": name, "kind": "blank", "side": "none", "level_vpp": math.nan}
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
    row = threshold_table(person("1", [2, 14, 22, 28, 29]), seed=1).iloc[0]
    fit = fit_psychometric(PAPER, [2, 14, 22, 28, 29], [30] * 5, guess_rate=0.0)
    assert tuple(row.index) == THRESHOLD_COLUMNS
    assert row["status"] == "ok"
    limits = [row[f"threshold_{name}vpp"] for name in ("low_", "", "high_")]
    assert limits == pytest.approx(
        [fit.threshold_limits[0], fit.threshold, fit.threshold_limits[1]]
    )
    decibel = [row[f"threshold_{name}db"] for name in ("low_", "", "high_")]
    assert decibel == pytest.approx([20 * math.log10(volts) for volts in limits])
    assert row["printed"] == "{1:.1f} V ({0:.1f} to {2:.1f})".format(*limits)
    assert (row["levels"], row["trials"]) == (5, 150)
    assert 0 < row["deviance_p"] <= 1


def test_taking_another_guess_rate_moves_the_threshold_up_with_it() -> None:
    people = person("1", [12, 17, 22, 29, 29], none_offered=False)
    row = threshold_table(people, seed=1).iloc[0]
    assert (row["guess_rate"], row["guess_basis"]) == (0.5, "forced choice")
    names = ("threshold_guess_0_vpp", "threshold_guess_third_vpp", "threshold_vpp")
    zero, third, half = (float(row[name]) for name in names)
    assert zero < third < half


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
def test_where_there_is_no_threshold_the_words_say_so_and_no_number(
    detected: list[int], words: str
) -> None:
    row = threshold_table(person("1", detected), seed=1).iloc[0]
    assert row["printed"] == words
    numbers = [name for name in THRESHOLD_COLUMNS if name.startswith(("threshold_", "mle_"))]
    kept = [name for name in numbers if "guess" not in name]
    assert row[[*kept, "sigma", "deviance", "deviance_p"]].isna().all()


def test_only_levels_that_were_presented_bound_a_threshold() -> None:
    everybody = pd.concat([person("1", [2, 14, 22, 28, 29]), person("2", [30, 30, 30])])
    placed = everybody[(everybody["participant"] == "1") | (everybody["level_vpp"] > 60)]
    assert threshold_table(placed, seed=1)["printed"].iloc[1] == "< 95 V"


def test_a_guess_rate_needs_blanks_and_the_answer_none() -> None:
    assert guessing(none_offered=False, sided_answers=30, blanks=60).rate.mean == 0.5
    few = guessing(none_offered=True, sided_answers=9, blanks=BLANKS_NEEDED - 1)
    assert (few.rate.mean, few.rate.known, few.basis) == (0.0, True, "none offered")
    enough = guessing(none_offered=True, sided_answers=9, blanks=BLANKS_NEEDED)
    assert enough.rate.beta == (0.5 + 4.5, 0.5 + 20 - 4.5)


def test_blanks_tell_the_guess_rate_of_their_participant_only() -> None:
    trials = pd.concat(
        [
            person("1", [6, 14, 22, 28, 29]),
            person("2", [6, 14, 22, 28, 29]),
            blanks("1", ["left"] * 5 + ["right"] * 3 + ["both"] * 2 + ["none"] * 30),
        ]
    )
    table = threshold_table(trials, seed=1).set_index("participant")
    assert table["guess_basis"].to_dict() == {"1": "blanks", "2": "none offered"}
    assert table["guess_rate"]["1"] == pytest.approx((0.5 + 4) / 41)
    assert float(table["threshold_vpp"]["1"]) > float(table["threshold_vpp"]["2"])


def test_one_trial_without_the_answer_none_makes_it_a_forced_choice() -> None:
    trials = person("1", [2, 14, 22, 28, 29])
    trials.loc[0, "none_offered"] = False
    assert threshold_table(trials, seed=1)["guess_basis"].tolist() == ["forced choice"]


def test_shuffled_rows_and_other_names_give_the_same_numbers() -> None:
    trials = pd.concat([person("1", [2, 14, 22, 28, 29]), person("2", [1, 8, 15, 27, 30])])
    here = threshold_table(trials, seed=3)
    shuffled = trials.sample(frac=1, random_state=np.random.default_rng(1))
    pd.testing.assert_frame_equal(threshold_table(shuffled, seed=3), here)
    renamed = trials.assign(participant=trials["participant"].map({"1": "z", "2": "=1+1"}))
    there = threshold_table(renamed, seed=3).set_index("participant").loc[["z", "=1+1"]]
    numbers = list(THRESHOLD_COLUMNS[1:])
    assert there[numbers].to_numpy().tolist() == here[numbers].to_numpy().tolist()


def test_names_change_no_last_digit() -> None:
    rng = np.random.default_rng(4)
    rows = np.sort(rng.integers(1, 12, (9, 5)), axis=1).tolist()
    here, there = (
        threshold_table(
            pd.concat([person(name, row, n=12) for name, row in zip(names, rows, strict=True)]),
            seed=3,
        )
        for names in ("123456789", "987654321")
    )
    assert there["participant"].tolist() == list("123456789")
    numbers = list(THRESHOLD_COLUMNS[1:])
    assert there[::-1][numbers].to_csv(index=False) == here[numbers].to_csv(index=False)


def test_conditions_are_never_mixed() -> None:
    detected = [2, 14, 22, 28, 29]
    two = pd.concat([person("1", detected), person("1", detected, condition="control plate")])
    alone, both = threshold_table(person("1", detected), seed=1), threshold_table(two, seed=1)
    assert both["condition"].tolist() == ["control plate", "main"]
    assert both["trials"].tolist() == [150, 150]
    pd.testing.assert_frame_equal(both.iloc[1:].reset_index(drop=True), alone)
    assert group_table(both)["participants"].tolist() == [1, 1]


def test_left_and_right_trials_count_alike() -> None:
    left, mirrored = person("1", [2, 14, 22, 28, 29]), person("1", [2, 14, 22, 28, 29])
    mirrored["side"] = "right"
    mirrored["response"] = mirrored["response"].map({"left": "right", "right": "left"})
    pd.testing.assert_frame_equal(threshold_table(mirrored, seed=1), threshold_table(left, seed=1))


def test_without_single_trials_there_is_an_empty_table() -> None:
    table = threshold_table(blanks("1", ["none"] * 30), seed=1)
    assert table.empty
    assert tuple(table.columns) == THRESHOLD_COLUMNS
    assert group_table(table).empty


def test_a_linear_axis_has_no_decibels_and_keeps_its_unit() -> None:
    row = threshold_table(
        person("1", [2, 14, 22, 28, 29]), seed=1, axis=Axis(x_scale="linear")
    ).iloc[0]
    assert math.isnan(row["threshold_db"])
    assert 80 < row["threshold_vpp"] < 120
    assert row["sigma"] > 10


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


def test_one_participant_has_no_mean() -> None:
    row = group_of(ok("1", 100))
    assert row["median_vpp"] == pytest.approx(100)
    assert math.isnan(row["mean_vpp"])


def test_leaving_the_censored_out_would_bias_the_group() -> None:
    row = group_of(ok("1", 100), ok("2", 110), below("3"), below("4"), ok("5", 70))
    assert row["median_vpp"] == pytest.approx(70)


def test_a_printed_threshold_keeps_its_limits() -> None:
    fit = fit_psychometric(PAPER, [2, 14, 22, 28, 29], [30] * 5, guess_rate=0.0, x_scale="linear")
    words = printed(fit, np.array(PAPER), Axis(x_scale="linear"))
    assert words.startswith(f"{fit.threshold:.1f} V (")


@pytest.mark.parametrize(
    ("levels", "detected", "words"),
    [
        ([0.01, 0.012, 0.015, 0.02, 0.03], [1, 5, 15, 25, 29], "0.0150 V (0.0139 to 0.0164)"),
        ([1000060.37, 1000095.37], [30, 30], "< 1000060.37 V"),
        ([1000060.37, 1000095.37], [0, 0], "> 1000095.37 V"),
    ],
)
def test_no_digit_that_tells_something_is_left_out(
    levels: list[float], detected: list[int], words: str
) -> None:
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
