"""A scene as oscillators: the modes of its plate, driven by its loads, and the static rest."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import takewhile
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.drive.sampled import SampledDrive
from stimuli.field.field import at_rest
from stimuli.load import DISCS
from stimuli.motion.modes import AboveFirstModeError, Modes, n_waves, plate_modes
from stimuli.motion.multiples import upwards
from stimuli.motion.oscillators import Oscillators, swung
from stimuli.motion.patches.patched import PatchedModes, has_room, patched_modes
from stimuli.motion.section import ECHOED, without_far_ends
from stimuli.motion.standing_waves import Waves, nodes_of, rim_of, strip_waves, wavenumber_rad_m
from stimuli.strip.edge import ElasticEdge
from stimuli.strip.patch import BondedPatch, Layer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.load import Load
    from stimuli.motion.multiples import Upwards
    from stimuli.motion.patches.functions import Functions
    from stimuli.strip.strip import Strip


_STATIC_RTOL: Final = 1e-5
_PERIODS: Final = 200.0
_SPANS: Final = 8.0
"""An endless strip repeats itself after so many widths, or distances of points and loads."""

_FEWEST, _MORE = 8.0, 1.75
"""Modes are kept up to such a multiple of the first cut-off; if that is not enough, to more."""

_SLOW: Final = 30.0
"""A burst so many times slower than the cut-off, as those of plates a few millimetres wide are,
moves upper modes so little that those which tell echoes may be enough."""

_PATCHED: Final = 4.0, 6.0
"""The same of a plate with patches, whose functions hold what is finer: both are needed."""

_IMAGES: Final = 3.0, 1.5
"""A sample rate below so many times the highest mode, and up to where modes are kept then."""

_COUPLED, _FEW = 4.0, 40
"""Of more modes of one symmetry those above so many times the reference exchange no loss: they
carry little to another finger, and differ in frequency by much more than by their loss."""

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
    coarser : tuple of two callables
        Return the same without the modes of the upper half octave and of the upper octave, where
        their inertia shifts the others, as it does under fingers; else empty.
    """

    oscillators: Oscillators
    late: NDArray[np.bool_]
    turned: Real | None
    reference_hz: float
    highest_hz: float
    viscous_s: float
    coarser: tuple[Callable[[], Motion], ...] = ()


def motions(scene: Scene, drive: Drive, period_m: float | None = None) -> Upwards[Motion]:
    """Yield a scene as oscillators for a drive, then with more of them; none if too many."""
    reference_hz = reference_of(scene, drive)
    asked = [*multiples_of(drive, reference_hz, scene.strip)]
    if not scene.strip.patches:
        asked.append(_MORE * asked[-1])
        if is_slow(drive, reference_hz):
            asked.insert(0, ECHOED)
    return upwards(
        enough_of(scene.strip, reference_hz, asked),
        lambda multiple, most: motion_of(scene, reference_hz, multiple, most, period_m),
    )


def is_slow(drive: Drive, reference_hz: float) -> bool:
    """Tell whether a burst is much slower than the cut-off."""
    return not isinstance(drive, SampledDrive) and _SLOW * drive.band_hz()[1] <= reference_hz


def enough_of(strip: Strip, reference_hz: float, multiples: Sequence[float]) -> list[float]:
    """Return those multiples of a frequency, up to the first, whose modes are too many.

    With patches all or none: two tell each other's error.
    """
    found = list(takewhile(lambda one: is_enough(strip, one * reference_hz), multiples))
    return [] if strip.patches and len(found) < len(multiples) else found


def is_enough(strip: Strip, highest_hz: float) -> bool:
    """Tell whether the modes up to a frequency are few enough to be sought."""
    if n_waves(strip, highest_hz) > MOST_WAVES:
        return False
    return not strip.patches or has_room(strip, highest_hz)


def reference_of(scene: Scene, drive: Drive) -> float:
    """Return the first cut-off, or the upper edge of the drive's band if that is higher."""
    return max(scene.strip.cutoff_hz(), drive.band_hz()[1])


def multiples_of(drive: Drive, reference_hz: float, strip: Strip) -> tuple[float, float]:
    """Return up to which multiples of a frequency modes are kept, and if need be, after all.

    The images of samples about their rate would make modes just above the highest one swing.
    """
    least, most = _PATCHED if strip.patches else (_FEWEST, _MORE * _FEWEST)
    if isinstance(drive, SampledDrive):
        near, reach = _IMAGES
        rate = drive.sample_rate_hz / reference_hz
        shift = max(1.0, reach * rate / least) if rate < near * least else 1.0
        least, most = shift * least, shift * most
    return least, most


@lru_cache(maxsize=4)
def motion_of(
    scene: Scene,
    reference_hz: float,
    multiple: float,
    most: float | None = None,
    period_m: float | None = None,
) -> Motion:
    """Return a scene as oscillators.

    Parameters
    ----------
    scene : Scene
        Strip, loads and points; a loss must be viscous.
    reference_hz : float
        The first cut-off, or the upper edge of the drive's band if that is higher.
    multiple : float
        Modes above so many times that frequency follow their load at once.
    most : float, optional
        The largest multiple that is going to be asked for.
    period_m : float, optional
        After which length an endless strip is taken to repeat itself.
    """
    strip, highest_hz = scene.strip, multiple * reference_hz
    lossless = dataclasses.replace(scene, strip=without_loss(strip))
    sought = lossless, highest_hz, (most or multiple) * reference_hz
    bare = bare_of(*sought, period_m)
    has_loss = springs_lose(strip)
    swings = []
    for group, moved, pushed in zip(bare.groups, bare.moved, bare.pushed, strict=True):
        bent = group.squared if has_loss else group.bent
        coupled_hz = _COUPLED * reference_hz if group.squared.size > _FEW else math.inf
        viscous_s, rows = strip.material.viscous_time_s, (moved, pushed)
        swings.append(swung(group.squared, bent, viscous_s, rows, coupled_hz=coupled_hz))
    found, at_points, of_loads = (
        np.concatenate(some, axis=-1) for some in zip(*swings, strict=True)
    )
    oscillators = Oscillators(
        poles=found, at_points=at_points, of_loads=of_loads, rest_m=bare.static_m
    )
    driven = (of_loads / -found).transpose(0, 2, 1)
    alone_m = np.sum(at_points @ driven, axis=0).real.T
    turned = [group.turned for group in bare.groups if isinstance(group, Waves)]
    return Motion(
        oscillators=dataclasses.replace(oscillators, rest_m=bare.static_m - alone_m),
        late=np.abs(oscillators.poles) > 2 * math.pi * highest_hz / math.sqrt(2),
        turned=np.concatenate(turned) if turned else None,
        reference_hz=reference_hz,
        highest_hz=highest_hz,
        viscous_s=strip.material.viscous_time_s,
    )


def steady(scene: Scene, frequency_hz: float) -> Complex:
    """Return the displacement at a frequency below the first mode: (n_loads, n_points).

    Metres per unit load, time factor exp(-i omega t): what `displacement` does for a plate that
    has no patches. A constant loss is taken as the viscous one that is the same there.

    ValueError where the plate has a mode below, or too many.
    """
    omega = 2 * math.pi * frequency_hz
    material = scene.strip.material
    viscous_s = material.viscous_time_s + material.loss_factor / omega
    viscous = dataclasses.replace(material, loss_factor=0.0, viscous_time_s=viscous_s)
    strip = dataclasses.replace(scene.strip, material=viscous)
    reference_hz = strip.cutoff_hz()
    enough = [multiple for multiple in _PATCHED if is_enough(strip, multiple * reference_hz)]
    if not enough:
        raise ValueError(f"the plate has too many modes for its patches, got {strip.length_m!r} m")
    highest_hz = enough[-1] * reference_hz
    lossless = dataclasses.replace(scene, strip=without_loss(strip))
    squared, bents, moved, pushed = (bare := bare_of(lossless, highest_hz, highest_hz)).alone()
    first_hz = math.sqrt(np.min(squared)) / (2 * math.pi)
    if frequency_hz >= first_hz:
        raise AboveFirstModeError(frequency_hz, first_hz)
    late = -1j * omega * viscous_s
    dynamic = np.diag(squared * (1 + late) - omega**2)
    if not springs_lose(strip):
        from scipy.linalg import block_diag

        dynamic = np.diag(squared - omega**2) + late * block_diag(*bents)
    swung = np.linalg.solve(dynamic, pushed.T.astype(np.complex128))
    rest_m = bare.static_m - (pushed / squared) @ moved.T
    return np.asarray((moved @ swung).T + rest_m / (1 + late))


class Bare(NamedTuple):
    """What of a scene does not depend on its loss."""

    groups: Sequence[Modes | Waves | PatchedModes]
    moved: list[Real]  # of each group the modes at the points, (n_copies, n_points, n_modes)
    pushed: list[Real]  # what the loads do to them, (n_copies, n_loads, n_modes)
    static_m: Real  # (n_loads, n_points)

    def alone(self) -> tuple[Real, list[Real], Real, Real]:
        """Return all modes in a row, cosines and sines of endless strips as modes of their own.

        Their squares, what each group bends, and modes at points and under loads: (n, n_modes).
        """
        copies = [len(moved) for moved in self.moved]
        both = list(zip(self.groups, copies, strict=True))
        moved, pushed = (
            np.concatenate([np.concatenate([*one], axis=1) for one in every], axis=1)
            for every in (self.moved, self.pushed)
        )
        return (
            np.concatenate([np.tile(group.squared, n) for group, n in both]),
            [np.tile(g.bent, n) if g.bent.ndim == 1 else g.bent for g, n in both],
            moved,
            pushed,
        )


@lru_cache(maxsize=8)
def bare_of(
    scene: Scene, highest_hz: float, within_hz: float, period_m: float | None = None
) -> Bare:
    """Return the same for every loss: a study that states none is computed with three."""
    strip = scene.strip
    centred = all(load.y_m == strip.width_m / 2 for load in scene.loads)
    if strip.patches:
        return _bare_patched(scene, highest_hz, within_hz, centred=centred)
    groups: Sequence[Modes | Waves]
    if strip.length_m is None:
        groups = strip_waves(strip, highest_hz, period_m or _period_m(scene), centred=centred)
    else:
        groups = plate_modes(strip, highest_hz, centred=centred)
    points_m, nodes = np.array(scene.points_m), _all_nodes(scene, highest_hz)
    return Bare(
        groups=groups,
        moved=[group.at(points_m) for group in groups],
        pushed=[_pushed(scene, nodes, group.at) for group in groups],
        static_m=_at_rest_m(without_far_ends(scene)),
    )


def _bare_patched(scene: Scene, highest_hz: float, within_hz: float, *, centred: bool) -> Bare:
    bearing = _with_places(scene.strip, scene.loads)
    groups = patched_modes(bearing, highest_hz, centred=centred, within_hz=within_hz)
    in_functions = [_in_functions(scene, group.functions, within_hz) for group in groups]
    answers = [one.answers(*rows) for one, rows in zip(groups, in_functions, strict=True)]
    moved, pushed, rests_m = zip(*answers, strict=True)
    return Bare(
        groups=groups,
        moved=[one[np.newaxis] for one in moved],
        pushed=[one[np.newaxis] for one in pushed],
        static_m=np.sum(rests_m, axis=0),
    )


@lru_cache(maxsize=8)
def _in_functions(scene: Scene, functions: Functions, highest_hz: float) -> tuple[Real, Real]:
    """Return functions at the points, and the works of the loads on them: (n, n_functions) each."""
    at_points = functions.at(np.array(scene.points_m))
    most_rad_m = wavenumber_rad_m(scene.strip, highest_hz)
    driven = scene.driven or (True,) * len(scene.loads)
    works = [
        on * _work(load, functions, most_rad_m)
        for on, load in zip(driven, scene.loads, strict=True)
    ]
    return at_points, np.stack(works)


@lru_cache(maxsize=32)
def _work(load: Load, functions: Functions, most_rad_m: float) -> Real:
    """Return the work of a load on functions, the same in all scenes: (n_functions,).

    A moment bends what it covers by what it turns the rim.
    """
    if load.is_moment:
        rim_m, along_m, across_m = rim_of(load, most_rad_m)
        return np.asarray(functions.slopes(rim_m, along_m, across_m).sum(axis=0))
    nodes_m, weights = nodes_of(load, most_rad_m)
    return np.asarray(weights @ functions.at(nodes_m))


def _at_rest_m(scene: Scene) -> Real:
    """Return the static field: of all sections of a long plate it is the same."""
    known = _known_at_rest_m(dataclasses.replace(scene, points_m=scene.points_m[:1]))
    new = tuple(point for point in scene.points_m if point not in known)
    if new:
        found_m = at_rest(dataclasses.replace(scene, points_m=new), _STATIC_RTOL)
        known.update(zip(new, found_m.T, strict=True))
    return np.stack([known[point] for point in scene.points_m], axis=1)


@lru_cache(maxsize=4)
def _known_at_rest_m(_: Scene) -> dict[tuple[float, float], Real]:
    """Return what is known of the static field of a scene, whatever its points: of each its own."""
    return {}


def _all_nodes(scene: Scene, highest_hz: float) -> list[tuple[Real, Real]]:
    most_rad_m = wavenumber_rad_m(scene.strip, highest_hz)
    return [nodes_of(load, most_rad_m) for load in scene.loads]


def _with_places(strip: Strip, loads: Sequence[Load]) -> Strip:
    """Return a strip with patches of nothing where a moment has no patch: it bends as sharply."""
    nothing = Layer(thickness_m=1e-9, youngs_modulus_pa=1e-3, poisson_ratio=0.0)
    patches = strip.patches
    for load in loads:
        if load.is_moment:
            half_x_m, half_y_m = load.half_size_m
            place = BondedPatch(
                x_m=load.x_m,
                y_m=load.y_m,
                length_x_m=2 * half_x_m,
                length_y_m=2 * half_y_m,
                layers=(nothing,),
                is_disc=isinstance(load, DISCS),
            )
            if all(max(place.gaps_m(patch)) >= 0 for patch in patches):
                patches = (*patches, place)
    return dataclasses.replace(strip, patches=patches)


def _pushed(scene: Scene, nodes: Sequence[tuple[Real, Real]], at: Callable[..., Real]) -> Real:
    """Return the works of the loads on functions: (n_copies, n_loads, n_functions)."""
    driven = scene.driven or (True,) * len(scene.loads)
    return np.stack(
        [
            on * np.einsum("n,cnm->cm", weights, at(nodes_m, laplacian=load.is_moment))
            for on, load, (nodes_m, weights) in zip(driven, scene.loads, nodes, strict=True)
        ],
        axis=1,
    )


def springs_lose(strip: Strip) -> bool:
    """Tell whether springs along the edges, if any, have the plate's loss."""
    return not (isinstance(strip.edge, ElasticEdge) and strip.edge.lossless)


def without_loss(strip: Strip) -> Strip:
    """Return the strip of a material without any."""
    lossless = dataclasses.replace(strip.material, loss_factor=0.0, viscous_time_s=0.0)
    return dataclasses.replace(strip, material=lossless)


def _period_m(scene: Scene) -> float:
    """Return after which length an endless strip is taken to repeat itself."""
    places = [x for x, _ in scene.points_m] + [load.x_m for load in scene.loads]
    return max(_PERIODS * scene.strip.width_m, _SPANS * (max(places) - min(places)))
