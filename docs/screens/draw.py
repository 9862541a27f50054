"""Draw every page that a participant sees, from the buffer before the flip: `draw.py FOLDER`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from experiment import ResponderSettings
from experiment.participant.pages import Pages
from experiment.participant.window import Stage
from experiment.study.files import paper_study, study_from_text
from experiment.study.presentation import Screen, Texts
from experiment.study.writing import preset_text
from experiment.trial.responder import Progress, SessionPart

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.participant.pages import Page
    from experiment.study.study import Study

ARABIC = Texts(
    welcome="أهلا وسهلا بك، وشكرا لمشاركتك في التجربة.",
    instructions=(
        "ستشعر باهتزاز قصير تحت إصبعك الأيسر أو الأيمن أو كليهما. ثم حدد أين شعرت به: {left} أو "
        "{right} أو {both}. إذا لم تكن متأكدا فأجب بما يبدو لك الأرجح. اضغط Esc للتوقف قليلا."
    ),
    placement="ضع إصبعا من كل يد على الصفيحة كما في الصورة، وأبقهما هناك.",
    hands_off_before=(
        "أولا دون لمس: ارفع يديك عن الصفيحة. إذا سمعتها فأجب من أين، "
        "وإذا لم تسمع شيئا فاضغط {none}."
    ),
    practice="الآن بضع محاولات للتدريب. سيقال لك هل كانت الإجابة صحيحة.",
    warm_up="بضع محاولات للتعود من جديد. إنها لا تحسب.",
    main="الآن تبدأ التجربة.",
    hands_off_after="الآن ارفع يديك عن الصفيحة. أجب كما من قبل، وإذا لم تلاحظ شيئا فاضغط {none}.",
    prompt="أين شعرت به؟",
    prompt_hands_off="هل لاحظت شيئا، وأين؟",
    correct="صحيح",
    incorrect="ليس كذلك",
    paused="توقف: تمت {done} من {planned} محاولة.",
    rest="استرح: تمت {done} من {planned} محاولة. يمكنك المتابعة بعد {seconds} ثانية.",
    rest_over="استرح: تمت {done} من {planned} محاولة.",
    **{"continue": "اضغط {continue} للمتابعة."},
    finished="هذا كل شيء. شكرا جزيلا!",
    stopped="أوقفت التجربة. شكرا.",
)
HEBREW = Texts(
    instructions=(
        "תרגישו רטט קצר מתחת לאצבע השמאלית, מתחת לאצבע הימנית, או מתחת לשתיהן. "
        "לחצו על המקש המתאים (Esc להפסקה) תוך 2.5 שניות."
    ),
    **{"continue": "הקישו Enter כדי להמשיך."},
)
LARGE = """
[screen]
text_height = 0.07
[keys]
left = ["f", "num_4"]
right = ["j", "num_6"]
both = ["pageup"]
"""
"""Twice as large; keys of a row, a number pad and a pedal."""


def pages(stage: Stage, study: Study) -> Iterator[tuple[str, Page]]:
    """Return the pages of a session by name, in their order."""
    settings = ResponderSettings(
        responses=study.design.responses,
        screen=study.screen,
        keys=study.keys,
        texts=study.texts,
    )
    of = Pages(stage, settings)
    at = Progress(done=37, planned=155, part=SessionPart.MAIN)
    end = Progress(done=155, planned=155, part=SessionPart.MAIN)
    yield from _numbered("instructions", of.before_visit())
    for part in SessionPart:
        yield from _numbered(part.value, of.before_part(part, lay=part is SessionPart.PRACTICE))
    yield "ready", of.ready
    yield "prompt", of.prompts[False]
    yield "prompt-hands-off", of.prompts[True]
    yield "correct", of.feedback[True]
    yield "incorrect", of.feedback[False]
    yield "pause", of.pause(at, may_continue=True)
    yield "break", of.rest(at, left_s=12)
    yield "break-over", of.rest(at, left_s=0)
    yield "end", of.end(end, finished=True)
    yield "stopped", of.end(at, finished=False)


def _numbered(name: str, pages: list[Page]) -> Iterator[tuple[str, Page]]:
    for number, page in enumerate(pages, start=1):
        yield (f"{name}-{number}" if len(pages) > 1 else name), page


def draw(stage: Stage, page: Page, file: Path) -> None:
    """Keep a page as a picture of few colours."""
    for drawing in page:
        drawing.draw()
    picture = stage.window.getMovieFrame(buffer="back")
    stage.window.movieFrames = []
    stage.window.flip()
    picture.convert("RGB").quantize(32).save(file, optimize=True)


def main(folder: Path) -> None:
    """Draw every page of the presets, and of studies in other languages and sizes."""
    recommended = preset_text("recommended")
    studies = {
        "paper": paper_study(),
        "recommended": study_from_text(recommended, "study.toml"),
        "arabic": _turned(ARABIC),
        "hebrew": _turned(HEBREW),
        "large": study_from_text(preset_text("paper") + LARGE, "study.toml"),
    }
    for name, study in studies.items():
        size = {"full_screen": False, "width_px": 800, "height_px": 450}
        window = study.screen.model_copy(update=size)
        shown = study.changed(screen=window)
        stage = Stage(window)
        (folder / name).mkdir(parents=True, exist_ok=True)
        for of, page in pages(stage, shown):
            draw(stage, page, folder / name / f"{of}.png")
        stage.close()


def _turned(texts: Texts) -> Study:
    screen = Screen(text_height=0.045, right_to_left=True)
    return paper_study().changed(screen=screen, texts=texts)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
