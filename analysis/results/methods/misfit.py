"""Which fitted functions the counts refuse, for the warnings and for the methods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from analysis.thresholds.fit import WITH_THRESHOLD

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd


REFUSED_P: Final = 0.01
"""A function with a smaller p does not fit.

Every such function is named, however many there are, and how many of so many fall below it by
chance stands beside: a correction for their number would hide one bad fit among many people.
"""
_NAMED: Final = 6
_FEW: Final = 2


def misfits(thresholds: pd.DataFrame) -> Iterator[str]:
    """Yield a warning where functions do not fit.

    >>> import pandas as pd
    >>> rows = [("1", 0.3), ("2", 0.004), ("3", float("nan"))]
    >>> table = pd.DataFrame(rows, columns=["participant", "deviance_p"]).assign(condition="main")
    >>> print(*misfits(table))  # doctest: +ELLIPSIS
    1 of 2 psychometric functions does not fit (bootstrap p < 0.01; 0.02 expected by chance):
    participant 2, p = 0.004. See its residuals: ...
    """
    fits, refused = _refused(thresholds)
    if not refused:
        return
    some = len(refused) > 1
    yield (
        f"{len(refused)} of {len(fits)} psychometric functions {'do' if some else 'does'} not fit "
        f"(bootstrap p < {REFUSED_P:g}; {REFUSED_P * len(fits):.2g} expected by chance): "
        f"{_names(refused, thresholds)}. See {'their' if some else 'its'} residuals: answers that "
        "drift or hang together, or keys and levels that changed, make a threshold's interval too "
        "narrow"
    )


def misfit_words(thresholds: pd.DataFrame) -> str:
    """Say how the test of the fits came out; empty text where nothing was tested."""
    fits, refused = _refused(thresholds)
    if not len(fits):
        return ""
    of = f"{len(fits)} function{'' if len(fits) == 1 else 's'}"
    if not refused:
        least = thresholds[thresholds["deviance_p"].eq(fits.min())].iloc[0]
        who = _where(least["participant"], least["condition"], thresholds)
        smallest = f"smallest p = {_p(fits.min())}, {who}"
        return f"It refused none of {of} at p < {REFUSED_P:g} ({smallest})."
    return (
        f"It refused {len(refused)} of {of} at p < {REFUSED_P:g} ({_names(refused, thresholds)})."
    )


def lapses_words(thresholds: pd.DataFrame) -> str:
    """Say how many functions are likeliest at the largest lapse rate; empty text where none is.

    >>> import pandas as pd
    >>> table = pd.DataFrame({"status": ["ok", "lapse_at_bound", "flat"], "participant": [*"ABC"]})
    >>> print(lapses_words(table.assign(condition="main")))
    1 of 2 functions fits best at the largest lapse rate allowed, 10 % (status "lapse at bound",
    participant B)
    """
    fitted = thresholds["status"].isin(WITH_THRESHOLD).sum()
    rows = thresholds[thresholds["status"].eq("lapse_at_bound")]
    if rows.empty:
        return ""
    some, fit = "" if fitted == 1 else "s", "fits" if len(rows) == 1 else "fit"
    who = [_where(one.participant, one.condition, thresholds) for one in rows.itertuples()]
    named = f", {'; '.join(who)}" if len(who) <= _FEW else ""
    return (
        f"{len(rows)} of {fitted} function{some} {fit} best at the largest lapse rate allowed, "
        f'10 % (status "lapse at bound"{named})'
    )


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
        f"{_where(who, condition, thresholds)}, p = {_p(p)}"
        for p, who, condition in refused[:_NAMED]
    ]
    more = len(refused) - len(told)
    return "; ".join([*told, f"and {more} more"] if more else told)


def _p(value: float) -> str:
    return f"{value:.3f}" if value < 2 * REFUSED_P else f"{value:.2f}"
