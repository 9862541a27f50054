"""A window that goes away under its program: destroyed by another one, or cut off from X.

Without this, the first ends in an error of OpenGL, and at the second Xlib ends the program.
Neither PsychoPy nor pyglet tells of it, hence the look into them.
"""
# ruff: noqa: SLF001 - pyglet tells of a lost window only in its private parts

from __future__ import annotations

import ctypes
import os
import sys
from typing import TYPE_CHECKING, Any

from experiment.exits import STOPPED_EARLY

if TYPE_CHECKING:
    from collections.abc import Callable

_kept: list[object] = []
"""What Xlib may call until the program ends."""


def watch_window(
    window: Any, *, destroyed: Callable[[], None], cut_off: Callable[[], None]
) -> None:
    """Have the loss of a window told, on Linux; elsewhere the system tells of a closed one only.

    Parameters
    ----------
    window : pyglet.window.Window
        The window.
    destroyed : callable
        Is called, while the window's events are dispatched, if it is no more.
    cut_off : callable
        Is called, within a call to the window, if its connection is no more: nothing that needs
        it may be called from then on, not even to close the window. Where the X server itself is
        no more, the program ends at once with exit code 4.
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
    """Have a window that was cut off not be closed, by PsychoPy or pyglet, when the program ends.

    Parameters
    ----------
    window : psychopy.visual.Window
        The window.
    """
    window._closed = True
    window.winHandle._window = None
