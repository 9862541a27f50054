"""No masking noise: where the study says so, and where the participant is simulated."""

from __future__ import annotations

from experiment.noise_player import NoiseFacts, NoiseHealth


class SilentNoise:
    """Plays nothing, and says so.

    Parameters
    ----------
    noise : str
        What the study asks for, ``pink`` or ``none``.

    Examples
    --------
    >>> SilentNoise("pink").facts.played, SilentNoise("none").health().ok
    (False, None)
    """

    def __init__(self, noise: str) -> None:
        self._facts = NoiseFacts(noise=noise, played=False)

    @property
    def facts(self) -> NoiseFacts:
        """What the header keeps of it."""
        return self._facts

    def start(self) -> None:
        """Stay silent."""

    def health(self) -> NoiseHealth:
        """Tell that none is played."""
        return NoiseHealth(ok=None, words="no noise is played")

    def stop(self) -> None:
        """Stay silent."""
