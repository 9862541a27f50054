from . import figures as figures
from .composed import ABOVE, BELOW
from .confusion import stimulus
from .curves import DRAWN, OF_BLANKS, conditions_of, function_table, shared_levels
from .drawing import COLOURS, GROUP, MARKERS, panels, written
from .figures import Picture

__all__ = [
    "ABOVE",
    "BELOW",
    "COLOURS",
    "DRAWN",
    "GROUP",
    "MARKERS",
    "OF_BLANKS",
    "Picture",
    "conditions_of",
    "figures",
    "function_table",
    "panels",
    "shared_levels",
    "stimulus",
    "written",
]
