"""The operator's live view on the terminal, and the operator's keys there."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from codecs import getincrementaldecoder
from typing import TYPE_CHECKING, Any, Final, Self

from experiment.operator.terminal import OperatorKeys
from experiment.trial.events import Phase

if TYPE_CHECKING:
    from experiment.operator.lines import ViewLines
    from experiment.operator.requests import Requests, Status, StopSignal
    from experiment.operator.terminal import BorrowedTerminal


LOOK_EVERY_S: Final = 0.1
"""So often the view looks for a new status; a key is seen at once."""

_TIMED: Final = (Phase.ARMING, Phase.FIRING, Phase.ANSWER)
"""Nothing is drawn here unless the operator types: a reaction time is being measured."""

_RUNNING: Final = (Phase.READY, Phase.FOREPERIOD, *_TIMED)
"""Here nothing waits for somebody to say that it goes on."""


class OperatorView:
    """Shows an operator how a session stands and takes their keys; a context manager and `Display`.

    To be entered in the main thread, within `StopSignal.on_signals`. On a terminal a thread draws
    the view and reads p pause, r resume, n note, s stop. In a pipe, or in the background of a
    shell, there is neither view nor keys. The terminal's settings are given back at the end, when
    the program is suspended, and when it is stopped by a signal; a terminal that goes away leaves
    the session as it is.

    Parameters
    ----------
    requests : Requests
        Is told of pauses and notes.
    stop : StopSignal
        Is told of a stop.

    Examples
    --------
    >>> from experiment.operator.requests import StopSignal
    >>> from experiment.operator.requests import Requests, Status
    >>> with OperatorView(Requests(), StopSignal()) as view:  # nothing to see in a pipe
    ...     view.show(Status(phase="ready", done=0, planned=5, block=1, blocks=2, left_s=30.0,
    ...                      noise="plays", device="ready", message="", tallies={}))
    """

    def __init__(self, requests: Requests, stop: StopSignal) -> None:
        self._requests = requests
        self._stop = stop
        self._status: Status | None = None
        self._keys = OperatorKeys(
            pause=requests.pause, go_on=self._go_on, stop=self._ask_to_stop, note=requests.note
        )
        self._decoder = getincrementaldecoder("utf-8")("replace")
        self._terminal: BorrowedTerminal | None = None
        self._picture: ViewLines | None = None
        self._drawn: object = None
        self._holding = threading.RLock()
        self._over = threading.Event()
        self._thread: threading.Thread | None = None
        self._suspended_before: Any = None

    def show(self, status: Status) -> None:
        """Take the newest status; it is drawn by the view's own thread."""
        self._status = status

    def __enter__(self) -> Self:
        if os.name != "posix":
            return self
        from experiment.operator.terminal import operators_terminal

        self._terminal = operators_terminal()
        if self._terminal is None:
            return self
        self._suspended_before = signal.signal(signal.SIGTSTP, self._suspend)
        with contextlib.suppress(OSError):
            self._look(self._terminal, 0.0)  # rich is imported now, not during a trial
        self._thread = threading.Thread(
            target=self._run, args=(self._terminal,), name="tactstrip operator", daemon=True
        )
        self._thread.start()
        self._requests.attended = True
        return self

    def __exit__(self, *_: object) -> None:
        if self._terminal is None or self._thread is None:
            return
        self._over.set()
        self._thread.join()
        self._put_down(self._terminal)
        signal.signal(signal.SIGTSTP, self._suspended_before)
        self._terminal.close()

    def _run(self, terminal: BorrowedTerminal) -> None:
        with contextlib.suppress(OSError):  # the terminal is gone: the view falls silent
            while not self._over.is_set():
                self._look(terminal, LOOK_EVERY_S)

    def _look(self, terminal: BorrowedTerminal, within_s: float) -> None:
        """Read what is typed and draw what is new, where the terminal is this program's."""
        if not terminal.in_front:
            self._over.wait(within_s)
            return
        with self._holding:
            if terminal.take() or self._picture is None:
                from experiment.operator.lines import ViewLines  # rich is slow to import

                self._picture, self._drawn = ViewLines(), None
        typed = terminal.read(within_s)
        self._keys.type(self._decoder.decode(typed))
        with self._holding:
            self._draw(terminal, at_once=bool(typed))

    def _draw(self, terminal: BorrowedTerminal, *, at_once: bool) -> None:
        status, keys, picture = self._status, self._keys, self._picture
        timed = status is not None and status.phase in _TIMED
        if picture is None or (timed and not at_once):
            return
        asked = self._requests.paused
        new = (status, asked, keys.notice, keys.prompt, picture.size)
        if new != self._drawn and not terminal.busy:
            self._drawn = new
            terminal.write(
                picture.draw(status, pause_asked=asked, notice=keys.notice, prompt=keys.prompt)
            )

    def _put_down(self, terminal: BorrowedTerminal) -> None:
        """Leave the last picture where it is, without keys, and give the terminal back."""
        with self._holding:
            picture, self._picture = self._picture, None
            with contextlib.suppress(OSError):
                if picture is not None and terminal.in_front:
                    asked = self._requests.paused
                    terminal.write(picture.end(self._status, pause_asked=asked))
                    terminal.flush()
            terminal.give_back()

    def _suspend(self, *_: object) -> None:
        """Give the terminal back and halt; the thread takes it again when the program goes on.

        The system halts no program that has no shell to continue it: then it goes on at once.
        """
        with self._holding:
            if self._terminal is not None:
                self._put_down(self._terminal)
            mine = signal.signal(signal.SIGTSTP, self._suspended_before)
            signal.raise_signal(signal.SIGTSTP)
            signal.signal(signal.SIGTSTP, mine)

    def _go_on(self) -> bool:
        """End what waits for it, and tell whether anything does: a wish is not kept for later."""
        status = self._status
        waits = status is not None and status.phase not in _RUNNING
        if waits or self._requests.paused:
            self._requests.go_on()
            return True
        return False

    def _ask_to_stop(self) -> None:
        """Have the main thread, where waits are interrupted, ask for the stop.

        `StopSignal.ask` ends a wait by raising in the thread that calls it, so it is called by the
        handler of a signal, sent to that thread alone: a signal to the process could reach another
        one, and the wait would go on.
        """
        self._stop.asked = True
        main = threading.main_thread().ident
        if main is not None and callable(signal.getsignal(signal.SIGTERM)):
            signal.pthread_kill(main, signal.SIGTERM)
