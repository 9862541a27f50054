"""What the task was, what counts as detected and what the guess rates are of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from analysis.definitions import TOTAL
from analysis.reading.foreign.columns import FORCED, YES_NO
from analysis.thresholds.people import FORCED_CHOICE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.results.tables import Analysis


def is_yes_no(analysis: Analysis) -> bool:
    """Tell whether it was asked only whether a stimulus was felt, as map or answers say."""
    if analysis.task == FORCED or analysis.detected_any is None:
        return False
    if analysis.one_side:
        return True
    sides = analysis.levels[["over_report", "mislocalised"]].fillna(0).to_numpy()
    return analysis.task == YES_NO and not sides.any()


def one_side_words(side: str) -> str:
    """Say why nothing is told of sides."""
    return (
        f"All stimuli were of one side, {side}, and so was each answer that names a side: sides "
        "are not compared"
    )


def task_words(analysis: Analysis) -> str:
    """Say what the task was, where that is known beyond a plan."""
    if is_yes_no(analysis):
        return "The task was yes/no: whether a stimulus was felt."
    return "The task was a forced choice." if analysis.task == FORCED else ""


def detected_words(analysis: Analysis) -> str:
    """Say what counts as detected."""
    told = "A single stimulus was detected where the answer named its side and nothing else."
    if is_yes_no(analysis):
        told = "A stimulus was detected where the answer was that it was felt."
    elif analysis.task == FORCED:
        told = "A stimulus was detected where the answer was correct."
    return f"{told} {unanswered_words(analysis)}".rstrip()


def unanswered_words(analysis: Analysis) -> str:
    """Say how many trials that count had no answer; empty text without any."""
    late, invalid = analysis.counts.timeouts, analysis.counts.invalid
    if not late and not invalid:
        return ""
    keys = f" and {invalid} with another key" if invalid else ""
    one = late + invalid == 1
    trials = f"{late} trial{'' if late == 1 else 's'} without an answer in time{keys}"
    return f"The {trials} count{'s' if one else ''} as not felt."


def short_words(analysis: Analysis) -> str:
    """Say in two sentences what was asked, what counts as detected, and whose the guess rate is."""
    felt = "a stimulus was detected where the answer named its side and nothing else"
    told = f"{felt[0].upper()}{felt[1:]}."
    if is_yes_no(analysis):
        told = "The task was yes/no: a stimulus was detected where the answer was that it was felt."
        if not analysis.side_told:
            told += " [If stimuli were given at several places, say which: they are pooled here.]"
    elif analysis.task == FORCED:
        told = "The task was a forced choice: a stimulus was detected where the answer was correct."
    elif analysis.detected_any is not None:
        both = " or at both" if analysis.confusion["both"].any() else ""
        told = f"Participants said whether they felt a stimulus, and at which side{both}: {felt}."
    rate = "false-alarm rate" if is_yes_no(analysis) else "guess rate"
    bases = [_BASES[one] for one in analysis.thresholds["guess_basis"].unique()]
    if bases:
        told += f" The {rate} {'; in others it '.join(dict.fromkeys(bases))}."
    return told


_BASES: Final = {
    FORCED_CHOICE: "was that of guessing, for who felt nothing could not say so",
    "blanks": "of each participant was estimated from blank (catch) trials",
    "few blanks": "of each participant was estimated from blank (catch) trials",
    "assumed": "was assumed to be small (a Beta(1, 10) prior), for want of blank trials",
}
"""Where a guess rate comes from."""


def guess_words(analysis: Analysis) -> Iterator[str]:
    """Say which value or prior gamma has, a sentence for each way in which it is known."""
    yes_no, one_side = is_yes_no(analysis), bool(analysis.one_side)
    bases = analysis.thresholds["guess_basis"].replace("few blanks", "blanks")
    for basis, rates in analysis.thresholds.groupby(bases, sort=False)["guess_rate"]:
        low, high = (f"{rate:.2g}" for rate in (rates.min(), rates.max()))
        value = low if low == high else f"{low} to {high}"
        if basis == FORCED_CHOICE:
            yield f"the rate gamma was fixed at {value}, for who felt nothing had to guess"
        elif basis == "assumed":
            yield (
                "the rate gamma had an assumed Beta(1, 10) prior, for want of blank trials, with a "
                f"mean of {value}"
            )
        else:
            blanks = f"b = {_blanks_of_each(analysis)} blank (catch) trials"
            after = (
                f"a false alarms in a participant's {blanks}"
                if yes_no or one_side
                else f"a participant's {blanks}, a being half the number of those answered left "
                "or right, because a guess names the right side half of the time"
            )
            yield (
                f"the rate gamma had the distribution Beta(a + 1/2, b - a + 1/2) after {after}, "
                f"with a mean (a + 1/2)/(b + 1) of {value}; a function that is drawn has the "
                "posterior mean of gamma, for which weak levels count, too"
            )


def _blanks_of_each(analysis: Analysis) -> str:
    """Return how many blank trials a participant has in a condition, the least and the most."""
    each = analysis.blank.loc[analysis.blank["participant"].ne(TOTAL), "presented"]
    return " to ".join(dict.fromkeys(str(int(one)) for one in (each.min(), each.max())))


def hit_words(analysis: Analysis) -> str:
    """Say what a hit is to d', where thresholds count something else; else empty text."""
    if is_yes_no(analysis) or analysis.one_side or analysis.task == FORCED:
        return ""
    answers = "left, right or both" if analysis.confusion["both"].any() else "left or right"
    return f", hits being stimuli answered {answers}, whatever their side,"
