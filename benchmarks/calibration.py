"""Whether limits of thresholds hold: simulated people, psignifit and statsmodels beside them."""

from __future__ import annotations

import itertools
import math
import os
import sys
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import expit, ndtr

from analysis.counts.intervals import group_interval, proportion_ci
from analysis.numbers import METHODS
from analysis.thresholds.fit import BOUNDED, WITH_THRESHOLD, fit_many
from analysis.thresholds.guess import GuessRate
from analysis.thresholds.likelihood import STANDARD, Nodes, Tables, likelihoods

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.fit import PsychometricFit

    Floats = NDArray[np.float64]

STUDIES: Final = 1500
BESIDE: Final = 40
"""Tables of a scenario that psignifit fits too: it takes a sixth of a second for each."""
SIGMA: Final = 0.1
BETWEEN_DB: Final = 2.0
PAPER: Final = (60.0, 95.0, 130.0, 165.0, 200.0)
CENTRED: Final = (49.0, 57.0, 64.0, 73.0, 91.0)
_WIDE: Final = (20.0, 40.0, 60.0, 80.0, 100.0, 130.0, 160.0, 200.0)
_SIX: Final = (50.0, 65.0, 80.0, 100.0, 125.0, 160.0)
_NARROW: Final = (80.0, 89.0, 100.0, 112.0, 125.0)
_SLOPE: Final = 1 / math.sqrt(2 * math.pi)
"""Of Phi at its middle: functions of other shapes are as steep there."""
SHAPES: Final[dict[str, Callable[[Floats], Floats]]] = {
    "normal": ndtr,
    "logistic": lambda z: np.asarray(expit(4 * _SLOPE * z)),
    "Weibull": lambda z: -np.expm1(-math.log(2) * np.exp(2 * _SLOPE / math.log(2) * z)),
}


def psychometric(
    level_vpp: ArrayLike,
    *,
    threshold_vpp: ArrayLike,
    sigma: float,
    guess_rate: float,
    lapse_rate: float,
    shape: str = "normal",
) -> Floats:
    """Return gamma + (1 - gamma - lambda) Phi(log10(V / threshold) / sigma), docs/statistics.md.

    Halfway up at the threshold, whatever its shape:

    >>> known = {"threshold_vpp": 60, "sigma": 0.1, "guess_rate": 0.5, "lapse_rate": 0.0}
    >>> [round(float(psychometric(60, **known, shape=shape)), 9) for shape in SHAPES]
    [0.75, 0.75, 0.75]
    """
    z = np.log10(np.asarray(level_vpp) / np.asarray(threshold_vpp)) / sigma
    return np.asarray(guess_rate + (1.0 - guess_rate - lapse_rate) * SHAPES[shape](z))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """A simulated observer and the levels it is tested with."""

    levels_vpp: tuple[float, ...]
    threshold_vpp: float
    sigma: float = SIGMA
    guess_rate: float = 0.5
    lapse_rate: float = 0.02
    presented: int = 30
    shape: str = "normal"

    @property
    def x(self) -> Floats:
        """Levels on the axis."""
        return np.log10(self.levels_vpp)

    def counts(self, studies: int) -> Floats:
        """Draw detections, shape (studies, levels)."""
        p = psychometric(
            self.levels_vpp,
            threshold_vpp=self.threshold_vpp,
            sigma=self.sigma,
            guess_rate=self.guess_rate,
            lapse_rate=self.lapse_rate,
            shape=self.shape,
        )
        return np.random.default_rng(1).binomial(self.presented, p, (studies, len(p))).astype(float)

    def tables(self, counts: Floats) -> Tables:
        """Return counts as they are fitted."""
        return Tables(
            levels=np.broadcast_to(self.levels_vpp, counts.shape),
            detected=counts,
            presented=np.full(counts.shape, float(self.presented)),
            guesses=[GuessRate(mean=self.guess_rate)] * len(counts),
        )

    def row(self) -> str:
        """Describe it in the first cells of a row."""
        levels = f"{len(self.levels_vpp)}, {self.levels_vpp[0]:g} to {self.levels_vpp[-1]:g}"
        others = f", n {self.presented}" * (self.presented != _CELL)
        others += f", lapses {self.lapse_rate:g}" * (self.lapse_rate != _LAPSES)
        shape = "" if self.shape == "normal" else f" ({self.shape})"
        return (
            f"| {_NAMES.get(self.levels_vpp, levels)}{others} | "
            f"{self.threshold_vpp:g}, {self.sigma:g}{shape}, {self.guess_rate:g} |"
        )


SCENARIOS: Final = (
    Scenario(levels_vpp=PAPER, threshold_vpp=62),
    Scenario(levels_vpp=PAPER, threshold_vpp=62, guess_rate=0.02),
    Scenario(levels_vpp=CENTRED, threshold_vpp=62),
    Scenario(levels_vpp=CENTRED, threshold_vpp=62, guess_rate=0.02),
    Scenario(levels_vpp=PAPER, threshold_vpp=100),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, guess_rate=0.02),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, sigma=0.015, lapse_rate=0.0),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, sigma=0.5, guess_rate=0.02),
    Scenario(levels_vpp=PAPER, threshold_vpp=180),
    Scenario(levels_vpp=_NARROW, threshold_vpp=100),
    Scenario(levels_vpp=_WIDE, threshold_vpp=85, guess_rate=0.02, lapse_rate=0.0, presented=5),
    Scenario(levels_vpp=_WIDE, threshold_vpp=85, presented=5),
    Scenario(levels_vpp=_SIX, threshold_vpp=80, guess_rate=0.02, lapse_rate=0.1, presented=10),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, sigma=0.05, shape="Weibull"),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, shape="logistic"),
)
BEYOND: Final = (
    Scenario(levels_vpp=PAPER, threshold_vpp=100, shape="Weibull"),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, guess_rate=0.02, shape="Weibull"),
    Scenario(levels_vpp=PAPER, threshold_vpp=100, sigma=0.5),
    Scenario(levels_vpp=_SIX, threshold_vpp=80, lapse_rate=0.1, presented=10),
)
"""What the model does not claim: people of another shape or flatness, told beside it."""


_ALIKE: Final = tuple(SCENARIOS[i] for i in (8, 9, 10))
"""What the page does not show: it is like its neighbours."""


def ours(scenario: Scenario, counts: Floats, nodes: Nodes = STANDARD) -> Floats:
    """Return limits and median of each threshold on the axis, shape (studies, 3)."""
    tables = scenario.tables(counts)
    points = [likelihood.mu_points for likelihood in likelihoods(tables, nodes)]
    return np.array(points) * tables.prior.step


def theirs(scenario: Scenario, counts: Floats, steps: int | None = None) -> Floats:
    """Return psignifit's lower limit, mean and upper limit of the threshold."""
    from psignifit import psignifit

    fixed = {"gamma": scenario.guess_rate, "eta": 1e-8}
    fine = {"grid_steps": {"threshold": steps, "width": steps, "lambda": 20}} if steps else {}
    data = np.column_stack([scenario.x, counts, np.full(len(counts), scenario.presented)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of data that do not determine a parameter
        found = psignifit(
            data, experiment_type="yes/no", sigmoid="norm", fixed_parameters=fixed, **fine
        )
    low, high = found.confidence_intervals["threshold"]["0.95"]
    return np.array([low, found.get_parameter_estimate("mean")["threshold"], high])


def by_statsmodels(scenario: Scenario, counts: Floats) -> Floats:
    """Return statsmodels' probit threshold and its limits by the delta method, NaN for none."""
    from statsmodels.api import GLM, families

    x, n = scenario.x, np.full(len(counts), scenario.presented)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of tables without a likeliest function
        try:
            fit = GLM(
                np.column_stack([counts, n - counts]),
                np.column_stack([np.ones(len(x)), x - x.mean()]),
                family=families.Binomial(families.links.Probit()),
            ).fit()
        except (ValueError, np.linalg.LinAlgError):
            return np.full(3, np.nan)
    middle = -fit.params[0] / fit.params[1]
    slope = np.array([1.0, middle]) / fit.params[1]
    half = 1.96 * math.sqrt(max(float(slope @ fit.cov_params() @ slope), 0.0))
    return np.asarray(x.mean() + np.array([middle - half, middle, middle + half]))


def _beside(scenario: Scenario, counts: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield what other programs find of the same tables, on two processes of one thread each."""
    from joblib import Parallel, delayed

    jobs = Parallel(n_jobs=min(2, os.cpu_count() or 1))
    yield "psignifit", np.array(jobs(delayed(theirs)(scenario, k) for k in counts))
    if scenario.guess_rate < SIGMA:  # its model has neither guesses nor lapses
        yield "statsmodels", np.array([by_statsmodels(scenario, k) for k in counts])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Score:
    """How estimates of one truth went."""

    db: Floats
    inside: NDArray[np.bool_]

    @classmethod
    def of(cls, found: Floats, scenario: Scenario) -> _Score:
        truth = math.log10(scenario.threshold_vpp)
        inside = (found[:, 0] <= truth) & (truth <= found[:, 2])
        return cls(db=20 * (found[:, 1] - truth), inside=inside)

    @property
    def rmse(self) -> str:
        """Root mean square error, as it is printed."""
        rmse = math.sqrt(float(np.square(self.db).mean())) if len(self.db) else math.nan
        return f"{rmse:.3g}" if rmse < 100 else "> 100"

    def brief(self) -> str:
        return f"{self.rmse}, {self.inside.mean():.1%}"


def threshold_rows() -> Iterator[str]:
    """Yield a row of each scenario, then the means over `SCENARIOS`."""
    every, told = [], []
    for scenario in (*SCENARIOS, *BEYOND):
        counts = scenario.counts(STUDIES)
        fits = _fits(scenario, counts)
        given = np.array([fit.status in WITH_THRESHOLD for fit in fits])
        require_within(fits, scenario)
        found = ours(scenario, counts)
        score, chosen = _Score.of(found, scenario), _Score.of(found[given], scenario)
        first: list[str] = []
        if scenario in SCENARIOS:
            every.append(score.db)
            told.append(chosen.db)
            if BESIDE:
                few = (("ours", found[:BESIDE]), *_beside(scenario, counts[:BESIDE]))
                first = [_Score.of(one, scenario).brief() for _, one in few]
        number = "all" if given.all() else f"{given.sum()}: {chosen.brief()}"
        if scenario not in _ALIKE:
            yield (
                f"{scenario.row()} {np.median(score.db):+.2f}, {score.brief()} | "
                f"{number} | {'; '.join(first)} |"
            ).replace("  ", " ")
    of_all, of_told = (
        f"{math.sqrt(float(np.mean([np.square(one).mean() for one in errors]))):.2f}"
        for errors in (every, told)
    )
    yield ""
    alike = sum(scenario in _ALIKE for scenario in SCENARIOS)
    unseen = ", and three like them not shown," * (alike == len(_ALIKE))
    yield (
        f"The first {len(every) - alike}{unseen} together have an RMSE of {of_all} dB of all and "
        f"{of_told} dB of what is printed. {_LAST}"
    )


def _fits(scenario: Scenario, counts: Floats) -> tuple[PsychometricFit, ...]:
    return fit_many(scenario.tables(counts))


def require_within(fits: tuple[PsychometricFit, ...], scenario: Scenario) -> None:
    """Stop where a number that is told lies outside the levels."""
    low, high = scenario.levels_vpp[0] * (1 - 1e-12), scenario.levels_vpp[-1] * (1 + 1e-12)
    told = np.array([(fit.threshold, *fit.threshold_limits) for fit in fits]).ravel()
    told = told[np.isfinite(told)]
    if ((told < low) | (told > high)).any():
        raise ValueError(f"thresholds must lie within the levels; got {told.min()}, {told.max()}")


def below_words() -> Iterator[str]:
    """Yield how often "< 60 V" is said of people who are not there, least and most."""
    for threshold in (60, 62, 66, 72):
        shares = []
        for guess_rate, sigma in itertools.product((0.5, 0.02), (0.05, 0.1, 0.2)):
            scenario = Scenario(
                levels_vpp=PAPER, threshold_vpp=threshold, sigma=sigma, guess_rate=guess_rate
            )
            fits = _fits(scenario, scenario.counts(STUDIES))
            shares.append(
                np.mean(
                    [
                        fit.status in BOUNDED and fit.threshold_limits[1] <= PAPER[0] * (1 + 1e-9)
                        for fit in fits
                    ]
                )
            )
        yield f"{100 * min(shares):.2f} to {100 * max(shares):.2f} % at {threshold} V"


def interval_rows(rng: np.random.Generator) -> Iterator[str]:
    """Yield the coverage of each interval of one cell."""
    truths = (0.5, 0.8, 0.95)
    counts = [rng.binomial(_CELL, truth, STUDIES) for truth in truths]
    for method in METHODS:
        cells = []
        for truth, k in zip(truths, counts, strict=True):
            low, high = proportion_ci(k, _CELL, method)
            cells.append(share((low <= truth) & (truth <= high)))
        yield f"| {method} | {' | '.join(cells)} |"


def group_rows(rng: np.random.Generator) -> Iterator[str]:
    """Yield the coverage of a group's interval at three levels, then of the pooled binomial."""
    n = _CELL
    people = (
        ("five", 5, 0.0, SIGMA),
        ("five steep", 5, 0.0, SIGMA / 5),
        ("five, forced choice", 5, 0.5, SIGMA),
        ("twelve", 12, 0.0, SIGMA),
    )
    levels, pooled_part = (60.0, 95.0, 165.0), dict[float, list[float]]()
    for name, number, guess_rate, sigma in people:
        cells = dict.fromkeys(levels, "")
        for between_db, level in itertools.product((2.0, 4.0, 6.0), levels):
            offsets = between_db / 20 * rng.standard_normal((STUDIES, number))
            felt = ndtr((math.log10(level / 70) + offsets) / sigma)
            truth = float(ndtr(math.log10(level / 70) / math.hypot(sigma, between_db / 20)))
            truth = guess_rate + (1 - guess_rate) * truth
            k = rng.binomial(n, guess_rate + (1 - guess_rate) * felt)
            group = np.array([group_interval(one, [n] * number) for one in k])
            pooled = np.stack(proportion_ci(k.sum(axis=1), number * n), axis=1)
            group_in, pooled_in = (
                (one[:, 0] <= truth) & (truth <= one[:, 1]) for one in (group, pooled)
            )
            told = f"{truth:.2f}: {100 * group_in.mean():.1f}"
            cells[level] = f"{cells[level]}, {told}".removeprefix(", ")
            pooled_part.setdefault(level, []).append(100 * float(pooled_in.mean()))
        yield f"| {name} | {' | '.join(cells.values())} |"
    covers = ", ".join(
        f"{min(some):.1f} to {max(some):.1f} % at {level:g} V"
        for level, some in pooled_part.items()
    )
    yield ""
    yield (
        "A [pooled](../explanation/intervals.md#trials-are-not-people) binomial interval covers "
        f"{covers}."
    )


def share(inside: NDArray[np.bool_]) -> str:
    """Return a share."""
    return f"{inside.mean():.1%}"


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    rng = np.random.default_rng(2)
    return "\n".join(
        [
            "## Calibration",
            "",
            _INTERVALS,
            "",
            "| one cell, true probability | 0.5 | 0.8 | 0.95 |",
            "|---|---|---|---|",
            *interval_rows(rng),
            "",
            "| group of | at 60 V | at 95 V | at 165 V |",
            "|---|---|---|---|",
            *group_rows(rng),
            "",
            _THRESHOLDS,
            "",
            _HEADER,
            f"|{'---|' * 5}",
            *threshold_rows(),
            "",
            f"{_BELOW}{', '.join(below_words())}.",
            "",
        ]
    )


_CELL: Final = 30
"""Stimuli of a person at a level."""
_LAPSES: Final = 0.02
"""Those of an observer, unless others are told."""
_INTERVALS: Final = (
    f"Coverage by {STUDIES} seeded studies (standard error 0.3 % at 98.7 %, 0.6 % at 95 %, 0.9 % "
    f"at 86 %), {_CELL} stimuli a cell. Of groups, with 70 V in the middle and sigma {SIGMA:g} (of "
    "steep people a fifth of it), a cell has the true mean and the coverage in %, where "
    "thresholds vary by 2, 4 and 6 dB between people."
)
_THRESHOLDS: Final = (
    f"Thresholds of one observer with a normal function, lapses {_LAPSES:g} and {_CELL} stimuli at "
    "each level unless told; centred levels are 49 to 91 V. All: median error and RMSE of the "
    "posterior median in dB, and coverage. Printed: how many tables print a number, their RMSE and "
    "coverage. Of the first 40 tables: RMSE and coverage of ours, psignifit (posterior mean, three "
    "free parameters, its default grid) and statsmodels (the likeliest probit line, limits by the "
    "delta method)."
)
_LAST: Final = (
    "The last four are people of another function where it is wide (the half point of a Weibull "
    "function of sigma 0.1 lies a third of a decibel off that of the nearest normal one), and "
    "answers at chance at most levels. All are a choice of 29, the first 23 of which had RMSEs of "
    "1.03 and 0.95 dB; the seven with such Weibull people are covered in 85.5 to 93.6 %."
)
_HEADER: Final = (
    "| levels, V | truth in V, sigma, gamma | all | printed "
    "| first 40: ours; psignifit; statsmodels |"
)
_NAMES: Final[dict[tuple[float, ...], str]] = {PAPER: "paper's", CENTRED: "centred"}
_BELOW: Final = (
    "False bounds (at 60 V only just false): at the paper's levels, over two guess rates (0.5, "
    f"0.02) and three widths (0.05, 0.1, 0.2), {STUDIES} sessions each, `< 60 V` is told in "
)


def main(studies: int) -> None:
    """Print the share of studies whose 95 % intervals hold the truth, of all kinds of intervals."""
    from benchmarks.groups import coverage_rows

    for scenario in (*SCENARIOS, *BEYOND):
        found = ours(scenario, scenario.counts(studies))
        score = _Score.of(found, scenario)
        print(f"person {scenario.row()} {share(score.inside)}", flush=True)
    for row in coverage_rows(studies):
        print(row, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else STUDIES)
