"""People who are named: swapped sides, guesses, drift; and the honest, who are not."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import fisher_exact

from analysis.answers.doubts import doubtful, doubtful_counts, hypergeometric_tails
from analysis.answers.drift import drift_p, drift_steps
from analysis.axis import VOLTS, Axis
from benchmarks.people import DESIGNS, HONEST, sessions_of
from tests.test_analysis.shared import put, run

if TYPE_CHECKING:
    from pathlib import Path

LINEAR = Axis(x_scale="linear", unit="mm/s")


def trials(sides: Any, answers: Any, **columns: Any) -> pd.DataFrame:
    """Return single stimuli that count, or blanks where the side is none."""
    side = np.array(sides)
    return pd.DataFrame(
        {
            "participant": "1", "condition": "main", "session": "01", "trial": range(len(sides)),
            "kind": np.where(side == "none", "blank", "single"), "side": side, "level_vpp": 60.0,
            "response": answers, "reason": "", "none_offered": False,
        } | columns
    )  # fmt: skip


def named(table: pd.DataFrame, axis: Axis = VOLTS) -> list[str]:
    return list(map(str, doubtful(table, axis)))


@pytest.mark.parametrize(
    "table", [[[3, 9], [8, 2]], [[0, 5], [5, 0]], [[40, 35], [30, 45]], [[6, 0], [9, 0]]]
)
def test_tails_are_those_of_fishers_test(table: list[list[int]]) -> None:
    found = hypergeometric_tails(np.array(table))
    wanted = [fisher_exact(np.array(table), alternative=one).pvalue for one in ("less", "greater")]
    assert found == pytest.approx(wanted, rel=1e-12)


def test_one_of_21_people_of_a_public_study_is_named() -> None:
    sides, answers = ["left", "right"] * 384, ["right", "left"] * 376 + ["left", "right"] * 8
    (words,) = named(trials(sides, answers, participant="سمر, x"))
    assert words.startswith("participant سمر, x: the side was right in 16 of 768 left or right")
    assert "keys or actuators swapped? Nothing was turned around" in words


def test_who_always_answers_the_rarer_side_has_not_swapped_them() -> None:
    (words,) = named(trials(["left"] * 90 + ["right"] * 30, ["right"] * 120))
    assert "cannot be told from guessing at any level (the side was right in 30 of 120" in words


@pytest.mark.parametrize(("right", "why"), [(17, "sides swapped"), (22, "levels too low")])
def test_fewer_right_than_by_chance_is_no_matter_of_the_levels(right: int, why: str) -> None:
    own = [("left", "left"), ("right", "right")] * right
    other = [("left", "right"), ("right", "left")] * (50 - right)
    pairs = np.random.default_rng(1).permutation([*own, *other])  # in another order it is a drift
    sides, answers = pairs.T
    (words,) = named(trials(sides, answers))
    assert f"right in {2 * right} of 100 left or right answers" in words
    assert ("fewer than by chance, p = 1e-3" in words) == (right == 17)
    assert f"): {why}, " in words
    table = pd.DataFrame({"condition": "main", "participant": "a", "level_vpp": [60.0, 90.0]})
    counts = table.assign(detected=[right, right + 1], presented=50, none_offered=False)
    (words,) = map(str, doubtful_counts(counts, None, 2))
    assert f"): {why}, " in words


def test_guesses_are_told_by_one_level_and_by_blanks() -> None:
    sides = ["left", "right"] * 50
    guesses = ["left"] * 50 + ["right"] * 50
    (words,) = named(trials(sides, guesses))
    assert words.startswith("participant 1: answers cannot be told from guessing at any level")
    level_vpp = np.repeat([60.0, 90.0], [80, 20])
    assert (
        named(trials(sides, [*guesses[:40], *guesses[50:90], *sides[80:]], level_vpp=level_vpp))
        == []
    )
    with_blanks = [*sides, *["none"] * 40]
    felt = trials(with_blanks, [*guesses, *["none"] * 40], none_offered=True)
    assert named(felt) == []
    alike = trials(with_blanks, [*guesses, *["left"] * 40], none_offered=True)
    (words,) = named(alike)
    assert "something felt in 100 of 100 single stimuli and in 40 of 40 blanks" in words


def test_a_yes_at_one_side_without_blanks_tells_nothing_of_guesses() -> None:
    yes = ["left", "none"] * 50
    assert named(trials(["left"] * 100, yes, none_offered=True)) == []
    (words,) = named(trials(["left"] * 100, ["left", "right"] * 50))
    assert "(50 of 100 answers were right)" in words


@pytest.mark.parametrize("table", [[[300_100, 299_900], [199_700, 200_300]]])
def test_very_large_tables_have_the_normal_tail(table: list[list[int]]) -> None:
    below, above = hypergeometric_tails(np.array(table))
    assert below + above == pytest.approx(1.0, abs=0.01)
    wanted = fisher_exact(np.array(table), alternative="greater").pvalue
    assert above == pytest.approx(wanted, rel=1e-4)


def test_counts_of_a_forced_choice_tell_guesses_and_swapped_answers() -> None:
    table = pd.DataFrame({"condition": "main", "level_vpp": [60.0, 90.0] * 3, "presented": 30})
    counts = table.assign(
        participant=list("aabbcc"), detected=[15, 17, 2, 1, 20, 29], none_offered=False
    )
    swapped, guessing = map(str, doubtful_counts(counts, None, 2))
    assert swapped.startswith("participant b: 3 of 60 answers were right")
    assert guessing.startswith("participant a: answers cannot be told from guessing")
    yes = counts.assign(none_offered=True)
    assert list(doubtful_counts(yes, None, 2)) == []
    blanks = pd.DataFrame(
        {"condition": "main", "participant": list("abc"), "felt": [9, 1, 1], "presented": 20}
    )
    (words,) = [one for one in map(str, doubtful_counts(yes, blanks, 2)) if "participant a" in one]
    assert "felt in 32 of 60 single stimuli and in 9 of 20 blanks" in words


def test_conditions_are_named_where_there_are_several() -> None:
    sides = ["left", "right"] * 40
    guesses = ["left"] * 40 + ["right"] * 40
    both = pd.concat(
        [trials(sides, guesses, condition="b"), trials(sides, sides, condition="a")]
    ).assign(trial=range(160))
    (words,) = named(both)
    assert words.startswith("participant 1, condition b: ")


def test_the_drift_s_probability_is_that_of_random_orders() -> None:
    rng = np.random.default_rng(3)
    level_vpp = np.repeat([60.0, 70.0, 80.0], 40)[rng.permutation(120)]
    hit = rng.random(120) < 0.2 + (level_vpp - 60) / 40 + np.linspace(0.12, -0.12, 120)
    table = trials(["left"] * 120, np.where(hit, "left", "none"), level_vpp=level_vpp)
    p = drift_p(table)[0][0]
    t, score = np.arange(120.0), []
    for draw in range(4001):
        y = hit.astype(float)
        for level in (60.0, 70.0, 80.0):
            rows = np.flatnonzero(level_vpp == level)
            y[rows] = rng.permutation(y[rows]) if draw else y[rows]
        score.append(
            sum(
                ((t - t[m].mean()) * y)[m].sum()
                for m in (level_vpp == v for v in (60.0, 70.0, 80.0))
            )
        )
    beyond = np.mean(np.abs(score) >= abs(score[0]))
    assert 0.01 < p < 0.5
    assert p == pytest.approx(beyond, abs=0.03)


@pytest.mark.parametrize(("axis", "step"), [(VOLTS, 1.0), (LINEAR, None)])
def test_a_drift_is_found_again(axis: Axis, step: float | None) -> None:
    rng = np.random.default_rng(1)
    x = np.linspace(-8.0, 8.0, 9)[rng.integers(0, 9, 3000)]  # steps about the threshold
    course = 6.0 * np.linspace(-0.5, 0.5, 3000)
    hit = rng.normal(size=3000) * 2.0 < x - course
    level_vpp = 60.0 * 10 ** (x / 20) if step else 10 * x
    sides = np.where(rng.random(3000) < 0.5, "left", "right")
    table = trials(sides, np.where(hit, sides, "none"), level_vpp=level_vpp, none_offered=True)
    wanted = 6.0 if step else 3.0  # an eighth of the range of 160 is 20, two of these steps
    assert drift_steps(table, axis, 2) == pytest.approx(wanted, rel=0.1)
    (words,) = named(table, axis)
    assert words.startswith("participant 1, session 01: ")
    assert "of 1500 single stimuli detected in the first half" in words
    moved = re.search(r"as if the threshold rose by ([0-9.]+) (dB|mm/s) from the first", words)
    assert moved is not None
    assert float(moved[1]) == pytest.approx(6.0 if step else 60.0, rel=0.1)


def test_a_drift_of_blocks_of_conditions_is_told_within_them() -> None:
    """The second condition is harder: that is no drift, and no part of its size."""
    rng = np.random.default_rng(3)
    parts = []
    for at, name in enumerate(("warm", "cold")):
        x = np.linspace(-8.0, 8.0, 9)[rng.integers(0, 9, 2000)]
        course = 6.0 * np.linspace(-0.5, 0.5, 2000) + 4.0 * at
        felt_it = rng.normal(size=2000) * 2.0 < x - course
        one = trials(
            ["left"] * 2000, np.where(felt_it, "left", "none"), level_vpp=60.0 * 10 ** (x / 20)
        )
        parts.append(one.assign(condition=name, trial=np.arange(2000) + 2000 * at))
    table = pd.concat(parts, ignore_index=True).assign(none_offered=True)
    (words,) = named(table, VOLTS)
    firsts, seconds = 0, 0
    for one in parts:
        hit = one["response"].eq("left").to_numpy()
        firsts, seconds = firsts + hit[:1000].sum(), seconds + hit[1000:].sum()
    assert (
        f"{firsts} of 2000 single stimuli detected in the first halves of its conditions, {seconds}"
        " of 2000 in the second" in words
    )
    moved = re.search(r"rose by ([0-9.]+) dB from a condition's first trial to its last", words)
    assert moved is not None
    assert float(moved[1]) == pytest.approx(6.0, rel=0.1)


def test_one_level_tells_a_drift_but_not_of_how_much_and_a_person_once() -> None:
    hit = np.array([True] * 60 + [False] * 60)
    first = trials(["left"] * 120, np.where(hit, "left", "none"), none_offered=True)
    both = pd.concat([first, first.assign(session="02")])
    (words,) = [one for one in named(both) if "session" in one]
    assert words == (
        "participant 1, session 01: 60 of 60 single stimuli detected in the first half, 0 of 60 in "
        "the second (p = 3e-21; so in 02): tired, adapted, out of practice, or a finger "
        "moved? A threshold is the mean over its trials"
    )


def test_neither_order_nor_sides_change_who_is_named() -> None:
    table = sessions_of(HONEST, DESIGNS[3], 5, seed=9)
    table.loc[table["participant"].eq("0002"), "response"] = "left"
    told = named(table)
    assert [one.split(":")[0] for one in told] == ["participant 0002"]
    assert named(table.sample(frac=1, random_state=1)) == told
    other = {"left": "right", "right": "left"}
    turned = table.assign(**{name: table[name].replace(other) for name in ("side", "response")})
    assert named(turned) == told


@pytest.mark.slow
def test_of_a_hundred_honest_people_nobody_is_named() -> None:
    assert named(sessions_of(HONEST, DESIGNS[2], 100)) == []


@pytest.mark.slow
def test_a_warning_reaches_summary_report_and_terminal(tmp_path: Path) -> None:
    rows = "".join(
        f"{who},{side},{level},{side if who == 'b' else other}\n"
        for who in "ab"
        for level in (60, 90)
        for side, other in (("left", "right"), ("right", "left")) * 10
    )
    table = put(tmp_path / "t.csv", "participant,side,level_vpp,response\n" + rows)
    map_toml = put(tmp_path / "map.toml", 'task = "forced choice"\n')
    found = run(
        "analyze",
        table,
        "--columns",
        map_toml,
        "--out",
        tmp_path / "out",
        "--strict",
        "--no-figures",
    )
    assert found.exit_code == 1
    words = "participant a: the side was right in 0 of 40"
    assert words in " ".join(found.output.split())
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert sum(words in one for one in summary["warnings"]) == 1
    assert words in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
