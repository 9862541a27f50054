"""Sessions on a device that stays on, with a participant whose every key is scripted."""

from __future__ import annotations

import contextlib
import itertools
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from device.clock import VirtualClock
from experiment.hardware.noise import NoiseError, NoiseHealth
from experiment.hardware.safety import Purpose
from experiment.hardware.setup import mock_device
from experiment.operator.requests import Requests, StopSignal
from experiment.record.files import UNWAITED
from experiment.record.folder import SessionFolder
from experiment.record.history import replay
from experiment.record.journal import Journal, read_journal
from experiment.record.verify import examine
from experiment.session.config import SessionConfig
from experiment.session.run import run
from experiment.trial.draw import draw_plan
from experiment.trial.responder import Press, Responder, SessionPart

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from device.clock import Clock
    from device.emulate.mock import MockDevice
    from experiment.operator.requests import Status
    from experiment.record.entries import Entry, Line
    from experiment.record.files import Disk
    from experiment.record.index import Difference
    from experiment.record.rows import TrialRow
    from experiment.session.config import SessionResult
    from experiment.study.study import Study
    from experiment.trial.responder import AwaitedAnswer, Progress


class Crash(BaseException):
    """The end of the process, as far as a session in the same process can have one."""


class Scripted(Responder):
    """Answers as usual, unless the script says otherwise for the n-th call."""

    simulated = True
    usual: tuple[str, float] = ("left", 0.5)
    """The answer, and its reaction time in seconds."""

    def __init__(self, clock: Clock, **script: Mapping[int, object]) -> None:
        self._clock = clock
        self._script = script
        self.calls: dict[str, int] = {}
        self.shown: list[object] = []

    @property
    def parts(self) -> list[SessionPart]:
        return [what for what in self.shown if isinstance(what, SessionPart)]

    def _next(self, call: str) -> object:
        number = self.calls.get(call, 0) + 1
        self.calls[call] = number
        act = self._script.get(call, {}).get(number)
        if callable(act):
            act = act()
        if isinstance(act, BaseException):
            raise act
        return act

    def begin(self, progress: Progress) -> bool:
        return self._next("begin") is not False

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        self.shown.append(part)
        return self._next("introduce") is not False

    def cue(self, progress: Progress) -> None:
        self._next("cue")
        self.shown.append(progress)

    def wait(self, until_s: float) -> Press | None:
        act = self._next("wait")
        if act is not None:
            return Press(str(act), self._clock.now_s())
        self._clock.wait(max(0.0, until_s - self._clock.now_s()))
        return None

    def ask(self, question: AwaitedAnswer) -> Press | None:
        act = self._next("ask") or self.usual
        assert isinstance(act, tuple)
        response, rt_s = act
        self._clock.wait(max(0.0, question.onset_s + rt_s - self._clock.now_s()))
        return None if response is None else Press(response, self._clock.now_s())

    def feedback(self, *, correct: bool) -> None:
        self.shown.append(correct)

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        self._clock.wait(minimum_s)
        return self._next("pause") is not False

    def end(self, progress: Progress, *, finished: bool) -> None:
        self._next("end")


class FakeNoise:
    """Noise that plays, or does not, as a test says; ``ok`` is ``None`` where none is to play."""

    def __init__(self, *, ok: bool | None = True) -> None:
        self.ok = ok
        self.can_start = True
        self.calls: list[str] = []
        self.sha256 = None if ok is None else "ab12"

    def start(self) -> None:
        self.calls.append("start")
        if not self.can_start:
            raise NoiseError("the sound card is gone: plug it in")
        self.ok = None if self.ok is None else True

    def health(self) -> NoiseHealth:
        words = {True: "plays", False: "silent", None: "none"}
        return NoiseHealth(ok=self.ok, message=words[self.ok])

    def stop(self) -> None:
        self.calls.append("stop")

    def lose(self) -> None:
        self.ok = False

    def lose_for_good(self) -> None:
        self.ok = self.can_start = False


class Watching:
    """Keeps what the operator was shown."""

    def __init__(self) -> None:
        self.seen: list[Status] = []

    def show(self, status: Status) -> None:
        self.seen.append(status)

    @property
    def messages(self) -> set[str]:
        return {status.message for status in self.seen} - {""}


class Lab:
    """A study, a folder and a device that outlives the sessions on it."""

    def __init__(
        self,
        study: Study,
        root: Path,
        patch: pytest.MonkeyPatch,
        disk: Disk = UNWAITED,
        *,
        participant: str = "01",
        seed: int = 3,
    ) -> None:
        self.study = study
        self.patch = patch
        self.clock = VirtualClock()
        self.device: MockDevice = mock_device(study, self.clock)
        self.folder = SessionFolder(root, participant, "01", disk=disk)
        self.plan = draw_plan(study, participant=participant, session="01", seed=seed)
        self.responder = Scripted(self.clock)
        self.noise = FakeNoise(ok=None)
        self.requests = Requests()
        self.display = Watching()
        self.stop = StopSignal()
        self.purpose = Purpose.PRACTICE
        """For scripts in which the participant is a person."""
        self.resume_anyway = False
        self.messages: list[str] = []

    def replace_device(self) -> None:
        """Switch the device off; another one stands in its place, on the present clock."""
        self.device = mock_device(self.study, self.clock)

    def config(self, **script: Mapping[int, object]) -> SessionConfig:
        self.responder = Scripted(self.clock, **script)
        self.stop = StopSignal()
        return SessionConfig(
            device=self.device,
            responder=self.responder,
            noise=self.noise,
            clock=self.clock,
            stop=self.stop,
            requests=self.requests,
            show=self.display.show,
            purpose=self.purpose,
            resume_anyway=self.resume_anyway,
            report=self.messages.append,
        )

    def begin(self, **script: Mapping[int, object]) -> SessionResult:
        return run(self.folder, self.plan, self.config(**script))

    def resume(self, **script: Mapping[int, object]) -> SessionResult:
        return run(
            self.folder, self.folder.read_plan(), replace(self.config(**script), resume=True)
        )

    def crash(self, question: int, ask: Mapping[int, object] | None = None) -> None:
        """Begin, or go on, until the process ends at the n-th question of this sitting."""
        go_on = self.resume if self.folder.plan_path.exists() else self.begin
        with pytest.raises(Crash):
            go_on(ask={**(ask or {}), question: Crash()})

    @contextlib.contextmanager
    def failing(self, call: str, error: BaseException) -> Iterator[None]:
        """Let a call of the device fail."""

        def fail(*_: object, **__: object) -> None:
            raise error

        with self.patch.context() as patch:
            patch.setattr(self.device, call, fail)
            yield

    @contextlib.contextmanager
    def killed_after(self, event: str | None = None, *, lines: int = 0) -> Iterator[None]:
        """Crash after so many journal lines, or after the first of an event."""
        append, written = Journal.append, 0

        def append_and_crash(journal: Journal, line: Line, *, sync: bool = False) -> None:
            nonlocal written
            append(journal, line, sync=sync)
            written += 1
            if written == lines or line.event == event:
                raise Crash

        with self.patch.context() as patch:
            patch.setattr(Journal, "append", append_and_crash)
            yield

    @property
    def rows(self) -> tuple[TrialRow, ...]:
        return replay(self.plan, read_journal(self.folder.journal_path).entries).rows

    @property
    def n_ok(self) -> int:
        return [row.status for row in self.rows].count("ok")

    def members(self, event: str, name: str) -> list[Any]:
        """Return one member of every line of an event."""
        return [getattr(entry.line, name) for entry in self.entries(event)]

    def differences(self) -> tuple[Difference, ...]:
        """Compare the files of the session with its journal."""
        return examine(self.folder.path).differences

    def is_sealed(self) -> bool:
        """Return whether the checksums in the journal's last line fit the tables."""
        line = self.entries()[-1].line.model_dump()
        sealed = {n: v for n, v in line.items() if n.endswith("_sha256") and v is not None}
        return bool(sealed) and sealed == self.folder.tables_sha256(self.plan)

    def entries(self, event: str | None = None) -> list[Entry]:
        entries = read_journal(self.folder.journal_path).entries
        return [entry for entry in entries if event in {None, entry.event}]

    def statuses(self) -> list[tuple[int, int, str]]:
        return [(row.trial, row.attempt, row.status) for row in self.rows]


def killed_after_each_line(lab_of: Callable[[str], Lab]) -> Iterator[Lab]:
    """Yield sessions that were killed after one journal line, then two, and resumed to their end.

    Each keeps the rows that it had, has every planned trial once, and files that fit its journal.
    """
    for lines in itertools.count(1):
        lab = lab_of(str(lines))
        try:
            with lab.killed_after(lines=lines):
                assert lab.begin().finished
        except Crash:
            before = lab.rows
            assert lab.resume().finished
            assert lab.rows[: len(before)] == before
        else:
            return
        planned = [trial.number for trial in lab.plan.trials]
        ok = [row.trial for row in lab.rows if row.status == "ok"]
        assert sorted(number for number in ok if number <= len(planned)) == planned
        assert lab.differences() == ()
        yield lab
