"""The pages before a participant, each as a list of drawings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from experiment.responder import Part
from experiment.screen_pictures import Artist
from experiment.screen_text import filled
from experiment.screen_window import DIM, PITCH

if TYPE_CHECKING:
    from experiment.presentation import Keys, Screen, Texts
    from experiment.responder import Progress
    from experiment.screen_window import Stage

    Page = list[Any]

_TOP = 0.44
_GO_ON_AT = -0.42
_PICTURE_AT = -0.1
_HALF_PICTURE = 0.14
_WIDEST_TEXT = 1.3
_SMALLEST_TEXT = 0.01
_HANDS_OFF = (Part.AUDIBILITY, Part.CONTROL)
_GOOD, _BAD = "#7fc97f", "#fdae6b"


class Pages:
    """Lays pages out.

    Parameters
    ----------
    stage : Stage
        Where they are shown.
    screen, keys, texts : Screen, Keys, Texts
        What the study says of them.
    responses : tuple of str
        The answers offered.
    """

    def __init__(
        self, stage: Stage, *, screen: Screen, keys: Keys, texts: Texts, responses: tuple[str, ...]
    ) -> None:
        self._stage = stage
        self._screen = screen
        self._texts = texts
        self._responses = responses
        self._artist = Artist(stage, keys)
        self._go_on = self._hint(texts.go_on)
        self.ready: Page = stage.centred(texts.ready, middle=0.0)
        self.prompt: Page = [
            *stage.centred(texts.prompt, middle=0.18),
            *self._artist.placement(responses, middle=-0.12),
        ]
        self._feedback = {
            True: stage.centred(texts.correct, middle=0.0, color=_GOOD),
            False: stage.centred(texts.wrong, middle=0.0, color=_BAD),
        }

    def feedback(self, *, correct: bool) -> Page:
        """Return what a practice answer is followed by."""
        return self._feedback[correct]

    def before_sitting(self, progress: Progress) -> list[Page]:
        """Return welcome, instructions and where the fingers lie."""
        picture = self._artist.placement(self._responses, middle=_PICTURE_AT)
        texts = self._texts
        return [
            *self._reading(filled(texts.welcome, progress)),
            *self._reading(filled(texts.instructions, progress)),
            *self._reading(filled(texts.placement, progress), picture),
        ]

    def before_part(self, part: Part, progress: Progress) -> list[Page]:
        """Return what a part asks for, and whether the fingers lie on the plate."""
        hands_off = part in _HANDS_OFF
        answers = self._responses
        if hands_off and "none" not in answers:
            answers = (*answers, "none")
        picture = self._artist.placement(answers, middle=_PICTURE_AT, hands_off=hands_off)
        return self._reading(filled(getattr(self._texts, part.value), progress), picture)

    def pause(self, progress: Progress, *, go_on: bool) -> Page:
        """Return a pause, with the hint how to go on where the participant may."""
        return self._halt(filled(self._texts.paused, progress), progress, go_on=go_on)

    def rest(self, progress: Progress, *, left_s: int) -> Page:
        """Return a break that lasts at least so many seconds more."""
        text = self._texts.rest if left_s else self._texts.rest_over
        return self._halt(filled(text, progress, seconds=left_s), progress, go_on=not left_s)

    def end(self, progress: Progress, *, finished: bool) -> Page:
        """Return the last page."""
        text = self._texts.finished if finished else self._texts.stopped
        return self._halt(filled(text, progress), progress, go_on=finished)

    def _halt(self, text: str, progress: Progress, *, go_on: bool) -> Page:
        hint = self._go_on if go_on else []
        bar = self._artist.bar(progress, middle=-0.15)
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
        return [*self._stage.lines(lines, top=top), *(picture or ()), *self._go_on]

    def _hint(self, text: str) -> Page:
        """Draw a line below, as small as needed to be one."""
        height, width = min(0.8 * self._screen.text_height, 0.045), 1.9 * self._stage.half_width
        while height > _SMALLEST_TEXT and len(
            self._stage.broken(text, width=width, height=height)
        ) > 1:  # fmt: skip
            height *= 0.9
        return self._stage.lines((text,), top=_GO_ON_AT, color=DIM, height=height)
