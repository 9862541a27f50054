"""Whether a difference of thresholds may be one of criterion: what blank trials tell of it.

Whether false alarms differ between two conditions rests on one number: of several participants on
the interval of the mean of their differences, of few on an exact test (docs/statistics.md, 8).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

from analysis.codes import Statement, StatementCode
from analysis.definitions import TOTAL
from analysis.groups.criterion import alarms_of, same_rates_p
from analysis.groups.hierarchy import FEW
from analysis.results.compared import ALPHA, alarms_apart, by_level, level_words, pairs_of, totals
from analysis.results.methods.alarms import interleaved, taken_together
from analysis.results.methods.words import SPELLED, isolated

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pandas as pd

    from analysis.results.compared import Pair
    from analysis.results.tables import Analysis


_LEAST_P: Final = 0.001
_OF_HALF: Final = 1 / 3
_AN_ANSWER: Final = 1 + 1e-9  # rounding of shares aside
_TOTALS: Final = "Fisher's exact test of the totals"
_WITHIN: Final = "exact Cochran-Mantel-Haenszel test within these participants"
_ENOUGH: Final = "; in a paper this interval is enough, without d'"
_MEANS: Final = {
    "Student's t": "the mean of the participants' differences, with a 95 % interval by Student's t",
    "Welch's t": "the difference of the means of both groups, with a 95 % interval by Welch's t",
}
_SHARES: Final = {
    "Student's t": "the mean of the participants' differences of their shares of blank trials, "
    "with a 95 % interval by Student's t",
    "Welch's t": "the difference of the means of their shares of blank trials, with a 95 % "
    "interval by Welch's t",
}


class _Verdict(NamedTuple):
    """Whether false alarms of two conditions differ, on what that rests, and by which sign."""

    apart: bool
    p: float
    test: str
    points: str  # the mean difference with its limits, where the verdict rests on these
    more: int  # 1 where they were more frequent in the second condition, -1 where rarer, else 0


def criterion_sentences(analysis: Analysis) -> Iterator[Statement]:
    """Say of conditions that differ whether false alarms do so, or are not known."""
    pairs = [one for one in pairs_of(analysis.differences) if one.apart]
    if not pairs or analysis.detected_any is None:
        return
    beside = "; d' at single levels is in the table" if len(analysis.d_prime_differences) else ""
    if not _all_told(analysis, pairs):
        text = f"a difference may be one of criterion, of which only blank trials can tell{beside}"
        yield Statement(StatementCode.CRITERION_UNKNOWN, text)
        return
    found = [_verdict(analysis.blank, one) for one in pairs]
    often = sum(one.apart for one in found)
    if len(pairs) > 1:
        which = "95 % intervals in the table"
        if least := min((one for one in found if not one.points), key=lambda o: o.p, default=None):
            others = f"{which}; " if any(one.points for one in found) else ""
            which = f"{others}least {_p_words(least.p)}, {least.test}"
        if often:
            text = (
                f"false alarms were not equally frequent in {often} of these {len(pairs)} pairs of "
                f"conditions ({which}); where they are rarer at the higher threshold, a difference "
                f"may be one of criterion, in whole or in part{beside}"
            )
            yield Statement(StatementCode.FALSE_ALARMS_DIFFER, text)
        else:
            text = f"false alarms are not told apart ({which})"
            yield Statement(StatementCode.FALSE_ALARM_DIFFERENCE_NOT_SHOWN, text)
    else:
        yield from _of_two(analysis, pairs[0], found[0], beside)
    if together := interleaved(analysis):
        text = taken_together(analysis, together)
        yield Statement(StatementCode.CONDITIONS_INTERLEAVED, text)


def _of_two(analysis: Analysis, one: Pair, told: _Verdict, beside: str) -> Iterator[Statement]:
    """Say of two conditions whether false alarms differ, and what follows from it."""
    words = f"{_p_words(told.p)}, {told.test}"
    if told.points:
        at, _, limits = told.points.removesuffix(")").partition(" (")
        which = f"in {isolated(one.b)} against {isolated(one.a)}"
        words = f"{at} {which}, 95 % interval {limits} by {one.t_test}"
    push = _push(one, told)
    if told.apart:
        text = f"false alarms were not equally frequent ({words}): {push}{beside}"
        yield Statement(StatementCode.FALSE_ALARMS_DIFFER, text)
        if levels := by_level(analysis, one):
            yield Statement(StatementCode.D_PRIME_BY_LEVEL, level_words(levels, one))
    else:
        enough = bool(told.points) and not interleaved(analysis)
        text = f"false alarms are not told apart ({words}){_ENOUGH * enough}"
        yield Statement(StatementCode.FALSE_ALARM_DIFFERENCE_NOT_SHOWN, text)
        if push:
            yield Statement(StatementCode.FALSE_ALARM_TENDENCY, f"if anything {push}")


def _push(one: Pair, told: _Verdict) -> str:
    """Say which way false alarms move a difference of thresholds; empty text without a sign."""
    if not told.more:
        return ""
    higher = one.ends_db[0] > 0
    where = isolated(one.b if higher else one.a)
    if (told.more > 0) == higher:
        return (
            f"they were more frequent in {where}, where the threshold is higher, and a laxer "
            "criterion there would hide part of the difference rather than cause it"
        )
    part = "in whole or in part" if told.apart else "in part"
    return (
        f"they were rarer in {where}, where the threshold is higher, and a stricter criterion "
        f"there may bring the difference about {part}"
    )


def _all_told(analysis: Analysis, pairs: list[Pair]) -> bool:
    told = {row["condition"] for row in totals(analysis) if "condition" in row}
    return all({one.a, one.b} <= told for one in pairs)


def _verdict(blank: pd.DataFrame, one: Pair) -> _Verdict:
    """Decide whether false alarms differ, of people in both conditions or else of totals.

    Of at least `FEW` people that is so where the interval of the mean difference, as it is printed,
    leaves out 0.
    """
    people, alarms, presented = alarms_of(blank, one.a, one.b)
    p = same_rates_p(alarms, presented)
    each = [b / of_b - a / of_a for (a, b), (of_a, of_b) in zip(alarms, presented, strict=True)]
    more = math.fsum(each) / len(each)
    points = alarms_apart(one.row) if _enough(blank, one, people) else ""
    apart = p < ALPHA
    if points:
        low, high = (
            round(100 * float(one.row[f"false_alarm_difference_{end}"]), 1)
            for end in ("low", "high")
        )
        apart = low > 0 or high < 0
    # What one answer would turn round points nowhere, nor does a small part of the interval.
    answers = abs(more) * min(map(sum, zip(*presented, strict=True)))
    half = (float(one.row["false_alarm_difference_high"]) - more) if points and people else 0.0
    clear = answers > _AN_ANSWER and abs(more) >= _OF_HALF * half
    sign = int(math.copysign(1, more)) if apart or clear else 0
    return _Verdict(apart=apart, p=p, test=_WITHIN if people else _TOTALS, points=points, more=sign)


def _enough(blank: pd.DataFrame, one: Pair, people: Sequence[str]) -> bool:
    """Tell whether there are people enough in both conditions or, of others, in each."""
    each = blank[blank["participant"].ne(TOTAL)].groupby("condition")["participant"].nunique()
    return (len(people) or min(each.get(name, 0) for name in (one.a, one.b))) >= FEW


def _p_words(p: float) -> str:
    return "p < 0.001" if p < _LEAST_P else f"p = {p:.3f}"


def _verdicts(analysis: Analysis) -> list[tuple[Pair, _Verdict]]:
    """Return those that the answer tells: of pairs of conditions whose thresholds differ."""
    pairs = [one for one in pairs_of(analysis.differences) if one.apart]
    if analysis.detected_any is None or not pairs or not _all_told(analysis, pairs):
        return []
    return [(one, _verdict(analysis.blank, one)) for one in pairs]


def settled(analysis: Analysis) -> set[tuple[str, str]]:
    """Return the pairs of conditions whose false alarms have an interval with 0 in it.

    d' at single levels has no part in their answer (docs/explanation/intervals.md, in a paper).
    """
    return {(one.a, one.b) for one, of in _verdicts(analysis) if of.points and not of.apart}


def _differences(analysis: Analysis) -> list[str]:
    return [
        f"{points.replace('points', 'percentage points')} in {isolated(one.b)} against "
        f"{isolated(one.a)}"
        for one in pairs_of(analysis.differences)
        if (points := alarms_apart(one.row))
    ]


def _t_tests(analysis: Analysis) -> list[str]:
    """Return by which t false alarms were compared."""
    pairs = pairs_of(analysis.differences)
    return sorted({one.t_test for one in pairs if alarms_apart(one.row)})


def compared_words(analysis: Analysis) -> Iterator[str]:
    """Say how false alarms of two conditions were compared, and on what the verdict rests."""
    found, told = _verdicts(analysis), _differences(analysis)
    by_t = any(one.points for _, one in found)
    if told:
        each = ": " + ", ".join(told) if len(told) <= SPELLED else ""
        how = " or, of different participants, ".join(
            _SHARES[t_test] for t_test in _t_tests(analysis)
        )
        yield (
            f"By how much false alarms are more frequent in one of two conditions is {how}, which "
            f"is of people like the participants{each}."
        )
    if by_t:
        yield "Whether false alarms are said to differ rests on this interval."
    if not found:
        return
    each = ", ".join(
        f"{_p_words(of.p)} of {isolated(one.b)} against {isolated(one.a)}" for one, of in found
    )
    if {of.test for _, of in found} == {_TOTALS}:
        which = "Beside it, they" if by_t else "False alarms of two conditions"
        yield (
            f"{which} were compared by {_TOTALS} (two-sided; {each}), which ignores that "
            "participants differ."
        )
        return
    rests = "" if by_t else ", for want of enough participants on it rests whether they differ"
    yield (
        f"{'Beside it, conditional' if by_t else 'Conditional'} on these participants, false "
        "alarms were compared by the exact Cochran-Mantel-Haenszel test (two-sided, a stratum for "
        "each participant: given the false alarms in both conditions together, those in one are "
        f"hypergeometric, and are summed over participants; {each}){rests}."
    )


def how_compared(analysis: Analysis) -> str:
    """Say by what false alarms of two conditions were compared, for the short version."""
    found = _verdicts(analysis)
    if any(one.points for _, one in found) or (not found and _differences(analysis)):
        how = " or ".join(_MEANS[t_test] for t_test in _t_tests(analysis))
        return f"Those of two conditions were compared by {how}."
    if {one.test for _, one in found} == {_TOTALS}:
        return f"Those of two conditions were compared by {_TOTALS}."
    return f"Those of two conditions were compared by the two-sided {_WITHIN}." if found else ""
