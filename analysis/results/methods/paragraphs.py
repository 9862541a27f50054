"""The paragraphs of methods, written once: for the page, and as they are for methods.txt."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, ClassVar

from analysis.definitions import TOTAL
from analysis.results.compared import own_model_words
from analysis.results.methods.alarms import rates_words, short_alarm_words
from analysis.results.methods.caption import caption_words
from analysis.results.methods.criterion import compared_words, how_compared
from analysis.results.methods.left_out import left_out_for_paper
from analysis.results.methods.looked import looked_words
from analysis.results.methods.misfit import lapses_for_paper, misfit_words, misfitting
from analysis.results.methods.presented import (
    both_words,
    design_words,
    order_words,
    presented_words,
)
from analysis.results.methods.task import (
    detected_words,
    guess_words,
    hit_words,
    is_yes_no,
    short_words,
    task_words,
    unanswered_words,
)
from analysis.results.methods.words import isolated, number_of, plain
from analysis.results.protocol import IN_METHODS, planned
from analysis.results.summary import versions

if TYPE_CHECKING:
    from analysis.results.protocol import Planned
    from analysis.results.tables import Analysis


@dataclass(frozen=True, slots=True, kw_only=True)
class Methods:
    """What an author pastes: paragraphs, in which names are `isolated`, and what they cite.

    The first is a short version that stands alone; behind `CAPTION` comes one of the figure, where
    it is drawn, and behind `DETAILS` the others.
    """

    CAPTION: ClassVar = "Caption of detection.svg, to paste"
    DETAILS: ClassVar = "Details, for a supplement"
    paragraphs: tuple[str, ...]
    references: tuple[str, ...]

    @property
    def text(self) -> str:
        """The same as a plain text, a line a paragraph."""
        cited = [f"[{place}] {one}" for place, one in enumerate(self.references, start=1)]
        return "\n\n".join([*map(plain, self.paragraphs), "\n".join(cited)]) + "\n"


def methods_of(analysis: Analysis, plans: Planned | None = None, *, drawn: bool = False) -> Methods:
    """Write the methods of an analysis; `plans` are `planned` of it, figures `drawn` or not."""
    from jinja2 import Environment, StrictUndefined

    plans = planned(analysis) if plans is None else plans
    pages = Environment(  # noqa: S701 (a text, no page: the page escapes it)
        undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = files(__package__).joinpath("methods.jinja").read_text(encoding="utf-8")
    people = analysis.differences.loc[analysis.differences["participant"].ne(TOTAL)]
    pairs = len(analysis.differences) - len(people)
    paired = people[["condition_a", "condition_b"]].drop_duplicates()
    told = pages.from_string(template).render(
        analysis=analysis,
        details=Methods.DETAILS,
        caption=caption_words(analysis) if drawn else "",
        caption_head=Methods.CAPTION,
        counts=analysis.counts,
        counts_told=counts_told(analysis),
        study=plans.studies[0] if plans.studies else None,
        studies=len(plans.studies),
        isolated=isolated,
        short=short_words(analysis),
        design=design_words(analysis),
        unanswered=unanswered_words(analysis),
        task=task_words(analysis),
        detected=detected_words(analysis),
        both=both_words(analysis),
        order=order_words(analysis),
        presented=[] if plans.studies else [*presented_words(analysis)],
        yes_no=is_yes_no(analysis),
        guesses=[*guess_words(analysis)],
        false_alarms=rates_words(analysis),
        short_alarms=" ".join(filter(None, (short_alarm_words(analysis), how_compared(analysis)))),
        hits=hit_words(analysis),
        misfit=misfit_words(analysis.thresholds),
        misfits=misfitting(analysis.thresholds),
        lapses=lapses_for_paper(analysis.thresholds),
        looked=looked_words(analysis),
        own_model=own_model_words(analysis),
        alarms=" ".join(compared_words(analysis)),
        left_out=left_out_for_paper(analysis),
        same_people=len(paired) == pairs,
        other_people=paired.empty,
        versions=versions(),
        **IN_METHODS,
    )
    parts = [" ".join(part.split()) for part in told.split("\n\n")]
    paragraphs = [part for part in parts if part and not part.startswith("* ")]
    cited = [part.removeprefix("* ") for part in parts if part.startswith("* ")]
    return Methods(paragraphs=tuple(paragraphs), references=tuple(cited))


def counts_told(analysis: Analysis) -> str:
    """Say how much was analysed."""
    counts = analysis.counts
    return (
        f"{counts.trials} trials of {number_of(counts.participants, 'participant')} in "
        f"{number_of(counts.sessions, 'session')}, {number_of(counts.conditions, 'condition')}"
    )
