from .console import print_analysis
from .files import save
from .tables import Analysis, analyse

__all__ = ["Analysis", "analyse", "print_analysis", "save"]
