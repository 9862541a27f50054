from .requests import Monitor, Requests, Status, StopRequested, StopSignal, Tally
from .terminal import KEY
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
]
