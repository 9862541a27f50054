"""A participant's screen without a window: keys that go down at given times."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any, ClassVar

from device import VirtualClock
from experiment import AwaitedAnswer, Press, Progress, ResponderSettings, SessionPart, paper_study
from experiment.operator.requests import Requests, StopSignal
from experiment.participant.screen import ScreenResponder

PROGRESS = Progress(done=1, planned=4, part=SessionPart.MAIN)


@dataclass(slots=True)
class Keyboard:
    """Keys that go down at given times."""

    clock: VirtualClock
    coming: deque[Press] = field(default_factory=deque)

    def next(self) -> Press | None:
        due = self.coming and self.coming[0].time_s <= self.clock.now_s()
        return self.coming.popleft() if due else None

    def drop_all(self) -> None:
        while self.next() is not None:
            pass

    def drop_earlier(self) -> None:
        kept = [stroke for stroke in iter(self.next, None) if stroke.response == "escape"]
        self.coming.extendleft(reversed(kept))


@dataclass(slots=True)
class Stage:
    """A window that only remembers its pages."""

    focused: bool = True
    closed: bool = False
    shown: list[Any] = field(default_factory=list)
    at_poll: Any = lambda: None

    def poll(self) -> None:
        self.at_poll()

    def show(self, page: Any) -> None:
        self.shown.append(page)

    def take_focus(self) -> None:
        """Do nothing: it has it."""


class Pages:
    """Pages by what they are, not by what is on them."""

    ready = "ready"
    prompts: ClassVar = {False: "prompt", True: "prompt, hands off"}
    feedback: ClassVar = {False: "incorrect", True: "correct"}

    def before_visit(self) -> list[str]:
        return ["welcome", "instructions"]

    def before_part(self, part: SessionPart, *, lay: bool) -> list[str]:
        return [*["placement"] * lay, part.value]

    def pause(self, _: Progress, *, may_continue: bool) -> str:
        return "pause+" if may_continue else "pause"

    def rest(self, _: Progress, *, left_s: int) -> str:
        return f"rest {left_s}"

    def end(self, _: Progress, *, finished: bool) -> str:
        return "end" if finished else "stopped"


class Room:
    """A participant's screen with keys to come."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.requests = Requests()
        self.stop = StopSignal()
        self.stage = Stage()
        self.keyboard = Keyboard(self.clock)
        settings = ResponderSettings(
            responses=("left", "right"),
            screen=paper_study().screen,
            keys=paper_study().changed(keys={"left": ("left", "a")}).keys,
            texts=paper_study().texts,
            requests=self.requests,
            stop=self.stop,
        )
        self.responder = ScreenResponder(settings, self.clock)
        parts = {"_stage": self.stage, "_pages": Pages(), "_reader": self.keyboard}
        for name, part in parts.items():
            setattr(self.responder, name, part)

    def keys(self, *strokes: tuple[str, float]) -> None:
        """Let keys go down at given times."""
        self.keyboard.coming.extend(Press(*stroke) for stroke in strokes)

    def at(self, time_s: float, act: Any) -> None:
        """Let something happen at a time."""
        self.stage.at_poll = lambda: act() if self.clock.now_s() >= time_s else None

    def pause(self, *, paused: bool, minimum_s: float = 0.0) -> bool:
        return self.responder.pause(PROGRESS, paused=paused, minimum_s=minimum_s)


def question(onset_s: float = 0.0, window_s: float = 2.0) -> AwaitedAnswer:
    """Ask for left or right."""
    return AwaitedAnswer(
        trial=1,
        attempt=1,
        levels_vpp=((0.0, 0.0),),
        onset_s=onset_s,
        window_s=window_s,
        answers=("left", "right"),
    )
