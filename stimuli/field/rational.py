"""A sweep as quotients through few solved frequencies, equation (77).

The field of a finite plate is the sum of its modes: at every point a quotient with the same
poles, the resonances. Where loss keeps these off the axis, the quotient through a few more
frequencies than there are resonances is the field, whatever the number of frequencies asked.
Which ones are solved is found on the way: the next are those at which the last two quotients
differ most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.source import Answered

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real

    _Rows = NDArray[np.intp]
    _Solve = Callable[[_Rows], Answered]
    _Groups = tuple[slice, ...]


FEWEST: Final = 10
"""Frequencies that are solved to begin with, beyond one for each resonance."""

PER_RESONANCE: Final = 1.5
"""Solved frequencies that a resonance takes in the end, about; the smooth rest takes `FEWEST`."""

_FIT: Final = 0.1
"""Part of the wanted error to which a quotient must hold at the frequencies solved."""

_AGREED: Final = 0.25
"""Part of the wanted error below which two quotients, and new values, count as the same."""

_FEW, _ALIKE = 6, 2
"""Fewer columns than so many may agree by chance: so often they must, and frequencies in gaps are
solved too."""

_CAUTION: Final = 4.0
"""What the difference of the last two quotients is multiplied with as an estimate of the error."""

_MOST: Final = 2.2
"""Times the number of frequencies solved to begin with, above which a band is halved."""

_NULL: Final = 1e-3
_FAINTEST: Final = 1e-3
"""Part of the wanted error below which a combination of columns is left out of the fit."""

_TINIEST: Final = 1e-300


def swept(
    place: Real, solve: _Solve, rtol: float, *, first: int, least: int, groups: _Groups
) -> tuple[Answered, _Rows]:
    """Return the field at increasing places, and which of them were solved.

    Parameters
    ----------
    place : ndarray of float64, shape (n,)
        Where the field is wanted, in what it is rational in.
    solve : callable
        Returns the field at some of the places, (n_some, n_columns).
    rtol : float
        Wanted error as a part of each value, or of a thousandth of the largest of its group.
    first : int
        Number of places solved to begin with.
    least : int
        Number of places, the lowest, that are solved only where no quotient tells of them.
    groups : tuple of slice
        Columns that have one unit.

    Examples
    --------
    Two resonances at two hundred places:

    >>> def field(rows):
    ...     z = place[rows, np.newaxis]
    ...     value = 1 / (z - 0.3 + 0.01j) + [1.0, 2.0] / (z - 0.7 + 0.01j)
    ...     return Answered(value=value, error=0 * abs(value))
    >>> place = np.linspace(0.0, 1.0, 200)
    >>> found, solved = swept(place, field, 1e-6, first=6, least=0, groups=(slice(None),))
    >>> true = field(np.arange(200)).value
    >>> solved.size < 12, bool(np.all(abs(found.value - true) < 1e-6 * abs(true)))
    (True, True)
    """
    rows = least + _spread(place[least:], first)
    known = _Known(rows=rows, value=(start := solve(rows)).value, error=start.error)
    value = np.zeros((place.size, known.value.shape[1]), dtype=np.complex128)
    error, solved = np.zeros(value.shape), [np.array([], dtype=np.intp)]
    parts = [(0, place.size, known)]
    while parts:
        lowest, stop, known = parts.pop()
        count = stop - lowest
        band = _Band(
            place=place[lowest:stop],
            lowest=lowest,
            least=max(least - lowest, 0),
            solve=solve,
            rtol=rtol,
            groups=groups,
        )
        known, found = band.settled(known, min(_MOST * first, count / 2))
        if found is None and count > 4 * FEWEST:
            # of a narrower band what is small stands beside less that is large
            middle = int(np.median(known.rows)) + 1
            parts.append((lowest, lowest + middle, known.among(0, middle)))
            parts.append((lowest + middle, stop, known.among(middle, count)))
            continue
        if found is None:
            known = band.more(known, np.setdiff1d(np.arange(count), known.rows))
            found = known.in_order()
        value[lowest:stop], error[lowest:stop] = found.value, found.error
        solved.append(known.rows + lowest)
    return Answered(value=value, error=error), np.concatenate(solved)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Known:
    """What has been solved of a band."""

    rows: _Rows  # which of its places: (n_solved,)
    value: Complex
    error: Real

    def among(self, start: int, stop: int) -> _Known:
        """Return what lies in a part of the band, counted from there."""
        some = (self.rows >= start) & (self.rows < stop)
        return _Known(rows=self.rows[some] - start, value=self.value[some], error=self.error[some])

    def in_order(self) -> Answered:
        """Return the values by rows."""
        order = np.argsort(self.rows)
        return Answered(value=self.value[order], error=self.error[order])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Band:
    """Places of which one quotient is sought."""

    place: Real
    lowest: int  # which of all the places is its first
    least: int  # places, the lowest, that are better not solved
    solve: _Solve
    rtol: float
    groups: _Groups

    def more(self, known: _Known, rows: _Rows) -> _Known:
        """Return what is known with some more rows."""
        if not rows.size:
            return known
        part = self.solve(rows + self.lowest)
        return _Known(
            rows=np.append(known.rows, rows),
            value=np.concatenate([known.value, part.value]),
            error=np.concatenate([known.error, part.error]),
        )

    def settled(self, known: _Known, most: float) -> tuple[_Known, Answered | None]:
        """Return what was solved and the field at all places; none beyond `most` solved ones."""
        before: Complex | None = None
        supports: list[int] = []
        agreed = 0
        while FEWEST // 2 < known.rows.size <= most:
            place, value = self.place[known.rows], known.value
            quotient = _grown(place, value, supports, self.rtol, self.groups)
            found = quotient.at(place, value, self.place)
            found[known.rows] = value
            apart = self._apart(found, before)
            agreed = agreed + 1 if np.max(apart) < _AGREED * self.rtol else 0
            if agreed >= (_ALIKE if quotient.rank < _FEW else 1):
                error = self._told(known, apart + quotient.missed) * _sizes(found, self.groups)
                error[known.rows] = known.error
                return known, Answered(value=found, error=error)
            before, supports = found, quotient.supports
            known = self.more(known, self._next(known.rows, apart, gaps=quotient.rank < _FEW))
        return known, None

    def _apart(self, found: Complex, before: Complex | None) -> Real:
        """Return the greatest relative difference at each place."""
        if before is None:
            return np.full(found.shape[0], np.inf)
        return _relative(np.abs(found - before), found, self.groups)

    def _next(self, rows: _Rows, apart: Real, *, gaps: bool) -> _Rows:
        """Return where to solve next: where the difference is greatest, not side by side.

        With `gaps` the second is as far as can be from all that were solved.
        """
        known = self.place[rows]
        found: list[int] = []
        away = np.min(np.abs(self.place[:, np.newaxis] - known), axis=1)
        ways = [away if np.all(np.isinf(apart)) else apart.copy()]
        ways.append(away if gaps else ways[0])
        for way in ways:
            way[rows] = way[: self.least] = -1.0
            for row in found:
                way[np.abs(self.place - self.place[row]) < away[row] / 2] = -1.0
            found.append(int(np.argmax(way)))
        return np.setdiff1d(np.array(found, dtype=np.intp), rows)

    def _told(self, known: _Known, apart: Real) -> Real:
        """Return the relative error told: the greatest between the nearest four solved places."""
        order = np.argsort(known.rows)
        which = np.searchsorted(known.rows[order], np.arange(apart.size))
        most = np.zeros(order.size + 1)
        np.maximum.at(most, which, _CAUTION * apart)
        solved = _relative(known.error, known.value, self.groups)
        most[:-1] = np.maximum(most[:-1], solved[order])
        most = np.pad(most, 1)
        widest = np.maximum(np.maximum(most[:-2], most[2:]), most[1:-1])
        return np.asarray(widest[which, np.newaxis])


def _spread(place: Real, count: int) -> _Rows:
    """Return some of the places, denser towards the ends of the interval."""
    turn = np.cos(np.linspace(math.pi, 0.0, count))
    wanted = place[0] + (place[-1] - place[0]) * (turn + 1) / 2
    return np.unique(np.clip(np.searchsorted(place, wanted), 0, place.size - 1))


def _sizes(value: Complex, groups: _Groups) -> Real:
    """Return what each value's error is a part of."""
    size = np.abs(value)
    for group in groups:
        floor = _NULL * np.max(size[:, group], axis=1, keepdims=True)
        size[:, group] = np.maximum(size[:, group], np.maximum(floor, _TINIEST))
    return size


def _relative(error: Real, value: Complex, groups: _Groups) -> Real:
    return np.asarray(np.max(error / _sizes(value, groups), axis=1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Quotient:
    """A rational function in barycentric form, with values at its supports."""

    supports: list[int]  # which of the solved places
    weights: Complex
    rank: int  # of the values it is fitted to
    missed: float = 0.0  # greatest relative error at the solved places that are no supports

    def at(self, solved: Real, value: Complex, place: Real) -> Complex:
        """Return its values at places."""
        apart = place[:, np.newaxis] - solved[self.supports]
        met = apart == 0
        terms = self.weights / np.where(met, 1.0, apart)
        terms[np.any(met, axis=1)] = 0.0
        terms[met] = 1.0
        found: Complex = terms / np.sum(terms, axis=1, keepdims=True) @ value[self.supports]
        return found


def _grown(
    place: Real, value: Complex, supports: list[int], rtol: float, groups: _Groups
) -> _Quotient:
    """Return a quotient that holds at all solved places, from more supports than before.

    Nakatsukasa, Sete, Trefethen 2018 (AAA), of all columns at once.
    """
    sizes = _sizes(value, groups)
    fitted = _combined(value, sizes, rtol)
    supports = list(supports) or [0, place.size - 1]
    while True:
        others = np.setdiff1d(np.arange(place.size), supports)
        weights = _weights(place, fitted, supports, others)
        quotient = _Quotient(supports=supports, weights=weights, rank=fitted.shape[1])
        missed = np.abs(quotient.at(place, value, place[others]) - value[others])
        worst = np.max(missed / sizes[others], axis=1)
        spare = (others.size - 1) * fitted.shape[1] - len(supports) - 1
        if np.max(worst) < _FIT * rtol or spare < 0 or others.size <= max(2, place.size // 8):
            return replace(quotient, missed=float(np.max(worst)))
        supports = [*supports, int(others[np.argmax(worst)])]


def _combined(value: Complex, sizes: Real, rtol: float) -> Complex:
    """Return combinations of the columns that count."""
    u, s, _ = np.linalg.svd(value * np.mean(1 / sizes, axis=0), full_matrices=False)
    kept = s >= _FAINTEST * rtol * s[0]
    return np.asarray(u[:, kept] * s[kept], dtype=np.complex128)


def _weights(place: Real, value: Complex, supports: list[int], others: _Rows) -> Complex:
    """Return the barycentric weights with the least error at the other places."""
    apart = place[others, np.newaxis] - place[supports]
    size = np.linalg.norm(value[others], axis=1)[:, np.newaxis]
    change = value[others, :, np.newaxis] - value[supports].T
    rows = change / (apart * np.maximum(size, _TINIEST))[:, np.newaxis]
    rows = rows.reshape(-1, len(supports))
    if rows.shape[0] > rows.shape[1]:
        rows = np.linalg.qr(rows, mode="r")
    return np.asarray(np.conj(np.linalg.svd(rows)[2][-1]))
