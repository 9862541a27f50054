"""What was answered to what: counts, mirror and renaming laws, serial effects."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.answers.choice import CONFUSION_COLUMNS, Choices, choices, confusion_table
from analysis.answers.counting import REACTION_COLUMNS, reaction_table
from analysis.answers.detection import both_table, level_table
from analysis.definitions import TOTAL
from tests.test_analysis.shared import SINGLE

if TYPE_CHECKING:
    from analysis.answers.sensitivity import SidePreference

MIRROR = {"left": "right", "right": "left"}
KIND_OF = {"left": "single", "right": "single", "both": "both", "none": "blank"}
WORDS = ("left", "right", "both", "none", "timeout", "invalid")
few = settings(deadline=None, max_examples=10)


def sequence(*pairs: tuple[str, str], **same: Any) -> pd.DataFrame:
    """Trials of a plan in their order, as stimulus and answer."""
    trials = pd.DataFrame(pairs, columns=["side", "response"])
    fixed = SINGLE | {"session": "01", "block": 1, "attempt": 1, "rt_s": 0.5} | same
    of_trial = {
        "kind": trials["side"].map(KIND_OF),
        "trial": np.arange(1, len(trials) + 1),
        "level_vpp": np.where(trials["side"] == "none", math.nan, 60.0),
    }
    return trials.assign(**{name: fixed[name] for name in fixed if name not in trials} | of_trial)


@st.composite
def studies(draw: st.DrawFn) -> pd.DataFrame:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    people = []
    for name in ("1", "2", "3"):
        size = int(rng.integers(5, 40))
        sides = rng.choice(list(KIND_OF), size, p=[0.4, 0.4, 0.1, 0.1])
        guess = rng.choice(WORDS, size, p=[0.3, 0.3, 0.1, 0.2, 0.05, 0.05])
        one = sequence(*zip(sides, np.where(rng.random(size) < 0.6, sides, guess), strict=True))
        drawn: dict[str, Any] = {
            "participant": name,
            "block": 1 + one["trial"] // 15,
            "reason": rng.choice(["", "voided"], size, p=[0.95, 0.05]),
            "condition": rng.choice(["main", "bare"], size, p=[0.9, 0.1]),
            "rt_s": rng.random(size),
        }
        people.append(one.assign(**drawn))
    return pd.concat([*people, people[0].assign(participant="4")], ignore_index=True)


def of(found: tuple[Choices, ...], participant: str = TOTAL) -> Choices:
    (one,) = (each for each in found if each.participant == participant)
    return one


def test_answers_are_counted_by_kind_and_side() -> None:
    trials = sequence(
        ("left", "left"), ("left", "both"), ("right", "left"), ("right", "timeout"),
        ("both", "both"), ("both", "left"), ("none", "none"), ("none", "invalid"),
    )  # fmt: skip
    left_out = trials.assign(reason="voided")
    table = confusion_table(pd.concat([trials, left_out], ignore_index=True))
    assert tuple(table.columns) == CONFUSION_COLUMNS
    assert table.drop(columns="condition").to_numpy().tolist() == [
        ["single", "left", 1, 0, 1, 0, 0, 0, 2],
        ["single", "right", 1, 0, 0, 0, 1, 0, 2],
        ["both", "both", 1, 0, 1, 0, 0, 0, 2],
        ["blank", "none", 0, 0, 0, 1, 0, 1, 2],
    ]
    found = of(choices(trials))
    assert (found.over_report.p, found.mislocalised.p, found.both.p) == (0.25, 0.25, 0.5)
    assert (found.extinction.left, found.extinction.right, found.extinction.p) == (1, 0, 1.0)
    assert (found.detection.hits.p, found.detection.false_alarms.p) == (0.75, 0.0)
    assert (found.spatial.hits.of, found.spatial.false_alarms.p) == (1, 1.0)
    assert found.information.trials == 6


def test_nothing_counted_gives_empty_tables() -> None:
    nothing = sequence(("left", "left"), reason="voided")
    assert choices(nothing) == ()
    assert tuple(confusion_table(nothing).columns) == CONFUSION_COLUMNS
    assert tuple(reaction_table(nothing).columns) == REACTION_COLUMNS
    assert len(confusion_table(nothing)) == len(reaction_table(nothing)) == 0


def test_a_word_that_is_no_answer_is_refused() -> None:
    with pytest.raises(ValueError, match="response must be one of left"):
        choices(sequence(("left", "top")))


def test_a_forced_choice_without_blanks_says_what_it_cannot_tell() -> None:
    found = of(choices(sequence(("left", "left"), ("right", "left"), none_offered=False)))
    assert found.detection.reason
    assert found.serial.felt.reason == '"none" was not offered'
    assert (found.detection.d_prime, found.serial.felt.p) == (None, None)
    assert (found.both.p, found.extinction.p, found.spatial.d_prime) == (None, None, 0)


def test_a_trial_follows_only_its_neighbour_in_the_same_block() -> None:
    trials = sequence(*[("left", "left")] * 6)
    trials.loc[3:, "block"] = 2
    assert of(choices(trials)).serial.side.again.of == 4
    trials.loc[1, "reason"] = "voided"
    assert of(choices(trials)).serial.side.again.of == 2
    trials.loc[4, "attempt"] = 2
    assert of(choices(trials)).serial.side.again.of == 0


def test_serial_shares_are_counted_over_pairs() -> None:
    pairs = [("left", "left"), ("right", "right"), ("left", "none"), ("right", "right")]
    found = of(choices(sequence(*pairs, ("left", "timeout"), ("both", "both"), ("left", "left"))))
    correct, felt, side = found.serial.correct, found.serial.felt, found.serial.side
    assert (correct.again.count, correct.again.of) == (2, 4)
    assert correct.otherwise is not None
    assert (correct.otherwise.count, correct.otherwise.of) == (1, 1)
    assert (felt.again.count, felt.again.of) == (2, 3)
    assert (side.again.count, side.again.of) == (0, 1)


def test_runs_of_misses_are_found_and_random_ones_are_not() -> None:
    rng = np.random.default_rng(3)
    sides = rng.choice(["left", "right"], 120)
    in_runs = [(side, side if n // 20 % 2 else "none") for n, side in enumerate(sides)]
    found = of(choices(sequence(*in_runs))).serial
    assert found.correct.p == found.felt.p == 0.002
    shuffled = [in_runs[n] for n in rng.permutation(120)]
    found = of(choices(sequence(*shuffled))).serial
    assert (found.correct.p or 0) > 0.05
    assert found.correct.expected == pytest.approx(found.correct.again.p, abs=0.1)


def test_a_drift_between_blocks_is_no_serial_effect() -> None:
    felt = np.random.default_rng(4).random(180) < np.repeat([0.95, 0.5, 0.05], 60)
    trials = sequence(*(("left", "left" if yes else "none") for yes in felt))
    found = of(choices(trials.assign(block=np.repeat([1, 2, 3], 60)))).serial.correct
    assert found.otherwise is not None
    assert (found.again.p or 0) - (found.otherwise.p or 0) > 0.3
    assert (found.p or 0) > 0.05


@pytest.mark.slow
def test_serial_p_is_not_too_small_without_an_effect() -> None:
    rng = np.random.default_rng(5)
    ps = []
    for _ in range(150):
        sides = rng.choice(["left", "right"], 60)
        answers = np.where(rng.random(60) < 0.7, sides, rng.choice(["left", "right"], 60))
        ps.append(of(choices(sequence(*zip(sides, answers, strict=True)))).serial.correct.p)
    # Equal counts are likely with 60 trials, which makes p rather too large.
    for level in (0.05, 0.2, 0.5):
        assert np.mean([p is not None and p <= level for p in ps]) <= level + 0.04


def test_one_side_answered_always_has_no_serial_p() -> None:
    side = of(choices(sequence(*[("left", "left"), ("left", "none")] * 5))).serial.side
    assert (side.p, side.reason) == (None, "no two such trials follow each other")
    side = of(choices(sequence(*[("left", "left")] * 5))).serial.side
    assert (side.p, side.reason) == (None, "only one side was answered")


@pytest.mark.slow
@few
@given(studies(), st.randoms(use_true_random=False))
def test_the_order_of_rows_changes_nothing(trials: pd.DataFrame, random: Any) -> None:
    order = random.sample(range(len(trials)), len(trials))
    shuffled = trials.iloc[order].reset_index(drop=True)
    assert choices(shuffled) == choices(trials)
    for make in (confusion_table, reaction_table):
        pd.testing.assert_frame_equal(make(shuffled), make(trials), check_exact=True)


@pytest.mark.slow
@few
@given(studies())
def test_names_change_no_number(trials: pd.DataFrame) -> None:
    names = {"1": "z", "2": "b", "3": "007", "4": "A"}
    renamed = trials.assign(participant=trials["participant"].map(names))
    back = {new: old for old, new in names.items()} | {TOTAL: TOTAL}
    found = [replace(one, participant=back[one.participant]) for one in choices(renamed)]
    assert {*found} == {*choices(trials)}
    moved = trials.assign(condition=trials["condition"].map({"main": "a", "bare": "b"}))
    assert {replace(one, condition="") for one in choices(moved)} == {
        replace(one, condition="") for one in choices(trials)
    }


@pytest.mark.slow
@few
@given(studies())
def test_exchanging_left_and_right_mirrors_every_side(trials: pd.DataFrame) -> None:
    mirrored = trials.replace({"side": MIRROR, "response": MIRROR})
    expected = tuple(_rounded(one) for one in choices(trials))
    assert tuple(_mirrored(one) for one in choices(mirrored)) == expected
    there = confusion_table(mirrored).rename(columns=MIRROR).replace({"side": MIRROR})
    key = ["condition", "kind", "side"]
    here = confusion_table(trials)
    pd.testing.assert_frame_equal(
        there[here.columns].sort_values(key).reset_index(drop=True),
        here.sort_values(key).reset_index(drop=True),
    )


def _mirrored(one: Choices) -> Choices:
    hits, wrong = one.spatial.hits, one.spatial.false_alarms
    criterion = one.spatial.criterion
    turned = replace(
        one.spatial,
        hits=replace(hits, count=wrong.of - wrong.count, of=wrong.of),
        false_alarms=replace(hits, count=hits.of - hits.count, of=hits.of),
        criterion=None if criterion is None else -criterion,
    )
    return replace(
        one,
        spatial=turned,
        wrong_side=_swapped(one.wrong_side),
        blank_side=_swapped(one.blank_side),
        extinction=_swapped(one.extinction),
    )


def _swapped(one: SidePreference) -> SidePreference:
    expected = None if one.expected_left is None else round(1 - one.expected_left, 12)
    return replace(one, left=one.right, right=one.left, expected_left=expected)


def _rounded(one: Choices) -> Choices:
    expected = one.wrong_side.expected_left
    rounded = None if expected is None else round(expected, 12)
    return replace(one, wrong_side=replace(one.wrong_side, expected_left=rounded))


@pytest.mark.slow
@few
@given(studies())
def test_counts_agree_with_the_other_tables(trials: pd.DataFrame) -> None:
    table = confusion_table(trials)
    assert (table[[*WORDS]].sum(axis=1) == table["presented"]).all()
    levels = level_table(trials).groupby("condition")
    single = table[table["kind"] == "single"].groupby("condition")
    assert single["presented"].sum().to_dict() == levels["presented"].sum().to_dict()
    assert single["both"].sum().to_dict() == levels["over_report"].sum().to_dict()
    main = trials[trials["condition"] == "main"]
    found = of(choices(main))
    for row in both_table(main).tail(1).itertuples():
        assert (found.extinction.left, found.extinction.right) == (row.left_only, row.right_only)
        assert (found.both.count, found.both.of) == (row.noticed, row.presented)


def test_the_seed_moves_p_and_nothing_else() -> None:
    sides = np.random.default_rng(6).choice(["left", "right"], (2, 60))
    trials = sequence(*zip(*sides, strict=True))
    one, other = of(choices(trials, seed=0)), of(choices(trials, seed=1))
    assert one != other
    assert one.spatial == other.spatial
    assert one.information.plugin_bits == other.information.plugin_bits


def test_reaction_times_are_those_of_correct_single_trials() -> None:
    trials = sequence(
        ("left", "left"), ("left", "left"), ("left", "right"), ("left", "timeout"),
        ("right", "both"), ("both", "both"), ("left", "left"),
    )  # fmt: skip
    trials["rt_s"] = [0.4, 0.6, 9.0, math.nan, 9.0, 9.0, math.nan]
    table = reaction_table(trials)
    assert table[["side", "n"]].to_numpy().tolist() == [["left", 2], ["right", 0]]
    left, right = table[["median", "p10", "p90"]].to_numpy()
    assert left == pytest.approx([0.5, 0.42, 0.58])
    assert np.isnan(right).all()
