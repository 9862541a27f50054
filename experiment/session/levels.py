"""The tracks of a session whose levels a rule chooses, by condition and site.

The journal has every choice. A resumed session rebuilds its tracks from the recorded levels and
answers, and computes no past choice again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from experiment.levels import Tracks
from experiment.record.entries import LevelChosen

if TYPE_CHECKING:
    from experiment.levels import Choice
    from experiment.record.history import History
    from experiment.trial.events import Attempt, EndTrial, SessionState
    from experiment.trial.plan import Plan


class LevelTracks:
    """Chooses the levels of single stimuli; does nothing where the plan has all levels."""

    def __init__(self, plan: Plan, history: History) -> None:
        self._plan, self._task = plan, plan.task
        self._chosen = {trial.number for trial in plan.trials if plan.is_chosen(trial)}
        self._tracks = {
            condition: Tracks(rule, plan.responses, self._task)
            for condition, rule in plan.level_rules.items()
        }
        self._choice: Choice | None = None
        for row in history.rows:
            if row.status == "ok" and not row.premature:
                self._update(row.condition, row.kind, row.side, row.level_vpp, row.response)

    def choose(self, state: SessionState) -> SessionState:
        """Return the state with the level of the next trial."""
        attempt, *rest = state.pending
        trial = attempt.trial
        self._choice = None
        if trial.number not in self._chosen or attempt.warm_up:
            return state
        tracks = self._tracks[trial.condition]
        self._choice = tracks.choose(trial.side, trial.number, attempt.number)
        presented = replace(trial, level_vpp=self._choice.level_vpp)
        return replace(state, pending=(replace(attempt, trial=presented), *rest))

    def line(self, attempt: Attempt) -> LevelChosen | None:
        """Return the line of the journal for the choice of the current trial, if there was one."""
        if self._choice is None:
            return None
        return LevelChosen(
            trial=attempt.trial.number,
            attempt=attempt.number,
            rule=self._plan.level_rules[attempt.trial.condition].kind,
            level_vpp=self._choice.level_vpp,
            entropy_bits=self._choice.entropy_bits,
        )

    def trial_ends(self, end: EndTrial) -> None:
        """Add an answer to its track."""
        trial = end.attempt.trial
        if end.status == "ok" and not end.premature and not end.attempt.warm_up:
            self._update(trial.condition, trial.kind, trial.side, trial.level_vpp, end.response)

    def describe(self) -> tuple[str, ...]:
        """Return the estimated threshold of each track, for the operator."""
        texts = []
        for condition, tracks in self._tracks.items():
            for site, estimate in tracks.estimates():
                name = " ".join(filter(None, (condition, site)))
                low_vpp, high_vpp = estimate.low_vpp, estimate.high_vpp
                interval = f"95 % interval {low_vpp:.0f} to {high_vpp:.0f}"
                texts.append(f"{name}: {estimate.threshold_vpp:.0f} Vpp ({interval})")
        return tuple(texts)

    def _update(
        self, condition: str, kind: str, side: str, level_vpp: float | None, response: str | None
    ) -> None:
        is_counted = kind in self._task.kinds and response in self._task.answer_names
        if is_counted and condition in self._tracks:
            self._tracks[condition].update(side, level_vpp, response or "")
