"""Tables for terminal and page: rows of an analysis, in the columns that tables.toml declares."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Final

import pandas as pd

from analysis.counts.table import felt_answers, is_correct
from analysis.numbers import TOTAL, in_order
from analysis.results.findings import (
    differences,
    estimates,
    records,
    shares,
    side_estimates,
    with_texts,
)
from analysis.results.rendering import compiled, names_in, phrases, read_toml
from analysis.results.summary import any_side, reported_columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analysis.results.analysis import Analysis


EMPTY: Final = frozenset({"", "n/a"})
_NAMES: Final = frozenset({"Participant", "Condition"})
"""Headings of columns of names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of texts; the first cell names its row."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def make_tables(name: str, frame: pd.DataFrame, analysis: Analysis) -> Iterator[Table]:
    """Lay out rows as tables.toml declares: in one table, or in one for each condition or pair.

    A column is shown where the rows have what it is made of, and any of its cells has a value; a
    table where any other column than those of names is.
    """
    if frame.empty:
        return
    layout, several = read_toml("tables.toml")[name], analysis.counts.conditions > 1
    hidden = {*analysis.task.named_answers, "elsewhere"} if analysis.one_side else set()
    hidden -= {analysis.one_side}
    has_sites = analysis.has_sites and analysis.task.named_answers
    hidden |= set() if has_sites else {"elsewhere", "mislocalised"}
    frame = reported_columns(frame.drop(columns=[*hidden & {*frame.columns}]), analysis)
    frame = frame.rename(columns=lambda column: str(column).removesuffix("_vpp"))
    # In an expression `none` is no name of a column.
    frame = frame.rename(columns={"none": "nothing"}).assign(unit=analysis.axis.unit)
    available = {*frame.columns} - (set() if several else {"condition"})
    groups = frame.groupby(layout["each"]) if "each" in layout else [((), frame)]
    for names, rows in groups:
        where = f", {layout['where'].format(*names)}" if several and names else ""
        columns = {
            heading: cell
            for heading, cell in _columns(layout["columns"], analysis)
            if names_in(cell) <= available
        }
        cells = compiled(f"({', '.join(columns.values())},)")
        texts = pd.DataFrame([[*map(str, cells(row))] for row in records(rows)], columns=[*columns])
        texts = texts.loc[:, ~texts.isin(EMPTY).all()]
        if {*texts} <= _NAMES:
            continue
        yield Table(
            caption=f"{analysis.label(layout['caption'])}{where}",
            header=[*texts],
            rows=texts.to_numpy().tolist(),
            note=analysis.label(layout.get("note", "")),
        )


def _columns(layout: Mapping[str, str], analysis: Analysis) -> Iterator[tuple[str, str]]:
    """Yield headings and cells; ``{answer}`` in both is replaced by each answer of the task."""
    for heading, cell in layout.items():
        for answer in analysis.task.answer_names if "{answer}" in heading else ("",):
            name = "nothing" if answer == "none" else answer
            title = analysis.label(heading).format(answer=answer.capitalize())
            if title:
                yield title, cell.replace("{answer}", name)


def result_rows(analysis: Analysis) -> dict[str, pd.DataFrame]:
    """Return the rows of each table of results by its name in tables.toml.

    Of several participants only the totals of blank and both-finger trials are among them:
    blank.csv and both.csv have each.
    """
    totals = {
        name: table[table["participant"].eq(TOTAL)]
        for name in ("blank", "both", "sensitivity", "d_prime_differences")
        for table in [getattr(analysis, name)]
    }
    if analysis.counts.participants == 1:
        totals |= {"blank": analysis.blank, "both": analysis.both}
    times, kind = analysis.reaction_times, analysis.confusion["kind"]
    single = "stimulus" if analysis.one_place else analysis.confusion["side"]
    confusion = analysis.confusion if analysis.has_sites else analysis.confusion[:0]
    names = phrases()["counts"]
    counts = pd.Series(asdict(analysis.counts)).reindex([*names])
    counts = counts.rename(lambda code: analysis.label(names[code]))
    return {
        "group": pd.DataFrame(estimates(analysis)),
        "side_group": pd.DataFrame(side_estimates(analysis)),
        "differences": pd.DataFrame(differences(analysis)),
        "people": _people(analysis),
        "levels": _levels(analysis),
        "sides": analysis.sides,
        "information": analysis.information,
        "answers": confusion.assign(stimulus=kind.mask(kind.eq("single"), single)),
        "each": _each_participant(analysis),
        "blank": shares(totals["blank"]),
        "both": shares(totals["both"]),
        "hands_off": analysis.hands_off,
        "sensitivity": totals["sensitivity"],
        "d_prime_differences": totals["d_prime_differences"],
        "reaction_times": times if times["n"].gt(0).any() else times[:0],
        "counts": counts[counts.gt(0)].rename_axis("what").reset_index(name="number"),
        "excluded": analysis.excluded,
    }


def _people(analysis: Analysis) -> pd.DataFrame:
    """Return the thresholds of participants, with d' and criterion over all levels."""
    sensitivity = analysis.sensitivity[analysis.sensitivity["level_vpp"].isna()]
    key = ["condition", "participant"]
    table = analysis.thresholds.join(sensitivity.set_index(key)[["d_prime", "criterion"]], on=key)
    return pd.DataFrame(
        row
        for _, rows in table.groupby("condition")
        for row in with_texts(rows, analysis.participants, analysis)
    )


def _levels(analysis: Analysis) -> pd.DataFrame:
    key = ["condition", "level_vpp"]
    people = analysis.participants.groupby(key).size().rename("people")
    return any_side(analysis).join(people, on=key)


def _each_participant(analysis: Analysis) -> pd.DataFrame:
    """Return what no warning is based on: false alarms, answers elsewhere and reaction times."""
    counted = analysis.trials[analysis.trials["reason"].eq("")].astype({"response": object})
    key, response = ["participant", "condition"], counted["response"]
    single, blank = (counted["kind"].eq(kind) for kind in ("single", "blank"))
    correct = is_correct(counted)
    marks = counted[key].assign(
        single=single,
        blank=blank & counted["none_offered"].fillna(value=False).astype(bool),
        alarms=blank & response.isin(felt_answers(analysis.task)),
        elsewhere=single & response.isin(analysis.task.sites) & ~correct,
        timeouts=response.eq("timeout"),
        rt_s=counted["rt_s"].where(single & correct),
    )
    groups = marks.groupby(key, observed=True)
    table = groups.sum().assign(rt_s=groups["rt_s"].median())
    return table.reset_index().sort_values(key, key=in_order)
