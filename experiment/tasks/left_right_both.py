"""Localisation with two fingers: the stimulus is on the left, on the right, or at both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from experiment.tasks.task import BLANK, BOTH, PLACEMENT, SINGLE, Answer, Burst, Presentation, Task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiment.tasks.task import Floats, Guessing, Sensation


_LEFT, _RIGHT, _BOTH, _NONE = "left", "right", "both", "none"


def _decide(
    intervals: Sequence[Sensation], responses: tuple[str, ...], guessing: Guessing
) -> dict[str, Floats]:
    """Return the probability of each answer.

    A participant who detects one site answers it. Two detected sites are answered by ``both``, or
    by the stronger one where ``both`` is not offered. If nothing was detected, the answer is
    ``none``, but for false alarms. Whatever remains is a guess.
    """
    (left, right), (left_um, right_um) = intervals[0].detected, intervals[0].amplitudes
    answers = {_LEFT: left * (1 - right), _RIGHT: right * (1 - left)}
    guesses, together = (1 - left) * (1 - right), left * right
    if _NONE in responses:
        answers[_NONE] = guesses * (1 - guessing.false_alarm)
        guesses = guesses * guessing.false_alarm
    if _BOTH in responses:
        answers[_BOTH] = together + guesses * guessing.all_sites
        guesses = guesses * (1 - guessing.all_sites)
    else:
        answers[_LEFT] += together * (left_um > right_um)
        answers[_RIGHT] += together * (left_um < right_um)
        guesses = guesses + together * (left_um == right_um)
    answers[_LEFT] += guesses * guessing.first_site
    answers[_RIGHT] += guesses * (1 - guessing.first_site)
    return answers


_WHERE: Final = "Answer where you felt it."
_UNSURE: Final = "If you are not sure, choose the most likely answer."
_INTRODUCTION: Final = "You will feel a short vibration under your left or your right finger."
_OR_BOTH: Final = (
    "You will feel a short vibration under your left finger, under your right finger, or under "
    "both."
)
_OR_NOTHING: Final = "In some trials you may feel no vibration: press {none} then."

LEFT_RIGHT_BOTH: Final = Task(
    name="left-right-both",
    sites=(_LEFT, _RIGHT),
    presentations=(
        Presentation(
            name=_LEFT,
            kind=SINGLE,
            bursts=(Burst((_LEFT,)),),
            correct=_LEFT,
            site=_LEFT,
            meaning="at the left finger",
        ),
        Presentation(
            name=_RIGHT,
            kind=SINGLE,
            bursts=(Burst((_RIGHT,)),),
            correct=_RIGHT,
            site=_RIGHT,
            meaning="at the right finger",
        ),
        Presentation(
            name=_BOTH,
            kind=BOTH,
            bursts=(Burst((_LEFT, _RIGHT)),),
            correct=_BOTH,
            meaning="at both fingers",
        ),
        Presentation(
            name=_NONE,
            kind=BLANK,
            bursts=(Burst(),),
            correct=_NONE,
            meaning="no stimulus",
        ),
    ),
    answers=(
        Answer(name=_LEFT, keys=("left",), sites=(_LEFT,), meaning="at the left finger"),
        Answer(name=_RIGHT, keys=("right",), sites=(_RIGHT,), meaning="at the right finger"),
        Answer(
            name=_BOTH,
            keys=("down",),
            sites=(_LEFT, _RIGHT),
            meaning="at both fingers",
            optional=True,
        ),
        Answer(name=_NONE, keys=("space",), meaning="nothing was noticed", optional=True),
    ),
    nothing=_NONE,
    kinds={
        SINGLE: "a stimulus at one finger",
        BOTH: "a stimulus at both fingers at once",
        BLANK: "no stimulus",
    },
    reversed_mapping={_LEFT: _RIGHT, _RIGHT: _LEFT},
    texts={
        "placement": PLACEMENT,
        "hands_off_before": (
            "Take both hands off the plate. If you hear a vibration, answer where it comes from; "
            "if you hear nothing, press {none}."
        ),
        "hands_off_after": (
            "Take both hands off the plate. Answer with the same keys; if you notice nothing, "
            "press {none}."
        ),
        "prompt": "Where did you feel it?",
        "prompt_hands_off": "Did you notice anything, and where?",
    },
    instructions={
        frozenset(): f"{_INTRODUCTION} {_WHERE} {_UNSURE}",
        frozenset({_BOTH}): f"{_OR_BOTH} {_WHERE} {_UNSURE}",
        frozenset({_NONE}): f"{_INTRODUCTION} {_WHERE} {_OR_NOTHING} {_UNSURE}",
        frozenset({_BOTH, _NONE}): f"{_OR_BOTH} {_WHERE} {_OR_NOTHING} {_UNSURE}",
    },
    decide=_decide,
)
