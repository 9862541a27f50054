"""The text of a methods section, in the words of methods.txt.jinja."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from analysis.counts.checks import ALTERNATED, INTERLEAVED
from analysis.numbers import TOTAL
from analysis.reading.columns import FORCED
from analysis.results.analysis import ALPHA, MISFIT_P, misfits_of
from analysis.results.findings import differences, estimates, false_alarms, left_out, level_range
from analysis.results.protocol import (
    format_cutoff,
    format_levels,
    format_material,
    format_noise,
    format_plate,
    format_trials,
    planned,
)
from analysis.results.rendering import phrases, plain, template
from analysis.results.summary import versions
from analysis.thresholds.fit import WITH_THRESHOLD

if TYPE_CHECKING:
    import pandas as pd

    from analysis.results.analysis import Analysis
    from analysis.results.protocol import Planned
    from experiment.study.study import Study


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
    caption: str = ""

    @property
    def text(self) -> str:
        """All of it as plain text, a line for each paragraph."""
        cited = [f"[{at}] {reference}" for at, reference in enumerate(self.references, start=1)]
        head = phrases()["methods"]["supplement"]
        parts = [*self.paragraphs, self.caption, head, *self.supplement, "\n".join(cited)]
        return plain("\n\n".join(filter(None, parts))) + "\n"


def methods_of(analysis: Analysis, plans: Planned | None = None, *, caption: str = "") -> Methods:
    """Write the methods of an analysis; `plans` are `planned` of it, `caption` the figure's."""
    plans = planned(analysis) if plans is None else plans
    cited: list[str] = []

    def cite(key: str) -> str:
        if key not in cited:
            cited.append(key)
        return f"[{cited.index(key) + 1}]"

    data = _data(analysis, plans) | {"cite": cite}
    texts = [
        tuple(
            joined
            for part in template(name).render(**data).split("\n\n")
            if (joined := " ".join(part.split()))
        )
        for name in ("methods.txt.jinja", "supplement.txt.jinja")
    ]
    references = dict(phrases()["references"])
    references["tactstrip"] = references["tactstrip"].format(version=versions()["tactstrip"])
    return Methods(
        paragraphs=texts[0],
        supplement=texts[1],
        references=tuple(references[key] for key in cited),
        caption=caption,
    )


def _data(analysis: Analysis, plans: Planned) -> dict[str, Any]:
    """Return what both templates state."""
    table, pairs = analysis.thresholds, differences(analysis)
    fitted = table[table["status"].isin(WITH_THRESHOLD)]
    named = phrases()["reasons"]
    task = "sites"
    if analysis.is_yes_no:
        task = "yes/no"
    elif analysis.loaded.task == FORCED:
        task = "forced choice"
    elif analysis.detected_any is None:
        task = "unknown"
    people = analysis.participants
    rates = table.groupby(table["guess_basis"].replace("few blanks", "blanks"))["guess_rate"]
    return {
        "analysis": analysis,
        "mark": analysis.mark,
        "counts": analysis.counts,
        "study": _study(plans.studies[0]) if plans.studies else None,
        "studies": len(plans.studies),
        "task": task,
        "sides": bool(analysis.loaded.side_told),
        "both_answered": bool(analysis.confusion["both"].any())
        if len(analysis.confusion)
        else False,
        "conditions": [*map(str, people["condition"].unique())],
        "levels": _span(people.groupby(["condition", "participant"])["level_vpp"].nunique()),
        "range": level_range(analysis) if len(people) else "",
        "per_level": _usual(people.set_index("participant")["presented"]),
        "per_person": {
            kind: _usual(_of_people(getattr(analysis, kind), people))
            for kind in ("blank", "both")
            if len(getattr(analysis, kind))
        },
        "left_out": [
            {"text": named.get(reason, reason), "number": number}
            for reason, number in left_out(analysis, named)
        ],
        "left_out_by": analysis.loaded.left_out_by,
        "order": _order(analysis),
        "bases": {str(basis): _span(values.map("{:.2g}".format)) for basis, values in rates},
        "log": not analysis.axis.signed,
        "in_db": analysis.axis.is_logarithmic,
        "axis_label": analysis.axis.label,
        "of_groups": bool(len(analysis.groups) and analysis.groups["participants"].max() > 1),
        "thresholds": len(table),
        "estimates": estimates(analysis),
        "differences": pairs,
        "paired": [*dict.fromkeys(bool(pair.participants) for pair in pairs)],
        "rates": false_alarms(analysis),
        "alarm_tests": [
            {"a": pair.a, "b": pair.b, "p": p, "differ": p < ALPHA}
            for pair in pairs
            if (p := pair.row["false_alarm_p"]) == p
        ],
        "tested": int(table["deviance_p"].notna().sum()),
        "misfits": misfits_of(table).to_dict("records"),
        "misfit_limit": MISFIT_P,
        "fitted": len(fitted),
        "at_bound": int(fitted["status"].eq("lapse_at_bound").sum()),
        "steep": int(fitted["status"].eq("separated").sum()),
        "sides_differ": [
            {"condition": condition, "p": p}
            for condition, p in analysis.side_p.items()
            if p < ALPHA
        ],
        "sensitivity": len(analysis.sensitivity),
        "versions": versions(),
    }


def _study(study: Study) -> dict[str, Any]:
    """Return the texts of a study."""
    design = study.design
    return {
        "plate": format_plate(study),
        "material": format_material(study),
        "cutoff": format_cutoff(study),
        "levels": format_levels(study),
        "trials": format_trials(study),
        "noise": format_noise(study),
        "stimuli": [(one.name, one.summary) for one in study.conditions],
        "order": design.order,
        "foreperiod_s": design.foreperiod_s,
        "responses": ", ".join(design.responses),
        "window_s": design.response_window_s,
        "contact": study.contact.summary,
    }


def _of_people(table: pd.DataFrame, people: pd.DataFrame) -> pd.Series[int]:
    """Return how many trials of a kind each participant had in a condition."""
    rows = table[table["participant"].ne(TOTAL)]
    number = rows.set_index("participant")["presented"]
    missing = [name for name in people["participant"].unique() if name not in number.index]
    return number if not missing else number.reindex([*number.index, *missing], fill_value=0)


def _span(numbers: Any) -> str:
    """Return the least and the most of some numbers."""
    ends = dict.fromkeys((str(numbers.min()), str(numbers.max()))) if len(numbers) else {}
    return " to ".join(ends)


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


def _order(analysis: Analysis) -> dict[str, Any]:
    """Return how many participants began with which condition, as far as the data show it."""
    rows = analysis.differences
    began: Counter[str] = Counter()
    turns: Counter[str] = Counter()
    unknown = 0
    for _, pairs in rows[rows["participant"].ne(TOTAL)].groupby("participant"):
        names = {*pairs["condition_a"], *pairs["condition_b"]}
        wins = Counter(first for first in pairs["first"] if first in names)
        first = [name for name, number in wins.items() if number == len(names) - 1]
        mixed = [how for how in (INTERLEAVED, ALTERNATED) if pairs["first"].eq(how).any()]
        if first:
            began[first[0]] += 1
        elif mixed:
            turns[mixed[0]] += 1
        else:
            unknown += 1
    return {
        "began": sorted(began.items()),
        "turns": {how: turns[how] for how in (INTERLEAVED, ALTERNATED)},
        "unknown": unknown,
    }
