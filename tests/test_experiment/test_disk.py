"""What a power cut leaves: of every record all that was promised, and no right for others."""

from __future__ import annotations

import json
import os
import stat
from typing import TYPE_CHECKING

import pytest

from device.clock import VirtualClock
from device.driver import LinkError
from experiment.apparatus.noise import SilentNoise
from experiment.apparatus.rig import mock_device
from experiment.archive.bids import export_bids
from experiment.archive.disk import SystemDisk, lock_on, make_folder
from experiment.archive.files import replaced, write_atomically
from experiment.archive.folders import SessionFolder
from experiment.archive.journal import Journal, read_journal
from experiment.archive.manifest import Manifest
from experiment.archive.participants import (
    Tombstone,
    enter_person,
    remove_person,
    tombstone_path,
    write_tombstone,
)
from experiment.archive.withdraw import held, look_up, remove
from experiment.operator.requests import Requests, StopSignal
from experiment.session.conduct import begin, resume
from experiment.session.setting import Setting
from experiment.session.simulate import SimulatedResponder, simulate_study, simulated_responder
from experiment.trial.draw import draw_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from device.driver import Delivery
    from experiment.operator.requests import Status
    from experiment.study.study import Study
    from experiment.terms.responder import AwaitedAnswer, Press, Progress


class LossyDisk:
    """A disk that loses everything after the last sync: names and contents, each by itself.

    It works on real files. What has arrived is what a file held, or which names a folder had, when
    it was synced last; a file or folder without a synced name is not found after a power cut.
    """

    def __init__(self) -> None:
        self._disk = SystemDisk(waits=False)
        self._open: dict[int, Path] = {}
        self._contents: dict[int, bytes] = {}
        self._names: dict[int, dict[str, int]] = {}
        self.opened = 0
        self.closed = 0

    def open(self, path: Path, *, new: bool) -> int:
        made = not path.exists()
        file = self._disk.open(path, new=new)
        if made:  # an inode may have been another file's
            self._contents.pop(os.fstat(file).st_ino, None)
        self._open[file] = path
        self.opened += 1
        return file

    def write(self, file: int, data: bytes) -> None:
        self._disk.write(file, data)

    def sync(self, file: int) -> None:
        self._contents[os.fstat(file).st_ino] = self._open[file].read_bytes()

    def close(self, file: int) -> None:
        del self._open[file]
        self._disk.close(file)
        self.closed += 1

    def sync_folder(self, folder: Path) -> None:
        self._names[folder.stat().st_ino] = {
            path.name: path.stat().st_ino for path in folder.iterdir()
        }

    def holds(self, folder: Path) -> dict[str, bytes]:
        """Return what is found below a folder after a power cut: the files, with what they hold."""
        return dict(self._found(folder.stat().st_ino, ""))

    def _found(self, inode: int, prefix: str) -> Iterator[tuple[str, bytes]]:
        for name, inner in self._names.get(inode, {}).items():
            if inner in self._names:
                yield from self._found(inner, f"{prefix}{name}/")
            else:
                yield f"{prefix}{name}", self._contents.get(inner, b"")

    def knows(self, folder: Path) -> None:
        """Take all that is there for safe."""
        for place, _, files in os.walk(folder):
            here = folder / place
            self.sync_folder(here)
            for name in files:
                self._contents[(here / name).stat().st_ino] = (here / name).read_bytes()


@pytest.fixture
def disk() -> LossyDisk:
    return LossyDisk()


def events_of(raw: bytes) -> list[str]:
    return [json.loads(line)["event"] for line in raw.split(b"\n")[:-1]]


# --- files ----------------------------------------------------------------------------------------


def test_a_synced_line_of_a_journal_and_all_before_it_outlive_a_power_cut(
    tmp_path: Path, disk: LossyDisk
) -> None:
    with Journal(tmp_path / "journal.jsonl", now_s=lambda: 0.0, disk=disk) as journal:
        journal.append("first")
        journal.append("second", sync=True)
        journal.append("third")
        assert events_of(disk.holds(tmp_path)["journal.jsonl"]) == ["first", "second"]


def test_a_torn_line_is_safe_elsewhere_before_it_is_cut_off(
    tmp_path: Path, disk: LossyDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path, now_s=lambda: 0.0, disk=disk) as journal:
        journal.append("first", sync=True)
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"crc":')
    truncate, found = os.truncate, []

    def observed(file: Path, length: int) -> None:
        found.append(disk.holds(tmp_path))
        truncate(file, length)

    monkeypatch.setattr(os, "truncate", observed)
    Journal(path, now_s=lambda: 0.0, disk=disk).close()
    assert [there["journal.torn-1"] for there in found] == [b'{"crc":']
    assert path.read_bytes() == whole


def test_a_file_is_on_the_disk_as_a_whole_when_it_is_written(
    tmp_path: Path, disk: LossyDisk
) -> None:
    for text in ("first", "second"):
        write_atomically(tmp_path / "table.csv", text, disk=disk)
        assert disk.holds(tmp_path) == {"table.csv": text.encode()}


def test_a_new_folder_is_on_the_disk_with_those_above_it(tmp_path: Path, disk: LossyDisk) -> None:
    make_folder(tmp_path / "study" / "sub-01" / "ses-01", disk)
    write_atomically(tmp_path / "study" / "sub-01" / "ses-01" / "plan.json", "{}", disk=disk)
    assert disk.holds(tmp_path) == {"study/sub-01/ses-01/plan.json": b"{}"}


def test_a_folder_below_a_file_is_refused_by_the_files_name(
    tmp_path: Path, disk: LossyDisk
) -> None:
    file = tmp_path / "study.toml"
    file.touch()
    with pytest.raises(NotADirectoryError) as refused:
        make_folder(file / "sub-01" / "ses-01", disk)
    assert refused.value.filename == str(file)


def test_an_export_is_on_the_disk_as_a_whole(tmp_path: Path, disk: LossyDisk) -> None:
    for text in ("first", "second"):
        about = Manifest(what="BIDS data set", participants=("01",))
        with replaced(tmp_path / "new" / "out", tmp_path / "study", about, disk) as folder:
            folder.write("README", text)
            folder.write("sub-01/beh/events.tsv", text)
        there = disk.holds(tmp_path)
        there = {name: raw for name, raw in there.items() if not name.startswith("new/.out")}
        assert there.pop("new/out/.tactstrip.json").startswith(b"{")
        assert there == {
            "new/out/README": text.encode(),
            "new/out/sub-01/beh/events.tsv": text.encode(),
        }


def test_every_file_that_is_opened_is_closed(
    tmp_path: Path, disk: LossyDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Journal(tmp_path / "journal.jsonl", now_s=lambda: 0.0, disk=disk):
        assert (disk.opened, disk.closed) == (1, 0)
    write_atomically(tmp_path / "table.csv", "text", disk=disk)
    monkeypatch.setattr(disk, "write", None)
    with pytest.raises(TypeError):
        write_atomically(tmp_path / "table.csv", "more", disk=disk)
    assert (disk.opened, disk.closed) == (3, 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["journal.jsonl", "table.csv"]


def test_the_system_is_asked_to_sync_files_and_folders_and_no_descriptor_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[bool] = []

    def observed(file: int) -> None:
        synced.append(stat.S_ISDIR(os.fstat(file).st_mode))

    monkeypatch.setattr(os, "fsync", observed)
    before = os.dup(0)  # the lowest descriptor that is free
    os.close(before)
    write_atomically(tmp_path / "table.csv", "text")
    assert synced == [False, True]
    write_atomically(tmp_path / "table.csv", "text", disk=SystemDisk(waits=False))
    assert synced == [False, True]
    after = os.dup(0)
    os.close(after)
    assert after == before


# --- a session ------------------------------------------------------------------------------------


class Lab:
    """A session of a simulated participant on a disk that loses what was not synced."""

    def __init__(self, study: Study, root: Path) -> None:
        self.disk = LossyDisk()
        self.study = study
        self.root = root
        self.folder = SessionFolder(root / "study", "01", "01", disk=self.disk)
        self.plan = draw_plan(study, participant="01", session="01", seed=3)
        self.clock = VirtualClock()
        self.device = mock_device(study, self.clock)
        self.requests = Requests()
        self.responder: SimulatedResponder = simulated_responder(study, self.plan, self.clock)

    def setting(self) -> Setting:
        return Setting(
            device=self.device,
            responder=self.responder,
            noise=SilentNoise(self.study.masking),
            clock=self.clock,
            stop=StopSignal(),
            requests=self.requests,
            monitor=self,
        )

    def show(self, status: Status) -> None:
        """See how the session stands."""

    def safe(self, event: str) -> int:
        """Return how many lines of an event a power cut would leave."""
        there = self.disk.holds(self.root)
        return events_of(there["study/sub-01/ses-01/journal.jsonl"]).count(event)

    def written(self, event: str) -> int:
        entries = read_journal(self.folder.journal_path).entries
        return sum(entry.event == event for entry in entries)


@pytest.fixture
def study(make_study: Callable[[str], Study], short_study_text: str) -> Study:
    """A study of people who feel volts: no displacement has to be computed."""
    return make_study(
        short_study_text + "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
    )


@pytest.fixture
def lab(tmp_path: Path, study: Study) -> Lab:
    return Lab(study, tmp_path)


def test_at_every_fire_the_token_and_at_every_cue_the_end_before_are_on_the_disk(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    fire, cue = lab.device.fire, lab.responder.cue
    seen: list[tuple[str, int]] = []

    def observed_fire(token: int) -> Delivery:
        raw = lab.disk.holds(lab.root)["study/sub-01/ses-01/journal.jsonl"]
        armed = [json.loads(line) for line in raw.split(b"\n")[:-1]][-1]
        assert (armed["event"], armed["token"]) == ("trial_armed", token)
        seen.append(("fire", lab.safe("trial_armed")))
        return fire(token)

    def observed_cue(progress: Progress) -> None:
        seen.append(("cue", lab.safe("trial_end")))
        cue(progress)

    monkeypatch.setattr(lab.device, "fire", observed_fire)
    monkeypatch.setattr(lab.responder, "cue", observed_cue)
    assert begin(lab.folder, lab.plan, lab.setting()).finished
    number = len(lab.plan.trials)
    assert seen == [
        step for trial in range(number) for step in (("cue", trial), ("fire", trial + 1))
    ]
    there = lab.disk.holds(lab.root)
    for path in (lab.folder.path / "trials.csv", lab.folder.plan_path, lab.folder.journal_path):
        assert there[path.relative_to(lab.root).as_posix()] == path.read_bytes()
    assert events_of(lab.folder.journal_path.read_bytes())[-1] == "session_close"


def test_who_waits_for_a_person_or_the_operator_has_written_what_led_there(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    pause, seen = lab.responder.pause, []

    def greeted(progress: Progress) -> bool:
        assert lab.safe("session_open") == 1
        lab.requests.note("the plate was cleaned")
        return True

    def observed_pause(progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        word = "pause" if paused else "break"
        seen.append(word)
        assert lab.safe(word) == lab.written(word) == seen.count(word)
        if not paused:
            lab.requests.pause()
        return pause(progress, paused=paused, minimum_s=minimum_s)

    monkeypatch.setattr(lab.responder, "begin", greeted)
    monkeypatch.setattr(lab.responder, "pause", observed_pause)
    monkeypatch.setattr(lab, "show", lambda status: noted.append(lab.safe("note")))
    noted: list[int] = []
    assert begin(lab.folder, lab.plan, lab.setting()).finished
    assert seen == ["break", "pause"]
    assert noted[:3] == [0, 0, 1]  # shown before the greeting, at it, and when the note was taken


def test_a_fault_is_on_the_disk_before_the_device_is_told_to_stop(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop, seen = lab.device.stop, []

    def lost(token: int) -> Delivery:
        raise LinkError("the line is dead")

    def observed_stop() -> None:
        seen.append(lab.safe("fault"))
        stop()

    monkeypatch.setattr(lab.device, "fire", lost)
    monkeypatch.setattr(lab.device, "stop", observed_stop)
    assert not begin(lab.folder, lab.plan, lab.setting()).finished
    assert set(seen) == {1}


def test_a_resume_and_the_end_of_the_open_trial_are_on_the_disk_before_it_goes_on(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    class PowerCut(BaseException):
        """The end of the process."""

    def cut(question: AwaitedAnswer) -> Press | None:
        raise PowerCut

    def begun(progress: Progress) -> bool:
        assert (lab.safe("session_resume"), lab.safe("trial_end")) == (1, 1)
        return True

    disarm, query = lab.device.disarm, lab.device.query
    asked: list[int] = []

    def observed_disarm(token: int) -> None:
        asked.append(lab.safe("session_resume"))
        disarm(token)

    with monkeypatch.context() as patch:
        patch.setattr(lab.responder, "ask", cut)
        with pytest.raises(PowerCut):
            begin(lab.folder, lab.plan, lab.setting())
    monkeypatch.setattr(lab.device, "disarm", observed_disarm)
    monkeypatch.setattr(lab.device, "query", query)
    monkeypatch.setattr(lab.responder, "begin", begun)
    assert resume(lab.folder, lab.setting()).finished
    assert asked == [1]


def test_a_session_of_a_person_whose_row_is_there_already_keeps_its_folder(lab: Lab) -> None:
    make_folder(lab.folder.root, lab.disk)
    enter_person(lab.folder.root, "01", [], (), disk=lab.disk)
    with lab.folder.locked():
        lab.folder.create(lab.plan, {})
    there = lab.disk.holds(lab.root)
    assert {"study/participants.tsv", "study/sub-01/ses-01/plan.json"} <= set(there)
    assert json.loads(there["study/sub-01/ses-01/plan.json"])["sha256"] == lab.plan.sha256


# --- a withdrawal ---------------------------------------------------------------------------------


@pytest.fixture
def results(tmp_path: Path, study: Study) -> Path:
    list(simulate_study(study, tmp_path, participants=2, seed=1, gains=()))
    return tmp_path


@pytest.mark.parametrize("in_table", [True, False])
def test_a_withdrawn_person_stays_gone_after_a_power_cut(
    results: Path, disk: LossyDisk, *, in_table: bool
) -> None:
    if not in_table:
        remove_person(results, "01")
    disk.knows(results)
    person = look_up(results, "01")
    with held(person) as locks:
        remove(person, locks, today="2026-01-02", disk=disk)
    there = disk.holds(results)
    assert [name for name in there if "sub-01" in name] == ["withdrawn/sub-01.json"]
    assert json.loads(there["withdrawn/sub-01.json"])["removed"] is True
    assert there["participants.tsv"] == b"participant_id\nsub-02\n"


def test_at_no_moment_of_a_withdrawal_is_data_missing_without_a_tombstone(
    results: Path, disk: LossyDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk.knows(results)
    data = {name for name in disk.holds(results) if name.startswith("sub-01/")}
    sync_folder, moments = disk.sync_folder, []

    def observed(folder: Path) -> None:
        sync_folder(folder)
        there = disk.holds(results)
        left = data & set(there)
        begun = "withdrawn/sub-01.json" in there
        moments.append((begun, len(left)))
        assert begun or left == data

    monkeypatch.setattr(disk, "sync_folder", observed)
    person = look_up(results, "01")
    with held(person) as locks:
        remove(person, locks, today="2026-01-02", disk=disk)
    assert (False, len(data)) in moments
    assert (True, len(data)) in moments
    assert moments[-1] == (True, 0)


# --- whose files they are -------------------------------------------------------------------------


@pytest.fixture(params=[0o000, 0o022, 0o077], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
def test_what_is_written_of_a_person_gives_others_no_right(
    tmp_path: Path, study: Study, umask: int
) -> None:
    (study_folder,) = simulate_study(
        study, tmp_path / "new" / "study", participants=1, seed=1, gains=()
    )
    root = study_folder.root
    export_bids(root, tmp_path / "out" / "bids", with_sourcedata=True)
    export_bids(root, tmp_path / "out" / "bids", with_sourcedata=True)
    study_folder.journal_path.write_bytes(study_folder.journal_path.read_bytes() + b"torn")
    study_folder.open_journal(lambda: 0.0).close()
    study_folder.write_trials()
    write_tombstone(root, Tombstone(participant="09", withdrawn="2026-01-02", removed=True))
    found = {
        path.relative_to(tmp_path).as_posix(): stat.S_IMODE(path.stat().st_mode)
        for path in tmp_path.rglob("*")
    }
    session = "new/study/sub-01/ses-01"
    expected = ["header.json", "plan.json", "journal.jsonl", "journal.torn-1", "trials.csv"]
    assert {f"{session}/{name}" for name in (*expected, ".lock")} <= set(found)
    others = [".participants.lock", ".export.lock", "participants.tsv"]
    assert {f"new/study/{name}" for name in others} <= set(found)
    assert tombstone_path(root, "09").relative_to(tmp_path).as_posix() in found
    assert "out/bids/sourcedata/sub-01/ses-01/header.json" in found
    for name, mode in found.items():
        assert mode == (0o770 if (tmp_path / name).is_dir() else 0o660) & ~umask, name


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
def test_a_lock_that_is_taken_again_keeps_the_rights_it_has(tmp_path: Path, umask: int) -> None:
    path = tmp_path / ".lock"
    for _ in range(2):
        with lock_on(path) as lock:
            assert lock._context.mode == 0o660 & ~umask
        assert stat.S_IMODE(path.stat().st_mode) == 0o660 & ~umask
