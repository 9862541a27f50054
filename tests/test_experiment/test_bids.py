"""The BIDS export: what the validator says of it, what is in it, what is not, and its place."""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner
from filelock import FileLock

from experiment.archive.bids_tables import EVENT_COLUMNS, MEANINGS
from experiment.archive.folders import SessionFolder
from experiment.archive.manifest import NAME
from experiment.archive.participants import Tombstone, write_tombstone
from experiment.terms.record import COLUMNS
from tactstrip import main
from tests.test_experiment.sessions import contents

if TYPE_CHECKING:
    from collections.abc import Callable

    from click.testing import Result

    from tests.conftest import Refused, Rows, Run

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
DATASET = """
[dataset]
name = "Fingers on a strip"
authors = ["A. One", "B. Two"]
license = "CC0"
acknowledgements = "Nobody"
how_to_acknowledge = "Cite it"
funding = ["None"]
ethics_approvals = ["None needed"]
references_and_links = ["A paper"]
institution_name = "An institute"
institution_address = "A street"
task_description = "Say where a vibration is felt"
"""


def dry_run(folder: Path, text: str | None, participants: int) -> Path:
    study, out = folder / "study.toml", folder / "results"
    if text is not None:
        study.write_text(text, encoding="utf-8")
    options = ["--participants", str(participants), "--seed", "1", "--out", str(out)]
    done = CliRunner().invoke(main, ["dry-run", *([str(study)] if text else []), *options])
    assert done.exit_code == 0, done.stderr
    return out


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return dry_run(tmp_path_factory.mktemp("small"), STUDY, 2)


@pytest.fixture
def results(small: Path, tmp_path: Path) -> Path:
    return shutil.copytree(small, tmp_path / "results")


@pytest.fixture
def described(tmp_path: Path) -> Path:
    return dry_run(tmp_path, STUDY + DATASET, 1)


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


@pytest.fixture(scope="session")
def validator() -> Path:
    bundle = pytest.importorskip(
        "bids_validator_deno", reason="bids-validator-deno is not installed (extra test)"
    )
    return Path(bundle.__path__[0])


def issues(validator: Path, bids: Path) -> list[dict[str, Any]]:
    """Validate a data set without any right to the network, with an exit code of 0."""
    from deno import find_deno_bin

    rights = ["--allow-read", "--allow-env", "--allow-write", "--deny-net", "--no-prompt"]
    command = [os.fsdecode(find_deno_bin()), *rights, str(validator / "bids-validator.js")]
    done = subprocess.run(
        [*command, str(bids), "--format", "json", "--max-rows", "-1"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found: list[dict[str, Any]] = json.loads(done.stdout)["issues"]["issues"]
    return found


def assert_only_missing_facts(found: list[dict[str, Any]]) -> None:
    assert {issue["severity"] for issue in found} <= {"warning"}
    codes = {issue["code"] for issue in found}
    assert all(code.endswith("_KEY_RECOMMENDED") or code == "TOO_FEW_AUTHORS" for code in codes)


@pytest.mark.slow
def test_the_validator_accepts_a_dry_run_and_misses_only_facts_that_the_study_lacks(
    validator: Path, tmp_path: Path
) -> None:
    bids = exported(dry_run(tmp_path, None, 5))
    found = issues(validator, bids)
    assert_only_missing_facts(found)
    once = ("HEDVersion", "License", "SourceDatasets")
    assert Counter(issue.get("subCode", issue["code"]) for issue in found) == {
        **dict.fromkeys(("TOO_FEW_AUTHORS", *once), 1),
        **dict.fromkeys(
            ("CogAtlasID", "CogPOID", "InstitutionAddress", "InstitutionName",
             "InstitutionalDepartmentName", "Instructions", "TaskDescription"),
            5,
        ),
    }  # fmt: skip


@pytest.mark.process
def test_the_validators_own_command_says_the_same(validator: Path, results: Path) -> None:
    bids = exported(results)
    done = subprocess.run(
        [sys.executable, "-c", "from bids_validator_deno import cli; cli()", str(bids),
         "--format", "json", "--max-rows", "-1"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    told = json.loads(done.stdout)["issues"]["issues"]
    assert sorted(map(str, told)) == sorted(map(str, issues(validator, bids)))


@pytest.mark.slow
def test_the_validator_accepts_broken_off_sessions_sources_and_columns_of_participants(
    validator: Path, results: Path
) -> None:
    cut_journal(results, "01", 12)
    cut_journal(results, "02", 1)
    bids = exported(results, "--with-sourcedata")
    assert len(table_of(events_of(bids, "02"))) == 0
    assert_only_missing_facts(issues(validator, bids))


@pytest.mark.slow
def test_facts_that_the_study_gives_are_not_missed(validator: Path, described: Path) -> None:
    bids = exported(described)
    missed = {issue.get("subCode") for issue in issues(validator, bids)}
    assert missed == {"HEDVersion", "SourceDatasets", "CogAtlasID", "CogPOID",
                      "InstitutionalDepartmentName", "Instructions"}  # fmt: skip


def test_events_are_the_trials_under_other_names(results: Path, rows_of: Rows) -> None:
    events = table_of(events_of(exported(results)))
    names = list(events[0])
    assert names[:4] == ["onset", "duration", "trial_type", "response_time"]
    trials = rows_of(results)
    assert len(trials) == len(events)
    for trial, event in zip(trials, events, strict=True):
        old = {"onset": "onset_s", "trial_type": "kind", "response_time": "rt_s"}
        same = {name: trial[old.get(name, name)] for name in names if name != "duration"}
        assert same == {name: event[name] for name in names if name != "duration"}
        assert event["duration"] == ("0" if event["trial_type"] == "blank" else "0.002")
    assert {event["trial_type"] for event in events} == {"single", "both", "blank", "practice"}
    assert {event["simulated"] for event in events} == {"true"}
    missed = [event["response_time"] for event in events if event["response"] == "timeout"]
    assert missed
    assert set(missed) == {"n/a"}


def test_every_column_and_every_word_is_described(results: Path) -> None:
    bids = exported(results)
    for table in bids.rglob("*.tsv"):
        sidecar = json.loads(table.with_suffix(".json").read_text("utf-8"))
        for row in table_of(table):
            for name, value in row.items():
                assert sidecar[name]["Description"]
                assert value in {*sidecar[name].get("Levels", [value]), "n/a"}
    events = json.loads(events_of(bids).with_suffix(".json").read_text("utf-8"))
    assert set(events["condition"]["Levels"]) == {"main"}


def test_the_sidecar_has_no_second_definition_of_a_column() -> None:
    assert {column.source for column in EVENT_COLUMNS} == {None, *(c.name for c in COLUMNS)}
    words = {column.name: set(column.choices) for column in COLUMNS if column.choices}
    assert {name: set(meanings) for name, meanings in MEANINGS.items()} == words
    described = {column.source: column for column in EVENT_COLUMNS}
    for column in COLUMNS:
        assert described[column.name].description.lower().startswith(column.description.lower())
        assert (described[column.name].units is not None) == column.name.endswith(
            ("_s", "_vpp", "_um")
        )


def test_participants_have_the_declared_columns_and_no_other(results: Path) -> None:
    (results / "participants.tsv").write_text(
        "participant_id\tage_group\tphone\nsub-01\t20-29\ttel-555\nsub-09\tn/a\ttel-556\n",
        encoding="utf-8",
    )
    done = export(results)
    bids = results.parent / "bids"
    assert (bids / "participants.tsv").read_text("utf-8") == (
        "participant_id\thandedness\tage_group\nsub-01\tn/a\t20-29\nsub-02\tn/a\tn/a\n"
    )
    sidecar = json.loads((bids / "participants.json").read_text("utf-8"))
    assert sidecar["handedness"]["Description"] == "by questionnaire"
    assert set(sidecar["handedness"]["Levels"]) == {"left", "right"}
    # no such letters can stand in a hash
    assert not any(b"tel-55" in content for content in contents(bids).values())


def test_a_value_that_is_no_declared_level_is_refused(results: Path, no_export: Refused) -> None:
    table = "participant_id\thandedness\nsub-02\tboth\n"
    (results / "participants.tsv").write_text(table, encoding="utf-8")
    assert "participants.tsv, participant 02:" in no_export()


def test_nothing_is_invented_about_the_data_set(results: Path) -> None:
    bids = exported(results)
    description = json.loads((bids / "dataset_description.json").read_text("utf-8"))
    assert set(description) == {"Name", "BIDSVersion", "DatasetType", "Authors", "GeneratedBy"}
    assert description["Authors"] == []
    assert description["Name"] == "two-finger_pilot (simulated)"
    assert [maker["Name"] for maker in description["GeneratedBy"]] == ["tactstrip"]


@pytest.mark.slow
def test_the_study_describes_the_data_set(described: Path) -> None:
    bids = exported(described)
    description = json.loads((bids / "dataset_description.json").read_text("utf-8"))
    assert description["Authors"] == ["A. One", "B. Two"]
    assert description["EthicsApprovals"] == ["None needed"]
    sidecar = json.loads(events_of(bids).with_suffix(".json").read_text("utf-8"))
    assert sidecar["InstitutionName"] == "An institute"
    assert sidecar["TaskDescription"] == "Say where a vibration is felt"


@pytest.mark.slow
def test_host_and_operator_are_only_in_sourcedata(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("platform.node", lambda: "labhost7")
    study, results = tmp_path / "study.toml", tmp_path / "results"
    study.write_text(STUDY, encoding="utf-8")
    words = ["--participant", "01", "--responder", "simulated", "--operator", "grete"]
    done = CliRunner().invoke(main, ["run", str(study), *words, "--out", str(results)])
    assert done.exit_code == 0, done.output
    bids = exported(results)
    assert not (bids / "sourcedata").exists()
    everything = b"".join(contents(bids).values())
    assert b"labhost7" not in everything
    assert b"grete" not in everything
    assert b"journal" not in everything
    exported(results, "--with-sourcedata")
    for name in ("plan.json", "header.json", "journal.jsonl"):
        source = results / "sub-01" / "ses-01" / name
        copy = bids / "sourcedata" / "sub-01" / "ses-01" / name
        assert copy.read_bytes() == source.read_bytes()
    verified = CliRunner().invoke(main, ["verify", str(bids / "sourcedata")])
    assert verified.exit_code == 0
    (session,) = table_of(bids / "sub-01" / "sub-01_sessions.tsv")
    assert f"head {session['head_sha256']}" in verified.stdout
    assert session["head_sha256"] in done.stdout


def test_sourcedata_without_a_data_set_is_refused(results: Path, refused: Refused) -> None:
    assert refused("export", results, "--with-sourcedata").count("\n") == 1


def test_unfinished_and_simulated_sessions_are_exported_and_named(results: Path) -> None:
    cut_journal(results, "02", 12)
    done = export(results)
    assert done.exit_code == 0
    bids = results.parent / "bids"
    (session,) = table_of(bids / "sub-02" / "sub-02_sessions.tsv")
    assert session["finished"] == "false"
    answered = session["trials_answered"]
    named = f"sub-02/ses-01 ({answered} of {session['trials_planned']} trials answered)"
    assert f"not finished: {named}" in done.stdout
    assert "simulated: 2 of 2 sessions" in done.stdout
    readme = (bids / "README").read_text("utf-8")
    assert f"Not finished: {named}" in readme
    assert "-01/ses-01, sub-02/ses-01" in readme
    assert "the .json" in readme
    assert 0 < len(table_of(events_of(bids, "02"))) < len(table_of(events_of(bids, "01")))
    (other,) = table_of(bids / "sub-01" / "sub-01_sessions.tsv")
    assert (other["finished"], other["simulated"]) == ("true", "true")


def test_a_damaged_journal_stops_the_export(results: Path, no_export: Refused) -> None:
    journal = results / "sub-02" / "ses-01" / "journal.jsonl"
    raw = bytearray(journal.read_bytes())
    raw[100] ^= 1
    journal.write_bytes(raw)


@pytest.mark.parametrize("out", [None, "bids"])
def test_a_plan_of_another_schema_ends_it_before_anything_is_written(
    results: Path, out: str | None
) -> None:
    plan = results / "sub-02" / "ses-01" / "plan.json"
    held = json.loads(plan.read_text("utf-8"))
    plan.write_text(json.dumps(held | {"schema": 2}), encoding="utf-8")
    for session in ("01", "02"):
        folder = results / f"sub-{session}" / "ses-01"
        (folder / "trials.csv").unlink()
        (folder / ".lock").unlink(missing_ok=True)
    before = {path: path.stat().st_mtime_ns for path in results.parent.rglob("*")}
    to = [] if out is None else ["--bids", str(results.parent / out)]
    done = CliRunner().invoke(main, ["export", str(results), *to])
    assert done.exit_code == 2
    assert done.stderr == f"error: {plan}: the plan's schema must be 3; got 2\n"
    assert {path: path.stat().st_mtime_ns for path in results.parent.rglob("*")} == before


def test_a_running_session_stops_the_export(results: Path, no_export: Refused) -> None:
    with FileLock(results / "sub-02" / "ses-01" / ".lock"):


def test_whoever_has_begun_to_withdraw_is_not_exported(results: Path, no_export: Refused) -> None:
    write_tombstone(results, Tombstone(participant="02", withdrawn="2001-02-03", removed=False))
    assert "participant 02" in no_export()


@pytest.mark.parametrize("place", [".", "sub-01", "sub-01/ses-01/bids", "sub-x", "withdrawn/bids"])
def test_a_data_set_is_not_among_its_data(results: Path, place: str, no_export: Refused) -> None:


def test_what_is_no_export_is_refused(results: Path, no_export: Refused) -> None:
    bids = results.parent / "bids"
    bids.mkdir()
    (bids / "thesis.tex").write_text("all of it", encoding="utf-8")
    shutil.rmtree(bids)
    bids.write_text("a file", encoding="utf-8")
    bids.unlink()
    bids.symlink_to(results)
    assert "symbolic link" in no_export()


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
        (bids / NAME).write_text("[]", encoding="utf-8")


def test_an_unchanged_export_and_an_empty_folder_are_replaced(results: Path) -> None:
    (results.parent / "bids").mkdir()
    first = contents(exported(results))
    assert contents(exported(results)) == first
    shutil.rmtree(results / "sub-02")
    bids = exported(results)
    assert not (bids / "sub-02").exists()
    assert sorted(path.name for path in results.parent.iterdir()) == ["bids", "results"]


@pytest.mark.parametrize("place", ["bids", "new/bids", "./bids/../bids", "."])
def test_a_data_set_is_named_from_the_folder_in_which_one_stands(
    results: Path, place: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = results.parent / "work"
    (work if place == "." else work / "bids").mkdir(parents=True)
    with monkeypatch.context() as patch:
        patch.chdir(work)
        done = run("export", "../results", "--bids", place)
    assert done.exit_code == 0, done.stderr
    assert (work / place / "dataset_description.json").is_file()


@pytest.mark.slow
def test_an_export_killed_anywhere_leaves_the_old_or_the_new_one_and_is_run_again(
    results: Path, kill_at: Callable[..., int | None]
) -> None:
    bids = results.parent / "bids"
    old_bids = contents(exported(results))
    shutil.copytree(bids, results.parent / "kept")
    shutil.rmtree(results / "sub-02")
    arguments = ("export", str(results), "--bids", str(bids))
    steps = kill_at(10**6, *arguments)
    assert steps is not None
    new_bids = contents(bids)
    assert new_bids != old_bids
    seen = set()
    for step in (1, 4, 9, 15, 22, *range(steps - 44, steps + 1, 4), steps):
        shutil.rmtree(bids)
        shutil.copytree(results.parent / "kept", bids)
        assert kill_at(step, *arguments) is None
        beside = results.parent / ".bids.tactstrip-old"
        if bids.exists():
            found = contents(bids)
            assert found in (old_bids, new_bids)
            seen.add("old" if found == old_bids else "new")
        else:
            assert contents(beside) == old_bids
            seen.add("beside")
        assert contents(exported(results)) == new_bids
        assert sorted(path.name for path in results.parent.iterdir()) == ["bids", "kept", "results"]
    assert {"old", "new"} <= seen


def test_a_withdrawal_lists_the_exports_that_hold_the_person(results: Path, run: Run) -> None:
    bids = exported(results)
    arguments = ("withdraw", results, "--participant", "01", "--also", bids.parent)
    done = run(*arguments, typed="01\n")
    assert done.exit_code == 0
    assert f"  BIDS data set: {bids}\n" in done.stdout
    exported(results)
    done = run(*arguments)
    assert done.exit_code == 0
