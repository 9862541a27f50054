from .chunks import spread
from .cluster import connected
from .crew import StoppedError
from .kept import Kept, computed_in

__all__ = ["Kept", "StoppedError", "computed_in", "connected", "spread"]
