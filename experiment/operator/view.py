"""The operator's live panel on the terminal, and the keys that the operator presses there."""

from __future__ import annotations

import _thread
import contextlib
import math
import os
import signal
import sys
import tempfile
import threading
from collections import deque
from typing import TYPE_CHECKING, Final, Self

from device.printing import echo, escaped
from experiment.operator.keyboard import is_in_front, open_keyboard
from experiment.trial.events import Phase
from experiment.trial.plan import HANDS_OFF_BLOCK, PRACTICE_BLOCK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rich.live import Live
    from rich.text import Text

    from experiment.operator.keyboard import Keyboard
    from experiment.operator.requests import Requests, Status, StopSignal, Tally


REFRESH_INTERVAL_S: Final = 0.1
MAX_NOTE_CHARACTERS: Final = 500
"""Further characters of a note are dropped."""
KEYS_HINT: Final = "p pause   r resume   n note   s stop"
NOTE_HINT: Final = "Enter saves the note, Esc discards it."
RESUME_HINT: Final = "Press r to continue."
_ENTER, _ESCAPE = "\n", "\x1b"
_BACKSPACE: Final = ("\x7f", "\b")

_TIMED: Final = (Phase.ARMING, Phase.FIRING, Phase.ANSWER)
"""Nothing is drawn here unless the operator writes a note: a reaction time is being measured."""
_RUNNING: Final = (Phase.READY, Phase.FOREPERIOD, *_TIMED)
"""Here nothing waits for somebody to continue."""
_MAX_EXIT_S: Final = 1.0
_SECONDS_UP_TO_S: Final = 90.0
_STEP_S: Final = 10


class OperatorView:
    """Shows an operator the progress of a session and takes commands; a context manager.

    Enter it in the main thread, within `StopSignal.on_signals`. On a terminal, one thread draws the
    panel and reads the keys p (pause), r (resume), n (note) and s (stop). In a pipe, or in the
    background of a shell, there is neither panel nor commands. A terminal that goes away, or is
    held by Ctrl-S, does not hold up the session. What libraries write to the terminal's standard
    error appears below the panel at the end.

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
        self._note: str | None = None
        self._lines: deque[str] = deque()
        self._over = threading.Event()
        self._terminal = contextlib.ExitStack()
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
        if sys.stdin.isatty() and sys.stdout.isatty() and is_in_front():
            import rich.live  # noqa: F401 - now, not during a trial

            self._terminal.enter_context(_captured_stderr())
            keyboard = self._terminal.enter_context(open_keyboard())
            self._thread = threading.Thread(target=self._run, args=(keyboard,), daemon=True)
            self._thread.start()
            self._requests.attended = True
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join(_MAX_EXIT_S)
            self._thread = None
        self._terminal.close()

    def _run(self, keyboard: Keyboard) -> None:
        from rich.console import Console
        from rich.live import Live

        console = Console(highlight=False)
        drawn: object = None
        try:
            with Live(console=console, auto_refresh=False) as live:
                while not self._over.is_set():
                    if not is_in_front():
                        self._over.wait(REFRESH_INTERVAL_S)
                        continue
                    status = self._status
                    state = status, self._requests.paused, self._notice, self._note, console.size
                    is_timed = status is not None and status.phase in _TIMED and self._note is None
                    if not is_timed and (state != drawn or self._lines):
                        self._draw(live, hints=True)
                        drawn = state
                    if keyboard.wait(REFRESH_INTERVAL_S):
                        for key in keyboard.read():
                            self.press(key)
                self._draw(live, hints=False)
        except (OSError, EOFError):  # the terminal is gone: the session goes on without it
            return

    def _draw(self, live: Live, *, hints: bool) -> None:
        from rich.text import Text

        while self._lines:
            live.console.print(Text(escaped(self._lines.popleft())))
        lines = status_lines(self._status, is_pause_requested=self._requests.paused)
        if hints and self._note is not None:
            lines += [Text(f"Note: {self._note}", "green"), Text(NOTE_HINT, "reverse")]
        elif hints:
            lines += [Text(self._notice, "green")] * bool(self._notice)
            lines.append(Text(KEYS_HINT, "reverse"))
        live.update(Text("\n").join(lines), refresh=True)

    def press(self, key: str) -> None:
        """Carry out the command of a key, or take it as a character of a note."""
        if self._note is not None:
            self._edit_note(self._note, key)
            return
        match key.lower():
            case "p":
                self._requests.pause()
                self._notice = ""
            case "r":
                # No wish is kept for later: only a pause, or a wait, can be ended.
                is_waiting = self._status is not None and self._status.phase not in _RUNNING
                self._notice = "" if is_waiting or self._requests.paused else "Nothing is paused."
                if not self._notice:
                    self._requests.request_continue()
            case "n":
                self._notice, self._note = "", ""
            case "s":
                self._notice = "Stopping ..."
                self._request_stop()

    def _edit_note(self, note: str, key: str) -> None:
        if key == _ENTER:
            self._note = None
            if text := note.strip():
                self._requests.note(text)
                self._notice = f"Noted: {text}"
        elif key == _ESCAPE:
            self._note = None
        elif key in _BACKSPACE:
            self._note = note[:-1]
        elif escaped(key) == key:
            self._note = (note + key)[:MAX_NOTE_CHARACTERS]

    def _request_stop(self) -> None:
        """Have the main thread, where waits are interrupted, ask for the stop.

        `StopSignal.request` ends a wait by raising in the thread that calls it. It is therefore
        called by the handler of a signal, sent to the main thread alone: a signal to the process
        could reach another thread, and the wait would continue.
        """
        self._stop.is_requested = True
        main = threading.main_thread().ident
        if main is None or not callable(signal.getsignal(signal.SIGTERM)):
            return
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(main, signal.SIGTERM)
        else:
            _thread.interrupt_main(signal.SIGTERM)


@contextlib.contextmanager
def _captured_stderr() -> Iterator[None]:
    """Keep what libraries write to a terminal's standard error, and write it there at the end.

    ALSA and others write to the file descriptor itself; their lines would scroll the panel away.
    """
    number = 2
    if not os.isatty(number):
        yield
        return
    with tempfile.TemporaryFile() as captured:
        terminal = os.dup(number)
        os.dup2(captured.fileno(), number)
        try:
            yield
        finally:
            os.dup2(terminal, number)
            os.close(terminal)
            captured.seek(0)
            with contextlib.suppress(OSError):  # the terminal is gone
                for line in captured.read().decode(errors="replace").splitlines():
                    echo(line, err=True)


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
    lines += [_line(("threshold  ", "dim"), (text, "")) for text in status.estimates]
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
