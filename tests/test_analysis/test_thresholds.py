"""Thresholds: each table's status and numbers, laws, published fits, misfit, recovery of truth."""

from __future__ import annotations

import math
import warnings
from dataclasses import astuple
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.special import log_ndtr

from analysis import Axis, GuessRate, PsychometricFit, fit_psychometric, probit_mle, threshold_table
from analysis import fit as notebook_fit
from analysis.thresholds.fit import fit_many
from analysis.thresholds.misfit import deviance_p
from benchmarks.calibration import psychometric
from tests.test_analysis.shared import FLASH, PAPER, QUANTA, SINGLE, SPEED, felt
from tests.test_analysis.tables import fit_counts, tables_at

WITH_THRESHOLD = ("ok", "lapse_at_bound", "separated")
BOUNDED = (
    *("threshold_below_levels", "threshold_above_levels"),
    *("median_below_levels", "median_above_levels"),
)
CENTRED = [70.0, 85.0, 100.0, 120.0, 145.0]
GOOD = [2, 14, 22, 28, 29]
tables = st.lists(st.integers(0, 30), min_size=5, max_size=5)
guess_rates = st.sampled_from([0.0, 1 / 3, 0.5])


def fit(detected: Any, x: Any = PAPER, n: int = 30, *, guess: Any = 0.0) -> PsychometricFit:
    return fit_psychometric(x, detected, [n] * len(detected), guess_rate=guess)


def linear(detected: Any, x: Any) -> PsychometricFit:
    n = [30] * len(detected)
    return fit_psychometric(x, detected, n, guess_rate=0.0, x_scale="linear")


def numbers(found: PsychometricFit) -> list[float]:
    _, threshold, limits, *others = astuple(found)
    return [threshold, *limits, *others]


@pytest.mark.parametrize("guess", [0.0, 0.5])
@pytest.mark.parametrize(
    ("detected", "expected"),
    [
        ([30] * 5, "threshold_below_levels"),
        ([0] * 5, "threshold_above_levels"),
        ([29, 24, 15, 6, 1], "decreasing"),
        ([30, 30, 10, 0, 0], "decreasing"),
        ([15] * 5, "flat"),
        ([15, 14, 16, 15, 15], "flat"),
        ([0, 0, 0, 30, 30], "separated"),
        ([0, 0, 9, 30, 30], "separated"),
        ([27, 30, 30, 30, 30], "median_below_levels"),
        ([2, 14, 24, 25, 25], "lapse_at_bound"),
        ([0, 1, 0, 3, 6], "median_above_levels"),
    ],
)
def test_every_table_has_its_status(guess: float, detected: list[int], expected: str) -> None:
    assert fit(detected, guess=guess).status == expected


def test_a_table_with_a_threshold_is_ok() -> None:
    found = fit(GOOD)
    assert found.status == "ok"
    assert all(math.isfinite(value) for value in numbers(found))
    low, high = found.threshold_limits
    assert 80 < low < found.threshold < high < 110
    assert linear([0, 15, 29], [0, 50, 100]).status == "ok"
    step = fit([0, 0, 30, 30, 30])  # which shows where, and not how steeply
    assert step.status == "separated"
    assert 95 < step.threshold_limits[0] < step.threshold < step.threshold_limits[1] < 130
    assert math.isnan(step.sigma + step.mle_sigma)
    for x, k, n in (([60], [3], [5]), ([60, 95], [3, 0], [5, 0]), ([60, 60], [3, 2], [5, 5])):
        assert fit_psychometric(x, k, n, guess_rate=0.0).status == "one_level"


def test_a_forced_choice_is_no_yes_no_task() -> None:
    """By quadrature over the prior: 101.2 V (83.8 to 117.3)."""
    levels, detected = [60, 80, 110, 150, 200], [15, 18, 24, 29, 30]
    forced, free = (fit(detected, levels, guess=guess) for guess in (0.5, 0.0))
    assert forced.threshold == pytest.approx(101.2, abs=0.5)
    assert forced.threshold_limits == pytest.approx((83.8, 117.3), abs=0.5)
    assert free.threshold == pytest.approx(63.8, abs=0.5)
    assert free.threshold_limits[0] == -math.inf


@pytest.mark.parametrize(
    ("detected", "status", "limits"),
    [
        ([30] * 5, "threshold_below_levels", (-math.inf, 60.0)),
        ([0] * 5, "threshold_above_levels", (200.0, math.inf)),
        ([25, 28, 30, 30, 30], "median_below_levels", (-math.inf, 68.0)),
    ],
)
def test_a_threshold_outside_the_levels_is_bounded(
    detected: list[int], status: str, limits: tuple[float, float]
) -> None:
    found = fit(detected, guess=0.5 if status == "median_below_levels" else 0.0)
    assert found.status == status
    assert found.threshold_limits == pytest.approx(limits, abs=0.5)


@pytest.mark.slow
@given(tables, guess_rates)
def test_only_tables_with_a_threshold_have_numbers(detected: list[int], guess: float) -> None:
    found = fit(detected, guess=guess)
    told = [value for value in numbers(found) if not math.isnan(value)]
    assert bool(told) == (found.status in WITH_THRESHOLD + BOUNDED)
    assert math.isfinite(found.threshold) == (found.status in WITH_THRESHOLD)
    for limit in found.threshold_limits:
        assert not PAPER[0] * (1 - 1e-12) > limit > -math.inf
        assert not PAPER[-1] * (1 + 1e-12) < limit < math.inf
    if found.status in WITH_THRESHOLD:
        assert found.threshold_limits[0] < found.threshold < found.threshold_limits[1]
        assert PAPER[0] <= found.threshold <= PAPER[-1]


def test_a_billion_trials_a_level_give_back_the_truth() -> None:
    p = psychometric(PAPER, threshold_vpp=100, sigma=0.1, guess_rate=0, lapse_rate=0.01)
    found = fit(np.round(1e9 * p), n=10**9)
    assert found.status == "ok"
    assert found.threshold == pytest.approx(100, abs=0.01)
    assert found.mle_threshold == pytest.approx(100, abs=1e-5)
    assert (found.mle_sigma, found.mle_lapse_rate) == pytest.approx((0.1, 0.01), abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize(("guess", "presented", "within_db"), [(0.0, 30, 0.06), (0.5, 120, 0.08)])
def test_limits_cover_their_threshold(guess: float, presented: int, within_db: float) -> None:
    """With 600 tables the covered share has a standard error of 0.9 %, the mean error 1/24 sd."""
    truth_vpp, studies = 98.0, 600
    p = psychometric(CENTRED, threshold_vpp=truth_vpp, sigma=0.1, guess_rate=guess, lapse_rate=0.02)
    k = np.random.default_rng(6).binomial(presented, p, (studies, 5))
    fits = fit_counts(np.log10(CENTRED), k, presented, guess)
    found = [one for one in fits if one.status in WITH_THRESHOLD]
    assert len(found) > 0.97 * studies
    covered = np.mean([low < truth_vpp < high for low, high in (f.threshold_limits for f in found)])
    assert covered == pytest.approx(0.95, abs=0.03)
    errors_db = 20 * np.log10(np.array([one.threshold for one in found]) / truth_vpp)
    assert errors_db.mean() == pytest.approx(0, abs=3 * errors_db.std() / 24 + within_db)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"x": [0.0, 95, 130]}, "levels"),
        ({"x": [-5.0, 95, 130]}, "levels"),
        ({"x": [60, 95, math.nan]}, "levels"),
        ({"x": [60, 95, math.inf]}, "levels"),
        ({"x": ["60", "95", "130"]}, "levels"),
        ({"x": [60, 95]}, "length"),
        ({"n": [10**13] * 3}, "presented"),
        ({"n": [3, 3, math.inf]}, "presented"),
        ({"k": [0] * 3, "n": [0] * 3}, "presented"),
        *(({"k": [k, 2, 3]}, "detected") for k in (4, -1, 0.5, math.nan)),
        *(({"guess": g}, "guess_rate") for g in (-0.1, 0.95, 1.0, math.nan, True, "0.5")),
        ({"x_scale": "ln"}, "x_scale"),
    ],
)
def test_other_tables_rates_and_axes_are_refused(changes: dict[str, Any], name: str) -> None:
    of: dict[str, Any] = {
        "x": [60, 95, 130],
        "k": [1, 2, 3],
        "n": [3] * 3,
        "guess": 0.0,
        "x_scale": "log10",
    }
    of |= changes
    with pytest.raises(ValueError, match=name):
        fit_psychometric(of["x"], of["k"], of["n"], guess_rate=of["guess"], x_scale=of["x_scale"])


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
    assert table_of(blanks("1", ["none"] * 30)).empty


def test_guess_rates_levels_axes_and_conditions_are_each_their_own() -> None:
    forced = table_of(person("1", [12, 17, 22, 29, 29], none_offered=False)).iloc[0]
    assert (forced["guess_rate"], forced["guess_basis"]) == (0.5, "forced choice")
    placed = person("2", [30, 30, 30])
    found = table_of(person("1", GOOD), placed[placed["level_vpp"] > 60])
    assert found["threshold_high_vpp"].iloc[1] <= 95  # only levels that were presented bound it
    both = table_of(person("1", GOOD), person("1", GOOD, condition="control plate"))
    assert both["condition"].tolist() == ["control plate", "main"]
    alone = table_of(person("1", GOOD))
    pd.testing.assert_frame_equal(both.iloc[1:].reset_index(drop=True), alone)
    linear = table_of(person("1", GOOD), axis=Axis(x_scale="linear")).iloc[0]
    assert math.isnan(linear["threshold_db"])
    assert 80 < linear["threshold_vpp"] < 120
    assert linear["sigma"] > 10


@pytest.mark.parametrize(
    ("detected", "status", "values"),
    [
        ([30] * 5, "threshold_below_levels", [math.nan, math.nan, 60.0]),
        ([25, 28, 30, 30, 30], "median_below_levels", [math.nan, math.nan, 68.2]),
        ([0] * 5, "threshold_above_levels", [math.nan, 200.0, math.nan]),
        ([0, 0, 0, 30, 30], "separated", [147.6, 137.5, 157.8]),
    ],
)
def test_limits_outside_the_levels_are_open(
    detected: list[int], status: str, values: list[float]
) -> None:
    row = table_of(person("1", detected, none_offered=False)).iloc[0]
    assert row["status"] == status
    names = ["threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"]
    assert row[names].tolist() == pytest.approx(values, abs=0.1, nan_ok=True)


# x, detected, presented; mu, sigma and deviance by statsmodels 0.14 and 40-digit arithmetic, which
# agree.
PUBLISHED: list[tuple[Any, list[int], Any, float, float, float]] = [
    (np.log(QUANTA["SH/R1"]), [0, 3, 12, 26, 35, 35], 35,
     4.874159236599045, 0.37444493924413164, 2.7810146983896575),
    (np.log(QUANTA["SS/R1"]), [0, 2, 9, 27, 47, 50], 50,
     4.415424322678962, 0.38695327096225235, 2.366426691834527),
    (np.log(QUANTA["MHP/R1"]), [3, 3, 12, 33, 44, 50], 50,
     4.766049454525097, 0.5261396242499573, 8.139545888880319),
    (FLASH, [0, 0, 0, 2, 2, 2, 2, 3, 4, 18], [3, 3, 5, 13, 10, 20, 14, 11, 5, 20],
     0.9458634718178631, 0.3384550465993306, 6.606213787201392),
    (SPEED, [15, 41, 88, 196, 265, 312, 338], 360,
     8.561165514905884, 4.361884745009525, 9.366203174465305),
    (SPEED, [40, 54, 118, 165, 257, 301, 334], 360,
     8.410582261709207, 5.307713589287506, 10.564642504510195),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize(("x", "detected", "presented", "mu", "sigma", "deviance"), PUBLISHED)
def test_the_fit_is_that_of_an_independent_implementation(
    x: Any, detected: list[int], presented: Any, mu: float, sigma: float, deviance: float
) -> None:
    fit = probit_mle(x, detected, np.broadcast_to(presented, len(detected)))
    assert (fit.mu, fit.sigma, fit.deviance) == pytest.approx((mu, sigma, deviance), rel=1e-11)


def fit_or_skip(detected: list[int]) -> Any:
    try:
        fit = probit_mle(PAPER, detected, [30] * 5)
    except ValueError:  # no likeliest function, or one that falls
        assume(condition=False)
    assume(fit.sigma < 1e5)
    return fit


@pytest.mark.slow
@given(tables)
def test_the_score_is_zero_at_the_fit(detected: list[int]) -> None:
    fit = fit_or_skip(detected)
    z = (np.array(PAPER) - fit.mu) / fit.sigma
    log_density = -z * z / 2 - math.log(2 * math.pi) / 2
    felt, missed = (np.exp(log_density - log_ndtr(side)) for side in (z, -z))
    score = np.array(detected) * felt - (30 - np.array(detected)) * missed
    assert score.sum() == pytest.approx(0, abs=1e-9)
    assert (score * z).sum() == pytest.approx(0, abs=1e-9 * (1 + np.abs(z).max()) ** 2)


@pytest.mark.slow
@given(tables, st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.permutations(range(5)))
def test_fits_shift_scale_and_mirror_with_the_axis(
    detected: list[int], shift: float, by: float, order: list[int]
) -> None:
    here = fit_or_skip(detected)
    there = probit_mle(np.array(PAPER) * by + shift, detected, [30] * 5)
    size = by * (abs(here.mu) + here.sigma) + abs(shift)
    assert there.mu == pytest.approx(here.mu * by + shift, abs=1e-8 * size)
    assert there.sigma == pytest.approx(here.sigma * by, rel=1e-7)
    assert there.deviance == pytest.approx(here.deviance, abs=1e-8)
    mirrored = probit_mle([-x for x in PAPER], [30 - k for k in detected], [30] * 5)
    assert (-mirrored.mu, mirrored.sigma) == pytest.approx((here.mu, here.sigma), rel=1e-9)
    split = [
        (PAPER[i], part, 15)
        for i in order
        for part in (min(detected[i], 15), max(detected[i] - 15, 0))
    ]
    assert probit_mle(*zip(*split, (1e9, 0, 0), strict=True)) == here


@pytest.mark.parametrize(
    ("levels", "detected", "presented", "name"),
    [
        *((PAPER, k, [30] * 5, "detected") for k in (
            [30] * 5, [0] * 5, [0, 0, 0, 30, 30], [0, 0, 9, 30, 30], [15] * 5, [27] * 5,
            [29, 24, 15, 6, 1], [30, 30, 15, 0, 0], [31, 0, 0, 0, 0], [-1, 0, 0, 0, 0],
            [1.5, 0, 0, 0, 0], [math.nan, 0, 0, 0, 0], [True] * 5,
        )),
        ([0.1, 0.2, 0.3], [26, 27, 26], [30] * 3, "detected"),
        (PAPER, [1, 2, 3, 4, 5], [30, 0, 0, 0, 0], "presented"),
        (PAPER, [1, 0, 0, 0, 0], [30, 0, 0, 0, 0], "two"),
        ([60, 60], [3, 4], [30] * 2, "two"),
        (PAPER, [0] * 5, [0] * 5, "presented"),
        *((x, [1, 2, 3, 4, 5], [30] * 5, "x") for x in (
            [*map(str, PAPER)], [*PAPER[:4], math.nan], [*PAPER[:4], math.inf], PAPER[:4],
        )),
        ([PAPER], [[1, 2, 3, 4, 5]], [[30] * 5], "x"),
    ],
)  # fmt: skip # rows of a table
def test_tables_without_a_likeliest_increasing_function_are_refused(
    levels: Any, detected: Any, presented: Any, name: str
) -> None:
    with pytest.raises(ValueError, match=name):
        probit_mle(levels, detected, presented)


LEVELS = [60.0, 85.0, 110.0, 140.0, 200.0]


def deviance_ps(k: Any, n: Any, guess: float, seed: int) -> np.ndarray[Any, Any]:
    tables = tables_at(np.log10(LEVELS), k, n, guess)
    fits = fit_many(tables, likeliest=True)
    return np.array([deviance_p(fit, tables, row, seed) for row, fit in enumerate(fits)])


@pytest.mark.slow
@pytest.mark.parametrize("guess", [0.0, 0.5])
def test_p_is_uniform_under_the_model(guess: float) -> None:
    """Of 400 values, the share below 0.05, 0.25, 0.5 has a standard error of at most 2.5 %."""
    p = psychometric(LEVELS, threshold_vpp=105, sigma=0.12, guess_rate=guess, lapse_rate=0.02)
    k = np.random.default_rng(1).binomial(30, p, (400, 5)).astype(float)
    values = deviance_ps(k, 30, guess, 2)
    assert ((values > 0) & (values <= 1)).all()
    for share, sd in ((0.05, 0.011), (0.25, 0.022), (0.5, 0.025)):
        assert (values <= share).mean() == pytest.approx(share, abs=3.5 * sd)


def test_p_of_a_misfit_is_the_least_and_depends_on_the_seed_alone() -> None:
    k = np.array([[2.0, 25, 6, 28, 29], [1, 10, 15, 28, 28], [5, 10, 20, 25, 30]])
    values = deviance_ps(k, 30, 0.0, 5).tolist()
    assert values[0] == pytest.approx(1 / 500)
    assert deviance_ps(k[::-1], 30, 0.0, 5).tolist() == values[::-1]
    assert deviance_ps(k, 30, 0.0, 6).tolist() != values


@pytest.mark.slow
def test_the_table_of_a_notebook_has_the_thresholds_of_its_people() -> None:
    names = ("participant", "level", "k", "n")
    rows = [(who, x, k, 30) for who in "ab" for x, k in zip(PAPER, GOOD, strict=True)]
    columns: Any = {"level": "level", "detected": "k", "presented": "n", "guess_rate": 0.05}
    found = notebook_fit(pd.DataFrame(rows, columns=names), participant="participant", **columns)
    one = fit_psychometric(PAPER, GOOD, [30] * 5, guess_rate=0.05)
    assert found.people["threshold"].tolist() == pytest.approx([one.threshold] * 2, rel=1e-3)
    assert found.groups["participants"].tolist() == [2]
    assert str(found).count("ok") == 3
    half = (1 + one.guess_rate - one.lapse_rate) / 2
    at = found.threshold_at(half)
    assert at["participant"].tolist() == ["a", "b", "all"]
    assert at["level"].iloc[0] == pytest.approx(one.threshold, rel=0.03)
    higher = found.threshold_at(0.75)
    assert (higher["level"] > at["level"]).all()
    people = higher[:2]
    assert ((people["low"] < people["level"]) & (people["level"] < people["high"])).all()
    assert found.threshold_at(0.01)["level"].isna().all()
    assert len(found.plot().lines) > 4
    for options, name in (
        ({"level": "volts"}, "columns"),
        ({"function": "cauchy"}, "function"),
        ({"function": "weibull", "x_scale": "linear"}, "gumbel"),
    ):
        with pytest.raises(ValueError, match=name):
            notebook_fit(pd.DataFrame(rows, columns=names), **(columns | options))


def test_levels_in_db_give_the_threshold_of_their_amplitudes() -> None:
    of_levels = fit_psychometric(PAPER, GOOD, [30] * 5, guess_rate=0.05)
    in_db = fit_psychometric(20 * np.log10(PAPER), GOOD, [30] * 5, guess_rate=0.05, x_scale="dB")
    assert in_db.threshold == pytest.approx(20 * np.log10(of_levels.threshold), abs=1e-9)
    assert in_db.sigma == pytest.approx(20 * of_levels.sigma, rel=1e-9)


@pytest.mark.slow
def test_the_level_of_a_group_is_that_of_its_typical_participant() -> None:
    """Steep functions 12 dB apart: their mean is flat, but nobody's is."""
    levels = np.geomspace(20.0, 400.0, 12)
    thresholds = [50.0, 70.0, 100.0, 140.0, 200.0]
    rows = [
        (who, level, round(60 * float(p)), 60)
        for who, threshold in enumerate(thresholds)
        for level, p in zip(
            levels,
            psychometric(levels, threshold_vpp=threshold, sigma=0.06, guess_rate=0, lapse_rate=0),
            strict=True,
        )
    ]
    frame = pd.DataFrame(rows, columns=["who", "level", "k", "n"])
    names: Any = {"level": "level", "detected": "k", "presented": "n", "participant": "who"}
    higher = notebook_fit(frame, **names, guess_rate=0.0).threshold_at(0.85)["level"]
    assert higher.iloc[-1] == pytest.approx(np.exp(np.log(higher[:-1]).mean()), rel=0.03)


def test_a_notebooks_table_without_a_name_or_a_count_is_refused_in_one_line() -> None:
    frame = pd.DataFrame({"who": "a", "level": PAPER, "k": GOOD, "n": 30})
    columns: Any = {"level": "level", "detected": "k", "presented": "n", "guess_rate": 0.05}
    for wrong, name in (
        (frame.assign(who=pd.Series(["a"] * 4)), "'who' must hold a name"),
        (frame.assign(who=["all"] * 5), "'who' must not hold"),
        (frame.assign(k=[1.5] * 5), "detected must be whole numbers"),
        (frame.assign(k=31), "detected must be at most presented"),
        (frame.assign(level=[math.nan] * 5), "finite"),
        (pd.concat([frame, frame["k"]], axis=1), "each once"),
    ):
        with pytest.raises(ValueError, match=name) as refusal:
            notebook_fit(wrong, participant="who", **columns)
        assert "\n" not in str(refusal.value)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "sigmoid"), [("normal", "norm"), ("logistic", "logistic"), ("weibull", "gumbel")]
)
def test_functions_lie_where_psignifit_has_them(function: Any, sigmoid: str) -> None:
    """Its priors of the width and of the lapse rate are other ones, and its limits wider."""
    psignifit = pytest.importorskip("psignifit")
    data = np.column_stack([np.log10(PAPER), GOOD, [30] * 5])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = psignifit.psignifit(
            data, experiment_type="yes/no", sigmoid=sigmoid, fixed_parameters={"gamma": 0.03}
        )
    ours = fit_psychometric(PAPER, GOOD, [30] * 5, guess_rate=0.03, function=function)
    mean = 10 ** theirs.get_parameter_estimate("mean")["threshold"]
    low, high = ours.threshold_limits
    assert ours.threshold == pytest.approx(mean, abs=0.2 * (high - low))
