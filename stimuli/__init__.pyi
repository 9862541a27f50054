from .burst_check import BurstCheck, check_burst
from .drive.burst import Burst
from .drive.energy import staircase_energy_above
from .drive.sampled import Drive, SampledDrive
from .fingers.actuator import LoadPerVolt, MeasuredDisplacement, PiezoLayers, load_per_volt
from .fingers.fingertip import Fingertip, Impedance, causal
from .fingers.level import WindowChoice, level_db, shortest_window
from .fingers.peaks import felt, fingertip_peaks
from .load import (
    ForceRectangle,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
)
from .plate.edge import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge
from .plate.material import ALUMINIUM, MATERIALS, Material
from .plate.patch import BondedPatch, Layer
from .plate.response import Estimate, displacement, displacement_map, response
from .plate.scene import Scene
from .plate.strip import Strip
from .plate.transient import transient, transient_response

__all__ = [
    "ALUMINIUM",
    "CLAMPED",
    "MATERIALS",
    "SIMPLY_SUPPORTED",
    "BondedPatch",
    "Burst",
    "BurstCheck",
    "Drive",
    "ElasticEdge",
    "Estimate",
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
    "SampledDrive",
    "Scene",
    "Strip",
    "WindowChoice",
    "causal",
    "check_burst",
    "displacement",
    "displacement_map",
    "felt",
    "fingertip_peaks",
    "level_db",
    "load_per_volt",
    "response",
    "shortest_window",
    "staircase_energy_above",
    "transient",
    "transient_response",
]
