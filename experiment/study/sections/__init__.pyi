from .actuator import (
    CARRIER_PATCH_KEYS,
    MEASURED_KEYS,
    PATCH_KEYS,
    PIEZO_KEYS,
    SIDES,
    Actuator,
    paper_actuators,
)
from .dataset import About, Dataset, ParticipantColumn, Participants
from .design import ASSUMED_ANSWER_S, EARLIEST_ANSWER_S, LEAST_LEVEL_VPP, Design
from .equipment import Contact, DeviceSettings, Masking
from .finger import FINGER_KEYS, FingerLoad
from .plate import (
    PAPER_CUTOFF_HZ,
    PAPER_LENGTH_MM,
    MaterialName,
    Plate,
    is_as_measured,
    is_papers_plate,
)
from .presentation import Keys, Screen, Texts, instructions_of, key_doubts, unsaid_in
from .simulation import PAPER_THRESHOLD_UM, THRESHOLD_VPP, Simulation
from .stimulus import (
    Condition,
    SharedStimulus,
    completed,
    drive_samples,
    stimulus_facts,
    unscaled_peak,
)
from .table import ASKED_FOR, FromTable, KeyRange, file_keys, section

__all__ = [
    "ASKED_FOR",
    "ASSUMED_ANSWER_S",
    "CARRIER_PATCH_KEYS",
    "EARLIEST_ANSWER_S",
    "FINGER_KEYS",
    "LEAST_LEVEL_VPP",
    "MEASURED_KEYS",
    "PAPER_CUTOFF_HZ",
    "PAPER_LENGTH_MM",
    "PAPER_THRESHOLD_UM",
    "PATCH_KEYS",
    "PIEZO_KEYS",
    "SIDES",
    "THRESHOLD_VPP",
    "About",
    "Actuator",
    "Condition",
    "Contact",
    "Dataset",
    "Design",
    "DeviceSettings",
    "FingerLoad",
    "FromTable",
    "KeyRange",
    "Keys",
    "Masking",
    "MaterialName",
    "ParticipantColumn",
    "Participants",
    "Plate",
    "Screen",
    "SharedStimulus",
    "Simulation",
    "Texts",
    "completed",
    "drive_samples",
    "file_keys",
    "instructions_of",
    "is_as_measured",
    "is_papers_plate",
    "key_doubts",
    "paper_actuators",
    "section",
    "stimulus_facts",
    "unsaid_in",
    "unscaled_peak",
]
