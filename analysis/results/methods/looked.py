"""What was looked for in each participant, and what was not, for the report and for the methods."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from analysis.answers.doubts import DRIFTING, FEWEST, GUESSING, SWAPPED
from analysis.answers.drift import STRONG
from analysis.definitions import counted_up
from analysis.reading.reasons import NEVER_ANSWERED
from analysis.results.methods.misfit import REFUSED_P
from analysis.results.methods.words import isolated

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.results.tables import Analysis


EACH: Final = "Each participant's answers"
"""The caption of a table of the report."""


def looked_words(analysis: Analysis) -> str:
    """Say what was looked for in everybody, whom it named, and what was not looked for.

    As `analysis.answers.doubts.doubtful`, `misfits` and the reasons of trials have it; empty text
    where nobody has a trial that counts.
    """
    if analysis.levels.empty:
        return ""
    number = analysis.participants["participant"].nunique()
    people = f"each of {number} participants" if number > 1 else "the one participant"
    looked = dict(_looked(analysis))
    named = {what: sorted(who, key=counted_up) for what, who in looked.items() if who}
    found = [f"{what} ({', '.join(map(isolated, who))})" for what, who in named.items()]
    missed = ["many false alarms"] if len(analysis.blank) else []
    if not analysis.one_side and len(analysis.trials):
        missed.append("a preference for one side")
    if analysis.reaction_times["n"].gt(0).any():
        missed.append("unusual reaction times")
    missed.append("the same data under two names")
    return (
        f"Looked for in {people}: {'; '.join(looked)}. "
        f"{'Found: ' + '; '.join(found) if found else 'None of these was found'}. "
        f"Not looked for: {', '.join(missed)}."
    )


def each_participant(analysis: Analysis) -> tuple[list[str], list[list[str]]]:
    """Return a table of what was not looked for: heads, and a row for each in each condition.

    Blank trials answered as felt, single stimuli answered with the other side, how often either
    side was the answer, answers not in time, and the median reaction time of right ones.
    """
    counted = analysis.trials[analysis.trials["reason"].eq("")].astype({"response": object})
    sides = not analysis.one_side
    alarms = analysis.detected_any is not None
    heads = ["Participant", "Trials", *["False alarms"] * alarms]
    heads += ["The other side", "Said left : right"] * sides
    heads += ["Not in time", "Median reaction time (s)"]
    several = analysis.counts.conditions > 1
    rows = []
    keys = ["participant", "condition"]
    for (who, condition), own in counted.groupby(keys, observed=True):
        single, blank = (own[own["kind"].eq(kind)] for kind in ("single", "blank"))
        side, said = single["side"].astype(str), single["response"].astype(str)
        other = (said.isin(["left", "right"]) & said.ne(side)).sum()
        felt = blank["response"].isin(["left", "right", "both"]).sum()
        left, right = (int(own["response"].eq(name).sum()) for name in ("left", "right"))
        time_s = float(single.loc[said.eq(side), "rt_s"].median())
        rows.append(
            [
                f"{who}, {condition}" if several else str(who),
                str(len(own)),
                *[f"{felt} of {len(blank)}"] * alarms,
                *[f"{other} of {len(single)}", f"{left} : {right}"] * sides,
                str(own["response"].eq("timeout").sum()),
                "n/a" if math.isnan(time_s) else f"{time_s:.3f}",
            ]
        )
    return heads, sorted(rows, key=lambda row: counted_up(row[0]))


def _looked(analysis: Analysis) -> Iterator[tuple[str, set[str]]]:
    """Yield what was looked for, and in whom it was found."""
    of = {
        kind: {one.participant for one in analysis.doubts if one.kind == kind}
        for kind in (SWAPPED, GUESSING, DRIFTING)
    }
    sides = not analysis.one_side and len(analysis.trials) > 0
    if sides or analysis.detected_any is None:
        what = "sides swapped" if sides else "fewer right answers than by guessing"
        yield f"{what} (p < 0.001)", of[SWAPPED]
    if sides or analysis.detected_any is None or len(analysis.blank):
        yield (
            f"answers no better than guessing (p > 0.05, of {FEWEST} single stimuli or more)",
            of[GUESSING],
        )
    if len(analysis.trials):
        unit = "dB" if analysis.axis.is_logarithmic else "eighths of the range of levels"
        yield (
            f"a threshold that drifts within a session (p < 0.001 and at least {STRONG:g} {unit})",
            of[DRIFTING],
        )
        silent = analysis.trials["reason"].eq(NEVER_ANSWERED)
        yield (
            "a condition without a single answer in time",
            {*analysis.trials.loc[silent, "participant"].astype(str)},
        )
    table = analysis.thresholds
    if table["deviance_p"].notna().any():
        refused = table.loc[table["deviance_p"].lt(REFUSED_P), "participant"]
        yield f"a function that does not fit (p < {REFUSED_P:g})", {*refused}
