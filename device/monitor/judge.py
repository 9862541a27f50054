"""Whether a burst that was measured is the planned one, and in which ways it is not."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from device.monitor.matching import Template
from device.monitor.measured import Fault, Planned, Tap, Tolerances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from device.monitor.matching import TemplateMatch

MIN_SNR_DB: Final = 10.0
"""Ratio of a burst's effective value to the noise's; below it nothing is judged."""
_SURE_SD: Final = 3.5
"""Standard deviations: by so much the threshold lies inside of a tolerance, so that noise lets
nothing pass that is beyond it; and by as much again outside of what a good burst is taken for."""
_SURE_SD_OF_TOP: Final = 4.5
"""The same of a flat top, which no threshold keeps clear of noise: a top may be two samples."""
_FLAT: Final = (0.5, 1.0, 1.0)
"""Shares of the peak's tolerance: of all tops; of one sign's, which a slow drift moves, too."""
_CLEAR_SD: Final = 6.0
"""Standard deviations: what is above them is no noise, wherever in a record it is looked for."""
_AGAIN_BY_MOTION: Final = 0.7
"""A plate rings: only what is as strong as this part of a burst, and clear of it, is a second."""


def judge(
    planned: Planned,
    matches: Sequence[TemplateMatch],
    *,
    tap: Tap,
    tolerances: Tolerances,
    late_s: Sequence[float] | None,
    sample_rate_hz: float,
) -> tuple[tuple[Fault, ...], str]:
    """Return the faults of a burst, and why it cannot be judged; empty if it can.

    `late_s` has the delay of each channel, None where the planned onset is unknown. An overloaded
    input is a fault at any noise level.
    """
    rms, sized = Template(planned.shape).rms, tap is not Tap.MOTION
    faults = [Fault.CLIPPED] if any(match.overloaded for match in matches) else []
    for peak, full, match in zip(planned.peaks, planned.burst, matches, strict=True):
        snr_db = 20 * math.log10(full * rms / match.noise_rms)
        finest = tolerances if peak and sized else None
        reason = _noise_reason(snr_db, match, full, finest=finest, silence=tolerances.silence)
        if reason:
            return tuple(faults), reason
    ratios = [
        (match.amplitude if peak else max(match.largest, match.loudest * sized)) / full
        for peak, full, match in zip(planned.peaks, planned.burst, matches, strict=True)
    ]
    faults += _channel_faults(planned, matches, ratios, tolerances, tap)
    faults += _doubling(planned, matches, tap, tolerances)
    if late_s is not None and not {Fault.SILENT, Fault.SWAPPED} & {*faults}:
        faults += _onset_faults(planned, matches, tolerances, late_s, sample_rate_hz)
    return tuple(dict.fromkeys(faults)), ""


def correlations_of(
    planned: Planned, matches: Sequence[TemplateMatch], silence: float
) -> tuple[float | None, ...]:
    """Return the correlation of each channel, None where only silence came out."""
    pairs = zip(matches, planned.burst, strict=True)
    return tuple(m.correlation if m.amplitude >= silence * full else None for m, full in pairs)


def _noise_reason(
    snr_db: float, match: TemplateMatch, full: float, *, finest: Tolerances | None, silence: float
) -> str:
    """Say why noise hides a fault; `finest` are the tolerances of a burst's size and shape."""
    if snr_db < MIN_SNR_DB:
        return f"the noise is only {snr_db:.1f} dB below the burst; {MIN_SNR_DB:g} are needed"
    sd = match.amplitude_sd / full
    needed = sd * _CLEAR_SD / silence
    if finest is not None:
        needed = max(needed, sd * 2 * _SURE_SD / finest.peak)
        if match.amplitude >= silence * full:  # energies grow with the square of the noise
            ratio = 2 * _SURE_SD * match.correlation_sd / (1 - finest.correlation)
            needed = max(needed, math.sqrt(ratio))
    if needed <= 1:
        return ""
    min_db = snr_db + 20 * math.log10(needed)
    needed_text = f"for these tolerances {min_db:.1f} are needed"
    return f"the noise is {snr_db:.1f} dB below the burst; {needed_text}"


def _min_sound(match: TemplateMatch, full: float, silence: float) -> float:
    """Return the ratio to a burst from which a channel was not silent, whatever noise took off."""
    sd = match.amplitude_sd / full
    return max(silence - _SURE_SD * sd, _CLEAR_SD * sd)


def _channel_faults(
    planned: Planned,
    matches: Sequence[TemplateMatch],
    ratios: list[float],
    tolerances: Tolerances,
    tap: Tap,
) -> list[Fault]:
    faults: list[Fault] = []
    channels = list(zip(planned.peaks, planned.burst, matches, ratios, strict=True))
    driven = max((ratio for peak, _, _, ratio in channels if peak), default=math.inf)
    stray = max((ratio for peak, _, _, ratio in channels if not peak), default=0.0)
    min_ratio = stray / 2 if tap is Tap.MOTION else tolerances.silence
    if driven < min_ratio and stray >= tolerances.silence:
        return [Fault.SWAPPED]  # undetectable where all channels play the same, or none does
    for peak, full, match, ratio in channels:
        if not peak:
            if ratio >= _min_sound(match, full, tolerances.silence):
                faults.append(Fault.STRAY)
        elif ratio < tolerances.silence:
            faults.append(Fault.SILENT)
        else:
            faults += _shape_faults(ratio, match, full, tolerances)
    return faults


def _shape_faults(
    ratio: float, match: TemplateMatch, full: float, tolerances: Tolerances
) -> list[Fault]:
    faults = []
    margin = tolerances.peak - _SURE_SD * match.amplitude_sd / full
    if ratio < 1 - margin:
        faults.append(Fault.WEAK)
    if ratio > 1 + margin:
        faults.append(Fault.STRONG)
    for (top, sd), share in zip(match.tops, _FLAT, strict=False):  # a shape may have one sign
        flat = max(share * tolerances.peak * match.amplitude, _SURE_SD_OF_TOP * sd)
        faults += [Fault.CLIPPED] * (match.amplitude - top > flat)
    min_correlation = tolerances.correlation + _SURE_SD * match.correlation_sd
    if match.inverted or match.correlation < min_correlation:
        faults.append(Fault.DISTORTED)
    return faults


def _doubling(
    planned: Planned,
    matches: Sequence[TemplateMatch],
    tap: Tap,
    tolerances: Tolerances,
) -> list[Fault]:
    frames = len(planned.shape)
    for peak, full, match in zip(planned.peaks, planned.burst, matches, strict=True):
        if tap is Tap.MOTION:
            loud = max(_AGAIN_BY_MOTION * match.amplitude, tolerances.silence * full)
            is_doubled = (
                match.second > loud and abs(match.second_at) > frames - 2
            )  # both ends are 0
        else:
            loud = _min_sound(match, full, tolerances.silence) * full
            is_doubled = max(match.second, match.beside) > loud
        if peak and is_doubled:
            return [Fault.DOUBLED]
    return []


def _onset_faults(
    planned: Planned,
    matches: Sequence[TemplateMatch],
    tolerances: Tolerances,
    late_s: Sequence[float],
    sample_rate_hz: float,
) -> list[Fault]:
    faults = []
    for peak, match, late in zip(planned.peaks, matches, late_s, strict=True):
        margin_s = max(tolerances.onset_s - match.onset_uncertainty / sample_rate_hz, 0.0)
        if peak and abs(late) > margin_s:
            faults.append(Fault.LATE if late > 0 else Fault.EARLY)
    return faults
