"""What a responder is made from, and how one of a lab's own is found."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from device.installed import RESPONDERS as GROUP
from device.installed import Installed, lookup
from experiment.operator.requests import Requests, StopSignal
from experiment.study.presentation import Texts
from experiment.trial.responder import RESPONDERS, SessionPart

if TYPE_CHECKING:
    from experiment.study.presentation import Keys, Screen


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponderSettings:
    """What a responder is made from.

    Attributes
    ----------
    responses : tuple of str
        The answers that the study offers; `SessionPart.answers` tells which count in a part.
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

    Examples
    --------
    >>> from experiment import paper_study
    >>> study = paper_study()
    >>> settings = ResponderSettings(responses=study.design.responses, screen=study.screen,
    ...                              keys=study.keys, texts=study.shown_texts)
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


def texts_without_device(texts: Texts) -> Texts:
    """Return what is read where nothing moves: nobody is told whether a guess was right.

    Texts of the study's own stay as they are.

    >>> from experiment.study.files import paper_study
    >>> texts_without_device(paper_study().texts).practice
    'Now a few trials for practice. Nothing moves, so no answer is right or wrong.'
    """
    return replace(texts, practice=_NOTHING_MOVES) if texts.practice == Texts().practice else texts


_NOTHING_MOVES: Final = (
    "Now a few trials for practice. Nothing moves, so no answer is right or wrong."
)


def own_responder(name: str) -> Installed:
    """Return an installed responder by its name, or refuse with the names of those there are.

    >>> own_responder("robot")
    Traceback (most recent call last):
    ValueError: must be one of screen, terminal, simulated; got 'robot', which no installed ...
    """
    return lookup(GROUP, name, RESPONDERS)
