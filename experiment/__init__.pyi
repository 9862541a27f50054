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
    "AwaitedAnswer",
    "Plan",
    "Press",
    "Progress",
    "Responder",
    "ResponderSettings",
    "SessionPart",
    "Study",
    "StudyError",
    "Trial",
    "TrialRow",
    "draw_plan",
    "first_study",
    "paper_study",
    "read_study",
    "run_session",
    "simulate_study",
]
