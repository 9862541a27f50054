from .screen import ScreenResponder
from .settings import ResponderSettings, own_responder, texts_without_device
from .terminal import TerminalResponder
from .window import require_window, window_lacks

__all__ = [
    "ResponderSettings",
    "ScreenResponder",
    "TerminalResponder",
    "own_responder",
    "require_window",
    "texts_without_device",
    "window_lacks",
]
