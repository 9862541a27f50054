"""How a session looks to its operator: a status as lines of text, drawn in place by rich."""

from __future__ import annotations

import math
from io import StringIO
from typing import TYPE_CHECKING, Final

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from experiment.trial.events import Phase
from experiment.trial.plan import PRACTICE_BLOCK

if TYPE_CHECKING:
    from experiment.operator.requests import Status, Tally


_SECONDS_UP_TO_S: Final = 90.0
_STEP_S: Final = 10

SHOW_CURSOR: Final = "\x1b[?25h"
"""What gives a terminal's cursor back."""


class ViewLines:
    """A few lines that are drawn again and again at the same place.

    Examples
    --------
    >>> picture = ViewLines()
    >>> "note: cup" in picture.draw(None, pause_asked=False, notice="", prompt="note: cup")
    True
    >>> picture.end(None, pause_asked=False).endswith(chr(10) + SHOW_CURSOR)
    True
    """

    def __init__(self) -> None:
        self._drawn = StringIO()
        self._console = Console(file=self._drawn, force_terminal=True, highlight=False)
        self._live = Live(
            console=self._console, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
        )
        self._live.start()

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines of the terminal."""
        return self._console.size

    def draw(self, status: Status | None, *, pause_asked: bool, notice: str, prompt: str) -> str:
        """Return what draws a status and the operator's keys over the last picture."""
        told = [_line((notice, "green"))] if notice else []
        lines = [*status_lines(status, pause_asked=pause_asked), *told, _line((prompt, "reverse"))]
        self._live.update(Group(*lines), refresh=True)
        return self._taken()

    def end(self, status: Status | None, *, pause_asked: bool) -> str:
        """Return what draws a last picture, without keys, and gives the cursor back below it."""
        self._live.update(Group(*status_lines(status, pause_asked=pause_asked)), refresh=True)
        self._live.stop()
        return self._taken()

    def _taken(self) -> str:
        text = self._drawn.getvalue()
        self._drawn.seek(0)
        self._drawn.truncate()
        return text


def status_lines(status: Status | None, *, pause_asked: bool) -> list[Text]:
    """Return what an operator is to know of a session, a line each; of none before the first.

    Examples
    --------
    >>> [line.plain for line in status_lines(None, pause_asked=False)]
    ['the session begins ...']
    """
    if status is None:
        return [_line(("the session begins ...", ""))]
    lines = [
        _line((_place(status), "bold"), (f"   {status.phase}   {left_words(status.left_s)}", "")),
        _line(("device  ", "dim"), (status.device, "")),
        _line(("noise   ", "dim"), (status.noise, "")),
        *(_tally_line(side, tally) for side, tally in status.tallies.items()),
    ]
    if status.message:
        lines.append(_line((status.message, "bold yellow")))
    if pause_asked and status.phase != Phase.PAUSED:
        lines.append(_line(("a pause follows this trial", "yellow")))
    return lines


def left_words(left_s: float) -> str:
    """Return a time to come as an operator wants to read it.

    Examples
    --------
    >>> left_words(1234.5), left_words(42.0), left_words(float("nan"))
    ('21 min left', '50 s left', 'time left unknown')
    """
    if not 0.0 <= left_s < math.inf:
        return "time left unknown"
    if left_s <= _SECONDS_UP_TO_S:
        return f"{math.ceil(left_s / _STEP_S) * _STEP_S} s left"
    return f"{round(left_s / 60)} min left"


def _place(status: Status) -> str:
    done = f"{status.done} of {status.planned} trials done"
    if status.block == PRACTICE_BLOCK:
        return f"{done}   practice"
    if status.block < PRACTICE_BLOCK:
        return f"{done}   before practice"
    return f"{done}   block {status.block} of {status.blocks}"


def _tally_line(side: str, tally: Tally) -> Text:
    count = f"{tally.correct} of {tally.presented} correct"
    return _line((f"{side:<8}", "dim"), (f"{count:<20}", ""), (" ".join(tally.last), "cyan"))


def _line(*parts: tuple[str, str]) -> Text:
    """Return a line that is cut, not wrapped; what would move the cursor is left out."""
    line = Text(no_wrap=True, overflow="ellipsis")
    for words, style in parts:
        line.append("".join(c if c.isprintable() else " " for c in words), style)
    return line
