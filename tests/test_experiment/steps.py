"""The trial engine, taken through a list of events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from experiment import Trial
from experiment.trial.engine import TRANSITIONS, IllegalStepError, next_event, step
from experiment.trial.events import Attempt, Event, SessionState

if TYPE_CHECKING:
    from collections.abc import Iterable

    from experiment.trial.events import Effect, Input, Phase


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


def ready(*trials: Trial, accept_premature: bool = False, welcomed: bool = True) -> SessionState:
    """Return a session between two trials."""
    return SessionState(
        pending=tuple(Attempt(t, 1) for t in trials),
        accept_premature=accept_premature,
        max_premature=3,
        response_window_s=3.0,
        welcomed=welcomed,
    )


def follow(state: SessionState, events: Iterable[Input]) -> tuple[SessionState, list[Effect]]:
    """Let events happen one after the other; returns the last state and all effects."""
    effects: list[Effect] = []
    for event in events:
        state, new = step(state, event)
        effects += new
    return state, effects


def due(state: SessionState) -> Event:
    """Return what comes next between two trials."""
    return next_event(state)


def row_of(event: Input, early: Event = Event.PREMATURE) -> Event:
    """Return what the table calls an event."""
    if isinstance(event, Event):
        return event
    return early if event.rt_s is None else Event.RESPONSE


def legal_events(phase: Phase) -> set[Event]:
    """Return the events of the table's rows of a phase."""
    return {event for at, event in TRANSITIONS if at is phase}


def require_refused(state: SessionState, event: Input) -> None:
    """Check that an event is refused and that nothing changes."""
    before = repr(state)
    with pytest.raises(IllegalStepError):
        step(state, event)
    assert repr(state) == before
