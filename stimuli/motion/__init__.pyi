from .modes import n_functions
from .motion import motion_of
from .peaks import peaks_of

__all__ = ["motion_of", "n_functions", "peaks_of"]
