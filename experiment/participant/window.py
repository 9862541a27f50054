# ruff: noqa: SLF001 - pyglet tells of a lost window only in its private parts
"""The participant's window: opened, or refused in one line; drawn on; lost.

A window can go away under its program: destroyed by another one, or cut off from X. Without care
the first ends in an error of OpenGL, and at the second Xlib ends the program. Neither PsychoPy nor
pyglet tells of it, hence the look into them.
"""

from __future__ import annotations

import ctypes
import os
import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from device.driver import Lack, installing
from experiment.exits import STOPPED_EARLY
from experiment.participant.wrapping import as_drawn, wrapped

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from experiment.study.presentation import Screen


_REMEDY = "in a second environment, " + installing("screen", "constraints-screen.txt")
_kept: list[object] = []
"""What Xlib may call until the program ends."""


def watch_window(
    window: Any, *, destroyed: Callable[[], None], cut_off: Callable[[], None]
) -> None:
    """Have the loss of a window told, on Linux; elsewhere the system tells of a closed one only.

    `destroyed` is called, while the window's events are dispatched, if the window is no more;
    `cut_off`, within a call to the window, if its connection is: nothing that needs it may be
    called from then on, not even to close the window. Where the X server itself is no more, the
    program ends at once with exit code 4.
    """
    if not sys.platform.startswith("linux"):
        return
    import pyglet
    from pyglet.libs.x11 import xlib

    window._event_handlers[xlib.DestroyNotify] = lambda _: destroyed()
    set_exit = getattr(ctypes.CDLL("libX11.so.6"), "XSetIOErrorExitHandler", None)
    if set_exit is None:  # before libX11 1.7: there is no way not to be ended
        return
    mine = {_address(display._display): display for display in pyglet.canvas._displays}

    def lost(display: Any) -> int:
        if _address(display) not in mine:  # the keyboard's: the X server itself is no more
            os.write(2, b"error: the X server has gone away; go on with --resume\n")
            os._exit(STOPPED_EARLY)  # as Xlib would, from the keyboard's thread
        return 0

    lost_c = xlib.XIOErrorHandler(lost)
    stay_c = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(lambda *_: cut_off())
    _kept.extend([lost_c, stay_c, mine])
    xlib.XSetIOErrorHandler(lost_c)
    for display in mine.values():
        set_exit(display._display, stay_c, None)


def _address(pointer: Any) -> int | None:
    return ctypes.cast(pointer, ctypes.c_void_p).value


def abandon(window: Any) -> None:
    """Have PsychoPy and pyglet not close a window that was cut off when the program ends."""
    window._closed = True
    window.winHandle._window = None


BACKGROUND = "#202020"
FOREGROUND = "#e8e8e8"
DIM = "#909090"
PITCH = 1.5
"""Distance of two lines, in heights of a line."""


class NoScreenError(ValueError):
    """A participant cannot be shown anything here."""


def require_python(version: tuple[int, int]) -> None:
    """Refuse a Python for which there is no PsychoPy.

    Examples
    --------
    >>> require_python((3, 13))
    Traceback (most recent call last):
    experiment.participant.window.NoScreenError: --responder screen needs Python 3.11 or 3.12, ...
    """
    if version >= (3, 13):
        raise NoScreenError(
            "--responder screen needs Python 3.11 or 3.12, for which PsychoPy exists; got "
            f"Python {version[0]}.{version[1]}; --responder terminal runs on this one"
        )


def require_display(system: str, display: str | None) -> None:
    """Refuse a Linux process that no X server was named to.

    Examples
    --------
    >>> require_display("linux", ":0")
    >>> require_display("linux", None)
    Traceback (most recent call last):
    experiment.participant.window.NoScreenError: --responder screen needs a display; DISPLAY is ...
    """
    if system == "linux" and not display:
        raise NoScreenError(
            "--responder screen needs a display; DISPLAY is not set: start it from a graphical "
            "session, or use --responder terminal"
        )


def window_lacks() -> tuple[Lack, ...]:
    """Tell what this machine lacks for a window; PsychoPy is not imported, no display is asked."""
    lacks = []
    try:
        require_python(sys.version_info[:2])
        if find_spec("psychopy") is None:
            lacks.append(Lack(what="PsychoPy", remedy=_REMEDY))
    except NoScreenError:
        lacks.append(Lack(what="Python 3.11 or 3.12", remedy="PsychoPy has no newer one"))
    try:
        require_display(sys.platform, os.environ.get("DISPLAY"))
    except NoScreenError:
        remedy = "DISPLAY is not set"
        lacks.append(Lack(what="display", remedy=remedy))
    return tuple(lacks)


def require_window() -> None:
    """Refuse a machine on which no window can be opened; nothing is opened.

    Raises
    ------
    NoScreenError
        Without PsychoPy, the Python that it needs, or a display.
    """
    require_python(sys.version_info[:2])
    require_display(sys.platform, os.environ.get("DISPLAY"))
    _visual()


def open_window(screen: Screen) -> Any:
    """Open a PsychoPy window; without PsychoPy, a display, or that screen, refuse and open none."""
    require_window()
    visual = _visual()
    _require_screen(screen.index)
    return visual.Window(
        size=(screen.width_px, screen.height_px),
        fullscr=screen.full_screen,
        screen=screen.index,
        allowGUI=not screen.full_screen,
        units="height",
        color=BACKGROUND,
        checkTiming=False,
        winType="pyglet",
    )


def _visual() -> Any:
    """Import what draws, if the display answers."""
    try:
        import psychtoolbox  # noqa: F401 - without it PsychoPy reads keys another way
        import pyglet
        from psychopy import logging

        pyglet.options["shadow_window"] = False  # it would bear the program's name, unseen
        pyglet.canvas.get_display()
        logging.console.setLevel(logging.ERROR)
        from psychopy import visual
    except ImportError as error:
        raise NoScreenError(f"--responder screen needs PsychoPy: {_REMEDY}; got {error}") from error
    except Exception as error:
        if type(error).__name__ != "NoSuchDisplayException":  # pyglet's, not importable without
            raise
        raise NoScreenError(
            f"--responder screen needs a display; {os.environ['DISPLAY']} does not answer: check "
            "DISPLAY, or use --responder terminal"
        ) from error
    return visual


def _require_screen(index: int) -> None:
    """Refuse a screen that is not there: PsychoPy would take the first one without a word."""
    import pyglet

    found = len(pyglet.canvas.get_display().get_screens())
    if index >= found:
        raise NoScreenError(
            f"screen.index must be below {found}, the number of screens; got {index}"
        )


class Stage:
    """A window to draw on: heights are in units of the window's, the middle is (0, 0).

    It is `focused` where keys are meant for it, as far as the system tells, and `closed` once
    somebody closed it.
    """

    def __init__(self, screen: Screen) -> None:
        self.window: Any = open_window(screen)
        self._screen = screen
        width_px, height_px = self.window.size
        self.half_width = float(width_px) / float(height_px) / 2
        self._height_px = float(height_px)
        self.closed = False
        self.focused = True
        self._shown: tuple[Any, ...] = ()
        self._exposed = False
        self._cut_off = False
        handle = self.window.winHandle
        handle.set_caption("tactstrip")
        handle.on_close = self._note_close
        handle.on_activate = self._note_focus
        handle.on_deactivate = self._note_no_focus
        handle.on_expose = self._note_exposed
        watch_window(handle, destroyed=self._note_close, cut_off=self._note_cut_off)
        self.take_focus()

    def _note_close(self) -> None:
        self.closed = True

    def _note_cut_off(self) -> None:
        self.closed = self._cut_off = True

    def _note_focus(self) -> None:
        self.focused = True

    def _note_no_focus(self) -> None:
        self.focused = False

    def _note_exposed(self) -> None:
        self._exposed = True

    @property
    def has_font(self) -> bool:
        """Whether the font of the texts is installed."""
        import pyglet

        return bool(pyglet.font.have_font(self._screen.font))

    def take_focus(self) -> None:
        """Ask the system for the keyboard."""
        if self.closed:
            return
        self.window.winHandle.activate()

    def poll(self) -> None:
        """Let the system tell what happened to the window; draw anew what was covered."""
        if self.closed:
            return
        self.window.winHandle.dispatch_events()
        if self._exposed:
            self.show(self._shown)

    def show(self, drawings: Iterable[Any]) -> None:
        """Draw and flip."""
        if self.closed:
            return
        self._shown = tuple(drawings)
        try:
            for drawing in self._shown:
                drawing.draw()
            self.window.flip()
        except Exception:  # what OpenGL says of a window that has just gone away
            if not self._gone():
                raise
        self._exposed = False

    def _gone(self) -> bool:
        if not self.closed:
            self.window.winHandle.dispatch_events()
        return self.closed

    def close(self) -> None:
        """Close the window."""
        if self._cut_off:
            abandon(self.window)
        else:
            self.window.close()

    def broken(self, text: str, *, width: float, height: float | None = None) -> tuple[str, ...]:
        """Break a text into lines of at most `width`, in reading order."""
        return wrapped(text, self._fits(width, height or self._screen.text_height))

    def _fits(self, width: float, height: float) -> Callable[[str], bool]:
        import pyglet

        # the size that TextStim takes for this height
        size_pt = int(height * self._height_px * 0.75)
        font = pyglet.font.load(self._screen.font, size_pt, dpi=96)
        widest_px = width * self._height_px

        def fits(line: str) -> bool:
            drawn = as_drawn(line, right_to_left=self._screen.right_to_left)
            return bool(sum(glyph.advance for glyph in font.get_glyphs(drawn)) <= widest_px)

        return fits

    def lines(
        self,
        lines: Iterable[str],
        *,
        top: float,
        color: str = FOREGROUND,
        height: float | None = None,
        x: float = 0.0,
    ) -> list[Any]:
        """Return drawings of lines below one another, each centred at `x`, the first at `top`."""
        from psychopy import visual

        height = height or self._screen.text_height
        return [
            visual.TextStim(
                self.window,
                text=as_drawn(line, right_to_left=self._screen.right_to_left),
                font=self._screen.font,
                height=height,
                pos=(x, top - PITCH * height * (i + 0.5)),
                color=color,
                wrapWidth=10 * self.half_width,
                autoLog=False,
            )
            for i, line in enumerate(lines)
            if line
        ]

    def centred(self, text: str, *, middle: float, color: str = FOREGROUND) -> list[Any]:
        """Return drawings of a text around a height."""
        lines = self.broken(text, width=1.8 * self.half_width)
        top = middle + PITCH * self._screen.text_height * len(lines) / 2
        return self.lines(lines, top=top, color=color)
