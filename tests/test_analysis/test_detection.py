"""What counts, what is left out, and the laws of the tables."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import group_interval, level_table, proportion_ci, threshold_table
from analysis.answers.counting import NEEDED, excluded_table, offers_none
from analysis.answers.detection import (
    LEVEL_COLUMNS,
    blank_table,
    both_table,
    cells,
    check_order,
    detected_any,
    participants_of,
)
from analysis.reading.reasons import with_reasons
from tests.test_analysis.shared import SINGLE

MIRROR = {"left": "right", "right": "left"}
SIDE_OF = {"both": "both", "blank": "none"}
BOTH = {"kind": "both", "side": "both", "response": "both"}
BLANK = {"kind": "blank", "side": "none", "level_vpp": math.nan}
UNASKED = {"status": "ok", "anticipated": False, "noise_ok": None, "burst_verified": None}


def table(*rows: dict[str, Any]) -> pd.DataFrame:
    trials = pd.DataFrame([SINGLE | UNASKED | row for row in rows])
    return with_reasons(trials.astype({"noise_ok": "boolean"}))


def answered(*responses: str | None, **same: Any) -> pd.DataFrame:
    return table(*({"response": response} | same for response in responses))


def test_only_the_own_side_is_detected() -> None:
    numbers = {"left": 2, "right": 1, "both": 2, "timeout": 3, "invalid": 4, "none": 1}
    answers = [word for word, number in numbers.items() for _ in range(number)]
    levels = level_table(answered(*answers)).iloc[0]
    assert (levels["detected"], levels["presented"]) == (2, 13)
    assert (levels["mislocalised"], levels["over_report"], levels["timeouts"]) == (1, 2, 3)
    assert levels["p_pooled"] == 2 / 13
    assert levels["p_answered"] == 2 / 6


def test_answered_only_is_nothing_where_nobody_answered() -> None:
    assert math.isnan(level_table(answered("timeout", "invalid")).iloc[0]["p_answered"])


def test_what_does_not_count_is_listed_by_participant_and_reason() -> None:
    unmasked: dict[str, Any] = {"noise_ok": False}
    trials = table({}, unmasked, unmasked | {"participant": "2"}, {"kind": "practice"})
    assert level_table(trials)["presented"].tolist() == [1]
    listed = excluded_table(trials).to_numpy().tolist()
    assert listed == [["1", "practice", 1], ["1", "unmasked", 1], ["2", "unmasked", 1]]


def test_a_trial_that_is_neither_counted_nor_listed_stops_everything() -> None:
    with pytest.raises(RuntimeError, match="neither"):
        excluded_table(table({}, {"kind": "unheard of"}))


def test_the_mean_is_unweighted_and_the_pooled_p_is_not() -> None:
    quick = answered(*["left"] * 9, "none", participant="a")
    trials = pd.concat([quick, answered("none", "none", participant="b")], ignore_index=True)
    levels = level_table(trials).iloc[0]
    assert levels["p_mean"] == 0.45
    assert levels["p_pooled"] == 9 / 12
    assert (levels["p_min"], levels["p_max"]) == (0.0, 0.9)


def test_false_alarms_of_several_people_have_the_group_interval_and_each_its_own() -> None:
    one, other = ["none"] * 3 + ["left"], ["none"] * 5 + ["right", "both"]
    parts = [
        answered(*each, **BLANK, participant=name)
        for name, each in zip("12", (one, other), strict=True)
    ]
    made = blank_table(pd.concat(parts, ignore_index=True))
    ends = made[["group_low", "group_high"]]
    assert ends.iloc[-1].tolist() == [*group_interval([1, 2], [4, 7], false_alarms=True)]
    assert ends.iloc[:-1].isna().all(axis=None)
    assert blank_table(parts[0])["group_low"].isna().all()


def test_one_participant_has_no_group_interval() -> None:
    assert level_table(answered("left", "none"))[["group_low", "group_high"]].isna().all(axis=None)


def test_conditions_and_levels_are_never_pooled() -> None:
    trials = table({}, {"condition": "bare"}, {"level_vpp": 95.0}, {"condition": "bare"})
    levels = level_table(trials)
    assert levels[["condition", "level_vpp", "presented"]].to_numpy().tolist() == [
        ["bare", 60.0, 2],
        ["main", 60.0, 1],
        ["main", 95.0, 1],
    ]


def test_both_and_blank_trials_are_never_in_the_level_table() -> None:
    trials = table({}, BOTH, BLANK)
    assert level_table(trials)["presented"].tolist() == [1]
    assert participants_of(cells(trials))["presented"].tolist() == [1]


def test_a_both_finger_trial_is_noticed_only_by_both() -> None:
    answers = ("both", "both", "left", "right", "right", "none", "timeout", "invalid")
    noticed = both_table(answered(*answers, kind="both", side="both"))
    assert noticed["participant"].tolist() == ["1", "all"]
    last = noticed.iloc[-1]
    assert (last["noticed"], last["left_only"], last["right_only"]) == (2, 1, 2)
    assert (last["low"], last["high"]) == proportion_ci(2, 8)


def test_a_false_alarm_is_any_of_left_right_both() -> None:
    answers = ("left", "right", "right", "both", "none", "none", "timeout", "invalid")
    last = blank_table(answered(*answers, **BLANK)).iloc[-1]
    assert last[["left", "right", "both", "presented", "p"]].tolist() == [1, 2, 1, 8, 0.5]


def test_tables_of_kinds_that_did_not_occur_are_empty_but_have_their_columns() -> None:
    shares = "presented p low high"
    for found, columns in (
        (
            both_table(table({})),
            f"participant noticed {shares} group_low group_high left_only right_only",
        ),
        (
            blank_table(table({})),
            f"participant left right both {shares} group_low group_high",
        ),
        (level_table(table({"kind": "practice"})), " ".join(LEVEL_COLUMNS)),
    ):
        assert (len(found), list(found.columns)) == (0, columns.split())


def test_participants_are_in_the_order_of_their_numbers() -> None:
    people = ["10", "9", "P2", "P11", "P02"]
    trials = pd.DataFrame([SINGLE | {"participant": name} for name in people])
    counted_up = ["9", "10", "P02", "P2", "P11"]
    blanks = trials.assign(kind="blank", side="none", level_vpp=np.nan)
    left_out = trials.assign(reason="voided")
    assert list(participants_of(cells(trials))["participant"].unique()) == counted_up
    assert list(blank_table(blanks)["participant"]) == [*counted_up, "all"]
    assert list(excluded_table(left_out)["participant"].unique()) == counted_up


def test_several_conditions_have_a_last_row_each() -> None:
    trials = table(BOTH, BOTH | {"condition": "bare"}, BOTH | {"participant": "2"})
    assert both_table(trials)[["condition", "participant", "presented"]].to_numpy().tolist() == [
        ["bare", "1", 1],
        ["bare", "all", 1],
        ["main", "1", 1],
        ["main", "2", 1],
        ["main", "all", 2],
    ]


def test_felt_at_all_is_counted_where_none_was_offered() -> None:
    answers = ("left", "right", "both", "none", "timeout", "invalid")
    assert detected_any(answered(*answers))["detected_any"].tolist() == [3]


@pytest.mark.parametrize("offered", [False, None])
def test_felt_at_all_is_refused_where_none_was_not_offered(*, offered: bool | None) -> None:
    trials = table({}, {"none_offered": offered})
    assert not offers_none(trials)
    with pytest.raises(ValueError, match='must offer "none"'):
        detected_any(trials)


def test_an_impossible_mean_stops() -> None:
    check_order(0.5, 0.5, 0.5)
    for p_min, p_mean, p_max in ((0.9, 0.87, 1.0), (0.5, 0.9, 0.8), (0.5, math.nan, 0.8)):
        with pytest.raises(RuntimeError, match="internal error"):
            check_order(p_min, p_mean, p_max)


@st.composite
def studies(draw: st.DrawFn) -> pd.DataFrame:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    size = draw(st.integers(1, 160))
    kinds = rng.choice(["single", "both", "blank", "practice"], size, p=[0.7, 0.1, 0.1, 0.1])
    one_sided = rng.choice(["left", "right"], size)
    sides = [SIDE_OF.get(kind, side) for kind, side in zip(kinds, one_sided, strict=True)]
    levels_vpp = rng.choice([60.0, 95.0, 130.0], size)
    made = {
        "participant": rng.integers(1, 5, size).astype(str),
        "condition": rng.choice(["main", "bare"], size),
        "kind": kinds,
        "side": sides,
        "level_vpp": np.where(np.array(sides) == "none", math.nan, levels_vpp),
        "response": rng.choice(["left", "right", "both", "none", "timeout", "invalid"], size),
        "status": rng.choice(["ok", "voided"], size, p=[0.9, 0.1]),
        "noise_ok": rng.random(size) > 0.1,
        "burst_verified": rng.choice(["line", "false"], size, p=[0.9, 0.1]),
    }
    return with_reasons(pd.DataFrame(made).assign(anticipated=False, none_offered=True))


few = settings(deadline=None, max_examples=6)
"""Tables cost the same whatever their size: few examples of many trials tell as much for less."""


def people_table(trials: pd.DataFrame) -> pd.DataFrame:
    return participants_of(cells(trials))


def every_table(trials: pd.DataFrame) -> list[pd.DataFrame]:
    made = [level_table, people_table, both_table, blank_table, excluded_table]
    return [make(trials) for make in made]


assert_same = partial(pd.testing.assert_frame_equal, check_exact=True)


@pytest.mark.slow
@few
@given(studies(), st.randoms(use_true_random=False))
def test_the_order_of_trials_changes_nothing(trials: pd.DataFrame, random: Any) -> None:
    order = list(range(len(trials)))
    random.shuffle(order)
    shuffled = trials.iloc[order].reset_index(drop=True)
    for one, other in zip(every_table(trials), every_table(shuffled), strict=True):
        assert_same(one, other)


@pytest.mark.slow
@few
@given(studies())
def test_the_names_of_participants_change_no_number(trials: pd.DataFrame) -> None:
    names = {"1": "z", "2": "b", "3": "007", "4": "A"}
    renamed = trials.assign(participant=trials["participant"].map(names))
    assert_same(level_table(trials), level_table(renamed))
    one, other = people_table(trials), people_table(renamed)
    one["participant"] = one["participant"].map(names)
    key = ["participant", "condition", "level_vpp"]
    assert_same(one.sort_values(key).reset_index(drop=True), other)
    for make in (both_table, blank_table):
        rows = (make(t).drop(columns="participant").iloc[-1:] for t in (trials, renamed))
        one, other = (row.reset_index(drop=True) for row in rows)
        assert_same(one, other)


@pytest.mark.slow
@few
@given(studies())
def test_exchanging_left_and_right_mirrors(trials: pd.DataFrame) -> None:
    mirrored = trials.replace({"side": MIRROR, "response": MIRROR})
    assert_same(level_table(trials), level_table(mirrored))
    assert_same(people_table(trials), people_table(mirrored))
    swap = {"left_only": "right_only", "right_only": "left_only"}
    there = both_table(mirrored).rename(columns=swap)
    assert_same(both_table(trials), there[both_table(trials).columns])
    there = blank_table(mirrored).rename(columns=MIRROR)
    assert_same(blank_table(trials), there[blank_table(trials).columns])


@pytest.mark.slow
@few
@given(studies())
def test_every_trial_is_counted_or_listed(trials: pd.DataFrame) -> None:
    level, _, both, blank, excluded = every_table(trials)
    totals = [t.loc[t["participant"].eq("all"), "presented"].sum() for t in (both, blank)]
    counted = level["presented"].sum() + sum(totals)
    assert counted + excluded["trials"].sum() == len(trials)


@few
@given(studies())
def test_means_lie_within_and_answers_add_up(trials: pd.DataFrame) -> None:
    levels = level_table(trials)
    for mean in ("p_mean", "p_pooled"):
        assert (levels["p_min"] <= levels[mean]).all()
        assert (levels[mean] <= levels["p_max"]).all()
    parts = levels[["detected", "over_report", "mislocalised", "timeouts"]].sum(axis=1)
    assert (parts <= levels["presented"]).all()
    people = participants_of(cells(trials), "jeffreys")
    assert (people["low"] <= people["p"]).all()
    assert (people["p"] <= people["high"]).all()
    by_level = people.groupby(["condition", "level_vpp"])[["detected", "presented"]].sum()
    assert by_level.to_numpy().tolist() == levels[["detected", "presented"]].to_numpy().tolist()


def test_both_finger_trials_have_the_interval_of_people_in_their_total() -> None:
    noticed = {"1": 8, "2": 3, "3": 8}
    rows = [(name, "both" if i < k else "left") for name, k in noticed.items() for i in range(8)]
    trials = pd.DataFrame(rows, columns=["participant", "response"])
    found = both_table(trials.assign(condition="main", kind="both", reason=""))
    assert found["group_low"].isna().tolist() == [True, True, True, False]
    last = found.iloc[-1]
    assert (last["group_low"], last["group_high"]) == group_interval([8, 3, 8], [8, 8, 8])
    assert last["group_low"] < last["low"]


def test_a_table_that_lacks_columns_is_refused_by_its_columns() -> None:
    told = "trials must be a table that analysis.read_trials returned; got one without "
    with pytest.raises(ValueError, match=f"{told}participant, condition, kind"):
        level_table(pd.DataFrame())
    few = pd.DataFrame(columns=[*NEEDED])
    with pytest.raises(ValueError, match=f"{told}none_offered"):
        threshold_table(few, seed=1)
    with pytest.raises(ValueError, match="seed must be a whole number >= 0; got -1"):
        threshold_table(few.assign(none_offered=True), seed=-1)
