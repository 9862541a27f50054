"""What the plan beside a trials.csv declares: its answers, its response window; broken plans."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ColumnMap, ResultFileError, read_trials
from analysis.load import read_inputs

if TYPE_CHECKING:
    from pathlib import Path

ANY = ColumnMap()


def write(path: Path, *answers: str, participant: str = "1") -> Path:
    """Write single trials, each with its response and reaction time."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{participant},left,60,{answer}\n" for answer in answers)
    path.write_text("participant,side,level_vpp,response,rt_s\n" + rows, encoding="utf-8")
    return path


def plan(folder: Path, **changes: Any) -> None:
    contents = {"schema": 1, "responses": ["left", "right"], "response_window_s": 2.0} | changes
    (folder / "plan.json").write_text(json.dumps(contents), encoding="utf-8")


def refused(path: Path) -> ResultFileError:
    with pytest.raises(ResultFileError) as caught:
        read_trials([path], ANY)
    return caught.value


def test_the_plan_tells_whether_none_was_offered(tmp_path: Path) -> None:
    for number, answers in enumerate((["left", "right"], ["left", "right", "none"])):
        folder = tmp_path / f"sub-{number}" / "ses-01"
        write(folder / "trials.csv", "left,0.5", participant=str(number))
        plan(folder, responses=answers)
    assert read_trials([tmp_path], ANY)["none_offered"].tolist() == [False, True]


def test_plans_are_listed_among_the_inputs(tmp_path: Path) -> None:
    write(tmp_path / "sub-1" / "ses-01" / "trials.csv", "left,0.5")
    plan(tmp_path / "sub-1" / "ses-01")
    names = [file.name for file in read_inputs([tmp_path], ANY).inputs]
    assert names == ["sub-1/ses-01/plan.json", "sub-1/ses-01/trials.csv"]


def test_without_a_plan_one_answer_none_shows_that_it_was_offered(tmp_path: Path) -> None:
    first = write(tmp_path / "1.csv", "left,0.5")
    second = write(tmp_path / "2.csv", "none,0.5", participant="2")
    assert read_trials([first], ANY)["none_offered"].isna().all()
    assert read_trials([first, second], ANY)["none_offered"].tolist() == [True, True]


def test_a_plan_beside_a_table_of_another_name_is_not_its_plan(tmp_path: Path) -> None:
    plan(tmp_path)
    assert len(read_trials([write(tmp_path / "other.csv", "both,3.5")], ANY)) == 1


def test_an_answer_that_the_plan_does_not_declare_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "trials.csv", "left,0.5", "both,0.5")
    plan(tmp_path)
    error = refused(path)
    assert error.line == 3
    assert "column 'response' is both" in str(error)
    assert "left, right, timeout or invalid" in str(error)


def test_time_outs_and_invalid_keys_need_no_declaration(tmp_path: Path) -> None:
    path = write(tmp_path / "trials.csv", "timeout,", "invalid,0.5")
    plan(tmp_path)
    assert len(read_trials([path], ANY)) == 2


def test_an_answer_after_the_plans_window_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "trials.csv", "left,2", "left,2.25")
    assert len(read_trials([path], ANY)) == 2
    plan(tmp_path)
    error = refused(path)
    assert error.line == 3
    assert "column 'rt_s' is 2.25; it must be at most the plan's response window 2" in str(error)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("{\n oops", 2, "not JSON"),
        ("[1]", None, "it must have responses"),
        ("{}", None, "it must have responses"),
        ('{"responses": "left", "response_window_s": 2}', None, "it must have responses"),
        ('{"responses": ["left"], "response_window_s": "2"}', None, "it must have responses"),
        ('{"responses": ["left"], "response_window_s": true}', None, "it must have responses"),
        ('{"responses": ["left"], "response_window_s": NaN}', None, "finite number above 0"),
        ('{"responses": ["left"], "response_window_s": 1e999}', None, "finite number above 0"),
        ('{"responses": ["left"], "response_window_s": 0}', None, "finite number above 0"),
        ('{"responses": [], "response_window_s": 2}', None, "must be different words"),
        ('{"responses": ["left", "left"], "response_window_s": 2}', None, "different words"),
        ('{"responses": ["up"], "response_window_s": 2}', None, "different words"),
        ('{"responses": ["left"], "response_window_s": 1' + "0" * 400 + "}", None, "not a plan"),
        ("[" * 100_000, None, "not a plan"),
    ],
)
def test_a_broken_plan_is_refused(tmp_path: Path, text: str, line: int | None, words: str) -> None:
    path = write(tmp_path / "trials.csv", "left,0.5")
    (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    error = refused(path)
    assert (error.file, error.line) == (str(tmp_path / "plan.json"), line)
    assert words in str(error)
