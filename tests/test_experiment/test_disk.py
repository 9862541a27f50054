"""What a power cut leaves: of every record all that was promised, and no right for others."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import pytest

from analysis.commands.dry_run import new_folder
from analysis.commands.levels import write_levels
from device.errors import LinkError
from experiment.archive.bids import export_bids
from experiment.archive.disk import SystemDisk, lock_on, make_folder
from experiment.archive.files import replaced, write_atomically
from experiment.archive.journal import Journal
from experiment.archive.manifest import Manifest
from experiment.archive.participants import (
    Tombstone,
    enter_person,
    remove_person,
    tombstone_path,
    write_tombstone,
)
from experiment.archive.withdraw import held, look_up, remove
from experiment.integrity.places import find_sessions
from experiment.session.simulate import simulate_study
from tests.test_experiment.lab import Lab

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from analysis.thresholds.levels import Placement
    from device.driver import Delivery
    from experiment.study.study import Study
    from tests.conftest import Run


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


def test_a_synced_line_and_all_before_it_outlive_a_power_cut(
    tmp_path: Path, disk: LossyDisk
) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path, now_s=lambda: 0.0, disk=disk) as journal:
        journal.append("first")
        journal.append("second", sync=True)
        journal.append("third")
        there = disk.holds(tmp_path)["journal.jsonl"]
    assert there == b"".join(path.read_bytes().splitlines(keepends=True)[:2])


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


def test_a_file_that_is_written_is_on_the_disk_as_a_whole(tmp_path: Path, disk: LossyDisk) -> None:
    for text in ("first", "second"):
        write_atomically(tmp_path / "table.csv", text, disk=disk)
        assert disk.holds(tmp_path) == {"table.csv": text.encode()}


def test_anew_folder_is_on_the_disk_with_those_above_it(tmp_path: Path, disk: LossyDisk) -> None:
    make_folder(tmp_path / "study" / "sub-01" / "ses-01", disk)
    write_atomically(tmp_path / "study" / "sub-01" / "ses-01" / "plan.json", "{}", disk=disk)
    assert disk.holds(tmp_path) == {"study/sub-01/ses-01/plan.json": b"{}"}


def test_a_folder_below_a_file_is_refused_by_its_name(tmp_path: Path, disk: LossyDisk) -> None:
    file = tmp_path / "study.toml"
    file.touch()
    with pytest.raises(NotADirectoryError) as refused:
        make_folder(file / "sub-01" / "ses-01", disk)
    assert refused.value.filename == str(file)


def test_an_export_is_on_the_disk_as_a_whole(tmp_path: Path, disk: LossyDisk) -> None:
    about = Manifest(what="BIDS data set", participants=("01",))
    for text in ("first", "second"):
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
    """A study of people who feel volts: no displacement has to be computed."""
    return make_study(
        short_study_text + "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
    )


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
        assert (commanded.event, commanded.facts["token"]) == ("stimulus_commanded", token)
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


def test_a_fault_is_on_the_disk_before_the_device_is_told_to_stop(lab: LossyLab) -> None:
    stop, seen = lab.device.stop, []

    def lost(token: int) -> Delivery:
        raise LinkError("the line is dead")

    def observed_stop() -> None:
        seen.append(lab.safe("fault"))
        stop()

    lab.patch.setattr(lab.device, "fire", lost)
    lab.patch.setattr(lab.device, "stop", observed_stop)
    assert not lab.begin().finished
    assert set(seen) == {1}


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


def test_a_session_of_a_person_whose_row_is_there_already_keeps_its_folder(lab: LossyLab) -> None:
    make_folder(lab.folder.root, lab.disk)
    enter_person(lab.folder.root, "01", [], (), disk=lab.disk)
    with lab.folder.locked():
        lab.folder.create(lab.plan, {})
    there = lab.disk.holds(lab.root)
    assert {"study/participants.tsv", "study/sub-01/ses-01/plan.json"} <= set(there)
    assert json.loads(there["study/sub-01/ses-01/plan.json"])["sha256"] == lab.plan.sha256


@pytest.fixture
def results(tmp_path: Path, study: Study) -> Path:
    list(simulate_study(study, tmp_path, participants=2, seed=1, gains=()))
    return tmp_path


def withdraw(results: Path, disk: LossyDisk) -> None:
    person = look_up(results, "01")
    with held(person) as locks:
        remove(person, locks, today="2026-01-02", disk=disk)


@pytest.mark.parametrize("in_table", [True, False])
def test_a_withdrawn_person_stays_gone_after_a_power_cut(
    results: Path, disk: LossyDisk, *, in_table: bool
) -> None:
    if not in_table:
        remove_person(results, "01")
    disk.knows(results)
    withdraw(results, disk)
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
    withdraw(results, disk)
    assert (False, len(data)) in moments
    assert (True, len(data)) in moments
    assert moments[-1] == (True, 0)


@pytest.fixture(params=[0o000, 0o022, 0o077], ids=oct)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
def test_records_of_a_person_give_others_no_right(tmp_path: Path, study: Study, umask: int) -> None:
    (study_folder,) = simulate_study(
        study, tmp_path / "new" / "study", participants=1, seed=1, gains=()
    )
    root = study_folder.root
    export_bids(find_sessions(root).sessions, tmp_path / "out" / "bids", with_sourcedata=True)
    export_bids(find_sessions(root).sessions, tmp_path / "out" / "bids", with_sourcedata=True)
    study_folder.journal_path.write_bytes(study_folder.journal_path.read_bytes() + b"torn")
    study_folder.open_journal(lambda: 0.0).close()
    study_folder.write_trials()
    write_tombstone(root, Tombstone(participant="09", withdrawn="2026-01-02", removed=True))
    names = [".lock", "header.json", "plan.json", "journal.jsonl", "journal.torn-1", "trials.csv"]
    expected = {study_folder.path / name for name in names}
    expected |= {root / name for name in (".participants.lock", ".export.lock", "participants.tsv")}
    header = tmp_path / "out" / "bids" / "sourcedata" / "sub-01" / "ses-01" / "header.json"
    found = set(tmp_path.rglob("*"))
    assert expected | {tombstone_path(root, "09"), header} <= found
    for path in found:
        mode = stat.S_IMODE(path.stat().st_mode)
        assert mode == (0o770 if path.is_dir() else 0o660) & ~umask, path


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
def test_the_folder_that_a_dry_run_names_itself_gives_others_no_right(
    tmp_path: Path, umask: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("dry-run-1", "dry-run-2"):
        folder = new_folder(None)
        assert folder == Path(name)
        assert stat.S_IMODE(folder.stat().st_mode) == 0o770 & ~umask


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
def test_a_lock_that_is_taken_again_keeps_the_rights_it_has(tmp_path: Path, umask: int) -> None:
    path = tmp_path / ".lock"
    for _ in range(2):
        with lock_on(path) as lock:
            assert lock._context.mode == 0o660 & ~umask
        assert stat.S_IMODE(path.stat().st_mode) == 0o660 & ~umask


@pytest.mark.skipif(os.name == "nt", reason="rights of files are a POSIX feature")
@pytest.mark.parametrize("umask", [0o000], indirect=True)
@pytest.mark.parametrize(
    "command",
    [
        pytest.param("dry-run study.toml --participants 1 --seed 1", marks=pytest.mark.slow),
        "analyze dry --allow-simulated --no-figures --out new/analysis",
    ],
)
@pytest.mark.usefixtures("umask")
def test_a_command_that_tells_of_people_gives_others_no_right(
    tmp_path: Path, study: Study, run: Run, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path)
    list(simulate_study(study, Path("dry"), participants=1, seed=1, gains=()))
    Path("study.toml").write_text("[design]\ntrials_per_side = 2\n", encoding="utf-8")
    before = set(Path().rglob("*"))
    result = run(*command.split())
    assert result.exit_code == 0, result.output
    found = cast("Placement", SimpleNamespace(participant="01", levels_vpp=[80.0]))
    write_levels([found], Path("levels.toml"), simulated=True)
    written = set(Path().rglob("*")) - before
    assert len(written) > 5
    for path in written:
        assert stat.S_IMODE(path.stat().st_mode) == (0o770 if path.is_dir() else 0o660), path
