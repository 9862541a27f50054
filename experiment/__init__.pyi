from .archive.files import ArchiveError
from .archive.folders import SessionFolder
from .archive.history import replay
from .archive.journal import Entry, Journal, JournalError, JournalWriteError, read_journal
from .integrity.sessions import examine
from .participant.settings import ResponderSettings
from .session.run import run_session
from .session.simulate import simulate_study
from .study.read import first_study, paper_study, read_study
from .study.study import Study, StudyError
from .terms.record import COLUMNS, TrialRow
from .terms.responder import AwaitedAnswer, Press, Progress, Responder, SessionPart
from .trial.draw import draw_plan
from .trial.plan import Plan, Trial

__all__ = [
    "COLUMNS",
    "ArchiveError",
    "AwaitedAnswer",
    "Entry",
    "Journal",
    "JournalError",
    "JournalWriteError",
    "Plan",
    "Press",
    "Progress",
    "Responder",
    "ResponderSettings",
    "SessionFolder",
    "SessionPart",
    "Study",
    "StudyError",
    "Trial",
    "TrialRow",
    "draw_plan",
    "examine",
    "first_study",
    "paper_study",
    "read_journal",
    "read_study",
    "replay",
    "run_session",
    "simulate_study",
]
