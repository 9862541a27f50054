"""d' and criterion by level and beside differences: values, laws, limits, of whom; the one test."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import fisher_exact, norm, ttest_1samp, ttest_ind, ttest_rel

from analysis.counts.sensitivity import BESIDE_COLUMNS, with_criterion, with_sensitivity
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
            trials_of
            for who, both in PEOPLE.items()
            for name, k in zip("ab", both, strict=True)
            for trials_of in (
                felt([k, *(29 for _ in others)], [60.0, *others], condition=name, participant=who),
                blanks(2, condition=name, participant=who),
            )
        )
    )


RATES = ("felt", "presented", "false_alarms", "blanks")
shares = st.integers(1, 60).flatmap(lambda of: st.tuples(st.integers(0, of), st.just(of)))


def sensitivity_of(hits: tuple[int, int], false: tuple[int, int]) -> Any:
    return with_sensitivity(pd.DataFrame([[*hits, *false]], columns=[*RATES])).iloc[0]


@pytest.mark.parametrize(
    ("hits", "false", "d_prime", "criterion"),
    [
        # Participants 1, 2 and 25 of M. Grund et al., J. Neurosci. 42 (2022) 643-656.
        ((91, 397), (1, 200), 1.695006918098493, 1.5866813322403461),
        ((171, 397), (0, 199), 2.6329619811422074, 1.4905527777727006),
        ((232, 399), (67, 199), 0.6243880687566047, 0.10710171866309363),
    ],
)
def test_published_counts_give_d_prime_and_criterion(
    hits: tuple[int, int], false: tuple[int, int], d_prime: float, criterion: float
) -> None:
    row = sensitivity_of(hits, false)
    assert (row["d_prime"], row["criterion"]) == pytest.approx((d_prime, criterion), abs=1e-12)


@pytest.mark.slow
@given(shares, shares)
def test_who_answers_yes_for_no_turns_the_criterion_only(
    hits: tuple[int, int], false: tuple[int, int]
) -> None:
    row = sensitivity_of(hits, false)
    turned = sensitivity_of(*((of - count, of) for count, of in (false, hits)))
    assert (turned["d_prime"], turned["criterion"]) == (row["d_prime"], -row["criterion"])
    assert -turned["criterion_high"] == pytest.approx(row["criterion_low"])
    for name in ("d_prime", "criterion"):
        assert row[f"{name}_low"] < row[name] < row[f"{name}_high"]
    equal = sensitivity_of(hits, hits)
    assert equal["d_prime"] == 0
    # The limits of d' and of twice the criterion differ by the sign of z(F) alone.
    mirrored = sensitivity_of(hits, (false[1] - false[0], false[1]))
    ends = [-2 * mirrored[f"criterion_{end}"] for end in ("high", "low")]
    assert ends == pytest.approx([row["d_prime_low"], row["d_prime_high"]])


def beside(
    trials: pd.DataFrame, *people: str, false_alarms: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Return what stands beside the differences of a and b."""
    alarms = false_alarms_of({}) if false_alarms is None else false_alarms
    rows = [{"condition_a": "a", "condition_b": "b", "participant": name} for name in people]
    return with_criterion(pd.DataFrame(rows), trials, table_of("sensitivity", trials), alarms)


def test_d_prime_is_the_difference_of_corrected_quantiles() -> None:
    table = table_of("sensitivity", study(felt([6, 25], [60.0, 95.0]), blanks(3)))
    rows = table[table["participant"].eq("1")]
    counts = ((6, 30), (25, 30), (31, 60))
    expected = [norm.ppf((k + 0.5) / (n + 1)) - norm.ppf(3.5 / 21) for k, n in counts]
    assert rows["d_prime"].tolist() == pytest.approx(expected, rel=1e-12)
    assert rows["level_vpp"].fillna(0).tolist() == [60.0, 95.0, 0]
    silent = felt([0], [60.0], n=10, missed="timeout")
    row = table_of("sensitivity", study(felt([10], [60.0], n=20), silent, blanks(2))).iloc[0]
    z = norm.ppf(2.5 / 21)
    assert row["d_prime"] == pytest.approx(norm.ppf(10.5 / 31) - z)
    assert row["d_prime_answered"] == pytest.approx(norm.ppf(10.5 / 21) - z)


def test_who_lacks_blanks_or_none_has_no_d_prime_and_equals_have_no_limits() -> None:
    assert table_of("sensitivity", study(felt([6]))).empty
    forced = study(felt([6], none_offered=False), blanks(3, none_offered=False))
    assert table_of("sensitivity", forced).empty
    second = study(felt([6]), felt([6], participant="2"), blanks(3, participant="2"))
    assert {*table_of("sensitivity", second)["participant"]} == {"2", "all"}
    same = [
        trials_of
        for who in "ab"
        for trials_of in (felt([9], [60.0], participant=who), blanks(2, participant=who))
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
    table = beside(trials, "1", "all")
    assert tuple(table.columns[3:]) == BESIDE_COLUMNS
    rows = table.iloc[0]
    counts = rows[["false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b"]].tolist()
    assert counts == [2, 20, 5, 20]
    assert rows["d_prime_a"] == pytest.approx(norm.ppf(25.5 / 31) - norm.ppf(2.5 / 21))
    assert rows["d_prime_b"] == pytest.approx(norm.ppf(20.5 / 31) - norm.ppf(5.5 / 21))
    assert table.iloc[1][["d_prime_a", "blanks_b"]].tolist() == [rows["d_prime_a"], 20]
    assert table["first"].tolist() == ["a", "a 1"]


def test_d_prime_differs_by_a_paired_t_or_of_other_people_by_welchs() -> None:
    trials = two_conditions()
    table = beside(trials, *PEOPLE, "all").set_index("participant")
    a, b = (table.loc[[*PEOPLE], f"d_prime_{which}"].to_numpy() for which in "ab")
    assert table.loc[[*PEOPLE], DIFFERENCE[0]].tolist() == pytest.approx((b - a).tolist())
    limits = ttest_1samp(b - a, 0).confidence_interval()
    of_all: Any = table.loc["all"]
    assert of_all[DIFFERENCE].tolist() == pytest.approx([np.mean(b - a), *limits])
    rows = table_of("sensitivity", trials).query("participant == '1' and level_vpp == 60")
    (a_at, a_high), (b_at, b_low) = (
        rows.loc[rows["condition"].eq(name), ["d_prime", end]].to_numpy()[0].tolist()
        for name, end in (("a", "d_prime_high"), ("b", "d_prime_low"))
    )
    low = b_at - a_at - math.hypot(b_at - b_low, a_high - a_at)
    assert table.loc["1", DIFFERENCE[1]] == pytest.approx(low)
    others = trials.assign(participant=trials["participant"] + trials["condition"])
    welch = ttest_ind(b, a, equal_var=False).confidence_interval()
    apart = beside(others, "all").iloc[0]
    assert apart[DIFFERENCE[1:]].tolist() == pytest.approx([*welch])


def test_d_prime_at_single_levels_has_the_same_limits() -> None:
    trials = two_conditions(95.0)
    table = table_of("d_prime_differences", trials)
    assert table["participant"].tolist() == ["1", "2", "3", "all"] * 2
    rows = table_of("sensitivity", trials).query("level_vpp == 60 and participant != 'all'")
    a, b = (rows.loc[rows["condition"].eq(name), "d_prime"].to_numpy() for name in "ab")
    first, second = (row for _, row in table.query("participant == 'all'").iterrows())
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


def test_over_all_levels_the_group_has_the_mean_of_its_people() -> None:
    trials = study(
        felt([6, 25], [60.0, 95.0]),
        blanks(3),
        felt([9], [60.0], participant="2", missed="right"),
        felt([12], [60.0], participant="3", missed="both"),
        blanks(1, participant="3"),
    )
    table = table_of("sensitivity", trials).query("level_vpp.isna()").set_index("participant")
    assert table[["felt", "presented"]].T.to_dict("list") == {
        "1": [31, 60],
        "3": [30, 30],
        "all": [61, 90],
    }
    for name in ("d_prime", "criterion"):
        assert table.loc["all", name] == pytest.approx(table.loc[["1", "3"], name].mean())
    limits = ttest_1samp(table.loc[["1", "3"], "criterion"], 0).confidence_interval()
    ends = table.loc["all", ["criterion_low", "criterion_high"]].tolist()
    assert ends == pytest.approx([*limits])


def false_alarms_of(counts: dict[tuple[str, str], tuple[int, int]]) -> pd.DataFrame:
    """Return the false alarms of condition and participant."""
    rows = [[*key, *value] for key, value in counts.items()]
    return pd.DataFrame(rows, columns=["condition", "participant", "felt", "presented"])


def test_one_exact_test_decides_whether_false_alarms_differ() -> None:
    """Twelve people: the interval by t leaves out 0, the exact test does not reject."""
    alarms = [(k, k + more) for k, more in zip([1, 0, 2, 1] * 3, [1, 0, 1, 1] * 3, strict=True)]
    keys = [(condition, str(who)) for who in range(12) for condition in "ab"]
    counts = dict(zip(keys, ((k, 30) for pair in alarms for k in pair), strict=True))
    people = [str(who) for who in range(12)]
    row = beside(two_conditions(), *people, "all", false_alarms=false_alarms_of(counts)).iloc[-1]
    low, high = ttest_rel(*(np.array(alarms).T / 30)[::-1]).confidence_interval()
    assert row[ALARMS[1:]].tolist() == pytest.approx([low, high])
    assert low > 0
    assert row["false_alarm_p"] > 0.05
    two = false_alarms_of({("a", "1"): (21, 240), ("b", "1"): (22, 240)})
    p = fisher_exact(np.array([[21, 22], [219, 218]])).pvalue
    assert beside(two_conditions(), "1", "all", false_alarms=two)["false_alarm_p"].iloc[-1] == (
        pytest.approx(p)
    )


def test_false_alarms_of_different_people_are_compared_by_welchs_t() -> None:
    of_a, of_b = (1, 6, 2), (9, 3, 8, 8)
    blanks = false_alarms_of(
        {("a", str(who)): (k, 40) for who, k in enumerate(of_a)}
        | {("b", str(who)): (k, 40) for who, k in enumerate(of_b, 5)}
    )
    row = beside(study(felt([3], [60.0], condition="a")), "all", false_alarms=blanks).iloc[0]
    a, b = np.array(of_a) / 40, np.array(of_b) / 40
    welch = ttest_ind(b, a, equal_var=False)
    assert row[ALARMS].tolist() == pytest.approx(
        [b.mean() - a.mean(), *welch.confidence_interval()]
    )
    assert row["false_alarm_p"] == pytest.approx(welch.pvalue)
