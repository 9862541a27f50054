"""How what fingertips feel is computed: by modes of the plate or of a part of it, or by spectra."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stimuli.fingers.fingertip import RTOL, asked, pressed_of
from stimuli.fingers.mirrored import images_of
from stimuli.fingers.pressed import pressed_peaks
from stimuli.fingers.unpressed import by_modes, by_patched_modes
from stimuli.motion.history import by_spectra
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.fingers.fingertip import Fingertip
    from stimuli.load import Load
    from stimuli.motion.motion import Motion
    from stimuli.motion.peaks import Peaks
    from stimuli.strip.strip import Strip


@dataclass(frozen=True, slots=True, kw_only=True)
class FeltWork:
    """How `felt` computes.

    Attributes
    ----------
    modes : int
        How many modes of the plate take the place of the spectra; 0 where none do.
    highest_hz : float
        Up to where the modes go.
    length_m : float or None
        Length of the part of the plate that has these modes; none without ends.
    is_whole : bool
        Whether that is all of the plate.

    Examples
    --------
    `felt_work` gives one:

    >>> FeltWork(modes=0, highest_hz=0.0, length_m=None, is_whole=True).words
    'spectra, which take minutes: no modes of the plate are enough'
    """

    modes: int
    highest_hz: float
    length_m: float | None
    is_whole: bool

    @property
    def words(self) -> str:
        """The same in words.

        >>> FeltWork(modes=426, highest_hz=35760.0, length_m=1.58, is_whole=False).words
        '426 modes up to 35.8 kHz, of 1580 mm of it: no echo from farther away counts'
        """
        if not self.modes:
            return "spectra, which take minutes: no modes of the plate are enough"
        words = f"{self.modes} modes up to {float(f'{self.highest_hz / 1e3:.3g}'):g} kHz"
        if self.is_whole or self.length_m is None:
            return words
        return f"{words}, of {self.length_m * 1e3:.4g} mm of it: no echo from farther away counts"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Felt:
    """What fingertips feel, how well that is known, and how it was computed.

    Attributes
    ----------
    peak_m : ndarray of float64, shape (n_fingertips, n_loads)
        As `felt` returns it.
    error_m : ndarray of float64, same shape, or None
        How well each is known on a strip with patches, in metres; else none. No other method
        knows patches, so that `rtol` has no say there. It is what the largest values change by
        where the modes are sought in more functions and further up, with what is left out of
        those, (84).
    work : FeltWork
        As `felt_work` does.
    """

    peak_m: Real
    error_m: Real | None
    work: FeltWork


def felt_work(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
    rtol: float = RTOL,
) -> FeltWork:
    """Return how `felt` computes with the same arguments, without the spectra's minutes.

    That is by modes of the plate, equations (78) to (82), where they are enough, and else by
    spectra, equations (63) to (66), which take minutes. This tells beforehand which it will be.

    Parameters
    ----------
    strip : Strip
        The strip, as for `felt`.
    loads : tuple or list of Load
        Loads, each driven by itself.
    fingertips : tuple or list of Fingertip
        Fingertips on the strip, at least one.
    drive : Drive
        A burst or any other drive, with the amplitude 1.
    rtol : float
        Wanted relative error of the displacement over time.

    Returns
    -------
    FeltWork
        How many modes it takes, up to which frequency, and of how much of the plate.

    Raises
    ------
    ValueError
        As for `felt`.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, Fingertip, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc, finger = MomentDisc(x_m=0, y_m=0.0125, radius_m=0.0064), Fingertip(x_m=0, y_m=0.0125)
    >>> felt_work(strip, [disc], [finger], Burst(frequency_hz=500.0, cycles=1)).modes > 100
    True
    """
    found = _by_modes(strip, loads, fingertips, drive, rtol)
    return _by_spectra(strip) if found is None else found.work


@tuned
def felt_known(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
    rtol: float = RTOL,
) -> Felt:
    """Return what `felt` and `felt_work` do with the same arguments, and how well it is known."""
    found = _by_modes(strip, loads, fingertips, drive, rtol)
    if found is not None:
        return found
    scene, places, far_m = asked(strip, loads, fingertips, drive)
    images = images_of(strip, loads, fingertips)
    peak_m = images.every(by_spectra(images.fewer(scene), places, drive, rtol, far_m))
    return Felt(peak_m=peak_m, error_m=None, work=_by_spectra(strip))


def _by_spectra(strip: Strip) -> FeltWork:
    return FeltWork(modes=0, highest_hz=0.0, length_m=strip.length_m, is_whole=True)


def _by_modes(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
    rtol: float,
) -> Felt | None:
    """Return what fingertips feel by modes; none if no modes are enough."""
    scene, places, far_m = asked(strip, loads, fingertips, drive)
    images = images_of(strip, loads, fingertips)
    scene, pressed = images.fewer(scene), pressed_of(strip, fingertips, drive)
    found: tuple[Peaks, Motion, Scene] | None
    with images.named():
        if pressed:
            found = pressed_peaks(scene, places, drive, pressed, rtol=rtol, far_m=far_m)
        elif strip.patches:
            found = *by_patched_modes(scene, places, drive, far_m), scene
        else:
            found = by_modes(scene, places, drive, rtol, far_m)
    if found is None:
        return None
    peaks, motion, section = found
    work = FeltWork(
        modes=motion.oscillators.poles.size,
        highest_hz=motion.highest_hz,
        length_m=section.strip.length_m,
        is_whole=section is scene,
    )
    return Felt(
        peak_m=images.every(peaks.peak_m),
        error_m=images.every(peaks.error_m) if strip.patches else None,
        work=work,
    )
