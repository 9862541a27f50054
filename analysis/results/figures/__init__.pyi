from . import figures as figures
from .confusion import stimulus
from .figures import Picture

__all__ = ["Picture", "figures", "stimulus"]
