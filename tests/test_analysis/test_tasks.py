"""The tables of each task keep its own rules: guesses, correct answers, mirrored judgments."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from analysis import read_trials
from analysis.counts.checks import check_answers, sides_differ
from analysis.counts.table import count_answers, count_correct
from analysis.thresholds.discrimination import DB_PER_SIGMA, with_difference_thresholds
from analysis.thresholds.guess import chances_of, forced_guess_rate
from analysis.thresholds.likelihood import Tables
from analysis.thresholds.table import side_thresholds, thresholds_of
from analysis.thresholds.tables import tables_of
from experiment import first_study, simulate_study
from experiment.tasks import make_task
from experiment.tasks.task import BLANK, SINGLE
from tests.test_analysis.shared import run

if TYPE_CHECKING:
    from pathlib import Path


REFERENCE_VPP = 100.0


def test_a_false_alarm_of_yes_and_no_has_no_side() -> None:
    assert chances_of(make_task("yes-no")) == {"yes": 1.0, "no": 0.0}


def test_sites_of_yes_and_no_that_differ_have_thresholds_of_their_own() -> None:
    hits = {"left": [1, 6, 19], "right": [6, 19, 20]}
    answers = [
        (SINGLE, site, level_vpp, "yes" if index < number else "no")
        for site, numbers in hits.items()
        for level_vpp, number in zip((60.0, 90.0, 135.0), numbers, strict=True)
        for index in range(20)
    ]
    answers += [(BLANK, "none", np.nan, "yes" if index < 3 else "no") for index in range(40)]
    trials = pd.DataFrame(answers, columns=["kind", "side", "level_vpp", "response"])
    same = {
        "participant": "1",
        "condition": "main",
        "reason": "",
        "task": "yes-no",
        "sites": "left/right",
    }
    trials = trials.assign(**same, none_offered=True)
    assert sides_differ(count_answers(trials))["p"].lt(0.05).all()
    table = side_thresholds(trials).set_index("side")
    left_vpp, right_vpp = (table["threshold_vpp"].to_dict()[site] for site in hits)
    assert right_vpp < 0.8 * left_vpp
    for site in hits:
        # Every yes to a blank trial is a false alarm of each site.
        tables = tables_of(trials[trials["side"].isin([site, "none"])])
        assert tables.guesses[0].beta == (3.5, 37.5)
    assert tables_of(trials).guesses[0].beta == (3.5, 37.5)


def comparisons(answer: Any, levels_vpp: Any = (70.0, 85.0, 100.0, 115.0, 130.0)) -> pd.DataFrame:
    """Return comparisons of both sites in both intervals, answered by a rule."""
    task = replace(make_task("amplitude-discrimination"), reference_vpp=REFERENCE_VPP)
    rows = [
        {"side": shown.name, "level_vpp": level_vpp, "response": answer(task, shown, level_vpp)}
        for level_vpp in levels_vpp
        for shown in task.presentations
        for _ in range(5)
    ]
    same = {
        "participant": "1",
        "condition": "main",
        "kind": SINGLE,
        "reason": "",
        "task": task.name,
        "sites": "/".join(task.sites),
    }
    return pd.DataFrame(rows).assign(**same, none_offered=False)


@pytest.mark.parametrize("levels_vpp", [(70.0, 85.0, 95.0), (105.0, 115.0, 130.0)])
def test_who_compares_correctly_on_either_side_of_the_reference_is_not_reversed(
    levels_vpp: tuple[float, ...],
) -> None:
    def correct(task: Any, shown: Any, level_vpp: float) -> Any:
        return shown.correct_below if level_vpp < task.reference_vpp else shown.correct

    def wrong(task: Any, shown: Any, level_vpp: float) -> Any:
        return next(name for name in task.answer_names if name != correct(task, shown, level_vpp))

    none = pd.DataFrame(columns=["condition", "participant", "felt", "presented"])
    codes = [
        [
            str(code)
            for code, _ in check_answers(
                count_correct(count_answers(comparisons(rule, levels_vpp)), REFERENCE_VPP), none
            )
        ]
        for rule in (correct, wrong)
    ]
    assert codes == [[], ["responses_reversed"]]


def test_mirrored_judgments_have_the_mirrored_pse_and_the_same_difference_threshold() -> None:
    levels_vpp, hits, number = np.array([64.0, 80.0, 100.0, 125.0, 156.25]), [1, 6, 17, 27, 29], 30
    detected = np.array([hits, [number - k for k in reversed(hits)]], dtype=float)
    tables = Tables(
        levels=np.array([levels_vpp, levels_vpp]),
        detected=detected,
        presented=np.full_like(detected, number),
        guesses=[forced_guess_rate(make_task("amplitude-discrimination"))] * 2,
        names=(("main", "1"), ("main", "2")),
    )
    table = with_difference_thresholds(thresholds_of(tables, seed=0), tables, REFERENCE_VPP)
    first, second = table.to_dict("records")
    assert first["threshold_db"] == pytest.approx(-second["threshold_db"], abs=1e-6)
    assert first["threshold_low_db"] == pytest.approx(-second["threshold_high_db"], abs=1e-6)
    for end in ("", "_low", "_high"):
        name = f"difference_threshold{end}_db"
        assert first[name] == pytest.approx(second[name], rel=1e-6)
    assert first["difference_threshold_db"] == pytest.approx(DB_PER_SIGMA * first["sigma"])
    assert pytest.approx(20 * 0.6745, rel=1e-4) == DB_PER_SIGMA


def test_thresholds_of_trials_follow_their_task() -> None:
    def first(_task: Any, _shown: Any, _level_vpp: float) -> str:
        return "first"

    tables = tables_of(comparisons(first))
    assert (tables.detected / tables.presented == 0.5).all()
    assert [guess.mean for guess in tables.guesses] == [0.0]


@pytest.mark.parametrize(
    ("kind", "goal"),
    [
        ("amplitude-discrimination", "difference=2dB"),
        ("amplitude-discrimination", "half-width=2dB"),
        ("2ifc", "false-alarms=5%"),
    ],
)
def test_a_goal_that_makes_no_sense_for_a_task_is_refused(
    kind: str, goal: str, tmp_path: Path
) -> None:
    path = tmp_path / "study.toml"
    reference = f"reference_vpp = {REFERENCE_VPP}\n" if kind.startswith("amp") else ""
    run("init", path)
    text = path.read_text("utf-8").replace("both_trials = 5\n", "")
    lines = [line for line in text.splitlines() if not line.startswith(("both_", "responses"))]
    path.write_text("\n".join(lines) + f'\n[task]\nkind = "{kind}"\n{reference}', "utf-8")
    result = run("power", path, "--goal", goal)
    assert result.exit_code == 2
    assert kind in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize("kind", ["2ifc", "amplitude-discrimination", "yes-no"])
def test_a_time_out_is_no_choice_between_intervals(kind: str, tmp_path: Path) -> None:
    is_comparison = kind == "amplitude-discrimination"
    task: dict[str, Any] = {"kind": kind} | ({"reference_vpp": 90.0} if is_comparison else {})
    design = {"levels_vpp": (60.0, 90.0, 120.0), "trials_per_side": 30, "response_window_s": 0.5}
    study = first_study().changed(task=task, design=design, simulation={"threshold_vpp": 80.0})
    assert [*simulate_study(study, tmp_path, participants=1, seed=2, gains=())]
    trials = read_trials([tmp_path])
    late = trials[trials["response"].eq("timeout")]
    assert len(late) > 5
    assert {*late["reason"]} == {"" if kind == "yes-no" else "unanswered"}
