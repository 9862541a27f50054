from .screen import ScreenResponder
from .terminal import TERMINAL_KEYS, TerminalResponder
from .window import require_window, window_lacks

__all__ = [
    "TERMINAL_KEYS",
    "ScreenResponder",
    "TerminalResponder",
    "require_window",
    "window_lacks",
]
