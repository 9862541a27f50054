from .screen import ScreenResponder
from .settings import ResponderSettings, own_responder
from .terminal import TERMINAL_KEYS, TerminalResponder
from .window import require_window, window_lacks

__all__ = [
    "TERMINAL_KEYS",
    "ResponderSettings",
    "ScreenResponder",
    "TerminalResponder",
    "own_responder",
    "require_window",
    "window_lacks",
]
