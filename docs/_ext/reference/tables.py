"""The columns of every CSV: trials, measurements, and the tables of an analysis."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from analysis.axis import VOLTS, Axis
from analysis.results.summary import column_meanings
from experiment.record.entries import MEASURED_COLUMNS, StimulusMeasured
from experiment.record.rows import COLUMNS
from reference.markdown import literal, table

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from experiment.record.rows import Column
    from reference.sample import Sample


OWN_UNIT: Final = "the levels' unit"
_PLACEHOLDER: Final = "@unit@"  # a unit has at most 16 letters
TRIALS: Final = "trials_clean.csv"
MARKS: Final = {
    "simulated": "whether the participant is a simulation",
    "device_kind": "what drove the actuators",
    "altered": "whether the session is not as it was recorded",
}
"""Columns that tell the sessions of an analysis apart, where they are of several sorts."""
_VOLTS: Final = re.compile(r"(peak-to-peak )?volts( at the actuator)?")
_DRIVEN: Final = re.compile(r"(\w+)_driven(?:_at_(\w+))?_(re|im|abs)_um")
_PARTS: Final = {"re": "real part", "im": "imaginary part", "abs": "magnitude"}
_PLACES: Final = {
    "frequency_hz": "frequency, Hz",
    "x_mm": "place along the strip, from its middle, mm",
    "y_mm": "place across the strip, from one edge, mm",
    "level_vpp": "level that the displacements are for; `n/a` for a unit load",
    "load_unit": "unit of the actuators' loads",
    "loss_factor": "loss factor of the plate",
    "loss_basis": "whether that is `set` in the study or `assumed`",
}


def defined() -> dict[str, str]:
    """Return what the columns of an analysis mean, by their names.

    Those of a unit that is not volts lack the end of the name, those of one place are others.

    >>> defined()["threshold_db"]
    'the threshold in dB re 1 V peak-to-peak'
    """
    ours = column_meanings(Axis(unit=_PLACEHOLDER)) | column_meanings(VOLTS)
    ours = {name: text.replace(_PLACEHOLDER, OWN_UNIT) for name, text in ours.items()}
    of_one_place = {
        name: text
        for name, text in column_meanings(VOLTS, one_place=True).items()
        if text != ours.get(name)
    }
    both = {
        name: f"{ours[name]}; of one place: {of_one_place[name]}"
        for name in {*ours} & {*of_one_place}
    }
    return of_one_place | ours | both


def meanings(name: str) -> dict[str, str]:
    """Return what the columns of a table of an analysis mean, by their names.

    In a table of trials a column is the session's before it is the analysis's, elsewhere not:

    >>> meanings("trials_clean.csv")["status"].partition(":")[0]
    'ok, or why the trial does not count'
    >>> meanings("thresholds.csv")["status"].partition(";")[0]
    'ok, or why there is no threshold or how it is limited'
    """
    ours = {column.name: _described(column) for column in COLUMNS}
    in_own_unit = {
        name.removesuffix("_vpp"): _VOLTS.sub(f"in {OWN_UNIT}", text)
        for name, text in ours.items()
        if name.endswith("_vpp")
    }
    of_trials = in_own_unit | ours
    return defined() | MARKS | of_trials if name == TRIALS else of_trials | defined()


def _described(column: Column) -> str:
    words = f": {', '.join(column.choices)}" if column.choices else ""
    return f"{column.description}{words}"


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
            "and `not_felt`. Of a column that only such tables have, the example is from one. "
            "`columns.json`, beside the tables, holds the meaning of each column as one JSON "
            "object: names and texts.\n"
        ),
        *_marks(sample),
    ]
    folders = [sample.analysis, *sorted(sample.elsewhere.iterdir())]
    for name in sorted({path.name for folder in folders for path in folder.glob("*.csv")}):
        told += [f"### {name}\n", _of_analyses(name, folders)]
    return "\n".join([*told, *_fields(sample)])


def _marks(sample: Sample) -> Iterator[str]:
    """Tell of the columns that only an analysis of several sorts of sessions has, with words."""
    found: dict[str, set[str]] = {name: set() for name in MARKS}
    for path in sample.marked.glob("*.csv"):
        if path.name == TRIALS:
            continue
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.DictReader(file):
                for name, words in found.items():
                    words.add(row[name])
    yield (
        "Where an analysis has trials of several sorts, the last columns of every table say which "
        "a row is of, or `mixed` where it is of several: `simulated` where there are simulated "
        "people and others, `device_kind` where a person had a device that moves nothing or "
        "devices differ, `altered` where `--accept-altered` took sessions. "
        f"{literal(TRIALS)} tells the first two of every trial, and the third where other tables "
        "do.\n"
    )
    yield table(
        ("column", "meaning", "for example"),
        [(literal(name), MARKS[name], " ".join(sorted(words))) for name, words in found.items()],
    )


def _fields(sample: Sample) -> Iterator[str]:
    """Tell of what `tactstrip field --out` writes."""
    rows = {"map": "A row for each place", "band": "With `--band`, a row for each frequency"}
    yield (
        "## Tables of a field\n\n`tactstrip field STUDY --out FILE.csv` writes displacements as "
        "amplitudes with the time factor exp(-i omega t), at the study's highest level. Where that "
        "of any actuator per volt is not known they are per unit load, in `load_unit`, and "
        "`_um` at the end of a name is `_um_per_unit_load`.\n"
    )
    for what, paths in sample.fields.items():
        heads = [_first_rows(path) for path in paths]
        if [name.removesuffix("_per_unit_load") for name in heads[1]] != [*heads[0]]:
            raise ValueError(f"{what}: the columns per unit load must be the same, got {heads}")
        yield f"### {'Over a band' if what == 'band' else 'A map'}\n\n{rows[what]}.\n"
        yield table(
            ("column", "meaning", "example"),
            [(literal(name), of_field(name), value) for name, value in heads[0].items()],
        )


def _first_rows(path: Path) -> dict[str, str]:
    with path.open(encoding="utf-8", newline="") as file:
        return next(csv.DictReader(file))


def of_field(name: str) -> str:
    """Return what a column of a field means.

    >>> of_field("left_driven_at_right_abs_um")
    'magnitude at the right finger, the left actuator driven, um'
    """
    if name in _PLACES:
        return _PLACES[name]
    found = _DRIVEN.fullmatch(name)
    if found is None:
        raise ValueError(f"name must be that of a column of a field, got {name!r}")
    driven, at, part = found.groups()
    where = f"at the {at} finger" if at else "at this place"
    return f"{_PARTS[part]} {where}, the {driven} actuator driven, um"


def _measured() -> str:
    ours = {column.name: column.description for column in COLUMNS}
    rows = []
    for name, path in MEASURED_COLUMNS.items():
        if path == name:
            rows.append((literal(name), ours[name]))
        else:
            field = StimulusMeasured.model_fields[path.removeprefix("measured.")]
            meaning = field.description or ""
            rows.append((literal(name), meaning[:1].lower() + meaning[1:].rstrip(".")))
    return table(("column", "meaning"), rows)


def _of_analyses(name: str, folders: Iterable[Path]) -> str:
    """Write the columns of a table in any of several analyses, each with its first example."""
    examples: dict[str, str] = {}
    for path in filter(Path.exists, [folder / name for folder in folders]):
        with path.open(encoding="utf-8", newline="") as file:
            first, *rows = csv.reader(file)
        values = rows[0] if rows else [""] * len(first)
        examples |= {
            column: value
            for column, value in zip(first, values, strict=True)
            if column not in examples
        }
    known = meanings(name)
    return table(
        ("column", "meaning", "example"),
        [
            (literal(column), known.get(column) or known[column[: -len("_a")]], value)
            for column, value in examples.items()
        ],
    )
