"""What leaves the device: converter, zero-order hold, amplifier; and the record of one burst."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from device.checks import require_positive, require_whole
from device.core.messages import full_scale
from device.limits import MAX_CHANNELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from device.driver import FloatArray
    from device.limits import CodeArray, Limits


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputStage:
    """Converters with amplifiers, the same for every channel.

    Parameters
    ----------
    channels : int
        Number of outputs.
    sample_rate_hz : float
        Each code is held for one period of this rate.
    bits : int
        Of each converter; its full scale is the rail.
    rail_v : float
        Volts at the actuator, to both sides, beyond which the amplifier cannot go.

    Raises
    ------
    ValueError
        A field is out of range.

    Examples
    --------
    >>> OutputStage().rail_v
    100.0
    """

    channels: int = 2
    sample_rate_hz: float = 48_000.0
    bits: int = 16
    rail_v: float = 100.0

    def __post_init__(self) -> None:
        require_whole("channels", self.channels, minimum=1, maximum=MAX_CHANNELS)
        require_positive("sample_rate_hz", self.sample_rate_hz)
        require_whole("bits", self.bits, minimum=2, maximum=24)
        require_positive("rail_v", self.rail_v)

    def render(self, codes: CodeArray, *, levels_mvpp: Sequence[int], limits: Limits) -> FloatArray:
        """Return the volts at each actuator for the codes of a stored waveform.

        Scaled to the levels, rounded toward zero to the converter's steps, held at the rail where
        the amplifier cannot follow. A burst that passed `check_ceiling` stays within +- half the
        ceiling to the last bit.

        Parameters
        ----------
        codes : ndarray of int, shape (n_channels, n_samples)
            Of the waveform.
        levels_mvpp : sequence of int
            Level of each channel, in peak-to-peak millivolts.
        limits : Limits
            The device's; their ceiling.

        Returns
        -------
        ndarray, shape (n_channels, n_samples)
            Volts, one value per sample period, read-only.

        Examples
        --------
        >>> from device.limits import Limits
        >>> codes = np.array([[0, 32767, -32767, 0], [0, 0, 0, 0]], dtype=np.int32)
        >>> limits = Limits(ceiling_vpp=200.0)
        >>> OutputStage().render(codes, levels_mvpp=[200_000] * 2, limits=limits).tolist()
        [[0.0, 100.0, -100.0, 0.0], [0.0, 0.0, 0.0, 0.0]]
        """
        # In whole numbers, as a firmware has it: where the exact quotient is a step of the
        # converter, a float may lie just below it and lose that step.
        levels = np.array(levels_mvpp, dtype=np.int64)[:, np.newaxis]
        magnitudes = np.abs(codes).astype(np.int64) * levels // round(2000 * self.rail_v)
        steps = (np.sign(codes) * magnitudes).astype(np.float64)
        max_v = min(self.rail_v, limits.ceiling_vpp / 2)
        volts: FloatArray = np.clip(steps * self.rail_v / full_scale(self.bits), -max_v, max_v)
        volts.setflags(write=False)
        return volts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Emission:
    """One burst as it left the device.

    Parameters
    ----------
    token : int
        That fired it.
    start_us : int
        Onset on the device's clock.
    volts : ndarray, shape (n_channels, n_samples)
        At the actuators, each held for one sample period.
    levels_vpp : tuple of float
        Level set of each channel, peak-to-peak volts; 0 where its waveform is zero throughout.
    sample_rate_hz : float
        Of the samples.
    cut_us : int or None
        Device time at which a stop cut the burst short; the samples from there on are zero.

    Examples
    --------
    >>> burst = Emission(token=1, start_us=0, volts=np.array([[0.0, 90.0, -90.0, 0.0], [0.0] * 4]),
    ...                  levels_vpp=(180.0, 0.0), sample_rate_hz=1000.0)
    >>> burst.duration_us
    4000
    >>> burst.cut(2000).volts[0].tolist()
    [0.0, 90.0, 0.0, 0.0]
    """

    token: int
    start_us: int
    volts: FloatArray
    levels_vpp: tuple[float, ...]
    sample_rate_hz: float
    cut_us: int | None = None

    @property
    def duration_us(self) -> int:
        """Microseconds from the onset to the end of the last sample, uncut."""
        n_samples: int = self.volts.shape[1]
        return -(-n_samples * 10**9 // round(self.sample_rate_hz * 1000))

    def cut(self, at_us: int) -> Emission:
        """Return the burst as a stop left it: zero from there on.

        Parameters
        ----------
        at_us : int
            When it was stopped, in microseconds on the device's clock.

        Returns
        -------
        Emission
            The same burst with `cut_us`; its samples keep their number.

        Raises
        ------
        ValueError
            `at_us` is before the onset.
        """
        if at_us < self.start_us:
            raise ValueError(f"at_us must be {self.start_us} or later, got {at_us}")
        first_zero = int(np.ceil((at_us - self.start_us) * self.sample_rate_hz / 1e6))
        volts = self.volts.copy()
        volts[:, first_zero:] = 0.0
        volts.setflags(write=False)
        return replace(self, volts=volts, cut_us=at_us)
