"""The group model by another method: the no-U-turn sampler of NumPyro (extra `crosscheck`)."""

from __future__ import annotations

import math
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.thresholds.function import MAX_LAPSE, SIGMA_FACTOR, SIGMA_MEDIAN
from analysis.thresholds.group import MIDDLE, OMEGA_SCALE, SPREAD, SPREAD_SCALE, posterior_of
from analysis.thresholds.likelihood import POINTS
from benchmarks.calibration import CENTRED, PAPER
from benchmarks.groups import TRUTH_DB, People

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

SETS: Final = (
    *((PAPER, 5, spread_db) for spread_db in (1.0, 2.0, 4.0)),
    *((CENTRED, 5, spread_db) for spread_db in (1.0, 2.0, 4.0)),
    *((levels, people, 2.0) for people in (3, 12) for levels in (PAPER, CENTRED)),
)
"""Ten: levels, people and the spread between them."""
WARM_UP: Final = 1000
SAMPLES: Final = 8000


def _model(x: Floats, counts: Floats, presented: float, guess_rate: float) -> None:
    """State the model of docs/statistics.md, section 8, in decibels; omega is continuous here."""
    import jax
    import jax.numpy as jnp
    import numpyro
    from numpyro import distributions as dist

    people = len(counts)
    low, high = float(x.min()), float(x.max())
    middle = numpyro.sample("middle", dist.Uniform(low - 60, high + 60))
    outside = jnp.maximum(jnp.maximum(low - middle, middle - high), 0.0)
    numpyro.factor("prior_of_middle", -outside / 3)
    spread = numpyro.sample("spread", dist.HalfNormal(SPREAD_SCALE))
    steepness = numpyro.sample(
        "steepness", dist.Normal(math.log(SIGMA_MEDIAN), math.log(SIGMA_FACTOR))
    )
    omega = numpyro.sample("omega", dist.HalfNormal(OMEGA_SCALE))
    with numpyro.plate("people", people):
        mu = middle + spread * numpyro.sample("mu", dist.Normal(0, 1))
        sigma = jnp.exp(steepness + omega * numpyro.sample("sigma", dist.Normal(0, 1)))
        lapse = numpyro.sample("lapse", dist.Uniform(0, MAX_LAPSE))
    numpyro.factor("prior_of_lapses", 9 * jnp.log1p(-lapse).sum())
    felt = jax.scipy.stats.norm.cdf((x - mu[:, None]) / sigma[:, None])
    p = guess_rate + (1 - guess_rate - lapse[:, None]) * felt
    numpyro.sample("k", dist.Binomial(presented, p), obs=counts)


def sampled(x: Floats, counts: Floats, presented: float, guess_rate: float) -> Any:
    """Return the sampler after its run."""
    import jax
    import numpyro
    from numpyro.infer import MCMC, NUTS

    numpyro.enable_x64()
    kernel = NUTS(_model, target_accept_prob=0.95)
    sampler = MCMC(kernel, num_warmup=WARM_UP, num_samples=SAMPLES, progress_bar=False)
    sampler.run(jax.random.PRNGKey(1), x, counts, presented, guess_rate)
    return sampler


def rows() -> Iterator[str]:
    """Yield the points of middle and spread by both methods, of each kind of group."""
    from numpyro.diagnostics import effective_sample_size

    grouped: dict[str, list[tuple[str, ...]]] = {}
    for levels, number, spread_db in SETS:
        people = People(number=number, levels_vpp=levels, between_db=spread_db)
        rng = people.generator()
        counts = people.answers(rng, TRUTH_DB + people.offsets_db(rng, 1))
        (tables,) = people.studies(counts)
        grid = posterior_of(tables)
        sampler = sampled(20 * np.log10(levels), counts[0], 30, people.guess_rate)
        drawn = sampler.get_samples()
        cells = []
        for ours, name in ((grid.points(MIDDLE), "middle"), (grid.points(SPREAD), "spread")):
            theirs = np.quantile(np.asarray(drawn[name]), POINTS)
            size = effective_sample_size(np.asarray(drawn[name])[None])
            # Of a normal density the 2.5 % point of so many draws is known so well.
            error = np.ptp(theirs) / 3.92 * 2.67 / math.sqrt(size)
            cells.append(f"{np.abs(ours - theirs).max():.2f} ({error:.2f})")
        name = "the paper's" if levels == PAPER else "centred"
        grouped.setdefault(name, []).append((f"{number}", f"{spread_db:g}", *cells))
    for name, some in grouped.items():
        yield f"| {name} | {' | '.join(', '.join(cells) for cells in zip(*some, strict=True))} |"


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    if find_spec("numpyro") is None:
        return "## Groups by another method\n\nNot measured: needs the extra `crosscheck`.\n"
    return "\n".join(["## Groups by another method", "", _WORDS, "", *_HEADER, *rows(), ""])


_WORDS: Final = (
    "Middle M and spread tau of ten groups: the largest difference, in dB, of their 2.5, 50 and "
    f"97.5 % points by the grid from those by NumPyro's no-U-turn sampler ({SAMPLES} draws after "
    f"{WARM_UP}), with the same model but a continuous omega and no nodes; in brackets the "
    "sampler's standard error of its outer points."
)
_HEADER: Final = (
    "| levels | people | between people, dB | M (error) | tau (error) |",
    "|---|---|---|---|---|",
)
