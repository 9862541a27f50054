"""Whether limits of groups and of differences hold, statsmodels beside them."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from analysis.thresholds.band import drawn_functions
from analysis.thresholds.difference import paired_difference
from analysis.thresholds.function import Prior
from analysis.thresholds.group import MIDDLE, NOT_RISING, group_fit, posterior_of
from analysis.thresholds.guess import GuessRate
from analysis.thresholds.likelihood import Tables
from benchmarks.calibration import CENTRED, PAPER

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


STUDIES: Final = 1000
TRUTH_DB: Final = 20 * math.log10(62)
LEVELS: Final = (PAPER, CENTRED)
PEOPLE: Final = (3, 5, 12)
N: Final = 30
_AT_ONCE: Final = 25
_PRIOR_DB: Final = 6.0
"""Of the half-normal spread between people, where it is drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class People:
    """How simulated people are alike, and how not."""

    number: int
    levels_vpp: tuple[float, ...]
    between_db: float | None = 2.0  # None: drawn for each study from its prior
    dispersion: int = 1
    guess_rate: float = 0.5
    lapse_rate: float = 0.02

    def generator(self) -> np.random.Generator:
        """Return a generator for this setting."""
        return np.random.default_rng(
            [self.number, int(10 * (self.between_db or 0)), self.dispersion]
        )

    def offsets_db(self, rng: np.random.Generator, studies: int) -> Floats:
        """Draw how far people lie from the middle, shape (studies, people)."""
        between = (
            np.abs(_PRIOR_DB * rng.standard_normal((studies, 1)))
            if self.between_db is None
            else self.between_db
        )
        return between * rng.standard_normal((studies, self.number))

    def middles_db(self, rng: np.random.Generator, studies: int) -> Floats:
        """Return the middle of each study, (studies, 1): drawn between the levels, or 62 V."""
        if self.between_db is not None:
            return np.full((studies, 1), TRUTH_DB)
        low, high = 20 * np.log10([self.levels_vpp[0], self.levels_vpp[-1]])
        # Uniform between the levels, exponential outside, 3 dB: the prior of M.
        at = rng.uniform(low - 3.0, high + 3.0, (studies, 1))
        tail = rng.exponential(3.0, at.shape)
        return np.where(at < low, low - tail, np.where(at > high, high + tail, at))

    def answers(self, rng: np.random.Generator, at_db: Floats) -> Floats:
        """Draw counts, which vary `dispersion` times as much as the binomial."""
        x = 20 * np.log10(self.levels_vpp)
        sigma = 2.0 * np.exp(0.3 * rng.standard_normal(at_db.shape))
        felt = ndtr((x - at_db[..., None]) / sigma[..., None])
        p = self.guess_rate + (1 - self.guess_rate - self.lapse_rate) * felt
        if self.dispersion > 1:
            size = (N - self.dispersion) / (self.dispersion - 1)
            p = rng.beta(np.maximum(p * size, 1e-6), np.maximum((1 - p) * size, 1e-6))
        return np.asarray(rng.binomial(N, p), dtype=np.float64)

    def tables(self, counts: Floats) -> Tables:
        """Return counts, (people, levels), as they are fitted."""
        return Tables(
            levels=np.broadcast_to(self.levels_vpp, counts.shape),
            detected=counts,
            presented=np.full(counts.shape, float(N)),
            guesses=[GuessRate(mean=self.guess_rate)] * len(counts),
        )

    def studies(self, counts: Floats) -> Iterator[Tables]:
        """Yield the tables of each study's people, of counts (studies, people, levels)."""
        flat = counts.reshape(-1, len(self.levels_vpp))
        for first in range(0, len(flat), _AT_ONCE * self.number):
            tables = self.tables(flat[first : first + _AT_ONCE * self.number])
            for i in range(0, len(tables), self.number):
                yield tables.at(range(i, i + self.number))

    def prior(self) -> Prior:
        """Return the prior that goes with the levels."""
        return Prior.of(np.log10(self.levels_vpp))

    def population_p(self, x_db: Floats, middle_db: Floats) -> Floats:
        """Return the mean function over people at places, (studies, places); sigma varies too."""
        at, weight = np.polynomial.hermite_e.hermegauss(21)
        width = np.hypot(2.0 * np.exp(0.3 * at), self.between_db or 0.0)
        felt = ndtr((x_db - middle_db[:, None])[..., None] / width) @ (weight / weight.sum())
        return np.asarray(self.guess_rate + (1 - self.guess_rate - self.lapse_rate) * felt)


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Limits of many studies and their truth, dB."""

    low: Floats
    middle: Floats
    high: Floats

    def cells(self) -> tuple[str, str, str, str]:
        """Tell coverage in %, median width, bias and RMSE of the middle."""
        error = self.middle[np.isfinite(self.middle)]
        if not len(error):
            error = np.full(1, math.nan)
        rmse = math.sqrt(float(np.square(error).mean()))
        width = np.median(self.high - self.low)
        inside = (self.low <= 0) & (self.high >= 0)
        return f"{100 * inside.mean():.1f}", f"{width:.1f}", f"{error.mean():+.2f}", f"{rmse:.2f}"


def group_score(people: People, studies: int) -> tuple[Score, float]:
    """Return how the group's threshold did, and of how many studies limits are printed."""
    rng = people.generator()
    truth_db = people.middles_db(rng, studies)
    counts = people.answers(rng, truth_db + people.offsets_db(rng, studies))
    found, given = [], 0
    for tables in people.studies(counts):
        fit = group_fit(tables)
        # Only where nobody's table rises a group has no limits.
        given += fit.status not in NOT_RISING
        found.append(posterior_of(tables).points(MIDDLE))
    low_db, middle_db, high_db = (np.array(found) - truth_db).T
    return Score(low=low_db, middle=middle_db, high=high_db), given / studies


def coverage_rows(studies: int) -> Iterator[str]:
    """Yield how often intervals hold the truth: M, the next person, the band, differences."""
    for between_db, levels, number in itertools.product((1.0, 2.0, 4.0, 6.0), LEVELS, PEOPLE):
        people = People(number=number, levels_vpp=levels, between_db=between_db)
        rng = people.generator()
        truth_db = people.middles_db(rng, studies)
        counts = people.answers(rng, truth_db + people.offsets_db(rng, studies))
        next_db = truth_db[:, 0] + between_db * rng.standard_normal(studies)
        x = np.log10(levels)
        truth_p = people.population_p(20 * x, truth_db[:, 0])
        inside = np.zeros(3)
        for i, tables in enumerate(people.studies(counts)):
            posterior = posterior_of(tables)
            limits = posterior.points(MIDDLE)[[0, 2]], posterior.next_person_points()[[0, 2]]
            low, high = drawn_functions(tables).band(x)
            inside += [
                limits[0][0] <= truth_db[i, 0] <= limits[0][1],
                limits[1][0] <= next_db[i] <= limits[1][1],
                ((low <= truth_p[i]) & (truth_p[i] <= high)).mean(),
            ]
        name = "paper's" if levels == PAPER else "centred"
        middle, following, band = inside / studies
        yield (
            f"group | {name}, {number} people, {between_db:g} dB | threshold {middle:.1%}, "
            f"next person {following:.1%}, band {band:.1%}"
        )
    for shift_db, varying_db in ((0.0, 0.5), (2.0, 1.0), (2.0, 3.0)):
        for levels, number in itertools.product(LEVELS, PEOPLE):
            people = People(number=number, levels_vpp=levels)
            score = difference_score(
                people, shift_db=shift_db, varying_db=varying_db, studies=studies
            )
            name = "paper's" if levels == PAPER else "centred"
            cover = score.cells()[0]
            yield (
                f"difference | {name}, {number} people, {shift_db:g} dB varying by "
                f"{varying_db:g} dB | {cover} %"
            )


def group_rows() -> Iterator[str]:
    """Yield the coverage of group thresholds, over people, spread, levels and dispersion."""
    spreads = ((1.0, 1), (2.0, 1), (6.0, 1), (2.0, 3), (None, 1))
    without: list[str] = []
    for between_db, dispersion in spreads:
        between = "prior" if between_db is None else f"{between_db:g} dB"
        cells = [between + _spread_words(dispersion)]
        for levels, number in itertools.product(LEVELS, PEOPLE):
            people = People(
                number=number, levels_vpp=levels, between_db=between_db, dispersion=dispersion
            )
            score, given = group_score(people, STUDIES)
            cells.append(", ".join(score.cells()))
            if given < 1:
                name = "the paper's" if levels == PAPER else "centred"
                without.append(f"{number} people, {between}, {name}: {given:.1%}")
        yield f"| {' | '.join(cells)} |"
    yield ""
    but = f", but of {'; '.join(without)}" if without else ""
    yield f"Limits or a bound are printed of all studies{but}."


def _spread_words(dispersion: int) -> str:
    return f", dispersion {dispersion}" if dispersion > 1 else ""


def difference_score(people: People, *, shift_db: float, varying_db: float, studies: int) -> Score:
    """Return how the difference of two conditions of the same people did."""
    rng = people.generator()
    middle_db = TRUTH_DB + people.offsets_db(rng, studies)
    d = shift_db + varying_db * rng.standard_normal(middle_db.shape)
    a, b = (people.answers(rng, middle_db + part * d) for part in (-0.5, 0.5))
    found: list[Sequence[float]] = []
    for of_a, of_b in zip(people.studies(a), people.studies(b), strict=True):
        one = paired_difference(of_a.likelihoods, of_b.likelihoods, people.prior())
        low, high = one.difference_limits_db
        found.append((low, one.difference_db, high))
    low_db, told, high_db = (np.array(found) - shift_db).T
    return Score(low=low_db, middle=told, high=high_db)


def difference_rows() -> Iterator[str]:
    """Yield the coverage of differences of two conditions."""
    settings = ((0.0, 0.5, 1), (2.0, 1.0, 1), (2.0, 3.0, 1), (2.0, 1.0, 3))
    for shift_db, varying_db, dispersion in settings:
        cells = [f"{shift_db:g} dB | {varying_db:g} dB{_spread_words(dispersion)}"]
        for levels, number in itertools.product(LEVELS, PEOPLE):
            people = People(number=number, levels_vpp=levels, dispersion=dispersion)
            score = difference_score(
                people, shift_db=shift_db, varying_db=varying_db, studies=STUDIES
            )
            cells.append(", ".join(score.cells()))
        yield f"| {' | '.join(cells)} |"


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    return "\n".join(
        [
            "## Groups and differences",
            "",
            _GROUPS,
            "",
            f"| between people | {_COLUMNS} |",
            f"|{'---|' * (1 + len(LEVELS) * len(PEOPLE))}",
            *group_rows(),
            "",
            _DIFFERENCES,
            "",
            f"| difference | varies by | {_COLUMNS} |",
            f"|{'---|' * (2 + len(LEVELS) * len(PEOPLE))}",
            *difference_rows(),
            "",
        ]
    )


_COLUMNS: Final = " | ".join(
    f"{name}: {number}" for name in ("the paper's", "centred") for number in PEOPLE
)
_GROUPS: Final = (
    f"Forced choices, {STUDIES} seeded studies a cell: coverage in % (standard error 0.3 % at 99 "
    "%, 0.7 % at 95 %), median width, bias and RMSE in dB. The middle of thresholds is 62 V, "
    "sigma 2 dB (varying by exp(0.3) between people), lapses 0.02; five levels, the paper's or "
    "centred ones, with 30 stimuli each. With a dispersion of 3 a person's answers vary three "
    "times as much as the binomial; `prior`: spread and middle are drawn from their priors for "
    "each study. Limits are the posterior's, printed or not (open outside the levels). Left out, "
    "as their neighbours show them: 4 dB between people, and differences of 2 dB that vary by 2 dB."
)
_DIFFERENCES: Final = (
    "Differences of two conditions, of people as above, 2 dB apart. Open limits count as covering."
)
