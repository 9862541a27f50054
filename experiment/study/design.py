"""The section [design]: what is presented, how often, in which order, what may be answered."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator
from pydantic_core import ArgsKwargs

from experiment.names import inward, require_word
from experiment.rows import ANSWERS
from experiment.study.base import section
from stimuli.checks import finite

Order = Literal["random", "balanced"]
ConditionOrder = Literal["random", "listed", "balanced"]
Anticipated = Literal["requeue", "keep"]

MAX_TRIALS = 10_000
"""More trials of one sort than a person can be asked for: a slip of the keyboard."""
LEAST_LEVEL_VPP = 0.1
"""A hundred steps of a device that counts its levels in millivolts."""
EARLIEST_ANSWER_S = 0.1
"""A key within this time of the onset cannot be an answer to it."""
ASSUMED_ANSWER_S: Final = 1.0
"""How long a person is taken to need for an answer, when a session's length is estimated."""
_EXCLUSIVE: Final = (("trials_per_side", "repeats_per_level"), ("both_trials", "both_fraction"))
_FRACTION_DIGITS: Final = 4
_FRACTION_ROUNDING: Final = 0.1
"""By so much of a fraction that is asked for may that of whole trials be off."""

Level = Annotated[float, Field(ge=LEAST_LEVEL_VPP)]
_Wait = Annotated[float, Field(ge=0.01, le=60)]


@section
class Design:
    """What is presented, how often, and what may be answered; for each condition.

    The trials with the fingers off the plate, too: as many of each side, at the highest level.
    """

    # Two keys may be said in another way. What a plan holds is the number of trials that comes of
    # it, so that two files that ask for the same trials are the same study.

    levels_vpp: tuple[Level, ...] = Field(
        default=(60.0, 95.0, 130.0, 165.0, 200.0),
        strict=False,
        description="increasing; from peak to peak of the burst with its window, as it is played",
    )
    trials_per_side: int = Field(
        default=75, ge=1, le=MAX_TRIALS, description="one finger at a time"
    )
    repeats_per_level: int | None = Field(
        default=None, ge=1, le=MAX_TRIALS, description="or: trials of each side and level"
    )
    both_trials: int = Field(default=5, ge=0, le=MAX_TRIALS, description="both fingers at once")
    both_fraction: float | None = Field(
        default=None,
        ge=0,
        le=0.9,
        description="or: about this part of all trials with a stimulus",
    )
    both_level: Level | Literal["random"] = Field(
        default="random", description="their level in Vpp; random: drawn from levels_vpp"
    )
    blank_trials: int = Field(
        default=0, ge=0, le=MAX_TRIALS, description="no stimulus; needs the answer none"
    )
    practice_trials: int = Field(
        default=0,
        ge=0,
        le=MAX_TRIALS,
        description="with feedback, at the highest level, before the first block",
    )
    audibility_trials: int = Field(
        default=0,
        ge=0,
        le=MAX_TRIALS,
        description="fingers off, at the beginning: is the plate heard? even",
    )
    control_trials: int = Field(
        default=0,
        ge=0,
        le=MAX_TRIALS,
        description="fingers off, at the end: the task as before; even",
    )
    order: Order = Field(default="random", description="balanced: each level equally often")
    condition_order: ConditionOrder = Field(
        default="random", description="balanced: over participants, by their numbers"
    )
    responses: tuple[str, ...] = Field(
        default=("left", "right", "both"), strict=False, description="of left, right, both, none"
    )
    foreperiod_s: tuple[_Wait, _Wait] = Field(
        default=(0.8, 2.0), strict=False, description="least and most wait before a stimulus"
    )
    response_window_s: float = Field(
        default=3.0, gt=EARLIEST_ANSWER_S, le=60, description="an answer is waited for so long"
    )
    break_every: int = Field(default=31, ge=0, le=MAX_TRIALS, description="trials; 0 for no break")
    minimum_break_s: float = Field(default=15.0, ge=0, le=3600, description="shortest break")
    anticipated: Anticipated = Field(
        default="requeue", description="what becomes of a trial answered too early"
    )
    most_anticipated: int = Field(
        default=3,
        ge=1,
        le=100,
        description="so many requeued in a row, or of one trial: a pause that the operator ends; "
        "where none attends, as with --responder terminal, the session stops; ours",
    )

    @model_validator(mode="before")
    @classmethod
    def _say_it_once(cls, given: Any) -> Any:
        """Refuse a number of trials that is given in both ways."""
        if isinstance(given, ArgsKwargs):
            keys = given.kwargs or {}
            for pair in _EXCLUSIVE:
                if all(keys.get(key) is not None for key in pair):
                    raise ValueError(f"{' and '.join(pair)} exclude each other; got both")
        return given

    def __post_init__(self) -> None:
        if not self.levels_vpp:
            raise ValueError("levels_vpp must hold at least one level; got none")
        for place, below_vpp in enumerate(self.levels_vpp[:-1], start=1):
            finite(f"levels_vpp[{place}]", self.levels_vpp[place], above=below_vpp)
        self._work_out_trials()
        for name in ("audibility_trials", "control_trials"):
            if (trials := getattr(self, name)) % 2:
                raise ValueError(f"{name} must be even, half of them for each side; got {trials}")
        if self.order == "balanced" and self.trials_per_side % len(self.levels_vpp):
            raise ValueError(
                "trials_per_side must be a multiple of the number of levels, "
                f"{len(self.levels_vpp)}, where order is balanced; got {self.trials_per_side}; "
                f"write {_multiples(self.trials_per_side, len(self.levels_vpp))}"
            )
        self._check_responses()
        finite("foreperiod_s[1]", self.foreperiod_s[1], least=self.foreperiod_s[0])

    def _work_out_trials(self) -> None:
        """Put the numbers of trials in the place of the other ways to say them."""
        if self.repeats_per_level is not None:
            trials, most = self.repeats_per_level * len(self.levels_vpp), self._most_repeats
            if self.repeats_per_level > most:
                raise ValueError(
                    f"repeats_per_level must be at most {most} with {len(self.levels_vpp)} "
                    f"levels, {MAX_TRIALS} trials a side; got {self.repeats_per_level}"
                )
            _put(self, trials_per_side=trials, repeats_per_level=None)
        if self.both_fraction is not None:
            trials = _both_trials(self.both_fraction, 2 * self.trials_per_side)
            _put(self, both_trials=trials, both_fraction=None)

    @property
    def _most_repeats(self) -> int:
        return MAX_TRIALS // len(self.levels_vpp)

    @property
    def both_level_vpp(self) -> float | None:
        """Level of the trials with both fingers; none where it is drawn from the levels."""
        return None if self.both_level == "random" else self.both_level

    @property
    def trials(self) -> int:
        """Trials of one condition, practice and those with the fingers off the plate left out."""
        return 2 * self.trials_per_side + self.both_trials + self.blank_trials

    @property
    def highest_vpp(self) -> float:
        """The highest level that is ever presented."""
        return max(*self.levels_vpp, self.both_level_vpp or 0.0)

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


def _put(design: Design, **keys: int | None) -> None:
    """Put worked-out values into a section that is being made; from then on it is frozen."""
    for key, value in keys.items():
        object.__setattr__(design, key, value)


def _multiples(trials: int, levels: int) -> str:
    """Name the multiples of a number of levels next to a number of trials."""
    below = trials // levels * levels
    return " or ".join(str(one) for one in (below, below + levels) if 0 < one <= MAX_TRIALS)


def _both_trials(fraction: float, single_trials: int) -> int:
    """Return how many trials with both fingers make a fraction of all with a stimulus.

    With s of one finger, b of both: b = s f / (1 - f), to the next whole number. A lab that writes
    a tenth means about a tenth, but not a third less: what rounding moves by more than a tenth of
    what was asked is refused, and so is a fraction that comes to no trial at all.
    """

    def fraction_of(both_trials: int) -> float:
        return both_trials / (single_trials + both_trials)

    exact = single_trials * fraction / (1 - fraction)
    nearest = round(exact)
    if nearest > MAX_TRIALS:
        most = inward(fraction_of(MAX_TRIALS), least=False, digits=_FRACTION_DIGITS)
        raise ValueError(
            f"both_fraction must be at most {most}, {MAX_TRIALS} trials "
            f"beside {single_trials} of one finger; got {fraction:g}"
        )
    if abs(fraction_of(nearest) - fraction) <= _FRACTION_ROUNDING * fraction:
        return nearest
    fewer = math.floor(exact)
    named = " and ".join(
        f"{fraction_of(trials):.{_FRACTION_DIGITS}g} ({trials} trial{'' if trials == 1 else 's'})"
        for trials in (fewer, fewer + 1)
    )
    raise ValueError(
        f"both_fraction must be within {_FRACTION_ROUNDING:.0%} that of a whole number of trials "
        f"beside {single_trials} of one finger; got {fraction:g}, which gives {exact:.2f}; the "
        f"nearest are {named}"
    )


def repeats_words(design: Design) -> str:
    """Say which levels there are, and how often each comes."""
    levels = " ".join(f"{level_vpp:g}" for level_vpp in design.levels_vpp)
    share = design.trials_per_side / len(design.levels_vpp)
    if design.order == "balanced":
        return f"{levels} Vpp, balanced: {share:g} of each side and level"
    spread = math.sqrt(share * (1 - 1 / len(design.levels_vpp)))
    return f"{levels} Vpp, drawn at random: {share:.3g} +- {spread:.2g} of each side and level"


def part_of_both(design: Design) -> str:
    """Say what a fraction that was asked for, or a number of trials, comes to."""
    if not design.both_trials:
        return ""
    part = design.both_trials / (2 * design.trials_per_side + design.both_trials)
    return f" ({part:.1%} of those with a stimulus)"
