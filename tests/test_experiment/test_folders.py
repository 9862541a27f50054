"""Folders of results that are not as they should be: refused in a line, nothing is changed."""

from __future__ import annotations

import errno
import fcntl
import os
import re
from typing import TYPE_CHECKING

import pytest

from experiment import ArchiveError, SessionFolder, StudyError
from experiment.record.files import check_identifier
from tests.test_experiment.lab import Crash, Lab
from tests.test_experiment.sessions import Sessions, contents

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment import Study
    from tests.conftest import Run
    from tests.test_experiment.conftest import LabOf

SIMULATED = ("--responder", "simulated")
NO_LOCKS = [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EIO]
VOLTS = "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
COLUMNS = '[participants]\ncolumns = [{ name = "hand", description = "x", levels = ["l", "r"] }]\n'


@pytest.fixture
def lab(lab_of: LabOf) -> Lab:
    return lab_of(VOLTS + COLUMNS)


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
@pytest.mark.parametrize("after", [0, 1])
def test_on_a_drive_without_locks_no_session_begins_and_nothing_is_written(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, number: int, after: int
) -> None:
    without_locks(monkeypatch, number, after=after)
    with pytest.raises(ValueError, match=re.escape(os.strerror(number))) as refused:
        lab.begin()
    assert str(refused.value).startswith(str(lab.folder.root))
    assert not lab.folder.root.exists()


@pytest.mark.parametrize(
    "command",
    [
        "run {study} --participant 02 --out {out}",
        "run {study} --participant 01 --out {out} --resume",
        "export {out}",
        "export {out} --bids {out}-bids",
        "withdraw {out} --participant 01",
    ],
)
def test_without_locks_every_command_that_writes_refuses(
    stopped: Lab, sessions: Sessions, run: Run, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setattr("experiment.study.files.is_recorded", lambda *_: True)
    before = everything(sessions.study.parent)
    without_locks(monkeypatch, errno.ENOLCK)
    words = command.format(study=sessions.study, out=stopped.folder.root).split()
    result = run(*words, *(SIMULATED if words[0] == "run" else ()), typed="01\n")
    assert (result.exit_code, os.strerror(errno.ENOLCK) in result.stderr) == (2, True)
    assert everything(sessions.study.parent) == before


# Which files are left of plan, journal and table.
LOST = ["journal.jsonl", "journal.jsonl trials.csv", "trials.csv", "plan.json"]


@pytest.mark.parametrize("left", [*LOST, "plan.json trials.csv"])
def test_what_was_lost_of_a_session_is_said_alike_by_run_and_resume(
    stopped: Lab, left: str
) -> None:
    folder = stopped.folder
    lost = []
    for path in (folder.plan_path, folder.journal_path, folder.trials_path):
        if path.name not in left.split():
            path.unlink()
            lost.append(path.name)
    before = contents(folder.root)
    for do in (stopped.begin, stopped.resume):
        with pytest.raises(ArchiveError) as refused:
            do()
        missing = str(refused.value).removeprefix(f"{folder.path}: ").split(" missing")[0]
        assert missing.split(" and ") == [name for name in lost if name != "trials.csv"]
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


BAD_TABLES = [
    ("name\thand\n", ":1: .*participant_id; got 'name'"),
    ("participant_id\thand\thand\n", ":1: "),
    ("participant_id\thand\nsub-02\n", ":2: .*2 cells; got 1"),
    ("participant_id\thand\n\n02\tl\n", ":3: participant_id"),
    ("participant_id\nsub-02\nsub-03\nsub-02\n", ":4: sub-02 "),
    ("participant_id\thand\nsub-02\tl\nsub-03\tboth\n", ":3: .*hand .*l, r, n/a"),
    ("participant_id\thand\nsub-02\t\n", ":2: .*hand .*l, r, n/a; got ''"),
]


@pytest.mark.parametrize(("table", "named"), BAD_TABLES, ids=[named for _, named in BAD_TABLES])
def test_a_bad_table_of_participants_is_told_before_the_device_is_opened(
    lab: Lab, table: str, named: str
) -> None:
    path = lab.folder.root / "participants.tsv"
    path.parent.mkdir()
    path.write_text(table, encoding="utf-8")
    with (
        lab.failing("open", Crash()),
        pytest.raises(ArchiveError, match=f"^{re.escape(str(path))}{named}"),
    ):
        lab.begin()
    assert everything(lab.folder.root) == [path]


@pytest.mark.parametrize("name", ["CON", "con", "Nul", "AUX", "prn", "COM1", "com9", "lPt4"])
def test_a_name_that_windows_reserves_is_refused(
    name: str, make_study: Callable[[str], Study]
) -> None:
    for what in ("participant", "session"):
        with pytest.raises(ArchiveError, match=f"{what}.*Windows.*'{name}'"):
            check_identifier(what, name)
    for text in (f'study = {{ name = "{name}" }}', f'[[condition]]\nname = "{name}"'):
        with pytest.raises(StudyError, match=f'Windows.*"{name}"'):
            make_study(text)


@pytest.mark.parametrize("left", ["sub-ab/ses-ab", "withdrawn/sub-ab.json", "participants.tsv"])
@pytest.mark.parametrize(("participant", "session"), [("AB", "ab"), ("aB", "2"), ("ab", "Ab")])
def test_identifiers_that_differ_only_by_case_are_refused(
    tmp_path: Path, left: str, participant: str, session: str
) -> None:
    path = tmp_path / left
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix:
        path.write_text("participant_id\nsub-ab\n" if path.suffix == ".tsv" else "", "utf-8")
    else:
        path.mkdir()
    folder = SessionFolder(tmp_path, participant, session)
    is_taken = participant != "ab" or left == "sub-ab/ses-ab"
    before = everything(tmp_path)
    if is_taken:
        with pytest.raises(ArchiveError, match=r"must differ from 'ab', which exists, .* upper"):
            folder.refuse_existing()
    assert everything(tmp_path) == before
    SessionFolder(tmp_path, "abc", "1").refuse_existing()
