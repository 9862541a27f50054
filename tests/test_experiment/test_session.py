"""Sessions from folder to trials.csv: killed, torn, damaged, locked, full, resumed."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
from collections import defaultdict
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from experiment.archive.folders import SessionFolder
from experiment.archive.history import replay
from experiment.archive.journal import read_journal
from tactstrip import main

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

    from experiment.archive.journal import Entry

KILLED_AFTER = """
import sys, time
from experiment.archive.journal import Journal
append, lines = Journal.append, int(sys.argv[1])
def append_and_halt(self, *args, **kwargs):
    global lines
    append(self, *args, **kwargs)
    lines -= 1
    if lines == 0:
        print("halted", flush=True)
        time.sleep(600)
Journal.append = append_and_halt
from tactstrip import main
main(sys.argv[2:])
"""


@pytest.fixture
def study_path(tmp_path: Path, quick_study_text: str) -> Path:
    path = tmp_path / "study.toml"
    path.write_text(quick_study_text, encoding="utf-8")
    return path


def arguments(study_path: Path, *more: str) -> list[str]:
    out = str(study_path.parent / "results")
    return ["run", str(study_path), "--participant", "01", "--responder", "simulated",
            "--out", out, *more]  # fmt: skip


def run(study_path: Path, *more: str) -> Result:
    return CliRunner().invoke(main, arguments(study_path, *more))


def folder_of(study_path: Path) -> SessionFolder:
    return SessionFolder(study_path.parent / "results", "01", "01")


def entries_of(study_path: Path) -> tuple[Entry, ...]:
    return read_journal(folder_of(study_path).journal_path).entries


def rows_of(study_path: Path) -> list[dict[str, str]]:
    with (folder_of(study_path).path / "trials.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def kill_after(study_path: Path, lines: int, *more: str) -> bool:
    """Run in a process of its own and kill it after so many lines; False if it ended before."""
    with subprocess.Popen(
        [sys.executable, "-c", KILLED_AFTER, str(lines), *arguments(study_path, *more)],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        halted = any(line == "halted\n" for line in process.stdout)
        process.kill()
    if halted:
        assert process.returncode == -signal.SIGKILL
    return halted


def assert_complete_and_true(study_path: Path, felt_before: tuple[Entry, ...]) -> None:
    """Check the record against the plan, and against what the journal said before the kill."""
    rows = rows_of(study_path)
    plan = folder_of(study_path).read_plan()
    attempts = defaultdict(list)
    for row in rows:
        attempts[int(row["trial"])].append((int(row["attempt"]), row["status"]))
    assert sorted(attempts) == [trial.number for trial in plan.trials]
    for presented in attempts.values():
        assert [attempt for attempt, _ in presented] == list(range(1, len(presented) + 1))
        assert [status for _, status in presented].count("ok") == 1
        assert presented[-1][1] == "ok"
    status_of = {(int(row["trial"]), int(row["attempt"])): row["status"] for row in rows}
    answered = {
        (entry.facts["trial"], entry.facts["attempt"])
        for entry in felt_before
        if entry.event == "response"
    }
    for entry in felt_before:
        if entry.event == "trial_armed":
            key = (entry.facts["trial"], entry.facts["attempt"])
            allowed = {"ok"} if key in answered else {"voided", "indeterminate"}
            assert status_of[key] in allowed
    tokens = [e.facts["token"] for e in entries_of(study_path) if e.event == "trial_armed"]
    assert len(set(tokens)) == len(tokens) == len(rows)


def test_a_session_is_run_from_study_to_trials(study_path: Path) -> None:
    result = run(study_path, "--seed", "1")
    assert result.exit_code == 0, result.stderr
    assert "seed 1" in result.stdout
    assert "all 5 trials are answered" in result.stdout
    assert_complete_and_true(study_path, entries_of(study_path))
    names = {path.name for path in folder_of(study_path).path.iterdir()}
    assert {"plan.json", "header.json", "journal.jsonl", "trials.csv"} <= names
    participants = study_path.parent / "results" / "participants.tsv"
    assert participants.read_text(encoding="utf-8") == "participant_id\nsub-01\n"
    header = json.loads((folder_of(study_path).path / "header.json").read_text("utf-8"))
    assert header["simulated"] is True
    assert header["device_identity"]["emulated"] is True


@pytest.mark.slow
def test_killed_after_any_journal_line_a_session_is_resumed_and_loses_nothing(
    study_path: Path,
) -> None:
    lines = 0
    while True:
        lines += 1
        for path in sorted(study_path.parent.glob("results/**/*"), reverse=True):
            path.rmdir() if path.is_dir() else path.unlink()
        if not kill_after(study_path, lines, "--seed", "1"):
            break
        before = entries_of(study_path)
        assert len(before) == lines
        result = run(study_path, "--resume")
        assert result.exit_code == 0, (lines, result.stderr)
        assert_complete_and_true(study_path, before)
    assert lines > 5 * 5


@pytest.mark.slow
def test_killed_again_and_again_a_session_still_comes_to_its_end(study_path: Path) -> None:
    assert kill_after(study_path, 7, "--seed", "1")
    kills = 1
    while kill_after(study_path, 7, "--resume"):
        kills += 1
        assert kills < 30
    assert kills > 3
    assert run(study_path, "--resume").exit_code == 0
    assert_complete_and_true(study_path, ())


@pytest.mark.process
def test_an_interrupted_simulation_gives_the_answers_of_an_unbroken_one(
    study_path: Path,
) -> None:
    run(study_path, "--seed", "1", "--session", "02")
    unbroken = rows_of_session(study_path, "02")
    kill_after(study_path, 9, "--seed", "1")
    run(study_path, "--resume")
    answers = {r["trial"]: r["response"] for r in rows_of(study_path) if r["attempt"] == "1"}
    assert {t: a for t, a in answers.items() if a != "n/a"}.items() <= unbroken.items()


def rows_of_session(study_path: Path, session: str) -> dict[str, str]:
    path = study_path.parent / "results" / "sub-01" / f"ses-{session}" / "trials.csv"
    with path.open(encoding="utf-8", newline="") as file:
        return {row["trial"]: row["response"] for row in csv.DictReader(file)}


@pytest.mark.process
def test_a_torn_last_line_is_set_aside_and_told(study_path: Path) -> None:
    kill_after(study_path, 9, "--seed", "1")
    journal = folder_of(study_path).journal_path
    journal.write_bytes(journal.read_bytes()[:-20])
    before = entries_of(study_path)
    assert len(before) == 8
    result = run(study_path, "--resume")
    assert result.exit_code == 0
    assert "journal.torn-1" in result.stderr
    assert journal.with_name("journal.torn-1").stat().st_size > 0
    assert_complete_and_true(study_path, before)


def refused(study_path: Path, *more: str) -> str:
    """Run, expect exit 2 with one line, and check that no file of the session changed."""
    before = {p: p.read_bytes() for p in folder_of(study_path).path.iterdir()}
    result = run(study_path, *more)
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert len(result.stderr.splitlines()) == 1
    assert {p: p.read_bytes() for p in folder_of(study_path).path.iterdir()} == before
    return result.stderr


@pytest.mark.process
def test_a_flipped_byte_in_the_middle_is_refused_with_its_line(study_path: Path) -> None:
    kill_after(study_path, 9, "--seed", "1")
    journal = folder_of(study_path).journal_path
    raw = bytearray(journal.read_bytes())
    raw[len(raw) // 2] ^= 1
    journal.write_bytes(raw)
    line = raw[: len(raw) // 2].count(b"\n") + 1
    assert f"journal.jsonl:{line}: this line is damaged" in refused(study_path, "--resume")


@pytest.mark.process
def test_a_changed_plan_is_refused(study_path: Path) -> None:
    kill_after(study_path, 9, "--seed", "1")
    plan = folder_of(study_path).plan_path
    plan.write_text(plan.read_text("utf-8").replace("160.0", "161.0", 1), encoding="utf-8")
    assert "changed after it was sealed" in refused(study_path, "--resume")


@pytest.mark.process
def test_a_plan_of_another_session_is_refused(study_path: Path) -> None:
    run(study_path, "--seed", "2", "--session", "02")
    kill_after(study_path, 9, "--seed", "1")
    other = SessionFolder(study_path.parent / "results", "01", "02").plan_path
    folder_of(study_path).plan_path.write_bytes(other.read_bytes())
    assert "must be the plan of participant 01, session 01" in refused(study_path, "--resume")


@pytest.mark.slow
def test_a_journal_of_another_plan_is_refused(study_path: Path) -> None:
    kill_after(study_path, 9, "--seed", "1")
    journal = folder_of(study_path).journal_path.read_bytes()
    for path in folder_of(study_path).path.iterdir():
        path.unlink()
    kill_after(study_path, 9, "--seed", "2")
    folder_of(study_path).journal_path.write_bytes(journal)
    assert "the journal belongs to the plan" in refused(study_path, "--resume")


@pytest.mark.process
def test_a_second_process_on_the_same_session_is_refused(study_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", KILLED_AFTER, "9", *arguments(study_path, "--seed", "1")],
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert "halted\n" in iter(process.stdout.readline, "")
        assert "another process is running this session" in refused(study_path, "--resume")
        assert "exists already" in refused(study_path)
        process.kill()
    assert run(study_path, "--resume").exit_code == 0


@pytest.mark.slow
def test_the_same_participant_twice_is_refused(study_path: Path) -> None:
    run(study_path, "--seed", "1")
    assert "this session exists already" in refused(study_path)
    assert run(study_path, "--session", "02").exit_code == 0


def test_nothing_to_resume_is_said(study_path: Path) -> None:
    result = run(study_path, "--resume")
    assert result.exit_code == 2
    assert "no session to resume" in result.stderr
    assert not (study_path.parent / "results").exists()


@pytest.mark.process
def test_resume_refuses_options_that_contradict_the_session(
    study_path: Path, tmp_path: Path
) -> None:
    kill_after(study_path, 9, "--seed", "1")
    assert "--seed must be that of the session, 1" in refused(study_path, "--resume", "--seed", "2")
    levels = tmp_path / "levels.toml"
    levels.write_text("levels_vpp = [70, 150]", encoding="utf-8")
    told = refused(study_path, "--resume", "--levels", str(levels))
    assert "--levels must be those of the session" in told
    text = study_path.read_text("utf-8")
    for edit in (("both_trials = 1", "both_trials = 2"), ("[80, 160]", "[70, 160]")):
        study_path.write_text(text.replace(*edit), encoding="utf-8")
        assert "not the study that this session was begun with" in refused(study_path, "--resume")
    study_path.write_text("# a comment changes nothing\n" + text, encoding="utf-8")
    assert run(study_path, "--resume", "--seed", "1").exit_code == 0


@pytest.mark.process
def test_placed_levels_are_sealed_into_the_plan_and_kept_on_resume(
    study_path: Path, tmp_path: Path
) -> None:
    levels = tmp_path / "levels.toml"
    levels.write_text('participant = "01"\nlevels_vpp = [70, 150]', encoding="utf-8")
    assert kill_after(study_path, 9, "--seed", "1", "--levels", str(levels))
    assert run(study_path, "--resume").exit_code == 0
    assert {r["level_vpp"] for r in rows_of(study_path)} <= {"70", "150"}


@pytest.mark.slow
def test_a_finished_session_only_gets_its_table_again(study_path: Path) -> None:
    run(study_path, "--seed", "1")
    table = folder_of(study_path).path / "trials.csv"
    whole, lines = table.read_bytes(), len(entries_of(study_path))
    table.unlink()
    assert run(study_path, "--resume").exit_code == 0
    assert table.read_bytes() == whole
    assert len(entries_of(study_path)) == lines


@pytest.mark.slow
def test_export_builds_the_tables_anew_from_the_journals(study_path: Path) -> None:
    run(study_path, "--seed", "1")
    table = folder_of(study_path).path / "trials.csv"
    whole = table.read_bytes()
    table.write_text("lost", encoding="utf-8")
    result = CliRunner().invoke(main, ["export", str(study_path.parent / "results")])
    assert result.exit_code == 0
    assert table.read_bytes() == whole
    result = CliRunner().invoke(main, ["export", str(study_path.parent / "nowhere")])
    assert result.exit_code == 2


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="file size limits are a POSIX feature")
def test_on_a_full_disk_the_session_stops_and_nothing_recorded_is_lost(study_path: Path) -> None:
    limited = """
import resource, sys
from experiment.archive.journal import Journal
append, lines = Journal.append, int(sys.argv[1])
def append_until_full(self, *args, **kwargs):
    global lines
    lines -= 1
    if lines == 0:
        size = self._path.stat().st_size + 30
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    append(self, *args, **kwargs)
Journal.append = append_until_full
from tactstrip import main
main(sys.argv[2:])
"""
    for lines in (1, 3, 4, 5, 7):
        session = f"{lines:02d}"
        done = subprocess.run(
            [sys.executable, "-c", limited, str(lines),
             *arguments(study_path, "--seed", "1", "--session", session)],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 4, done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert "journal.jsonl: cannot be written" in done.stderr
        assert "make room, then go on with --resume" in done.stderr
        folder = SessionFolder(study_path.parent / "results", "01", session)
        assert len(read_journal(folder.journal_path).entries) == lines - 1
        result = run(study_path, "--resume", "--session", session)
        assert result.exit_code == 0, result.stderr
        history = replay(folder.read_plan(), read_journal(folder.journal_path).entries)
        assert sum(row.status == "ok" for row in history.rows) == 5
        assert history.finished


@pytest.mark.process
def test_a_session_that_cannot_be_created_leaves_no_session(study_path: Path) -> None:
    limited = """
import resource, sys
from tactstrip import main
resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))
main(sys.argv[1:])
"""
    done = subprocess.run(
        [sys.executable, "-c", limited, *arguments(study_path, "--seed", "1")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert "header.json: File too large; make room, then run it again" in done.stderr
    assert run(study_path, "--seed", "1").exit_code == 0


@pytest.mark.process
def test_a_full_disk_at_the_end_says_that_the_record_is_whole(study_path: Path) -> None:
    limited = """
import resource, sys
from experiment.archive import folders
write = folders.write_atomically
def write_until_full(path, text, *, disk):
    if path.name == "trials.csv":
        resource.setrlimit(resource.RLIMIT_FSIZE, (200, 200))
    write(path, text, disk=disk)
folders.write_atomically = write_until_full
from tactstrip import main
main(sys.argv[1:])
"""
    done = subprocess.run(
        [sys.executable, "-c", limited, *arguments(study_path, "--seed", "1")],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 4, done.stderr
    assert "trials.csv: cannot be written" in done.stderr
    assert run(study_path, "--resume").exit_code == 0
    assert_complete_and_true(study_path, ())


@pytest.mark.slow
def test_what_a_killed_process_left_half_written_is_swept_up(study_path: Path) -> None:
    folder = folder_of(study_path)
    folder.path.mkdir(parents=True)
    (folder.path / ".plan.json.x1y2.tmp").write_text("half", encoding="utf-8")
    assert run(study_path).exit_code == 0
    assert not list(folder.path.glob(".*.tmp"))


@pytest.mark.slow
def test_a_table_of_participants_that_is_none_is_refused_by_name(study_path: Path) -> None:
    table = study_path.parent / "results" / "participants.tsv"
    table.parent.mkdir()
    for content in (b"\xff\xfe", b"name\tage\n", b""):
        table.write_bytes(content)
        result = run(study_path)
        assert result.exit_code == 2
        assert "participants.tsv" in result.stderr
        assert table.read_bytes() == content
        assert not folder_of(study_path).plan_path.exists()
    table.write_text("participant_id\tage\nsub-00\t20\n", encoding="utf-8")
    assert run(study_path).exit_code == 0
    assert table.read_text("utf-8") == "participant_id\tage\nsub-00\t20\nsub-01\tn/a\n"


@pytest.mark.slow
def test_one_session_that_cannot_be_exported_does_not_stop_the_others(study_path: Path) -> None:
    for session in ("01", "02", "03"):
        run(study_path, "--session", session)
    first = folder_of(study_path)
    raw = bytearray(first.journal_path.read_bytes())
    raw[100] ^= 1
    first.journal_path.write_bytes(raw)
    third = SessionFolder(first.root, "01", "03")
    third.trials_path.unlink()
    third.journal_path.unlink()
    result = CliRunner().invoke(main, ["export", str(first.root)])
    assert result.exit_code == 2
    assert "this line is damaged" in result.stderr
    assert len(result.stdout.splitlines()) == 2
    assert third.trials_path.read_text("utf-8").count("\n") == 1


# --- displacements --------------------------------------------------------------------------------

EVERY_KIND = """
[burst]
window = "hann"
[design]
levels_vpp = [80, 160]
trials_per_side = 2
both_trials = 1
blank_trials = 1
practice_trials = 1
break_every = 0
foreperiod_s = [0.01, 0.02]
responses = ["left", "right", "both", "none"]
"""
UNKNOWN = """
[[actuator]]
side = "left"
x_mm = -35
diameter_mm = 12.8
[[actuator]]
side = "right"
x_mm = 35
diameter_mm = 12.8
"""


def test_every_row_has_the_displacements_of_the_sealed_matrix(study_path: Path) -> None:
    study_path.write_text(EVERY_KIND, encoding="utf-8")
    assert run(study_path, "--seed", "1").exit_code == 0
    rows = rows_of(study_path)
    gains = folder_of(study_path).read_plan().gains_of("main")
    assert {row["kind"] for row in rows} == {"practice", "single", "both", "blank"}
    for row in rows:
        left_vpp, right_vpp = float(row["level_left_vpp"]), float(row["level_right_vpp"])
        peaks_um = gains.peaks_um(left_vpp, right_vpp)
        assert peaks_um == (float(row["peak_left_um"]), float(row["peak_right_um"]))
        assert row["displacement_basis"] == "measured"
        assert (row["peak_left_um"] == "0") == (row["kind"] == "blank")
        for column in ("peak_left_um", "peak_right_um"):
            digits = row[column].replace(".", "").strip("0")
            assert len(digits) <= 4


@pytest.mark.slow
def test_without_a_stated_displacement_the_columns_say_so(study_path: Path) -> None:
    study_path.write_text(EVERY_KIND + UNKNOWN, encoding="utf-8")
    assert run(study_path, "--seed", "1").exit_code == 0
    assert folder_of(study_path).read_plan().gains[0].bases == (None, None)
    for row in rows_of(study_path):
        told = (row["peak_left_um"], row["peak_right_um"], row["displacement_basis"])
        assert told == ("n/a", "n/a", "n/a")


@pytest.mark.process
def test_a_session_never_computes_its_matrix_again(
    study_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kill_after(study_path, 9, "--seed", "1")

    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr("experiment.study.physics.study_gains", never)
    assert run(study_path, "--resume").exit_code == 0
    results = str(study_path.parent / "results")
    assert CliRunner().invoke(main, ["export", results]).exit_code == 0
    assert "measured" in {row["displacement_basis"] for row in rows_of(study_path)}


@pytest.mark.slow
def test_a_chosen_window_is_played_recorded_and_kept_on_resume(
    study_path: Path, short_study_text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = short_study_text
    auto = '[burst]\nwindow = "auto"\nwanted_level_db = {}\n'
    study_path.write_text(text + auto.format(-40), encoding="utf-8")
    kill_after(study_path, 9, "--seed", "1")
    header = json.loads((folder_of(study_path).path / "header.json").read_text("utf-8"))
    stimulus = header["stimuli"]["main"]
    assert stimulus["window"] in {"tukey", "gaussian", "hann"}
    assert stimulus["wanted_level_db"] == -40

    def never(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr("experiment.study.physics.chosen_burst", never)
    assert run(study_path, "--resume").exit_code == 0
    monkeypatch.undo()
    study_path.write_text(text + auto.format(-41), encoding="utf-8")
    assert "not the study that this session was begun with" in refused(study_path, "--resume")


@pytest.mark.slow
def test_a_changed_click_ends_the_resume(study_path: Path, short_study_text: str) -> None:
    click = study_path.parent / "click.csv"
    click.write_text("0\n1\n2\n1\n0\n-1\n-2\n-1\n0\n", encoding="utf-8")
    text = short_study_text + '[burst]\nfile = "click.csv"\n'
    text += 'accept_unfit = "a click of 12 kHz"\n'
    study_path.write_text(text, encoding="utf-8")
    assert kill_after(study_path, 9, "--seed", "1")
    whole = click.read_bytes()
    click.write_text("0\n1\n-1\n0\n", encoding="utf-8")
    assert "not the study that this session was begun with" in refused(study_path, "--resume")
    click.write_bytes(whole)
    assert run(study_path, "--resume").exit_code == 0
    header = json.loads((folder_of(study_path).path / "header.json").read_text("utf-8"))
    assert header["stimuli"]["main"] == {
        "file": "click.csv",
        "sample_rate_hz": 48000.0,
        "samples": 9,
    }


@pytest.mark.process
def test_a_session_of_another_schema_is_refused_so_nothing_changed(study_path: Path) -> None:
    assert kill_after(study_path, 9, "--seed", "1")
    folder = folder_of(study_path)
    contents = json.loads(folder.plan_path.read_text("utf-8"))
    folder.plan_path.write_text(json.dumps(contents | {"schema": 2}), encoding="utf-8")
    told = f"{folder.plan_path}: the plan's schema must be 3; got 2"
    assert told in refused(study_path, "--resume")
    before = {path: path.read_bytes() for path in folder.path.iterdir()}
    exported = CliRunner().invoke(main, ["export", str(folder.root)])
    assert (exported.exit_code, exported.stderr) == (2, f"error: {told}\n")
    assert {path: path.read_bytes() for path in folder.path.iterdir()} == before


@pytest.mark.slow
def test_an_unfit_place_of_the_actuators_stops_a_run_before_anything_is_written(
    study_path: Path,
) -> None:
    near = UNKNOWN.replace("-35", "-8").replace("= 35", "= 8")
    study_path.write_text(study_path.read_text("utf-8") + near, encoding="utf-8")
    result = run(study_path)
    assert result.exit_code == 1
    assert "the limit is -20 dB" in result.stderr
    assert not (study_path.parent / "results").exists()
