"""Which fitted functions the counts refuse, for the warnings and for the methods."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.special import ndtr

from analysis.axis import VOLTS, half_up, shortest
from analysis.definitions import LAPSES_ERROR
from analysis.thresholds.fit import WITH_THRESHOLD
from analysis.thresholds.goodness import REPLICATES, deviance_residuals
from analysis.thresholds.people import FORCED_CHOICE

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd

    from analysis.axis import Axis
    from analysis.thresholds.people import PersonCounts


REFUSED_P: Final = 0.01
"""A function with a smaller p does not fit.

Every such function is named, however many there are, and how many of so many fall below it by
chance stands beside: a correction for their number would hide one bad fit among many people.
"""
_LEAST_P: Final = 1 / (1 + REPLICATES)
_WITHOUT: Final = (
    " methods.txt names {}; the group's results without misfits and drifts stand in the answer's "
    "table, to be reported beside the others, not instead."
)
_NAMED: Final = 6
_APART: Final = 0.03
"""Guess rates that differ by less leave the residuals of the function drawn much as tested."""
_FEW: Final = 2
_BY: Final = {
    "blanks": "that blank trials tell",
    "few blanks": "that blank trials tell",
    "assumed": "assumed",
    FORCED_CHOICE: "of guessing",
}
_MOST, _FEW_LEVELS = 0.8, 4
_SEVERAL, _OFTEN = 5, 0.3


def misfits(
    thresholds: pd.DataFrame, people: PersonCounts | None = None, axis: Axis = VOLTS
) -> Iterator[str]:
    """Yield a warning where functions do not fit, and where they do not if their counts are told.

    >>> import pandas as pd
    >>> rows = [("1", 0.3), ("2", 0.004), ("3", float("nan"))]
    >>> table = pd.DataFrame(rows, columns=["participant", "deviance_p"]).assign(condition="main")
    >>> print(*misfits(table))  # doctest: +ELLIPSIS
    1 of 2 psychometric functions does not fit (bootstrap p < 0.01; 0.02 expected by chance):
    participant 2, p = 0.004. Look at its residuals, ...
    """
    fits, refused = _refused(thresholds)
    if not refused:
        return
    some = len(refused) > 1
    alone = len({*thresholds["participant"]}) == 1
    where = (
        "at the foot of the figure of detection"
        if alone
        else "below the panels of the figure of participants"
    )
    yield (
        f"{len(refused)} of {len(fits)} psychometric functions {'do' if some else 'does'} not fit "
        f"(bootstrap p < {REFUSED_P:g}; {REFUSED_P * len(fits):.2g} expected by chance): "
        f"{_names(refused, thresholds)}. Look at {'their' if some else 'its'} residuals, "
        f"{where}: answers that drift or hang together, or keys, levels and criteria that "
        "changed, make a threshold's interval too narrow."
        + "".join(_most_apart(thresholds, refused, people, axis) if people else ())
        + "".join(_held(thresholds, refused))
        + _without(thresholds)
    )


def _without(thresholds: pd.DataFrame) -> str:
    """Say where results without misfits stand; empty text where too few people are left."""
    misfits_of = misfitting(thresholds)
    if len({*thresholds["participant"]} - misfits_of) <= 1:
        return ""
    return _WITHOUT.format("this one" if len(misfits_of) == 1 else "them")


def _most_apart(
    thresholds: pd.DataFrame,
    refused: list[tuple[float, str, str]],
    people: PersonCounts,
    axis: Axis,
) -> Iterator[str]:
    """Say at which levels most of the tested function's deviance is."""
    for _, who, condition in refused[:_NAMED]:
        row = _row(thresholds, who, condition)
        at = people.names.index((condition, who))
        used = people.presented[at] > 0
        levels, k, n = (
            of[at, used] for of in (people.level_vpp, people.detected, people.presented)
        )
        far = axis.on_axis(levels) - axis.on_axis(float(row["mle_threshold_vpp"]))
        guess, lapse = float(row["guess_rate"]), float(row["mle_lapse_rate"])
        p = guess + (1 - guess - lapse) * ndtr(far * axis.width(1.0) / float(row["mle_sigma"]))
        size = np.abs(deviance_residuals(k, n, p))
        order = np.argsort(-size, kind="stable")
        part = np.cumsum(size[order] ** 2) / np.sum(size**2)
        worst = order[: min(int(np.searchsorted(part, _MOST)) + 1, _FEW_LEVELS)]
        told = "; ".join(
            f"at {shortest(levels[i])} {axis.unit} detected in {k[i]:.0f} of {n[i]:.0f} trials, "
            f"expected in {n[i] * p[i]:.1f}"
            for i in sorted(worst, key=lambda i: levels[i])
        )
        yield (
            f" Of {_where(who, condition, thresholds)} most of the deviance from the likeliest "
            f"function with the guess rate {_BY.get(str(row.get('guess_basis')), 'held')}: {told}."
        )


def _row(thresholds: pd.DataFrame, who: str, condition: str) -> pd.Series[Any]:
    one = thresholds["participant"].eq(who) & thresholds["condition"].eq(condition)
    return thresholds[one].iloc[0]


def _held(thresholds: pd.DataFrame, refused: list[tuple[float, str, str]]) -> Iterator[str]:
    """Say where the function drawn starts higher than the tested one, so that it shows no misfit.

    The test holds the guess rate at what blank trials tell; the function drawn takes weak levels.
    """
    if "guess_posterior" not in thresholds:
        return
    for _, who, condition in refused[:_NAMED]:
        row = _row(thresholds, who, condition)
        held, drawn = float(row["guess_rate"]), float(row["guess_posterior"])
        if drawn - held > _APART:
            yield (
                f" Of {_where(who, condition, thresholds)} the test holds the guess rate at "
                f"{100 * held:.1f} %, as blank trials tell it; the function drawn starts at "
                f"{100 * drawn:.1f} %, by the weak levels too: there the misfit shows less."
            )


def misfitting(thresholds: pd.DataFrame) -> set[str]:
    """Return the participants with a function that does not fit."""
    return {who for _, who, _ in _refused(thresholds)[1]}


def misfit_words(thresholds: pd.DataFrame) -> str:
    """Say how the test of the fits came out; empty text where nothing was tested."""
    fits, refused = _refused(thresholds)
    if not len(fits):
        return ""
    of = f"{len(fits)} function{'' if len(fits) == 1 else 's'}"
    if not refused:
        least = thresholds[thresholds["deviance_p"].eq(fits.min())].iloc[0]
        who = _where(least["participant"], least["condition"], thresholds)
        smallest = f"smallest {_p_words(float(fits.min()))}, {who}"
        told = f"It refused none of {of} at p < {REFUSED_P:g} ({smallest})."
    else:
        names = _names(refused, thresholds)
        told = f"It refused {len(refused)} of {of} at p < {REFUSED_P:g} ({names})."
    steep = steep_words(thresholds)
    return f"{told} {steep[0].upper()}{steep[1:]}." if steep else told


def lapses_words(thresholds: pd.DataFrame) -> str:
    """Say how many functions are likeliest at the largest lapse rate; empty text where none is.

    >>> import pandas as pd
    >>> table = pd.DataFrame({"status": ["ok", "lapse_at_bound", "flat"], "participant": [*"ABC"]})
    >>> print(lapses_words(table.assign(condition="main")))
    1 of 2 functions with a threshold fits best at the largest lapse rate allowed, 10 % (status
    "lapse at bound", participant B)
    """
    fitted = thresholds["status"].isin(WITH_THRESHOLD).sum()
    rows = thresholds[thresholds["status"].eq("lapse_at_bound")]
    if rows.empty:
        return ""
    of = _functions(fitted, thresholds)
    fit = "fits" if len(rows) == 1 else "fit"
    return (
        f"{len(rows)} of {of} {fit} best at the largest lapse rate allowed, "
        f'10 % (status "lapse at bound"{_named(rows, thresholds)})'
    )


def lapses_for_paper(thresholds: pd.DataFrame) -> str:
    """Say the same, and of a large share what it means for the group."""
    told = lapses_words(thresholds)
    return f"{told}; {LAPSES_ERROR}" if told and at_bound_often(thresholds) else told


def at_bound_often(thresholds: pd.DataFrame) -> bool:
    """Tell whether the largest lapse rate is the likeliest in many of several functions."""
    fitted = thresholds.loc[thresholds["status"].isin(WITH_THRESHOLD), "status"]
    return len(fitted) >= _SEVERAL and fitted.eq("lapse_at_bound").mean() >= _OFTEN


def steep_words(thresholds: pd.DataFrame) -> str:
    """Say how many functions rise in one step, and what follows; empty text where none does.

    >>> import pandas as pd
    >>> table = pd.DataFrame({"status": ["ok", "separated", "flat"], "participant": [*"ABC"]})
    >>> print(steep_words(table.assign(condition="main")))
    1 of 2 functions with a threshold rises in one step (status "separated", participant B): it
    cannot be tested for fit, and the interval of its threshold rests on the prior of the slope
    """
    fitted = thresholds["status"].isin(WITH_THRESHOLD).sum()
    rows = thresholds[thresholds["status"].eq("separated")]
    if rows.empty:
        return ""
    one = len(rows) == 1
    it, its = ("it", "its threshold") if one else ("they", "their thresholds")
    return (
        f"{len(rows)} of {_functions(fitted, thresholds)} rise{'s' if one else ''} in "
        f'one step (status "separated"{_named(rows, thresholds)}): {it} cannot be tested for fit, '
        f"and the interval{'' if one else 's'} of {its} rest{'s' if one else ''} on the prior of "
        "the slope"
    )


def _functions(number: int, thresholds: pd.DataFrame) -> str:
    """Say how many functions these are, and why not all where some are not among them."""
    told = f"{number} function{'' if number == 1 else 's'}"
    return told if number == len(thresholds) else f"{told} with a threshold"


def _named(rows: pd.DataFrame, thresholds: pd.DataFrame) -> str:
    """Name whose functions these are, where they are few."""
    who = [_where(one.participant, one.condition, thresholds) for one in rows.itertuples()]
    return f", {'; '.join(who)}" if len(who) <= _FEW else ""


def _refused(thresholds: pd.DataFrame) -> tuple[pd.Series[Any], list[tuple[float, str, str]]]:
    """Return p of all that were tested; p, participant, condition of the refused, least first."""
    fits = thresholds["deviance_p"].dropna()
    rows = thresholds.loc[fits.index[fits.lt(REFUSED_P)]]
    names = zip(rows["deviance_p"], rows["participant"], rows["condition"], strict=True)
    return fits, sorted((float(p), str(who), str(condition)) for p, who, condition in names)


def _where(participant: object, condition: object, thresholds: pd.DataFrame) -> str:
    several = len({*thresholds["condition"]}) > 1
    return f"participant {participant}{f' in condition {condition}' if several else ''}"


def _names(refused: list[tuple[float, str, str]], thresholds: pd.DataFrame) -> str:
    told = [
        f"{_where(who, condition, thresholds)}, {_p_words(p)}"
        for p, who, condition in refused[:_NAMED]
    ]
    more = len(refused) - len(told)
    words = "; ".join([*told, f"and {more} more"] if more else told)
    least = f"; {_LEAST_P:.3f} is the least that {REPLICATES} tables can show"
    return f"{words}{least if refused[0][0] <= _LEAST_P else ''}"


def misfit_p_text(value: float) -> str:
    """Return a bootstrap's p for a table, n/a where there is none.

    >>> misfit_p_text(1 / 500), misfit_p_text(float("nan"))
    ('<= 0.002', 'n/a')
    """
    return "n/a" if math.isnan(value) else "<= " * (value <= _LEAST_P) + half_up(value, 3)


def _p_words(value: float) -> str:
    """Write a bootstrap's p; the least that it can be is a bound.

    >>> _p_words(1 / 500), _p_words(0.004), _p_words(0.25)
    ('p <= 0.002', 'p = 0.004', 'p = 0.25')
    """
    if value <= _LEAST_P:
        return f"p <= {_LEAST_P:.3f}"
    return f"p = {value:.3f}" if value < 2 * REFUSED_P else f"p = {value:.2f}"
