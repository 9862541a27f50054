"""What fits, groups and differences cost, and how far their grids lie from finer ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtr

from analysis import compare_conditions, fit_group
from analysis.thresholds.fit import fit_many
from analysis.thresholds.likelihood import STANDARD, Nodes
from benchmarks.calibration import BESIDE, CENTRED, PAPER, SCENARIOS, ours, theirs
from benchmarks.timing import duration, processor_s

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from benchmarks.calibration import Scenario

    Floats = NDArray[np.float64]

GRIDS: Final = (
    Nodes(between=11, outside=4, log_sigma=7, lapse=3),
    Nodes(between=21, outside=6, log_sigma=11, lapse=4),
    Nodes(between=31, outside=10, log_sigma=17, lapse=5),
    STANDARD,
    Nodes(between=101, outside=24, log_sigma=33, lapse=8),
)
FINEST: Final = Nodes(between=301, outside=60, log_sigma=81, lapse=16)
BATCH: Final = 500
FIGURE: Final = Path(__file__).parent.parent / "docs" / "benchmarks" / "posterior.png"


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """What a grid costs, and how far its points lie from those of the finest."""

    name: str
    error: float
    alone_s: float
    batch_s: float


def _whole(scenario: Scenario, counts: Floats) -> object:
    return fit_many(scenario.tables(counts))


def grids() -> list[Grid]:
    """Time the grids on forced choices of centred levels."""
    scenario, found = SCENARIOS[2], []
    counts = scenario.counts(BATCH)
    ends = (scenario.x[0], scenario.x[-1])  # no limit outside is told
    true = np.clip(ours(scenario, counts[:40], FINEST), *ends)
    for nodes in GRIDS:
        here = np.clip(ours(scenario, counts[:40], nodes), *ends)
        error = 20 * np.abs(here - true).max()
        alone = processor_s(partial(ours, scenario, counts[:1], nodes), 20)
        batch = processor_s(partial(ours, scenario, counts, nodes), 5) / len(counts)
        name = f"{nodes.between + 2 * nodes.outside} x {nodes.log_sigma} x {nodes.lapse}"
        found.append(Grid(name=name, error=float(error), alone_s=alone, batch_s=batch))
    whole = processor_s(lambda: _whole(scenario, counts), 5) / len(counts)
    error = found[GRIDS.index(STANDARD)].error if STANDARD in GRIDS else math.nan
    alone = processor_s(lambda: _whole(scenario, counts[:1]), 20)
    found.append(
        Grid(name="a fit with status and likeliest", error=error, alone_s=alone, batch_s=whole)
    )
    return found


def beside() -> Grid | None:
    """Time psignifit, and tell how far its limits lie from those on a finer grid of its own."""
    if not BESIDE:
        return None
    scenario = SCENARIOS[2]
    counts = scenario.counts(4)
    moved = [
        20 * np.abs(theirs(scenario, k) - theirs(scenario, k, 120))[[0, 2]].max() for k in counts
    ]
    alone = processor_s(lambda: theirs(scenario, counts[0]), 4)
    return Grid(name="psignifit", error=float(np.median(moved)), alone_s=alone, batch_s=alone)


def draw(found: list[Grid], other: Grid | None) -> None:
    """Draw the time against the error."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.2), layout="constrained")
    axes = figure.subplots()
    of_grids = found[:-1]
    for label, times, colour in (
        ("one posterior alone", [one.alone_s for one in of_grids], "#0072B2"),
        (f"one of {BATCH} in a batch", [one.batch_s for one in of_grids], "#D55E00"),
    ):
        axes.loglog([one.error for one in of_grids], times, "o-", color=colour, label=label)
    axes.loglog(
        [found[-1].error],
        [found[-1].batch_s],
        "s",
        color="#009E73",
        label=f"a whole fit, one of {BATCH}",
    )
    if other is not None:
        axes.loglog([other.error], [other.alone_s], "^", color="#CC79A7", label="psignifit, alone")
    axes.set_xlabel("largest error of limits and median of 40 tables, dB")
    axes.set_ylabel("processor seconds per table, one thread")
    axes.grid(visible=True, which="both", alpha=0.3)
    axes.legend()
    figure.savefig(FIGURE, dpi=110)


def together() -> str:
    """Time groups and differences of people of three studies, through what a script calls."""
    taken: dict[str, list[float]] = {"`fit_group`": [], "`compare_conditions`": []}
    for levels, people in product((PAPER, CENTRED), (5, 8, 12)):
        n = np.full((people, len(levels)), 30)
        rng = np.random.default_rng(people)
        a, b = (
            rng.binomial(n, 0.5 + 0.48 * ndtr((np.log10(levels) - at) / 0.1))
            for at in math.log10(62) + 0.1 * rng.standard_normal((2, people, 1))
        )
        group, both = taken.values()
        group.append(processor_s(partial(fit_group, levels, a, n, guess_rate=0.5)))
        both.append(processor_s(partial(compare_conditions, levels, a, n, b, n, guess_rate=0.5)))
    told = " and ".join(
        f"{name} takes {1e3 * min(some):.0f} to {1e3 * max(some):.0f} ms"
        for name, some in taken.items()
    )
    return (
        f"Of 5 to 12 people, 2 dB apart, with five levels of 30 stimuli, {told} of processor time, "
        "people's own fits included."
    )


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    found, other = grids(), beside()
    draw(found, other)
    rows = [
        f"| {one.name} | {one.error:.1e} | {duration(one.alone_s)} | {duration(one.batch_s)} |"
        for one in found
        if one.name != _DRAWN_ONLY
    ]
    if other is not None:
        rows.append(f"| psignifit | {other.error:.1e} | {duration(other.alone_s)} | |")
    return "\n".join(
        [
            "## Fits: time against error",
            "",
            _TIMES,
            "",
            "![Time against error](posterior.png)",
            "",
            f"| grid (mu, sigma, lambda) | error, dB | alone | in a batch of {BATCH} |",
            "|---|---|---|---|",
            *rows,
            "",
            together(),
            "",
        ]
    )


_DRAWN_ONLY: Final = "33 x 11 x 4"
"""A grid that the figure has, and the table not."""
_TIMES: Final = (
    "Processor time of one posterior against the largest error of its limits and median, against a "
    f"grid of {FINEST.between + 2 * FINEST.outside} x {FINEST.log_sigma} x {FINEST.lapse}, cut off "
    "at the levels; forced choice, centred levels, one thread. psignifit's error is that of its "
    "limits against a finer grid of its own, median of four tables."
)
