"""The states of a device and every legal step between them.

Read aloud: a device that was loaded can be enabled; once live it can be armed; once armed it is
fired, disarmed or runs out of its time to live, and is live again; a stop leads from anywhere to
the safe state, which only an explicit enable leaves.
"""

from __future__ import annotations

from enum import StrEnum

from device.errors import Refusal


class State(StrEnum):
    """States of a device.

    Examples
    --------
    >>> State("live") is State.LIVE
    True
    """

    CLOSED = "closed"
    """The host has not opened it."""
    IDLE = "idle"
    """It is switched on, and holds no waveform."""
    LOADED = "loaded"
    """It holds a waveform; its output is off."""
    LIVE = "live"
    """Its output is on."""
    ARMED = "armed"
    """A token waits to be fired."""
    FIRED = "fired"
    """A burst plays."""
    SAFE = "safe"
    """It was stopped; its output is at zero until it is enabled again."""


class Step(StrEnum):
    """What can happen to a device: messages, events of its own, and the stop that is both."""

    LOAD = "load"
    LEVEL = "level"
    ENABLE = "enable"
    ARM = "arm"
    FIRE = "fire"
    DISARM = "disarm"
    EXPIRE = "expire"
    FINISH = "finish"
    STOP = "stop"


# LOAD and LEVEL are listed even where they change no state, because they are illegal while a token
# is armed or playing: the participant must feel what was armed. STOP is legal in every state. Only
# ENABLE leaves SAFE, so that no late or spurious message can switch an output on.
TRANSITIONS = {
    (State.IDLE, Step.LOAD): State.LOADED,
    (State.IDLE, Step.LEVEL): State.IDLE,
    (State.LOADED, Step.LOAD): State.LOADED,
    (State.LOADED, Step.LEVEL): State.LOADED,
    (State.LOADED, Step.ENABLE): State.LIVE,
    (State.LIVE, Step.LOAD): State.LIVE,
    (State.LIVE, Step.LEVEL): State.LIVE,
    (State.LIVE, Step.ENABLE): State.LIVE,
    (State.LIVE, Step.ARM): State.ARMED,
    (State.ARMED, Step.FIRE): State.FIRED,
    (State.ARMED, Step.DISARM): State.LIVE,
    (State.ARMED, Step.EXPIRE): State.LIVE,
    (State.FIRED, Step.FINISH): State.LIVE,
    (State.SAFE, Step.LOAD): State.SAFE,
    (State.SAFE, Step.LEVEL): State.SAFE,
    (State.SAFE, Step.ENABLE): State.LIVE,
    (State.IDLE, Step.STOP): State.SAFE,
    (State.LOADED, Step.STOP): State.SAFE,
    (State.LIVE, Step.STOP): State.SAFE,
    (State.ARMED, Step.STOP): State.SAFE,
    (State.FIRED, Step.STOP): State.SAFE,
    (State.SAFE, Step.STOP): State.SAFE,
}
"""Every legal step. Not in here, because they are answered in every state and change none: BEAT,
QUERY, FIRE of a token that has fired, DISARM of a token that is not the armed one."""

ILLEGAL = {
    State.CLOSED: Refusal.NOT_OPEN,
    State.IDLE: Refusal.NOTHING_LOADED,
    State.LOADED: Refusal.NOT_ENABLED,
    State.LIVE: Refusal.NOT_ARMED,
    State.ARMED: Refusal.ALREADY_ARMED,
    State.FIRED: Refusal.BUSY,
    State.SAFE: Refusal.SAFE_STATE,
}
"""Why any other step is refused."""
