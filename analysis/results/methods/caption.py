"""A caption of the figure of detection, to paste: what it shows of whom, and what its signs are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from analysis.results.figures.composed import ABOVE, BELOW
from analysis.results.figures.curves import DRAWN, OF_BLANKS, conditions_of, shared_levels
from analysis.results.methods.task import is_yes_no
from analysis.results.methods.words import isolated, number_of
from analysis.thresholds.people import FORCED_CHOICE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.results.tables import Analysis


LOOK_WORDS: Final = (
    "circles, solid line",
    "squares, dashed line",
    "triangles, dash-dotted line",
    "diamonds, dotted line",
    "triangles that point down, dash-dot-dotted line",
    "crosses, short-dashed line",
)
"""What each of `analysis.results.figures.composed.LOOKS` is called."""


def caption_words(analysis: Analysis) -> str:
    """Return a caption of what `analysis.results.figures.detection` draws; else empty text."""
    if analysis.levels.empty or analysis.groups.empty:
        return ""
    alone = analysis.participants["participant"].nunique() == 1
    mark = f"{analysis.mark}. " if analysis.mark else ""
    signs = "; ".join(_signs(analysis, alone=alone))
    thresholds = "; ".join(_thresholds(analysis, alone=alone))
    return f"{mark}{_whose(analysis)}. {signs}. {thresholds}."


def _whose(analysis: Analysis) -> str:
    """Say what is drawn, of whom, and which sign a condition has."""
    conditions = conditions_of(analysis)
    number = analysis.participants["participant"].nunique()
    people = number_of(number, "participant")
    told = f"Detection probability by level ({analysis.axis.label}) of {people}"
    if len(conditions) == 1:
        return told
    if len(conditions) > len(LOOK_WORDS):
        return f"{told} in {len(conditions)} conditions, side by side at each level"
    of = analysis.groups.set_index("condition")["participants"]
    each = []
    for condition, look in zip(conditions, LOOK_WORDS, strict=False):
        some = "" if of[condition] == number else f"{number_of(of[condition], 'participant')}; "
        each.append(f"{isolated(condition)} ({some}{look})")
    named = f"{', '.join(each[:-1])} and {each[-1]}"
    return f"{told} in conditions {named}, side by side at each level"


def _signs(analysis: Analysis, *, alone: bool) -> Iterator[str]:
    """Yield what stands above the thresholds."""
    own = f"proportions with 95 % {analysis.ci.title()} intervals (bars)"
    if alone:
        yield f"Open symbols are {own}"
    else:
        shared = [
            shared_levels(analysis, name)["level_vpp"].nunique() for name in conditions_of(analysis)
        ]
        where = ""
        if sum(shared) < len(analysis.levels):
            where = " at the levels that everybody was tested at"
        means = (
            f"Open symbols are means of the participants{where} with 95 % credible intervals for "
            "the population mean (bars; of few people their far limit near 0 or 1 is mostly the "
            "prior's)"
        )
        single = analysis.groups.loc[analysis.groups["participants"].eq(1), "condition"]
        for name in single:
            means += f", in condition {isolated(name)}, of one participant, {own}"
        yield means
        yield "small symbols are single participants"
    if _has_function(analysis):
        of = "" if alone else " of the group"
        yield f"lines are the fitted functions{of} with pointwise 95 % credible bands"
    yield from _starts(analysis, alone=alone)


def _has_function(analysis: Analysis) -> bool:
    groups, people = analysis.groups, analysis.thresholds
    single = groups.loc[groups["participants"].eq(1), "condition"]
    own = people.loc[people["condition"].isin(single), "status"].isin(DRAWN)
    return bool(groups["status"].isin((*DRAWN, "separated")).any() or own.any())


def _starts(analysis: Analysis, *, alone: bool) -> Iterator[str]:
    """Yield what the filled signs at the left edge are, where some are drawn; and chance."""
    table = analysis.thresholds
    of_blanks = table["guess_basis"].isin(OF_BLANKS).groupby(table["condition"]).all()
    if of_blanks.any():
        what = "half of the share of blank (catch) trials answered left or right"
        if is_yes_no(analysis) or analysis.one_side:
            what = "the share of blank (catch) trials answered as felt"
        rate = "false-alarm rates" if is_yes_no(analysis) else "guess rates"
        rate = f"{rate} with 95 % intervals" if alone else f"mean {rate}"
        start = "; the functions start at their posterior means and end below 1 by the lapse rates'"
        start *= _has_function(analysis)
        yield f"filled symbols at the left edge are {rate} as counted ({what}){start}"
    if table["guess_basis"].eq(FORCED_CHOICE).all() and table["guess_rate"].nunique() == 1:
        yield "the thin dashed line is the rate of guessing"


def _thresholds(analysis: Analysis, *, alone: bool) -> Iterator[str]:
    """Yield what stands below the functions."""
    arrows = "; arrows: open ends" if _open_ends(analysis) else ""
    below = (
        "Below, thresholds (posterior medians; dotted lines lead to the functions) with 95 % "
        f"credible intervals (thick bars{arrows})"
    )
    if analysis.groups[["new_low_vpp", "new_high_vpp"]].notna().any(axis=None):
        below += " and, thinner, where another participant's is expected (95 %)"
    yield below
    if _has_function(analysis):
        yield (
            "at the foot, deviance residuals, the signed roots of what each proportion adds to the "
            "deviance"
            if alone
            else "at the foot, the means less the group's function, with the intervals of the means"
        )
    told = analysis.differences["status"].isin(("ok", "at_least", "at_most"))
    if told.any():
        yield "at the head, the difference of thresholds with its 95 % credible interval"


def _open_ends(analysis: Analysis) -> bool:
    """Tell whether an interval has an arrow."""
    limits = ["threshold_low_vpp", "threshold_high_vpp"]
    groups, people = analysis.groups, analysis.thresholds
    single = groups.loc[groups["participants"].eq(1), "condition"]
    for rows, ends in (
        (groups[groups["participants"].gt(1)], [*limits, "new_low_vpp", "new_high_vpp"]),
        (people[people["condition"].isin(single)], limits),
    ):
        drawn = rows["threshold_vpp"].notna() | rows["status"].isin((*BELOW, *ABOVE))
        if rows.loc[drawn, ends].isna().any(axis=None):
            return True
    return False
