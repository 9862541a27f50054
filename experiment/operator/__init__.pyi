from .requests import Display, Requests, Status, StopRequested, StopSignal, Tally
from .terminal import KEY, read_keys
from .view import OperatorView

__all__ = [
    "KEY",
    "Display",
    "OperatorView",
    "Requests",
    "Status",
    "StopRequested",
    "StopSignal",
    "Tally",
    "read_keys",
]
