"""Information transfer: how many bits an answer says about the site of the stimulus."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import pandas as pd
from scipy.special import digamma

from analysis.counts.intervals import mean_limits
from analysis.counts.table import PERSON
from analysis.numbers import TOTAL, in_order
from analysis.task_columns import task_of
from experiment.tasks.task import SINGLE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    Floats = NDArray[np.float64]

INFORMATION_COLUMNS: Final = (
    *("condition", "participant", "presented", "bits", "bits_low", "bits_high", "max_bits"),
)
_DRAWS: Final = 2_000
_PRIOR_ANSWERS: Final = 2.0
"""Answers added to each row, spread evenly, before tables are drawn from it. Without them, the
interval of a participant who never errs would have no width."""
_PERCENTILES: Final = (2.5, 97.5)


class InformationTransfer(NamedTuple):
    """An estimate with its 95 % interval, in bits."""

    bits: float
    low: float
    high: float


def information_transfer(counts: ArrayLike, *, seed: int = 0) -> InformationTransfer:
    """Return the information that answers transfer about stimuli, in bits, corrected for its bias.

    The information of equally frequent stimuli is the entropy of all answers less the mean entropy
    of the answers to one stimulus. With few trials both are estimated too low, the second more, so
    that the plug-in estimate is too high by about ``(S - 1)(A - 1) / (2 n ln 2)`` bits. Entropies
    are therefore estimated by Grassberger's series. Its bias is below 0.05 bit with 20 trials of
    each of four stimuli, and with five times as many trials of each stimulus as there are stimuli.
    The interval is that of the basic bootstrap: tables are drawn from the smoothed shares of each
    row.

    Parameters
    ----------
    counts : array_like of int, shape (S, A)
        How often each of S stimuli was answered by each of A answers.
    seed : int
        Seed of the bootstrap.

    Returns
    -------
    InformationTransfer
        The estimate and its limits, from 0 to log2 of the smaller of S and A; NaN if there is no
        stimulus, or one of them has no answer.

    Raises
    ------
    ValueError
        For anything but a matrix of whole counts of at least 0.

    References
    ----------
    G. A. Miller, "Note on the bias of information estimates", 1955. P. Grassberger, "Entropy
    estimates from insufficient samplings", 2003, arXiv:physics/0307138.

    Examples
    --------
    Two stimuli that are never confused carry one bit, as far as 40 trials can show:

    >>> information_transfer([[20, 0], [0, 20]])._asdict()
    {'bits': 1.0, 'low': 0.73..., 'high': 1.0}
    """
    table = np.asarray(counts)
    if np.ndim(table) != np.ndim([[]]) or table.dtype.kind not in "iu" or np.any(table < 0):
        raise ValueError(f"counts must be a matrix of whole numbers of at least 0, got {counts!r}")
    presented = table.sum(axis=1)
    if not presented.size or not presented.all():
        return InformationTransfer(math.nan, math.nan, math.nan)
    max_bits = math.log2(min(table.shape))
    n_answers = table.shape[1]
    smooth = (table + _PRIOR_ANSWERS / n_answers) / (presented + _PRIOR_ANSWERS)[:, None]
    rng = np.random.default_rng(seed)
    pairs = zip(presented.tolist(), smooth, strict=True)
    drawn = np.stack([rng.multinomial(n, p, size=_DRAWS) for n, p in pairs], axis=1)
    true_bits = _entropy_bits(smooth.mean(axis=0)) - _entropy_bits(smooth).mean()
    errors = _corrected_bits(drawn) - true_bits
    bits = _corrected_bits(table)
    above, below = np.percentile(errors, _PERCENTILES)
    values = np.clip([bits, bits - below, bits - above], 0.0, max_bits)
    return InformationTransfer(*values.tolist())


def _entropy_bits(p: Floats) -> Floats:
    """Return the entropy of each row of probabilities."""
    return np.asarray(-np.sum(p * np.log2(np.where(p > 0, p, 1.0)), axis=-1))


def _corrected_bits(tables: NDArray[np.int64]) -> Any:
    """Return the information of tables (..., S, A), with the corrected entropies."""
    share = tables / tables.sum(axis=-1, keepdims=True)
    weights = share.mean(axis=-2)  # of the answers, were all stimuli equally frequent
    marginal = weights * tables.sum(axis=(-2, -1))[..., None]
    return _grassberger_bits(marginal) - _grassberger_bits(tables).mean(axis=-1)


def _grassberger_bits(counts: ArrayLike) -> Any:
    """Return the entropy of each row of counts n_i, log2 N - sum n_i G(n_i) / (N ln 2).

    G(n) = psi(n) + (-1)^n (psi((n + 1) / 2) - psi(n / 2)) / 2, equation (31) of Grassberger.
    """
    n = np.asarray(counts, dtype=np.float64)
    total = n.sum(axis=-1)
    at = np.maximum(np.rint(n), 1.0)
    sign = np.where(at % 2 == 0, 0.5, -0.5)
    series = digamma(at) + sign * (digamma((at + 1) / 2) - digamma(at / 2))
    return np.log2(total) - (n * series).sum(axis=-1) / (total * math.log(2))


def information_table(counts: pd.DataFrame, *, seed: int = 0) -> pd.DataFrame:
    """Return the information transfer of each participant in each condition, over all levels.

    `counts` are those of `analysis.counts.table.count_answers`. The last rows are `TOTAL`: the mean
    of the participants with its 95 % limits by Student's t, NaN for one participant.
    """
    task = task_of(counts)
    rows = counts[counts["kind"].eq(SINGLE) & counts["response"].isin(task.answer_names)]
    names = [shown.name for shown in task.of_kind(SINGLE)]
    max_bits = math.log2(min(len(names), len(task.correct_answers)))
    people = []
    for (condition, participant), person in rows.groupby(PERSON):
        table = person.pivot_table("n", "side", "response", aggfunc="sum", fill_value=0)
        table = table.reindex(index=names, columns=[*task.answer_names], fill_value=0)
        transfer = information_transfer(table.to_numpy(dtype=np.int64), seed=seed)
        people.append([condition, participant, int(person["n"].sum()), *transfer, max_bits])
    each = pd.DataFrame(people, columns=[*INFORMATION_COLUMNS])
    if each.empty:
        return each
    limits = mean_limits(each["bits"], [each["condition"]])
    totals = limits.rename(columns={"mean": "bits", "low": "bits_low", "high": "bits_high"})
    totals[["bits_low", "bits_high"]] = totals[["bits_low", "bits_high"]].clip(0.0, max_bits)
    totals = totals.assign(
        participant=TOTAL,
        presented=each.groupby("condition")["presented"].sum(),
        max_bits=max_bits,
    ).reset_index()
    table = pd.concat([each, totals[[*INFORMATION_COLUMNS]]], ignore_index=True)
    return table.sort_values(PERSON, key=in_order, ignore_index=True)
