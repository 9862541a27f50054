"""The operator's live panel on the terminal, and the commands that the operator types there.

A command is a line: p, r, n TEXT or s, then Enter. The terminal keeps its usual settings, so that
nothing has to be restored when the program is suspended or killed.
"""

from __future__ import annotations

import _thread
import math
import os
import select
import signal
import sys
import threading
from codecs import getincrementaldecoder
from collections import deque
from typing import TYPE_CHECKING, Final, Self

from device.printing import echo, escaped
from experiment.trial.events import Phase
from experiment.trial.plan import HANDS_OFF_BLOCK, PRACTICE_BLOCK

if TYPE_CHECKING:
    from rich.live import Live
    from rich.text import Text

    from experiment.operator.requests import Requests, Status, StopSignal, Tally


REFRESH_INTERVAL_S: Final = 0.1
MAX_NOTE_CHARACTERS: Final = 500
"""Further characters of a note are dropped."""
HINTS: Final = "Type p (pause), r (resume), n TEXT (note) or s (stop), then Enter: "
RESUME_HINT: Final = "Press r to continue."

_TIMED: Final = (Phase.ARMING, Phase.FIRING, Phase.ANSWER)
"""Nothing is drawn here unless the operator types: a reaction time is being measured."""
_RUNNING: Final = (Phase.READY, Phase.FOREPERIOD, *_TIMED)
"""Here nothing waits for somebody to continue."""
_MAX_EXIT_S: Final = 1.0
_SECONDS_UP_TO_S: Final = 90.0
_STEP_S: Final = 10


class OperatorView:
    """Shows an operator the progress of a session and takes commands; a context manager.

    Enter it in the main thread, within `StopSignal.on_signals`. On a terminal, one thread draws the
    panel and reads p (pause), r (resume), n TEXT (note) and s (stop). In a pipe, or in the
    background of a shell, there is neither panel nor commands. A terminal that goes away, or is
    held by Ctrl-S, does not hold up the session.

    Parameters
    ----------
    requests : Requests
        Receives pauses and notes.
    stop : StopSignal
        Receives a stop.

    Examples
    --------
    >>> from experiment.operator.requests import Requests, Status, StopSignal
    >>> with OperatorView(Requests(), StopSignal()) as view:  # no panel in a pipe
    ...     view.show(Status(phase="ready", done=0, planned=5, block=1, blocks=2, left_s=30.0,
    ...                      noise="plays", device="ready", message="", tallies={}))
    ...     view.print("Note: this device cannot read its levels back.")
    Note: this device cannot read its levels back.
    """

    def __init__(self, requests: Requests, stop: StopSignal) -> None:
        self._requests = requests
        self._stop = stop
        self._status: Status | None = None
        self._notice = ""
        self._lines: deque[str] = deque()
        self._over = threading.Event()
        self._thread: threading.Thread | None = None

    def show(self, status: Status) -> None:
        """Take the newest status; the view's own thread draws it."""
        self._status = status

    def print(self, line: str) -> None:
        """Print a line above the panel."""
        if self._thread is None:
            echo(line)
        else:
            self._lines.append(line)

    def __enter__(self) -> Self:
        if sys.stdin.isatty() and sys.stdout.isatty():
            import rich.live  # noqa: F401 - now, not during a trial

            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()
            self._requests.attended = True
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join(_MAX_EXIT_S)
            self._thread = None

    def _run(self) -> None:
        from rich.console import Console
        from rich.live import Live

        console = Console(highlight=False)
        drawn: object = None
        decode = getincrementaldecoder("utf-8")("replace").decode
        typed = ""
        try:
            with Live(console=console, auto_refresh=False, transient=False) as live:
                console.show_cursor()  # the operator types behind the panel
                while not self._over.is_set():
                    status = self._status
                    state = (status, self._requests.paused, self._notice, console.size)
                    is_timed = status is not None and status.phase in _TIMED and not typed
                    if _is_in_front() and not is_timed and (state != drawn or self._lines):
                        self._draw(live, hints=True)
                        drawn = state
                    *lines, typed = (typed + decode(_read_typed())).split("\n")
                    for line in lines:
                        console.file.write(_UP_AND_CLEAR)  # Enter moved the cursor on
                        self.obey(line.rstrip("\r"))
                self._draw(live, hints=False)
        except OSError:  # the terminal is gone: the session goes on without it
            return

    def _draw(self, live: Live, *, hints: bool) -> None:
        from rich.text import Text

        while self._lines:
            live.console.print(Text(escaped(self._lines.popleft())))
        lines = status_lines(self._status, is_pause_requested=self._requests.paused)
        if hints:
            lines += [Text(self._notice, "green")] * bool(self._notice) + [Text(HINTS, "reverse")]
        live.update(Text("\n").join(lines), refresh=True)

    def obey(self, line: str) -> None:
        """Carry out a command; a line without a meaning is answered by the list of commands."""
        command, _, text = line.strip().partition(" ")
        note = escaped(text.strip())[:MAX_NOTE_CHARACTERS]
        match command.lower(), note:
            case "p", "":
                self._requests.pause()
                self._notice = ""
            case "r", "":
                # No wish is kept for later: only a pause, or a wait, can be ended.
                is_waiting = self._status is not None and self._status.phase not in _RUNNING
                self._notice = "" if is_waiting or self._requests.paused else "Nothing is paused."
                if not self._notice:
                    self._requests.request_continue()
            case "n", note if note:
                self._requests.note(note)
                self._notice = f"Noted: {note}"
            case "s", "":
                self._notice = "Stopping ..."
                self._request_stop()
            case _:
                self._notice = "There is no such command." if command else ""

    def _request_stop(self) -> None:
        """Have the main thread, where waits are interrupted, ask for the stop.

        `StopSignal.ask` ends a wait by raising in the thread that calls it. It is therefore called
        by the handler of a signal, sent to the main thread alone: a signal to the process could
        reach another thread, and the wait would continue.
        """
        self._stop.asked = True
        main = threading.main_thread().ident
        if main is None or not callable(signal.getsignal(signal.SIGTERM)):
            return
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, signal.SIGTERM)
        else:
            _thread.interrupt_main(signal.SIGTERM)


_UP_AND_CLEAR: Final = "\x1b[1A\x1b[2K"


def _is_in_front() -> bool:
    """Return whether this program may use the terminal: it is not in a shell's background."""
    if os.name != "posix":
        return True
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:  # no job control on this terminal
        return True


def _read_typed() -> bytes:
    """Return what was typed up to Enter, or nothing after a moment.

    `os.read` is used, as a thread that waits in `sys.stdin` would block the end of the program.
    """
    keyboard = sys.stdin.fileno()
    if os.name == "posix" and not select.select([keyboard], [], [], REFRESH_INTERVAL_S)[0]:
        return b""
    if not _is_in_front():
        return b""
    typed = os.read(keyboard, 4096)
    if not typed:
        raise OSError
    return typed


def status_lines(status: Status | None, *, is_pause_requested: bool) -> list[Text]:
    """Return what an operator has to know of a session, before its first status and after it.

    Examples
    --------
    >>> [line.plain for line in status_lines(None, is_pause_requested=False)]
    ['The session begins ...']
    """
    if status is None:
        return [_line(("The session begins ...", ""))]
    lines = [
        _line(
            (_position(status), "bold"), (f"   {status.phase}   {format_left(status.left_s)}", "")
        ),
        _line(("device  ", "dim"), (status.device, "")),
        _line(("noise   ", "dim"), (status.noise, "")),
        *(_tally_line(site, tally) for site, tally in status.tallies.items()),
    ]
    if status.message:
        hint = f" {RESUME_HINT}" if status.phase == Phase.PAUSED else ""
        lines.append(_line((f"{status.message.rstrip('.')}.{hint}", "bold yellow")))
    if is_pause_requested and status.phase != Phase.PAUSED:
        lines.append(_line(("A pause follows this trial.", "yellow")))
    return lines


def format_left(left_s: float) -> str:
    """Return a remaining time as an operator reads it.

    Examples
    --------
    >>> format_left(1234.5), format_left(42.0)
    ('21 min left', '50 s left')
    """
    if left_s <= _SECONDS_UP_TO_S:
        return f"{math.ceil(left_s / _STEP_S) * _STEP_S} s left"
    return f"{round(left_s / 60)} min left"


def _position(status: Status) -> str:
    names = {PRACTICE_BLOCK: "practice", HANDS_OFF_BLOCK: "before practice"}
    block = names.get(status.block, f"block {status.block} of {status.blocks}")
    return f"{status.done} of {status.planned} trials done   {block}"


def _tally_line(site: str, tally: Tally) -> Text:
    count = f"{tally.correct} of {tally.presented} correct"
    return _line((f"{site:<8}", "dim"), (f"{count:<20}", ""), (" ".join(tally.last), "cyan"))


def _line(*spans: tuple[str, str]) -> Text:
    """Return a line that wraps at the width of the terminal."""
    from rich.text import Text

    return Text.assemble(*((escaped(text), style) for text, style in spans))
