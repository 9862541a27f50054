from .participant.settings import ResponderSettings
from .session.conduct import begin, resume
from .session.run import run_session
from .session.setting import Setting
from .session.simulate import simulate_study
from .study.read import paper_study, read_study
from .study.study import Study, StudyError
from .terms.record import COLUMNS, TrialRow
from .terms.responder import AwaitedAnswer, Press, Progress, Responder, SessionPart
from .trial.draw import draw_plan
from .trial.plan import Plan, Trial

__all__ = [
    "COLUMNS",
    "AwaitedAnswer",
    "Plan",
    "Press",
    "Progress",
    "Responder",
    "ResponderSettings",
    "SessionPart",
    "Setting",
    "Study",
    "StudyError",
    "Trial",
    "TrialRow",
    "begin",
    "draw_plan",
    "paper_study",
    "read_study",
    "resume",
    "run_session",
    "simulate_study",
]
