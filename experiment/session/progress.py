"""The progress of a session for its operator: answers by side, pace, time left."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from experiment.operator.requests import Status, Tally
from experiment.trial.events import Attempt
from experiment.trial.plan import PRACTICE_BLOCK
from experiment.trial.responder import Progress, SessionPart

if TYPE_CHECKING:
    from experiment.record.history import History
    from experiment.study.study import Study
    from experiment.trial.events import EndTrial, SessionState
    from experiment.trial.plan import Plan, Trial


N_LAST_ANSWERS = 5
"""Number of last answers of each side that the operator sees."""


class SessionProgress:
    """Counts trials and answers of a session; earlier visits are in its history."""

    def __init__(self, plan: Plan, study: Study, history: History) -> None:
        self._planned = Counter(Attempt(trial, number=1).part for trial in plan.trials)
        self._blocks = len({t.block for t in plan.trials if t.block > PRACTICE_BLOCK})
        self._study = study
        self._task = plan.task
        self._tallies = {site: Tally() for site in plan.task.sites}
        self._begun_s = 0.0
        self._spent_s = 0.0
        self._done = 0
        for row in history.rows:
            if row.status == "ok" and row.response is not None:
                self._count(row.kind, row.side, row.level_vpp, row.response)

    def trial_begins(self, now_s: float) -> None:
        """Note when a trial began."""
        self._begun_s = now_s

    def trial_ends(self, end: EndTrial, now_s: float) -> None:
        """Count a trial that ended, and the time that it took, answered or not."""
        self._spent_s += now_s - self._begun_s
        if end.status != "ok" or end.response is None:
            return
        self._done += 1
        trial: Trial = end.attempt.trial
        self._count(trial.kind, trial.side, trial.level_vpp, end.response)

    def progress(self, state: SessionState) -> Progress:
        """Return how far the part has come that was introduced last, or is the first to come.

        Behind the last trial of all it is the attempt.
        """
        left = [attempt.part for attempt in state.pending if not attempt.warm_up]
        ahead = left[0] if left else SessionPart.MAIN
        part = (state.part if left else None) or ahead
        of = ahead if part == SessionPart.WARM_UP else part
        planned = self._planned[of]
        return Progress(done=planned - left.count(of), planned=planned, part=part)

    def status(
        self,
        state: SessionState,
        *,
        noise: str,
        device: str,
        message: str,
        estimates: tuple[str, ...] = (),
    ) -> Status:
        """Return what the operator is shown.

        Every trial is expected to take the mean time of those answered in this visit, every break
        its shortest time.
        """
        progress = self.progress(state)
        pace_s = self._spent_s / self._done if self._done else self._study.trial_s
        blocks = [t.trial.block for t in state.pending if t.trial.block > PRACTICE_BLOCK]
        breaks = max(0, len(set(blocks)) - 1)
        next_block = state.pending[0].trial.block if state.pending else self._blocks
        return Status(
            phase=state.phase.value,
            done=progress.done,
            planned=progress.planned,
            block=next_block if state.block is None else state.block,
            blocks=self._blocks,
            left_s=len(state.pending) * pace_s + breaks * self._study.design.min_break_s,
            noise=noise,
            device=device,
            message=message,
            tallies=dict(self._tallies),
            estimates=estimates,
        )

    def _count(self, kind: str, side: str, level_vpp: float | None, response: str) -> None:
        """Count the answer to a stimulus at one site, if it can be right or wrong."""
        site = self._task.presentation(side).site
        correct = self._task.is_correct(side, level_vpp, response)
        if kind not in self._task.kinds or site is None or correct is None:
            return
        tally = self._tallies[site]
        last = (*tally.last, response)[-N_LAST_ANSWERS:]
        counts = {"presented": tally.presented + 1, "correct": tally.correct + correct}
        self._tallies[site] = Tally(**counts, last=last)
