"""Thresholds that drift within a session, from detection over the number of the trial."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from scipy.special import erfc, ndtr

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from analysis.axis import Axis

    Floats = NDArray[np.float64]


DRIFT_P: Final = 1e-3
"""In so many sessions without a drift one is found, if answers depend on nothing else."""
STRONG: Final = 3.0
"""A drift over a condition, in dB or in eighths of a linear axis's range, that is worth a word."""
_THROUGHOUT: Final = 0.9
"""Of a session: conditions whose trials span more of it took turns."""

_WITHOUT: Final = "; the group's results without misfits and drifts stand in the answer's table"
_GUESS_WITH_NONE: Final = 0.03
_LAPSE: Final = 0.02
"""Both assumed, as they hardly change by how much a threshold moves."""


def drifting(single: pd.DataFrame, axis: Axis, alternatives: int) -> Iterator[tuple[str, str]]:
    """Say whose thresholds drift strongly, of single stimuli that count: person and sentence.

    That of the session with the least p; the other sessions are named.
    """
    p_value, sessions = drift_p(single)
    found: dict[str, list[tuple[float, str, str]]] = {}
    for i in np.flatnonzero(p_value < DRIFT_P):
        rows = single[sessions.eq(i)].sort_values("trial")
        part = _span(rows)
        steps = drift_steps(rows, axis, alternatives) * part
        if abs(steps) >= STRONG:
            name, session = str(rows["participant"].iloc[0]), str(rows["session"].iloc[0])
            words = _words(rows, steps, axis, throughout=part > _THROUGHOUT)
            found.setdefault(name, []).append((float(p_value[i]), session, words))
    several = single["participant"].nunique() - len(found) > 1
    for name, each in found.items():
        p, session, words = min(each)
        others = sorted(other for _, other, _ in each if other != session)
        also = f"; so in {', '.join(others)}" if others else ""
        told = (
            f"participant {name}, session {session}: {words} (p = {short_p(p)}{also}): tired, "
            "adapted, out of practice, or a finger moved? A threshold is the mean over its trials"
            + _WITHOUT
            * several
        )
        yield name, told


def _span(rows: pd.DataFrame) -> float:
    """Return over how much of a session its longest condition extends.

    Of conditions in blocks the drift is known within each alone: what lies between two of them is
    as well their difference.
    """
    order = rows["trial"].rank()
    spans = order.groupby(rows["condition"].astype(str)).agg(np.ptp)
    return float(spans.max() / max(np.ptp(order), 1.0))


def _words(rows: pd.DataFrame, steps: float, axis: Axis, *, throughout: bool) -> str:
    """Tell a drift by both halves; how far the threshold moved, where several levels tell that."""
    hit = rows["response"].astype(object).eq(rows["side"].astype(object))
    each = [np.array_split(one, 2) for _, one in hit.groupby(rows["condition"].astype(str))]
    first, second = (np.concatenate(halves) for halves in zip(*each, strict=True))
    half = "half" if len(each) == 1 else "halves of its conditions"
    told = (
        f"{first.sum()} of {len(first)} single stimuli detected in the first {half}, "
        f"{second.sum()} of {len(second)} in the second"
    )
    if len(set(rows["level_vpp"])) == 1:
        return told
    moved = f"{abs(steps):.1f} dB"
    if not axis.is_logarithmic:
        moved = f"{abs(steps) * _step(rows, axis):.3g} {axis.unit}"
    which = "rose" if steps > 0 else "fell"
    over = "the first trial to the last" if throughout else "a condition's first trial to its last"
    return f"{told}, as if the threshold {which} by {moved} from {over}"


def short_p(value: float) -> str:
    """Write a small probability.

    >>> short_p(0.00012), short_p(0.0)
    ('1e-4', '0')
    """
    return f"{value:.0e}".replace("e-0", "e-") if value else "0"


def drift_p(single: pd.DataFrame) -> tuple[Floats, pd.Series[int]]:
    """Return the probability of as much drift in each session by chance, and each trial's session.

    The sum of (trial number - its mean) x detected within each condition, level and side is zero
    without a drift; its variance is that of random orders of the answers there, the normal
    distribution its limit. Mantel's test (J. Am. Stat. Assoc. 58 (1963) 690-700), two-sided.

    >>> rows = pd.DataFrame({"participant": "1", "session": "01", "condition": "main",
    ...     "level_vpp": 60.0, "side": "left", "trial": range(40),
    ...     "response": ["left"] * 20 + ["none"] * 20})
    >>> p, _ = drift_p(rows)
    >>> p.round(7).tolist()
    [1e-07]
    """
    names = single.groupby(["participant", "session"], observed=True)
    stratum = single.groupby(
        ["participant", "session", "condition", "level_vpp", "side"], observed=True
    ).ngroup()
    session = names.ngroup()
    table = pd.DataFrame(
        {
            "session": session,
            "stratum": stratum,
            "t": names["trial"].rank(),
            "y": single["response"].astype(object).eq(single["side"].astype(object)).astype(float),
        }
    )
    table["tt"], table["ty"] = table["t"] ** 2, table["t"] * table["y"]
    table["n"] = 1.0
    sums = table.groupby(["session", "stratum"])[["n", "t", "y", "tt", "ty"]].sum()
    more = sums[sums["n"] > 1]
    share = more["y"] / more["n"]
    score = more["ty"] - more["t"] * share
    variance = (
        (more["tt"] - more["t"] ** 2 / more["n"])
        * share
        * (1 - share)
        * more["n"]
        / (more["n"] - 1)
    )
    of = pd.DataFrame({"score": score, "variance": variance}).groupby("session").sum()
    of = of.reindex(range(int(session.max()) + 1), fill_value=0.0)
    spread = np.sqrt(of["variance"].to_numpy())
    z = np.divide(of["score"].to_numpy(), spread, out=np.zeros_like(spread), where=spread > 0)
    return np.asarray(erfc(np.abs(z) / math.sqrt(2))), session


def _step(rows: pd.DataFrame, axis: Axis) -> float:
    """Return a dB on the axis, or an eighth of a linear one's range."""
    if axis.is_logarithmic:
        return 1 / 20
    return float(np.ptp(rows["level_vpp"].to_numpy(float))) / 8 or 1.0


def drift_steps(rows: pd.DataFrame, axis: Axis, alternatives: int) -> float:
    """Return by how many steps the threshold of a session rises, most likely with weak priors.

    One psychometric function whose threshold is that of its condition and rises in a straight line;
    its width has the prior of a single fit, the drift a normal one of 10 steps.
    """
    from scipy.optimize import minimize

    x = axis.on_axis(rows["level_vpp"].to_numpy(float)) / _step(rows, axis)
    condition, _ = pd.factorize(rows["condition"].astype(str))
    order = rows["trial"].rank().to_numpy()
    t = (order - order.min()) / max(np.ptp(order), 1.0) - 0.5
    hit = rows["response"].astype(object).eq(rows["side"].astype(object)).to_numpy()
    offered = rows["none_offered"].astype("boolean").fillna(value=False).all()
    guess = _GUESS_WITH_NONE if offered else 1 / alternatives
    middle = float(np.median(x))

    def cost(values: Floats) -> float:
        steps, log_sigma, mu = values[0], values[1], values[2:]
        z = (x - mu[condition] - steps * t) * math.exp(-log_sigma)
        p = guess + (1 - guess - _LAPSE) * ndtr(z)
        likelihood = np.log(np.where(hit, p, 1 - p)).sum()
        width = (log_sigma - math.log(2.0)) / math.log(2.5)
        prior = steps**2 / 200 + width**2 / 2 + ((mu - middle) ** 2).sum() / 800
        return float(prior - likelihood)

    start = np.array([0.0, math.log(2.0), *[middle] * (int(condition.max()) + 1)])
    return float(minimize(cost, start, method="BFGS").x[0])
