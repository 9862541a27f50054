"""The columns of every CSV: trials, measurements, and the tables of an analysis."""

from __future__ import annotations

import csv
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Final, get_type_hints

from analysis.definitions import DEFINITIONS, OF_ONE_PLACE, definitions_in
from experiment.terms.record import COLUMNS, MeasuredRow
from reference.markdown import literal, table

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from reference.sample import Sample


OWN_UNIT: Final = "the levels' unit"


def defined() -> dict[str, str]:
    """Return what the columns of an analysis mean, by their names.

    Those of a unit that is not volts lack the end of the name, those of one place are others.

    >>> defined()["threshold_db"], defined()["threshold_guess_0"]
    ('the threshold in dB re 1 V peak-to-peak', 'the threshold if the guess rate were 0')
    """
    ours = _by_name({**definitions_in(OWN_UNIT), **DEFINITIONS})
    of_one_place = _by_name(OF_ONE_PLACE)
    both = {
        name: f"{ours[name]}; of one place: {of_one_place[name]}"
        for name in {*ours} & {*of_one_place}
    }
    return of_one_place | ours | both


def _by_name(definitions: Mapping[str, str]) -> dict[str, str]:
    return {name: text for names, text in definitions.items() for name in names.split(", ")}


def meanings() -> dict[str, str]:
    """Return what a column means, by its name: the session's first, then the analysis's own."""
    ours = {column.name: column.description for column in COLUMNS}
    in_own_unit = {name.removesuffix("_vpp"): _in_own_unit(text) for name, text in ours.items()}
    return in_own_unit | ours | defined()


def _in_own_unit(text: str) -> str:
    return text.replace("peak-to-peak volts at the actuator", f"in {OWN_UNIT}").replace(
        "peak-to-peak volts", f"in {OWN_UNIT}"
    )


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
    told += [
        "## Tables of an analysis\n",
        (
            "Levels and thresholds in another unit than volts have no `_vpp` in their names, and "
            "`unit` says which; of a table made elsewhere with one place the answers are `felt` "
            "and `not_felt`. Of a column that only such tables have, the example is from one.\n"
        ),
    ]
    folders = [sample.analysis, *sorted(sample.elsewhere.iterdir())]
    for name in sorted({path.name for folder in folders for path in folder.glob("*.csv")}):
        told += [f"### {name}\n", _of_analyses([one / name for one in folders])]
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


def _of_analyses(paths: Iterable[Path]) -> str:
    """Write the columns of a table in any of several analyses, each with its first example."""
    examples: dict[str, str] = {}
    for path in filter(Path.exists, paths):
        with path.open(encoding="utf-8", newline="") as file:
            first, *rows = csv.reader(file)
        values = rows[0] if rows else [""] * len(first)
        examples |= {
            name: value for name, value in zip(first, values, strict=True) if name not in examples
        }
    known = meanings()
    return table(
        ("column", "meaning", "example"),
        [
            (literal(name), known.get(name) or known[name[: -len("_a")]], value)
            for name, value in examples.items()
        ],
    )
