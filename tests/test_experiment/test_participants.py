"""Participants: their facts are declared and never overwritten; the contact of their fingers."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import pytest

from experiment.record.people import enter_person, parse_participant_values, read_people
from tests.plates import on_paper_plate
from tests.test_experiment.lab import Lab
from tests.test_experiment.studies import codes_of, facts_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment import Study
    from tests.conftest import Run

COLUMNS = """
[participants]
columns = [
    { name = "hand", description = "preferred hand", levels = ["left", "right"] },
    { name = "age_group", description = "ten years wide" },
]
"""
HEAD = "participant_id\thand\tage_group\n"


@pytest.fixture
def columns(make_study: Callable[[str], Study]) -> Any:
    """The columns of participants that a study declares: hand and age_group."""
    return make_study(COLUMNS).participants.columns


@pytest.mark.parametrize(
    ("given", "parts"),
    [
        (["hand"], ["NAME=VALUE"]),
        (["hnad=left"], ["hnad", "hand, age_group"]),
        (["hand=both"], ["fact hand", "left, right, n/a", "'both'"]),
        (["hand="], ["fact hand"]),
        (["hand=left", "hand=left"], ["hand", "once"]),
        (["age_group="], ["age_group", "1 to 200"]),
        (["age_group=2\t3"], ["age_group", "1 to 200"]),
        (["age_group=20\n"], ["age_group", "1 to 200"]),
        (["age_group= 20"], ["age_group", "1 to 200"]),
        (["age_group=" + "x" * 201], ["age_group", "1 to 200"]),
        (["participant_id=sub-02"], ["participant_id"]),
    ],
)
def test_a_fact_that_the_study_does_not_declare_is_refused(
    columns: Any, given: list[str], parts: list[str]
) -> None:
    with pytest.raises(ValueError, match=re.escape(parts[0])) as caught:
        parse_participant_values(columns, given)
    assert [part for part in parts if part not in str(caught.value)] == []


def test_an_undeclared_fact_is_refused_and_nothing_is_written(
    tmp_path: Path, run: Run, quick_study_text: str
) -> None:
    (study := tmp_path / "study.toml").write_text(quick_study_text, "utf-8")
    words = ("run", study, "--participant", "01", "--responder", "simulated")
    result = run(*words, "--fact", "hand=left", "--out", tmp_path / "results")
    assert (result.exit_code, "hand" in result.stderr) == (2, True)
    assert not (tmp_path / "results").exists()


def test_a_fact_is_filled_in_later_and_never_overwritten(tmp_path: Path, columns: Any) -> None:
    hand, _ = columns
    enter_person(tmp_path, "01", [], {})
    enter_person(tmp_path, "01", [hand], {"hand": "left"})
    for facts in ({}, {"hand": "n/a"}, {"hand": "left"}):
        enter_person(tmp_path, "01", columns, facts)
    enter_person(tmp_path, "02", columns, parse_participant_values(columns, ["age_group=20-29"]))
    table = tmp_path / "participants.tsv"
    whole = table.read_bytes()
    assert whole == f"{HEAD}sub-01\tleft\tn/a\nsub-02\tn/a\t20-29\n".encode()
    with pytest.raises(ValueError, match=r"'left', .*participants.tsv"):
        enter_person(tmp_path, "01", [hand], {"hand": "right"})
    assert table.read_bytes() == whole


def test_a_row_of_another_length_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "participants.tsv").write_bytes(
        b"participant_id\thand\r\nsub-01\tleft\r\nsub-02\r\n"
    )
    with pytest.raises(ValueError, match=r"participants.tsv:3: .*2 cells; got 1"):
        read_people(tmp_path)


# --- how the fingers lay on the plate ------------------------------------------------------------

LOAD_CELL = 'control = "measured"\nforce_n = 0.5\nhow = "a load cell"\n'


def test_the_contact_of_fingers_stands_in_check_and_plan(tmp_path: Path, run: Run) -> None:
    held = 'control = "held"\nhow = "20 g on the nail"\n'
    controls = [f'control = "{control}"\n' for control in ("not stated", "none", "instructed")]
    for number, keys in enumerate((*controls, held, LOAD_CELL)):
        text = f"[contact]\n{keys}[design]\ntrials_per_side = 5\n[burst]\nwindow = 'hann'\n"
        facts = facts_of(text, ())
        assert ("unknown_contact" in codes_of(facts)) == (number < 2)
        assert facts["contact"]["control"] == keys.split('"')[1]
        assert facts["contact"]["force_n"] == (0.5 if keys == LOAD_CELL else None)
    (tmp_path / "study.toml").write_text(on_paper_plate(text), "utf-8")
    words = ("run", tmp_path / "study.toml", "--participant", "01", "--out", tmp_path)
    assert run(*words, "--responder", "simulated", "--seed", "1").exit_code == 0
    plan = json.loads((tmp_path / "sub-01" / "ses-01" / "plan.json").read_text("utf-8"))
    assert facts["contact"] == plan["study"]["contact"]


@pytest.mark.slow
def test_sessions_of_several_contacts_are_listed_by_contact(
    tmp_path: Path,
    make_study: Callable[[str], Study],
    short_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
    run: Run,
) -> None:
    results, out = tmp_path / "results", tmp_path / "out"
    for person, text in (("01", LOAD_CELL), ("02", ""), ("03", LOAD_CELL)):
        study = make_study(f"{short_study_text}[contact]\n{text}")
        Lab(study, results, monkeypatch, participant=person).begin()
    allowed = ("--no-figures", "--allow-simulated", "--out")
    assert run("analyze", results, *allowed, out).exit_code == 0
    contact = json.loads((out / "summary.json").read_bytes())["contact"]
    assert sorted(contact.values()) == [["sub-01/ses-01", "sub-03/ses-01"], ["sub-02/ses-01"]]
