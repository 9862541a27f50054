"""d' by level and beside differences: values, limits, of whom, and which condition was first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm, ttest_1samp, ttest_ind, ttest_rel

from analysis.answers.choice import choices
from analysis.answers.detection import blank_table
from analysis.answers.dprime import (
    SENSITIVITY_COLUMNS,
    d_prime_limits,
    sensitivity_table,
    z_of,
)
from analysis.groups.criterion import BESIDE_COLUMNS, rates_apart, with_criterion
from analysis.groups.sensitivity import BY_LEVEL_COLUMNS, d_prime_differences, levels_apart
from tests.test_analysis.shared import felt


def blanks(answered: int, n: int = 20, **same: Any) -> pd.DataFrame:
    return felt([answered], [60.0], n=n, **({"kind": "blank", "side": "none"} | same)).assign(
        level_vpp=np.nan
    )


def study(*parts: pd.DataFrame) -> pd.DataFrame:
    trials = pd.concat(parts, ignore_index=True)
    trials["trial"] = range(1, len(trials) + 1)
    absent: dict[str, Any] = {"session": "01", "block": 1, "attempt": 1}
    for name, value in absent.items():
        if name not in trials:
            trials[name] = value
    return trials


def test_d_prime_is_the_difference_of_corrected_quantiles() -> None:
    table = sensitivity_table(study(felt([6, 25], [60.0, 95.0]), blanks(3)))
    own = table[table["participant"].eq("1")]
    assert tuple(table.columns) == SENSITIVITY_COLUMNS
    expected = [norm.ppf((k + 0.5) / (n + 1)) - norm.ppf(3.5 / 21)
                for k, n in ((6, 30), (25, 30), (31, 60))]  # fmt: skip
    assert own["d_prime"].tolist() == pytest.approx(expected, rel=1e-12)
    assert own["level_vpp"].iloc[:2].tolist() == [60.0, 95.0]
    assert np.isnan(own["level_vpp"].iloc[2])


def test_all_levels_together_are_as_the_answers_tell() -> None:
    trials = study(
        *(felt([6 + n, 25], [60.0, 95.0], participant=str(n)) for n in range(3)),
        *(blanks(n, participant=str(n)) for n in range(3)),
    )
    table = sensitivity_table(trials)
    told = {one.participant: one.detection.d_prime for one in choices(trials)}
    together = table[table["level_vpp"].isna()].set_index("participant")["d_prime"]
    assert together.to_dict() == pytest.approx(told, rel=1e-12)


def test_people_of_the_same_d_prime_have_no_limits_of_the_mean() -> None:
    same = [part for who in "ab" for part in (felt([9], [60.0], participant=who),
                                              blanks(2, participant=who))]  # fmt: skip
    (row,) = sensitivity_table(study(*same)).query("participant == 'all' and level_vpp == 60").index
    table = sensitivity_table(study(*same)).loc[row]
    assert np.isfinite(table["d_prime"])
    assert np.isnan(table["d_prime_low"])
    assert np.isnan(table["d_prime_high"])


def test_time_outs_count_among_all_and_not_among_the_answered() -> None:
    silent = felt([0], [60.0], n=10, missed="timeout")
    table = sensitivity_table(study(felt([10], [60.0], n=20), silent, blanks(2)))
    row = table.iloc[0]
    z = norm.ppf(2.5 / 21)
    assert row["d_prime"] == pytest.approx(norm.ppf(10.5 / 31) - z)
    assert row["d_prime_answered"] == pytest.approx(norm.ppf(10.5 / 21) - z)


def test_there_is_no_d_prime_without_blanks_or_none() -> None:
    assert sensitivity_table(study(felt([6]))).empty
    forced = study(felt([6], none_offered=False), blanks(3, none_offered=False))
    assert sensitivity_table(forced).empty
    other = study(felt([6]), felt([6], participant="2"), blanks(3, participant="2"))
    assert {*sensitivity_table(other)["participant"]} == {"2", "all"}


def test_limits_cover_d_prime() -> None:
    rng = np.random.default_rng(4)
    for hit, false, n0 in ((0.5, 0.1, 30), (0.9, 0.05, 60), (0.97, 0.2, 20)):
        h, f = rng.binomial(30, hit, 4000), rng.binomial(n0, false, 4000)
        low, high = d_prime_limits(
            h.astype(float), np.full(4000, 30.0), f.astype(float), np.full(4000, float(n0))
        )
        truth = norm.ppf(hit) - norm.ppf(false)
        assert 0.93 < float(((low < truth) & (truth < high)).mean()) < 0.99


def test_exchanged_answers_turn_the_sign_of_d_prime() -> None:
    k, n = np.array([0.0, 3, 7, 20]), np.full(4, 20.0)
    assert (z_of(n - k, n) == -z_of(k, n)).all()


def pair(*people: str) -> pd.DataFrame:
    rows = [{"condition_a": "a", "condition_b": "b", "participant": name} for name in people]
    return pd.DataFrame(rows)


def test_beside_a_difference_stand_false_alarms_and_d_prime_of_common_levels() -> None:
    trials = study(
        felt([6, 25], [60.0, 95.0], condition="a"), blanks(2, condition="a"),
        felt([20, 28], [95.0, 130.0], condition="b", block=2), blanks(5, condition="b", block=2),
        felt([9, 9], [60.0, 95.0], condition="a", participant="2"),
    ).fillna({"block": 1})  # fmt: skip
    found = with_criterion(pair("1", "all"), trials, sensitivity_table(trials))
    assert tuple(found.columns[3:]) == BESIDE_COLUMNS
    own = found.iloc[0]
    counts = own[["false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b"]].tolist()
    assert counts == [2, 20, 5, 20]
    assert own["d_prime_a"] == pytest.approx(norm.ppf(25.5 / 31) - norm.ppf(2.5 / 21))
    assert own["d_prime_b"] == pytest.approx(norm.ppf(20.5 / 31) - norm.ppf(5.5 / 21))
    assert found.iloc[1][["d_prime_a", "blanks_b"]].tolist() == [own["d_prime_a"], 20]
    assert (own["first"], found.iloc[1]["first"]) == ("a", "a 1")


@pytest.mark.parametrize(
    ("places", "first"),
    [
        ({"a": [("01", 1)], "b": [("01", 2)]}, "a"),
        ({"a": [("02", 1)], "b": [("01", 9)]}, "b"),
        ({"a": [("01", 1), ("01", 3)], "b": [("01", 2)]}, "alternated"),
        ({"a": [("01", 1)], "b": [("01", 1)]}, "a"),
        ({"b": [("01", 1)], "a": [("01", 1)]}, "b"),
    ],
)
def test_the_condition_that_was_over_first_is_named(
    places: dict[str, list[tuple[str, int]]], first: str
) -> None:
    parts = [
        felt([3], [60.0], condition=name, session=session, block=block)
        for name, held in places.items() for session, block in held
    ]  # fmt: skip
    trials = study(*parts)
    found = with_criterion(pair("1", "all"), trials, sensitivity_table(trials))
    assert found["first"].tolist() == [first, f"{first} 1"]
    assert found["d_prime_a"].isna().all()


def test_false_alarms_of_different_people_are_compared_by_welchs_t() -> None:
    rows = [("a", name, k, 40) for name, k in zip("123", (1, 6, 2), strict=True)]
    rows += [("b", name, k, 40) for name, k in zip("4567", (9, 3, 8, 8), strict=True)]
    table = pd.DataFrame(rows, columns=["condition", "participant", "felt", "presented"])
    total = table.groupby("condition", as_index=False).sum(numeric_only=True)
    blank = pd.concat([table, total.assign(participant="all")])
    blank = blank.assign(p=blank["felt"] / blank["presented"])
    trials = study(felt([3], [60.0], condition="a"))
    (found,) = with_criterion(pair("all"), trials, sensitivity_table(trials), blank=blank).to_dict(
        "records"
    )
    shares = [table.loc[table["condition"].eq(name), "felt"] / 40 for name in "ba"]
    limits = ttest_ind(*shares, equal_var=False).confidence_interval()
    told = [found[f"false_alarm_difference{end}"] for end in ("", "_low", "_high")]
    assert told == pytest.approx([shares[0].mean() - shares[1].mean(), *limits])


@pytest.mark.parametrize(
    ("run", "first"),
    [(1, "interleaved"), (3, "interleaved"), (4, "alternated"), (10, "alternated")],
)
def test_conditions_are_interleaved_by_trials_and_alternate_by_blocks(run: int, first: str) -> None:
    trials = study(felt([10], [60.0], condition="a"), felt([10], [60.0], condition="b"))
    turn = np.arange(len(trials) // 2)
    of_a = turn // run * 2 * run + turn % run + 1
    trials["trial"] = [*of_a, *(of_a + run)]
    found = with_criterion(pair("1"), trials, sensitivity_table(trials))
    assert found["first"].tolist() == [first]


@pytest.mark.parametrize(
    ("places", "first"),
    [
        ({"a": [("01", 1), ("01", 3)], "b": [("01", 2)]}, "alternated"),
        ({"a": [("01", 1)], "b": [("01", 2), ("02", 1)]}, "a"),
        ({"a": [("01", 1), ("01", 2)], "b": [("01", 2)]}, None),
    ],
)
def test_of_trials_without_numbers_only_a_shared_block_hides_their_order(
    places: dict[str, list[tuple[str, int]]], first: str | None
) -> None:
    parts = [
        felt([3], [60.0], condition=name, session=session, block=block)
        for name, held in places.items() for session, block in held
    ]  # fmt: skip
    trials = study(*parts)
    found = with_criterion(pair("1"), trials, sensitivity_table(trials), numbered=False)
    assert found["first"].tolist() == [first]


def test_the_difference_of_d_prime_has_the_interval_of_a_paired_t_test() -> None:
    people = {"1": (6, 20), "2": (9, 17), "3": (12, 26)}
    parts = [
        felt([k], [95.0], condition=name, participant=who)
        for who, both in people.items() for name, k in zip("ab", both, strict=True)
    ]  # fmt: skip
    parts += [blanks(2, condition=name, participant=who) for who in people for name in "ab"]
    trials = study(*parts).fillna({"block": 1, "session": "01"})
    table = sensitivity_table(trials)
    found = with_criterion(pair(*people, "all"), trials, table).set_index("participant")
    each = found.loc[[*people], "d_prime_b"] - found.loc[[*people], "d_prime_a"]
    assert found.loc[[*people], "d_prime_difference"].tolist() == pytest.approx(each.tolist())
    columns = ["d_prime_difference_low", "d_prime_difference_high"]
    limits = ttest_1samp(each.to_numpy(), 0).confidence_interval(0.95)
    assert [found[name]["all"] for name in columns] == pytest.approx([*limits])
    own = table.loc[table["participant"].eq("1") & table["level_vpp"].notna()]
    (a_at, a_high), (b_at, b_low) = (
        own.loc[own["condition"].eq(name), ["d_prime", end]].to_numpy()[0].tolist()
        for name, end in (("a", "d_prime_high"), ("b", "d_prime_low"))
    )
    low = float(each["1"]) - math.hypot(b_at - b_low, a_high - a_at)
    assert found.loc["1", columns[0]] == pytest.approx(low)
    others = trials.assign(participant=trials["participant"] + trials["condition"])
    apart = with_criterion(pair("all"), others, sensitivity_table(others)).iloc[0]
    a, b = ([*found.loc[[*people], f"d_prime_{which}"]] for which in "ab")
    welch = ttest_ind(b, a, equal_var=False).confidence_interval(0.95)
    assert apart[columns].tolist() == pytest.approx([*welch])


def test_false_alarms_of_the_same_people_differ_as_by_a_paired_t_test() -> None:
    alarms, blanks = [(1, 4), (0, 0), (6, 5), (2, 7)], [(20, 24), (12, 12), (30, 20), (20, 20)]
    shares = np.array(alarms) / np.array(blanks)
    limits = ttest_rel(shares[:, 1], shares[:, 0]).confidence_interval(0.95)
    assert rates_apart(alarms, blanks)[1:] == pytest.approx([*limits])
    assert math.isnan(rates_apart([(1, 4)], [(20, 20)])[1])


def test_the_row_of_all_has_by_how_much_false_alarms_differ_of_those_in_both() -> None:
    alarms = {"1": (1, 4), "2": (0, 0), "3": (6, 5)}
    parts = [
        part
        for who, both in alarms.items() for name, k in zip("ab", both, strict=True)
        for part in (felt([9], [95.0], condition=name, participant=who),
                     blanks(k, condition=name, participant=who))
    ]  # fmt: skip
    parts.append(blanks(9, condition="a", participant="4"))  # was in one condition only
    trials = study(*parts).fillna({"block": 1, "session": "01"})
    table, blank = sensitivity_table(trials), blank_table(trials)
    columns = [f"false_alarm_difference{end}" for end in ("", "_low", "_high")]
    of_all = with_criterion(pair(*alarms, "all"), trials, table, blank=blank)[columns]
    told = rates_apart([*alarms.values()], [(20, 20)] * 3)
    assert of_all.iloc[-1].tolist() == pytest.approx(told)
    assert of_all.iloc[:-1].isna().all(axis=None)
    alone = with_criterion(
        pair("1", "all"), trials, table, blank=blank[blank["participant"].isin(("1", "all"))]
    )
    assert alone[columns].iloc[-1].tolist() == pytest.approx(
        [0.15, math.nan, math.nan], nan_ok=True
    )
    assert with_criterion(pair(*alarms, "all"), trials, table)[columns].isna().all(axis=None)


def levels_of_two(*, others: bool = False) -> pd.DataFrame:
    """Return sensitivities of three people at 60 and 95 V in two conditions."""
    people = {"1": (6, 20), "2": (9, 17), "3": (12, 26)}
    parts = [
        part
        for who, both in people.items() for name, k in zip("ab", both, strict=True)
        for part in (felt([k, 29], [60.0, 95.0], condition=name, participant=who),
                     blanks(2, condition=name, participant=who))
    ]  # fmt: skip
    trials = study(*parts)
    if others:
        trials["participant"] += trials["condition"]
    return sensitivity_table(trials)


def test_d_prime_at_a_level_differs_by_a_paired_t_or_of_other_people_by_welchs() -> None:
    columns = [*BY_LEVEL_COLUMNS[-2:]]
    table = levels_of_two()
    found = d_prime_differences(table)
    assert tuple(found.columns) == BY_LEVEL_COLUMNS
    assert found["participant"].tolist() == ["1", "2", "3", "all"] * 2
    own = table[table["level_vpp"].eq(60) & table["participant"].ne("all")]
    a, b = (own.loc[own["condition"].eq(name), "d_prime"].to_numpy() for name in "ab")
    of_all = found[found["participant"].eq("all") & found["level_vpp"].eq(60)].iloc[0]
    assert of_all["d_prime_difference"] == pytest.approx((b - a).mean())
    assert of_all[columns].tolist() == pytest.approx([*ttest_rel(b, a).confidence_interval(0.95)])
    assert of_all[["felt_a", "presented_a", "felt_b"]].tolist() == [27, 90, 63]
    apart = d_prime_differences(levels_of_two(others=True))
    assert apart["participant"].tolist() == ["all"] * 2
    welch = ttest_ind(b, a, equal_var=False).confidence_interval(0.95)
    assert apart.iloc[0][columns].tolist() == pytest.approx([*welch])


def test_levels_at_which_nearly_all_is_felt_are_told_apart_from_the_others() -> None:
    found = d_prime_differences(levels_of_two()).assign(d_prime_difference_low=-1.0)
    told = levels_apart(found[found["participant"].eq("all")])
    assert told is not None
    assert (told.nearly_all, told.number) == ((95.0,), 1)
    assert told.most_felt == (29 / 30,)
    assert levels_apart(found.assign(d_prime_difference_low=math.nan)) is None


def test_a_difference_that_is_the_same_in_all_has_no_interval() -> None:
    found = d_prime_differences(levels_of_two())
    of_all = found[found["participant"].eq("all") & found["level_vpp"].eq(95)].iloc[0]
    assert of_all["d_prime_difference"] == 0
    assert math.isnan(of_all["d_prime_difference_low"])


def test_three_conditions_have_three_pairs_and_one_person_no_group_interval() -> None:
    parts = [
        part for n, name in enumerate("abc")
        for part in (felt([6 + 5 * n], [60.0], condition=name), blanks(2, condition=name))
    ]  # fmt: skip
    found = d_prime_differences(sensitivity_table(study(*parts)))
    pairs = [*zip(found["condition_a"], found["condition_b"], strict=True)]
    assert pairs == [("a", "b")] * 2 + [("a", "c")] * 2 + [("b", "c")] * 2
    alone = found["participant"].eq("all")
    assert found.loc[alone, "d_prime_difference_low"].isna().all()
    assert found.loc[~alone, "d_prime_difference_low"].notna().all()
    assert d_prime_differences(sensitivity_table(study(*parts[:2]))).empty
