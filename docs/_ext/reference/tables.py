"""The columns of every CSV: trials, measurements, and the tables of an analysis."""

from __future__ import annotations

import csv
from dataclasses import fields
from typing import TYPE_CHECKING, get_type_hints

from analysis.definitions import DEFINITIONS
from experiment.terms.record import COLUMNS, MeasuredRow
from reference.markdown import literal, table

if TYPE_CHECKING:
    from pathlib import Path

    from reference.sample import Sample


def meanings() -> dict[str, str]:
    """Return what a column means, by its name: the session's first, then the analysis's own."""
    ours = {name: text for names, text in DEFINITIONS.items() for name in names.split(", ")}
    return {column.name: column.description for column in COLUMNS} | ours


def page(sample: Sample) -> str:
    """Write the page."""
    told = [
        "# Columns of the tables\n",
        (
            "UTF-8 without a mark at its beginning, commas, `n/a` for what does not exist or is "
            "not known. How numbers are worked out: [](/statistics.md).\n"
        ),
        "## trials.csv\n\nOne row for each presented trial, built from the journal.\n",
        table(
            ("column", "meaning", "type", "words", "n/a"),
            [
                (
                    literal(column.name),
                    column.description,
                    column.type,
                    " ".join(column.choices),
                    "may be" if column.optional else "",
                )
                for column in COLUMNS
            ],
        ),
        "## measured.csv\n\nOne row for each burst that a monitor measured.\n",
        _measured(),
    ]
    for path in sorted(sample.analysis.glob("*.csv")):
        told += [f"## {path.name}\n", _of_analysis(path)]
    return "\n".join(told)


def _measured() -> str:
    kinds = get_type_hints(MeasuredRow)
    rows = []
    for field in fields(MeasuredRow):
        kind = getattr(kinds[field.name], "__name__", str(kinds[field.name]))
        words = " ".join(field.metadata["choices"])
        optional = "may be" if "None" in kind else ""
        named = kind.replace(" | None", "")
        rows.append((literal(field.name), field.metadata["description"], named, words, optional))
    return table(("column", "meaning", "type", "words", "n/a"), rows)


def _of_analysis(path: Path) -> str:
    """Write the columns of a table of an analysis, with an example from its first row."""
    with path.open(encoding="utf-8", newline="") as file:
        first, *rows = csv.reader(file)
    known = meanings()
    values = rows[0] if rows else [""] * len(first)
    return table(
        ("column", "meaning", "example"),
        [
            (literal(name), known.get(name) or known[name[: -len("_a")]], value)
            for name, value in zip(first, values, strict=True)
        ],
    )
