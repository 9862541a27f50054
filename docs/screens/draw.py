"""Draw every page that a participant sees, from the buffer before the flip: `draw.py FOLDER`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from experiment.participant.pages import Pages
from experiment.participant.window import Stage
from experiment.study.sections.presentation import Keys, Screen, Texts
from experiment.terms.responder import Progress, SessionPart

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.participant.pages import Page

ARABIC = Texts(
    welcome="أهلا وسهلا بك، وشكرا لمشاركتك في التجربة.",
    instructions=(
        "ستشعر باهتزاز قصير تحت إصبعك الأيسر أو الأيمن أو كليهما. ثم حدد أين شعرت به. "
        "إذا لم تكن متأكدا فأجب بما يبدو لك الأرجح. اضغط Esc للتوقف قليلا."
    ),
    go_on="اضغط Enter للمتابعة.",
)
HEBREW = Texts(
    instructions=(
        "תרגישו רטט קצר מתחת לאצבע השמאלית, מתחת לאצבע הימנית, או מתחת לשתיהן. "
        "לחצו על המקש המתאים (Esc להפסקה) תוך 2.5 שניות."
    ),
    go_on="הקישו Enter כדי להמשיך.",
)
OTHER_KEYS = Keys(left=("f", "num_4"), right=("j", "num_6"), both=("pageup",))
"""Keys of a row, a number pad and a pedal."""


def pages(stage: Stage, screen: Screen, texts: Texts, keys: Keys) -> Iterator[tuple[str, Page]]:
    """Return the pages of a session by name."""
    answers = ("left", "right", "both", "none")
    of = Pages(stage, screen=screen, keys=keys, texts=texts, responses=answers)
    at = Progress(done=37, planned=155, part=SessionPart.MAIN)
    end = Progress(done=155, planned=155, part=SessionPart.MAIN)
    welcome, *instructions = of.before_sitting()
    yield "welcome", welcome
    for i, page in enumerate(instructions, start=1):
        yield f"instructions-{i}", page
    yield "placement", of.before_part(SessionPart.MAIN, lay=True)[0]
    for part in SessionPart:
        yield part.value, of.before_part(part, lay=False)[-1]
    yield "ready", of.ready
    yield "prompt", of.prompt(SessionPart.MAIN)
    yield "prompt-hands-off", of.prompt(SessionPart.CONTROL)
    yield "correct", of.feedback(correct=True)
    yield "wrong", of.feedback(correct=False)
    yield "pause", of.pause(at, go_on=True)
    yield "break", of.rest(at, left_s=12)
    yield "break-over", of.rest(at, left_s=0)
    yield "end", of.end(end, finished=True)
    yield "stopped", of.end(at, finished=False)


def draw(stage: Stage, page: Page, file: Path) -> None:
    """Keep a page as a picture of few colours."""
    for drawing in page:
        drawing.draw()
    picture = stage.window.getMovieFrame(buffer="back")
    stage.window.movieFrames = []
    stage.window.flip()
    picture.convert("RGB").quantize(32).save(file, optimize=True)


def main(folder: Path) -> None:
    """Draw the pages of a plain study, and some of studies in other languages and sizes."""
    plain = Screen(full_screen=False, width_px=800, height_px=450)
    stage = Stage(plain)
    for name, page in pages(stage, plain, Texts(), Keys()):
        draw(stage, page, folder / f"{name}.png")
    stage.close()
    large = replace(plain, text_height=0.1)
    turned = replace(plain, text_height=0.045, right_to_left=True)
    for name, screen, texts, keys, kept in (
        ("arabic", turned, ARABIC, Keys(), ("welcome", "instructions-1")),
        ("hebrew", turned, HEBREW, Keys(), ("instructions-1",)),
        ("large", large, Texts(), OTHER_KEYS, ("instructions-1", "placement", "break")),
    ):
        stage = Stage(screen)
        for of, page in pages(stage, screen, texts, keys):
            if of in kept:
                draw(stage, page, folder / f"{name}-{of}.png")
        stage.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
