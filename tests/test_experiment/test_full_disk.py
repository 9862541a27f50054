"""A disk that is full at any one of the operations by which a session writes its files."""

from __future__ import annotations

import errno
import os
from typing import TYPE_CHECKING, Any

import pytest

from experiment.archive.disk import DISK
from experiment.archive.journal import JournalWriteError
from tests.test_experiment.lab import Lab
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study

VOLTS = "[simulation]\nthreshold_vpp = 58.0\ncrosstalk_db = -30.0\n"
SIMULATED = ("--responder", "simulated", "--seed", "1")
TRIALS = 5


class FullDisk:
    """Lets every operation that needs room below a folder fail from the n-th on.

    It stands below the program, at the system's calls. What is written when it is full is cut short
    first, as systems do.
    """

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch, *, full_at: int) -> None:
        self._folder = os.fspath(folder)
        self._full_at = full_at
        self._files: set[int] = set()
        self.done = 0
        for name in ("open", "write", "fsync", "mkdir", "replace"):
            patch.setattr(os, name, getattr(self, f"_{name}")(getattr(os, name)))

    @property
    def full(self) -> bool:
        return self.done >= self._full_at

    def _needs_room(self, path: object) -> None:
        self.done += 1
        if self.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), path)

    def _is_here(self, path: object) -> bool:
        return os.fspath(path).startswith(self._folder)  # type: ignore[call-overload, no-any-return]

    def _open(self, system: Callable[..., int]) -> Callable[..., int]:
        def opened(path: Any, flags: int, *args: Any, **kwargs: Any) -> int:
            here = self._is_here(path)
            if here and flags & os.O_CREAT and not os.path.exists(path):  # noqa: PTH110
                self._needs_room(path)
            file = system(path, flags, *args, **kwargs)
            (self._files.add if here else self._files.discard)(file)
            return file

        return opened

    def _write(self, system: Callable[..., int]) -> Callable[..., int]:
        def written(file: int, data: bytes) -> int:
            if file not in self._files:
                return system(file, data)
            if self.done + 1 == self._full_at and len(data) > 1:
                system(file, data[: len(data) // 2])
            self._needs_room(None)
            return system(file, data)

        return written

    def _fsync(self, system: Callable[..., None]) -> Callable[..., None]:
        def synced(file: int) -> None:
            if file in self._files:
                self._needs_room(None)
            system(file)

        return synced

    def _mkdir(self, system: Callable[..., None]) -> Callable[..., None]:
        def made(path: Any, *args: Any, **kwargs: Any) -> None:
            if self._is_here(path):
                self._needs_room(path)
            system(path, *args, **kwargs)

        return made

    def _replace(self, system: Callable[..., None]) -> Callable[..., None]:
        def replaced(source: Any, target: Any, **kwargs: Any) -> None:
            if self._is_here(target):
                self._needs_room(target)
            system(source, target, **kwargs)

        return replaced


@pytest.fixture
def study(make_study: Callable[[str], Study], short_study_text: str) -> Study:
    return make_study(short_study_text + VOLTS)


def begin_until_full(lab: Lab, folder: Path, full_at: int) -> bool:
    """Begin a session; tell whether the disk was full, and check what is said and left then."""
    failed: Exception | None = None
    with lab.patch.context() as patch:
        disk = FullDisk(folder, patch, full_at=full_at)
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


@pytest.mark.slow
def test_whoever_runs_a_session_on_a_full_disk_is_told_in_a_line_what_to_do(
    tmp_path: Path, quick_study_text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    full_at, codes = 1, set()
    while True:
        sessions = Sessions(tmp_path / str(full_at), quick_study_text + VOLTS)
        with monkeypatch.context() as patch:
            disk = FullDisk(sessions.out, patch, full_at=full_at)
            result = sessions.run(*SIMULATED)
        if not disk.full:
            break
        begun = sessions.folder().plan_path.exists()
        hint = "make room, then go on with --resume" if begun else "make room, then run it again"
        assert result.exit_code == (4 if begun else 2), result.output
        assert result.stderr.startswith(f"error: {sessions.out}"), result.stderr
        assert (len(result.stderr.splitlines()), hint in result.stderr) == (1, True)
        again = sessions.run(*SIMULATED, *(("--resume",) if begun else ()))
        assert again.exit_code == 0, again.output
        codes.add(result.exit_code)
        full_at += 4  # every operation is tried above; here the words are
    assert codes == {2, 4}
    assert result.exit_code == 0
