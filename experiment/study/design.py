"""The section [design] of a study file: what is presented, how often, and what may be answered."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from experiment.study.base import Line, Section, is_distinct, obey
from experiment.tasks.task import BLANK, BOTH, SINGLE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.base import Rule
    from experiment.tasks.task import Task

Order = Literal["random", "balanced"]
ConditionOrder = Literal["random", "listed", "balanced"]
PrematureResponses = Literal["repeat", "accept"]

MAX_TRIALS: Final = 10_000
"""More trials of one kind than anybody can be asked for."""
MIN_LEVEL_VPP: Final = 0.1
"""A hundred steps of a device that counts its levels in millivolts."""
EARLIEST_ANSWER_S: Final = 0.1
"""A key within this time of the onset cannot be an answer to it."""
ASSUMED_ANSWER_S: Final = 1.0
"""Assumed time to an answer, when a session's length is estimated."""
_MAX_ROUNDING: Final = 0.1
"""A fraction of trials may be off by this part of it, as trials are whole."""

_NUMBERS: Final = {SINGLE: "trials_per_side", BOTH: "both_trials", BLANK: "blank_trials"}
"""The key with the number of trials of each kind."""
_KEYS_OF_KIND: Final = {
    BOTH: ("both_trials", "both_fraction", "both_level"),
    BLANK: ("blank_trials",),
}
"""The keys of kinds of trials that not every task has."""
_UNUSED: Final = (0, None, "random")
"""The values of these keys that present nothing, as a plan states them."""

Level = Annotated[float, Field(ge=MIN_LEVEL_VPP)]
_Wait = Annotated[float, Field(ge=0.01, le=60)]
_Trials = Annotated[int, Field(ge=0, le=MAX_TRIALS)]


class Design(Section):
    """What is presented, how often, and what may be answered, in each condition."""

    # Two numbers of trials can be given in another way. A plan holds the numbers, so that two files
    # that ask for the same trials are the same study.
    levels_vpp: tuple[Level, ...] = (60.0, 95.0, 130.0, 165.0, 200.0)
    """increasing levels, peak-to-peak of the burst with its window"""
    trials_per_side: Annotated[int, Field(ge=1, le=MAX_TRIALS)] = 75
    """trials with one finger, for each site"""
    repeats_per_level: Annotated[int, Field(ge=1, le=MAX_TRIALS)] | None = None
    """in place of trials_per_side: trials for each site and level"""
    both_trials: _Trials = 5
    """trials with all fingers at once"""
    both_fraction: Annotated[float, Field(ge=0, le=0.9)] | None = None
    """in place of both_trials: their fraction of all trials with a stimulus"""
    both_level: Level | Literal["random"] = "random"
    """level of these trials in Vpp; random: drawn from levels_vpp"""
    blank_trials: _Trials = 0
    """trials without a stimulus; they need the answer none"""
    practice_trials: _Trials = 0
    """trials with feedback at the highest level, before the first block"""
    hands_off_trials_before: Annotated[int, Field(ge=0, le=MAX_TRIALS, multiple_of=2)] = 0
    """trials with the hands off the plate at the beginning, to learn whether it is audible; even"""
    hands_off_trials_after: Annotated[int, Field(ge=0, le=MAX_TRIALS, multiple_of=2)] = 0
    """trials with the hands off the plate at the end; even"""
    order: Order = "random"
    """order of trials; balanced: each level equally often in each block"""
    condition_order: ConditionOrder = "random"
    """order of conditions; balanced: over participants, by their numbers"""
    responses: tuple[str, ...] = ()
    """answers on offer; by default those that the trials need"""
    foreperiod_s: tuple[_Wait, _Wait] = (0.8, 2.0)
    """shortest and longest wait before a stimulus"""
    response_window_s: Annotated[float, Field(gt=EARLIEST_ANSWER_S, le=60)] = 3.0
    """longest time to an answer"""
    break_every: _Trials = 31
    """trials between breaks; 0 for no break"""
    min_break_s: Annotated[float, Field(ge=0, le=3600)] = 15.0
    """shortest break"""
    premature_responses: PrematureResponses = "repeat"
    """what happens to a trial with a premature response"""
    max_premature: Annotated[int, Field(ge=1, le=100)] = 3
    """pause the session after this many premature responses in a row, or on one trial"""
    source: Line | None = None
    """where these values are from"""

    def rules(self) -> Iterator[Rule]:
        """Yield the rules of levels, numbers of trials and waits."""
        levels_vpp, single_trials = self.levels_vpp, self._single_trials
        yield not levels_vpp, "levels_vpp", "must have at least one level"
        for index, (below_vpp, level_vpp) in enumerate(pairwise(levels_vpp), start=1):
            rule = f"must be above the level before it, {below_vpp:g}"
            yield level_vpp <= below_vpp, f"levels_vpp[{index}]", rule
        exclusive = {"repeats_per_level": "trials_per_side", "both_fraction": "both_trials"}
        for key, number in exclusive.items():
            excess = getattr(self, key) is not None and number in self.model_fields_set
            yield excess, key, f"excludes {number}; give one of the two"
        rule = f"must be at most {MAX_TRIALS // len(levels_vpp)} with these levels"
        yield single_trials > MAX_TRIALS, "repeats_per_level", rule
        is_uneven = self.order == "balanced" and single_trials % len(levels_vpp) > 0
        rule = f"must be a multiple of the number of levels, {len(levels_vpp)}, with order ="
        yield is_uneven, "trials_per_side", f'{rule} "balanced"', single_trials
        shortest_s, longest_s = self.foreperiod_s
        rule = f"must be at least the shortest wait, {shortest_s:g}"
        yield longest_s < shortest_s, "foreperiod_s[1]", rule

    @model_validator(mode="after")
    def _count_trials(self) -> Self:
        """Put numbers of trials in place of the other ways to state them."""
        self.__dict__.update(trials_per_side=self._single_trials, repeats_per_level=None)
        return self

    @property
    def _single_trials(self) -> int:
        """Trials with one finger, for each site."""
        if self.repeats_per_level is None:
            return self.trials_per_side
        return self.repeats_per_level * len(self.levels_vpp)

    def with_both_trials(self, n_sites: int) -> Design:
        """Return the design with a number of trials in place of their fraction f of all trials.

        With s trials of one finger and b of several, b = s f / (1 - f).
        """
        if (fraction := self.both_fraction) is None:
            return self
        single = n_sites * self.trials_per_side
        trials = round(single * fraction / (1 - fraction))
        nearest = trials / (single + trials)
        is_far = abs(nearest - fraction) > _MAX_ROUNDING * fraction or trials > MAX_TRIALS
        rule = (
            f"must give a whole number of at most {MAX_TRIALS} trials beside {single} "
            f"with one finger; {trials} trials give {nearest:.4g}"
        )
        obey([(is_far, "both_fraction", rule)], self)
        return self.completed(both_trials=trials, both_fraction=None)

    def with_answers(self, task: Task) -> Design:
        """Return the design with the answers that its trials need, or check those it offers.

        Kinds of trials that the task does not have are refused, and are none by default.
        """
        rule = f'must be omitted with task.kind = "{task.name}"'
        unused = [
            key for kind, keys in _KEYS_OF_KIND.items() if kind not in task.kinds for key in keys
        ]
        obey(
            (key in self.model_fields_set and value not in _UNUSED, key, rule, value)
            for key in unused
            for value in [getattr(self, key)]
        )
        design = self.completed(**dict.fromkeys({*unused} & {*_NUMBERS.values()}, 0))
        design = design.with_both_trials(len(task.sites))
        presented = {p.correct for p in task.presentations if design.trials_of(p.kind)}
        needed = tuple(
            name
            for name in task.answer_names
            if name in presented or name not in task.optional_answers
        )
        if "responses" not in self.model_fields_set:
            return design.completed(responses=needed)
        for index, response in enumerate(self.responses):
            is_unknown, rule = response not in task.answer_names, ", ".join(task.answer_names)
            obey([(is_unknown, f"responses[{index}]", f"must be one of {rule}")], self)
        missing = ", ".join(answer for answer in needed if answer not in self.responses)
        rule = f"must contain {missing}, the correct answer to some trials"
        obey([(not is_distinct(self.responses), "responses", "must be distinct")], self)
        obey([(missing != "", "responses", rule)], self)
        return design

    def trials_of(self, kind: str) -> int:
        """Return how many trials of a kind a condition has; of single ones, for each site."""
        trials: int = getattr(self, _NUMBERS[kind])
        return trials

    @property
    def both_level_vpp(self) -> float | None:
        """Level of the trials with both fingers; none if it is drawn from the levels."""
        return None if isinstance(self.both_level, str) else self.both_level

    def trials_at(self, n_sites: int) -> int:
        """Return the trials of one condition, without practice and hands-off trials."""
        return n_sites * self.trials_per_side + self.both_trials + self.blank_trials

    @property
    def highest_vpp(self) -> float:
        """The highest level that is ever presented."""
        return max(*self.levels_vpp, self.both_level_vpp or 0.0)
