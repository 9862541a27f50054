"""Sessions from folder to trials.csv: killed, torn, damaged, locked, full, resumed."""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from typing import TYPE_CHECKING

import pytest

from tests.plates import on_paper_plate
from tests.test_experiment.sessions import Sessions, contents

if TYPE_CHECKING:
    from pathlib import Path

    from experiment import Entry
    from tests.conftest import Run

SIMULATED = ("--responder", "simulated")
SEED = (*SIMULATED, "--seed", "1")
RESUME = (*SIMULATED, "--resume")


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    return Sessions(tmp_path, quick_study_text)


@pytest.fixture(scope="module")
def killed_once(tmp_path_factory: pytest.TempPathFactory, quick_study_text: str) -> Path:
    folder = tmp_path_factory.mktemp("killed")
    assert Sessions(folder, quick_study_text).crash(9, *SEED)
    return folder


@pytest.fixture
def killed(killed_once: Path, tmp_path: Path, quick_study_text: str) -> Sessions:
    """A session that was killed after nine lines."""
    return Sessions(shutil.copytree(killed_once, tmp_path / "killed"), quick_study_text)


def assert_complete_and_true(sessions: Sessions, felt_before: list[Entry]) -> None:
    """Check the record against the plan, and against what the journal said before the kill."""
    rows = sessions.rows()
    attempts = defaultdict(list)
    for row in rows:
        attempts[int(row["trial"])].append((int(row["attempt"]), row["status"]))
    assert sorted(attempts) == [trial.number for trial in sessions.folder().read_plan().trials]
    for presented in attempts.values():
        assert [attempt for attempt, _ in presented] == list(range(1, len(presented) + 1))
        assert [status for _, status in presented].count("ok") == 1
        assert presented[-1][1] == "ok"
    status_of: dict[object, str] = {
        (int(row["trial"]), int(row["attempt"])): row["status"] for row in rows
    }
    lines = [entry.line.model_dump() for entry in felt_before]
    named = [(line["event"], (line.get("trial"), line.get("attempt"))) for line in lines]
    for event, key in named:
        if event == "trial_armed":
            answered = ("response", key) in named
            assert status_of[key] in ({"ok"} if answered else {"voided", "indeterminate"})
    tokens = [line["token"] for line in sessions.lines("trial_armed")]
    assert len(set(tokens)) == len(tokens) == len(rows)


def refused(sessions: Sessions, *more: str) -> str:
    """Run, expect exit 2 with one line, and check that no file of the session changed."""
    before = contents(sessions.folder().path)
    result = sessions.run(*SIMULATED, *more)
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    assert len(result.stderr.splitlines()) == 1
    assert contents(sessions.folder().path) == before
    return result.stderr


def test_a_session_is_run_from_study_to_trials(sessions: Sessions) -> None:
    result = sessions.run(*SEED)
    assert result.exit_code == 0, result.stderr
    assert_complete_and_true(sessions, sessions.entries())
    names = {path.name for path in sessions.folder().path.iterdir()}
    assert {"plan.json", "header.json", "journal.jsonl", "trials.csv"} <= names
    table = (sessions.out / "participants.tsv").read_text(encoding="utf-8")
    assert table == "participant_id\nsub-01\n"
    header = sessions.header()
    assert header["simulated"] is True
    assert header["device_identity"]["emulated"] is True
    refused(sessions)  # it exists already


def test_a_plan_or_journal_that_was_changed_or_is_anothers_is_refused(killed: Sessions) -> None:
    killed.run(*SIMULATED, "--seed", "2", "--session", "02")
    plan, journal = killed.folder().plan_path, killed.folder().journal_path
    sealed, whole = plan.read_bytes(), journal.read_bytes()
    middle = len(whole) // 2
    flipped = bytes([*whole[:middle], whole[middle] ^ 1, *whole[middle + 1 :]])
    line = whole[:middle].count(b"\n") + 1
    old = json.dumps(json.loads(sealed) | {"schema": 2}).encode()
    for path, raw, named in (
        (journal, flipped, f"journal.jsonl:{line}:"),
        (plan, sealed.replace(b"160.0", b"161.0", 1), "plan"),
        (plan, killed.folder("02").plan_path.read_bytes(), "session 01"),
        (journal, killed.folder("02").journal_path.read_bytes(), "plan"),
        (plan, old, "must be 6; got 2"),
    ):
        before = path.read_bytes()
        path.write_bytes(raw)
        assert named in refused(killed, "--resume")
        path.write_bytes(before)


def test_resume_refuses_options_that_contradict_it(killed: Sessions, tmp_path: Path) -> None:
    assert "--seed" in refused(killed, "--resume", "--seed", "2")
    levels = tmp_path / "levels.toml"
    levels.write_text("levels_vpp = [70, 150]", encoding="utf-8")
    assert "--levels" in refused(killed, "--resume", "--levels", str(levels))
    text = killed.text
    for edit in (("both_trials = 1", "both_trials = 2"), ("[80, 160]", "[70, 160]")):
        killed.write(text.replace(*edit))
        refused(killed, "--resume")
    killed.write("# a comment changes nothing\n" + text)
    assert killed.run(*RESUME, "--seed", "1").exit_code == 0
    nobody = killed.run(*RESUME, "--session", "09")
    assert (nobody.exit_code, killed.folder("09").path.exists()) == (2, False)


@pytest.mark.slow
def test_levels_of_each_condition_are_kept_on_resume_and_verified(
    sessions: Sessions, tmp_path: Path, run: Run
) -> None:
    sessions.write(sessions.text + CONDITIONS)
    levels = tmp_path / "levels.toml"
    levels.write_text('participant = "01"\nlevels_vpp = [70, 150]', encoding="utf-8")
    assert "levels.toml: levels_vpp" in refused(sessions, "--levels", str(levels))
    assert not sessions.out.exists()
    levels.write_text("[levels_vpp]\nx = [70, 150]\ny = [31, 41.5]\n", encoding="utf-8")
    assert sessions.crash(9, *SEED, "--levels", str(levels))
    assert sessions.run(*RESUME, "--levels", str(levels)).exit_code == 0
    presented = {(row["condition"], row["level_vpp"]) for row in sessions.rows()}
    presented -= {("x", "n/a"), ("y", "n/a")}
    assert presented <= {("x", "70"), ("x", "150"), ("y", "31"), ("y", "41.5")}
    assert {condition for condition, _ in presented} == {"x", "y"}
    assert run("verify", sessions.out).exit_code == 0
    levels.write_text("[levels_vpp]\nx = [70, 150]\ny = [31, 42]\n", encoding="utf-8")
    assert "--levels" in refused(sessions, "--resume", "--levels", str(levels))


CONDITIONS = """
[[condition]]
name = "x"
cycles = 2
[[condition]]
name = "y"
cycles = 3
"""


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


def test_every_row_has_the_displacements_of_the_sealed_matrix(sessions: Sessions) -> None:
    sessions.write(on_paper_plate(EVERY_KIND))
    assert sessions.run(*SEED).exit_code == 0
    gains = sessions.folder().read_plan().gains_of("main")
    assert {row["kind"] for row in sessions.rows()} == {"practice", "single", "both", "blank"}
    for row in sessions.rows():
        peaks_um = gains.peaks_um((float(row["level_left_vpp"]), float(row["level_right_vpp"])))
        assert peaks_um == (float(row["peak_left_um"]), float(row["peak_right_um"]))
        assert row["displacement_basis"] == "measured"
        assert (row["peak_left_um"] == "0") == (row["kind"] == "blank")
        for column in ("peak_left_um", "peak_right_um"):
            assert len(row[column].replace(".", "").strip("0")) <= 4
