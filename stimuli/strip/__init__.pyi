from .dispersion import relation
from .edge import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge
from .material import ALUMINIUM, MATERIALS, Material
from .patch import BondedPatch, Laminate, Layer, cutoff_factor, laminate, layer_of
from .roots import clamped_roots, section_roots
from .strip import Strip
from .waves import ratio, supported_cutoff_hz

__all__ = [
    "ALUMINIUM",
    "CLAMPED",
    "MATERIALS",
    "SIMPLY_SUPPORTED",
    "BondedPatch",
    "ElasticEdge",
    "IdealEdge",
    "Laminate",
    "Layer",
    "Material",
    "Strip",
    "clamped_roots",
    "cutoff_factor",
    "laminate",
    "layer_of",
    "ratio",
    "relation",
    "section_roots",
    "supported_cutoff_hz",
]
