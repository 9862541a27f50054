"""How a session stands, for its operator: answers by side, pace, time left."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING

from experiment.operator.requests import Status, Tally
from experiment.rows import is_correct
from experiment.study.design import ASSUMED_ANSWER_S
from experiment.trial.events import Task
from experiment.trial.plan import PRACTICE_BLOCK
from experiment.trial.responder import Progress, SessionPart

if TYPE_CHECKING:
    from experiment.archive.history import History
    from experiment.study.design import Design
    from experiment.trial.events import EndTrial, SessionState
    from experiment.trial.plan import Plan, Trial


LAST_ANSWERS = 5
"""So many answers of each side are shown."""


class Standing:
    """What is counted while a session goes on; earlier sittings are in its history."""

    def __init__(self, plan: Plan, design: Design, history: History) -> None:
        self._planned = Counter(Task(trial, attempt=1).part for trial in plan.trials)
        self._blocks = len({t.block for t in plan.trials if t.block > PRACTICE_BLOCK})
        self._design = design
        self._tallies = {"left": Tally(), "right": Tally()}
        self._begun_s = 0.0
        self._spent_s = 0.0
        self._done = 0
        for row in history.rows:
            if row.status == "ok" and row.kind == "single" and row.response is not None:
                self._count(row.side, row.response)

    def trial_begins(self, now_s: float) -> None:
        """Note when a trial began."""
        self._begun_s = now_s

    def trial_ends(self, end: EndTrial, now_s: float) -> None:
        """Count a trial that ended, and the time that it took, answered or not."""
        self._spent_s += now_s - self._begun_s
        if end.status != "ok" or end.response is None:
            return
        self._done += 1
        trial: Trial = end.task.trial
        if trial.kind == "single":
            self._count(trial.side, end.response)

    def progress(self, state: SessionState) -> Progress:
        """Return how far the part has come that was introduced last, or is the first to come.

        Behind the last trial of all it is the task.
        """
        left = [task.part for task in state.pending if not task.warm_up]
        ahead = left[0] if left else SessionPart.MAIN
        part = (state.part if left else None) or ahead
        of = ahead if part == SessionPart.WARM_UP else part
        planned = self._planned[of]
        return Progress(done=planned - left.count(of), planned=planned, part=part)

    def status(self, state: SessionState, *, noise: str, device: str, message: str) -> Status:
        """Return what the operator is shown."""
        progress = self.progress(state)
        return Status(
            phase=state.phase.value,
            done=progress.done,
            planned=progress.planned,
            block=self._block(state),
            blocks=self._blocks,
            left_s=self._left_s(state),
            noise=noise,
            device=device,
            message=message,
            tallies=dict(self._tallies),
        )

    def _block(self, state: SessionState) -> int:
        """Return the open block, or the one to come; after the last one, the last."""
        if state.block is not None:
            return state.block
        return state.pending[0].trial.block if state.pending else self._blocks

    def _left_s(self, state: SessionState) -> float:
        """Expect every trial to take the mean of those so far, every break its shortest time."""
        blocks = {t.trial.block for t in state.pending if t.trial.block > PRACTICE_BLOCK}
        breaks = max(0, len(blocks) - 1)
        return len(state.pending) * self._pace_s() + breaks * self._design.minimum_break_s

    def _pace_s(self) -> float:
        """Return the mean time for a trial that was answered in this sitting."""
        if self._done:
            return self._spent_s / self._done
        answer_s = min(ASSUMED_ANSWER_S, self._design.response_window_s)
        return sum(self._design.foreperiod_s) / 2 + answer_s

    def _count(self, side: str, response: str) -> None:
        tally = self._tallies[side]
        correct = is_correct("single", side, response) is True
        self._tallies[side] = replace(
            tally,
            presented=tally.presented + 1,
            correct=tally.correct + correct,
            last=(*tally.last, response)[-LAST_ANSWERS:],
        )
