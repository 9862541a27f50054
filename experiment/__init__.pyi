from .check.check import check_study
from .participant.settings import ResponderSettings
from .perception.gains import ConditionGains
from .record.entries import Entry
from .record.files import ArchiveError
from .record.folder import SessionFolder
from .record.history import replay
from .record.journal import Journal, JournalError, JournalWriteError, read_journal
from .record.rows import COLUMNS, TrialRow
from .record.verify import examine
from .session.run import run_session
from .session.simulate import simulate_study
from .study.base import StudyError
from .study.files import first_study, paper_study, read_study, study_from_text
from .study.physics import study_gains
from .study.study import Study
from .tasks.task import Answer, Burst, Guessing, Presentation, Sensation, Task
from .trial.draw import draw_plan
from .trial.plan import Plan, PlanError, Trial
from .trial.responder import (
    AwaitedAnswer,
    Press,
    Progress,
    Responder,
    ResponderError,
    SessionPart,
)

__all__ = [
    "COLUMNS",
    "Answer",
    "ArchiveError",
    "AwaitedAnswer",
    "Burst",
    "ConditionGains",
    "Entry",
    "Guessing",
    "Journal",
    "JournalError",
    "JournalWriteError",
    "Plan",
    "PlanError",
    "Presentation",
    "Press",
    "Progress",
    "Responder",
    "ResponderError",
    "ResponderSettings",
    "Sensation",
    "SessionFolder",
    "SessionPart",
    "Study",
    "StudyError",
    "Task",
    "Trial",
    "TrialRow",
    "check_study",
    "draw_plan",
    "examine",
    "first_study",
    "paper_study",
    "read_journal",
    "read_study",
    "replay",
    "run_session",
    "simulate_study",
    "study_from_text",
    "study_gains",
]
