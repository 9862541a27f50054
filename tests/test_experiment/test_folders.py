"""Folders of results that are not as they should be: refused in a line that says what to do."""

from __future__ import annotations

import errno
import fcntl
import os
import re
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from device.emulate.mock import MockDevice
from experiment.archive.disk import LockError
from experiment.archive.files import ArchiveError, check_identifier
from experiment.archive.folders import SessionFolder
from experiment.archive.journal import read_journal
from experiment.session.conduct import resume
from experiment.study.read import study_from_text
from experiment.study.study import StudyError
from tests.test_experiment.lab import Crash, Lab
from tests.test_experiment.sessions import Sessions, contents

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study
    from tests.conftest import Run

SIMULATED = ("--responder", "simulated")
NO_LOCKS = [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EIO]
VOLTS = "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
COLUMNS = '[participants]\ncolumns = [{ name = "hand", description = "x", levels = ["l", "r"] }]\n'


@pytest.fixture
def lab(
    tmp_path: Path,
    make_study: Callable[[str], Study],
    short_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
) -> Lab:
    study = make_study(short_study_text + VOLTS + COLUMNS)
    return Lab(study, tmp_path / "results", monkeypatch)


@pytest.fixture
def stopped(lab: Lab) -> Lab:
    """A session of which one trial is answered."""
    lab.crash(2)
    lab.folder.write_trials()
    return lab


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    return Sessions(tmp_path, quick_study_text + VOLTS)


def everything(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*"))


def without_locks(monkeypatch: pytest.MonkeyPatch, number: int, *, after: int = 0) -> None:
    """Let flock fail as on a network drive, after so many that did not."""
    flock, calls = fcntl.flock, 0

    def fail(file: int, operation: int) -> None:
        nonlocal calls
        calls += 1
        if calls <= after or operation == fcntl.LOCK_UN:
            flock(file, operation)
        else:
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", fail)


@pytest.mark.parametrize("number", NO_LOCKS, ids=errno.errorcode.get)
@pytest.mark.parametrize("there", [False, True])
def test_on_a_drive_without_locks_a_session_is_refused_in_a_line_and_nothing_is_written(
    sessions: Sessions, monkeypatch: pytest.MonkeyPatch, number: int, *, there: bool
) -> None:
    if there:
        sessions.out.mkdir()
    before = everything(sessions.out.parent)
    without_locks(monkeypatch, number)
    result = sessions.run(*SIMULATED)
    assert (result.exit_code, len(result.stderr.splitlines())) == (2, 1)
    assert f"{sessions.folder().path}: this drive does not lock files" in result.stderr
    assert os.strerror(number) in result.stderr
    assert everything(sessions.out.parent) == before


@pytest.mark.parametrize("number", NO_LOCKS, ids=errno.errorcode.get)
def test_a_lock_that_fails_later_leaves_nothing_either(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    without_locks(monkeypatch, number, after=1)
    with pytest.raises(LockError, match=re.escape(f"{lab.folder.root}: this drive")):
        lab.begin()
    assert not lab.folder.root.exists()


@pytest.mark.parametrize("number", NO_LOCKS, ids=errno.errorcode.get)
@pytest.mark.parametrize(
    "command",
    ["run {study} --participant 01 --out {out} --resume", "export {out}",
     "export {out} --bids {out}-bids", "withdraw {out} --participant 01"],
)  # fmt: skip
def test_without_locks_every_command_that_writes_refuses(
    stopped: Lab, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, number: int,
    command: str,
) -> None:  # fmt: skip
    study = tmp_path / "study.toml"
    study.write_text("", encoding="utf-8")
    monkeypatch.setattr("experiment.study.read.is_recorded", lambda *_: True)
    out = stopped.folder.root
    before = everything(tmp_path)
    without_locks(monkeypatch, number)
    words = command.format(study=study, out=out).split()
    result = run(*words, *(SIMULATED if words[0] == "run" else ()), typed="01\n")
    assert (result.exit_code, "files" in result.stderr) == (2, True), result.output
    assert everything(tmp_path) == before


def test_a_session_that_does_not_begin_leaves_no_folder(lab: Lab) -> None:
    def dead() -> None:
        raise OSError(errno.EIO, "the line is dead")

    lab.patch.setattr(lab.device, "open", dead)
    with pytest.raises(OSError, match="line"):
        lab.begin()
    assert not lab.folder.root.exists()


LINKED = ["", "..", "plan.json", "header.json", "journal.jsonl", "trials.csv", ".lock"]


@pytest.mark.parametrize("name", LINKED, ids=["ses", "sub", *LINKED[2:]])
def test_a_symbolic_link_among_the_results_is_refused_and_not_followed(
    stopped: Lab, tmp_path: Path, run: Run, name: str
) -> None:
    folder = stopped.folder
    place = folder.path.parent if name == ".." else folder.path / name
    place.rename(tmp_path / "elsewhere")
    place.symlink_to(tmp_path / "elsewhere")
    before = contents(tmp_path)
    told = f"{place}: must not be a symbolic link"
    for do in (stopped.begin, stopped.resume, folder.write_trials, folder.refuse_existing):
        with pytest.raises(ArchiveError, match=re.escape(told)):
            do()
    result = run("export", folder.root)
    assert (result.exit_code, told in result.stderr) == (2, True)
    assert contents(tmp_path) == before


def test_a_link_to_a_file_that_is_not_there_is_refused_too(lab: Lab, tmp_path: Path) -> None:
    lab.folder.root.mkdir()
    lab.folder.path.parent.symlink_to(tmp_path / "nowhere")
    with pytest.raises(ArchiveError, match="symbolic link"):
        lab.begin()
    assert not (tmp_path / "nowhere").exists()


def test_the_folder_of_results_itself_may_be_reached_by_a_link(lab: Lab, tmp_path: Path) -> None:
    (tmp_path / "disk").mkdir()
    lab.folder.root.symlink_to(tmp_path / "disk")
    assert lab.begin().finished


# Which files are there, and what is said: of plan, journal and table in turn.
LOST = [
    ("journal.jsonl", "plan.json missing, journal.jsonl left"),
    ("journal.jsonl trials.csv", "plan.json missing, journal.jsonl and trials.csv left"),
    ("trials.csv", "plan.json and journal.jsonl missing, trials.csv left"),
    ("plan.json", "journal.jsonl missing, plan.json left"),
    ("plan.json trials.csv", "journal.jsonl missing, plan.json and trials.csv left"),
]


@pytest.mark.parametrize(("left", "told"), LOST, ids=[left for left, _ in LOST])
def test_what_was_lost_of_a_session_is_said_alike_by_run_and_resume(
    stopped: Lab, left: str, told: str
) -> None:
    folder = stopped.folder
    for path in (folder.plan_path, folder.journal_path, folder.trials_path):
        if path.name not in left.split():
            path.unlink()
    before = contents(folder.root)
    for do in (stopped.begin, stopped.resume):
        with pytest.raises(ArchiveError) as refused:
            do()
        message = str(refused.value)
        assert message.startswith(f"{folder.path}: {told}; restore from a copy what is missing")
        assert ("trials.csv" in message) == ("trials.csv" in left)
        assert message.endswith("the person needs another --session: nothing was changed")
    assert contents(folder.root) == before


@pytest.mark.parametrize("calls", range(1, 20))
def test_a_session_killed_while_it_is_created_can_be_begun_again(lab: Lab, calls: int) -> None:
    """No remains of a beginning are taken for a loss."""
    sync_folder, done = type(lab.folder.disk).sync_folder, 0

    def killed(*args: object) -> None:
        nonlocal done
        done += 1
        if done == calls:
            raise KeyboardInterrupt
        sync_folder(*args)  # type: ignore[arg-type]

    with lab.patch.context() as patch:
        patch.setattr(type(lab.folder.disk), "sync_folder", killed)
        try:
            lab.begin()
        except KeyboardInterrupt:
            pass
        else:
            assert calls > 8
            return
    go_on = lab.resume if lab.folder.plan_path.exists() else lab.begin
    assert go_on().finished
    assert len(lab.rows) == 5


def test_a_session_without_a_line_says_that_it_begins_at_the_first_trial(lab: Lab) -> None:
    with lab.killed_after(lines=1), pytest.raises(Crash):
        lab.begin()
    lab.folder.journal_path.write_bytes(b"")
    told: list[str] = []
    assert resume(lab.folder, replace(lab.setting(), tell=told.append)).finished
    assert [line for line in told if "begins" in line]


BAD_TABLES = [
    ("name\thand\n", ":1: the first column must be participant_id; got 'name'"),
    ("participant_id\thand\thand\n", ":1: columns must have distinct names"),
    ("participant_id\thand\nsub-02\n", ":2: must have 2 cells; got 1"),
    ("participant_id\thand\n\n02\tl\n", ":3: participant_id must be sub- and 1 to 32 letters"),
    ("participant_id\nsub-02\nsub-03\nsub-02\n", ":4: sub-02 must stand once; it stands in line 2"),
    ("participant_id\thand\nsub-02\tl\nsub-03\tboth\n", ":3: fact hand must be one of l, r, n/a"),
    ("participant_id\thand\nsub-02\t\n", ":2: fact hand must be one of l, r, n/a; got ''"),
]


@pytest.mark.parametrize(("table", "told"), BAD_TABLES, ids=[told for _, told in BAD_TABLES])
def test_a_bad_table_of_participants_is_told_before_the_device_is_opened(
    lab: Lab, table: str, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = lab.folder.root / "participants.tsv"
    path.parent.mkdir()
    path.write_text(table, encoding="utf-8")
    opened: list[object] = []
    monkeypatch.setattr(MockDevice, "open", opened.append)
    with pytest.raises(ArchiveError, match=re.escape(f"{path}{told}")):
        lab.begin()
    assert everything(lab.folder.root) == [path]
    assert not opened


def test_a_bad_table_of_participants_is_told_before_a_port_is_sought(sessions: Sessions) -> None:
    sought = ("--driver", "serial", "--port", "/no/such/port")
    assert sessions.run(*SIMULATED, *sought).exit_code == 3
    sessions.out.mkdir(exist_ok=True)
    (sessions.out / "participants.tsv").write_text("who\n", encoding="utf-8")
    result = sessions.run(*SIMULATED, *sought)
    assert result.exit_code == 2
    assert "participants.tsv:1:" in result.stderr


def test_a_table_that_went_bad_meanwhile_is_told_before_a_session_goes_on(stopped: Lab) -> None:
    path = stopped.folder.root / "participants.tsv"
    path.write_text("participant_id\thand\nsub-01\tboth\n", encoding="utf-8")
    lines = len(read_journal(stopped.folder.journal_path).entries)
    with pytest.raises(ArchiveError, match=re.escape(f"{path}:2: fact hand")):
        stopped.resume()
    assert len(read_journal(stopped.folder.journal_path).entries) == lines


RESERVED = ["CON", "con", "Nul", "AUX", "prn", "COM1", "com9", "lPt4"]


@pytest.mark.parametrize("name", RESERVED)
def test_a_name_that_windows_reserves_is_refused(name: str) -> None:
    for what in ("participant", "session"):
        with pytest.raises(ArchiveError, match=f"Windows reserves.*got '{name}'"):
            check_identifier(what, name)
    for text in (f'study = {{ name = "{name}" }}', f'[[condition]]\nname = "{name}"'):
        with pytest.raises(StudyError, match=f"none that Windows reserves.*got '{name}'"):
            study_from_text(text, "s.toml")


@pytest.mark.parametrize("name", ["CON1", "COM", "COM10", "control", "aux2", "nil"])
def test_a_name_that_windows_does_not_reserve_is_taken(name: str) -> None:
    assert check_identifier("participant", name) == name
    assert study_from_text(f'study = {{ name = "{name}" }}', "s.toml").name == name


@pytest.mark.slow
def test_a_session_beside_two_thousand_people_begins_in_under_two_seconds(lab: Lab) -> None:
    """Twice as many sessions as people; the processor's time of a whole session of 5 trials."""
    root, table = lab.folder.root, ["participant_id\thand"]
    for number in range(2000):
        person = f"P{number:04d}"
        table.append(f"sub-{person}\tl")
        for session in ("01", "02"):
            folder = SessionFolder(root, person, session)
            folder.path.mkdir(parents=True)
            for name in ("plan.json", "journal.jsonl", "header.json", "trials.csv"):
                (folder.path / name).write_text("{}", encoding="utf-8")
    (root / "participants.tsv").write_text("\n".join(table) + "\n", encoding="utf-8")
    began_s = time.process_time()
    assert lab.begin().finished
    assert time.process_time() - began_s < 2.0
