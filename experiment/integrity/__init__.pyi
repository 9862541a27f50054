from .heads import SessionHead, enter_head, person_of, read_heads
from .places import FoundSessions, find_sessions, lost_sessions, refuse_given_link
from .sessions import (
    JOURNAL,
    MEASURED,
    Difference,
    Examined,
    examine,
    refuse_altered,
    refuse_links,
    removed_journal,
    unaltered,
)

__all__ = [
    "JOURNAL",
    "MEASURED",
    "Difference",
    "Examined",
    "FoundSessions",
    "SessionHead",
    "enter_head",
    "examine",
    "find_sessions",
    "lost_sessions",
    "person_of",
    "read_heads",
    "refuse_altered",
    "refuse_given_link",
    "refuse_links",
    "removed_journal",
    "unaltered",
]
