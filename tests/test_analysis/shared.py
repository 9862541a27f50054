"""Tables as the tests of the analysis write, read and refuse them; the command as it is typed."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest
from click.testing import CliRunner, Result

from analysis import ColumnMap, ResultFileError, load_column_map, read_inputs
from analysis.reading.draft import propose_map
from analysis.reading.sources import find_sources
from experiment.record.rows import TrialRow, trials_csv
from experiment.tasks import LEFT_RIGHT_BOTH
from tactstrip import main

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from analysis import LoadedTrials

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
CASES = Path(__file__).parent / "cases.json"
LEAST = "participant,side,level_vpp,response\n"
"""The header of a table that a map without a word can read."""
PAPER = [60.0, 95.0, 130.0, 165.0, 200.0]
# Hecht, Shlaer & Pirenne (1942), quanta at the cornea, in the R package MPDiR, on the axis
# ln(quanta); Miranda & Henson (2008), in the R package modelfree; Dallmann et al. (2015), speed in
# cm/s, all participants together, with 0 and 32 Hz, in the R package MixedPsy.
QUANTA = {
    "SH/R1": [46.9, 73.1, 113.8, 177.4, 276.1, 421.7],
    "SS/R1": [24.1, 37.6, 58.6, 91.0, 141.9, 221.3],
    "SS/R2": [23.5, 37.1, 58.5, 92.9, 148.6, 239.3],
    "MHP/R1": [37.6, 58.6, 91.0, 141.9, 221.3, 342.8],
}
FLASH = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.9, 1.1, 1.3]
SPEED = [1.0, 3.5, 6.0, 8.5, 11.0, 13.5, 16.0]
ROW = TrialRow(
    schema=3,
    participant="007",
    session="01",
    condition="main",
    block=1,
    trial=1,
    attempt=1,
    kind="single",
    side="left",
    level_vpp=60.0,
    response="left",
    rt_s=0.5,
    correct=True,
    status="ok",
    earlier_onsets_s=(),
    onset_s=12.25,
    foreperiod_s=1.5,
    site_levels_vpp=(60.0, 0.0),
    site_peaks_um=(None, None),
    displacement_basis=None,
    premature=False,
    noise_ok=True,
    simulated=False,
    device_kind="real",
    burst_verified=None,
    onset_clock=1,
    study_sha256="ab" * 32,
)
SINGLE: dict[str, Any] = {
    "participant": "1",
    "condition": "main",
    "kind": "single",
    "side": "left",
    "level_vpp": 60.0,
    "response": "left",
    "reason": "",
    "none_offered": True,
}
"""A trial as tables are counted from."""


def row(trial: int = 1, **changes: Any) -> TrialRow:
    """Return a row of trials.csv, whose verdict fits unless it is given."""
    made = replace(ROW, trial=trial, **changes)
    verdict = LEFT_RIGHT_BOTH.is_correct(made.side, made.level_vpp, made.response)
    return made if "correct" in changes else replace(made, correct=verdict)


def cases(name: str) -> list[list[Any]]:
    """Return the rows of a table of cases.json: arguments of a test."""
    tables: dict[str, list[list[Any]]] = json.loads(CASES.read_text(encoding="utf-8"))
    return tables[name]


def put(path: Path, text: str) -> Path:
    """Write a file, and the folders that it lies in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def table_of(*rows: TrialRow) -> str:
    """Return the text of a trials.csv."""
    return trials_csv(LEFT_RIGHT_BOTH, rows)


def write(path: Path, *rows: TrialRow) -> Path:
    """Write a trials.csv."""
    return put(path, table_of(*rows))


def loaded(folder: Path, text: str, columns: ColumnMap | None = None) -> LoadedTrials:
    """Read a table made elsewhere."""
    return read_inputs([put(folder / "t.csv", text)], columns or ColumnMap())


def refused(*paths: Path, columns: ColumnMap | None = None) -> ResultFileError:
    """Return what tables are refused with, in one line."""
    with pytest.raises(ResultFileError) as caught:
        read_inputs(paths, columns)
    assert "\n" not in str(caught.value)
    return caught.value


@dataclass(frozen=True)
class Draft:
    """The column map that is proposed for tables, the keys that it leaves empty, and notes."""

    text: str
    fill_in: list[str]
    notes: list[str]

    @property
    def map(self) -> dict[str, Any]:
        """The parsed map."""
        return tomllib.loads(self.text)

    def filled(self, path: Path, words: Mapping[str, str]) -> ColumnMap:
        """Fill in what is empty, write the map and load it."""
        lines = self.text.splitlines()
        for n, line in enumerate(lines):
            key, _, rest = line.partition(" = ")
            if "# FILL IN" in line:
                lines[n] = f'{key} = "{words[key]}" {rest[2:]}'
        return load_column_map(put(path, "\n".join(lines) + "\n"))


def draft(*paths: Path) -> Draft:
    """Propose a column map for external tables."""
    return Draft(*propose_map(find_sources([*paths], foreign=True)[0]))


def felt(
    detected: Iterable[int],
    levels: Sequence[float] = PAPER,
    *,
    n: int = 30,
    missed: str = "none",
    **same: Any,
) -> pd.DataFrame:
    """Return the trials of a person who felt so many of n stimuli at each of the first levels."""
    rows = [
        SINGLE | {"level_vpp": level, "response": answer} | same
        for level, k in zip(levels, detected, strict=False)
        for answer in ["left"] * k + [missed] * (n - k)
    ]
    return pd.DataFrame(rows)


def run(*arguments: object) -> Result:
    """Run tactstrip."""
    result = CliRunner().invoke(main, [str(one) for one in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    return result


def files(folder: Path) -> dict[str, bytes]:
    """Return the contents of a folder's files."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}
