"""What the pages offer: the answers that count in their part, and the fingers where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from experiment import SessionPart
from experiment.participant.pages import Pages

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment import Study

NO_NOTHING = '[design]\nresponses = ["right", "left"]\nboth_trials = 0\n'
WITH_NOTHING = (
    '[design]\nresponses = ["left", "both", "none", "right"]\nblank_trials = 3\n'
    '[keys]\nnone = ["num_0", "k"]\n'
)
OWN_TEXTS = (
    '[texts]\nmain = "{left}, {right}, {both}!"\ncontrol = "{none} or {left}!"\n'
    'prompt = "{both}?"\nprompt_hands_off = "{none}?"\n'
)


class Stage:
    """A window whose drawings are words: texts, and what a picture offers."""

    half_width = 0.9

    def lines(self, lines: tuple[str, ...], **_: Any) -> list[Any]:
        return list(lines)

    def centred(self, text: str, **_: Any) -> list[Any]:
        return [text]

    def broken(self, text: str, **_: Any) -> tuple[str, ...]:
        return (text,)


class Artist:
    """Draws an answer as its word."""

    def __init__(self, *_: object) -> None:
        pass

    def placement(self, answers: tuple[str, ...], *, middle: float, hands_off: bool) -> list[Any]:
        return [("offered", answers, hands_off)]


@pytest.fixture(params=[NO_NOTHING, WITH_NOTHING, OWN_TEXTS])
def study(request: pytest.FixtureRequest, make_study: Callable[[str], Study]) -> Study:
    return make_study(request.param)


@pytest.fixture
def shown(study: Study, monkeypatch: pytest.MonkeyPatch) -> Pages:
    monkeypatch.setattr("experiment.participant.pages.Artist", Artist)
    stage: Any = Stage()
    return Pages(
        stage,
        screen=study.screen,
        keys=study.keys,
        texts=study.shown_texts,
        responses=study.design.responses,
    )


@pytest.mark.parametrize("part", SessionPart)
def test_no_page_offers_an_answer_that_does_not_count_in_its_part(
    study: Study, shown: Pages, part: SessionPart
) -> None:
    offered = [
        drawing
        for page in (*shown.before_part(part, lay=False), shown.prompt(part))
        for drawing in page
        if isinstance(drawing, tuple)
    ]
    counted = part.answers(study.design.responses)
    assert set(offered) == {("offered", counted, part.hands_off)}
    assert ("none" in counted) == (part.hands_off or "none" in study.design.responses)


def test_no_page_shows_a_key_of_an_answer_that_is_not_offered(study: Study, shown: Pages) -> None:
    responses = study.design.responses
    for part in SessionPart:
        lay = not part.hands_off
        texts = [*shown.before_part(part, lay=lay), shown.prompt(part), *shown.before_sitting()]
        words = " ".join(word for page in texts for word in page if isinstance(word, str))
        assert "{" not in words
        for answer, sign in (("both", "↓"), ("none", "Space"), ("none", "0 / K")):
            assert answer in part.answers(responses) or sign not in words
