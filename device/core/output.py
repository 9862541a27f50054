"""What leaves the device: converter, zero-order hold, amplifier; and the record of one burst."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from device.checks import require_positive, require_whole
from device.core.messages import Levels, full_scale

if TYPE_CHECKING:
    from device.driver import FloatArray
    from device.limits import CodeArray, Limits


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputStage:
    """A converter with an amplifier, the same for both channels.

    Parameters
    ----------
    sample_rate_hz : float
        Each code is held for one period of this rate.
    bits : int
        Of the converter; its full scale is the rail.
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

    sample_rate_hz: float = 48_000.0
    bits: int = 16
    rail_v: float = 100.0

    def __post_init__(self) -> None:
        require_positive("sample_rate_hz", self.sample_rate_hz)
        require_whole("bits", self.bits, minimum=2, maximum=24)
        require_positive("rail_v", self.rail_v)

    def render(self, codes: CodeArray, *, levels: Levels, limits: Limits) -> FloatArray:
        """Return the volts at both actuators for the codes of a stored waveform.

        Scaled to the levels, rounded toward zero to the converter's steps, held at the rail where
        the amplifier cannot follow. A burst that passed `check_ceiling` stays within +- half the
        ceiling to the last bit.

        Parameters
        ----------
        codes : ndarray of int, shape (2, n)
            Left and right.
        levels : Levels
            Of both channels.
        limits : Limits
            The device's; their ceiling.

        Returns
        -------
        ndarray, shape (2, n)
            Volts, one value per sample period, read-only.

        Examples
        --------
        >>> from device.limits import Limits
        >>> codes = np.array([[0, 32767, -32767, 0], [0, 0, 0, 0]], dtype=np.int32)
        >>> limits = Limits(ceiling_vpp=200.0)
        >>> levels = Levels(left_mvpp=200_000, right_mvpp=200_000)
        >>> OutputStage().render(codes, levels=levels, limits=limits).tolist()
        [[0.0, 100.0, -100.0, 0.0], [0.0, 0.0, 0.0, 0.0]]
        """
        levels_mvpp = (levels.left_mvpp, levels.right_mvpp)
        pairs = zip(codes, levels_mvpp, strict=True)
        steps = np.array([self._steps(row, level_mvpp) for row, level_mvpp in pairs])
        max_v = min(self.rail_v, limits.ceiling_vpp / 2)
        volts: FloatArray = np.clip(steps * self.rail_v / full_scale(self.bits), -max_v, max_v)
        volts.setflags(write=False)
        return volts

    # In whole numbers, as a firmware has it: where the exact quotient is a step of the converter, a
    # float may lie just below it and lose that step.
    def _steps(self, codes: CodeArray, level_mvpp: int) -> FloatArray:
        magnitudes = np.abs(codes).astype(np.int64) * level_mvpp // round(2000 * self.rail_v)
        return (np.sign(codes) * magnitudes).astype(np.float64)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Emission:
    """One burst as it left the device.

    Parameters
    ----------
    token : int
        That fired it.
    start_us : int
        Onset on the device's clock.
    left_v, right_v : ndarray, shape (m,)
        Volts at the actuators, each held for one sample period.
    level_left_vpp, level_right_vpp : float
        Levels set, peak-to-peak volts; 0 for a channel whose waveform is zero throughout.
    sample_rate_hz : float
        Of the two arrays.
    cut_us : int or None
        Device time at which a stop cut the burst short; the samples from there on are zero.

    Examples
    --------
    >>> volts = np.array([0.0, 90.0, -90.0, 0.0])
    >>> burst = Emission(token=1, start_us=0, left_v=volts, right_v=0 * volts,
    ...                  level_left_vpp=180.0, level_right_vpp=0.0, sample_rate_hz=1000.0)
    >>> burst.duration_us
    4000
    >>> burst.cut(2000).left_v.tolist()
    [0.0, 90.0, 0.0, 0.0]
    """

    token: int
    start_us: int
    left_v: FloatArray
    right_v: FloatArray
    level_left_vpp: float
    level_right_vpp: float
    sample_rate_hz: float
    cut_us: int | None = None

    @property
    def duration_us(self) -> int:
        """Microseconds from the onset to the end of the last sample, uncut."""
        return -(-self.left_v.size * 10**9 // round(self.sample_rate_hz * 1000))

    def cut(self, at_us: int) -> Emission:
        """Return the burst as a stop left it: zero from there on.

        Parameters
        ----------
        at_us : int
            When it was stopped, in microseconds on the device's clock.

        Returns
        -------
        Emission
            The same burst with `cut_us`; its arrays keep their length.

        Raises
        ------
        ValueError
            `at_us` is before the onset.
        """
        if at_us < self.start_us:
            raise ValueError(f"at_us must be {self.start_us} or later, got {at_us}")
        first_zero = int(np.ceil((at_us - self.start_us) * self.sample_rate_hz / 1e6))
        left_v, right_v = self.left_v.copy(), self.right_v.copy()
        left_v[first_zero:] = right_v[first_zero:] = 0.0
        left_v.setflags(write=False)
        right_v.setflags(write=False)
        return replace(self, left_v=left_v, right_v=right_v, cut_us=at_us)
