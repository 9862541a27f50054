"""Simulated people who are not as simple: their counts, and which of them an analysis names."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from scipy.special import ndtr

from analysis.axis import VOLTS
from analysis.codes import WarningCode
from analysis.counts.checks import check_answers, check_drift
from analysis.counts.table import count_answers, count_false_alarms, count_levels
from experiment.perception.answers import draw_answers
from experiment.perception.gains import without_crosstalk
from experiment.perception.population import draw_observer, threshold_course_db
from experiment.study.simulation import Simulation

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from experiment.perception.observer import Observer

    Floats = NDArray[np.float64]


def overdispersed_counts(
    rng: np.random.Generator, p: ArrayLike, presented: int, factor: float
) -> Floats:
    """Draw detections with the mean of a binomial and `factor` times its variance.

    Beta-binomial: each cell has a probability of its own, Beta distributed about p with the
    correlation (factor - 1) / (presented - 1) between answers.

    >>> rng = np.random.default_rng(1)
    >>> k = overdispersed_counts(rng, np.full(100_000, 0.3), 30, 2.0)
    >>> round(float(k.mean()) / 30, 2), round(float(k.var()) / (30 * 0.3 * 0.7), 1)
    (0.3, 2.0)
    """
    p = np.asarray(p, dtype=float)
    if factor == 1:
        return np.asarray(rng.binomial(presented, p), dtype=float)
    rho = (factor - 1) / (presented - 1)
    inside = np.clip(p, 1e-12, 1 - 1e-12)
    own = rng.beta(inside * (1 - rho) / rho, (1 - inside) * (1 - rho) / rho)
    return np.asarray(rng.binomial(presented, own), dtype=float)


def wander(rng: np.random.Generator, shape: tuple[int, int], trials_to_fade: float) -> Floats:
    """Draw a stationary autoregressive course over trials for each person, variance 1.

    It is correlated with itself by exp(-lag / trials_to_fade); shape (people, trials).

    >>> w = wander(np.random.default_rng(1), (2000, 50), 20.0)
    >>> round(float(np.mean(w[:, 20:] * w[:, :-20])), 1), round(float(w.var()), 1)
    (0.4, 1.0)
    """
    kept = math.exp(-1 / trials_to_fade)
    steps = rng.standard_normal(shape)
    steps[:, 1:] *= math.sqrt(1 - kept**2)
    return np.asarray(lfilter([1.0], [1.0, -kept], steps, axis=1))


def wandering_counts(
    rng: np.random.Generator,
    x: ArrayLike,
    presented: int,
    *,
    mu: ArrayLike,
    sigma: ArrayLike,
    guess_rate: float,
    lapse_rate: float,
    wander_db: float,
    trials_to_fade: float,
    drift_db: float = 0.0,
) -> Floats:
    """Draw detections of people whose thresholds wander or drift within a session.

    Parameters
    ----------
    rng : numpy.random.Generator
        Where chance comes from.
    x : array_like, shape (levels,)
        log10 of the levels.
    presented : int
        Stimuli at each level, in random order.
    mu, sigma : array_like, shape (people,) or ()
        Of each person's psychometric function, log10 units.
    guess_rate, lapse_rate : float
        Of everybody.
    wander_db, trials_to_fade : float
        Standard deviation of a threshold about its own mean, and over how many trials it is
        forgotten.
    drift_db : float
        Rise from the first trial to the last, half of it on either side of mu.

    Returns
    -------
    ndarray of float64, shape (people, levels)
    """
    x = np.asarray(x, dtype=float)
    mu, sigma = np.broadcast_arrays(np.atleast_1d(mu), np.atleast_1d(sigma))
    people, trials = len(mu), len(x) * presented
    order = rng.permuted(np.tile(np.repeat(np.arange(len(x)), presented), (people, 1)), axis=1)
    shift_db = wander_db * wander(rng, (people, trials), trials_to_fade)
    shift_db += drift_db * np.linspace(-0.5, 0.5, trials)
    z = (x[order] - mu[:, None] - shift_db / 20) / sigma[:, None]
    detected = rng.random(z.shape) < guess_rate + (1 - guess_rate - lapse_rate) * ndtr(z)
    return np.stack([(detected & (order == level)).sum(axis=1) for level in range(len(x))], 1) + 0.0


SESSIONS: Final = 1000
PAPER: Final = (60.0, 95.0, 130.0, 165.0, 200.0)
CENTRED: Final = (49.0, 57.0, 64.0, 73.0, 91.0)
FORCED: Final = ("left", "right", "both")
WITH_NONE: Final = (*FORCED, "none")


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionDesign:
    """What a person is shown in one session, in random order."""

    name: str
    levels_vpp: tuple[float, ...]
    per_side: int  # stimuli of each level
    blanks: int
    responses: tuple[str, ...]


DESIGNS: Final = (
    SessionDesign(
        name="the paper's, 150", levels_vpp=PAPER, per_side=15, blanks=0, responses=FORCED
    ),
    SessionDesign(
        name="centred levels, 150", levels_vpp=CENTRED, per_side=15, blanks=0, responses=FORCED
    ),
    SessionDesign(
        name='"none", 150 and 60 blanks',
        levels_vpp=PAPER,
        per_side=15,
        blanks=60,
        responses=WITH_NONE,
    ),
    SessionDesign(
        name='"none", centred, 150 and 60 blanks',
        levels_vpp=CENTRED,
        per_side=15,
        blanks=60,
        responses=WITH_NONE,
    ),
    SessionDesign(
        name='pilot, "none", 40 and 12 blanks',
        levels_vpp=(20.0, 40.0, 80.0, 160.0),
        per_side=5,
        blanks=12,
        responses=WITH_NONE,
    ),
)

HONEST: Final = Simulation(threshold_vpp=62.0).median
PEOPLE: Final = {
    "honest": HONEST,
    "honest, wandering": replace(
        HONEST, wander_db=1.4, wander_trials=11.0, last_answer_db=0.35, masking_slope=0.2
    ),
    "sides swapped": replace(HONEST, reversed_mapping=True),
    "drift of 4 dB": replace(HONEST, drift_db=4.0),
    "drift of 8 dB": replace(HONEST, drift_db=8.0),
    "feels nothing": replace(HONEST, threshold_vpp=1e5),
}
CODES: Final = (
    WarningCode.RESPONSES_REVERSED,
    WarningCode.GUESSING,
    WarningCode.THRESHOLD_DRIFTS,
)


def sessions_of(
    person: Observer, design: SessionDesign, sessions: int, *, seed: int = 1
) -> pd.DataFrame:
    """Return the trials of many people, one session each, without an engine."""
    rows: list[tuple[object, ...]] = []
    stimuli = [(level, side) for level in design.levels_vpp for side in ("left", "right")]
    every = [*(stimuli * design.per_side), *[(0.0, "none")] * design.blanks]
    for number in range(sessions):
        rng = np.random.default_rng((seed, number))
        someone = draw_observer(person, 1.5, rng, finger_difference_sd_db=1.0)
        course_db = threshold_course_db(someone, [1] * len(every), rng)
        last_db = 0.0
        for trial, i in enumerate(rng.permutation(len(every))):
            level_vpp, side = every[i]
            now_db = course_db[trial] + last_db
            answer, _ = draw_answers(
                [someone],
                [(level_vpp * (side == "left"), level_vpp * (side == "right"))],
                design.responses,
                60.0,
                rng,
                gains=without_crosstalk(2),
                shift_db=(now_db, now_db),
            )
            response = (*design.responses, None)[answer.item()]
            if "none" in design.responses:
                half_db = someone.last_answer_db / 2
                last_db = half_db if response == "none" else -half_db
            rows.append((f"{number:04d}", trial, level_vpp or math.nan, side, response))
    table = pd.DataFrame(rows, columns=["participant", "trial", "level_vpp", "side", "response"])
    return table.assign(
        condition="main",
        session="01",
        kind=np.where(table["side"] == "none", "blank", "single"),
        reason="",
        none_offered="none" in design.responses,
    )


def doubt_rows() -> Iterator[str]:
    """Yield for each design how many of each kind of people are named, as what."""
    for design in DESIGNS:
        cells = []
        for person in PEOPLE.values():
            trials = sessions_of(person, design, SESSIONS)
            counts = count_answers(trials)
            by_side, blanks = count_levels(counts, "side"), count_false_alarms(counts)
            failed = [*check_answers(by_side, blanks), *check_drift(trials, VOLTS)]
            codes = [check.code for check in failed]
            cells.append(", ".join(str(codes.count(code)) for code in CODES))
        yield f"| {design.name} | {' | '.join(cells)} |"


_WORDS: Final = (
    f"How many of {SESSIONS} simulated people (62 V, 1.5 dB between people, fingers 1 dB apart, "
    "sigma 0.1, lapses 0.03, false alarms 0.05) are [warned "
    "of](../statistics.md#12-warnings-about-participants) as swapped, at chance and drifting, a "
    "session each.\n"
)


def section() -> str:
    """Return the section of the page."""
    return "\n".join(
        [
            "## Who is named\n",
            _WORDS,
            f"| session | {' | '.join(PEOPLE)} |",
            "|" + "---|" * (1 + len(PEOPLE)),
            *doubt_rows(),
            "",
        ]
    )
