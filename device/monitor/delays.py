"""A way's delay, which may jump within its tolerance where frames were lost."""

from __future__ import annotations

from typing import Final

SAME_S: Final = 1e-3
"""By more than this, and what is not known of the two, a delay is another than that before."""


class Delays:
    """The delay of the burst before.

    >>> delays = Delays()
    >>> [delays.changed(late_s, 1e-5) for late_s in (0.01, 0.0105, 0.014, 0.014)]
    [False, False, True, False]
    """

    def __init__(self) -> None:
        self._before: tuple[float, float] | None = None

    def changed(self, late_s: float, known_s: float) -> bool:
        """Tell whether a delay, known by so much with 95 %, is another; and keep it."""
        before, self._before = self._before, (late_s, known_s)
        return before is not None and abs(late_s - before[0]) > SAME_S + known_s + before[1]
