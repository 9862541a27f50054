"""A scene as oscillators: the modes of its plate, driven by its loads, and the static rest."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss

from stimuli.drive.sampled import SampledDrive
from stimuli.field.field import displacement
from stimuli.load import DISCS
from stimuli.motion.modes import Modes, n_waves, plate_modes
from stimuli.motion.oscillators import Oscillators, poles
from stimuli.motion.standing_waves import Waves, strip_waves, wavenumber_rad_m
from stimuli.strip.edge import ElasticEdge

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.load import Load
    from stimuli.strip.strip import Strip


_STATIC_RTOL: Final = 1e-5
_PERIODS: Final = 200.0
_SPANS: Final = 8.0
"""An endless strip repeats itself after so many widths, or distances of points and loads."""

_FEWEST, _MORE = 8.0, 1.75
"""Modes are kept up to such a multiple of the first cut-off; if that is not enough, to more."""

_IMAGES: Final = 3.0, 1.5
"""A sample rate below so many times the highest mode, and up to where modes are kept then."""

MOST_WAVES: Final = 1500
"""Waves of one symmetry in which modes are sought: with more, spectra are faster."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """A scene as oscillators.

    Attributes
    ----------
    oscillators : Oscillators
        All that are kept.
    late : ndarray of float64, shape (n_poles,)
        Weights of the oscillators in an estimate of the error: 1 for those of the upper half
        octave, whose inertia counts for more than that of all above them.
    turned : ndarray of float64, shape (n_poles,)
        The same for the length after which an endless strip repeats itself: 1 and -1 by turns,
        which gives what comes round after half of it; none for a plate with ends.
    reference_hz : float
        The first cut-off, or the upper edge of the drive's band if that is higher.
    highest_hz : float
        Up to where it has modes.
    viscous_s : float
        Relaxation time of the plate: what follows at once does so as late as this.
    """

    oscillators: Oscillators
    late: NDArray[np.bool_]
    turned: Real | None
    reference_hz: float
    highest_hz: float
    viscous_s: float


def motions(scene: Scene, drive: Drive) -> Iterator[Motion]:
    """Yield a scene as oscillators for a drive, then with more of them; none if too many."""
    reference_hz = reference_of(scene, drive)
    for multiple in _multiples(drive, reference_hz):
        if n_waves(scene.strip, multiple * reference_hz) > MOST_WAVES:
            return
        yield motion_of(scene, reference_hz, multiple)


def reference_of(scene: Scene, drive: Drive) -> float:
    """Return the first cut-off, or the upper edge of the drive's band if that is higher."""
    return max(scene.strip.cutoff_hz(), drive.band_hz()[1])


def _multiples(drive: Drive, reference_hz: float) -> tuple[float, float]:
    """Return up to which multiples of a frequency modes are kept, and if need be, after all.

    The images of samples about their rate would make modes just above the highest one swing.
    """
    least = _FEWEST
    if isinstance(drive, SampledDrive):
        near, reach = _IMAGES
        rate = drive.sample_rate_hz / reference_hz
        least = max(least, reach * rate) if rate < near * least else least
    return least, _MORE * least


@lru_cache(maxsize=4)
def motion_of(scene: Scene, reference_hz: float, multiple: float) -> Motion:
    """Return a scene as oscillators.

    Parameters
    ----------
    scene : Scene
        Strip, loads and points; a loss must be viscous.
    reference_hz : float
        The first cut-off, or the upper edge of the drive's band if that is higher.
    multiple : float
        Modes above so many times that frequency follow their load at once.
    """
    strip, highest_hz = scene.strip, multiple * reference_hz
    bare = _bare(dataclasses.replace(scene, strip=_without_loss(strip)), highest_hz)
    has_loss = not (isinstance(strip.edge, ElasticEdge) and strip.edge.lossless)
    found, at_points, of_loads = [], [], []
    for group, moved, pushed in zip(bare.groups, bare.moved, bare.pushed, strict=True):
        bent = group.squared if has_loss else group.bent
        some, modes, drives = poles(group.squared, bent, strip.material.viscous_time_s)
        found.append(some)
        at_points.append(moved @ modes)
        of_loads.append(pushed @ drives.T)
    oscillators = Oscillators(
        poles=np.concatenate(found),
        at_points=np.concatenate(at_points, axis=2),
        of_loads=np.concatenate(of_loads, axis=2),
        rest_m=bare.static_m,
    )
    alone_m = [
        (oscillators.weights(load) / -oscillators.poles).sum(axis=1).real
        for load in range(len(scene.loads))
    ]
    turned = [group.turned for group in bare.groups if isinstance(group, Waves)]
    return Motion(
        oscillators=dataclasses.replace(oscillators, rest_m=bare.static_m - alone_m),
        late=np.abs(oscillators.poles) > 2 * math.pi * highest_hz / math.sqrt(2),
        turned=np.concatenate(turned) if turned else None,
        reference_hz=reference_hz,
        highest_hz=highest_hz,
        viscous_s=strip.material.viscous_time_s,
    )


class _Bare(NamedTuple):
    """What of a scene does not depend on its loss."""

    groups: Sequence[Modes | Waves]
    moved: list[Real]  # of each group the modes at the points, (n_copies, n_points, n_modes)
    pushed: list[Real]  # what the loads do to them, (n_copies, n_loads, n_modes)
    static_m: Real  # (n_loads, n_points)


@lru_cache(maxsize=4)
def _bare(scene: Scene, highest_hz: float) -> _Bare:
    """Return the same for every loss: a study that states none is computed with three."""
    strip = scene.strip
    centred = all(load.y_m == strip.width_m / 2 for load in scene.loads)
    groups: Sequence[Modes | Waves]
    if strip.length_m is None:
        groups = strip_waves(strip, highest_hz, _period_m(scene), centred=centred)
    else:
        groups = plate_modes(strip, highest_hz, centred=centred)
    points_m = np.array(scene.points_m)
    most_rad_m = wavenumber_rad_m(strip, highest_hz)
    nodes = [_nodes(load, most_rad_m) for load in scene.loads]
    driven = scene.driven or (True,) * len(scene.loads)
    pushed = [
        np.stack(
            [
                on * np.einsum("n,cnm->cm", weights, group.at(nodes_m, laplacian=load.is_moment))
                for on, load, (nodes_m, weights) in zip(driven, scene.loads, nodes, strict=True)
            ],
            axis=1,
        )
        for group in groups
    ]
    return _Bare(
        groups=groups,
        moved=[group.at(points_m) for group in groups],
        pushed=pushed,
        static_m=displacement(scene, [0.0], _STATIC_RTOL)[0].real,
    )


def _without_loss(strip: Strip) -> Strip:
    lossless = dataclasses.replace(strip.material, loss_factor=0.0, viscous_time_s=0.0)
    return dataclasses.replace(strip, material=lossless)


def _period_m(scene: Scene) -> float:
    """Return after which length an endless strip is taken to repeat itself."""
    places = [x for x, _ in scene.points_m] + [load.x_m for load in scene.loads]
    return max(_PERIODS * scene.strip.width_m, _SPANS * (max(places) - min(places)))


def _nodes(load: Load, most_rad_m: float) -> tuple[Real, Real]:
    """Return places and weights that sum waves over a load: (n, 2) and (n,)."""
    half_x_m, half_y_m = load.half_size_m
    if not half_x_m:
        return np.array([[load.x_m, load.y_m]]), np.ones(1)
    n = 10 + math.ceil(most_rad_m * max(half_x_m, half_y_m))
    nodes, weights = leggauss(n)
    if isinstance(load, DISCS):
        reach = half_x_m * (nodes + 1) / 2
        angle = 2 * math.pi / (2 * n) * np.arange(2 * n)
        x, y = np.multiply.outer(reach, np.cos(angle)), np.multiply.outer(reach, np.sin(angle))
        share = np.multiply.outer(weights * reach * half_x_m / 2, np.full(2 * n, math.pi / n))
    else:
        x, y = np.meshgrid(half_x_m * nodes, half_y_m * nodes)
        share = np.multiply.outer(weights, weights) * half_x_m * half_y_m / load.area_m2
    return np.stack([load.x_m + x.ravel(), load.y_m + y.ravel()], axis=1), share.ravel()
