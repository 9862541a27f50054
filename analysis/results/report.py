"""The report of an analysis: one HTML page that needs nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from analysis.results.answer import answer
from analysis.results.findings import side_estimates
from analysis.results.methods import methods_of
from analysis.results.protocol import planned, protocol_tables, source_tables
from analysis.results.rendering import phrases, read_text, template
from analysis.results.summary import devices
from analysis.results.tables import (
    answer_tables,
    blank_tables,
    count_tables,
    group_tables,
    level_tables,
    people_tables,
    sensitivity_tables,
    side_tables,
    time_tables,
)
from experiment.archive.files import HEADER
from experiment.rows import NOT_AVAILABLE

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from analysis.results.analysis import Analysis
    from analysis.results.figures.figures import Picture
    from analysis.results.methods import Methods
    from analysis.results.tables import Table


MAX_ROWS: Final = 16
"""A longer table is folded."""
MAX_LETTERS: Final = 30
"""Letters of a cell that is not wrapped."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A part of the page: its key in phrases.toml, its tables and its figures."""

    key: str
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    folded: bool = False

    @property
    def title(self) -> str:
        """The heading."""
        return phrases()["sections"][self.key]


def report_html(
    analysis: Analysis, pictures: Iterable[Picture], methods: Methods | None = None
) -> str:
    """Write the report: a page without script or request, the same for the same data."""
    style = read_text("report.css")
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode("ascii")
    plans = planned(analysis)
    drawn: dict[str, list[Picture]] = {}
    for picture in pictures:
        drawn.setdefault(picture.figure, []).append(picture)
    first = drawn.pop("detection", [])

    def take(*names: str) -> list[Picture]:
        return [picture for name in names for picture in drawn.pop(name, [])]

    differ = bool(side_estimates(analysis))
    by_side = [*side_tables(analysis)] if differ else []
    sections = [
        Section(key="thresholds", tables=[*group_tables(analysis)], pictures=take("thresholds")),
        Section(key="people", tables=[*people_tables(analysis)], pictures=take("participants")),
        Section(key="levels", tables=[*level_tables(analysis), *by_side]),
        Section(key="answers", tables=[*answer_tables(analysis)], pictures=take("confusion")),
        Section(
            key="sensitivity",
            tables=[*blank_tables(analysis), *sensitivity_tables(analysis)],
            pictures=take("d_prime"),
        ),
        Section(
            key="times",
            tables=[*time_tables(analysis)],
            pictures=take("reaction_times"),
            folded=True,
        ),
        Section(key="counts", tables=[*count_tables(analysis)], folded=True),
        Section(key="protocol", tables=[*protocol_tables(analysis, plans)], folded=True),
        Section(key="sources", tables=[*source_tables(analysis, plans)], folded=True),
    ]
    kinds = devices(analysis.trials)
    return template("report.html.jinja").render(
        analysis=analysis,
        title=title_of(analysis, [study.name for study in plans.studies]),
        date=date_of(analysis),
        style=style,
        policy=f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; "
        "base-uri 'none'; form-action 'none'",
        answer=answer(analysis),
        first=first,
        sides_differ=differ,
        sections=[one for one in sections if one.tables or one.pictures],
        more_pictures=[picture for each in drawn.values() for picture in each],
        methods=methods or methods_of(analysis, plans),
        faults=plans.faults,
        kinds=kinds if {*kinds} - {NOT_AVAILABLE} else {},
        max_rows=MAX_ROWS,
        max_letters=MAX_LETTERS,
    )


def title_of(analysis: Analysis, studies: Sequence[str]) -> str:
    """Return the name of the study, or of the first file and how many there are besides."""
    if studies:
        return ", ".join(dict.fromkeys(studies))
    names = [path.name for path in analysis.loaded.paths]
    more = len(names) - 1
    return f"{names[0]} and {more} more" if more else names[0]


def date_of(analysis: Analysis) -> str:
    """Return the first and the last day of sessions, from their headers; else empty text."""
    days = set()
    for table in analysis.loaded.paths:
        try:
            header = json.loads(table.with_name(HEADER).read_bytes())
            days.add(str(header["begun"])[:10])
        except (OSError, ValueError, KeyError, TypeError):
            continue
    return " to ".join(sorted({min(days), max(days)})) if days else ""
