"""The pages before a participant, each as a list of drawings: plate, fingers, keys, progress."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

from experiment.participant.window import DIM, FOREGROUND, PITCH
from experiment.study.key_names import ARROWS
from experiment.trial.responder import SessionPart

if TYPE_CHECKING:
    from experiment.participant.settings import ResponderSettings
    from experiment.participant.window import Stage
    from experiment.tasks.task import Answer
    from experiment.trial.responder import Progress

    Page = list[Any]
    Point = tuple[float, float]


PLATE = "#6f8fa8"
DISC = "#c9a227"
SKIN = "#d9b99b"
STIMULUS_COLOUR = "#ff8c42"
_TURN_OF = {arrow: 90.0 * turns for turns, arrow in enumerate(ARROWS)}
_SHAFT, _BARB = 0.12, 0.35
_ARROW = (
    *((-0.5, _SHAFT), (0.1, _SHAFT), (0.1, _BARB), (0.5, 0.0)),
    *((0.1, -_BARB), (0.1, -_SHAFT), (-0.5, -_SHAFT)),
)
"""An arrow to the right, of length 1, counted from its middle."""
_NAMES = {"return": "Enter", "escape": "Esc", "space": "Space"}
WIDEST_PANEL = 0.36
"""Width of one answer's picture where there is room."""


class Drawings:
    """Draws on a stage the plate, fingers and the keys of every answer."""

    def __init__(self, stage: Stage, settings: ResponderSettings) -> None:
        self._stage = stage
        self._settings = settings

    def answers(self, part: SessionPart, *, middle: float) -> list[Any]:
        """Draw, for each answer that counts in a part, its sign, or what is felt, and its keys."""
        names = self._settings.answers(part)
        width = min(WIDEST_PANEL, 1.9 * self._stage.half_width / len(names))
        answers = {answer.name: answer for answer in self._settings.task.answers}
        drawings = []
        for i, name in enumerate(names):
            at = (width * (i - (len(names) - 1) / 2), middle)
            if sign := answers[name].sign:
                height = 0.3 * width
                top = middle + PITCH * height / 2
                drawings += self._stage.lines((sign,), top=top, height=height, x=at[0])
            else:
                drawings += self._plate(answers[name], at, 0.8 * width, hands_off=part.hands_off)
            drawings += self._caps(name, (at[0], middle - 0.62 * width), width)
        return drawings

    def bar(self, progress: Progress, *, middle: float) -> list[Any]:
        """Draw how far the session has come."""
        width, height = 1.2 * self._stage.half_width, 0.03
        done = width * progress.done / max(1, progress.planned)
        frame = self._box((0.0, middle), (width, height), line=DIM)
        inner = ((done - width) / 2, middle)
        return [*([self._box(inner, (done, height), fill=PLATE)] if done else []), frame]

    def _plate(self, answer: Answer, at: Point, width: float, *, hands_off: bool) -> list[Any]:
        """Draw plate and actuators, and a finger above each; circles where a vibration is felt."""
        x, y = at
        drawings = [self._box(at, (width, 0.22 * width), fill=PLATE)]
        sites = self._settings.task.sites
        for i, site in enumerate(sites):
            disc = (x + (2 * i - len(sites) + 1) / len(sites) * 0.54 * width, y)
            is_stimulated = site in answer.sites
            drawings.append(self._disc(disc, 0.08 * width, fill=DISC))
            circles = (0.15, 0.19) if is_stimulated else ()
            drawings += [
                self._disc(disc, radius * width, line=STIMULUS_COLOUR) for radius in circles
            ]
            tip = (disc[0], y - 0.27 * width if hands_off else y)
            skin = STIMULUS_COLOUR if is_stimulated and not hands_off else SKIN
            finger = (tip[0], tip[1] - 0.12 * width)
            drawings.append(self._box(finger, (0.1 * width, 0.24 * width), fill=skin))
            drawings.append(self._disc(tip, 0.05 * width, fill=skin))
        return drawings

    def _caps(self, answer: str, at: Point, width: float) -> list[Any]:
        """Draw the keys of an answer in a row."""
        keys = self._settings.keys.meanings[answer]
        side = min(0.2 * width, 0.9 * width / len(keys))
        drawings = []
        for i, key in enumerate(keys):
            x = at[0] + 1.15 * side * (i - (len(keys) - 1) / 2)
            drawings += self._cap(key, (x, at[1]), side, alone=len(keys) == 1)
        return drawings

    def _cap(self, key: str, at: Point, side: float, *, alone: bool) -> list[Any]:
        label = _label(key)
        wide = alone and key not in _TURN_OF and len(label) > 1
        width = 3 * side if wide else side
        frame = self._box(at, (width, side), line=FOREGROUND)
        if key in _TURN_OF:
            arrow = {"vertices": _ARROW, "size": 0.7 * side, "ori": _TURN_OF[key]}
            return [frame, self._shape("ShapeStim", at, {"fill": FOREGROUND}, **arrow)]
        if key == "space":
            bar = (at[0], at[1] - 0.2 * side)
            return [frame, self._box(bar, (0.6 * width, 0.08 * side), fill=FOREGROUND)]
        height = min(0.6 * side, 1.4 * width / len(label))
        top = at[1] + 0.75 * height
        return [frame, *self._stage.lines((label,), top=top, height=height, x=at[0])]

    def _box(self, at: Point, size: tuple[float, float], **look: str) -> Any:
        return self._shape("Rect", at, look, width=size[0], height=size[1])

    def _disc(self, at: Point, radius: float, **look: str) -> Any:
        return self._shape("Circle", at, look, radius=radius, edges=48)

    def _shape(self, kind: str, at: Point, look: dict[str, str], **form: Any) -> Any:
        """Return a shape of PsychoPy; `look` gives the colours of its `fill` and of its `line`."""
        from psychopy import visual

        return getattr(visual, kind)(
            self._stage.window,
            pos=at,
            fillColor=look.get("fill"),
            lineColor=look.get("line"),
            lineWidth=2,
            autoLog=False,
            **form,
        )


def labelled(keys: tuple[str, ...]) -> str:
    """Return the keys of an answer as they are named in a text, in any language.

    >>> labelled(("up", "num_4")), labelled(("space",)), labelled(("button_2",))
    ('↑ / 4', 'Space', 'B2')
    """
    return " / ".join(ARROWS.get(key) or _label(key) for key in keys)


def _label(key: str) -> str:
    short = key.removeprefix("num_").replace("button_", "B")
    return _NAMES.get(key, key.upper() if len(key) == 1 else short)


_EACH_WAY = (SessionPart.MAIN, SessionPart.HANDS_OFF_AFTER)
"""A part with the fingers on the plate, and one without."""
_TOP = 0.44
_GO_ON_AT = -0.42
_PICTURE_AT = -0.1
_HALF_PICTURE = 0.14
_WIDEST_TEXT = 1.3
_SMALLEST_TEXT = 0.01
_GOOD, _BAD = "#7fc97f", "#fdae6b"


class Pages:
    """Lays out what a study says, for the answers offered, on a stage.

    `ready` announces a trial, and `intervals` each of its intervals; `prompts` asks, by whether the
    hands are off the plate; `feedback` follows a practice answer, by whether it is correct.
    """

    def __init__(self, stage: Stage, settings: ResponderSettings) -> None:
        self._stage = stage
        self._screen = settings.screen
        self._texts = texts = settings.texts
        self._drawings = Drawings(stage, settings)
        self._labels = {meaning: labelled(keys) for meaning, keys in settings.keys.meanings.items()}
        self._continue = self._hint(texts.continue_.format(**self._labels))
        self.ready: Page = stage.centred(texts.ready, middle=0.0)
        self.intervals = [
            stage.centred(str(i + 1), middle=0.0) for i in range(settings.task.n_intervals)
        ]
        # Drawn before they are needed: nothing may take a while once a stimulus is out.
        self.prompts = {
            part.hands_off: [
                *stage.centred(settings.prompt(part).format(**self._labels), middle=0.18),
                *self._drawings.answers(part, middle=-0.12),
            ]
            for part in _EACH_WAY
        }
        self.feedback = {
            True: stage.centred(texts.correct, middle=0.0, color=_GOOD),
            False: stage.centred(texts.incorrect, middle=0.0, color=_BAD),
        }

    def before_visit(self) -> list[Page]:
        """Return welcome and instructions."""
        instructions = self._texts.instructions.format(**self._labels)
        return [*self._reading(self._texts.welcome), *self._reading(instructions)]

    def before_part(self, part: SessionPart, *, lay: bool) -> list[Page]:
        """Return where the fingers are laid, if they have to be, and what a part asks for."""
        text = getattr(self._texts, part).format(**self._labels)
        picture = self._drawings.answers(part, middle=_PICTURE_AT)
        placement = self._reading(self._texts.placement, picture) if lay else []
        return [*placement, *self._reading(text, picture)]

    def pause(self, progress: Progress, *, may_continue: bool) -> Page:
        """Return a pause, with a hint how to continue if the participant may."""
        called = "" if may_continue else f"\n{self._texts.called}"
        return self._halt(self._texts.paused + called, progress, may_continue=may_continue)

    def rest(self, progress: Progress, *, left_s: int) -> Page:
        """Return a break that lasts at least so many seconds more."""
        text = self._texts.rest if left_s else self._texts.rest_over
        return self._halt(text, progress, may_continue=not left_s, seconds=left_s)

    def end(self, progress: Progress, *, finished: bool) -> Page:
        """Return the last page."""
        text = self._texts.finished if finished else self._texts.stopped
        return self._halt(text, progress, may_continue=finished)

    def _halt(self, text: str, progress: Progress, *, may_continue: bool, seconds: int = 0) -> Page:
        text = text.format(done=progress.done, planned=progress.planned, seconds=seconds)
        hint = self._continue if may_continue else []
        bar = self._drawings.bar(progress, middle=-0.15)
        return [*self._stage.centred(text, middle=0.12), *bar, *hint]

    def _reading(self, text: str, picture: Page | None = None) -> list[Page]:
        """Break a text into as many pages as it needs, the picture below the last."""
        lines = self._stage.broken(text, width=min(1.8 * self._stage.half_width, _WIDEST_TEXT))
        pitch = PITCH * self._screen.text_height
        most = max(1, int((_TOP - _GO_ON_AT) / pitch))
        most_above = max(1, int((_TOP - _PICTURE_AT - _HALF_PICTURE) / pitch))
        pages: list[Page] = []
        while len(lines) > (most if picture is None else most_above):
            pages.append(self._page(lines[:most]))
            lines = lines[most:]
        pages.append(self._page(lines, picture))
        return pages

    def _page(self, lines: tuple[str, ...], picture: Page | None = None) -> Page:
        height = PITCH * self._screen.text_height * len(lines)
        top = min(_TOP, height / 2) if picture is None else _TOP
        return [*self._stage.lines(lines, top=top), *(picture or ()), *self._continue]

    def _hint(self, text: str) -> Page:
        """Draw a line below, as small as needed to be one."""
        height = min(0.8 * self._screen.text_height, 0.045)
        broken = partial(self._stage.broken, text, width=1.9 * self._stage.half_width)
        while height > _SMALLEST_TEXT and len(broken(height=height)) > 1:
            height *= 0.9
        return self._stage.lines((text,), top=_GO_ON_AT, color=DIM, height=height)
