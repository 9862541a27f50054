"""The text of a methods section, in the words of methods.txt.jinja."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from analysis.counts.checks import ALTERNATED, INTERLEAVED
from analysis.numbers import TOTAL
from analysis.results.findings import (
    differences,
    false_alarms,
    left_out,
    level_range,
    records,
    sides_that_differ,
)
from analysis.results.rendering import phrases, plain, template
from analysis.results.summary import versions
from analysis.results.warnings import MISFIT_P, misfits_of
from analysis.thresholds.fit import WITH_THRESHOLD

if TYPE_CHECKING:
    import pandas as pd

    from analysis.results.analysis import Analysis


MAX_SHARE_OF_OTHERS: Final = 0.25
"""Participants with other numbers of trials than most are counted apart, if they are so few."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Methods:
    """Paragraphs to paste: the methods, and a supplement with every detail; and their references.

    Names of participants and conditions are isolated in `paragraphs`; `text` has them plain.
    """

    paragraphs: tuple[str, ...]
    supplement: tuple[str, ...]
    references: tuple[str, ...]

    def text(self, caption: str = "") -> str:
        """Return all of it as plain text, with the caption of a figure; a line a paragraph."""
        cited = [f"[{at}] {reference}" for at, reference in enumerate(self.references, start=1)]
        head = phrases()["methods"]["supplement"]
        parts = [*self.paragraphs, caption, head, *self.supplement, "\n".join(cited)]
        return plain("\n\n".join(filter(None, parts))) + "\n"


def methods_of(analysis: Analysis) -> Methods:
    """Write the methods of an analysis."""
    cited: dict[str, int] = {}

    def cite(key: str) -> str:
        return f"[{cited.setdefault(key, len(cited) + 1)}]"

    data = _data(analysis) | {"cite": cite, "words": analysis.words}
    texts = [
        tuple(
            joined
            for part in template(name).render(**data).split("\n\n")
            if (joined := " ".join(part.split()))
        )
        for name in ("methods.txt.jinja", "supplement.txt.jinja")
    ]
    references, version = phrases()["references"], versions()["tactstrip"]
    return Methods(
        paragraphs=texts[0],
        supplement=texts[1],
        references=tuple(references[key].format(version=version) for key in cited),
    )


def _data(analysis: Analysis) -> dict[str, Any]:
    """Return what both templates state."""
    table, pairs = analysis.thresholds, differences(analysis)
    people = analysis.participants
    task = "yes/no" if analysis.is_yes_no else analysis.loaded.task
    rates = table.groupby(table["guess_basis"].replace("few blanks", "blanks"))["guess_rate"]
    return {
        "analysis": analysis,
        "studies": [*analysis.plans.studies.values()],
        "task": task or ("unknown" if analysis.detected_any is None else "sites"),
        "conditions": [*map(str, people["condition"].unique())],
        "levels": _span(people.groupby(["condition", "participant"])["level_vpp"].nunique()),
        "range": level_range(analysis) if len(people) else "",
        "per_level": _usual(people.set_index("participant")["presented"]),
        "per_person": {
            kind: _usual(_of_people(getattr(analysis, kind), people))
            for kind in ("blank", "both")
            if len(getattr(analysis, kind))
        },
        "left_out": left_out(analysis),
        "order": _count_orders(analysis),
        "bases": {str(basis): _span(values, "{:.2g}") for basis, values in rates},
        "of_groups": analysis.groups["participants"].gt(1).any(),
        "differences": pairs,
        "paired": {pair["people"] > 0 for pair in pairs},
        "rates": false_alarms(analysis),
        "alarm_p": [
            pair["false_alarm_p"] for pair in pairs if not math.isnan(pair["false_alarm_p"])
        ],
        "tested": table["deviance_p"].count(),
        "misfits": records(misfits_of(table)),
        "misfit_limit": MISFIT_P,
        "status": Counter(table["status"]),
        "fitted": table["status"].isin(WITH_THRESHOLD).sum(),
        "sides_differ": sides_that_differ(analysis),
        "versions": versions(),
    }


def _of_people(table: pd.DataFrame, people: pd.DataFrame) -> pd.Series[int]:
    """Return how many trials of a kind each participant had in a condition."""
    names = people[["participant"]].drop_duplicates()
    rows = table.loc[table["participant"].ne(TOTAL), ["participant", "presented"]]
    return names.merge(rows, "outer").fillna(0).set_index("participant")["presented"]


def _span(numbers: pd.Series[Any], form: str = "{}") -> str:
    """Return the least and the most of some numbers."""
    return " to ".join(dict.fromkeys(map(form.format, (numbers.min(), numbers.max()))))


def _usual(numbers: pd.Series[int]) -> str:
    """Return the least and the most of a participant; few participants with others apart.

    >>> import pandas as pd
    >>> _usual(pd.Series([20, 18])), _usual(pd.Series([20, 12, 20, 20, 20]))
    ('18 to 20', '20 (12 for 1 of 5 participants)')
    """
    if numbers.empty:
        return ""
    usual = numbers.eq(numbers.mode().iloc[0])
    people, others = numbers.index.nunique(), numbers[~usual].index.nunique()
    if 0 < others <= MAX_SHARE_OF_OTHERS * people:
        few = f"({_span(numbers[~usual].astype(int))} for {others} of {people} participants)"
        return f"{_span(numbers[usual].astype(int))} {few}"
    return _span(numbers.astype(int))


def _count_orders(analysis: Analysis) -> Counter[str]:
    """Count who began with which condition, had them in turns, or in an order that is not known."""
    rows = analysis.differences[analysis.differences["participant"].ne(TOTAL)]
    orders: Counter[str] = Counter()
    for _, pairs in rows.groupby("participant"):
        first = [*pairs["first"]]
        names = {*pairs["condition_a"], *pairs["condition_b"]}
        began = [name for name in names if first.count(name) == len(names) - 1]
        turns = [how for how in (INTERLEAVED, ALTERNATED) if how in first]
        orders[next(iter([*began, *turns]), "unknown")] += 1
    return orders
