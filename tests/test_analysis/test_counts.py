"""What counts, what is left out, what was answered: counts, shares, and laws of their tables."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr
from scipy.stats import ttest_1samp

from analysis import group_interval, proportion_ci, threshold_table
from analysis.counts.table import count_answers, count_levels, summarize_levels
from tests.test_analysis.shared import SINGLE, loaded
from tests.test_analysis.tables import reasoned, table_of

if TYPE_CHECKING:
    from pathlib import Path

MIRROR = {"left": "right", "right": "left"}
KIND_OF = {"left": "single", "right": "single", "both": "both", "none": "blank"}
WORDS = ("left", "right", "both", "none", "timeout", "invalid")
BOTH = {"kind": "both", "side": "both", "response": "both"}
KEY = ("condition", "level_vpp")
BLANK = {"kind": "blank", "side": "none", "level_vpp": math.nan}
COUNTS = ("levels", "participants", "both", "blank", "excluded")
FRAMES = (*COUNTS, "confusion", "sides", "sensitivity", "reaction_times")
few = settings(deadline=None, max_examples=6)
"""Tables cost the same whatever their size: few examples of many trials show as much for less."""
assert_same = partial(pd.testing.assert_frame_equal, check_exact=True)


def table(*rows: dict[str, Any]) -> pd.DataFrame:
    return reasoned(*rows, **SINGLE)


def answered(*responses: str | None, **same: Any) -> pd.DataFrame:
    return table(*({"response": response} | same for response in responses))


def sequence(*pairs: tuple[str, str], **same: Any) -> pd.DataFrame:
    """Return the trials of a plan in their order, by stimulus and answer."""
    trials = pd.DataFrame(pairs, columns=["side", "response"])
    fixed = SINGLE | {"session": "01", "block": 1, "attempt": 1, "rt_s": 0.5} | same
    of_trial = {
        "kind": trials["side"].map(KIND_OF),
        "trial": np.arange(1, len(trials) + 1),
        "level_vpp": np.where(trials["side"] == "none", math.nan, 60.0),
    }
    return trials.assign(**{name: fixed[name] for name in fixed if name not in trials} | of_trial)


def test_only_the_stimulated_side_is_detected() -> None:
    number = {"left": 2, "right": 1, "both": 2, "timeout": 3, "invalid": 4, "none": 1}
    answers = [word for word, times in number.items() for _ in range(times)]
    levels = table_of("levels", answered(*answers)).iloc[0]
    assert (levels["detected"], levels["presented"]) == (2, 13)
    assert (levels["mislocalised"], levels["over_report"], levels["timeouts"]) == (1, 2, 3)
    assert (levels["p_pooled"], levels["p_answered"]) == (2 / 13, 2 / 6)
    nobody = table_of("levels", answered("timeout", "invalid"))
    assert nobody[["p_answered", "p_low", "p_high"]].isna().all(axis=None)


def test_what_does_not_count_is_listed_by_participant_and_reason() -> None:
    unmasked: dict[str, Any] = {"noise_ok": False}
    trials = table({}, unmasked, unmasked | {"participant": "2"}, {"kind": "practice"})
    assert table_of("levels", trials)["presented"].tolist() == [1]
    listed = table_of("excluded", trials).to_numpy().tolist()
    assert listed == [["1", "practice", 1], ["1", "unmasked", 1], ["2", "unmasked", 1]]


def test_the_mean_is_unweighted_and_the_pooled_p_is_not() -> None:
    quick = answered(*["left"] * 9, "none", participant="a")
    trials = pd.concat([quick, answered("none", "none", participant="b")], ignore_index=True)
    levels = table_of("levels", trials).iloc[0]
    assert levels[["p_mean", "p_pooled", "p_min", "p_max"]].tolist() == [0.45, 9 / 12, 0.0, 0.9]


def test_totals_of_several_people_have_the_interval_of_the_group() -> None:
    answers = ["none"] * 3 + ["left"], ["none"] * 5 + ["right", "both"]
    parts = [answered(*each, **BLANK, participant=n) for n, each in zip("12", answers, strict=True)]
    blank = table_of("blank", pd.concat(parts, ignore_index=True))
    ends = blank[["group_low", "group_high"]]
    assert ends.iloc[-1].tolist() == [*group_interval([1, 2], [4, 7], false_alarms=True)]
    assert ends.iloc[:-1].isna().all(axis=None)
    assert table_of("blank", parts[0])["group_low"].isna().all()
    noticed = {"1": 8, "2": 3, "3": 8}
    parts = [
        answered(*["both"] * k, *["left"] * (8 - k), kind="both", side="both", participant=name)
        for name, k in noticed.items()
    ]
    both = table_of("both", pd.concat(parts, ignore_index=True))
    assert both["group_low"].isna().tolist() == [True, True, True, False]
    last = both.iloc[-1]
    assert (last["group_low"], last["group_high"]) == group_interval([8, 3, 8], [8, 8, 8])
    assert last["group_low"] < last["low"]


def test_levels_have_the_band_of_the_function_or_else_limits_by_t() -> None:
    hits = {"1": 8, "2": 3, "3": 6}
    parts = [
        answered(*["left"] * k, *["none"] * (10 - k), participant=name, level_vpp=level)
        for name, k in hits.items()
        for level in (60.0, 95.0)
    ]
    cells = count_levels(count_answers(pd.concat(parts, ignore_index=True)))
    bands = pd.DataFrame({"condition": "main", "level_vpp": [60.0], "p_low": 0.5, "p_high": 0.6})
    bands["p_function"] = 0.55
    limits = summarize_levels(cells, bands)[["p_low", "p_high"]].to_numpy()
    by_t = ttest_1samp([k / 10 for k in hits.values()], 0).confidence_interval()
    assert limits.tolist() == [[0.5, 0.6], pytest.approx(np.clip([*by_t], 0, 1))]


def test_conditions_levels_and_kinds_are_never_pooled() -> None:
    trials = table({}, {"condition": "b"}, {"level_vpp": 95.0}, {"condition": "b"}, BOTH, BLANK)
    levels = table_of("levels", trials)[["condition", "level_vpp", "presented"]]
    assert levels.to_numpy().tolist() == [["b", 60.0, 2], ["main", 60.0, 1], ["main", 95.0, 1]]
    assert table_of("participants", trials)["presented"].sum() == 4
    both = table(BOTH, BOTH | {"condition": "b"}, BOTH | {"participant": "2"})
    rows = table_of("both", both)[["condition", "participant", "presented"]].to_numpy().tolist()
    assert rows[:2] == [["b", "1", 1], ["b", "all", 1]]
    assert rows[2:] == [["main", "1", 1], ["main", "2", 1], ["main", "all", 2]]


def test_both_finger_trials_and_blanks_are_counted_by_their_answers() -> None:
    answers = ("both", "both", "left", "right", "right", "none", "timeout", "invalid")
    noticed = table_of("both", answered(*answers, kind="both", side="both"))
    assert noticed["participant"].tolist() == ["1", "all"]
    last = noticed.iloc[-1]
    assert last[["noticed", "left_only", "right_only"]].tolist() == [2, 1, 2]
    assert (last["low"], last["high"]) == proportion_ci(2, 8)
    answers = ("left", "right", "right", "both", "none", "none", "timeout", "invalid")
    last = table_of("blank", answered(*answers, **BLANK)).iloc[-1]
    assert last[["left", "right", "both", "presented", "p"]].tolist() == [1, 2, 1, 8, 0.5]
    any_site = table_of("detected_any", answered(*answers[:6]))
    assert any_site["detected_any"].tolist() == [4]
    for offered in (False, None):
        assert table_of("detected_any", table({}, {"none_offered": offered})) is None


def test_what_did_not_occur_has_an_empty_table_with_its_columns() -> None:
    something = sequence(*((side, side) for side in KIND_OF))
    nothing = something.assign(reason="voided")
    for name in (*COUNTS[:-1], *FRAMES[len(COUNTS) :]):
        empty, full = (table_of(name, trials) for trials in (nothing, something))
        assert (len(empty), [*empty.columns]) == (0, [*full.columns])


def test_participants_are_in_the_order_of_their_numbers() -> None:
    people = ["10", "9", "P2", "P11", "P02"]
    trials = pd.DataFrame([SINGLE | {"participant": name} for name in people])
    counted_up = ["9", "10", "P02", "P2", "P11"]
    blanks = trials.assign(kind="blank", side="none", level_vpp=np.nan)
    assert list(table_of("participants", trials)["participant"].unique()) == counted_up
    assert list(table_of("blank", blanks)["participant"]) == [*counted_up, "all"]
    left_out = table_of("excluded", trials.assign(reason="voided"))
    assert list(left_out["participant"].unique()) == counted_up


@st.composite
def studies(draw: st.DrawFn) -> pd.DataFrame:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    people = []
    for name in ("1", "2", "3"):
        size = int(rng.integers(5, 60))
        sides = rng.choice(list(KIND_OF), size, p=[0.4, 0.4, 0.1, 0.1])
        guess = rng.choice(WORDS, size, p=[0.3, 0.3, 0.1, 0.2, 0.05, 0.05])
        person = sequence(*zip(sides, np.where(rng.random(size) < 0.6, sides, guess), strict=True))
        drawn = {
            "participant": name,
            "block": 1 + person["trial"] // 15,
            "reason": rng.choice(["", "voided", "practice"], size, p=[0.9, 0.05, 0.05]),
            "condition": rng.choice(["main", "bare"], size, p=[0.8, 0.2]),
            "level_vpp": np.where(sides == "none", math.nan, rng.choice([60.0, 95.0], size)),
            "rt_s": rng.random(size),
        }
        people.append(person.assign(**drawn))
    return pd.concat([*people, people[0].assign(participant="4")], ignore_index=True)


@pytest.mark.slow
@few
@given(studies(), st.randoms(use_true_random=False))
def test_neither_the_order_of_trials_nor_names_change_a_number(
    trials: pd.DataFrame, random: Any
) -> None:
    shuffled = trials.iloc[random.sample(range(len(trials)), len(trials))].reset_index(drop=True)
    for name in FRAMES:
        assert_same(table_of(name, trials), table_of(name, shuffled))
    names = {"1": "z", "2": "b", "3": "007", "4": "A", "all": "all"}
    renamed = trials.assign(participant=trials["participant"].map(names))
    assert_same(table_of("levels", trials), table_of("levels", renamed))
    before, after = (table_of("participants", each) for each in (trials, renamed))
    key = [column for column in ("participant", *KEY) if column in before]
    before = before.replace({"participant": names})
    assert_same(*(each.sort_values(key, ignore_index=True) for each in (before, after)))


@pytest.mark.slow
@few
@given(studies())
def test_exchanging_left_and_right_mirrors(trials: pd.DataFrame) -> None:
    mirrored = trials.replace({"side": MIRROR, "response": MIRROR})
    for name in ("levels", "participants", "sensitivity"):
        assert_same(table_of(name, trials), table_of(name, mirrored))
    sides, there = (table_of("sides", each) for each in (trials, mirrored))
    there = there.replace({"side": MIRROR}).sort_values(["condition", "side", "level_vpp"])
    assert_same(sides, there.reset_index(drop=True))
    p, same = (table_of("sides_differ", each)["p"].tolist() for each in (trials, mirrored))
    assert p == pytest.approx(same, rel=1e-9)
    swap = {"left_only": "right_only", "right_only": "left_only"} | MIRROR
    for name in ("both", "blank"):
        here = table_of(name, trials)
        assert_same(here, table_of(name, mirrored).rename(columns=swap)[here.columns])
    there = table_of("confusion", mirrored).rename(columns=MIRROR).replace({"side": MIRROR})
    here, key = table_of("confusion", trials), ["condition", "kind", "side"]
    there = there[here.columns].sort_values(key, ignore_index=True)
    assert_same(here.sort_values(key, ignore_index=True), there)


@few
@given(studies())
def test_counts_add_up_and_agree_with_each_other(trials: pd.DataFrame) -> None:
    levels, people, both, blank, excluded = (table_of(name, trials) for name in COUNTS)
    totals = [t.loc[t["participant"].eq("all"), "presented"].sum() for t in (both, blank)]
    assert levels["presented"].sum() + sum(totals) + excluded["trials"].sum() == len(trials)
    for mean in ("p_mean", "p_pooled"):
        assert (levels["p_min"] <= levels[mean]).all()
        assert (levels[mean] <= levels["p_max"]).all()
    parts = levels[["detected", "over_report", "mislocalised", "timeouts"]].sum(axis=1)
    assert (parts <= levels["presented"]).all()
    exact = table_of("participants", trials, ci="jeffreys")
    assert ((exact["low"] <= exact["p"]) & (exact["p"] <= exact["high"])).all()
    by_level = people.groupby(["condition", "level_vpp"])[["detected", "presented"]].sum()
    assert by_level.to_numpy().tolist() == levels[["detected", "presented"]].to_numpy().tolist()
    answers = table_of("confusion", trials)
    assert (answers[[*WORDS]].sum(axis=1) == answers["presented"]).all()
    single = answers[answers["kind"] == "single"].groupby("condition")[["presented", "both"]].sum()
    of_levels = levels.groupby("condition")[["presented", "over_report"]].sum()
    assert single.to_numpy().tolist() == of_levels.to_numpy().tolist()
    sides = table_of("sides", trials).groupby(["condition", "level_vpp"])[["detected", "presented"]]
    assert sides.sum().to_numpy().tolist() == levels[["detected", "presented"]].to_numpy().tolist()


def test_answers_are_counted_by_kind_and_side() -> None:
    trials = sequence(
        *(("left", "left"), ("left", "both"), ("right", "left"), ("right", "timeout")),
        *(("both", "both"), ("both", "left"), ("none", "none"), ("none", "invalid")),
    )
    left_out = trials.assign(reason="voided")
    answers = table_of("confusion", pd.concat([trials, left_out], ignore_index=True))
    assert answers.drop(columns="condition").to_numpy().tolist() == [
        ["single", "left", 1, 0, 1, 0, 0, 0, 2],
        ["single", "right", 1, 0, 0, 0, 1, 0, 2],
        ["both", "both", 1, 0, 1, 0, 0, 0, 2],
        ["blank", "none", 0, 0, 0, 1, 0, 1, 2],
    ]
    with pytest.raises(ValueError, match="response"):
        table_of("confusion", sequence(("left", "top")))


def people_with_sides(
    rng: np.random.Generator, difference_db: float, sd_db: float = 0.0, people: int = 5
) -> Any:
    """Return trials whose thresholds at left and right are so many dB apart, about 60 V."""
    level_vpp = np.array([30.0, 45.0, 60.0, 80.0, 105.0])
    shape = (people, 2, len(level_vpp), 15)
    person, side, level, _ = (axis.ravel() for axis in np.indices(shape))
    apart = difference_db + rng.normal(0, sd_db, people)[person]
    threshold = rng.normal(0, 2, people)[person] + apart * (side - 0.5)
    z = (20 * np.log10(level_vpp[level] / 60) - threshold) / 2
    hits = rng.random(len(z)) < 0.02 + 0.95 * ndtr(z)
    sides = np.array(["left", "right"])[side]
    return pd.DataFrame(
        SINGLE
        | {
            "participant": person.astype(str),
            "side": sides,
            "level_vpp": level_vpp[level],
            "response": np.where(hits, sides, "none"),
        }
    )


@pytest.mark.slow
def test_sides_are_said_to_differ_in_one_of_20_studies_where_they_do_not() -> None:
    rng = np.random.default_rng(1)
    shares = [
        np.mean(
            [
                table_of("sides_differ", people_with_sides(rng, db, sd_db))["p"].item() < 0.05
                for _ in range(studies)
            ]
        )
        for db, sd_db, studies in ((0.0, 0.0, 200), (0.0, 1.4, 200), (5.0, 1.4, 30))
    ]
    # Two tests that must both find a difference are cautious where participants are alike.
    assert shares[0] <= 0.06
    assert 0.01 <= shares[1] <= 0.09
    assert shares[2] == 1.0


def test_people_at_45_v_left_and_80_v_right_are_not_pooled_without_a_word() -> None:
    trials = people_with_sides(np.random.default_rng(2), 5.0)
    (p,) = table_of("sides_differ", trials)["p"]
    assert p < 0.01
    sides = table_of("sides", trials).query("level_vpp == 60")
    left, right = sides["p_mean"]
    assert sides["side"].tolist() == ["left", "right"]
    assert left - right > 0.4
    assert sides["presented"].tolist() == [75, 75]
    one_side = trials[trials["side"].eq("left")]
    assert table_of("sides_differ", one_side).empty


def test_reaction_times_are_those_of_correct_single_trials() -> None:
    answers = ("left", "left", "right", "timeout", "both", "both", "left")
    sides = ("left", "left", "left", "left", "right", "both", "left")
    trials = sequence(*zip(sides, answers, strict=True))
    trials["rt_s"] = [0.4, 0.6, 9.0, math.nan, 9.0, 9.0, math.nan]
    times = table_of("reaction_times", trials)
    assert times[["side", "n"]].to_numpy().tolist() == [["left", 2], ["right", 0]]
    left, right = times[["median", "p10", "p90"]].to_numpy()
    assert left == pytest.approx([0.5, 0.42, 0.58])
    assert np.isnan(right).all()


@pytest.mark.parametrize(
    ("change", "names"),
    [
        ({"columns": []}, ["participant", "condition", "kind"]),
        ({"columns": ["none_offered"]}, ["none_offered"]),
        ({"seed": -1}, ["seed", "-1"]),
    ],
)
def test_other_tables_and_seeds_are_refused_by_name(change: Any, names: list[str]) -> None:
    trials = pd.DataFrame([SINGLE])
    if "columns" in change:
        trials = trials.drop(columns=change["columns"] or [*trials.columns])
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the names follow
        threshold_table(trials, seed=change.get("seed", 1))
    assert all(name in str(caught.value) for name in names)


HEADER = "participant,block,trial,kind,side,level_vpp,response,status,premature,noise_ok\n"
MAIN = (
    "1,1,90,single,left,60,left,ok,false,true\n1,1,91,single,right,60,left,ok,false,true\n"
    "1,1,92,both,both,60,both,ok,false,true\n"
)
HANDS_OFF = (
    "1,-1,1,hands_off,left,200,none,ok,false,true\n"
    "1,-1,2,hands_off,right,200,right,ok,false,true\n"
    "1,-1,3,hands_off,left,200,left,voided,false,false\n"
    "1,-1,4,hands_off,left,200,left,ok,true,true\n"
    "1,9,94,hands_off,left,200,timeout,ok,false,true\n"
    "1,9,95,hands_off,left,200,both,ok,false,true\n"
    "1,9,96,hands_off,right,200,none,ok,false,n/a\n"
    "1,9,97,hands_off,right,200,left,ok,false,false\n"
    "2,-1,1,hands_off,right,200,invalid,ok,false,true\n"
)


def test_hands_off_trials_are_counted_by_person_part_and_side(tmp_path: Path) -> None:
    without, trials = (loaded(tmp_path, HEADER + rows).trials for rows in (MAIN, MAIN + HANDS_OFF))
    hands_off = table_of("hands_off", trials)
    counts = ["left", "right", "both", "none", "timeouts", "invalid", "presented"]
    assert list(hands_off.columns) == ["participant", "part", "side", *counts]
    assert hands_off.to_numpy().tolist() == [
        ["1", "before", "left", 0, 0, 0, 1, 0, 0, 1],
        ["1", "before", "right", 0, 1, 0, 0, 0, 0, 1],
        ["1", "after", "left", 0, 0, 1, 0, 1, 0, 2],
        ["1", "after", "right", 0, 0, 0, 1, 0, 0, 1],
        ["2", "before", "right", 0, 0, 0, 0, 0, 1, 1],
        ["all", "before", "left", 0, 0, 0, 1, 0, 0, 1],
        ["all", "before", "right", 0, 1, 0, 0, 0, 1, 2],
        ["all", "after", "left", 0, 0, 1, 0, 1, 0, 2],
        ["all", "after", "right", 0, 0, 0, 1, 0, 0, 1],
    ]
    for name in ("levels", "both"):
        assert_same(table_of(name, trials), table_of(name, without))
    trials["condition"] = trials["trial"].mod(2).map({0: "a", 1: "b"})
    totals = table_of("hands_off", trials).query("participant == 'all'")
    assert totals.groupby("condition")["presented"].sum().to_dict() == {"a": 3, "b": 3}
