"""Whether intervals hold: simulated studies, thresholds beside psignifit, grids against time."""

from __future__ import annotations

import math
import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from analysis.answers.intervals import group_interval, proportion_ci
from analysis.definitions import METHODS
from analysis.groups.difference import paired_difference
from analysis.groups.hierarchy import hierarchy
from analysis.thresholds.fit import WITH_THRESHOLD, fit_many
from analysis.thresholds.grid import STANDARD, Nodes, Ruler, surfaces
from analysis.thresholds.people import GuessRate
from analysis.thresholds.posterior import posterior
from benchmarks.timing import duration, median_s

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.grid import Surface

    Floats = NDArray[np.float64]

STUDIES: Final = 2000
GROUPS: Final = 300
"""Studies of groups, and of differences, for each line."""
BESIDE: Final = 200
"""Studies that psignifit fits too: it takes a third of a second for each."""
GRIDS: Final = (
    Nodes(between=11, outside=4, log_sigma=7, lapse=3),
    Nodes(between=21, outside=6, log_sigma=11, lapse=4),
    Nodes(between=31, outside=10, log_sigma=17, lapse=5),
    STANDARD,
    Nodes(between=101, outside=24, log_sigma=33, lapse=8),
)
FINEST: Final = Nodes(between=301, outside=60, log_sigma=81, lapse=16)
FIGURE: Final = Path(__file__).parent.parent / "docs" / "posterior.png"
N: Final = 30
SIGMA: Final = 0.1
LAPSE: Final = 0.02
BETWEEN_DB: Final = 2.0
PAPER: Final = (60.0, 95.0, 130.0, 165.0, 200.0)


def psychometric(
    level_vpp: ArrayLike,
    *,
    threshold_vpp: ArrayLike,
    sigma: float,
    guess_rate: float,
    lapse_rate: float,
) -> Floats:
    """Return gamma + (1 - gamma - lambda) Phi(log10(V / threshold) / sigma), docs/model.md.

    Halfway up at the threshold:

    >>> float(psychometric(60, threshold_vpp=60, sigma=0.1, guess_rate=0.5, lapse_rate=0.0))
    0.75
    """
    z = np.log10(np.asarray(level_vpp) / np.asarray(threshold_vpp)) / sigma
    return np.asarray(guess_rate + (1.0 - guess_rate - lapse_rate) * ndtr(z))


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A simulated observer and the levels it is tested with."""

    name: str
    threshold_vpp: float
    guess_rate: float
    levels_vpp: tuple[float, ...]

    @property
    def x(self) -> Floats:
        """Levels on the axis."""
        return np.log10(self.levels_vpp)

    def counts(self, studies: int) -> Floats:
        """Draw detections, shape (studies, levels)."""
        p = psychometric(
            self.levels_vpp,
            threshold_vpp=self.threshold_vpp,
            sigma=SIGMA,
            guess_rate=self.guess_rate,
            lapse_rate=LAPSE,
        )
        return np.random.default_rng(1).binomial(N, p, (studies, len(p))).astype(float)


CENTRED: Final = (49.0, 57.0, 64.0, 73.0, 91.0)
SETTINGS: Final = (
    Setting(name="the paper's", threshold_vpp=62, guess_rate=0.5, levels_vpp=PAPER),
    Setting(name="centred", threshold_vpp=62, guess_rate=0.5, levels_vpp=CENTRED),
    Setting(name="the paper's", threshold_vpp=62, guess_rate=0.0, levels_vpp=PAPER),
    Setting(name="centred", threshold_vpp=62, guess_rate=0.0, levels_vpp=CENTRED),
)


def ours(setting: Setting, counts: Floats, nodes: Nodes = STANDARD) -> Floats:
    """Return limits and median of each threshold on the axis, shape (studies, 3)."""
    ruler = Ruler.of(setting.x, "log10")
    rulers = [ruler] * len(counts)
    found = surfaces(
        np.broadcast_to(setting.x / ruler.step, counts.shape),
        counts,
        np.full(counts.shape, float(N)),
        rulers=rulers,
        guesses=[GuessRate(mean=setting.guess_rate)] * len(counts),
        nodes=nodes,
    )
    return np.asarray(posterior(found, rulers).mu * ruler.step)


def theirs(setting: Setting, counts: Floats, steps: int | None = None) -> Floats:
    """Return psignifit's lower limit, mean and upper limit of the threshold."""
    from psignifit import psignifit

    fixed = {"gamma": setting.guess_rate, "eta": 1e-8}
    fine = {"grid_steps": {"threshold": steps, "width": steps, "lambda": 20}} if steps else {}
    data = np.column_stack([setting.x, counts, np.full(len(counts), N)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of data that do not determine a parameter
        found = psignifit(
            data, experiment_type="yes/no", sigmoid="norm", fixed_parameters=fixed, **fine
        )
    low, high = found.confidence_intervals["threshold"]["0.95"]
    return np.array([low, found.get_parameter_estimate("mean")["threshold"], high])


def many_theirs(setting: Setting, counts: Floats) -> Floats:
    """Fit with psignifit on two processes of one thread each."""
    from joblib import Parallel, delayed

    rows = Parallel(n_jobs=min(2, os.cpu_count() or 1))(delayed(theirs)(setting, k) for k in counts)
    return np.array(rows)


def _errors(found: Floats, setting: Setting) -> str:
    truth = math.log10(setting.threshold_vpp)
    db = 20 * (found[:, 1] - truth)
    covered = np.mean((found[:, 0] <= truth) & (truth <= found[:, 2]))
    rmse = math.sqrt(float(np.square(db).mean()))
    spread = float(np.square(db).std()) / (2 * rmse * math.sqrt(len(db)))
    error = math.sqrt(float(covered * (1 - covered)) / len(db))
    return (
        f"{db.mean():+.2f} +- {db.std() / math.sqrt(len(db)):.2f} | {rmse:.2f} +- {spread:.2f} | "
        f"{covered:.1%} +- {error:.1%}"
    )


def _given(setting: Setting, counts: Floats) -> NDArray[np.bool_]:
    """Tell of which studies a threshold is given."""
    x, shown = np.broadcast_to(setting.x, counts.shape), np.full(counts.shape, float(N))
    guesses = [GuessRate(mean=setting.guess_rate)] * len(counts)
    fits = fit_many(x, counts, shown, guesses=guesses)
    return np.array([fit.status in WITH_THRESHOLD for fit in fits])


def threshold_rows() -> Iterator[str]:
    """Yield a row of each setting, program and choice of studies."""
    for setting in SETTINGS:
        counts = setting.counts(STUDIES)
        results = [("ours", ours(setting, counts))]
        if BESIDE:
            results += [("ours", results[0][1][:BESIDE])]
            results += [("psignifit", many_theirs(setting, counts[:BESIDE]))]
        given = _given(setting, counts)
        for which, chosen in (("all", np.ones(STUDIES, dtype=bool)), ("given", given)):
            for program, found in results:
                some = found[chosen[: len(found)]]
                head = f"| {setting.name} | {setting.guess_rate:g} | {which} | {program} |"
                yield f"{head} {len(some)} | {_errors(some, setting)} |"


def interval_rows() -> Iterator[str]:
    """Yield the coverage of each interval, of one cell and of a group of five."""
    rng = np.random.default_rng(2)
    for truth in (0.5, 0.8, 0.95):
        k = rng.binomial(N, truth, STUDIES)
        for method in METHODS:
            low, high = proportion_ci(k, N, method)
            yield f"| one cell, {method} | {truth:g} | {_share((low <= truth) & (truth <= high))} |"
    for level in (60.0, 95.0):
        offsets = BETWEEN_DB / 20 * rng.standard_normal((STUDIES, 5))
        p = ndtr((math.log10(level / 70) + offsets) / SIGMA)
        truth = float(ndtr(math.log10(level / 70) / math.hypot(SIGMA, BETWEEN_DB / 20)))
        k = rng.binomial(N, p)
        group = np.array([group_interval(one, [N] * 5) for one in k])
        pooled = np.stack(proportion_ci(k.sum(axis=1), 5 * N), axis=1)
        for name, limits in (("n_eff", group), ("pooled binomial, ignores participants", pooled)):
            inside = (limits[:, 0] <= truth) & (truth <= limits[:, 1])
            yield f"| group of five, {name} | {truth:.2f} | {_share(inside)} |"


def _people(
    rng: np.random.Generator, at_db: Floats, levels_vpp: tuple[float, ...], dispersion: float
) -> Floats:
    """Draw forced choices of people, whose answers vary so many times as much as the binomial."""
    x = 20 * np.log10(levels_vpp)
    sigma = 20 * SIGMA * np.exp(0.3 * rng.standard_normal((len(at_db), 1)))
    p = 0.5 + (0.5 - LAPSE) * ndtr((x - at_db[:, None]) / sigma)
    if dispersion > 1:
        size = (N - dispersion) / (dispersion - 1)
        p = rng.beta(np.maximum(p * size, 1e-6), np.maximum((1 - p) * size, 1e-6))
    return np.asarray(rng.binomial(N, p), dtype=np.float64)


def group_rows() -> Iterator[str]:
    """Yield the coverage of group thresholds, over people, spread, levels and dispersion."""
    truth_db = 20 * math.log10(62)
    for name, levels in (("the paper's", PAPER), ("centred", CENTRED)):
        for people in (3, 5, 12):
            for spread_db, dispersion in ((1, 1), (2, 1), (4, 1), (6, 1), (2, 2), (2, 3)):
                rng = np.random.default_rng([people, spread_db, dispersion])
                inside, widths, errors = [], [], []
                for _ in range(GROUPS):
                    at_db = truth_db + spread_db * rng.standard_normal(people)
                    low, middle, high = _group_db(_people(rng, at_db, levels, dispersion), levels)
                    inside.append(low <= truth_db <= high)
                    widths.append(high - low)
                    errors.append(middle - truth_db)
                yield (
                    f"| {name} | {people} | {spread_db} dB | {dispersion} | "
                    f"{_share(np.array(inside))} | {np.median(widths):.1f} | "
                    f"{np.mean(errors):+.2f} | {math.sqrt(float(np.square(errors).mean())):.2f} |"
                )


def _likelihoods(counts: Floats, levels_vpp: tuple[float, ...]) -> tuple[list[Surface], Ruler]:
    ruler = Ruler.of(np.log10(levels_vpp), "log10")
    found = surfaces(
        np.broadcast_to(np.log10(levels_vpp) / ruler.step, counts.shape),
        counts,
        np.full(counts.shape, float(N)),
        rulers=[ruler] * len(counts),
        guesses=[GuessRate(mean=0.5)] * len(counts),
    )
    return found, ruler


def _group_db(counts: Floats, levels_vpp: tuple[float, ...]) -> Floats:
    """Return limits and median of a group's threshold, dB, whether or not they are printed."""
    return hierarchy(*_likelihoods(counts, levels_vpp)).of_middle()


def difference_rows() -> Iterator[str]:
    """Yield the coverage of differences of two conditions."""
    for name, levels in (("the paper's", PAPER), ("centred", CENTRED)):
        for people in (3, 5, 8, 12):
            for shift_db, spread_db, dispersion in ((0, 0.5, 1), (2, 1, 1), (2, 2, 1), (2, 1, 3)):
                rng = np.random.default_rng([people, int(10 * spread_db), dispersion])
                inside, widths, errors = [], [], []
                for _ in range(GROUPS):
                    a_db = 20 * math.log10(62) + BETWEEN_DB * rng.standard_normal(people)
                    b_db = a_db + shift_db + spread_db * rng.standard_normal(people)
                    both = [_people(rng, one, levels, dispersion) for one in (a_db, b_db)]
                    found, ruler = _likelihoods(np.concatenate(both), levels)
                    one, _ = paired_difference(found[:people], found[people:], ruler)
                    low, high = one.difference_limits_db
                    inside.append(low <= shift_db <= high)
                    widths.append(high - low)
                    errors.append(one.difference_db - shift_db)
                yield (
                    f"| {name} | {people} | {shift_db} dB | {spread_db} dB | {dispersion} | "
                    f"{_share(np.array(inside))} | {np.median(widths):.1f} | "
                    f"{np.nanmean(errors):+.2f} |"
                )


def _share(inside: NDArray[np.bool_]) -> str:
    share = float(inside.mean())
    return f"{share:.1%} +- {math.sqrt(share * (1 - share) / len(inside)):.1%}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What a grid costs, and how far its points lie from those of the finest."""

    name: str
    error: float
    alone_s: float
    batch_s: float


def grids() -> list[Grid]:
    """Time the grids on the forced choices of the first setting."""
    setting, found = SETTINGS[1], []
    counts = setting.counts(200)
    true = _printed(setting, ours(setting, counts[:40], FINEST))
    for nodes in GRIDS:
        here = _printed(setting, ours(setting, counts[:40], nodes))
        error = 20 * np.quantile(np.abs(here - true).max(axis=1), 0.9)
        alone, batch = _times(setting, counts, nodes)
        name = f"{nodes.between + 2 * nodes.outside} x {nodes.log_sigma} x {nodes.lapse}"
        found.append(Grid(name=name, error=float(error), alone_s=alone, batch_s=batch))
    return found


def _printed(setting: Setting, points: Floats) -> Floats:
    """Return points as they are told: no limit lies outside the levels."""
    return np.clip(points, setting.x[0], setting.x[-1])


def _times(setting: Setting, counts: Floats, nodes: Nodes) -> tuple[float, float]:
    alone = median_s(lambda i: ours(setting, counts[i : i + 1], nodes), 100)
    return alone, median_s(lambda _: ours(setting, counts, nodes), 3) / len(counts)


def beside() -> Grid | None:
    """Time psignifit, and tell how far its limits lie from those on a finer grid of its own."""
    if not BESIDE:
        return None
    setting = SETTINGS[1]
    counts = setting.counts(4)
    moved = [
        20 * np.abs(theirs(setting, k) - theirs(setting, k, 120))[[0, 2]].max() for k in counts
    ]
    alone = median_s(lambda i: theirs(setting, counts[i % 4]), 4)
    return Grid(name="psignifit", error=float(np.median(moved)), alone_s=alone, batch_s=alone)


def draw(found: list[Grid], other: Grid | None) -> None:
    """Draw the time against the error."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    for label, times, colour in (
        ("one fit alone", [one.alone_s for one in found], "#0072B2"),
        ("one of 200 in a batch", [one.batch_s for one in found], "#D55E00"),
    ):
        axes.loglog([one.error for one in found], times, "o-", color=colour, label=label)
    if other is not None:
        axes.loglog([other.error], [other.alone_s], "^", color="#CC79A7", label="psignifit, alone")
    axes.set_xlabel("error of limits and median, dB (90 % of fits are better)")
    axes.set_ylabel("seconds per fit, one thread")
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(FIGURE, dpi=110)


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    found, other = grids(), beside()
    draw(found, other)
    rows = [
        f"| {one.name} | {one.error:.1e} | {duration(one.alone_s)} | {duration(one.batch_s)} |"
        for one in found
    ]
    if other is not None:
        rows.append(f"| psignifit | {other.error:.1e} | {duration(other.alone_s)} | |")
    return "\n".join(
        [
            "## Calibration",
            "",
            _INTERVALS,
            "",
            "| interval | true probability | covers |",
            "|---|---|---|",
            *interval_rows(),
            "",
            _THRESHOLDS,
            "",
            "| levels | gamma | which | program | studies | bias, dB | RMSE, dB | limits cover |",
            "|---|---|---|---|---|---|---|---|",
            *threshold_rows(),
            "",
            _GROUPS,
            "",
            _GROUP_HEADER,
            "|---|---|---|---|---|---|---|---|",
            *group_rows(),
            "",
            _DIFFERENCES,
            "",
            _DIFFERENCE_HEADER,
            "|---|---|---|---|---|---|---|---|",
            *difference_rows(),
            "",
            _TIMES,
            "",
            "![Time against error](posterior.png)",
            "",
            "| grid (mu, sigma, lambda) | error | alone | in a batch of 200 |",
            "|---|---|---|---|",
            *rows,
            "",
        ]
    )


_INTERVALS: Final = (
    f"{STUDIES} seeded studies for each line; the share that covers the truth, with its standard "
    f"error. {N} stimuli a cell; groups: five people with {BETWEEN_DB:g} dB between their "
    "thresholds, 70 V in the middle, at 60 and 95 V."
)
_THRESHOLDS: Final = (
    f"Thresholds of one observer: 62 V, sigma {SIGMA}, lapses {LAPSE}, five levels of {N} stimuli; "
    f"the paper's levels or {', '.join(f'{v:g}' for v in CENTRED)} V. Ours is the posterior "
    "median, psignifit's the posterior mean (three free parameters, its default grid): of all "
    "tables, whatever their status, and of those of which we give a threshold as a number (status "
    "ok, lapse_at_bound or separated; chosen by their outcome, the same for both programs). "
    "psignifit fits the first of the same studies; fewer, as each takes a third of a second on a "
    "busy machine. Where the levels say little its prior, which falls off outside them, pulls the "
    "threshold towards them, here to where it is. With every figure its standard error."
)
_GROUP_HEADER: Final = (
    "| levels | people | between people | dispersion | limits cover | width, dB | bias, dB "
    "| RMSE, dB |"
)
_DIFFERENCE_HEADER: Final = (
    "| levels | people | difference | between people | dispersion | limits cover | width, dB "
    "| bias, dB |"
)
_GROUPS: Final = (
    f"Groups of forced choices, {GROUPS} seeded studies for each line: thresholds with a middle of "
    "62 V, sigma 2 dB (varying by exp(0.3) between people), lapses 0.02; dispersion is how many "
    "times as much as the binomial the answers of a person vary. Limits are those of the "
    "posterior, whether or not they are printed (outside the levels they are open); width is the "
    "median one."
)
_DIFFERENCES: Final = (
    "Differences of two conditions of the same people, thresholds of the first as above with 2 dB "
    "between people; the difference varies between people, too. Open limits count as covering."
)
_TIMES: Final = (
    "Time of one posterior against the error of its three points (dB, 90 % quantile of 40 "
    f"tables beside a grid of {FINEST.between + 2 * FINEST.outside} x {FINEST.log_sigma} x "
    f"{FINEST.lapse}, cut off at the levels); forced choice, centred levels, one thread. "
    "psignifit's error is that of its limits beside a finer grid of "
    "its own, median of four tables."
)
