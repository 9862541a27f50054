from .screen import ScreenResponder
from .settings import ResponderSettings, own_responder
from .terminal import TerminalResponder
from .window import require_window, window_lacks

__all__ = [
    "ResponderSettings",
    "ScreenResponder",
    "TerminalResponder",
    "own_responder",
    "require_window",
    "window_lacks",
]
