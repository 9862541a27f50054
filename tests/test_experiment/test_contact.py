"""How the fingers lay on the plate is stated by the study, and stands wherever its results do."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from analysis.commands.analyze import write_analysis
from experiment.archive.bids_tables import events_sidecar
from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.study.read import study_from_canonical, study_from_text
from experiment.study.study import StudyError
from tests.test_experiment.lab import Lab

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study

LOAD_CELL = '[contact]\ncontrol = "measured"\nforce_n = 0.5\nhow = "a load cell below the plate"\n'
STATED = {
    "": "not stated",
    '[contact]\ncontrol = "none"\n': "not controlled",
    '[contact]\ncontrol = "instructed"\n': "by instruction",
    '[contact]\ncontrol = "held"\nhow = "20 g on the nail"\n': "held: 20 g on the nail",
    LOAD_CELL: "measured, 0.5 N: a load cell below the plate",
}


@pytest.mark.parametrize(("text", "words"), STATED.items(), ids=STATED.values())
def test_what_is_stated_stands_in_header_check_and_data_set(
    tmp_path: Path,
    make_study: Callable[[str], Study],
    short_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
    text: str,
    words: str,
) -> None:
    lab = Lab(make_study(short_study_text + text), tmp_path, monkeypatch)
    lab.begin(begin={1: False})
    header = json.loads((lab.folder.path / "header.json").read_text("utf-8"))
    assert header["contact"]["words"] == words
    study = study_from_canonical(lab.folder.read_plan().study)
    assert study.contact == lab.study.contact
    found = check_findings(check_study(study, gains=()), "s.toml")
    assert [line.split(maxsplit=1)[1] for line in found.text.splitlines()
            if line.startswith("contact ")] == [words]  # fmt: skip
    assert found.facts["contact"]["force_n"] == (0.5 if text == LOAD_CELL else None)
    person = events_sidecar(study, software_version=None, simulated=False)
    assert person["FingerContact"] == words
    assert "FingerContact" not in events_sidecar(study, software_version=None, simulated=True)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('control = "tight"', "control must be 'not stated', 'none', 'instructed', 'held' or"),
        ("force_n = 0.5", "control must be none, instructed, held or measured beside force_n; got"),
        ('how = "by hand"', "control must be none, instructed, held or measured beside how; got"),
        ('control = "none"\nforce_n = 0.5', "control must be instructed, held or measured beside"),
        ('control = "measured"\nforce_n = 0.5', "how is missing; control = measured needs it"),
        ('control = "held"', "how is missing; control = held needs it"),
        (
            'control = "instructed"\nforce_n = 0',
            "force_n must be a finite number >= 0.01 and <= 20",
        ),
        ('control = "none"\nhow = " "', "how must be one line of text"),
    ],
)
def test_a_statement_that_contradicts_itself_is_refused(text: str, said: str) -> None:
    with pytest.raises(StudyError) as refused:
        study_from_text(f"[contact]\n{text}\n", "s.toml")
    assert str(refused.value).startswith(f"s.toml: contact.{said}")


@pytest.mark.slow
def test_statements_that_differ_are_told_with_their_sessions_and_as_a_warning(
    tmp_path: Path,
    make_study: Callable[[str], Study],
    short_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    results, out = tmp_path / "results", tmp_path / "out"
    for person, text in (("01", LOAD_CELL), ("02", ""), ("03", LOAD_CELL)):
        study = make_study(short_study_text + text)
        Lab(study, results, monkeypatch, participant=person).begin()
    analysis = write_analysis([results], out, figures=False)
    stated = {
        "measured, 0.5 N: a load cell below the plate": ["sub-01/ses-01", "sub-03/ses-01"],
        "not stated": ["sub-02/ses-01"],
    }
    assert json.loads((out / "summary.json").read_bytes())["contact"] == stated
    told = "; ".join(f"{words} ({', '.join(which)})" for words, which in stated.items())
    assert [one for one in analysis.warnings if "contact" in one] == [
        f"force and contact of the fingers are not the same in all sessions: {told}"
    ]
    page = (out / "report.html").read_text("utf-8")
    assert page.count("a load cell below the plate: sub-01/ses-01, sub-03/ses-01") == 1
    alone = write_analysis([results / "sub-01"], tmp_path / "alone", figures=False)
    assert not [one for one in alone.warnings if "contact" in one]
