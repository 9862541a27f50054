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
from .sources import (
    cutoff_source,
    displacement_source,
    measured_beside,
    plate_sources,
    plate_words,
    study_sources,
    words_of_the_others,
)
from .study import Study, StudyError

__all__ = [
    "ASSUMED_LOSS",
    "LEAST_LOSS",
    "MOST_LOSS",
    "Study",
    "StudyError",
    "cutoff_source",
    "displacement_source",
    "field_strip",
    "fingertips_of",
    "is_recorded",
    "loads_of",
    "loads_per_volt",
    "measured_beside",
    "paper_study",
    "plate_sources",
    "plate_words",
    "read_levels",
    "read_study",
    "study_from_canonical",
    "study_gains",
    "study_sources",
    "with_levels",
    "words_of_the_others",
]
