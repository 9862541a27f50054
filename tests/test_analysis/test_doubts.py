"""People who are named: reversed sides, guesses, drift; and the honest, who are not."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import fisher_exact

from analysis import Axis
from analysis.answers.doubts import doubtful, doubtful_counts, hypergeometric_tails
from tests.test_analysis.shared import put, run
from tests.test_analysis.tables import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from analysis.answers.doubts import Doubt

MIRROR = {"left": "right", "right": "left"}
SIDES = ["left", "right"] * 50
GUESSES = ["left"] * 50 + ["right"] * 50


def trials(sides: Any, answers: Any, **columns: Any) -> pd.DataFrame:
    """Return single stimuli that count, or blanks where the side is none."""
    kinds = ["blank" if side == "none" else "single" for side in sides]
    table = pd.DataFrame({"side": sides, "kind": kinds, "response": answers})
    same: dict[str, Any] = {"participant": "1", "condition": "main", "session": "01"}
    same["trial"] = range(len(sides))
    return table.assign(**same | {"level_vpp": 60.0, "reason": "", "none_offered": False} | columns)


def kinds(found: Iterable[Doubt]) -> list[tuple[str, str, str]]:
    return [(one.kind, one.participant, one.condition) for one in found]


def named(table: pd.DataFrame, axis: Axis | None = None) -> list[Doubt]:
    return [*doubtful(table, axis or Axis())]


@pytest.mark.parametrize(
    ("table", "rel"),
    [
        ([[3, 9], [8, 2]], 1e-12),
        ([[0, 5], [5, 0]], 1e-12),
        ([[40, 35], [30, 45]], 1e-12),
        ([[6, 0], [9, 0]], 1e-12),
        ([[300_100, 299_900], [199_700, 200_300]], 2e-3),  # the normal distribution's tails
    ],
)
def test_tails_are_those_of_fishers_test(table: list[list[int]], rel: float) -> None:
    counts = np.array(table)
    expected = [fisher_exact(counts, alternative=one).pvalue for one in ("less", "greater")]
    assert hypergeometric_tails(counts) == pytest.approx(expected, rel=rel)


@pytest.mark.parametrize(
    ("sides", "answers", "columns", "kind", "counts"),
    [
        # As one of 21 people of a public study.
        (["left", "right"] * 384, ["right", "left"] * 376 + ["left", "right"] * 8, {},
         "swapped", [16, 768]),
        # Who always answers the rarer side has not reversed them.
        (["left"] * 90 + ["right"] * 30, ["right"] * 120, {}, "guessing", [30, 120]),
        (SIDES, GUESSES, {}, "guessing", [50, 100]),
        (["left"] * 100, ["left", "right"] * 50, {}, "guessing", [50, 100]),
        # One level of several that is felt is enough, and so are blanks that are not.
        (SIDES, [*GUESSES[:40], *GUESSES[50:90], *SIDES[80:]],
         {"level_vpp": np.repeat([60.0, 90.0], [80, 20])}, None, []),
        ([*SIDES, *["none"] * 40], [*GUESSES, *["none"] * 40], {"none_offered": True}, None, []),
        ([*SIDES, *["none"] * 40], [*GUESSES, *["left"] * 40], {"none_offered": True},
         "guessing", [50, 100, 100, 100, 40, 40]),
        # Yes at one side without blanks shows nothing of guesses.
        (["left"] * 100, ["left", "none"] * 50, {"none_offered": True}, None, []),
    ],
)  # fmt: skip # rows of a table
def test_who_is_named_and_by_which_counts(
    sides: Any, answers: Any, columns: Any, kind: str | None, counts: list[int]
) -> None:
    found = named(trials(sides, answers, participant="سمر, x", **columns))
    where = "main" if kind == "guessing" else ""
    assert kinds(found) == ([(kind, "سمر, x", where)] if kind else [])
    assert not found or numbers(found[0].words)[: len(counts)] == counts


@pytest.mark.parametrize(("right", "fewer"), [(17, True), (22, False)])
def test_fewer_right_than_by_chance_has_its_p(*, right: int, fewer: bool) -> None:
    own = [("left", "left"), ("right", "right")] * right
    other = [("left", "right"), ("right", "left")] * (50 - right)
    pairs = np.random.default_rng(1).permutation([*own, *other])  # in another order it is a drift
    (doubt,) = named(trials(*pairs.T))
    assert numbers(doubt.words)[1:3] == [2 * right, 100]
    assert ("p = 1e-3" in doubt.words) == fewer
    table = pd.DataFrame({"condition": "main", "participant": "a", "level_vpp": [60.0, 90.0]})
    counts = table.assign(detected=[right, right + 1], presented=50, none_offered=False)
    assert kinds(doubtful_counts(counts, None, 2)) == [("guessing", "a", "main")]


def test_counts_of_a_forced_choice_show_guesses_and_reversed_answers() -> None:
    table = pd.DataFrame({"condition": "main", "level_vpp": [60.0, 90.0] * 3, "presented": 30})
    counts = table.assign(
        participant=list("aabbcc"), detected=[15, 17, 2, 1, 20, 29], none_offered=False
    )
    found = [*doubtful_counts(counts, None, 2)]
    assert kinds(found) == [("swapped", "b", ""), ("guessing", "a", "main")]
    assert numbers(found[0].words)[:2] == [3, 60]
    yes = counts.assign(none_offered=True)
    assert not [*doubtful_counts(yes, None, 2)]
    blanks = pd.DataFrame({"participant": list("abc"), "felt": [9, 1, 1], "presented": 20})
    found = [*doubtful_counts(yes, blanks.assign(condition="main"), 2)]
    assert [numbers(one.words) for one in found if one.participant == "a"] == [[32, 60, 9, 20]]


@pytest.mark.parametrize(
    ("axis", "conditions"),
    [(Axis(), 1), (Axis(x_scale="linear", unit="mm/s"), 1), (Axis(), 2)],
)
def test_a_drift_is_found_again_within_each_condition(axis: Axis, conditions: int) -> None:
    """The second condition is harder: that is no drift, and no part of its size."""
    rng, number, parts = np.random.default_rng(1), 3000, []
    for at in range(conditions):
        x = np.linspace(-8.0, 8.0, 9)[rng.integers(0, 9, number)]  # steps about the threshold
        course = 6.0 * np.linspace(-0.5, 0.5, number) + 4.0 * at
        answers = np.where(rng.normal(size=number) * 2.0 < x - course, "left", "none")
        level = 60.0 * 10 ** (x / 20) if axis.is_logarithmic else 10 * x
        one = trials(["left"] * number, answers, level_vpp=level, condition=f"c{at}")
        parts.append(one.assign(trial=np.arange(number) + number * at, none_offered=True))
    (doubt,) = named(pd.concat(parts, ignore_index=True), axis)
    assert (doubt.kind, doubt.participant) == ("drifting", "1")
    halves = [np.array_split(one["response"].eq("left"), 2) for one in parts]
    first, second = (sum(int(half[i].sum()) for half in halves) for i in (0, 1))
    values = numbers(doubt.words)
    of = number * conditions // 2
    assert values[2:6] == [first, of, second, of]
    moved = 6.0 if axis.is_logarithmic else 60.0
    assert values[6] == pytest.approx(moved, rel=0.1)


def test_a_drift_is_named_by_its_p_and_once() -> None:
    """A drift is named at p < 0.001; of a weaker one nobody is."""
    rng = np.random.default_rng(3)
    level_vpp = np.repeat([60.0, 70.0, 80.0], 40)[rng.permutation(120)]
    hit = rng.random(120) < 0.2 + (level_vpp - 60) / 40 + np.linspace(0.12, -0.12, 120)
    table = trials(["left"] * 120, np.where(hit, "left", "none"), level_vpp=level_vpp)
    assert not named(table.assign(none_offered=True))
    hit = np.array([True] * 60 + [False] * 60)
    first = trials(["left"] * 120, np.where(hit, "left", "none"), none_offered=True)
    found = named(pd.concat([first, first.assign(session="02")]))
    (doubt,) = [one for one in found if one.kind == "drifting"]  # once for both sessions
    assert numbers(doubt.words)[2:6] == [60, 60, 0, 60]
    assert "p = 3e-21" in doubt.words


@pytest.mark.slow
def test_a_warning_reaches_summary_report_and_terminal(tmp_path: Path) -> None:
    rows = "".join(
        f"{who},{side},{level},{side if who == 'b' else MIRROR[side]}\n"
        for who in "ab"
        for level in (60, 90)
        for side in ("left", "right") * 10
    )
    table = put(tmp_path / "t.csv", "participant,side,level_vpp,response\n" + rows)
    names, out = put(tmp_path / "map.toml", 'task = "forced choice"\n'), tmp_path / "out"
    found = run("analyze", table, "--columns", names, "--out", out, "--strict", "--no-figures")
    assert found.exit_code == 1
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    (warning,) = (one for one in summary["warnings"] if one["code"] == "responses_reversed")
    assert numbers(warning["message"])[:2] == [0, 40]
    assert warning["message"] in " ".join(found.output.split())
    assert warning["message"] in (out / "report.html").read_text(encoding="utf-8")
