"""The design of a study: what is presented, how often, in which order, what may be answered."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

from experiment.terms.checks import require_word
from experiment.terms.record import ANSWERS
from stimuli.checks import finite, whole

Order = Literal["random", "balanced"]
ConditionOrder = Literal["random", "listed"]
Anticipated = Literal["requeue", "keep"]

MAX_TRIALS = 10_000
"""More trials of one sort than a person can be asked for: a slip of the keyboard."""
LEAST_LEVEL_VPP = 0.1
"""A hundred steps of a device that counts its levels in millivolts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """What is presented, how often, in which order, and what may be answered.

    Attributes
    ----------
    levels_vpp : tuple of float
        Drive levels of the single-finger trials, increasing.
    trials_per_side : int
        Single-finger trials of each side.
    both_trials : int
        Trials with both fingers at once.
    both_level_vpp : float or None
        Their level; none where it is drawn from ``levels_vpp``.
    blank_trials, practice_trials : int
        Trials without a stimulus; trials with feedback before the first block.
    order : str
        ``random`` draws every level independently, ``balanced`` presents each equally often.
    condition_order : str
        ``random`` or ``listed``.
    responses : tuple of str
        The answers offered, words of `record.ANSWERS`.
    foreperiod_s : tuple of float
        Least and most wait between the cue and the stimulus.
    response_window_s : float
        How long an answer is waited for.
    break_every : int
        Trials between two breaks; 0 for no break.
    minimum_break_s : float
        Shortest break.
    anticipated : str
        ``requeue`` repeats a trial answered before it could be felt, ``keep`` only flags it.
    audibility_trials, control_trials : int
        Trials with the fingers off the plate, half of them for each side, at the highest level:
        before everything else, to learn whether the plate is heard, and at the end, the task as
        before.

    Raises
    ------
    ValueError
        If a value is out of its range, or two do not go together; it begins with the name.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from experiment.study.read import paper_study
    >>> replace(paper_study().design, order="balanced", trials_per_side=76)
    Traceback (most recent call last):
    ValueError: trials_per_side must be a multiple of the number of levels, 5, where order is
    balanced; got 76
    """

    levels_vpp: tuple[float, ...]
    trials_per_side: int
    both_trials: int
    both_level_vpp: float | None
    blank_trials: int
    practice_trials: int
    order: Order
    condition_order: ConditionOrder
    responses: tuple[str, ...]
    foreperiod_s: tuple[float, float]
    response_window_s: float
    break_every: int
    minimum_break_s: float
    anticipated: Anticipated
    audibility_trials: int = 0
    control_trials: int = 0

    def __post_init__(self) -> None:
        check_levels(self.levels_vpp)
        whole("trials_per_side", self.trials_per_side, least=1, most=MAX_TRIALS)
        for name in ("both_trials", "blank_trials", "practice_trials", "break_every"):
            whole(name, getattr(self, name), least=0, most=MAX_TRIALS)
        for name in ("audibility_trials", "control_trials"):
            trials = whole(name, getattr(self, name), least=0, most=MAX_TRIALS)
            if trials % 2:
                raise ValueError(f"{name} must be even, half of them for each side; got {trials}")
        if self.both_level_vpp is not None:
            finite("both_level", self.both_level_vpp, least=LEAST_LEVEL_VPP)
        require_word("order", self.order, get_args(Order))
        require_word("condition_order", self.condition_order, get_args(ConditionOrder))
        require_word("anticipated", self.anticipated, get_args(Anticipated))
        self._check_balance()
        self._check_responses()
        self._check_times()

    @property
    def trials(self) -> int:
        """Trials of one condition, practice and those with the fingers off the plate left out."""
        return 2 * self.trials_per_side + self.both_trials + self.blank_trials

    @property
    def highest_vpp(self) -> float:
        """The highest level that is ever presented."""
        return max(*self.levels_vpp, self.both_level_vpp or 0.0)

    def _check_balance(self) -> None:
        if self.order == "balanced" and self.trials_per_side % len(self.levels_vpp):
            raise ValueError(
                "trials_per_side must be a multiple of the number of levels, "
                f"{len(self.levels_vpp)}, where order is balanced; got {self.trials_per_side}"
            )

    def _check_responses(self) -> None:
        for place, response in enumerate(self.responses):
            require_word(f"responses[{place}]", response, ANSWERS)
        if len(set(self.responses)) != len(self.responses):
            raise ValueError(f"responses must be distinct; got {list(self.responses)}")
        needed = {"left": 1, "right": 1, "both": self.both_trials, "none": self.blank_trials}
        missing = [word for word, trials in needed.items() if trials and word not in self.responses]
        if missing:
            raise ValueError(
                "responses must hold left and right, both where both_trials is above 0 and none "
                f"where blank_trials is above 0; missing {', '.join(missing)}, "
                f"got {list(self.responses)}"
            )

    def _check_times(self) -> None:
        finite("foreperiod_s[0]", self.foreperiod_s[0], above=0, most=60)
        finite("foreperiod_s[1]", self.foreperiod_s[1], least=self.foreperiod_s[0], most=60)
        finite("response_window_s", self.response_window_s, above=EARLIEST_ANSWER_S, most=60)
        finite("minimum_break_s", self.minimum_break_s, least=0, most=3600)


def check_levels(levels_vpp: tuple[float, ...]) -> None:
    """Refuse levels that are not increasing, or below what a device can set.

    Examples
    --------
    >>> check_levels((60.0, 60.0))
    Traceback (most recent call last):
    ValueError: levels_vpp[1] must be a finite number > 60, got 60.0
    """
    if not levels_vpp:
        raise ValueError("levels_vpp must hold at least one level; got none")
    finite("levels_vpp[0]", levels_vpp[0], least=LEAST_LEVEL_VPP)
    below_vpp = 0.0
    for place, level_vpp in enumerate(levels_vpp):
        finite(f"levels_vpp[{place}]", level_vpp, above=below_vpp)
        below_vpp = level_vpp


EARLIEST_ANSWER_S = 0.1
"""A key within this time of the onset cannot be an answer to it."""

ASSUMED_ANSWER_S: Final = 1.0
"""How long a person is taken to need for an answer, when a session's length is estimated."""
