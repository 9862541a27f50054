"""The participant's pages: laid out for every part without a window, all placeholders filled in."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import pytest

from experiment import Progress, ResponderSettings, SessionPart, paper_study
from experiment.participant.pages import Pages

KEYS = {"left": ("f", "num_4"), "right": ("j",), "both": ("down",), "none": ("button_2",)}


class Paper:
    """A stage on which every line is a drawing."""

    window = None
    half_width = 0.9

    def broken(self, text: str, *, width: float, height: float | None = None) -> tuple[str, ...]:
        return tuple(text.split("\n"))

    def lines(self, lines: tuple[str, ...], **_: Any) -> list[Any]:
        return [*lines]

    def centred(self, text: str, **_: Any) -> list[Any]:
        return [text]


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> Pages:
    psychopy, shape = ModuleType("psychopy"), lambda *_, **__: None
    visual: Any = ModuleType("psychopy.visual")
    visual.Rect = visual.Circle = visual.ShapeStim = shape
    vars(psychopy)["visual"] = visual
    monkeypatch.setitem(sys.modules, "psychopy", psychopy)
    study = paper_study().changed(keys=KEYS)
    settings = ResponderSettings(
        responses=("left", "right", "both", "none"),
        screen=study.screen,
        keys=study.keys,
        texts=study.texts,
    )
    paper: Any = Paper()
    return Pages(paper, settings)


def test_every_page_has_its_text_with_keys_and_numbers(pages: Pages) -> None:
    progress = Progress(done=3, planned=10, part=SessionPart.MAIN)
    shown = [
        *pages.before_visit(),
        *(page for part in SessionPart for page in pages.before_part(part, lay=True)),
        *pages.prompts.values(),
        *pages.feedback.values(),
        *(pages.pause(progress, may_continue=may) for may in (True, False)),
        *(pages.rest(progress, left_s=left_s) for left_s in (12, 0)),
        *(pages.end(progress, finished=finished) for finished in (True, False)),
    ]
    assert all(shown)
    text = "\n".join(line for page in shown for line in page if line)
    assert "{" not in text
    for label in ("\nF\n", "\n4\n", "B2", "Press Enter", "3 of 10", "12 s"):
        assert label in text


def test_a_pause_that_only_the_operator_ends_asks_to_call_the_experimenter(pages: Pages) -> None:
    progress = Progress(done=214, planned=215, part=SessionPart.MAIN)
    shown = [
        "\n".join(line for line in pages.pause(progress, may_continue=may) if line)
        for may in (True, False)
    ]
    assert ["call the experimenter" in text for text in shown] == [False, True]
    assert ["Press Enter" in text for text in shown] == [True, False]
