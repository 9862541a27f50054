"""What a power cut or a full disk leaves: all that was promised, and no right for others."""

from __future__ import annotations

import errno
import json
import os
import stat
from typing import TYPE_CHECKING, Any

import pytest

from experiment import Journal, JournalWriteError, simulate_study
from experiment.record.entries import NoteTaken, StimulusCommanded
from experiment.record.files import DISK, Disk, make_folder
from tests.test_experiment.disks import FullDisk, LossyDisk, withdraw, write_export, write_file
from tests.test_experiment.lab import Lab
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from device import Delivery
    from experiment import Study
    from tests.conftest import Run

VOLTS = "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
"""People who feel volts: no displacement has to be computed."""
SIMULATED = ("--responder", "simulated", "--seed", "1")
TRIALS = 5


@pytest.fixture
def disk() -> LossyDisk:
    return LossyDisk()


def test_a_synced_line_and_all_before_it_outlive_a_power_cut(
    tmp_path: Path, disk: LossyDisk
) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path, now_s=lambda: 0.0, disk=disk) as journal:
        journal.append(NoteTaken(text="first"))
        journal.append(NoteTaken(text="second"), sync=True)
        journal.append(NoteTaken(text="third"))
        there = disk.holds(tmp_path)["journal.jsonl"]
    assert there == b"".join(path.read_bytes().splitlines(keepends=True)[:2])


def test_a_file_or_export_that_is_written_is_on_the_disk_as_a_whole(
    tmp_path: Path, disk: LossyDisk
) -> None:
    plan = "results/sub-01/ses-01/plan.json"
    make_folder((tmp_path / plan).parent, disk)
    write_file(tmp_path / plan, "{}", disk)
    assert disk.holds(tmp_path) == {plan: b"{}"}
    for text in ("first", "second"):
        write_file(tmp_path / "table.csv", text, disk)
        assert disk.holds(tmp_path)["table.csv"] == text.encode()
        write_export(tmp_path / "new" / "out", tmp_path / "study", text, disk)
        there = {name: raw for name, raw in disk.holds(tmp_path).items() if "/.out" not in name}
        assert there.pop("new/out/.tactstrip.json").startswith(b"{")
        assert there == {
            plan: b"{}",
            "table.csv": text.encode(),
            "new/out/README": text.encode(),
            "new/out/sub-01/beh/events.tsv": text.encode(),
        }


def test_the_system_is_asked_to_sync_files_and_folders_and_no_descriptor_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[bool] = []

    def observed(file: int) -> None:
        synced.append(stat.S_ISDIR(os.fstat(file).st_mode))

    monkeypatch.setattr(os, "fsync", observed)
    before = os.dup(0)  # the lowest descriptor that is free
    os.close(before)
    for disk in (Disk(waits=True), Disk(waits=False)):
        write_file(tmp_path / "table.csv", "text", disk)
        assert synced == [False, True]
    after = os.dup(0)
    os.close(after)
    assert after == before


class LossyLab(Lab):
    """A session on a disk that loses what was not synced."""

    def __init__(self, study: Study, root: Path, patch: pytest.MonkeyPatch) -> None:
        self.disk = LossyDisk()
        super().__init__(study, root / "study", patch, self.disk)
        self.root = root

    def safe_lines(self) -> list[dict[str, Any]]:
        """Return the lines of the journal that a power cut would leave."""
        raw = self.disk.holds(self.root)["study/sub-01/ses-01/journal.jsonl"]
        return [json.loads(line) for line in raw.split(b"\n")[:-1]]

    def safe(self, event: str) -> int:
        return sum(line["event"] == event for line in self.safe_lines())


@pytest.fixture
def study(make_study: Callable[[str], Study], short_study_text: str) -> Study:
    return make_study(short_study_text + VOLTS)


@pytest.fixture
def lab(tmp_path: Path, study: Study, monkeypatch: pytest.MonkeyPatch) -> LossyLab:
    return LossyLab(study, tmp_path, monkeypatch)


def test_at_every_fire_the_token_and_at_every_cue_the_last_end_are_on_the_disk(
    lab: LossyLab,
) -> None:
    fire = lab.device.fire
    seen: list[tuple[str, int]] = []

    def observed_fire(token: int) -> Delivery:
        armed, commanded = lab.safe_lines()[-1], lab.entries()[-1]
        assert (armed["event"], armed["token"]) == ("trial_armed", token)
        assert commanded.line == StimulusCommanded(token=token)
        seen.append(("fire", lab.safe("trial_armed")))
        return fire(token)

    def observed_cue() -> None:
        seen.append(("cue", lab.safe("trial_end")))

    lab.patch.setattr(lab.device, "fire", observed_fire)
    number = len(lab.plan.trials)
    assert lab.begin(cue=dict.fromkeys(range(1, number + 1), observed_cue)).finished
    assert seen == [
        step for trial in range(number) for step in (("cue", trial), ("fire", trial + 1))
    ]
    there = lab.disk.holds(lab.root)
    for path in (lab.folder.trials_path, lab.folder.plan_path, lab.folder.journal_path):
        assert there[path.relative_to(lab.root).as_posix()] == path.read_bytes()
    assert lab.safe_lines()[-1]["event"] == "session_close"


def test_who_waits_for_a_person_or_the_operator_has_written_what_led_there(lab: LossyLab) -> None:
    noted: list[int] = []

    def greeted() -> None:
        assert lab.safe("session_open") == 1
        lab.requests.note("the plate was cleaned")

    def waits_in_a_break() -> None:
        assert (lab.safe("break"), len(lab.entries("break"))) == (1, 1)
        lab.requests.pause()

    def waits_in_a_pause() -> None:
        assert (lab.safe("pause"), len(lab.entries("pause"))) == (1, 1)

    lab.patch.setattr(lab.display, "show", lambda status: noted.append(lab.safe("note")))
    assert lab.begin(begin={1: greeted}, pause={1: waits_in_a_break, 2: waits_in_a_pause}).finished
    assert lab.responder.calls["pause"] == 2
    assert noted[:3] == [0, 0, 1]  # shown before the greeting, at it, and when the note was taken


def test_a_resume_and_the_open_trials_end_are_on_the_disk_before_it_goes_on(lab: LossyLab) -> None:
    def begun() -> None:
        assert (lab.safe("session_resume"), lab.safe("trial_end")) == (1, 1)

    disarm = lab.device.disarm
    asked: list[int] = []

    def observed_disarm(token: int) -> None:
        asked.append(lab.safe("session_resume"))
        disarm(token)

    lab.crash(1)
    lab.patch.setattr(lab.device, "disarm", observed_disarm)
    assert lab.resume(begin={1: begun}).finished
    assert lab.responder.calls["begin"] == 1
    assert asked == [1]


@pytest.fixture
def results(tmp_path: Path, study: Study) -> Path:
    list(simulate_study(study, tmp_path, participants=2, seed=1, gains=()))
    return tmp_path


@pytest.mark.parametrize("in_table", [True, False])
def test_a_withdrawn_person_stays_gone_after_a_power_cut(
    results: Path, disk: LossyDisk, *, in_table: bool
) -> None:
    if not in_table:
        (results / "participants.tsv").write_text("participant_id\nsub-02\n", encoding="utf-8")
    disk.knows(results)
    withdraw(results, disk)
    there = disk.holds(results)
    assert [name for name in there if "sub-01" in name] == ["withdrawn/sub-01.json"]
    assert json.loads(there["withdrawn/sub-01.json"])["removed"] is True
    assert there["participants.tsv"] == b"participant_id\nsub-02\n"


@pytest.fixture(
    params=[*(pytest.param(mask, marks=pytest.mark.slow) for mask in (0o000, 0o077)), 0o022],
    ids=oct,
)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
def test_records_of_a_person_give_others_no_right(
    tmp_path: Path, quick_study_text: str, run: Run, umask: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions = Sessions(tmp_path, quick_study_text + VOLTS)
    monkeypatch.chdir(tmp_path)
    sessions.crash(20, *SIMULATED)
    folder = sessions.folder()
    folder.journal_path.write_bytes(folder.journal_path.read_bytes() + b"torn")
    assert sessions.run(*SIMULATED, "--resume").exit_code == 0
    commands = [
        *["export results --bids out/bids --with-sourcedata --allow-simulated"] * 2,
        "analyze results --allow-simulated --no-figures --out new/analysis",
        "dry-run study.toml --participants 2 --seed 1",
        "withdraw dry-run-1 --participant 02",
    ]
    for command in commands if umask == 0 else commands[:2]:  # the others take long
        result = run(*command.split(), typed="02\n")
        assert result.exit_code == 0, result.output
    written = set(tmp_path.rglob("*")) - {sessions.study}
    names = [".lock", "header.json", "plan.json", "journal.jsonl", "journal.torn-1", "trials.csv"]
    assert {folder.path / name for name in names} <= written
    assert umask or tmp_path / "dry-run-1" / "withdrawn" / "sub-02.json" in written
    for path in written:
        mode = stat.S_IMODE(path.stat().st_mode)
        assert mode == (0o770 if path.is_dir() else 0o660) & ~umask, path


def begin_until_full(lab: Lab, folder: Path, full_at: int) -> bool:
    """Begin a session; return whether the disk was full, and check what is left then."""
    failed: Exception | None = None
    with lab.patch.context() as patch:
        disk = FullDisk(patch, full_at=full_at)
        try:
            lab.begin()
        except (JournalWriteError, OSError) as error:
            failed = error
    assert (failed is not None) == disk.full
    if isinstance(failed, OSError):
        assert failed.errno == errno.ENOSPC
        assert str(failed.filename).startswith(str(folder))
        assert not lab.folder.plan_path.exists(), "a session that has begun is to be resumed"
    elif failed is not None:
        assert lab.folder.plan_path.exists()
        assert str(failed).startswith(str(folder))
    return disk.full


@pytest.mark.slow
def test_wherever_the_disk_is_full_nothing_is_lost_or_felt_without_a_row(
    tmp_path: Path, study: Study, monkeypatch: pytest.MonkeyPatch
) -> None:
    full_at, begun = 1, 0
    while True:
        lab = Lab(study, tmp_path / str(full_at) / "results", monkeypatch, DISK)
        if not begin_until_full(lab, tmp_path, full_at):
            break
        recorded = lab.rows if lab.folder.plan_path.exists() else ()
        begun += lab.folder.plan_path.exists()
        go_on = lab.resume if lab.folder.plan_path.exists() else lab.begin
        assert go_on().finished
        assert lab.rows[: len(recorded)] == recorded
        assert [status for _, _, status in lab.statuses()].count("ok") == TRIALS
        felt = [s for _, _, s in lab.statuses() if s in {"ok", "voided", "indeterminate"}]
        assert len(lab.device.emitted) <= len(felt)
        assert not list(lab.folder.root.rglob("*.tmp"))
        full_at += 1
    assert begun > 5 * TRIALS
    assert full_at - begun > 10


@pytest.mark.parametrize(
    ("number", "advice"),
    [(errno.EIO, "safe: continue with"), (errno.ENOSPC, "safe: make room, then continue with")],
)
def test_a_disk_that_fails_is_reported_by_its_own_error(
    tmp_path: Path,
    quick_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    advice: str,
) -> None:
    sessions = Sessions(tmp_path, quick_study_text + VOLTS)
    sync, calls = Disk.sync, 0

    def failing_sync(disk: Disk, file: int) -> None:
        nonlocal calls
        calls += 1
        if calls > 12:
            raise OSError(number, os.strerror(number))
        sync(disk, file)

    monkeypatch.setattr(Disk, "sync", failing_sync)
    result = sessions.run(*SIMULATED)
    assert result.exit_code == 4
    assert os.strerror(number) in result.stderr
    assert advice in result.stderr
    assert ("make room" in result.stderr) == (number == errno.ENOSPC)
    monkeypatch.undo()
    assert sessions.run(*SIMULATED, "--resume").exit_code == 0


@pytest.mark.slow
def test_on_a_full_disk_the_line_that_resumes_stands_in_the_error(
    tmp_path: Path, quick_study_text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions = Sessions(tmp_path, quick_study_text)
    options = ["--responder", "simulated"]
    assert sessions.crash(12, *options, "--seed", "1")
    full_at, is_full = 0, True
    while is_full:
        full_at += 1
        with monkeypatch.context() as patch:
            disk = FullDisk(patch, full_at=full_at)
            result = sessions.run(*options, "--resume")
        is_full = disk.full
        if is_full:
            assert result.exit_code == 4, (full_at, result.output)
            (line,) = result.stderr.splitlines()
            assert line.endswith("--resume"), line
            assert "make room" in line
    assert result.exit_code == 0
    assert full_at > 3
