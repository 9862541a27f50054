"""What is felt: the strip, its loads and its field, the burst and the check on the strip."""

from stimuli.actuator import LoadPerVolt, MeasuredDisplacement, PiezoLayers, load_per_volt
from stimuli.burst import Burst
from stimuli.drive import Drive, SampledDrive
from stimuli.edge import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge
from stimuli.energy import staircase_energy_above
from stimuli.felt import causal, felt
from stimuli.field import Response, displacement, response
from stimuli.fingertip import Fingertip
from stimuli.level import WindowChoice, level_db, shortest_window
from stimuli.load import (
    ForceRectangle,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
)
from stimuli.maps import DisplacementMap, displacement_map
from stimuli.material import ALUMINIUM, Material
from stimuli.scene import Scene, Work
from stimuli.spectrum import BurstCheck, check_burst
from stimuli.strip import Strip
from stimuli.transient import TransientWork, transient, transient_work

__all__ = [
    "ALUMINIUM",
    "CLAMPED",
    "SIMPLY_SUPPORTED",
    "Burst",
    "BurstCheck",
    "DisplacementMap",
    "Drive",
    "ElasticEdge",
    "Fingertip",
    "ForceRectangle",
    "IdealEdge",
    "Load",
    "LoadPerVolt",
    "Material",
    "MeasuredDisplacement",
    "MomentDisc",
    "MomentRectangle",
    "PiezoLayers",
    "PointForce",
    "PressureDisc",
    "PressureRectangle",
    "Response",
    "SampledDrive",
    "Scene",
    "Strip",
    "TransientWork",
    "WindowChoice",
    "Work",
    "causal",
    "check_burst",
    "displacement",
    "displacement_map",
    "felt",
    "level_db",
    "load_per_volt",
    "response",
    "shortest_window",
    "staircase_energy_above",
    "transient",
    "transient_work",
]
