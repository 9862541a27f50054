"""The files of an analysis: tables, summary and figures, all written or none."""

from __future__ import annotations

import csv
import io
import json
import math
import platform
import re
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING

from analysis import figures
from experiment.record import format_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import pandas as pd

    from analysis.tables import Analysis

SCHEMA = 1
SUMMARY = "summary.json"
# The summary first: wherever moving stops, the next analysis knows the folder for one of its own.
NAMES = (
    SUMMARY,
    "levels.csv",
    "participants.csv",
    "both.csv",
    "blank.csv",
    "control.csv",
    *figures.NAMES,
)
_SUMMARY_BEGINS = re.compile(rb'\{\n "schema": \d+,\n "definitions": \{')

DEFINITIONS: Mapping[str, str] = MappingProxyType(
    {
        "presented": "trials of the kind with status ok, not anticipated, noise_ok not false",
        "detected": "single stimuli answered with their own side and nothing else",
        "p": "detected (noticed, felt) / presented; time-outs and invalid keys stay in presented",
        "low, high": "95 % interval of one participant's p, by the method under ci; in a last row "
        "'all' it ignores that participants differ",
        "p_min, p_mean, p_max": "least, unweighted mean and largest p of the participants",
        "p_pooled": "detected / presented over all participants",
        "group_low, group_high": "95 % interval of the group: Wilson at p_pooled with "
        "presented / deff trials and Student's t with participants - 1 degrees of freedom; none "
        "for one participant",
        "over_report": "single stimuli answered both",
        "mislocalised": "single stimuli answered with the other side",
        "timeouts": "single stimuli (in control.csv: control trials) without an answer in time",
        "p_answered": "detected / (presented without time-outs and invalid keys)",
        "detected_any": "single stimuli answered left, right or both; null where the answer "
        "none was not offered",
        "noticed": "both-finger trials answered both",
        "left_only, right_only": "both-finger trials answered with one side",
        "left, right, both": "blank trials with this answer, each a false alarm",
        "part, side": "of control trials, with the fingers off the plate and in no other table: "
        "audibility, before practice, or control, at the end; which side was driven",
        "none, invalid": "control trials with this answer; left, right and both likewise",
    }
)


def csv_text(table: pd.DataFrame) -> str:
    r"""Write a table as CSV with LF line ends; NaN is ``n/a``, numbers keep their shortest form.

    >>> import pandas as pd
    >>> csv_text(pd.DataFrame({"level_vpp": [60.0], "group_low": [math.nan]}))
    'level_vpp,group_low\n60,n/a\n'
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(map(format_value, row) for row in _rows(table))
    return text.getvalue()


def _rows(table: pd.DataFrame) -> Iterable[list[object]]:
    for row in table.itertuples(index=False, name=None):
        yield [None if isinstance(v, float) and math.isnan(v) else v for v in row]


def summary_text(analysis: Analysis) -> str:
    """Write the summary as JSON: no time, no host, no absolute path, so equal data give equal text.

    Parameters
    ----------
    analysis : Analysis
        What came out.

    Returns
    -------
    str
        A JSON object with the keys ``schema definitions inputs versions seed counts excluded levels
        both blank control warnings``.
    """
    levels = analysis.levels
    if analysis.detected_any is None:
        levels = levels.assign(detected_any=math.nan)
    else:
        levels = levels.assign(detected_any=analysis.detected_any["detected_any"])
    summary = {
        "schema": SCHEMA,
        "definitions": {"ci": analysis.ci, **DEFINITIONS},
        "inputs": [asdict(file) for file in analysis.inputs],
        "versions": _versions(),
        "seed": analysis.seed,
        "counts": asdict(analysis.counts),
        "excluded": _records(analysis.excluded),
        "levels": _records(levels),
        "both": _records(analysis.both),
        "blank": _records(analysis.blank),
        "control": _records(analysis.control),
        "warnings": list(analysis.warnings),
    }
    return json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _versions() -> dict[str, str]:
    names = ("tactstrip", "numpy", "scipy", "pandas", "matplotlib")
    return {"python": platform.python_version()} | {name: version(name) for name in names}


def _records(table: pd.DataFrame) -> list[dict[str, object]]:
    return [dict(zip(table.columns, row, strict=True)) for row in _rows(table)]


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
    contents = _contents(analysis, with_figures=with_figures)
    out_dir.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=".analysis-", dir=out_dir) as name:
        made = Path(name)
        for file, content in contents.items():
            _write(made / file, content, out_dir / file)
        for file in NAMES:
            if file in contents:
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


def _contents(analysis: Analysis, *, with_figures: bool) -> dict[str, bytes]:
    tables = {"levels.csv": analysis.levels, "participants.csv": analysis.participants}
    possible = {
        "both.csv": analysis.both,
        "blank.csv": analysis.blank,
        "control.csv": analysis.control,
    }
    tables |= {name: table for name, table in possible.items() if len(table)}
    contents = {SUMMARY: summary_text(analysis).encode()}
    contents |= {name: csv_text(table).encode() for name, table in tables.items()}
    if with_figures and len(analysis.levels):
        data = figures.DetectionData(
            levels=analysis.levels,
            participants=analysis.participants,
            forced_choice=analysis.detected_any is None,
            ci=analysis.ci,
            note=analysis.simulated,
        )
        contents |= zip(figures.NAMES, figures.render(data), strict=True)
    return contents


def _write(path: Path, content: bytes, target: Path) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:  # of a full disk, which does not say where
        raise OSError(error.errno, error.strerror, str(target)) from error
