"""The trial engine, taken through a list of events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from experiment import Trial
from experiment.trial.engine import TRANSITIONS, IllegalStepError, step, upcoming
from experiment.trial.events import Event, SessionState, Task

if TYPE_CHECKING:
    from collections.abc import Iterable

    from experiment.trial.events import Effect, Happening, Phase


def trial(number: int, block: int = 1, kind: str = "single", side: str = "left") -> Trial:
    """Return a trial of which only its place matters."""
    return Trial(
        number=number,
        block=block,
        condition="main",
        kind=kind,
        side=side,
        level_vpp=100.0,
        foreperiod_s=1.0,
    )


def ready(*trials: Trial, keep_anticipated: bool = False, greeted: bool = True) -> SessionState:
    """Return a session between two trials."""
    return SessionState(
        pending=tuple(Task(t, 1) for t in trials),
        keep_anticipated=keep_anticipated,
        most_anticipated=3,
        response_window_s=3.0,
        greeted=greeted,
    )


def follow(state: SessionState, events: Iterable[Happening]) -> tuple[SessionState, list[Effect]]:
    """Let events happen one after the other; returns the last state and all effects."""
    effects: list[Effect] = []
    for event in events:
        state, new = step(state, event)
        effects += new
    return state, effects


def due(state: SessionState) -> Event:
    """Return what comes next between two trials."""
    return upcoming(state)


def row_of(event: Happening, early: Event = Event.EARLY_KEY) -> Event:
    """Return what the table calls an event."""
    if isinstance(event, Event):
        return event
    return early if event.rt_s is None else Event.KEY


def legal_events(phase: Phase) -> set[Event]:
    """Return the events of the table's rows of a phase."""
    return {event for at, event in TRANSITIONS if at is phase}


def require_refused(state: SessionState, event: Happening) -> None:
    """Check that an event is refused and that nothing changes."""
    before = repr(state)
    with pytest.raises(IllegalStepError):
        step(state, event)
    assert repr(state) == before
