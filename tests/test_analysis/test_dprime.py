"""d' by level and beside differences: values, limits, of whom, and which condition was first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import fisher_exact, norm, ttest_1samp, ttest_ind, ttest_rel

from analysis.groups.criterion import BESIDE_COLUMNS, rates_apart, same_rates_p, with_criterion
from tests.test_analysis.shared import felt
from tests.test_analysis.tables import table_of

PEOPLE = {"1": (6, 20), "2": (9, 17), "3": (12, 26)}
"""Detected at one level in conditions a and b."""
DIFFERENCE = [f"d_prime_difference{end}" for end in ("", "_low", "_high")]
ALARMS = [f"false_alarm_difference{end}" for end in ("", "_low", "_high")]


def blanks(answered: int, n: int = 20, **same: Any) -> pd.DataFrame:
    return felt([answered], [60.0], n=n, **({"kind": "blank", "side": "none"} | same)).assign(
        level_vpp=np.nan
    )


def study(*parts: pd.DataFrame) -> pd.DataFrame:
    trials = pd.concat(parts, ignore_index=True)
    trials["trial"] = range(1, len(trials) + 1)
    absent: dict[str, Any] = {"session": "01", "block": 1, "attempt": 1}
    for name, value in absent.items():
        trials[name] = trials[name].fillna(value) if name in trials else value
    return trials


def two_conditions(*others: float) -> pd.DataFrame:
    """Return the trials of three people in both conditions, with 29 of 30 at further levels."""
    return study(
        *(
            part
            for who, both in PEOPLE.items()
            for name, k in zip("ab", both, strict=True)
            for part in (
                felt([k, *(29 for _ in others)], [60.0, *others], condition=name, participant=who),
                blanks(2, condition=name, participant=who),
            )
        )
    )


def beside(trials: pd.DataFrame, *people: str, **options: Any) -> pd.DataFrame:
    """Return what stands beside the differences of a and b."""
    rows = [{"condition_a": "a", "condition_b": "b", "participant": name} for name in people]
    return with_criterion(pd.DataFrame(rows), trials, table_of("sensitivity", trials), **options)


def test_d_prime_is_the_difference_of_corrected_quantiles() -> None:
    table = table_of("sensitivity", study(felt([6, 25], [60.0, 95.0]), blanks(3)))
    own = table[table["participant"].eq("1")]
    counts = ((6, 30), (25, 30), (31, 60))
    expected = [norm.ppf((k + 0.5) / (n + 1)) - norm.ppf(3.5 / 21) for k, n in counts]
    assert own["d_prime"].tolist() == pytest.approx(expected, rel=1e-12)
    assert own["level_vpp"].fillna(0).tolist() == [60.0, 95.0, 0]
    silent = felt([0], [60.0], n=10, missed="timeout")
    row = table_of("sensitivity", study(felt([10], [60.0], n=20), silent, blanks(2))).iloc[0]
    z = norm.ppf(2.5 / 21)
    assert row["d_prime"] == pytest.approx(norm.ppf(10.5 / 31) - z)
    assert row["d_prime_answered"] == pytest.approx(norm.ppf(10.5 / 21) - z)


def test_who_lacks_blanks_or_none_has_no_d_prime_and_equals_have_no_limits() -> None:
    assert table_of("sensitivity", study(felt([6]))).empty
    forced = study(felt([6], none_offered=False), blanks(3, none_offered=False))
    assert table_of("sensitivity", forced).empty
    other = study(felt([6]), felt([6], participant="2"), blanks(3, participant="2"))
    assert {*table_of("sensitivity", other)["participant"]} == {"2", "all"}
    same = [
        part
        for who in "ab"
        for part in (felt([9], [60.0], participant=who), blanks(2, participant=who))
    ]
    rows = table_of("sensitivity", study(*same)).query("participant == 'all' and level_vpp == 60")
    assert np.isfinite(rows["d_prime"]).all()
    assert rows[["d_prime_low", "d_prime_high"]].isna().all(axis=None)


def test_beside_a_difference_stand_false_alarms_and_d_prime_of_common_levels() -> None:
    trials = study(
        felt([6, 25], [60.0, 95.0], condition="a"),
        blanks(2, condition="a"),
        felt([20, 28], [95.0, 130.0], condition="b", block=2),
        blanks(5, condition="b", block=2),
        felt([9, 9], [60.0, 95.0], condition="a", participant="2"),
    )
    found = beside(trials, "1", "all")
    assert tuple(found.columns[3:]) == BESIDE_COLUMNS
    own = found.iloc[0]
    counts = own[["false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b"]].tolist()
    assert counts == [2, 20, 5, 20]
    assert own["d_prime_a"] == pytest.approx(norm.ppf(25.5 / 31) - norm.ppf(2.5 / 21))
    assert own["d_prime_b"] == pytest.approx(norm.ppf(20.5 / 31) - norm.ppf(5.5 / 21))
    assert found.iloc[1][["d_prime_a", "blanks_b"]].tolist() == [own["d_prime_a"], 20]
    assert found["first"].tolist() == ["a", "a 1"]


@pytest.mark.parametrize(
    ("a", "b", "numbered", "first"),
    [
        ([("01", 1)], [("01", 2)], True, "a"),
        ([("02", 1)], [("01", 9)], True, "b"),
        ([("01", 1), ("01", 3)], [("01", 2)], True, "alternated"),
        ([("01", 1)], [("01", 1)], True, "a"),
        ([("01", 1), ("01", 3)], [("01", 2)], False, "alternated"),
        ([("01", 1)], [("01", 2), ("02", 1)], False, "a"),
        ([("01", 1), ("01", 2)], [("01", 2)], False, None),  # a shared block hides the order
        ([("01", 1)], [("01", 1)], False, None),
    ],
)
def test_the_condition_that_was_over_first_is_named(
    a: list[Any], b: list[Any], *, numbered: bool, first: str | None
) -> None:
    parts = [
        felt([3], [60.0], condition=name, session=session, block=block)
        for name, held in (("a", a), ("b", b))
        for session, block in held
    ]
    found = beside(study(*parts), "1", "all", numbered=numbered)
    assert found["first"].tolist() == [first, first and f"{first} 1"]
    assert found["d_prime_a"].isna().all()
    mirrored = beside(study(*parts[::-1]), "1", numbered=numbered)
    assert mirrored["first"].tolist() == ["b" if a == b and numbered else first]


@pytest.mark.parametrize(
    ("run", "first"), [(1, "interleaved"), (3, "interleaved"), (4, "alternated")]
)
def test_conditions_are_interleaved_by_trials_and_alternate_by_blocks(run: int, first: str) -> None:
    trials = study(felt([10], [60.0], condition="a"), felt([10], [60.0], condition="b"))
    turn = np.arange(len(trials) // 2)
    of_a = turn // run * 2 * run + turn % run + 1
    trials["trial"] = [*of_a, *(of_a + run)]
    assert beside(trials, "1")["first"].tolist() == [first]


def test_d_prime_differs_by_a_paired_t_or_of_other_people_by_welchs() -> None:
    trials = two_conditions()
    found = beside(trials, *PEOPLE, "all").set_index("participant")
    a, b = (found.loc[[*PEOPLE], f"d_prime_{which}"].to_numpy() for which in "ab")
    assert found.loc[[*PEOPLE], DIFFERENCE[0]].tolist() == pytest.approx((b - a).tolist())
    limits = ttest_1samp(b - a, 0).confidence_interval()
    of_all: Any = found.loc["all"]
    assert of_all[DIFFERENCE].tolist() == pytest.approx([np.mean(b - a), *limits])
    own = table_of("sensitivity", trials).query("participant == '1' and level_vpp == 60")
    (a_at, a_high), (b_at, b_low) = (
        own.loc[own["condition"].eq(name), ["d_prime", end]].to_numpy()[0].tolist()
        for name, end in (("a", "d_prime_high"), ("b", "d_prime_low"))
    )
    low = b_at - a_at - math.hypot(b_at - b_low, a_high - a_at)
    assert found.loc["1", DIFFERENCE[1]] == pytest.approx(low)
    others = trials.assign(participant=trials["participant"] + trials["condition"])
    welch = ttest_ind(b, a, equal_var=False).confidence_interval()
    apart = beside(others, "all").iloc[0]
    assert apart[DIFFERENCE[1:]].tolist() == pytest.approx([*welch])


def test_d_prime_at_single_levels_has_the_same_limits() -> None:
    trials = two_conditions(95.0)
    found = table_of("d_prime_differences", trials)
    assert found["participant"].tolist() == ["1", "2", "3", "all"] * 2
    own = table_of("sensitivity", trials).query("level_vpp == 60 and participant != 'all'")
    a, b = (own.loc[own["condition"].eq(name), "d_prime"].to_numpy() for name in "ab")
    first, second = (row for _, row in found.query("participant == 'all'").iterrows())
    limits = [np.mean(b - a), *ttest_rel(b, a).confidence_interval()]
    assert first[DIFFERENCE].tolist() == pytest.approx(limits)
    assert first[["felt_a", "presented_a", "felt_b"]].tolist() == [27, 90, 63]
    assert (second[DIFFERENCE[0]], math.isnan(second[DIFFERENCE[1]])) == (0, True)  # all alike
    apart = table_of(
        "d_prime_differences",
        trials.assign(participant=trials["participant"] + trials["condition"]),
    )
    assert apart["participant"].tolist() == ["all"] * 2
    welch = ttest_ind(b, a, equal_var=False).confidence_interval()
    assert apart.iloc[0][DIFFERENCE[1:]].tolist() == pytest.approx([*welch])


def test_false_alarms_differ_by_a_paired_t_or_of_other_people_by_welchs() -> None:
    alarms, shown = [(1, 4), (0, 0), (6, 5), (2, 7)], [(20, 24), (12, 12), (30, 20), (20, 20)]
    shares = np.array(alarms) / np.array(shown)
    limits = ttest_rel(shares[:, 1], shares[:, 0]).confidence_interval()
    assert rates_apart(alarms, shown)[1:] == pytest.approx([*limits])
    assert math.isnan(rates_apart([(1, 4)], [(20, 20)])[1])
    rows = [("a", name, k, 40) for name, k in zip("123", (1, 6, 2), strict=True)]
    rows += [("b", name, k, 40) for name, k in zip("4567", (9, 3, 8, 8), strict=True)]
    table = pd.DataFrame(rows, columns=["condition", "participant", "felt", "presented"])
    total = table.groupby("condition", as_index=False).sum(numeric_only=True)
    blank = pd.concat([table, total.assign(participant="all")])
    blank = blank.assign(p=blank["felt"] / blank["presented"])
    found = beside(study(felt([3], [60.0], condition="a")), "all", blank=blank).iloc[0]
    a, b = (table.loc[table["condition"].eq(name), "felt"] / 40 for name in "ab")
    welch = ttest_ind(b, a, equal_var=False).confidence_interval()
    assert found[ALARMS].tolist() == pytest.approx([b.mean() - a.mean(), *welch])


def test_false_alarms_are_tested_within_people() -> None:
    """Of two people who each prefer another rate, the one pair of conditions is compared."""
    alone = np.array([[21, 22], [219, 218]])
    assert same_rates_p([(21, 22)], [(240, 240)]) == pytest.approx(fisher_exact(alone).pvalue)
    alarms, shown = [(1, 6), (0, 5), (14, 19)], [(20, 20), (30, 30), (20, 20)]
    rng = np.random.default_rng(1)
    drawn = sum(
        rng.hypergeometric(a + b, of[0] + of[1] - a - b, of[0], 100_000)
        for (a, b), of in zip(alarms, shown, strict=True)
    )
    number, times = np.unique(drawn, return_counts=True)
    rare = times[times <= times[number == 15]].sum() / 100_000
    assert same_rates_p(alarms, shown) == pytest.approx(rare, abs=0.001)
    many = np.array([[5000, 5200], [85_000, 84_800]])
    p = same_rates_p([(5000, 5200)], [(90_000, 90_000)])
    assert p == pytest.approx(fisher_exact(many).pvalue, rel=0.02)
