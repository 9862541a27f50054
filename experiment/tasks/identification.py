"""Identification of the site of a stimulus among several."""

from __future__ import annotations

import string
from typing import TYPE_CHECKING, Final

import numpy as np

from experiment.tasks.task import FINGERS, SINGLE, Answer, Burst, Presentation, Task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiment.tasks.task import Floats, Guessing, Sensation

MIN_SITES: Final = 2
MAX_SITES: Final = 16
_KEYS: Final = (*"123456789", *string.ascii_lowercase)
_WHERE: Final = "At which finger did you feel it?"
_HANDS_OFF: Final = (
    "Take your hands off the plate. If you hear a vibration, answer where it comes from; if not, "
    "guess."
)


def _identify(
    intervals: Sequence[Sensation], responses: tuple[str, ...], _guessing: Guessing
) -> dict[str, Floats]:
    """Return the probability of each site's answer.

    A participant answers the site of the strongest burst that they detected, or any site equally
    often where they detected none. Equal amplitudes are answered equally often.
    """
    detected, amplitudes = (np.array(each) for each in intervals[0][:2])
    guesses = np.prod(1 - detected, axis=0) / len(responses)
    answers = {}
    for i, name in enumerate(responses):
        p = detected[i]
        for j in range(len(responses)):
            if j != i:
                wins = np.where(amplitudes[j] == amplitudes[i], 0.5, amplitudes[j] > amplitudes[i])
                p = p * (1 - detected[j] * wins)
        answers[name] = p + guesses
    total = sum(answers.values())  # three equal amplitudes or more are not halves of pairs
    return {name: p / total for name, p in answers.items()}


def identification(sites: tuple[str, ...]) -> Task:
    """Return the identification of one of these sites, 2 to 16.

    Raises
    ------
    ValueError
        If there are fewer or more sites.
    """
    if not MIN_SITES <= len(sites) <= MAX_SITES:
        raise ValueError(f"must have {MIN_SITES} to {MAX_SITES} sites with identification")
    return Task(
        name="identification",
        sites=sites,
        presentations=tuple(
            Presentation(
                name=site,
                kind=SINGLE,
                bursts=(Burst((site,)),),
                correct=site,
                site=site,
                meaning=f"at the {site} finger",
            )
            for site in sites
        ),
        answers=tuple(
            Answer(name=site, keys=(key,), sites=(site,), meaning=f"at the {site} finger")
            for site, key in zip(sites, _KEYS, strict=False)
        ),
        scoring="identification",
        kinds={SINGLE: "a stimulus at one finger"},
        reversed_mapping=dict(zip(sites, reversed(sites), strict=True)),
        texts={
            "placement": FINGERS,
            "hands_off_before": _HANDS_OFF,
            "hands_off_after": _HANDS_OFF,
            "prompt": _WHERE,
            "prompt_hands_off": "Where did you notice anything?",
        },
        instructions={
            frozenset(): (
                "You will feel a short vibration under one of your fingers. Answer where you felt "
                "it; the picture shows the key of each finger. If you are not sure, choose the "
                "most likely answer."
            )
        },
        decide=_identify,
    )
