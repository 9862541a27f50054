"""The files of an analysis, all written or none; tables as CSV that no spreadsheet carries out."""

from __future__ import annotations

import contextlib
import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.counts.table import clean_table
from analysis.numbers import TOTAL
from analysis.results.figures import figures
from analysis.results.figures.curves import function_table
from analysis.results.figures.drawing import DEFAULT_STYLE, Style
from analysis.results.methods import methods_of
from analysis.results.report import report_html
from analysis.results.summary import columns_text, devices, summary_text, written_columns
from analysis.thresholds.displacement import with_group_micrometres
from experiment.names import NOT_AVAILABLE
from experiment.record import manifest
from experiment.record.files import (
    UNWAITED,
    ArchiveError,
    LockError,
    locked,
    make_folder,
    write_new,
)
from experiment.record.manifest import Manifest
from experiment.record.rows import format_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analysis.results.analysis import Analysis


# At the beginning, or behind what some spreadsheet takes for the end of a cell; = + - @ also wide.
_FORMULA = re.compile(r"""(^|[,;|\t"])([' ]*[=+\-@＝＋－＠])""")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)


_ROWS = 5_000
"""Rows that are written at a time: a list of cells takes more room than its text."""


def csv_text(table: pd.DataFrame) -> str:
    r"""Write a table as CSV with LF line ends; NaN is ``n/a``, numbers keep their shortest form.

    Texts are written as `harmless` makes them.

    >>> table = pd.DataFrame({"level_vpp": [60.0], "group_low": [float("nan")], "name": ["=1+1"]})
    >>> csv_text(table)
    "level_vpp,group_low,name\n60,n/a,'=1+1\n"
    """
    texts = []
    for first in range(0, max(len(table), 1), _ROWS):
        rows = table.iloc[first : first + _ROWS]
        cells = pd.DataFrame({name: _cells(rows[name]) for name in rows}, dtype=object)
        texts.append(cells.to_csv(index=False, header=first == 0, lineterminator="\n"))
    return "".join(texts)


def _cells(column: pd.Series[Any]) -> list[str]:
    """Write each different value once."""
    codes, distinct = pd.factorize(column, use_na_sentinel=True)
    values = distinct.tolist()
    texts = [harmless(v) if isinstance(v, str) else format_value(v) for v in values]
    texts.append(NOT_AVAILABLE)  # of missing values, whose code is -1
    return [texts[code] for code in codes.tolist()]


def harmless(text: str) -> str:
    """Return a text that a spreadsheet does not take for a formula.

    Parts that a spreadsheet might calculate, because they begin with ``=``, ``+``, ``-`` or ``@``
    or with apostrophes before one of them, get an apostrophe in front. Different texts stay
    different. Texts that are numbers stay as they are.

    >>> [harmless(text) for text in ("S01", "=1+1", "'=1+1", "-3", "-3 dB", "a;@b")]
    ['S01', "'=1+1", "''=1+1", '-3', "'-3 dB", "a;'@b"]
    """
    return text if _NUMBER.fullmatch(text) else _FORMULA.sub(r"\1'\2", text)


SUMMARY, REPORT, METHODS, COLUMNS = "summary.json", "report.html", "methods.txt", "columns.json"
_TABLES = (
    *("levels", "participants", "both", "blank", "hands_off", "thresholds", "differences"),
    *("sides", "sensitivity", "d_prime_differences", "confusion", "information"),
)
_ALWAYS = ("levels", "participants")
# The manifest first: wherever moving stops, the next analysis knows the folder for one of its own.
NAMES = (
    *(manifest.NAME, SUMMARY, COLUMNS, METHODS, REPORT),
    *(f"{name}.csv" for name in (*_TABLES, "functions", "trials_clean")),
    *figures.NAMES,
)
_PREFIX, _LOCK = ".analysis-", "lock"
_KIND = "analysis"
"""How the manifest calls the folder."""
_KEY = ["participant", "condition"]


def save(
    analysis: Analysis,
    out_dir: Path,
    *,
    read: Iterable[Path],
    style: Style | None = DEFAULT_STYLE,
) -> None:
    """Write the files of an analysis into a folder; those of an earlier analysis are replaced.

    They are written into a temporary folder inside the folder, and moved when all are complete.
    Files of an earlier analysis that this one does not write are removed, so that no file describes
    older data. The temporary folder of an analysis that was killed is removed, too.

    Parameters
    ----------
    analysis : Analysis
        The analysis.
    out_dir : Path
        The folder; it is made if it does not exist.
    read : iterable of Path
        The files that were analysed.
    style : Style, optional
        Style of the figures; None writes none.

    Raises
    ------
    ValueError
        If `out_dir` is not a folder, or if it has one of `NAMES` that must not be replaced: a
        folder, a file that was analysed, or any file if the manifest of an analysis is missing.
    OSError
        If the folder cannot be written; no file in it has changed then.
    """
    _check_target(out_dir, read)
    made_here = not out_dir.exists()
    make_folder(out_dir, UNWAITED)
    try:
        _sweep(out_dir)
        with TemporaryDirectory(prefix=_PREFIX, dir=out_dir) as name, locked(Path(name) / _LOCK):
            made = Path(name)
            for file, content in _contents(analysis, style):
                _write(made / file, content, out_dir / file)
            _move(made, out_dir)
    except BaseException:
        if made_here:
            with contextlib.suppress(OSError):
                out_dir.rmdir()
        raise


def _sweep(out_dir: Path) -> None:
    """Remove what analyses left that were killed; one that still writes holds its lock."""
    for left in out_dir.glob(f"{_PREFIX}*"):
        if left.is_symlink() or not left.is_dir():
            continue
        if {path.name for path in left.iterdir()} <= {*NAMES, _LOCK}:
            with (
                contextlib.suppress(ArchiveError, LockError, OSError),
                locked(left / _LOCK, "in use"),
            ):
                shutil.rmtree(left)


def _move(made: Path, out_dir: Path) -> None:
    for file in NAMES:
        if (made / file).exists():
            (made / file).replace(out_dir / file)
        else:
            (out_dir / file).unlink(missing_ok=True)


def _check_target(out_dir: Path, read: Iterable[Path]) -> None:
    if out_dir.exists() and not out_dir.is_dir():
        raise ValueError(f"out_dir must be a folder, got the file {out_dir}")
    there = [path for path in map(out_dir.joinpath, NAMES) if path.exists() or path.is_symlink()]
    for path in there:
        if path.is_dir():
            raise ValueError(f"out_dir must not hold a folder with a result's name, got {path}")
        if path.exists() and any(map(path.samefile, read)):
            raise ValueError(f"out_dir must not hold what is analysed, got {path} there")
    earlier = manifest.read_manifest(out_dir)
    if there and (earlier is None or earlier.what != _KIND):
        message = "out_dir must not hold files that are not of an earlier analysis"
        raise ValueError(f"{message}, got {there[0]}")


def _contents(analysis: Analysis, style: Style | None) -> Iterator[tuple[str, bytes]]:
    """Yield the files one by one, so that only one is held besides the figures."""
    people = tuple(sorted(map(str, analysis.trials["participant"].unique())))
    yield manifest.NAME, Manifest(what=_KIND, participants=people).text().encode()
    yield SUMMARY, summary_text(analysis).encode()
    altered = analysis.trials["file"].isin([*analysis.loaded.altered])
    trials = analysis.trials.assign(altered=altered)
    marks = _marks(trials, analysis)
    clean = clean_table(trials, more={"altered"} & {*marks})
    yield "trials_clean.csv", csv_text(written_columns(clean, analysis)).encode()
    drawn = () if style is None else tuple(figures.pictures(analysis, style))
    tables = {name: getattr(analysis, name) for name in _TABLES}
    tables["thresholds"] = _with_groups(analysis)
    tables["functions"] = function_table(analysis) if drawn else pd.DataFrame()
    for name, table in tables.items():
        if len(table) or name in _ALWAYS:
            text = csv_text(written_columns(_marked(table, marks), analysis))
            yield f"{name}.csv", text.encode()
    for picture in drawn:
        for ending, content in picture.files.items():
            yield f"{picture.name}.{ending}", content
    caption = next((picture.caption for picture in drawn if picture.figure == "detection"), "")
    methods = methods_of(analysis)
    yield COLUMNS, columns_text(analysis).encode()
    yield METHODS, methods.text(caption).encode()
    yield REPORT, report_html(analysis, drawn, methods).encode()


def _marks(trials: pd.DataFrame, analysis: Analysis) -> pd.DataFrame:
    """Return the columns that distinguish rows if there are several kinds of trials.

    The rows are the participants in each condition, and `TOTAL` for all of them.
    """
    counts, loaded = analysis.counts, analysis.loaded
    shown = {
        "simulated": 0 < counts.simulated < counts.trials,
        "device_kind": counts.without_device > 0 or len(devices(trials)) > 1,
        "altered": bool(loaded.altered or loaded.lost),
    }
    table = trials[[*_KEY, *(name for name in shown if shown[name])]]
    table = table.astype(object).drop_duplicates()
    return pd.concat([table, table.assign(participant=TOTAL)])


def _marked(table: pd.DataFrame, marks: pd.DataFrame) -> pd.DataFrame:
    """Say in last columns which trials a row is of: true, false or the kind of device, or mixed."""
    key = [name for name in _KEY if name in table]
    names = [name for name in marks if name not in _KEY]
    if not names:
        return table
    return table.join(marks.groupby(key)[names].agg(_same), on=key)


def _same(values: pd.Series[Any]) -> object:
    different = values.unique()
    return different[0] if len(different) == 1 else "mixed"


def _with_groups(analysis: Analysis) -> pd.DataFrame:
    """Put below the participants of each condition a row of their group."""
    thresholds, groups = analysis.thresholds, analysis.groups
    number = thresholds.groupby("condition")["trials"].sum()
    rows = with_group_micrometres(groups, thresholds)
    rows = rows.assign(participant=TOTAL, trials=groups["condition"].map(number))
    columns = [*thresholds]
    table = pd.concat([thresholds.astype(object), rows.reindex(columns=columns).astype(object)])
    return table.sort_values("condition", kind="stable", ignore_index=True)


def _write(path: Path, content: bytes, target: Path) -> None:
    try:
        write_new(path, content, UNWAITED)
    except OSError as error:  # of a full disk, which does not say where
        raise OSError(error.errno, error.strerror, str(target)) from error
