"""Facts of participants: declared by the study, or refused; never overwritten."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest

from experiment.archive.files import ArchiveError
from experiment.archive.folders import SessionFolder
from experiment.archive.participants import (
    Fact,
    enter_person,
    participant_facts,
    read_people,
    remove_person,
)
from experiment.session.simulate import simulate_study
from experiment.study.sections.dataset import ParticipantColumn
from experiment.trial.draw import draw_plan

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study

HAND = ParticipantColumn(name="hand", description="preferred hand", levels=("left", "right"))
AGE = ParticipantColumn(name="age_group", description="ten years wide")
COLUMNS = """
[participants]
columns = [
    { name = "hand", description = "preferred hand", levels = ["left", "right"] },
    { name = "age_group", description = "ten years wide" },
]
"""


def create(study: Study, root: Path, participant: str, facts: tuple[Fact, ...] = ()) -> None:
    folder = SessionFolder(root, participant, "01", facts=facts)
    folder.path.mkdir(parents=True)
    folder.create(draw_plan(study, participant=participant, session="01", seed=1), {})


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["hand"], "NAME=VALUE"),
        (["hnad=left"], "unknown key hnad; did you mean hand?; the study declares hand, age_group"),
        (["hand=both"], "fact hand must be one of left, right, n/a; got 'both'"),
        (["hand="], "must be one of"),
        (["hand=left", "hand=left"], "once"),
        (["age_group="], "1 to 200 characters"),
        (["age_group=2\t3"], "1 to 200 characters"),
        (["age_group=20\n"], "1 to 200 characters"),
        (["age_group= 20"], "1 to 200 characters"),
        (["age_group=" + "x" * 201], "1 to 200 characters"),
        (["participant_id=sub-02"], "unknown key participant_id"),
    ],
)
def test_a_fact_that_the_study_does_not_declare_is_refused(given: list[str], told: str) -> None:
    with pytest.raises(ArchiveError, match=re.escape(told)):
        participant_facts((HAND, AGE), given)


def test_facts_stand_in_the_declared_columns_and_n_a_where_none_is_given(
    tmp_path: Path, make_study: Callable[[str], Study], quick_study_text: str
) -> None:
    study = make_study(quick_study_text + COLUMNS)
    facts = participant_facts(study.participants.columns, ["age_group=20-29"])
    create(study, tmp_path, "01", facts)
    create(study, tmp_path, "02")
    table = (tmp_path / "participants.tsv").read_text("utf-8")
    assert table == "participant_id\thand\tage_group\nsub-01\tn/a\t20-29\nsub-02\tn/a\tn/a\n"


def test_an_undeclared_fact_creates_no_session(
    tmp_path: Path, make_study: Callable[[str], Study], quick_study_text: str
) -> None:
    with pytest.raises(ArchiveError, match="unknown key hand"):
        create(make_study(quick_study_text), tmp_path, "01", (Fact("hand", "left"),))
    assert list((tmp_path / "sub-01" / "ses-01").iterdir()) == []
    assert not (tmp_path / "participants.tsv").exists()


def test_a_fact_is_filled_in_later_and_never_overwritten(tmp_path: Path) -> None:
    enter_person(tmp_path, "01", [], ())
    enter_person(tmp_path, "01", [HAND], [Fact("hand", "left")])
    for facts in ((), [Fact("hand", "n/a")], [Fact("hand", "left")]):
        enter_person(tmp_path, "01", [HAND, AGE], facts)
    table = tmp_path / "participants.tsv"
    whole = table.read_bytes()
    assert whole == b"participant_id\thand\tage_group\nsub-01\tleft\tn/a\n"
    with pytest.raises(ArchiveError, match=r"must be 'left', as participants.tsv has it"):
        enter_person(tmp_path, "01", [HAND], [Fact("hand", "right")])
    assert table.read_bytes() == whole


def test_a_row_of_another_length_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "participants.tsv").write_bytes(
        b"participant_id\thand\r\nsub-01\tleft\r\nsub-02\r\n"
    )
    with pytest.raises(ArchiveError, match=r"participants.tsv:3: must have 2 cells; got 1"):
        read_people(tmp_path)


def test_a_half_written_table_goes_with_the_row(tmp_path: Path) -> None:
    (tmp_path / ".participants.tsv.ab12.tmp").write_text("sub-01", encoding="utf-8")
    enter_person(tmp_path, "01", [], ())
    remove_person(tmp_path, "01")
    assert not list(tmp_path.glob("*.tmp"))
    assert not list(tmp_path.glob(".*.tmp"))


@pytest.mark.slow
def test_a_simulated_study_has_the_declared_columns_without_values(
    tmp_path: Path, make_study: Callable[[str], Study], quick_study_text: str
) -> None:
    study = make_study(quick_study_text + COLUMNS)
    list(simulate_study(study, tmp_path, participants=1, seed=1))
    assert read_people(tmp_path).rows == (("sub-01", "n/a", "n/a"),)
