"""Thresholds of participants and groups: guess rates, printed words, censoring, invariances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis import Axis, GuessRate, fit_psychometric, threshold_table
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
    assert row["status"] == "ok"
    low, high = fit.threshold_limits
    limits = [row[f"{name}vpp"] for name in VALUES]
    assert limits == pytest.approx([low, fit.threshold, high])
    decibel = [row[f"{name}db"] for name in VALUES]
    assert decibel == pytest.approx([20 * math.log10(volts) for volts in limits])
    assert row["printed"] == "{1:.1f} V ({0:.1f} to {2:.1f})".format(*limits)
    assert (row["levels"], row["trials"]) == (5, 150)
    assert 0 < row["deviance_p"] <= 1


@pytest.mark.parametrize(
    ("answers", "sides", "basis", "mean"),
    [
        ([], "left", "assumed", 1 / 11),
        (["left"] * 5 + ["right"] * 3 + ["both"] * 2 + ["none"] * 30, "left", "blanks", 5.5 / 41),
        (["left"] * 5 + ["right"] * 3 + ["none"] * 32, "both", "blanks", 4.5 / 41),  # by half
        (["left"] * 4 + ["none"] * 15, "left", "few blanks", None),
    ],
)
def test_blanks_show_the_guess_rate_of_their_participant(
    answers: list[str], sides: str, basis: str, mean: float | None
) -> None:
    people = [person("1", GOOD), person("2", GOOD)]
    mirrored = people[0].replace({"side": MIRROR, "response": MIRROR})
    parts = [*people, *([mirrored] if sides == "both" else []), blanks("1", answers)]
    table = table_of(*parts).set_index("participant")
    assert table["guess_basis"].to_dict() == {"1": basis, "2": "assumed"}
    assert table["guess_rate"]["2"] == pytest.approx(1 / 11)
    assert mean is None or table["guess_rate"]["1"] == pytest.approx(mean)
    people[0].loc[0, "none_offered"] = False
    assert table_of(people[0])["guess_basis"].tolist() == ["forced choice"]


@pytest.mark.parametrize("detected", [[15] * 5, [29, 24, 15, 6, 1], [11]])
def test_without_a_threshold_there_is_no_number(detected: list[int]) -> None:
    row = table_of(person("1", detected)).iloc[0]
    names = [name for name in row.index if name.startswith(("threshold_", "mle_"))]
    kept = [name for name in names if "guess" not in name]
    assert row[[*kept, "sigma", "deviance", "deviance_p"]].isna().all()
    assert not any(one.isdigit() for one in row["printed"])
    assert table_of(blanks("1", ["none"] * 30)).empty


def test_guess_rates_levels_axes_and_conditions_are_each_their_own() -> None:
    forced = table_of(person("1", [12, 17, 22, 29, 29], none_offered=False)).iloc[0]
    assert (forced["guess_rate"], forced["guess_basis"]) == (0.5, "forced choice")
    rates = ("threshold_guess_0_vpp", "threshold_guess_third_vpp", "threshold_vpp")
    assert forced[[*rates]].is_monotonic_increasing
    placed = person("2", [30, 30, 30])
    found = table_of(person("1", GOOD), placed[placed["level_vpp"] > 60])
    assert found["printed"].iloc[1] == "< 95 V"  # only levels that were presented are a bound
    both = table_of(person("1", GOOD), person("1", GOOD, condition="control plate"))
    assert both["condition"].tolist() == ["control plate", "main"]
    alone = table_of(person("1", GOOD))
    pd.testing.assert_frame_equal(both.iloc[1:].reset_index(drop=True), alone)
    linear = table_of(person("1", GOOD), axis=Axis(x_scale="linear")).iloc[0]
    assert math.isnan(linear["threshold_db"])
    assert 80 < linear["threshold_vpp"] < 120
    assert linear["sigma"] > 10
    vary = threshold_table(felt([12, 29, 30, 30, 30]), seed=1).iloc[0]
    assert math.isnan(vary["varied_low_vpp"])
    assert vary["varied_printed"].startswith("< 60 ")


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
