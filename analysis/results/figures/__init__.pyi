from . import figures as figures
from .confusion import stimulus
from .drawing import COLOURS, GROUP, MARKERS, panels, written
from .figures import Picture

__all__ = ["COLOURS", "GROUP", "MARKERS", "Picture", "figures", "panels", "stimulus", "written"]
