from .around import sliver_doubt
from .functions import Functions
from .patched import PatchedModes, has_room, patched_modes

__all__ = ["Functions", "PatchedModes", "has_room", "patched_modes", "sliver_doubt"]
