from . import manifest as manifest
from .bids import describe, export_bids
from .bids_tables import EVENT_COLUMNS
from .disk import DISK, FOLDER_MODE, UNWAITED, Disk, LockError, lock_on, make_folder, write_new
from .files import HEADS, TEMPORARY, ArchiveError, LinkError, refuse_link, write_atomically
from .folders import SessionFolder
from .history import BROKEN, History, OpenTrial, replay
from .journal import (
    Journal,
    JournalError,
    JournalFile,
    JournalLineError,
    JournalWriteError,
    RecordSchemaError,
    read_ends,
    read_journal,
)
from .manifest import LEVELS_SUFFIX, Manifest, Search, search
from .participants import participant_facts
from .withdraw import Person, held, look_up, remove

__all__ = [
    "BROKEN",
    "DISK",
    "EVENT_COLUMNS",
    "FOLDER_MODE",
    "HEADS",
    "LEVELS_SUFFIX",
    "TEMPORARY",
    "UNWAITED",
    "ArchiveError",
    "Disk",
    "History",
    "Journal",
    "JournalError",
    "JournalFile",
    "JournalLineError",
    "JournalWriteError",
    "LinkError",
    "LockError",
    "Manifest",
    "OpenTrial",
    "Person",
    "RecordSchemaError",
    "Search",
    "SessionFolder",
    "describe",
    "export_bids",
    "held",
    "lock_on",
    "look_up",
    "make_folder",
    "manifest",
    "participant_facts",
    "read_ends",
    "read_journal",
    "refuse_link",
    "remove",
    "replay",
    "search",
    "write_atomically",
    "write_new",
]
