"""The answer to the question of a study, as rows: for the terminal, the page and the summary."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Final

from analysis.numbers import TOTAL
from analysis.reading.columns import FORCED
from analysis.reading.trials import NEVER_ANSWERED
from analysis.results.findings import (
    ALPHA,
    differences,
    estimates,
    false_alarms,
    left_out,
    side_estimates,
    sides_that_differ,
)
from analysis.results.rendering import phrase, sentence, words_of
from analysis.thresholds.discrimination import DB_PER_SIGMA

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from analysis.results.analysis import Analysis
    from experiment.study.study import Study
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
        return phrase(self.kind, "answer")


def answer(analysis: Analysis, brief: Collection[str] = ()) -> list[AnswerRow]:
    """Return the rows of the answer; kinds in `brief` take less room."""
    return [
        *_information(analysis),
        *_sides(analysis, brief="side" in brief),
        *(() if _is_at_one_level(analysis) else _thresholds(analysis, brief="threshold" in brief)),
        *_differences(analysis, brief="difference" in brief),
        *(() if analysis.task.nothing is None else (_false_alarms(analysis),)),
        _left_out(analysis),
    ]


def _row(
    kind: str,
    macro: str = "",
    names: tuple[str, ...] = (),
    analysis: Analysis | None = None,
    **data: object,
) -> AnswerRow:
    """Return a row; what its kind is called depends on the task."""
    scoring = analysis.scoring if analysis else ""
    text = sentence(_FILE, macro or kind, scoring, **data)
    return AnswerRow(kind=words_of(scoring)["kinds"].get(kind, kind), names=names, text=text)


def _named(analysis: Analysis, condition: str) -> tuple[str, ...]:
    return (condition,) if analysis.counts.conditions > 1 else ()


def _information(analysis: Analysis) -> Iterator[AnswerRow]:
    """Yield the information transfer of each condition, the mean of its participants."""
    table = analysis.information
    for condition, rows in table.groupby("condition") if len(table) else ():
        people = int(rows["participant"].ne(TOTAL).sum())
        row = dict(rows.iloc[0 if people == 1 else -1]) | {"participants": people}
        names = _named(analysis, str(condition))
        yield _row("information", names=names, i=row, counts=analysis.counts)


def _is_at_one_level(analysis: Analysis) -> bool:
    """Return whether an identification has one level in each condition, so that no threshold."""
    return analysis.task.is_identification and bool(
        analysis.thresholds["status"].eq("one_level").all()
    )


def _sides(analysis: Analysis, *, brief: bool) -> Iterator[AnswerRow]:
    conditions = sides_that_differ(analysis)
    if len(conditions) > MAX_CONDITIONS:
        yield _row("side", "sides_of_many", analysis=analysis, number=len(conditions))
        return
    for condition, sides in groupby(side_estimates(analysis), itemgetter("condition")):
        names = _named(analysis, condition)
        yield _row("side", names=names, analysis=analysis, sides=[*sides], brief=brief)


def _thresholds(analysis: Analysis, *, brief: bool) -> Iterator[AnswerRow]:
    rows = estimates(analysis)
    if not rows:
        yield _row("threshold", "threshold_missing", analysis=analysis)
    elif len(rows) > (1 if brief else MAX_CONDITIONS):
        inside = sorted((row for row in rows if not math.isnan(row["at"])), key=itemgetter("at"))
        ends = [row["short"] for row in (*inside[:1], *inside[-1:])]
        macro = "thresholds_of_many"
        yield _row("threshold", macro, analysis=analysis, number=len(rows), ends=ends)
    else:
        for row in rows:
            names = _named(analysis, row["condition"])
            yield _row("threshold", names=names, analysis=analysis, e=row, counts=analysis.counts)
        for kind in ("re_reference", "difference_threshold"):
            for row in rows:
                if row[kind]:
                    yield _row(kind, names=_named(analysis, row["condition"]), e=row)
        trials = analysis.trials
        silent = {*trials.loc[trials["reason"].eq(NEVER_ANSWERED), "condition"]}
        for condition in sorted(silent - {row["condition"] for row in rows})[:1]:
            yield _row("threshold", "condition_silent", names=(condition,), analysis=analysis)
    for row in rows if len(rows) <= MAX_WITH_MICROMETRES else ():
        if row["um"]:
            yield _row("micrometres", names=_named(analysis, row["condition"]), e=row)


def _differences(analysis: Analysis, *, brief: bool) -> Iterator[AnswerRow]:
    pairs = differences(analysis)
    if len(pairs) > (1 if brief else MAX_ITEMS):
        yield _row("difference", "differences_of_many", analysis=analysis, pairs=pairs)
        return
    for pair in pairs:
        names = (pair["condition_b"], pair["condition_a"])
        short = brief or len(pairs) > 1
        yield _row("difference", names=names, analysis=analysis, d=pair, short=short)
    if not pairs and len(analysis.groups) > 1:
        yield _row("difference", "not_compared", analysis=analysis)


def _false_alarms(analysis: Analysis) -> AnswerRow:
    trials, p = analysis.trials, [pair["false_alarm_p"] for pair in differences(analysis)]
    offered = trials.loc[trials["reason"].eq(""), "none_offered"].fillna(value=False)
    return _row(
        "false_alarms",
        rates=false_alarms(analysis),
        max_rates=MAX_ITEMS,
        p=p[0] if len(p) == 1 and not math.isnan(p[0]) else None,
        alpha=ALPHA,
        none_offered=analysis.detected_any is not None,
        forced=analysis.loaded.task == FORCED or not offered.any(),
        has_blanks=trials["kind"].eq("blank").any(),
    )


def _left_out(analysis: Analysis) -> AnswerRow:
    of_counts = bool(analysis.counts.trials) and analysis.trials.empty
    reasons = left_out(analysis)
    return _row("left_out", counts=analysis.counts, reasons=reasons, of_counts=of_counts)


def simulated_row(thresholds: Sequence[MedianThreshold], sd_db: float, study: Study) -> AnswerRow:
    """Return the row with the thresholds of simulated participants, or what they can compare."""
    if study.task.has_reference:
        # Two sensations are compared, each as wide as the function of detection.
        width_db = DB_PER_SIGMA * math.sqrt(2) * study.simulation.sigma
        reference_vpp = study.task.reference_vpp
        macro = "simulated_comparison"
        return _row("simulated", macro, reference_vpp=reference_vpp, width_db=width_db)
    return _row("simulated", thresholds=thresholds, sd_db=sd_db)
