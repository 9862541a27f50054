"""The files of an analysis: tables, summary, figures and report, all written or none."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from analysis import figures
from analysis.counting import clean_table
from analysis.detection import TOTAL
from analysis.plain_csv import csv_text
from analysis.report import report_html
from analysis.summary import summary_text

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    import pandas as pd

    from analysis.tables import Analysis

SUMMARY = "summary.json"
# The summary first: wherever moving stops, the next analysis knows the folder for one of its own.
REPORT = "report.html"
NAMES = (
    SUMMARY,
    *("levels.csv", "participants.csv", "both.csv", "blank.csv", "control.csv"),
    *("thresholds.csv", "confusion.csv", "trials_clean.csv"),
    *figures.NAMES,
    REPORT,
)
_SUMMARY_BEGINS = re.compile(rb'\{\n "schema": \d+,\n "definitions": \{')


def save(analysis: Analysis, out_dir: Path, *, with_figures: bool, read: Iterable[Path]) -> None:
    """Write the files of an analysis into a folder; those of an earlier analysis are replaced.

    They are written into a temporary folder in it and moved when all of them are complete. A file
    of an earlier analysis that this one does not have is removed, so that none tells of older data.

    Parameters
    ----------
    analysis : Analysis
        What came out.
    out_dir : Path
        The folder; made where it does not exist.
    with_figures : bool
        Whether to draw.
    read : iterable of Path
        The files that were analysed.

    Raises
    ------
    ValueError
        Where `out_dir` is not a folder, or has under one of `NAMES` a folder, a file that was
        analysed, or any file without a summary.json of an earlier analysis beside it.
    OSError
        Where the folder cannot be written; no file in it has changed then.
    """
    _check_target(out_dir, read)
    out_dir.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".analysis-", dir=out_dir) as name:
        made = Path(name)
        for file, content in _contents(analysis, with_figures=with_figures):
            _write(made / file, content, out_dir / file)
        for file in NAMES:
            if (made / file).exists():
                (made / file).replace(out_dir / file)
            else:
                (out_dir / file).unlink(missing_ok=True)


def _check_target(out_dir: Path, read: Iterable[Path]) -> None:
    if out_dir.exists() and not out_dir.is_dir():
        raise ValueError(f"out_dir must be a folder, got the file {out_dir}")
    named = [out_dir / name for name in NAMES]
    there = [target for target in named if target.exists() or target.is_symlink()]
    for path in read:
        if any(target.exists() and path.samefile(target) for target in there):
            raise ValueError(f"out_dir must not hold what is analysed, got {path} there")
    for target in there:
        if target.is_dir():
            raise ValueError(f"out_dir must not hold a folder with a result's name, got {target}")
    if there and not _is_summary(out_dir / SUMMARY):
        message = "out_dir must not hold files that are not of an earlier analysis"
        raise ValueError(f"{message}, got {there[0]}")


def _is_summary(path: Path) -> bool:
    """Tell whether a file begins as `summary_text` does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return _SUMMARY_BEGINS.match(stream.read(100)) is not None


def _contents(analysis: Analysis, *, with_figures: bool) -> Iterator[tuple[str, bytes]]:
    """Yield the files one by one, so that only one is held besides the figures."""
    yield SUMMARY, summary_text(analysis).encode()
    yield "trials_clean.csv", csv_text(clean_table(analysis.trials)).encode()
    tables = {"levels.csv": analysis.levels, "participants.csv": analysis.participants}
    possible = {
        "both.csv": analysis.both,
        "blank.csv": analysis.blank,
        "control.csv": analysis.control,
        "thresholds.csv": _with_groups(analysis.thresholds, analysis.groups),
        "confusion.csv": analysis.confusion,
    }
    tables |= {name: table for name, table in possible.items() if len(table)}
    for name, table in tables.items():
        yield name, csv_text(table).encode()
    drawn = tuple(figures.pictures(analysis)) if with_figures else ()
    for one in drawn:
        yield f"{one.name}.png", one.png
        yield f"{one.name}.svg", one.svg
    yield REPORT, report_html(analysis, drawn).encode()


def _with_groups(thresholds: pd.DataFrame, groups: pd.DataFrame) -> pd.DataFrame:
    """Put below the participants of each condition a row of their group: its median."""
    import pandas as pd

    rows = groups.assign(
        participant=TOTAL,
        threshold_vpp=groups["median_vpp"],
        trials=[
            thresholds.loc[thresholds["condition"].eq(name), "trials"].sum()
            for name in groups["condition"]
        ],
    )
    columns = list(thresholds.columns)
    records = [*thresholds.to_dict("records"), *rows.to_dict("records")]
    table = pd.DataFrame(records, columns=columns)
    return table.sort_values("condition", kind="stable").reset_index(drop=True)


def _write(path: Path, content: bytes, target: Path) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:  # of a full disk, which does not say where
        raise OSError(error.errno, error.strerror, str(target)) from error
