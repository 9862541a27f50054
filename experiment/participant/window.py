"""The participant's window: opened, or refused in one line; texts broken into lines; drawn on.

A window that another program destroys raises an error when it is drawn on next, which ends the
session as a stop does: the record is complete, and the session can be resumed.
"""

from __future__ import annotations

import contextlib
import os
import sys
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

from device.driver import Lack, installing

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from experiment.study.presentation import Screen


_REMEDY = "in a second environment, " + installing("screen", "constraints-screen.txt")

BACKGROUND = "#202020"
FOREGROUND = "#e8e8e8"
DIM = "#909090"
PITCH = 1.5
"""Distance of two lines, in heights of a line."""


class NoScreenError(ValueError):
    """A participant cannot be shown anything here."""


def window_lacks() -> tuple[Lack, ...]:
    """Return what this machine lacks for a window; PsychoPy is not imported, no display opened."""
    lacks = []
    if sys.version_info >= (3, 13):
        lacks.append(Lack(what="Python 3.11 or 3.12", remedy="PsychoPy supports no newer one"))
    elif find_spec("psychopy") is None:
        lacks.append(Lack(what="PsychoPy", remedy=_REMEDY))
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        remedy = "DISPLAY is not set: start tactstrip from a graphical session"
        lacks.append(Lack(what="display", remedy=remedy))
    return tuple(lacks)


def require_window() -> None:
    """Raise NoScreenError on a machine on which no window can be opened; none is opened."""
    for lack in window_lacks():
        raise NoScreenError(f"--responder screen: {lack}; --responder terminal needs no window")
    _visual()


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


class Stage:
    """A window to draw on: lengths are in units of its height, and its center is (0, 0).

    It is `focused` if the system reports that it has the keyboard, and `closed` once a user closed
    it. `has_font` is true if the font of the texts is installed.
    """

    def __init__(self, screen: Screen) -> None:
        require_window()
        visual = _visual()
        import pyglet

        # PsychoPy would take the first screen in the place of a missing one without a word.
        n_screens = len(pyglet.canvas.get_display().get_screens())
        if screen.index >= n_screens:
            raise NoScreenError(
                f"screen.index must be below {n_screens}, the number of screens; got {screen.index}"
            )
        self.window: Any = visual.Window(
            size=(screen.width_px, screen.height_px),
            fullscr=screen.full_screen,
            screen=screen.index,
            allowGUI=not screen.full_screen,
            units="height",
            color=BACKGROUND,
            checkTiming=False,
            winType="pyglet",
        )
        self._screen = screen
        width_px, self._height_px = map(float, self.window.size)
        self.half_width = width_px / self._height_px / 2
        self.has_font = bool(pyglet.font.have_font(screen.font))
        self.closed = False
        self.focused = True
        self._shown: tuple[Any, ...] = ()
        self._exposed = False
        handle = self.window.winHandle
        handle.set_caption("tactstrip")
        handle.on_close = partial(self._note, closed=True)
        handle.on_activate = partial(self._note, focused=True)
        handle.on_deactivate = partial(self._note, focused=False)
        handle.on_expose = partial(self._note, _exposed=True)
        self.take_focus()

    def _note(self, **state: bool) -> None:
        """Keep what the system reports of the window."""
        vars(self).update(state)

    def take_focus(self) -> None:
        """Ask the system for the keyboard."""
        if not self.closed:
            self.window.winHandle.activate()

    def poll(self) -> None:
        """Process the system's events for the window; redraw what was covered."""
        if not self.closed:
            self.window.winHandle.dispatch_events()
        if self._exposed:
            self.show(self._shown)

    def show(self, drawings: Iterable[Any]) -> None:
        """Draw and flip."""
        if self.closed:
            return
        self._shown = tuple(drawings)
        for drawing in self._shown:
            drawing.draw()
        self.window.flip()
        self._exposed = False

    def close(self) -> None:
        """Close the window, which may be gone already."""
        with contextlib.suppress(Exception):
            self.window.close()

    def broken(self, text: str, *, width: float, height: float | None = None) -> tuple[str, ...]:
        """Break a text into lines of at most `width`, in reading order."""
        import pyglet

        # the size that TextStim takes for this height
        size_pt = int((height or self._screen.text_height) * self._height_px * 0.75)
        font = pyglet.font.load(self._screen.font, size_pt, dpi=96)

        def fits(line: str) -> bool:
            glyphs = font.get_glyphs(as_drawn(line, right_to_left=self._screen.right_to_left))
            return bool(sum(glyph.advance for glyph in glyphs) <= width * self._height_px)

        return wrapped(text, fits)

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


# Texts for a window that knows neither line breaks nor right-to-left scripts


def wrapped(text: str, fits: Callable[[str], bool]) -> tuple[str, ...]:
    """Break a text of any language into lines, in reading order; its own line breaks are kept.

    Text without spaces is broken anywhere, at least one character to a line.

    Examples
    --------
    >>> wrapped("one two three", lambda line: len(line) <= 7)
    ('one two', 'three')
    >>> wrapped("触覚実験", lambda line: len(line) <= 3)
    ('触覚実', '験')
    """
    lines: list[str] = []
    for paragraph in text.split("\n"):
        line = ""
        for word in paragraph.split():
            longer = f"{line} {word}" if line else word
            if fits(longer):
                line = longer
                continue
            if line:
                lines.append(line)
            *whole, line = _pieces(word, fits)
            lines += whole
        lines.append(line)
    return tuple(lines)


def _pieces(word: str, fits: Callable[[str], bool]) -> list[str]:
    """Break a word that is longer than a line."""
    pieces = [word[:1]]
    for character in word[1:]:
        if fits(pieces[-1] + character):
            pieces[-1] += character
        else:
            pieces.append(character)
    return pieces


def as_drawn(line: str, *, right_to_left: bool) -> str:
    """Return a line's characters from left to right, in the shapes in which they join.

    The line is in reading order, and was broken before: one that is broken after this would begin
    with its end. `right_to_left` is of the line as a whole.
    """
    from arabic_reshaper import ArabicReshaper
    from bidi.algorithm import get_display

    # vowel signs follow their letter once the line is turned around
    reshaper = ArabicReshaper({"delete_harakat": False, "shift_harakat_position": True})
    drawn: str = get_display(reshaper.reshape(line), base_dir="R" if right_to_left else "L")
    return drawn
