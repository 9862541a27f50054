"""Detection by yes and no: a stimulus at one finger, or none."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from experiment.tasks.task import BLANK, FINGERS, SINGLE, Answer, Burst, Presentation, Task

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiment.tasks.task import Floats, Guessing, Sensation

_YES, _NO, _NONE = "yes", "no", "none"
_HANDS_OFF: Final = (
    "Take your hands off the plate. If you notice a vibration, press {yes}; if not, press {no}."
)


def _decide(
    intervals: Sequence[Sensation], responses: tuple[str, ...], guessing: Guessing
) -> dict[str, Floats]:
    """Return the probability of yes: something was detected, or it is a false alarm."""
    missed = np.prod([1 - detected for detected in intervals[0].detected], axis=0)
    yes = 1 - missed * (1 - guessing.false_alarm)
    return {name: p for name, p in ((_YES, yes), (_NO, 1 - yes)) if name in responses}


def yes_no(sites: tuple[str, ...]) -> Task:
    """Return the task for these sites: a stimulus at one of them, or a blank trial.

    Thresholds are estimated for each site, the guess rate from the blank trials.
    """
    return Task(
        name="yes-no",
        sites=sites,
        presentations=(
            *(
                Presentation(
                    name=site,
                    kind=SINGLE,
                    bursts=(Burst((site,)),),
                    correct=_YES,
                    site=site,
                    meaning=f"at the {site} finger",
                )
                for site in sites
            ),
            Presentation(
                name=_NONE, kind=BLANK, bursts=(Burst(),), correct=_NO, meaning="no stimulus"
            ),
        ),
        answers=(
            Answer(
                name=_YES, keys=("y", "left"), meaning="something was felt", sign="\N{CHECK MARK}"
            ),
            Answer(name=_NO, keys=("n", "right"), meaning="nothing was felt", sign="\N{BALLOT X}"),
        ),
        scoring="yes-no",
        nothing=_NO,
        kinds={SINGLE: "a stimulus at one finger", BLANK: "no stimulus"},
        reversed_mapping={_YES: _NO, _NO: _YES},
        texts={
            "placement": FINGERS,
            "hands_off_before": _HANDS_OFF,
            "hands_off_after": _HANDS_OFF,
            "prompt": "Did you feel a vibration?",
            "prompt_hands_off": "Did you notice anything?",
        },
        instructions={
            frozenset(): (
                "In some trials you will feel a short vibration under one of your fingers, in "
                "others there is none. If you felt a vibration, press {yes}; if not, press {no}."
            )
        },
        decide=_decide,
    )
