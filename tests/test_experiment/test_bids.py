"""The BIDS export: what is in it, what is not, and its place."""

from __future__ import annotations

import csv
import json
import shutil
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner
from filelock import FileLock

from experiment import SessionFolder
from experiment.record.people import WithdrawalRecord, write_withdrawal
from tactstrip import main
from tests.plates import on_paper_plate
from tests.test_experiment.sessions import Sessions, contents

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

    from tests.conftest import Refused, Rows, Simulate

STUDY = """
[study]
name = "two-finger_pilot"
[burst]
window = "hann"
[design]
levels_vpp = [80, 160]
trials_per_side = 3
both_trials = 1
blank_trials = 2
practice_trials = 1
responses = ["left", "right", "both", "none"]
response_window_s = 0.55
[participants]
columns = [
    { name = "handedness", description = "by questionnaire", levels = ["left", "right"] },
    { name = "age_group", description = "ten years wide" },
]
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory, simulate: Simulate) -> Path:
    return simulate(tmp_path_factory.mktemp("small") / "results", study=STUDY, participants=2)


@pytest.fixture
def results(small: Path, tmp_path: Path) -> Path:
    return shutil.copytree(small, tmp_path / "results")


def export(results: Path, *more: str) -> Result:
    out = str(results.parent / "bids")
    return CliRunner().invoke(main, ["export", str(results), "--bids", out, *more])


def exported(results: Path, *more: str) -> Path:
    done = export(results, *more)
    assert done.exit_code == 0, done.stderr
    return results.parent / "bids"


@pytest.fixture
def no_export(results: Path, refused: Refused) -> Refused:
    """Export into a folder, which must be refused; returns what is said."""

    def no_export(place: str | Path = results.parent / "bids") -> str:
        return refused("export", results, "--bids", place)

    return no_export


def table_of(table: Path) -> list[dict[str, str]]:
    with table.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, dialect="excel-tab"))


def events_of(bids: Path, participant: str = "01") -> Path:
    name = f"sub-{participant}_ses-01_task-twofingerpilot_events.tsv"
    return bids / f"sub-{participant}" / "ses-01" / "beh" / name


def cut_journal(results: Path, participant: str, lines: int) -> None:
    """Let a session have been interrupted after so many lines of its journal."""
    folder = SessionFolder(results, participant, "01")
    whole = folder.journal_path.read_bytes().splitlines(keepends=True)
    folder.journal_path.write_bytes(b"".join(whole[:lines]))
    folder.trials_path.unlink()
    (folder.path.parent / "sessions.tsv").unlink()


def test_events_are_the_trials_under_other_names(results: Path, rows_of: Rows) -> None:
    events = table_of(events_of(exported(results)))
    names = list(events[0])
    assert names[:4] == ["onset", "duration", "trial_type", "response_time"]
    trials = rows_of(results)
    old = {"onset": "onset_s", "trial_type": "kind", "response_time": "rt_s"}
    assert {old.get(name, name) for name in names} == {*trials[0], "duration"}
    for trial, event in zip(trials, events, strict=True):
        same = {name: trial[old.get(name, name)] for name in names if name != "duration"}
        assert same == {name: event[name] for name in names if name != "duration"}
        assert event["duration"] == ("0" if event["trial_type"] == "blank" else "0.002")
    assert {event["trial_type"] for event in events} == {"single", "both", "blank", "practice"}
    assert {event["simulated"] for event in events} == {"true"}
    missed = [event["response_time"] for event in events if event["response"] == "timeout"]
    assert {*missed} == {"n/a"}


def test_every_column_and_every_value_is_described(results: Path) -> None:
    bids = exported(results)
    for table in bids.rglob("*.tsv"):
        sidecar = json.loads(table.with_suffix(".json").read_text("utf-8"))
        for row in table_of(table):
            for name, value in row.items():
                assert sidecar[name]["Description"]
                assert value in {*sidecar[name].get("Levels", [value]), "n/a"}
    events = json.loads(events_of(bids).with_suffix(".json").read_text("utf-8"))
    assert set(events["condition"]["Levels"]) == {"main"}
    units = {name: events[name].get("Units") for name in ("onset", "level_vpp", "peak_left_um")}
    assert units == {"onset": "s", "level_vpp": "V", "peak_left_um": "um"}
    description = json.loads((bids / "dataset_description.json").read_text("utf-8"))
    assert set(description) == {"Name", "BIDSVersion", "DatasetType", "Authors", "GeneratedBy"}
    assert description["Authors"] == []
    assert description["Name"] == "two-finger_pilot (simulated)"
    assert [maker["Name"] for maker in description["GeneratedBy"]] == ["tactstrip"]


def test_participants_have_the_declared_columns_and_no_other(
    results: Path, no_export: Refused
) -> None:
    people = results / "participants.tsv"
    people.write_text("participant_id\thandedness\nsub-02\tboth\n", encoding="utf-8")
    assert "participants.tsv:2:" in no_export()
    people.write_text(
        "participant_id\tage_group\tphone\nsub-01\t20-29\ttel-555\nsub-09\tn/a\ttel-556\n",
        encoding="utf-8",
    )
    done = export(results)
    assert "phone" in done.stdout  # is left out
    bids = results.parent / "bids"
    assert (bids / "participants.tsv").read_text("utf-8") == (
        "participant_id\thandedness\tage_group\nsub-01\tn/a\t20-29\nsub-02\tn/a\tn/a\n"
    )
    sidecar = json.loads((bids / "participants.json").read_text("utf-8"))
    assert sidecar["handedness"]["Description"] == "by questionnaire"
    assert set(sidecar["handedness"]["Levels"]) == {"left", "right"}
    # no such letters can stand in a hash
    assert not any(b"tel-55" in content for content in contents(bids).values())


@pytest.mark.slow
def test_host_and_operator_are_only_in_sourcedata(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("platform.node", lambda: "labhost7")
    sessions = Sessions(tmp_path, on_paper_plate(STUDY))
    done = sessions.run("--responder", "simulated", "--operator", "grete")
    assert done.exit_code == 0, done.output
    results = sessions.out
    bids = exported(results)
    assert not (bids / "sourcedata").exists()
    everything = b"".join(contents(bids).values())
    assert not any(name in everything for name in (b"labhost7", b"grete", b"journal"))
    exported(results, "--with-sourcedata")
    for name in ("plan.json", "header.json", "journal.jsonl"):
        source = results / "sub-01" / "ses-01" / name
        copy = bids / "sourcedata" / "sub-01" / "ses-01" / name
        assert copy.read_bytes() == source.read_bytes()
    verified = CliRunner().invoke(main, ["verify", str(bids / "sourcedata")])
    assert verified.exit_code == 0
    (session,) = table_of(bids / "sub-01" / "sub-01_sessions.tsv")
    assert session["head_sha256"] in verified.stdout
    assert session["head_sha256"] in done.stdout


def test_unfinished_and_simulated_sessions_are_exported_and_named(results: Path) -> None:
    cut_journal(results, "02", 12)
    done = export(results)
    assert (done.exit_code, "sub-02/ses-01" in done.stdout) == (0, True)
    bids = results.parent / "bids"
    (session,) = table_of(bids / "sub-02" / "sub-02_sessions.tsv")
    assert session["finished"] == "false"
    answered, planned = (int(session[f"trials_{word}"]) for word in ("answered", "planned"))
    assert 0 < answered < planned
    assert 0 < len(table_of(events_of(bids, "02"))) < len(table_of(events_of(bids, "01")))
    (other,) = table_of(bids / "sub-01" / "sub-01_sessions.tsv")
    assert (other["finished"], other["simulated"]) == ("true", "true")
    readme = (bids / "README").read_text("utf-8")
    assert all(f"sub-{person}/ses-01" in readme for person in ("01", "02"))


@pytest.mark.parametrize("place", [".", "sub-01", "sub-01/ses-01/bids", "sub-x", "withdrawn/bids"])
def test_a_data_set_is_not_among_its_data(results: Path, place: str, no_export: Refused) -> None:
    no_export(results / place)


def test_what_is_no_export_is_refused(results: Path, no_export: Refused, refused: Refused) -> None:
    bids = results.parent / "bids"
    bids.mkdir()
    (bids / "thesis.tex").write_text("all of it", encoding="utf-8")
    assert "thesis.tex" in no_export()
    shutil.rmtree(bids)
    bids.write_text("a file", encoding="utf-8")
    no_export()
    bids.unlink()
    bids.symlink_to(results)
    assert "symbolic" in no_export()
    bids.unlink()
    assert refused("export", results, "--with-sourcedata").count("\n") == 1
    with FileLock(results / "sub-02" / "ses-01" / ".lock"):
        assert "sub-02" in no_export()
    write_withdrawal(
        results, WithdrawalRecord(participant="02", withdrawn="2001-02-03", removed=False)
    )
    assert "participant 02" in no_export()


@pytest.mark.parametrize("what", ["added", "changed", "removed", "linked", "damaged"])
def test_a_changed_export_is_not_replaced(results: Path, what: str, no_export: Refused) -> None:
    bids = exported(results)
    if what == "added":
        (bids / "sub-01" / "notes.txt").write_text("dear", encoding="utf-8")
    elif what == "changed":
        (bids / "README").write_text("better", encoding="utf-8")
    elif what == "removed":
        (bids / "participants.json").unlink()
    elif what == "linked":
        (bids / "README").rename(results.parent / "README")
        (bids / "README").symlink_to(results.parent / "README")
    else:
        (bids / ".tactstrip.json").write_text("[]", encoding="utf-8")
    no_export()
