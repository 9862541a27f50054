from .drive.burst import Burst
from .drive.energy import staircase_energy_above
from .drive.fit import BurstCheck, check_burst
from .drive.sampled import Drive, SampledDrive
from .field.field import Response, displacement, response
from .field.maps import DisplacementMap, displacement_map
from .field.scene import Scene, Work
from .field.synthesis import TransientWork
from .fingers.actuator import LoadPerVolt, MeasuredDisplacement, PiezoLayers, load_per_volt
from .fingers.fingertip import Fingertip, causal, felt
from .fingers.impedance import Impedance
from .fingers.level import WindowChoice, level_db, shortest_window
from .fingers.work import FeltWork, felt_work
from .load import (
    ForceRectangle,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
)
from .motion.history import transient, transient_work
from .strip.edge import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge
from .strip.material import ALUMINIUM, MATERIALS, Material
from .strip.patch import BondedPatch, Layer
from .strip.strip import Strip

__all__ = [
    "ALUMINIUM",
    "CLAMPED",
    "MATERIALS",
    "SIMPLY_SUPPORTED",
    "BondedPatch",
    "Burst",
    "BurstCheck",
    "DisplacementMap",
    "Drive",
    "ElasticEdge",
    "FeltWork",
    "Fingertip",
    "ForceRectangle",
    "IdealEdge",
    "Impedance",
    "Layer",
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
    "felt_work",
    "level_db",
    "load_per_volt",
    "response",
    "shortest_window",
    "staircase_energy_above",
    "transient",
    "transient_work",
]
