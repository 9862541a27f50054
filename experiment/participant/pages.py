"""The pages before a participant, each as a list of drawings: plate, fingers, keys, progress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from experiment.participant.window import BACKGROUND, DIM, FOREGROUND, PITCH
from experiment.participant.wrapping import filled
from experiment.rows import ANSWERS
from experiment.trial.responder import SessionPart

if TYPE_CHECKING:
    from experiment.participant.window import Stage
    from experiment.study.presentation import Keys, Screen, Texts
    from experiment.trial.responder import Progress

    Page = list[Any]


PLATE = "#6f8fa8"
DISC = "#c9a227"
SKIN = "#d9b99b"
FELT = "#ff8c42"
_TURN_OF = {"right": 0.0, "down": 90.0, "left": 180.0, "up": 270.0}
_ARROW = (
    (-0.5, 0.12),
    (0.1, 0.12),
    (0.1, 0.35),
    (0.5, 0.0),
    (0.1, -0.35),
    (0.1, -0.12),
    (-0.5, -0.12),
)
_FELT_AT = {"left": (-1,), "right": (1,), "both": (-1, 1), "none": ()}
_NAMES = {"return": "Enter", "escape": "Esc", "space": "Space"}
_SIGNS = {"left": "←", "right": "→", "up": "↑", "down": "↓"}
WIDEST_PANEL = 0.36
"""Width of one answer's picture where there is room."""


class Artist:
    """Draws on a stage the plate, fingers and the keys of every answer."""

    def __init__(self, stage: Stage, keys: Keys) -> None:
        self._stage = stage
        self._keys = keys

    def placement(
        self, answers: tuple[str, ...], *, middle: float, hands_off: bool = False
    ) -> list[Any]:
        """Draw, for each answer in a row, the fingers, what is felt, and the key beside it."""
        width = min(WIDEST_PANEL, 1.9 * self._stage.half_width / len(answers))
        drawings = []
        for i, answer in enumerate(answers):
            x = width * (i - (len(answers) - 1) / 2)
            drawings += self._plate(answer, (x, middle), 0.8 * width, hands_off=hands_off)
            drawings += self._caps(answer, (x, middle - 0.62 * width), width)
        return drawings

    def bar(self, progress: Progress, *, middle: float) -> list[Any]:
        """Draw how far the session has come."""
        width, height = 1.2 * self._stage.half_width, 0.03
        filled = width * progress.done / max(1, progress.planned)
        frame = self._box((0.0, middle), (width, height), line=DIM)
        if not filled:
            return [frame]
        inner = self._box(((filled - width) / 2, middle), (filled, height), fill=PLATE)
        return [inner, frame]

    def _plate(
        self, answer: str, at: tuple[float, float], width: float, *, hands_off: bool
    ) -> list[Any]:
        x, y = at
        drawings = [self._box((x, y), (width, 0.22 * width), fill=PLATE)]
        for side in (-1, 1):
            disc = (x + side * 0.27 * width, y)
            felt = side in _FELT_AT[answer]
            drawings.append(self._disc(disc, 0.08 * width, fill=DISC))
            if felt:
                drawings += [self._disc(disc, radius * width, line=FELT) for radius in (0.15, 0.19)]
            tip = y - 0.27 * width if hands_off else y
            drawings += self._finger(
                (disc[0], tip), width, fill=FELT if felt and not hands_off else SKIN
            )
        return drawings

    def _finger(self, tip: tuple[float, float], width: float, *, fill: str) -> list[Any]:
        x, y = tip
        return [
            self._box((x, y - 0.12 * width), (0.1 * width, 0.24 * width), fill=fill),
            self._disc((x, y), 0.05 * width, fill=fill),
        ]

    def _caps(self, answer: str, at: tuple[float, float], width: float) -> list[Any]:
        """Draw the keys of an answer beside one another."""
        keys: tuple[str, ...] = getattr(self._keys, answer)
        side = min(0.2 * width, 0.9 * width / len(keys))
        drawings = []
        for i, key in enumerate(keys):
            x = at[0] + 1.15 * side * (i - (len(keys) - 1) / 2)
            drawings += self._cap(key, (x, at[1]), side, alone=len(keys) == 1)
        return drawings

    def _cap(self, key: str, at: tuple[float, float], side: float, *, alone: bool) -> list[Any]:
        label = _label(key)
        wide = alone and key not in _TURN_OF and len(label) > 1
        width = 3 * side if wide else side
        frame = self._box(at, (width, side), line=FOREGROUND)
        if key in _TURN_OF:
            return [frame, self._arrow(at, 0.7 * side, _TURN_OF[key])]
        if key == "space":
            place = (at[0], at[1] - 0.2 * side)
            return [frame, self._box(place, (0.6 * width, 0.08 * side), fill=FOREGROUND)]
        height = min(0.6 * side, 1.4 * width / len(label))
        top = at[1] + 0.75 * height
        return [frame, *self._stage.lines((label,), top=top, height=height, x=at[0])]

    def _box(
        self,
        at: tuple[float, float],
        size: tuple[float, float],
        *,
        fill: str | None = None,
        line: str | None = None,
    ) -> Any:
        from psychopy.visual import Rect

        return Rect(
            self._stage.window,
            width=size[0],
            height=size[1],
            pos=at,
            fillColor=fill,
            lineColor=line,
            lineWidth=2,
            autoLog=False,
        )

    def _disc(
        self,
        at: tuple[float, float],
        radius: float,
        *,
        fill: str | None = None,
        line: str | None = None,
    ) -> Any:
        from psychopy.visual import Circle

        return Circle(
            self._stage.window,
            radius=radius,
            edges=48,
            pos=at,
            fillColor=fill,
            lineColor=line,
            lineWidth=2,
            autoLog=False,
        )

    def _arrow(self, at: tuple[float, float], size: float, turn_deg: float) -> Any:
        from psychopy.visual import ShapeStim

        return ShapeStim(
            self._stage.window,
            vertices=_ARROW,
            size=size,
            ori=turn_deg,
            pos=at,
            fillColor=FOREGROUND,
            lineColor=BACKGROUND,
            autoLog=False,
        )


def labelled(keys: tuple[str, ...]) -> str:
    """Return the keys of an answer as they are named in a text, in any language.

    >>> labelled(("left", "num_4")), labelled(("space",)), labelled(("button_2",))
    ('← / 4', 'Space', 'B2')
    """
    return " / ".join(_SIGNS.get(key) or _label(key) for key in keys)


def _label(key: str) -> str:
    short = key.removeprefix("num_").replace("button_", "B")
    return _NAMES.get(key, key.upper() if len(key) == 1 else short)


_EACH_WAY = (SessionPart.MAIN, SessionPart.CONTROL)
"""A part with the fingers on the plate, and one without."""
_TOP = 0.44
_GO_ON_AT = -0.42
_PICTURE_AT = -0.1
_HALF_PICTURE = 0.14
_WIDEST_TEXT = 1.3
_SMALLEST_TEXT = 0.01
_GOOD, _BAD = "#7fc97f", "#fdae6b"


class Pages:
    """Lays out what a study says, for the answers offered, on a stage."""

    def __init__(
        self, stage: Stage, *, screen: Screen, keys: Keys, texts: Texts, responses: tuple[str, ...]
    ) -> None:
        self._stage = stage
        self._screen = screen
        self._texts = texts
        self._responses = responses
        self._artist = Artist(stage, keys)
        named = (*ANSWERS, "go_on")
        self._labels = {meaning: labelled(getattr(keys, meaning)) for meaning in named}
        self._go_on = self._hint(filled(texts.go_on, self._labels))
        self.ready: Page = stage.centred(texts.ready, middle=0.0)
        # Drawn before they are needed: nothing may take a while once a stimulus is out.
        self._prompts = {part.hands_off: self._prompt(part) for part in _EACH_WAY}
        self._feedback = {
            True: stage.centred(texts.correct, middle=0.0, color=_GOOD),
            False: stage.centred(texts.wrong, middle=0.0, color=_BAD),
        }

    def feedback(self, *, correct: bool) -> Page:
        """Return what a practice answer is followed by."""
        return self._feedback[correct]

    def prompt(self, part: SessionPart) -> Page:
        """Return the question after a stimulus, with the answers that count in a part."""
        return self._prompts[part.hands_off]

    def _prompt(self, part: SessionPart) -> Page:
        text = self._texts.prompt_hands_off if part.hands_off else self._texts.prompt
        return [
            *self._stage.centred(filled(text, self._labels), middle=0.18),
            *self._answers(part, middle=-0.12),
        ]

    def before_sitting(self) -> list[Page]:
        """Return welcome and instructions."""
        texts = self._texts
        return [
            *self._reading(texts.welcome),
            *self._reading(filled(texts.instructions or "", self._labels)),
        ]

    def before_part(self, part: SessionPart, *, lay: bool) -> list[Page]:
        """Return where the fingers are laid, if they have to be, and what a part asks for."""
        text = filled(getattr(self._texts, part.value), self._labels)
        picture = self._answers(part, middle=_PICTURE_AT)
        placement = self._reading(self._texts.placement, picture) if lay else []
        return [*placement, *self._reading(text, picture)]

    def _answers(self, part: SessionPart, *, middle: float) -> Page:
        """Draw the answers that count in a part, the fingers where they are in it."""
        return self._artist.placement(
            part.answers(self._responses), middle=middle, hands_off=part.hands_off
        )

    def pause(self, progress: Progress, *, go_on: bool) -> Page:
        """Return a pause, with the hint how to go on where the participant may."""
        return self._halt(self._texts.paused, progress, go_on=go_on)

    def rest(self, progress: Progress, *, left_s: int) -> Page:
        """Return a break that lasts at least so many seconds more."""
        text = self._texts.rest if left_s else self._texts.rest_over
        return self._halt(text, progress, go_on=not left_s, seconds=left_s)

    def end(self, progress: Progress, *, finished: bool) -> Page:
        """Return the last page."""
        text = self._texts.finished if finished else self._texts.stopped
        return self._halt(text, progress, go_on=finished)

    def _halt(self, text: str, progress: Progress, *, go_on: bool, seconds: int = 0) -> Page:
        facts = {"done": progress.done, "planned": progress.planned, "seconds": seconds}
        hint = self._go_on if go_on else []
        bar = self._artist.bar(progress, middle=-0.15)
        return [*self._stage.centred(filled(text, facts), middle=0.12), *bar, *hint]

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
        return [*self._stage.lines(lines, top=top), *(picture or ()), *self._go_on]

    def _hint(self, text: str) -> Page:
        """Draw a line below, as small as needed to be one."""
        height, width = min(0.8 * self._screen.text_height, 0.045), 1.9 * self._stage.half_width
        while (
            height > _SMALLEST_TEXT
            and len(self._stage.broken(text, width=width, height=height)) > 1
        ):
            height *= 0.9
        return self._stage.lines((text,), top=_GO_ON_AT, color=DIM, height=height)
