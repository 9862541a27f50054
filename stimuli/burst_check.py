"""The spectrum of a burst, its half-power band, and the check of a burst against a strip."""

from __future__ import annotations

from dataclasses import dataclass

from stimuli.checks import finite, instance
from stimuli.drive.energy import staircase_energy_above
from stimuli.drive.sampled import Drive
from stimuli.plate.strip import Strip


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstCheck:
    """What the check of a burst against a strip found.

    The energies decide: the burst is fit if neither the ideal burst nor its staircase has more
    than `max_energy_above_cutoff` of its energy above the cut-off. A half-power band that reaches
    above the cut-off is an additional reason, never the only one.

    Attributes
    ----------
    cutoff_hz : float
        First cut-off of the strip.
    peak_hz : float
        Peak of the burst's spectrum.
    band_hz : tuple of float
        Half-power band, lower and upper edge.
    energy_above_cutoff : float
        Fraction of the ideal burst's energy above the cut-off.
    staircase_energy_above_cutoff : float
        The same for the samples held at `sample_rate_hz`.
    max_energy_above_cutoff : float
        The largest fraction that is fit.
    sample_rate_hz : float
        Sample rate of the device.

    Raises
    ------
    ValueError
        If a fraction is not from 0 to 1.

    Examples
    --------
    >>> check = BurstCheck(cutoff_hz=2900.0, peak_hz=419.0, band_hz=(206.0, 654.0),
    ...     energy_above_cutoff=3e-4, staircase_energy_above_cutoff=1.3e-2,
    ...     max_energy_above_cutoff=1e-2, sample_rate_hz=8000.0)
    >>> check.fit, len(check.reasons)
    (False, 1)
    """

    cutoff_hz: float
    peak_hz: float
    band_hz: tuple[float, float]
    energy_above_cutoff: float
    staircase_energy_above_cutoff: float
    max_energy_above_cutoff: float
    sample_rate_hz: float

    def __post_init__(self) -> None:
        shares = ("energy_above_cutoff", "staircase_energy_above_cutoff", "max_energy_above_cutoff")
        for name in shares:
            finite(name, getattr(self, name), least=0.0, most=1.0)

    @property
    def fit(self) -> bool:
        """Whether both energies keep the limit."""
        return not self.reasons

    @property
    def reasons(self) -> tuple[str, ...]:
        """The limits that the burst violates, a sentence each."""
        shares = (
            ("the ideal burst", self.energy_above_cutoff),
            (f"its staircase at {self.sample_rate_hz:g} Hz", self.staircase_energy_above_cutoff),
        )
        reasons = [
            f"{what} has {share:.3g} of its energy above the strip's cut-off of "
            f"{self.cutoff_hz:.6g} Hz; the limit is {self.max_energy_above_cutoff:g}"
            for what, share in shares
            if share > self.max_energy_above_cutoff
        ]
        if reasons and self.band_hz[1] > self.cutoff_hz:
            reasons.append(
                f"the half-power band reaches to {self.band_hz[1]:.6g} Hz, above the cut-off"
            )
        return tuple(reasons)


def check_burst(
    burst: Drive,
    strip: Strip,
    sample_rate_hz: float = 48_000.0,
    max_energy_above_cutoff: float = 1e-2,
) -> BurstCheck:
    """Check that a burst, or another drive, stays below the cut-off of a strip.

    Parameters
    ----------
    burst : Drive
        The burst, or any other drive; a held `SampledDrive` is its own staircase.
    strip : Strip
        The strip; its first cut-off counts.
    sample_rate_hz : float
        Sample rate of the device that plays the burst.
    max_energy_above_cutoff : float
        The largest fraction of the energy, from 0 to 1, that may lie above the cut-off.

    Returns
    -------
    BurstCheck
        Cut-off, band and energies; whether the burst is fit, and why not.

    Raises
    ------
    ValueError
        If burst or strip is none, the limit is not from 0 to 1, or the drive's `samples` refuses
        the rate.

    Notes
    -----
    Source: paper, sections II-B and V (frequencies below the cut-off stay confined). The band
    alone misses the energy that carries furthest, so the energies decide.

    Examples
    --------
    The paper's burst is fit for a strip whose cut-off was measured as 2900 Hz, but not when it is
    played at 8 kHz:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, Strip
    >>> plate = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
    >>> check_burst(burst, plate.with_cutoff(2900.0)).fit
    True
    >>> check_burst(burst, plate.with_cutoff(2900.0), sample_rate_hz=8000.0).fit
    False
    """
    instance("burst", burst, Drive, "a Burst or another Drive")
    instance("strip", strip, Strip, "a Strip")
    limit = finite("max_energy_above_cutoff", max_energy_above_cutoff, least=0.0, most=1.0)
    cutoff_hz = strip.cutoff_hz()
    held = staircase_energy_above(
        burst.samples(sample_rate_hz), sample_rate_hz=sample_rate_hz, frequency_hz=cutoff_hz
    )
    return BurstCheck(
        cutoff_hz=cutoff_hz,
        peak_hz=burst.peak_hz(),
        band_hz=burst.band_hz(),
        energy_above_cutoff=burst.energy_above(cutoff_hz),
        staircase_energy_above_cutoff=held,
        max_energy_above_cutoff=limit,
        sample_rate_hz=float(sample_rate_hz),
    )
