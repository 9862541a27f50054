"""Forced choice between observation intervals: detection and discrimination of amplitudes."""

from __future__ import annotations

from itertools import permutations, product
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from experiment.tasks.task import FINGERS, SINGLE, Answer, Burst, Presentation, Task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiment.tasks.task import Floats, Guessing, Sensation

_NAMES: Final = ("first", "second", "third")
_KEYS: Final = (("1", "left"), ("2", "down"), ("3", "right"))
_TWO_KEYS: Final = (_KEYS[0], ("2", "right"))
_HANDS_OFF: Final = (
    "Take your hands off the plate. If you hear or see anything, answer by it; if not, guess."
)


def _answers(n_intervals: int, meaning: str) -> tuple[Answer, ...]:
    keys = _TWO_KEYS if n_intervals == len(_TWO_KEYS) else _KEYS
    return tuple(
        Answer(name=name, keys=keys[i], meaning=meaning.format(name), sign=str(i + 1))
        for i, name in enumerate(_NAMES[:n_intervals])
    )


def _detect(
    intervals: Sequence[Sensation], responses: tuple[str, ...], _guessing: Guessing
) -> dict[str, Floats]:
    """Return the probability of each interval's answer.

    A participant detects something in each interval or does not, and answers one of those in which
    they did, each equally often; where they detected nothing at all, any interval.
    """
    missed = [np.prod([1 - p for p in interval.detected], axis=0) for interval in intervals]
    answers = {name: np.zeros_like(missed[0]) for name in responses}
    for detected in product((False, True), repeat=len(intervals)):
        p = np.prod([1 - m if d else m for d, m in zip(detected, missed, strict=True)], axis=0)
        is_chosen = detected if any(detected) else (True,) * len(intervals)
        for name, chosen in zip(responses, is_chosen, strict=True):
            answers[name] = answers[name] + p * chosen / sum(is_chosen)
    return answers


def _compare(
    intervals: Sequence[Sensation], responses: tuple[str, ...], _guessing: Guessing
) -> dict[str, Floats]:
    """Return the probability of the stronger interval's answer.

    The sensation of each burst is normal, with the width of the psychometric function, and the
    stronger one is answered: two sensations differ by its width times the square root of 2.
    """
    first, second = (np.max(interval.strengths, axis=0) for interval in intervals)
    with np.errstate(invalid="ignore"):  # nothing in either interval
        p = ndtr((second - first) / np.sqrt(2))
    p = np.where(np.isnan(p), 0.5, p)
    return dict(zip(responses, (1 - p, p), strict=True))


def _forced_choice(name: str, sites: tuple[str, ...], n_intervals: int, word: str) -> Task:
    presentations = tuple(
        Presentation(
            name=f"{site}_{interval + 1}",
            kind=SINGLE,
            bursts=tuple(Burst((site,) if i == interval else ()) for i in range(n_intervals)),
            correct=_NAMES[interval],
            site=site,
            meaning=f"at the {site} finger, in the {_NAMES[interval]} interval",
        )
        for site in sites
        for interval in range(n_intervals)
    )
    return Task(
        name=name,
        sites=sites,
        presentations=presentations,
        answers=_answers(n_intervals, "the vibration was in the {} interval"),
        scoring="forced-choice",
        kinds={SINGLE: "a stimulus at one finger in one of the intervals"},
        # Keys in the reverse order; the middle one of three stays.
        reversed_mapping=dict(
            zip(_NAMES[:n_intervals], reversed(_NAMES[:n_intervals]), strict=True)
        ),
        texts={
            "placement": FINGERS,
            "hands_off_before": _HANDS_OFF,
            "hands_off_after": _HANDS_OFF,
            "prompt": "In which interval did you feel the vibration?",
            "prompt_hands_off": "In which interval did you notice anything?",
        },
        instructions={
            frozenset(): (
                f"Each trial has {word} intervals, shown by their numbers. In one of them there is "
                "a short vibration under one of your fingers. Answer in which interval you felt "
                "it. If you are not sure, choose the most likely answer."
            )
        },
        decide=_detect,
    )


def two_intervals(sites: tuple[str, ...]) -> Task:
    """Return detection as a forced choice between two intervals, with a threshold of each site."""
    return _forced_choice("2ifc", sites, 2, "two")


def three_intervals(sites: tuple[str, ...]) -> Task:
    """Return detection as a forced choice between three intervals."""
    return _forced_choice("3ifc", sites, 3, "three")


def amplitude_discrimination(sites: tuple[str, ...]) -> Task:
    """Return the comparison of two bursts at one site, one of them at the reference level.

    The proportion of comparisons that are judged stronger than the reference, as a function of
    their level, gives the point of subjective equality and the difference threshold.
    """
    presentations = []
    for site, (comparison, reference) in product(sites, permutations(range(2))):
        interval = _NAMES[comparison]
        bursts = tuple(Burst((site,), is_reference=i == reference) for i in range(2))
        presentations.append(
            Presentation(
                name=f"{site}_{comparison + 1}",
                kind=SINGLE,
                bursts=bursts,
                correct=interval,
                correct_below=_NAMES[reference],
                site=site,
                meaning=f"at the {site} finger, the comparison in the {interval} interval",
            )
        )
    return Task(
        name="amplitude-discrimination",
        sites=sites,
        presentations=tuple(presentations),
        answers=_answers(2, "the {} vibration was stronger"),
        scoring="discrimination",
        kinds={SINGLE: "a reference and a comparison at one finger"},
        reversed_mapping={_NAMES[0]: _NAMES[1], _NAMES[1]: _NAMES[0]},
        texts={
            "placement": FINGERS,
            "hands_off_before": _HANDS_OFF,
            "hands_off_after": _HANDS_OFF,
            "prompt": "Which vibration was stronger?",
            "prompt_hands_off": "Which vibration was stronger?",
        },
        instructions={
            frozenset(): (
                "Each trial has two intervals, shown by their numbers, with a short vibration "
                "under the same finger in each. Answer which of the two was stronger. If you are "
                "not sure, choose the most likely answer."
            )
        },
        decide=_compare,
    )
