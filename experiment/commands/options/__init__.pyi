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
from .resumed import plan_to_resume, refuse_another_number, resumed_line

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
    "plan_to_resume",
    "plate_options",
    "plate_study",
    "refuse_another_number",
    "responder_named",
    "resumed_line",
    "told_paths",
    "working",
]
