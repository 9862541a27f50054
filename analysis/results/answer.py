"""The answer to the question of a study, as rows: for the terminal, the page and the summary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from analysis.reading.columns import FORCED
from analysis.reading.trials import NEVER_ANSWERED
from analysis.results.analysis import ALPHA
from analysis.results.findings import (
    differences,
    estimates,
    false_alarms,
    left_out,
    side_estimates,
)
from analysis.results.rendering import phrases, sentence

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from analysis.results.analysis import Analysis
    from experiment.study.threshold import MedianThreshold


MAX_CONDITIONS: Final = 5
"""Of more conditions the answer states the range of thresholds, and the report lists them."""
MAX_ITEMS: Final = 3
"""Of more differences, and of more rates of false alarms, the answer states a summary."""
MAX_WITH_MICROMETRES: Final = 2
_FILE: Final = "answer.jinja"


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerRow:
    """A row of the answer: its kind, the name of a condition or pair, and the text.

    Names come from files: they are printed as they are, and may be cut on a terminal.
    """

    kind: str
    text: str
    names: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The heading of rows of this kind."""
        return phrases()["answer"][self.kind]


def answer(analysis: Analysis, brief: Collection[str] = ()) -> list[AnswerRow]:
    """Return the rows of the answer; kinds in `brief` take less room."""
    return [
        *_sides(analysis, brief="side" in brief),
        *_thresholds(analysis, brief="threshold" in brief),
        *_differences(analysis, brief="difference" in brief),
        *_false_alarms(analysis),
        _left_out(analysis),
    ]


def _row(kind: str, macro: str = "", names: tuple[str, ...] = (), **data: object) -> AnswerRow:
    return AnswerRow(kind=kind, names=names, text=sentence(_FILE, macro or kind, **data))


def _named(analysis: Analysis, condition: str) -> tuple[str, ...]:
    return (condition,) if analysis.counts.conditions > 1 else ()


def _sides(analysis: Analysis, *, brief: bool) -> Iterator[AnswerRow]:
    results = side_estimates(analysis)
    if len(results) > MAX_CONDITIONS:
        yield _row("side", "sides_of_many", number=len(results))
        return
    for each in results:
        yield _row("side", names=_named(analysis, each["condition"]), e=each, brief=brief)


def _thresholds(analysis: Analysis, *, brief: bool) -> Iterator[AnswerRow]:
    results = estimates(analysis)
    if not results:
        yield _row("threshold", "threshold_missing")
    elif len(results) > (1 if brief else MAX_CONDITIONS):
        values = analysis.groups["threshold_vpp"].astype(float)
        ends = ["", ""]
        if values.notna().any():
            ends = [results[i].short for i in (int(values.argmin()), int(values.argmax()))]
        low, high = ends
        yield _row("threshold", "thresholds_of_many", number=len(results), lowest=low, highest=high)
    else:
        for each in results:
            yield _row("threshold", names=_named(analysis, each.condition), e=each)
        trials = analysis.trials
        silent = {*trials.loc[trials["reason"].eq(NEVER_ANSWERED), "condition"]}
        for condition in sorted(silent - {each.condition for each in results})[:1]:
            yield _row("threshold", "condition_silent", names=(condition,))
    if len(results) <= MAX_WITH_MICROMETRES:
        for each in results:
            if each.fingertips:
                yield _row("micrometres", names=_named(analysis, each.condition), e=each)


def _differences(analysis: Analysis, *, brief: bool) -> Iterator[AnswerRow]:
    results = differences(analysis)
    if len(results) > (1 if brief else MAX_ITEMS):
        apart = sum(pair.apart for pair in results)
        yield _row("difference", "differences_of_many", number=len(results), apart=apart)
    elif results:
        for pair in results:
            yield _row(
                "difference", names=(pair.b, pair.a), d=pair, short=brief or len(results) > 1
            )
    elif len(analysis.groups) > 1:
        yield _row("difference", "not_compared")


def _false_alarms(analysis: Analysis) -> Iterator[AnswerRow]:
    rates = false_alarms(analysis)
    if analysis.detected_any is None:
        reason = "forced" if analysis.loaded.task == FORCED or not _none_in_part(analysis) else ""
        yield _row("false_alarms", "false_alarms_missing", reason=reason or "in part")
    elif not rates:
        trials = analysis.trials
        shown = len(trials) and trials["kind"].eq("blank").any()
        reason = "uncounted" if shown else "none"
        yield _row("false_alarms", "false_alarms_missing", reason=reason)
    elif len(rates) > MAX_ITEMS:
        shares = [rate.p for rate in rates]
        yield _row("false_alarms", "false_alarms_of_many", low=min(shares), high=max(shares))
    else:
        pairs = [pair.row["false_alarm_p"] for pair in differences(analysis)]
        p = pairs[0] if len(pairs) == 1 and pairs[0] == pairs[0] else None
        differ = p is not None and p < ALPHA
        yield _row("false_alarms", rates=rates, p=p, differ=differ)


def _none_in_part(analysis: Analysis) -> bool:
    """Tell whether "none" could be answered in some trials that count, but not in all."""
    trials = analysis.trials
    if trials.empty:
        return False
    offered = trials.loc[trials["reason"].eq(""), "none_offered"]
    return bool(offered.fillna(value=False).any())


def _left_out(analysis: Analysis) -> AnswerRow:
    names = phrases()["reasons"]
    reasons = [
        {"text": names.get(reason, reason), "number": number}
        for reason, number in left_out(analysis, names)
    ]
    of_counts = bool(analysis.counts.trials) and analysis.trials.empty
    return _row("left_out", counts=analysis.counts, reasons=reasons, of_counts=of_counts)


def simulated_row(thresholds: Sequence[MedianThreshold], sd_db: float) -> AnswerRow:
    """Return the row with the thresholds of simulated participants."""
    each = [
        {"condition": one.condition, "vpp": one.threshold_vpp, "um": one.threshold_um}
        for one in thresholds
    ]
    return _row("simulated", thresholds=each, sd_db=sd_db)
