"""Counts at levels, checked: what psychometric functions are fitted to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, get_args

import numpy as np

from analysis.axis import LARGEST, XScale
from analysis.counts.intervals import checked_counts
from analysis.thresholds.function import FunctionName, Prior
from analysis.thresholds.guess import GuessRate

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

MAX_PRESENTED: Final = 10**12
_MAX_LEVELS: Final = 64
_BIN: Final = 0.1
"""Steps. Counts at more than `_MAX_LEVELS` levels are spread over levels that lie so far apart."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tables:
    """Counts at levels on the axis, (tables, levels); an unused place has 0 presented."""

    x: Floats
    detected: Floats
    presented: Floats
    guesses: Sequence[GuessRate]
    x_scale: XScale = "log10"
    function: FunctionName = "normal"
    step: float | None = None
    """A step of the prior on the axis, where more levels than these make it."""

    def __len__(self) -> int:
        return len(self.x)

    def at(self, rows: Sequence[int]) -> Tables:
        """Return some of the tables, in steps of all."""
        chosen = list(rows)
        return replace(
            self,
            x=self.x[chosen],
            detected=self.detected[chosen],
            presented=self.presented[chosen],
            guesses=[self.guesses[i] for i in chosen],
            step=self.prior.step,
        )

    def counts(self, rows: int | slice = slice(None)) -> tuple[Floats, Floats, Floats]:
        """Return the levels of some tables in steps, with what was detected and presented there."""
        used = self.presented[rows] > 0
        u = self.x[rows][used] / self.prior.step
        return pooled(u, self.detected[rows][used], self.presented[rows][used])

    @cached_property
    def prior(self) -> Prior:
        """The prior that goes with the levels of all tables."""
        return Prior.of(self.x[self.presented > 0], self.x_scale, self.step)

    @cached_property
    def priors(self) -> list[Prior]:
        """The prior that goes with the levels of each table, in steps of all."""
        step = self.prior.step
        tables = zip(self.x, self.presented, strict=True)
        return [Prior.of(x[presented > 0], self.x_scale, step) for x, presented in tables]

    def several_levels(self) -> NDArray[np.bool_]:
        """Return which tables have more than one level."""
        return np.array([prior.high > prior.low for prior in self.priors])


def checked_tables(
    levels: ArrayLike,
    detected: ArrayLike,
    presented: ArrayLike,
    guess_rate: float | GuessRate | None = None,
    blanks: tuple[ArrayLike, ArrayLike] | None = None,
    *,
    x_scale: XScale = "log10",
    function: FunctionName = "normal",
    name: str = "levels",
) -> Tables:
    """Check the counts of people, (people, levels), and lay them on the axis.

    `name` is what messages call the levels.
    """
    if function not in get_args(FunctionName):
        allowed = ", ".join(get_args(FunctionName))
        raise ValueError(f"function must be one of {allowed}; got {function!r}")
    if function == "weibull" and x_scale == "linear":
        raise ValueError('function="weibull" needs x_scale="log10"; on a linear axis use "gumbel"')
    k, n = checked_counts(detected, presented)
    x = np.asarray(levels)
    if x.ndim != 1 or k.shape != n.shape or k.shape != (len(np.atleast_1d(k)), x.size):
        raise ValueError(
            f"detected and presented must have the length of {name}, for each person; got the "
            f"shapes {k.shape}, {n.shape} and {x.shape}"
        )
    if (n > MAX_PRESENTED).any():
        raise ValueError(f"presented must be at most {MAX_PRESENTED:.0e}; got {n.max():g}")
    if not (n > 0).any(axis=1).all():
        raise ValueError("presented must hold at least one stimulus of each person; got none")
    return Tables(
        x=np.broadcast_to(_on_axis(x, x_scale, name), k.shape),
        detected=k,
        presented=n,
        guesses=_guess_rates(len(k), guess_rate, blanks),
        x_scale=x_scale,
        function=function,
    )


def _on_axis(levels: NDArray[np.generic], x_scale: XScale, name: str) -> Floats:
    """Return levels on the axis; raise a ValueError unless they can lie there."""
    if levels.size and levels.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be finite numbers; got {levels.tolist()!r}")
    x = levels.astype(np.float64)
    if not (np.abs(x) <= LARGEST).all():
        wrong = x[~(np.abs(x) <= LARGEST)].tolist()
        raise ValueError(f"{name} must be finite and at most {LARGEST:g}; got {wrong}")
    if x_scale not in get_args(XScale):
        raise ValueError(f"x_scale must be one of log10, linear; got {x_scale!r}")
    if x_scale == "log10" and (x <= 0).any():
        raise ValueError(
            f"{name} must be above 0 on the axis log10; got {x[x <= 0].tolist()}: use "
            'x_scale="linear"'
        )
    return np.log10(x) if x_scale == "log10" else x


def _guess_rates(
    people: int, guess_rate: float | GuessRate | None, blanks: tuple[ArrayLike, ArrayLike] | None
) -> list[GuessRate]:
    """Return the guess rate of each person, known or after blank trials."""
    if guess_rate is not None and blanks is None:
        rate = guess_rate if isinstance(guess_rate, GuessRate) else GuessRate(mean=guess_rate)
        return [rate] * people
    if blanks is None or guess_rate is not None:
        raise ValueError("exactly one of guess_rate and blanks must be given")
    answered, shown = checked_counts(*blanks)
    if answered.shape != (people,) or shown.shape != (people,):
        raise ValueError(
            f"blanks must be two lists of {people}, a number for each person; got the shapes "
            f"{answered.shape} and {shown.shape}"
        )
    return [
        GuessRate.after_blanks(answered=float(a), blanks=int(b))
        for a, b in zip(answered, shown, strict=True)
    ]


def pooled(x: Floats, detected: Floats, presented: Floats) -> tuple[Floats, Floats, Floats]:
    """Return different levels in order, with the sums of their counts."""
    if (np.diff(x) > 0).all():
        return x, detected, presented
    at, index = np.unique(x, return_inverse=True)
    k, n = (
        np.bincount(index.ravel(), count, len(at)).astype(np.float64)
        for count in (detected, presented)
    )
    return at, k, n


def binned(u: Floats, k: Floats, n: Floats) -> tuple[Floats, Floats, Floats]:
    """Spread counts at many levels over few, each over its two neighbours, and pool equal levels.

    Log likelihoods are thereby interpolated between levels that lie 0.1 dB apart.
    """
    u, k, n = pooled(u, k, n)
    if len(u) <= _MAX_LEVELS:
        return u, k, n
    below = np.floor(u / _BIN)
    share = u / _BIN - below
    return pooled(
        np.concatenate([below, below + 1]) * _BIN,
        np.concatenate([k * (1 - share), k * share]),
        np.concatenate([n * (1 - share), n * share]),
    )
