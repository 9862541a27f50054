from .requests import Monitor, Requests, Status, StopRequested, StopSignal, Tally
from .terminal import KEY, read_keys
from .view import OperatorView

__all__ = [
    "KEY",
    "Monitor",
    "OperatorView",
    "Requests",
    "Status",
    "StopRequested",
    "StopSignal",
    "Tally",
    "read_keys",
]
