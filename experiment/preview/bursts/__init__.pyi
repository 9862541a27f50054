from .choice import ChosenBurst, chosen_burst
from .compared import compare_bursts, grid_of
from .edges import edge_words, other_edge, with_other_edge
from .report import bursts_findings

__all__ = [
    "ChosenBurst",
    "bursts_findings",
    "chosen_burst",
    "compare_bursts",
    "edge_words",
    "grid_of",
    "other_edge",
    "with_other_edge",
]
