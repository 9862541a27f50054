"""Participants who are named: reversed mapping, at chance, drift; the order of conditions."""

from __future__ import annotations

import html
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from analysis import Axis, ColumnMap, analyse
from analysis.counts.checks import check_answers, check_drift, condition_order
from analysis.counts.table import count_answers, count_false_alarms, count_levels
from analysis.results.rendering import warning
from tests.test_analysis.shared import loaded, put, run
from tests.test_analysis.tables import numbers

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from analysis.counts.checks import FailedCheck

MIRROR = {"left": "right", "right": "left"}
SIDES = ["left", "right"] * 50
GUESSES = ["left"] * 50 + ["right"] * 50


def trials(sides: Any, answers: Any, **columns: Any) -> pd.DataFrame:
    """Return single stimuli that count, or blanks where the side is none."""
    kinds = ["blank" if side == "none" else "single" for side in sides]
    table = pd.DataFrame({"side": sides, "kind": kinds, "response": answers})
    same: dict[str, Any] = {"participant": "1", "condition": "main", "session": "01", "block": 1}
    same["trial"] = range(len(sides))
    return table.assign(**same | {"level_vpp": 60.0, "reason": "", "none_offered": False} | columns)


NO_BLANKS = pd.DataFrame(columns=["condition", "participant", "felt", "presented"])


def failed(checks: Iterable[FailedCheck], *names: str) -> list[list[Any]]:
    """Return the code of each check that failed, with some of its data."""
    return [[str(check.code), *(check.data[name] for name in names)] for check in checks]


def checks_of(table: pd.DataFrame, axis: Axis | None = None) -> list[FailedCheck]:
    counts = count_answers(table)
    answers = check_answers(count_levels(counts, "side"), count_false_alarms(counts))
    return [*answers, *check_drift(table, axis or Axis())]


NAMED, FELT = ("detected", "named"), ("detected_any", "presented", "false_alarms", "blanks")


@pytest.mark.parametrize(
    ("sides", "answers", "columns", "code", "counts"),
    [
        # As one of 21 people of a public study.
        (["left", "right"] * 384, ["right", "left"] * 376 + ["left", "right"] * 8, {},
         "responses_reversed", [16, 768]),
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
    sides: Any, answers: Any, columns: Any, code: str | None, counts: list[int]
) -> None:
    checks = checks_of(trials(sides, answers, participant="سمر, x", **columns))
    names = (NAMED + FELT)[: len(counts)]
    expected = [[code, "سمر, x", *counts]] if code else []
    assert failed(checks, "participant", *names) == expected
    for check in checks:
        assert {*counts} <= {*numbers(warning(check.code, **check.data).message)}


def test_fewer_correct_than_by_chance_at_one_site_are_guesses() -> None:
    table = pd.DataFrame({"condition": "main", "participant": "a", "level_vpp": [60.0, 90.0]})
    counts = table.assign(detected=[17, 18], presented=50, none_offered=False)
    assert failed(check_answers(counts, NO_BLANKS)) == [["guessing"]]


def test_counts_of_a_forced_choice_show_guesses_and_reversed_answers() -> None:
    table = pd.DataFrame({"condition": "main", "level_vpp": [60.0, 90.0] * 3, "presented": 30})
    counts = table.assign(
        participant=list("aabbcc"), detected=[15, 17, 2, 1, 20, 29], none_offered=False
    )
    assert failed(check_answers(counts, NO_BLANKS), "participant", *NAMED) == [
        ["responses_reversed", "b", 3, 60],
        ["guessing", "a", 32, 60],
    ]
    yes = counts.assign(none_offered=True)
    assert not [*check_answers(yes, NO_BLANKS)]
    blanks = pd.DataFrame({"participant": list("abc"), "felt": [9, 1, 1], "presented": 20})
    guessing = failed(check_answers(yes, blanks.assign(condition="main")), "participant", *FELT)
    assert ["guessing", "a", 32, 60, 9, 20] in guessing
    huge = counts.assign(presented=10**12, detected=[10**12 // 2, 10**12] * 3)
    assert not [*check_answers(huge, NO_BLANKS)]


@pytest.mark.parametrize(
    ("axis", "conditions"),
    [(Axis(), 1), (Axis(x_scale="linear", unit="mm/s"), 1), (Axis(), 2)],
)
def test_a_drift_is_estimated_within_each_condition(axis: Axis, conditions: int) -> None:
    """The second condition is harder: that is no drift, and no block of its size."""
    rng, number, parts = np.random.default_rng(1), 3000, []
    for at in range(conditions):
        x = np.linspace(-8.0, 8.0, 9)[rng.integers(0, 9, number)]  # steps about the threshold
        course = 6.0 * np.linspace(-0.5, 0.5, number) + 4.0 * at
        answers = np.where(rng.normal(size=number) * 2.0 < x - course, "left", "none")
        level = 60.0 * 10 ** (x / 20) if axis.is_logarithmic else 10 * x
        condition = trials(["left"] * number, answers, level_vpp=level, condition=f"c{at}")
        parts.append(condition.assign(trial=np.arange(number) + number * at, none_offered=True))
    halves = [np.array_split(block["response"].eq("left"), 2) for block in parts]
    detected = [sum(int(half[i].sum()) for half in halves) for i in (0, 1)]
    checks = checks_of(pd.concat(parts, ignore_index=True), axis)
    assert failed(checks, "participant", "session", "detected", "presented") == [
        ["threshold_drifts", "1", "01", detected, [number * conditions // 2] * 2]
    ]
    moved = 6.0 if axis.is_logarithmic else 60.0
    assert checks[0].data["drift"] == pytest.approx(moved, rel=0.1)
    message = warning(checks[0].code, **checks[0].data).message
    assert numbers(message)[-1] == pytest.approx(moved, rel=0.1)


def test_a_drift_is_named_by_its_p_and_has_no_size_under_separation() -> None:
    rng = np.random.default_rng(3)
    level_vpp = np.repeat([60.0, 70.0, 80.0], 40)[rng.permutation(120)]
    hit = rng.random(120) < 0.2 + (level_vpp - 60) / 40 + np.linspace(0.12, -0.12, 120)
    table = trials(["left"] * 120, np.where(hit, "left", "none"), level_vpp=level_vpp)
    assert not checks_of(table.assign(none_offered=True))
    answers = np.repeat(["left", "none"], 60)
    for levels in (60.0, level_vpp):
        separated = trials(["left"] * 120, answers, level_vpp=levels, none_offered=True)
        (check,) = checks_of(separated)
        expected = ["threshold_drifts", [60, 0], [60, 60], None]
        assert failed([check], "detected", "presented", "drift") == [expected]
        assert check.data["p"] < 1e-19
    both = pd.concat([separated, separated.assign(session="02")])
    assert [check.data["session"] for check in checks_of(both)] == ["01", "02"]


@pytest.mark.slow
def test_a_session_without_a_drift_is_hardly_ever_named() -> None:
    rng, named = np.random.default_rng(5), 0
    for _ in range(200):
        x = rng.choice([-4.0, -2.0, 0.0, 2.0, 4.0], 150)
        answers = np.where(rng.normal(size=150) * 2 < x, "left", "none")
        level_vpp = 60 * 10 ** (x / 20)
        table = trials(["left"] * 150, answers, level_vpp=level_vpp, none_offered=True)
        named += len(checks_of(table))
    assert named <= 2


def order_of(*places: tuple[str, str, int, int], numbered: bool = True) -> str | None:
    """Return which condition came first, of conditions with session, block and trial."""
    columns = ["condition", "session", "block", "trial"]
    table = pd.DataFrame(places, columns=columns).assign(participant="1", kind="single", reason="")
    for seed in (1, 2):  # the order of rows is no order of trials
        first = condition_order(table, numbered=numbered)["first"].tolist()
        table = table.sample(frac=1, random_state=seed)
        assert condition_order(table, numbered=numbered)["first"].tolist() == first
    return first[0] if first else ""


@pytest.mark.parametrize(
    ("places", "numbered", "first"),
    [
        ([("b", "01", 1, 1), ("a", "01", 1, 2)], True, "b"),
        ([("a", "02", 1, 1), ("b", "01", 9, 1)], True, "b"),  # sessions have running numbers
        ([("a", "10", 1, 1), ("b", "9", 1, 1)], True, "b"),
        ([("a", "post", 1, 1), ("b", "pre", 1, 1)], True, None),
        ([("b", "01", 1, 1), ("a", "01", 2, 1)], True, "b"),
        ([("a", "01", 1, 1), ("a", "01", 3, 5), ("b", "01", 2, 3)], False, "alternated"),
        # Trial numbers that begin anew in each condition show no order.
        ([("a", "01", 1, 1), ("a", "01", 1, 2), ("b", "01", 1, 1), ("b", "01", 1, 2)], True, None),
        ([("b", "01", 1, 1), ("a", "01", 1, 2)], False, None),
        ([("a", "01", 1, 1), ("a", "01", 2, 2), ("b", "01", 2, 3)], False, None),
        ([("b", "01", 1, 1), ("a", "01", 2, 2)], False, "b"),
        ([("a", "01", 1, 1)], True, ""),
    ],
)
def test_the_condition_that_came_first_is_told_only_where_numbers_show_it(
    places: list[Any], *, numbered: bool, first: str | None
) -> None:
    assert order_of(*places, numbered=numbered) == first


@pytest.mark.parametrize(
    ("run_length", "first"), [(1, "interleaved"), (3, "interleaved"), (4, "alternated")]
)
def test_conditions_are_interleaved_by_trials_and_alternate_by_blocks(
    run_length: int, first: str
) -> None:
    places = [("ab"[i // run_length % 2], "01", 1, i) for i in range(40)]
    assert order_of(*places) == first


@pytest.mark.parametrize(("column", "drifts"), [("trial", True), ("row", False)])
def test_an_order_of_rows_is_no_order_of_trials(
    tmp_path: Path, column: str, *, drifts: bool
) -> None:
    rows = (
        f"{n},a,left,{level},{'left' if n >= 60 else 'none'}\n"
        for n, level in enumerate([60, 80] * 60)
    )
    text = f"{column},participant,side,level_vpp,response\n" + "".join(rows)
    result = analyse(loaded(tmp_path, text, ColumnMap(task="yes/no")))
    assert ("threshold_drifts" in [str(one.code) for one in result.warnings]) == drifts


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
    result = run("analyze", table, "--columns", names, "--out", out, "--strict", "--no-figures")
    assert result.exit_code == 1
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    (warning,) = (each for each in summary["warnings"] if each["code"] == "responses_reversed")
    assert numbers(warning["message"])[:2] == [0, 40]
    assert re.search(r"Warnings +1  ", result.output)
    assert html.escape(warning["message"]) in (out / "report.html").read_text(encoding="utf-8")
