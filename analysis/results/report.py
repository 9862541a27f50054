"""The report of an analysis: one HTML page that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
from typing import TYPE_CHECKING, Final

import pandas as pd

from analysis.results.answer import answer
from analysis.results.findings import sides_that_differ
from analysis.results.protocol import protocol_rows
from analysis.results.rendering import phrases, read_text, template
from analysis.results.summary import devices
from analysis.results.tables import make_tables, result_rows
from experiment.names import NOT_AVAILABLE
from experiment.record.entries import Header
from experiment.record.files import HEADER

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analysis.results.analysis import Analysis
    from analysis.results.figures.figures import Picture
    from analysis.results.methods import Methods


MAX_ROWS: Final = 16
"""A longer table is folded."""
MAX_LETTERS: Final = 30
"""Letters of a cell that is not wrapped."""


def report_html(analysis: Analysis, pictures: Iterable[Picture], methods: Methods) -> str:
    """Write the report: a page without script or request, the same for the same data."""
    style = read_text("report.css")
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    drawn: dict[str, list[Picture]] = {}
    for picture in pictures:
        drawn.setdefault(picture.figure, []).append(picture)
    rows = result_rows(analysis) | protocol_rows(analysis)
    sides_differ = bool(sides_that_differ(analysis))
    if not sides_differ:
        rows["sides"] = pd.DataFrame()  # sides.csv has them
    sections = [
        section
        | {
            "key": key,
            "title": analysis.label(section["title"]),
            "tables": [
                table
                for name in section["tables"]
                for table in make_tables(name, rows[name], analysis)
            ],
            "pictures": [
                picture for name in section.get("figures", []) for picture in drawn.pop(name, [])
            ],
        }
        for key, section in phrases()["sections"].items()
    ]
    kinds = devices(analysis.trials)
    return template("report.html.jinja").render(
        analysis=analysis,
        title=title_of(analysis),
        date=date_of(analysis),
        style=style,
        policy=f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; "
        "base-uri 'none'; form-action 'none'",
        answer=answer(analysis),
        first=drawn.pop("detection", []),
        sides_differ=sides_differ,
        sections=[section for section in sections if section["tables"] or section["pictures"]],
        methods=methods,
        faults=analysis.plans.faults,
        kinds=kinds if {*kinds} - {NOT_AVAILABLE} else {},
        max_rows=MAX_ROWS,
        max_letters=MAX_LETTERS,
    )


def title_of(analysis: Analysis) -> str:
    """Return the name of the study, or of the first file and how many there are besides."""
    if studies := analysis.plans.studies.values():
        return ", ".join(dict.fromkeys(study.name for study in studies))
    names = [path.name for path in analysis.loaded.paths]
    more = len(names) - 1
    return f"{names[0]} and {more} more" if more else names[0]


def date_of(analysis: Analysis) -> str:
    """Return the first and the last day of sessions, from their headers; else empty text."""
    days = set()
    for table in analysis.loaded.paths:
        try:
            header = Header.model_validate_json(table.with_name(HEADER).read_bytes())
        except (OSError, ValueError):
            continue
        days.add(header.begun[:10])
    return " to ".join(sorted({min(days), max(days)})) if days else ""
