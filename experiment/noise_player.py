"""The masking noise as a session sees it: started, asked for its health, stopped."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol


class NoiseError(RuntimeError):
    """The noise cannot be played; the message says why and what to do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseHealth:
    """Whether the noise is playing now.

    Attributes
    ----------
    ok : bool or None
        ``None`` where none is to be played, or the participant is simulated.
    words : str
        For the operator: what is wrong, or that it plays.
    frames, underruns : int
        Taken by the sound card so far, and how often it had to wait.
    """

    ok: bool | None
    words: str
    frames: int = 0
    underruns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFacts:
    """What the header keeps of the noise; ``None`` is what is not known or does not apply.

    Attributes
    ----------
    noise : str
        ``pink`` or ``none``.
    played : bool
        Whether it is.
    sha256 : str or None
        Checksum of the loop's samples.
    sample_rate_hz : float or None
        Of the loop.
    loop_s : float or None
        Its length.
    level_dbfs : float or None
        Effective value of its samples, dB re the peak of a full-scale sine.
    max_level_dba, measured_level_dba : float or None
        The study's, at the ear.
    sound_card : str or None
        What plays it.
    """

    noise: str
    played: bool
    sha256: str | None = None
    sample_rate_hz: float | None = None
    loop_s: float | None = None
    level_dbfs: float | None = None
    max_level_dba: float | None = None
    measured_level_dba: float | None = None
    sound_card: str | None = None


class NoisePlayer(Protocol):
    """What plays the masking noise; see `masking`."""

    @property
    def facts(self) -> NoiseFacts:
        """What the header keeps of it."""
        ...

    def start(self) -> None:
        """Fade in, and play until `stop`; also again after the sound card was lost.

        Raises
        ------
        NoiseError
            If it cannot be played.
        """
        ...

    def health(self) -> NoiseHealth:
        """Tell whether it plays now; returns at once, and touches no disk."""
        ...

    def stop(self) -> None:
        """Fall silent; from any state."""
        ...
