"""A way's delay: what nobody has stated, and a jump within its tolerance where frames were lost."""

from __future__ import annotations

from typing import Final

SAME_S: Final = 1e-3
"""By more than this, and what is not known of the two, a delay is another than that before."""


LONGEST_OWN_S: Final = 0.3
"""As long as a sound server's delay may be that nobody states."""
_EARLIEST_OWN_S: Final = 0.1
"""Before its time by another clock's error."""


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


class OwnDelay:
    """The delay of a stream, where nobody states it: that of its bursts before.

    A burst is at its time where the last was that was at its time, or where the burst before was:
    after frames were lost all come later, and only the first of them is blamed. The first of a
    stream is taken as it comes, up to `LONGEST_OWN_S`; after one that was not heard it may be that
    one, and nothing is known until two come alike.

    >>> own, off_s = OwnDelay(), []
    >>> for late_s in (0.04, 0.04, 0.06, 0.06, 0.04):
    ...     off_s.append(round(late_s - own.near(late_s, within_s=0.001), 3))
    ...     own.keep(late_s, good=abs(off_s[-1]) <= 0.001)
    >>> off_s
    [0.0, 0.0, 0.02, 0.0, -0.02]
    >>> own = OwnDelay()
    >>> own.miss()
    >>> own.near(0.1, within_s=0.001) is None, OwnDelay().near(0.7, within_s=0.001)
    (True, 0.3)
    """

    def __init__(self) -> None:
        self._good_s: float | None = None
        self._before_s: float | None = None
        self._missed = False

    def near(self, late_s: float, *, within_s: float) -> float | None:
        """Return the delay that a burst of this one is to be compared with, or that none is known.

        It is never one that no stream has.
        """
        if self._before_s is not None and abs(late_s - self._before_s) <= within_s:
            return self._before_s
        if self._good_s is None and self._missed:
            return None
        good_s = late_s if self._good_s is None else self._good_s
        return min(max(good_s, -_EARLIEST_OWN_S), LONGEST_OWN_S)

    def keep(self, late_s: float, *, good: bool) -> None:
        """Note the delay of a burst that was found, and whether all else was as planned."""
        self._before_s = late_s if -_EARLIEST_OWN_S <= late_s <= LONGEST_OWN_S else None
        if good:
            self._good_s = late_s

    def miss(self) -> None:
        """Note that a burst was not heard."""
        self._missed = True
