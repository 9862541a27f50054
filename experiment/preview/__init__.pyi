from .check import ConditionCheck, StudyCheck, check_study, require_fit, require_mock_suitable
from .check_report import burst_words, check_findings
from .device import DeviceCheck, check_device, device_findings, machine_findings, machine_lacks
from .field import (
    PlateBand,
    PlateMap,
    PlateMotion,
    plate_band,
    plate_map,
    plate_motion,
    with_bursts,
)
from .field_figure import animate, render
from .field_report import field_csv, field_text
from .plate import plate_of

__all__ = [
    "ConditionCheck",
    "DeviceCheck",
    "PlateBand",
    "PlateMap",
    "PlateMotion",
    "StudyCheck",
    "animate",
    "burst_words",
    "check_device",
    "check_findings",
    "check_study",
    "device_findings",
    "field_csv",
    "field_text",
    "machine_findings",
    "machine_lacks",
    "plate_band",
    "plate_map",
    "plate_motion",
    "plate_of",
    "render",
    "require_fit",
    "require_mock_suitable",
    "with_bursts",
]
