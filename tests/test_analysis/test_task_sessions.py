"""Sessions of each task: counted by its own rules, in its own words, and never mixed."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from analysis import read_inputs, write_analysis
from analysis.counts.table import count_answers, count_false_alarms
from analysis.reading.text import ResultFileError
from analysis.results.analysis import Analysis, analyse
from analysis.thresholds.guess import forced_guess_rate
from experiment import first_study, simulate_study
from experiment.tasks import TASKS, make_task
from experiment.tasks.task import BLANK, SINGLE
from tests.test_analysis.shared import refused

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.study.study import Study

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("task-sessions")]
REFERENCE_VPP = 100.0
KINDS = [*TASKS]
OWN_WORDS = [kind for kind in KINDS if kind != "left-right-both"]
LEVELS_VPP = [60.0, 80.0, 100.0, 120.0, 140.0]


def study_of(kind: str, **design: Any) -> Study:
    task: dict[str, Any] = {"kind": kind}
    if kind == "amplitude-discrimination":
        task["reference_vpp"] = REFERENCE_VPP
    base = {"levels_vpp": LEVELS_VPP, "trials_per_side": 20, "break_every": 0}
    base |= {"blank_trials": 12} if kind == "yes-no" else {}
    base |= {"hands_off_trials_before": 2}
    people = {"threshold_vpp": 95.0}
    return first_study().changed(task=task, design=base | design, simulation=people)


@pytest.fixture(scope="module")
def sessions(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Return a folder with the sessions of two simulated people for each task."""
    folders = {}
    for kind in KINDS:
        folders[kind] = tmp_path_factory.mktemp(kind)
        [*simulate_study(study_of(kind), folders[kind], participants=2, seed=3, gains=())]
    return folders


@pytest.fixture(scope="module")
def analyses(sessions: dict[str, Path]) -> dict[str, Analysis]:
    """Return the analysis of each task, written beside its sessions."""
    return {
        kind: write_analysis([folder], folder / "analysis", figures=False)
        for kind, folder in sessions.items()
    }


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_detected_is_what_the_task_says(kind: str, analyses: dict[str, Analysis]) -> None:
    analysis, task = analyses[kind], make_task(kind)
    trials = analysis.trials[analysis.trials["reason"].eq("")]
    single = trials[trials["kind"].eq(SINGLE)]
    detected = [
        task.is_detected(*pair) for pair in zip(single["side"], single["response"], strict=True)
    ]
    expected = pd.Series(detected, single.index).groupby(single["level_vpp"]).agg(["sum", "size"])
    table = analysis.levels.set_index("level_vpp")[["detected", "presented"]]
    assert table.to_numpy().tolist() == expected.to_numpy().tolist()
    assert trials.loc[trials["kind"].eq(BLANK), "level_vpp"].isna().all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_guess_rate_is_that_of_the_task(kind: str, analyses: dict[str, Analysis]) -> None:
    analysis, task = analyses[kind], make_task(kind)
    rates = analysis.thresholds["guess_rate"]
    if task.nothing in analysis.loaded.progress[0].plan.responses:
        alarms = count_false_alarms(count_answers(analysis.trials))
        assert rates.tolist() == pytest.approx(
            ((alarms["felt"] + 0.5) / (alarms["presented"] + 1)).tolist()
        )
    else:
        assert {*rates} == {forced_guess_rate(task).mean}
    known = {"2ifc": 1 / 2, "3ifc": 1 / 3, "amplitude-discrimination": 0.0}
    assert forced_guess_rate(task).mean == known.get(kind, forced_guess_rate(task).mean)


@pytest.mark.parametrize("kind", KINDS)
def test_answers_are_listed_in_the_words_of_the_task(
    kind: str, analyses: dict[str, Analysis]
) -> None:
    analysis, task = analyses[kind], make_task(kind)
    table, presented = analysis.confusion, {*analysis.confusion["side"]}
    assert presented <= {*task.presentation_names}
    assert {*task.answer_names} <= {*table}
    columns = [*task.answer_names, "timeout", "invalid"]
    assert table[columns].sum(axis=1).tolist() == table["presented"].tolist()
    assert {*analysis.trials["task"]} == {kind}
    sites = {*analysis.sides["side"]}
    assert sites == {*task.sites}


@pytest.mark.parametrize("kind", KINDS)
def test_the_files_define_the_columns_that_the_task_has(
    kind: str, sessions: dict[str, Path], analyses: dict[str, Analysis]
) -> None:
    assert analyses[kind].counts.trials > 0
    folder = sessions[kind] / "analysis"
    meanings = json.loads((folder / "columns.json").read_text("utf-8"))
    for path in folder.glob("*.csv"):
        columns = {*pd.read_csv(path, nrows=0)} if path.name != "trials_clean.csv" else set()
        assert columns - {*meanings} <= {"participant", "condition", "level_vpp"}
    rows = pd.read_csv(folder / "trials_clean.csv")
    assert {*rows["response"].dropna()} <= {*make_task(kind).answer_names, "timeout", "invalid"}


# An identification of left and right has no other words than left-right-both.
@pytest.mark.parametrize("kind", [kind for kind in OWN_WORDS if kind != "identification"])
def test_a_table_without_its_plan_is_refused(
    kind: str, sessions: dict[str, Path], tmp_path: Path
) -> None:
    table = next(sessions[kind].glob("sub-*/ses-*/trials.csv"))
    copy = tmp_path / "trials.csv"
    copy.write_bytes(table.read_bytes())
    message = str(refused(copy))
    assert "plan.json" in message
    assert "\n" not in message


@pytest.mark.parametrize("kind", OWN_WORDS)
def test_a_table_beside_its_plan_is_checked_by_it(
    kind: str, sessions: dict[str, Path], tmp_path: Path
) -> None:
    source = next(sessions[kind].glob("sub-01/ses-*"))
    folder = tmp_path / "sub-01" / source.name
    folder.mkdir(parents=True)
    for name in ("plan.json", "trials.csv"):
        (folder / name).write_bytes((source / name).read_bytes())
    loaded = read_inputs([folder / "trials.csv"])
    assert loaded.session_task.name == kind
    text = (folder / "trials.csv").read_text("utf-8")
    verdict = text.replace(",true,ok,", ",false,ok,", 1)
    (folder / "trials.csv").write_text(verdict, "utf-8")
    assert "'correct'" in str(refused(folder / "trials.csv"))


def test_sessions_of_different_tasks_are_refused_by_name(sessions: dict[str, Path]) -> None:
    for kind in OWN_WORDS:
        with pytest.raises(ResultFileError) as error:
            read_inputs([sessions["left-right-both"], sessions[kind]])
        message = str(error.value)
        assert kind in message
        assert "left-right-both" in message
        assert "\n" not in message


def test_sessions_with_different_references_are_refused(
    sessions: dict[str, Path], tmp_path: Path
) -> None:
    kind = "amplitude-discrimination"
    study = study_of(kind).changed(task={"kind": kind, "reference_vpp": 90.0})
    [*simulate_study(study, tmp_path, participants=1, seed=3, gains=())]
    with pytest.raises(ResultFileError, match=r"90 Vpp.*100 Vpp|100 Vpp.*90 Vpp"):
        read_inputs([sessions[kind], tmp_path])


def test_constant_and_chosen_levels_are_not_pooled_silently(
    sessions: dict[str, Path], tmp_path: Path
) -> None:
    chosen = study_of("2ifc").changed(levels={"rule": "staircase"})
    [*simulate_study(chosen, tmp_path, participants=2, seed=5, gains=())]
    loaded = read_inputs([sessions["2ifc"] / "sub-01", tmp_path / "sub-02"])
    (warning,) = (each for each in analyse(loaded).warnings if each.code == "levels_chosen")
    assert warning.data == {"rules": {"staircase": 1}, "constant": 1}
    assert "proportions of correct answers" in warning.message


def test_a_comparison_reports_the_pse_in_place_of_a_threshold(
    sessions: dict[str, Path], analyses: dict[str, Analysis]
) -> None:
    kind = "amplitude-discrimination"
    analysis, folder = analyses[kind], sessions[kind] / "analysis"
    summary = json.loads((folder / "summary.json").read_text("utf-8"))
    assert [row["kind"] for row in summary["answer"][:3]] == [
        "pse",
        "re_reference",
        "difference_threshold",
    ]
    (group,) = summary["groups"]
    assert group["pse_db"] == pytest.approx(20 * np.log10(group["pse_vpp"] / REFERENCE_VPP))
    assert group["reference_vpp"] == REFERENCE_VPP
    assert analysis.words["axis"] == "Judged stronger"
    written = [pd.read_csv(path, nrows=0) for path in folder.glob("*.csv")]
    names = {str(name) for table in written for name in table}
    assert "judged_stronger" in names
    assert not {name for name in names if name == "detected" or name.startswith("threshold")}
