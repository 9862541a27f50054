from . import manifest as manifest
from .bids import describe, export_bids
from .disk import DISK, FOLDER_MODE, UNWAITED, LockError, lock_on, make_folder, write_new
from .files import ArchiveError, write_atomically
from .folders import SessionFolder, session_folders
from .history import BROKEN, History, OpenTrial
from .journal import Journal, JournalWriteError
from .manifest import LEVELS_SUFFIX, Manifest, Search, search
from .participants import participant_facts
from .withdraw import Person, held, look_up, remove

__all__ = [
    "BROKEN",
    "DISK",
    "FOLDER_MODE",
    "LEVELS_SUFFIX",
    "UNWAITED",
    "ArchiveError",
    "History",
    "Journal",
    "JournalWriteError",
    "LockError",
    "Manifest",
    "OpenTrial",
    "Person",
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
    "remove",
    "search",
    "session_folders",
    "write_atomically",
    "write_new",
]
