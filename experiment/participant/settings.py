"""What a responder is made from, and how one of a lab's own is found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from device.installed import RESPONDERS as GROUP
from device.installed import Installed, lookup
from experiment.operator.requests import Requests, StopSignal
from experiment.study.presentation import Texts
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.trial.responder import RESPONDERS, SessionPart

if TYPE_CHECKING:
    from experiment.study.presentation import Keys, Screen
    from experiment.tasks.task import Task


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponderSettings:
    """What a responder is made from.

    Attributes
    ----------
    responses : tuple of str
        The answers that the study offers; `answers` returns those that count in a part.
    screen : Screen
        The window.
    keys : Keys
        What each key means.
    texts : Texts
        What is read.
    parts : frozenset of SessionPart
        The parts that may come.
    requests : Requests
        The operator's wishes; notes that are left there come into the journal.
    stop : StopSignal
        May be asked to stop the session; ends every wait.
    task : Task
        The task: its sites and answers.

    Examples
    --------
    >>> from experiment import paper_study
    >>> study = paper_study()
    >>> settings = ResponderSettings(responses=study.design.responses, screen=study.screen,
    ...                              keys=study.keys, texts=study.texts)
    >>> settings.requests.note("pressed twice")
    >>> settings.requests.notes()
    ('pressed twice',)
    """

    responses: tuple[str, ...]
    screen: Screen
    keys: Keys
    texts: Texts
    parts: frozenset[SessionPart] = frozenset(SessionPart)
    requests: Requests = field(default_factory=Requests)
    stop: StopSignal = field(default_factory=StopSignal)
    task: Task = LEFT_RIGHT_BOTH

    def answers(self, part: SessionPart) -> tuple[str, ...]:
        """Return the answers that count in a part.

        Parameters
        ----------
        part : SessionPart
            A part of the session.

        Returns
        -------
        tuple of str
            Those that the study offers; with the hands off, also that nothing was noticed.
        """
        return self.task.offered(self.responses, hands_off=part.hands_off)

    def prompt(self, part: SessionPart) -> str:
        """Return the question that is asked in a part.

        Parameters
        ----------
        part : SessionPart
            A part of the session.

        Returns
        -------
        str
            With names of answers in braces for their keys.
        """
        return self.texts.prompt_hands_off if part.hands_off else self.texts.prompt


def texts_without_device(texts: Texts) -> Texts:
    """Return the texts of practice without a device: guesses are not judged.

    Texts that the study sets stay as they are.

    >>> from experiment.study.files import paper_study
    >>> texts_without_device(paper_study().texts).practice
    'Now a few trials for practice. Nothing moves, so no answer is right or wrong.'
    """
    is_default = texts.practice == Texts().practice
    return texts.completed(practice=_NOTHING_MOVES) if is_default else texts


_NOTHING_MOVES: Final = (
    "Now a few trials for practice. Nothing moves, so no answer is right or wrong."
)


def installed_responder(name: str) -> Installed:
    """Return an installed responder by its name, or refuse with the names of those there are.

    >>> installed_responder("robot")
    Traceback (most recent call last):
    ValueError: must be one of screen, terminal, simulated; got 'robot', which no installed ...
    """
    return lookup(GROUP, name, RESPONDERS)
