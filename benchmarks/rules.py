"""The Bayesian rule of levels beside other programs' handlers, on the yes/no task that all know.

The same simulated participants answer all in the same run, as many trials in all: this program's
rule has a blank trial after every fourth stimulus; the others have stimuli only, for they have no
blank trials. QUEST+ chooses among the same levels, PsychoPy's handlers any level between them.
Estimates are compared with the true threshold. Needs the extras `crosscheck` and `screen`.
"""

from __future__ import annotations

import time
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from experiment.levels import Bayesian
from experiment.tasks import make_task

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

LEVELS_VPP: Final = tuple(np.geomspace(30.0, 300.0, 15).tolist())
SIGMAS, LAPSES, FALSE_ALARMS = (0.03, 0.05, 0.09, 0.15, 0.25), (0.0, 0.03, 0.08), (0.02, 0.08, 0.2)
CHECKPOINTS: Final = (30, 60, 120)
"""Trials in all after which the estimates are compared."""
PEOPLE: Final = 1000


class Person(NamedTuple):
    """A simulated participant of a yes/no task."""

    threshold_vpp: float
    sigma: float
    lapse: float
    false_alarm: float

    def says_yes(self, level_vpp: float, rng: np.random.Generator) -> bool:
        """Draw an answer; 0 V is a blank trial."""
        p = 0.0
        if level_vpp:
            middle = np.log10(self.threshold_vpp)
            p = NormalDist(middle, self.sigma).cdf(float(np.log10(level_vpp)))
        p += (1 - p) * self.false_alarm
        return bool(rng.random() < self.lapse / 2 + (1 - self.lapse) * p)


def _people() -> Iterator[Person]:
    rng = np.random.default_rng(4)
    for _ in range(PEOPLE):
        threshold_vpp = float(np.exp(rng.uniform(np.log(50.0), np.log(180.0))))
        yield Person(threshold_vpp, *rng.uniform((0.03, 0.0, 0.0), (0.25, 0.06, 0.2)))


def _bayesian(person: Person, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield the time of a choice in seconds, and the error in dB, after each trial."""
    task = make_task("yes-no")
    single, blank = task.presentations[0], task.presentations[-1]
    track = Bayesian(candidates_vpp=LEVELS_VPP, seed=1).start(task.answer_names, task)
    for trial in range(1, max(CHECKPOINTS) + 1):
        begun_s = time.perf_counter()
        level_vpp = 0.0 if trial % 5 == 0 else track.choose(trial, 1).level_vpp
        answer = "yes" if person.says_yes(level_vpp, rng) else "no"
        track.update(single if level_vpp else blank, level_vpp or None, answer)
        taken_s = time.perf_counter() - begun_s
        estimate = track.estimate()
        assert estimate is not None
        yield taken_s, float(20 * np.log10(estimate.threshold_vpp / person.threshold_vpp))


def _questplus(person: Person, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield the same of QUEST+ (A. B. Watson, J. Vis. 17(3):10, 2017), with the same grid."""
    import questplus

    levels = np.log10(LEVELS_VPP)
    quest: Any = questplus.QuestPlus(
        stim_domain={"intensity": levels},
        param_domain={
            "mean": np.linspace(levels[0] - 0.15, levels[-1] + 0.15, 61),
            "sd": np.array(SIGMAS),
            "lower_asymptote": np.array(FALSE_ALARMS),
            "lapse_rate": np.array(LAPSES),
        },
        outcome_domain={"response": ["Yes", "No"]},
        func="norm_cdf",
        stim_scale="linear",
        stim_selection_method="min_entropy",
        param_estimation_method="mean",
    )
    for _ in range(max(CHECKPOINTS)):
        begun_s = time.perf_counter()
        level = float(quest.next_stim["intensity"])
        answer = "Yes" if person.says_yes(10**level, rng) else "No"
        quest.update(stim={"intensity": level}, outcome={"response": answer})
        taken_s = time.perf_counter() - begun_s
        error = quest.param_estimate["mean"] - np.log10(person.threshold_vpp)
        yield taken_s, float(20 * error)


def _psychopy_quest(person: Person, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield the same of PsychoPy's QUEST, whose slope, lapse and guess rate are fixed.

    They are those of the middle of the population; a Weibull function of slope 5.6 is about as wide
    as a normal one of sigma 0.1.
    """
    from psychopy.data.staircase import QuestHandler

    low, high = np.log10([LEVELS_VPP[0], LEVELS_VPP[-1]])
    settings: dict[str, Any] = {"pThreshold": 0.54, "beta": 5.6, "delta": 0.03, "gamma": 0.08}
    quest: Any = QuestHandler(
        (low + high) / 2, 0.5, nTrials=max(CHECKPOINTS), minVal=low, maxVal=high, **settings
    )
    yield from _handled(quest, quest.mean, person, rng)


def _psychopy_staircase(person: Person, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield the same of PsychoPy's staircase, one up and one down in steps of 4, 2 and 1 dB.

    Its estimate is the mean of the reversals, as its users compute it, or the level before one.
    """
    from psychopy.data.staircase import StairHandler

    low, high = np.log10([LEVELS_VPP[0], LEVELS_VPP[-1]])
    stairs: Any = StairHandler(
        high,
        nTrials=max(CHECKPOINTS),
        nReversals=3,
        stepSizes=[0.2, 0.1, 0.05],
        stepType="lin",
        nUp=1,
        nDown=1,
        minVal=low,
        maxVal=high,
    )

    def estimate() -> float:
        reversals = stairs.reversalIntensities[2:]
        return float(np.mean(reversals)) if reversals else float(stairs.intensities[-1])

    yield from _handled(stairs, estimate, person, rng)


def _handled(
    handler: Any, estimate: Callable[[], float], person: Person, rng: np.random.Generator
) -> Iterator[tuple[float, float]]:
    """Yield the time of a choice and the error after each trial of a handler of PsychoPy."""
    for _ in range(max(CHECKPOINTS)):
        begun_s = time.perf_counter()
        level = float(next(handler))
        handler.addResponse(int(person.says_yes(10**level, rng)))
        taken_s = time.perf_counter() - begun_s
        yield taken_s, float(20 * (estimate() - np.log10(person.threshold_vpp)))


def section() -> str:
    """Measure both rules, and write the section of the page."""
    lines = [
        "## Levels by a rule\n",
        (
            f"Yes/no task, {PEOPLE} simulated participants: thresholds from 50 to 180 Vpp, sigma "
            ".03 to .25, lapses to 6 %, false alarms to 20 %; 15 levels. Error of the threshold in "
            "dB: rms, and bias in parentheses. The Bayesian rule spends every fifth trial on a "
            "blank.\n"
        ),
        "| rule | " + " | ".join(f"{n} trials" for n in CHECKPOINTS) + " | one choice (ms) |",
        "|---|" + "---|" * (len(CHECKPOINTS) + 1),
    ]
    rules: dict[str, Callable[[Person, np.random.Generator], Iterator[tuple[float, float]]]] = {
        "`bayesian`": _bayesian,
        "QUEST+ (questplus)": _questplus,
        "QUEST (PsychoPy)": _psychopy_quest,
        "staircase (PsychoPy)": _psychopy_staircase,
    }
    for name, rule in rules.items():
        runs = np.array(
            [[*rule(person, np.random.default_rng((9, i)))] for i, person in enumerate(_people())]
        )
        errors_db = runs[:, [n - 1 for n in CHECKPOINTS], 1]
        rms_db, bias_db = np.sqrt((errors_db**2).mean(axis=0)), errors_db.mean(axis=0)
        cells = [f"{rms:.2f} ({bias:+.2f})" for rms, bias in zip(rms_db, bias_db, strict=True)]
        median_ms = 1e3 * np.median(runs[..., 0])
        lines.append(f"| {name} | {' | '.join(cells)} | {median_ms:.1f} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(section())
