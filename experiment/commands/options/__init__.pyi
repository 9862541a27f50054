from .hardware import (
    Step,
    answer,
    confirmed,
    device_failures,
    hardware_options,
    working,
)
from .plate import (
    CEILING,
    QUESTIONS,
    ceiling_vpp,
    completed,
    plate_options,
    plate_study,
    told_paths,
)
from .responders import display_beside, distribution_of, responder_named

__all__ = [
    "CEILING",
    "QUESTIONS",
    "Step",
    "answer",
    "ceiling_vpp",
    "completed",
    "confirmed",
    "device_failures",
    "display_beside",
    "distribution_of",
    "hardware_options",
    "plate_options",
    "plate_study",
    "responder_named",
    "told_paths",
    "working",
]
