from .burst import Burst
from .energy import staircase_energy_above
from .fit import BurstCheck, check_burst
from .noise import LEAST_LEVEL_DBFS, pink_loop
from .sampled import Drive, SampledDrive
from .sums import exponential_sums
from .windows import WINDOWS, Window, sines

__all__ = [
    "LEAST_LEVEL_DBFS",
    "WINDOWS",
    "Burst",
    "BurstCheck",
    "Drive",
    "SampledDrive",
    "Window",
    "check_burst",
    "exponential_sums",
    "pink_loop",
    "sines",
    "staircase_energy_above",
]
