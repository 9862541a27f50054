"""What is felt: the strip, the burst and the check of one against the other."""

from stimuli.burst import Burst
from stimuli.edge import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge
from stimuli.energy import staircase_energy_above
from stimuli.material import ALUMINIUM, Material
from stimuli.spectrum import BurstCheck, check_burst
from stimuli.strip import Strip

__all__ = [
    "ALUMINIUM",
    "CLAMPED",
    "SIMPLY_SUPPORTED",
    "Burst",
    "BurstCheck",
    "ElasticEdge",
    "IdealEdge",
    "Material",
    "Strip",
    "check_burst",
    "staircase_energy_above",
]
