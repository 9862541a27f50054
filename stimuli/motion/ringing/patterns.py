"""How oscillators move many points near each other: by few shapes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.motion.motion import Motion


_CHECKED: Final = 7
"""The error is estimated at every so many points."""

_FEWEST: Final = 16
_LEFT: Final = 1e-11
"""Shapes that are a smaller part of the largest one are left out: at quiet fingers displacements
are 1e-6 of what each oscillator does there."""

_SEED: Final = 1


class Field(NamedTuple):
    """How poles move shapes; the last is that of what follows the drive and lags a little."""

    strengths: Complex  # (n_shapes, n_poles)
    some: NDArray[np.intp]  # numbers of the poles that do anything


class Watched(NamedTuple):
    """Points whose largest displacement under a load is looked for, in several versions.

    These are all points; and with the error fewer points, as they are, and with each of what is
    doubted added and taken off.
    """

    rows: Real  # shapes at the points, all orthogonal to each other: (n_points, n_shapes)
    fields: list[Field]  # of the displacement, and of what is doubted
    sizes: Real  # how far each pole moves any of the points at most, (n_versions, n_poles)
    load: int

    def versions(self, shapes: Sequence[Real]) -> list[Real]:
        """Return the displacements of all versions: (n_points, n_times) each.

        `shapes` are how far each field moves the shapes, (n_shapes, n_times).
        """
        whole_m = self.rows @ shapes[0]
        if len(self.sizes) == 1:
            return [whole_m]
        some_m, rows = whole_m[::_CHECKED], self.rows[::_CHECKED]
        doubts_m = (rows @ one for one in shapes[1:])
        both_m = ((some_m + one, some_m - one) for one in doubts_m)
        return [whole_m, some_m, *(one for pair in both_m for one in pair)]


def watched_of(
    motion: Motion, groups: Sequence[NDArray[np.intp]], lag_s: float, *, with_error: bool
) -> list[Watched]:
    """Return points of each group under each load, the loads of a group in a row.

    The last pole is that of what follows the drive, as late as is told.
    """
    return [
        _watched(motion, load, shapes, lag_s, with_error=with_error)
        for shapes in (_shapes_of(motion, points) for points in groups)
        for load in range(len(motion.oscillators.rest_m))
    ]


class _Shapes(NamedTuple):
    rows: Real  # (n_points, n_shapes)
    moving: Real | Complex  # how oscillators move shapes, (n_copies, n_shapes, n_poles)
    most: Real  # and any of the points at most, (n_copies, n_poles)
    rests_m: Real  # what follows each load at once, (n_loads, n_shapes)


def _watched(
    motion: Motion, load: int, shapes: _Shapes, lag_s: float, *, with_error: bool
) -> Watched:
    driven = motion.oscillators.of_loads[:, load]
    swings = np.einsum("csj,cj->sj", shapes.moving, driven)
    made = [(swings, shapes.rests_m[load])]
    if with_error:
        late = swings * motion.late
        made.append((late, (late / motion.oscillators.poles).sum(axis=1).real))
        if motion.turned is not None:
            made.append((swings * motion.turned, np.zeros(len(swings))))
    fields, sizes = [], []
    for swing, follows in made:
        strengths = np.concatenate([swing, follows[:, np.newaxis] / lag_s], axis=1)
        moves = np.any(strengths, axis=0)
        fields.append(Field(strengths, np.flatnonzero(moves)))
        lags = np.max(np.abs(shapes.rows @ follows)) / lag_s
        sizes.append(moves * np.append((shapes.most * np.abs(driven)).sum(axis=0), lags))
    versions = sizes[:1]
    if with_error:
        versions += [sizes[0], *(sizes[0] + one for one in sizes[1:] for _ in range(2))]
    return Watched(shapes.rows, fields, np.stack(versions), load)


def _shapes_of(motion: Motion, points: NDArray[np.intp]) -> _Shapes:
    """Return the shapes in which points move: those of slow oscillators come first."""
    oscillators = motion.oscillators
    moving, rests_m = oscillators.at_points[:, points], oscillators.rest_m[:, points]
    real = moving if np.any(moving.imag) else moving.real
    rows = _spanning(np.concatenate([*real], axis=1), rests_m)
    slow = np.argsort(np.abs(oscillators.poles))
    parts = [real.real, real.imag] if np.iscomplexobj(real) else [real]
    ordered = np.concatenate([one[:, :, slow] for one in parts]).transpose(2, 0, 1)
    columns = np.concatenate([ordered.reshape(-1, len(points)), rests_m]).T
    turned, _ = np.linalg.qr(rows.T @ columns)
    rows = rows @ turned
    return _Shapes(rows, rows.T @ real, np.abs(real).max(axis=1), rests_m @ rows)


def _spanning(moving: Real | Complex, rests_m: Real) -> Real:
    """Return few columns that span all others, orthogonal: (n_points, n_shapes).

    They span random sums of all columns; if those are more than the shapes are, nothing else is
    left. Many points do not move by many more shapes than few.
    """
    columns = [moving.real, moving.imag] if np.iscomplexobj(moving) else [moving]
    every, rng = np.concatenate(columns, axis=1), np.random.default_rng(_SEED)
    scale = np.max(np.abs(every)) / max(np.max(np.abs(rests_m)), np.finfo(np.float64).tiny)
    n_sums, rests = _FEWEST, scale * rests_m.T
    while 2 * n_sums < min(every.shape):
        sums = every @ rng.standard_normal((every.shape[1], n_sums))
        shapes = _orthogonal(np.concatenate([sums, rests], axis=1))
        if shapes.shape[1] <= n_sums:
            return shapes
        n_sums *= 2
    return _orthogonal(np.concatenate([every, rests], axis=1))


def _orthogonal(columns: Real) -> Real:
    from scipy.linalg import qr

    found, triangle, _ = qr(columns, mode="economic", pivoting=True)
    size = np.abs(np.diag(triangle))
    return np.asarray(found[:, : int(np.sum(size > _LEFT * size[0]))])
