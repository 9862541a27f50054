from . import manifest as manifest
from .bids import describe, export_bids
from .disk import UNWAITED
from .files import ArchiveError, write_atomically
from .folders import SessionFolder, session_folders
from .history import History, OpenTrial
from .journal import Journal, JournalWriteError
from .manifest import Manifest, Search, search
from .participants import participant_facts
from .withdraw import Person, held, look_up, remove

__all__ = [
    "UNWAITED",
    "ArchiveError",
    "History",
    "Journal",
    "JournalWriteError",
    "Manifest",
    "OpenTrial",
    "Person",
    "Search",
    "SessionFolder",
    "describe",
    "export_bids",
    "held",
    "look_up",
    "manifest",
    "participant_facts",
    "remove",
    "search",
    "session_folders",
    "write_atomically",
]
