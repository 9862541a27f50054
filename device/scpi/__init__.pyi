from .dialects import EMULATED, INFINITE_OHM
from .generator import generator_device, identify_generator
from .visa import instrument_lack

__all__ = ["EMULATED", "INFINITE_OHM", "generator_device", "identify_generator", "instrument_lack"]
