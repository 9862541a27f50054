from .physics import (
    ASSUMED_LOSS,
    LEAST_LOSS,
    MOST_LOSS,
    field_strip,
    fingertips_of,
    loads_of,
    loads_per_volt,
    study_gains,
)
from .read import (
    is_recorded,
    paper_study,
    read_levels,
    read_study,
    study_from_canonical,
    with_levels,
)
from .study import Study, StudyError

__all__ = [
    "ASSUMED_LOSS",
    "LEAST_LOSS",
    "MOST_LOSS",
    "Study",
    "StudyError",
    "field_strip",
    "fingertips_of",
    "is_recorded",
    "loads_of",
    "loads_per_volt",
    "paper_study",
    "read_levels",
    "read_study",
    "study_from_canonical",
    "study_gains",
    "with_levels",
]
