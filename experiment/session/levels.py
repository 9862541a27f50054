"""The tracks of a session whose levels a rule chooses, by condition and site.

The journal has every choice, so that a resumed session continues with what was presented: tracks
are made again from the recorded levels and answers, and no past choice is computed anew.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from experiment.record.entries import LevelChosen
from experiment.tasks.task import BLANK

if TYPE_CHECKING:
    from experiment.levels import Choice, Track
    from experiment.record.history import History
    from experiment.trial.events import Attempt, EndTrial, SessionState
    from experiment.trial.plan import Plan


class LevelTracks:
    """Chooses the levels of single stimuli; does nothing where the plan has all levels."""

    def __init__(self, plan: Plan, history: History) -> None:
        self._plan, self._task = plan, plan.task
        self._chosen = {trial.number for trial in plan.trials if plan.is_chosen(trial)}
        self._tracks: dict[tuple[str, str], Track] = {}
        self._choice: Choice | None = None
        for condition, rule in plan.level_rules.items():
            for site in ("",) if rule.pooled else self._task.sites:
                self._tracks[condition, site] = rule.start(plan.responses, self._task)
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
        rule = self._plan.level_rules[trial.condition]
        site = "" if rule.pooled else self._task.presentation(trial.side).site or ""
        track = self._tracks[trial.condition, site]
        self._choice = track.choose(trial.number, attempt.number)
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
        for (condition, site), track in self._tracks.items():
            estimate = track.estimate()
            name = " ".join(filter(None, (condition, site)))
            if estimate is not None:
                low_vpp, high_vpp = estimate.low_vpp, estimate.high_vpp
                interval = f"95 % interval {low_vpp:.0f} to {high_vpp:.0f}"
                texts.append(f"{name}: {estimate.threshold_vpp:.0f} Vpp ({interval})")
        return tuple(texts)

    def _update(
        self, condition: str, kind: str, side: str, level_vpp: float | None, response: str | None
    ) -> None:
        if kind not in self._task.kinds or response not in self._task.answer_names:
            return
        presentation = self._task.presentation(side)
        for (name, site), track in self._tracks.items():
            is_concerned = site in {"", presentation.site} or presentation.kind == BLANK
            if name == condition and is_concerned:
                track.update(presentation, level_vpp, response)
