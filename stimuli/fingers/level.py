"""Crosstalk at the undriven finger, and the shortest burst that keeps a target."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite, finite_array, instance, whole
from stimuli.drive.burst import Burst
from stimuli.errors import PlateError, Rule
from stimuli.fingers.fingertip import checked_fingertips
from stimuli.fingers.peaks import fingertip_peaks
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike

    from stimuli.arrays import Real
    from stimuli.drive.windows import Window
    from stimuli.fingers.fingertip import Fingertip
    from stimuli.load import Load
    from stimuli.plate.strip import Strip


MOST_CYCLES: Final = 20
"""Longest burst that `shortest_window` tries."""

_ORDER: Final[tuple[Window, ...]] = ("none", "tukey", "gaussian", "hann")
"""Windows of equally long bursts, in the order in which they are tried."""

_MATRIX: Final = 2


def level_db(felt_m: ArrayLike, own: int, other: int, load: int | None = None) -> float:
    """Return the peak at another finger in dB relative to that at the driven finger, equation (44).

    Parameters
    ----------
    felt_m : array_like of float, shape (n_fingertips, n_loads)
        What `felt` returned.
    own, other : int
        The fingertip on the driven actuator, and the one compared with it.
    load : int, optional
        The driven load; by default the one with the number of the own fingertip.

    Returns
    -------
    float
        20 log10(peak at the other / peak at the driven finger), negative where the other feels
        less; minus infinity where it feels nothing.

    Raises
    ------
    ValueError
        If the matrix or a number is not what it should be, or the driven finger feels nothing.

    Examples
    --------
    >>> round(level_db([[2e-6, 1e-7], [2e-7, 3e-6]], own=0, other=1), 9)
    -20.0
    """
    matrix = finite_array("felt_m", felt_m)
    if matrix.ndim != _MATRIX or not matrix.size or np.any(matrix < 0):
        raise ValueError(f"felt_m must be a matrix of numbers >= 0, got {matrix.tolist()}")
    n_fingertips, n_loads = matrix.shape
    own = whole("own", own, least=0, most=n_fingertips - 1)
    other = whole("other", other, least=0, most=n_fingertips - 1)
    column = whole("load", own if load is None else load, least=0, most=n_loads - 1)
    at_own_m, at_other_m = float(matrix[own, column]), float(matrix[other, column])
    if at_own_m == 0:
        raise ValueError(f"felt_m must be above 0 at the driven finger, got {matrix.tolist()}")
    return 20 * math.log10(at_other_m / at_own_m) if at_other_m else -math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowChoice:
    """A standard burst that keeps the other finger quiet enough, and its price.

    Attributes
    ----------
    burst : Burst
        The burst.
    level_db : float
        Its worst level at another finger relative to the own one, on any of the strips.
    extra_s : float
        How much longer it lasts than the asked burst; 0 if only its window differs.
    louder : tuple of (Burst, float)
        What was tried before it, each with the level at which it was found not quiet enough.

    Examples
    --------
    `shortest_window` gives one, next to those that were too loud:

    >>> from stimuli import ALUMINIUM, CLAMPED, Fingertip, MomentDisc, Strip
    >>> plate = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> discs = [MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035)]
    >>> fingers = [Fingertip(x_m=x, y_m=0.0125, radius_m=0.0) for x in (-0.035, 0.035)]
    >>> one = Burst(frequency_hz=500.0, cycles=1, window="none")
    >>> choice = shortest_window(plate, discs, fingers, one, wanted_db=-60.0)
    >>> choice.burst.window, [burst.window for burst, _ in choice.louder], choice.extra_s
    ('gaussian', ['none', 'tukey'], 0.0)
    """

    burst: Burst
    level_db: float
    extra_s: float
    louder: tuple[tuple[Burst, float], ...] = ()


@single_threaded
def shortest_window(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    burst: Burst,
    wanted_db: float,
    *,
    also: Sequence[Strip] = (),
) -> WindowChoice:
    """Return the shortest standard burst that is quiet enough at the other fingers.

    Parameters
    ----------
    strip : Strip
        The strip.
    loads : tuple or list of Load
        The actuators under the fingers.
    fingertips : tuple or list of Fingertip
        As many fingertips, each on its load, at least two.
    burst : Burst
        Its frequency is kept; its cycles, at most 20, are the fewest tried, its window does not
        count.
    wanted_db : float
        Greatest level at any other finger relative to the own one, below 0.
    also : sequence of Strip
        What the strip may be as well, as with another loss: the burst is quiet on all of them.

    Returns
    -------
    WindowChoice
        The first one that is quiet enough, with the fingertips' impedances and without: fewer
        cycles come first, and of equally many no window before tukey, gaussian and hann.

    Raises
    ------
    ValueError
        If an argument is not what it should be, or no burst of up to 20 cycles is quiet enough;
        the message has the best one.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Fingertip, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> discs = [MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035)]
    >>> fingers = [Fingertip(x_m=x, y_m=0.0125, radius_m=0.0) for x in (-0.035, 0.035)]
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
    >>> choice = shortest_window(strip, discs, fingers, burst, wanted_db=-20.0)
    >>> choice.burst == burst, choice.level_db < -20, choice.extra_s
    (True, True, 0.0)
    """
    instance("burst", burst, Burst, "a Burst")
    whole("burst.cycles", burst.cycles, least=1, most=MOST_CYCLES)
    wanted_db = finite("wanted_db", wanted_db, most=0.0)
    n_fingers = len(checked_fingertips(fingertips))
    if n_fingers <= 1 or len(loads) != n_fingers:
        raise ValueError(
            "fingertips must be at least two and as many as loads, got "
            f"{n_fingers} fingertips and {len(loads)} loads"
        )
    louder: list[tuple[Burst, float]] = []
    for cycles in range(burst.cycles, MOST_CYCLES + 1):
        for window in _ORDER:
            tried = dataclasses.replace(burst, cycles=cycles, window=window)
            worst_db = -math.inf
            for plate, tips in product((strip, *also), _loading(fingertips, tried)):
                worst_db = max(
                    worst_db, _worst_db(fingertip_peaks(plate, loads, tips, tried).value)
                )
                if worst_db > wanted_db:
                    break
            if worst_db <= wanted_db:
                extra_s = tried.duration_s - burst.duration_s
                return WindowChoice(
                    burst=tried, level_db=worst_db, extra_s=extra_s, louder=tuple(louder)
                )
            louder.append((tried, worst_db))
    best, best_db = min(louder, key=lambda one: one[1])
    raise PlateError(
        Rule.LEVEL_NOT_REACHED,
        target_db=wanted_db,
        lowest_db=best_db,
        cycles=best.cycles,
        window=best.window,
        max_cycles=MOST_CYCLES,
    )


def _loading(tips: Sequence[Fingertip], drive: Burst) -> Iterator[Sequence[Fingertip]]:
    """Yield fingertips that do not load the strip, and then with their impedances that hold."""
    yield [dataclasses.replace(tip, impedance=None) for tip in tips]
    if any(tip.impedance and tip.impedance.holds_for(drive) for tip in tips):
        yield tips


def _worst_db(felt_m: Real) -> float:
    """Return the greatest level at any finger but the driven one."""
    fingers = range(len(felt_m))
    return max(level_db(felt_m, own, other) for own in fingers for other in fingers if own != other)
