"""Whether the masking noise plays: asked where it matters, journaled where nobody waits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiment.noise_player import NoiseError

if TYPE_CHECKING:
    from experiment.journal import Journal
    from experiment.noise_player import NoiseHealth, NoisePlayer


class NoiseWatch:
    """The masking noise of a session, watched trial by trial.

    Parameters
    ----------
    noise : NoisePlayer
        What plays it.
    journal : Journal
        Where changes are noted.

    Attributes
    ----------
    ok : bool or None
        Whether it played from the current trial's onset on; ``False`` also if it was lost before.
    trouble : str
        What the operator has to know; empty if it plays.
    """

    def __init__(self, noise: NoisePlayer, journal: Journal) -> None:
        self._noise = noise
        self._journal = journal
        self._noted: tuple[bool | None, int] = (None, 0)
        self._loss: NoiseHealth | None = None
        self.ok: bool | None = None
        self.trouble = ""

    def begin_trial(self) -> None:
        """Forget the trial before."""
        self.ok = None

    def hear_onset(self) -> None:
        """Take the health at an onset; touches no disk."""
        self.ok = self._asked().ok

    def lost(self) -> bool:
        """Tell whether it does not play now, or did not at the onset; touches no disk."""
        if self._asked().ok is False:
            self.ok = False
        return self.ok is False

    def words(self) -> str:
        """Return its health in a few words; touches no disk."""
        return self._noise.health().words

    def note(self) -> None:
        """Journal its health where it changed; never between an onset and its answer.

        A loss is journaled even if it is over: a gap shows only in the first health after it.
        """
        losses = () if self._loss is None else (self._loss,)
        self._loss = None
        for health in (*losses, self._noise.health()):
            if (health.ok, health.underruns) != self._noted:
                self._noted = (health.ok, health.underruns)
                facts = {"frames": health.frames, "underruns": health.underruns}
                self._journal.append(
                    "noise_status", {"ok": health.ok, "words": health.words, **facts}
                )

    def start_again(self) -> bool:
        """Start it after it was lost; tell whether that could be done, and journal why not."""
        try:
            self._noise.start()
        except NoiseError as error:
            self.trouble = str(error)
            self._journal.append("noise_status", {"ok": False, "words": self.trouble})
            return False
        self.trouble = ""
        return True

    def stop(self) -> None:
        """Fall silent."""
        self._noise.stop()

    def _asked(self) -> NoiseHealth:
        health = self._noise.health()
        if health.ok is False:
            self._loss = health
            self.trouble = f"masking noise: {health.words}; put it right, then go on"
        return health
