"""The tables of study.toml about the participant's screen, and about the data set."""

from __future__ import annotations

from typing import Any, Final

from pydantic import Field

from experiment.study.sections.presentation import Keys, Screen, Texts
from experiment.study.sections.table import Table

_SCREEN: Final = Screen()
_KEYS: Final = Keys()
_TEXTS: Final = Texts()


def _keys(meaning: str, description: str | None = None) -> Any:
    return Field(getattr(_KEYS, meaning), strict=False, description=description)


def _text(name: str, description: str | None = None) -> Any:
    return Field(getattr(_TEXTS, name), description=description)


class ScreenTable(Table):
    """The participant's window, for `run --responder screen`."""

    full_screen: bool = Field(_SCREEN.full_screen)
    index: int = Field(_SCREEN.index, description="which screen, counted from 0")
    width_px: int = Field(_SCREEN.width_px, description="of a window")
    height_px: int = Field(_SCREEN.height_px)
    text_height: float = Field(_SCREEN.text_height, description="of a line, part of the window's")
    right_to_left: bool = Field(_SCREEN.right_to_left, description="for Arabic, Hebrew, ...")
    font: str = Field(_SCREEN.font)


class KeysTable(Table):
    """The keys of each answer and wish, by PsychoPy's names.

    They are a-z, 0-9, left, space, return, num_4, f1 and such; a pedal types keys. Several keys may
    mean the same, no key two things.
    """

    left: tuple[str, ...] = _keys("left")
    right: tuple[str, ...] = _keys("right")
    both: tuple[str, ...] = _keys("both")
    none: tuple[str, ...] = _keys("none", "where the answer none is offered")
    pause: tuple[str, ...] = _keys("pause", "pressed again in the pause: stop")
    go_on: tuple[str, ...] = _keys("go_on", "to the next screen")


class TextsTable(Table):
    """What the participant reads, in any language.

    {done}, {planned} and, in rest, {seconds} are filled in where the defaults have them.
    """

    welcome: str = _text("welcome")
    instructions: str = _text("instructions")
    placement: str = _text("placement", "above the picture of the fingers")
    audibility: str = _text("audibility", "before each part of a session")
    practice: str = _text("practice")
    warm_up: str = _text("warm_up")
    main: str = _text("main")
    control: str = _text("control")
    ready: str = _text("ready", "until the stimulus")
    prompt: str = _text("prompt")
    correct: str = _text("correct", "after a practice answer")
    wrong: str = _text("wrong")
    paused: str = _text("paused")
    rest: str = _text("rest")
    rest_over: str = _text("rest_over")
    go_on: str = _text("go_on", "below screens that wait for its key")
    finished: str = _text("finished")
    stopped: str = _text("stopped")


class ColumnTable(Table):
    """A column of participants.tsv."""

    name: str
    description: str
    levels: tuple[str, ...] = Field((), strict=False)


class ParticipantsTable(Table):
    """What participants.tsv has beside the identifier.

    For example columns = [{ name = "handedness", description = "by questionnaire",
    levels = ["left", "right", "both"] }]. Declare nothing by which a person can be recognised.
    """

    columns: tuple[ColumnTable, ...] = Field((), strict=False)


class DatasetTable(Table):
    """What an exported data set (BIDS) says of itself; what is not given is left out of it."""

    name: str | None = Field(None, description="title")
    authors: tuple[str, ...] = Field((), strict=False)
    license: str | None = Field(None, description="such as CC-BY-4.0")
    acknowledgements: str | None = Field(None)
    how_to_acknowledge: str | None = Field(None)
    funding: tuple[str, ...] = Field((), strict=False)
    ethics_approvals: tuple[str, ...] = Field((), strict=False)
    references_and_links: tuple[str, ...] = Field((), strict=False)
    institution_name: str | None = Field(None)
    institution_address: str | None = Field(None)
    task_description: str | None = Field(None)
