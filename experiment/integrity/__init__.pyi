from .heads import SessionHead, enter_head, read_heads
from .sessions import (
    JOURNAL,
    Difference,
    Examined,
    examine,
    lost_sessions,
    people_of,
    refuse_altered,
    removed_file,
    session_paths,
)

__all__ = [
    "JOURNAL",
    "Difference",
    "Examined",
    "SessionHead",
    "enter_head",
    "examine",
    "lost_sessions",
    "people_of",
    "read_heads",
    "refuse_altered",
    "removed_file",
    "session_paths",
]
