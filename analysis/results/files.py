"""The files of an analysis, all written or none; tables as CSV that no spreadsheet carries out."""

from __future__ import annotations

import contextlib
import csv
import io
import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pandas as pd
from filelock import Timeout

from analysis.counts.table import clean_table
from analysis.numbers import TOTAL
from analysis.results.figures import figures
from analysis.results.figures.curves import function_table
from analysis.results.figures.drawing import DEFAULT_STYLE, Style
from analysis.results.methods import methods_of
from analysis.results.report import report_html
from analysis.results.summary import columns_text, devices, in_own_words, summary_text
from analysis.thresholds.displacement import with_group_micrometres
from experiment.archive import manifest
from experiment.archive.disk import UNWAITED, LockError, lock_on, make_folder, write_new
from experiment.archive.manifest import Manifest
from experiment.rows import NOT_AVAILABLE, format_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analysis.results.analysis import Analysis


# At the beginning, or behind what some spreadsheet takes for the end of a cell; = + - @ also wide.
_FORMULA = re.compile(r"""(^|[,;|\t"])([' ]*[=+\-@＝＋－＠])""")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)


_ROWS = 5_000


def csv_text(table: pd.DataFrame) -> str:
    r"""Write a table as CSV with LF line ends; NaN is ``n/a``, numbers keep their shortest form.

    Texts are written as `harmless` makes them.

    >>> table = pd.DataFrame({"level_vpp": [60.0], "group_low": [float("nan")], "name": ["=1+1"]})
    >>> csv_text(table)
    "level_vpp,group_low,name\n60,n/a,'=1+1\n"
    """
    parts = [",".join(map(_quoted, table.columns)) + "\n"]
    for first in range(0, len(table), _ROWS):  # a list of cells takes more room than its text
        rows = table.iloc[first : first + _ROWS]
        cells = (_cells(rows[name]) for name in table.columns)
        parts.append("\n".join([*map(",".join, zip(*cells, strict=True)), ""]))
    return "".join(parts)


def _cells(column: pd.Series[Any]) -> Iterable[str]:
    """Write each different value once."""
    codes, distinct = pd.factorize(column, use_na_sentinel=True)
    # The last stands for missing values, whose code is -1.
    texts = [*map(_cell, distinct.tolist()), NOT_AVAILABLE]
    return [texts[code] for code in codes.tolist()]


def _cell(value: object) -> str:
    return _quoted(harmless(value)) if isinstance(value, str) else format_value(value)


def _quoted(text: str) -> str:
    """Quote a text where a CSV must; numbers and flags never need it."""
    written = io.StringIO()
    csv.writer(written, lineterminator="\n").writerow([text, ""])
    return written.getvalue().removesuffix(",\n")


def harmless(text: str) -> str:
    """Return a text that a spreadsheet does not take for a formula.

    Parts that a spreadsheet might calculate, because they begin with ``=``, ``+``, ``-`` or ``@``
    or with apostrophes before one of them, get an apostrophe in front. Different texts stay
    different. Texts that are numbers stay as they are.

    >>> [harmless(text) for text in ("S01", "=1+1", "'=1+1", "-3", "-3 dB", "a;@b")]
    ['S01', "'=1+1", "''=1+1", '-3', "'-3 dB", "a;'@b"]
    """
    return text if _NUMBER.fullmatch(text) else _FORMULA.sub(r"\1'\2", text)


SUMMARY = "summary.json"
# The summary first: wherever moving stops, the next analysis knows the folder for one of its own.
REPORT, METHODS, COLUMNS = "report.html", "methods.txt", "columns.json"
NAMES = (
    SUMMARY,
    manifest.NAME,
    *("levels.csv", "participants.csv", "both.csv", "blank.csv", "hands_off.csv"),
    *("thresholds.csv", "differences.csv", "sensitivity.csv", "sides.csv"),
    *("functions.csv", "d_prime_differences.csv", "confusion.csv", "trials_clean.csv"),
    *figures.NAMES,
    COLUMNS,
    METHODS,
    REPORT,
)
_PREFIX, _LOCK = ".analysis-", "lock"
_SUMMARY_BEGINS = re.compile(rb'\{\n "schema": \d+,\n "(ci|definitions)": ')


def save(
    analysis: Analysis,
    out_dir: Path,
    *,
    read: Iterable[Path],
    style: Style | None = DEFAULT_STYLE,
) -> None:
    """Write the files of an analysis into a folder; those of an earlier analysis are replaced.

    They are written into a temporary folder in it and moved when all of them are complete. A file
    of an earlier analysis that this one does not have is removed, so that none tells of older data;
    so is the temporary folder of an analysis that was killed.

    Parameters
    ----------
    analysis : Analysis
        What came out.
    out_dir : Path
        The folder; made where it does not exist.
    read : iterable of Path
        The files that were analysed.
    style : Style, optional
        How figures look; None writes none.

    Raises
    ------
    ValueError
        Where `out_dir` is not a folder, or has under one of `NAMES` a folder, a file that was
        analysed, or any file without a summary.json of an earlier analysis beside it.
    OSError
        Where the folder cannot be written; no file in it has changed then.
    """
    _check_target(out_dir, read)
    made_here = not out_dir.exists()
    make_folder(out_dir, UNWAITED)
    try:
        _sweep(out_dir)
        with TemporaryDirectory(prefix=_PREFIX, dir=out_dir) as name, lock_on(Path(name) / _LOCK):
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
            with contextlib.suppress(Timeout, LockError, OSError), lock_on(left / _LOCK, 0):
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
    named = [out_dir / name for name in NAMES]
    there = [target for target in named if target.exists() or target.is_symlink()]
    held = {_file_identity(target) for target in there if target.exists()}
    for path in read:
        if _file_identity(path) in held:
            raise ValueError(f"out_dir must not hold what is analysed, got {path} there")
    for target in there:
        if target.is_dir():
            raise ValueError(f"out_dir must not hold a folder with a result's name, got {target}")
    if there and not _is_summary(out_dir / SUMMARY):
        message = "out_dir must not hold files that are not of an earlier analysis"
        raise ValueError(f"{message}, got {there[0]}")


def _file_identity(path: Path) -> tuple[int, int]:
    """Return what two paths have in common that lead to the same file."""
    status = path.stat()
    return status.st_dev, status.st_ino


def _is_summary(path: Path) -> bool:
    """Tell whether a file begins as `summary_text` does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return _SUMMARY_BEGINS.match(stream.read(100)) is not None


def _contents(analysis: Analysis, style: Style | None) -> Iterator[tuple[str, bytes]]:
    """Yield the files one by one, so that only one is held besides the figures."""
    yield SUMMARY, summary_text(analysis).encode()
    people = tuple(sorted(map(str, analysis.trials["participant"].unique())))
    yield manifest.NAME, Manifest(what="analysis", participants=people).text().encode()
    trials, marks = _marks(analysis)
    yield "trials_clean.csv", _csv(clean_table(trials, more=_ALTERED & {*marks}), analysis)
    tables = {"levels.csv": analysis.levels, "participants.csv": analysis.participants}
    possible = {
        "both.csv": analysis.both,
        "blank.csv": analysis.blank,
        "hands_off.csv": analysis.hands_off,
        "thresholds.csv": _with_groups(analysis),
        "differences.csv": analysis.differences,
        "sides.csv": analysis.sides,
        "sensitivity.csv": analysis.sensitivity,
        "d_prime_differences.csv": analysis.d_prime_differences,
        "confusion.csv": analysis.confusion,
    }
    tables |= {name: table for name, table in possible.items() if len(table)}
    for name, table in tables.items():
        yield name, _csv(_marked(table, trials, marks), analysis)
    drawn = () if style is None else tuple(figures.pictures(analysis, style))
    if drawn and len(table := function_table(analysis)):
        yield "functions.csv", _csv(_marked(table, trials, marks), analysis)
    for picture in drawn:
        yield f"{picture.name}.png", picture.png
        yield f"{picture.name}.svg", picture.svg
        if picture.pdf:
            yield f"{picture.name}.pdf", picture.pdf
    caption = next((picture.caption for picture in drawn if picture.figure == "detection"), "")
    methods = methods_of(analysis, caption=caption)
    yield COLUMNS, columns_text(analysis).encode()
    yield METHODS, methods.text.encode()
    yield REPORT, report_html(analysis, drawn, methods).encode()


def _csv(table: pd.DataFrame, analysis: Analysis) -> bytes:
    return csv_text(in_own_words(table, analysis)).encode()


_ALTERED = {"altered"}


def _marks(analysis: Analysis) -> tuple[pd.DataFrame, list[str]]:
    """Return the trials, and those of their columns by which the rows of tables are told apart."""
    trials, counts = analysis.trials, analysis.counts
    marks = {
        "simulated": 0 < counts.simulated < counts.trials,
        "device_kind": bool(counts.without_device) or len(devices(trials)) > 1,
        "altered": bool(analysis.loaded.altered or analysis.loaded.lost),
    }
    altered = trials["file"].isin([*analysis.loaded.altered])
    return trials.assign(altered=altered), [name for name, is_marked in marks.items() if is_marked]


def _marked(table: pd.DataFrame, trials: pd.DataFrame, marks: Iterable[str]) -> pd.DataFrame:
    """Say in last columns which trials a row is of: true, false or the kind of device, or mixed."""
    return table.assign(**{name: _sorts(table, trials, name) for name in marks})


def _sorts(table: pd.DataFrame, trials: pd.DataFrame, mark: str) -> list[str]:
    """Return the value of a mark in the trials of each row, or mixed."""
    texts = trials.assign(text=trials[mark].astype(object).map(_text))
    keys = ("condition",), ("participant",), ("participant", "condition")
    of_rows: dict[tuple[str, ...], dict[Any, str]] = {
        key: texts.groupby(list(key))["text"].agg(_same).to_dict() for key in keys
    }
    sorts = []
    for row in table.to_dict("records"):
        names = ("participant", "condition")
        key = tuple(name for name in names if name in row and row[name] != TOTAL)
        values = tuple(row[name] for name in key)
        value = values if len(values) > 1 else values[0] if key else None
        sorts.append(of_rows[key][value] if key else _same(texts["text"]))
    return sorts


def _text(value: object) -> str:
    missing = value is None or value != value  # noqa: PLR0124 (NaN, as categoricals have it)
    return NOT_AVAILABLE if missing else format_value(value)


def _same(texts: pd.Series[Any]) -> str:
    different = texts.unique()
    return str(different[0]) if len(different) == 1 else "mixed"


def _with_groups(analysis: Analysis) -> pd.DataFrame:
    """Put below the participants of each condition a row of their group."""
    thresholds, groups = analysis.thresholds, analysis.groups
    rows = with_group_micrometres(groups, thresholds).assign(
        participant=TOTAL,
        trials=[
            thresholds.loc[thresholds["condition"].eq(name), "trials"].sum()
            for name in groups["condition"]
        ],
    )
    if analysis.axis.is_logarithmic:
        for name in ("threshold", "threshold_low", "threshold_high"):
            rows[f"{name}_db"] = 20 * analysis.axis.on_axis(rows[f"{name}_vpp"].to_numpy(float))
    columns = list(thresholds.columns)
    records = [*thresholds.to_dict("records"), *rows.to_dict("records")]
    table = pd.DataFrame(records, columns=columns)
    return table.sort_values("condition", kind="stable").reset_index(drop=True)


def _write(path: Path, content: bytes, target: Path) -> None:
    try:
        write_new(path, content, UNWAITED)
    except OSError as error:  # of a full disk, which does not say where
        raise OSError(error.errno, error.strerror, str(target)) from error
