"""Rows of text to rows of trials: every column typed, absent ones at their default."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis.axis import axis_of
from analysis.reading.cells import ANY, CellFault, CellReader, first_fault
from analysis.reading.foreign.columns import FORCED, YES_NO
from analysis.reading.text import ELSEWHERE, ResultFileError, shown
from experiment.rows import (
    COLUMNS,
    HANDS_OFF,
    KINDS,
    NOT_AVAILABLE,
    OTHER_VERSION,
    RESPONSES,
    SCHEMA,
    SIDES,
)
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Mapping

    from analysis.reading.foreign.columns import ColumnMap


# A table made elsewhere that lacks one of these has this in every row; other absent columns: n/a.
DEFAULTS: Mapping[str, str] = MappingProxyType(
    {
        "schema": str(SCHEMA),
        "session": "01",
        "condition": "main",
        "block": "1",
        "attempt": "1",
        "status": "ok",
        "premature": "false",
        "simulated": "false",
        "onset_clock": "1",
    }
)
UNNUMBERED = -1
_HINT = f"; {ELSEWHERE}"
_KIND_OF_SIDE: Mapping[str, str] = MappingProxyType({"both": "both", "none": "blank"})
_NAMES = tuple(column.name for column in COLUMNS)
_OTHER = {"left": "right", "right": "left"}


def own_rows(text: pd.DataFrame, file: str) -> pd.DataFrame:
    """Read rows of a trials.csv.

    The columns of `experiment.rows.COLUMNS`, typed, ``file`` and ``line``, which is the
    index of the text.

    Raises ResultFileError for an unknown or missing column, and for the first cell that cannot be
    read.

    >>> own_rows(pd.DataFrame({"colour": ["red"]}, index=[2]), "t.csv")
    Traceback (most recent call last):
    analysis.reading.text.ResultFileError: t.csv:1: unknown column 'colour'; a table made ...
    """
    _check_schema(text, file)
    for name in text.columns:
        if name not in _NAMES:
            raise ResultFileError(file, 1, f"unknown column {shown(name)}{_HINT}")
    missing = [name for name in _NAMES if name not in text.columns]
    if missing:
        raise ResultFileError(file, 1, f"no column {', '.join(missing)}{_HINT}")
    readers = [CellReader(column=column, label=column.name) for column in COLUMNS]
    return typed(text, readers, file)


def exported(text: pd.DataFrame) -> pd.DataFrame:
    """Give the columns of an events.tsv that `tactstrip export --bids` wrote their own names.

    >>> list(exported(pd.DataFrame(columns=["duration", "colour"])))
    ['duration', 'colour']
    """
    from experiment.archive.bids import EVENT_COLUMNS  # with all of a study's sections

    if {*text.columns} != {*EVENT_COLUMNS}:
        return text
    sources = {name: source for name, source in EVENT_COLUMNS.items() if source}
    return text[[*sources]].rename(columns=sources)


def _check_schema(text: pd.DataFrame, file: str) -> None:
    """Refuse a table of another version before its columns are found to be other ones."""
    if "schema" not in text.columns or text.empty or set(text.columns) == {*_NAMES}:
        return
    found = text["schema"].iloc[0]
    if found.isdecimal() and int(found) != SCHEMA:
        message = f"schema must be {SCHEMA}; got {found}: {OTHER_VERSION}"
        raise ResultFileError(file, int(text.index[0]), message)


def mapped_rows(text: pd.DataFrame, file: str, columns: ColumnMap) -> pd.DataFrame:
    """Read rows of a table made elsewhere; what it lacks gets its default.

    As `own_rows`, but ``detected`` may stand in the place of ``response``, and ``trial`` is
    `UNNUMBERED` where the table does not number its trials. Where ``unanswered`` is true, the
    answer is ``timeout``. Without ``kind``, a level of 0 is a blank trial, whatever its side; where
    0 is a level, as in dB, -inf is. What the map says has side ``none`` has no level, whatever is
    written there.

    Raises ResultFileError for a column that the map names and the table lacks, a required column
    without a source, the first cell that cannot be read, and a blank trial in a forced choice.

    >>> from analysis.reading.foreign.columns import ColumnMap
    >>> text = pd.DataFrame({"participant": "007", "side": "left", "level_vpp": "60",
    ...     "response": ["left", "none"]}, index=[2, 3])
    >>> mapped_rows(text, "t.csv", ColumnMap())[["session", "kind", "line"]].to_numpy().tolist()
    [['01', 'single', 2], ['01', 'single', 3]]
    """
    ours = columns.ours(text, file)
    rows = typed(ours, [columns.reader(str(name)) for name in ours.columns], file)
    silent, rows = silent_rows(rows, columns)
    if "kind" not in rows:
        rows = _without_stimulus(rows, silent, columns)
        kinds = [_KIND_OF_SIDE.get(side, "single") for side in rows["side"]]
        rows["kind"] = pd.Categorical(kinds, categories=list(KINDS))
    absent = [name for name in _NAMES if name not in rows and name != "response"]
    for name in absent:
        rows[name] = UNNUMBERED if name == "trial" else _default(name, columns, rows.index)
    if "level_vpp" in columns.constant or _says_none(columns):
        rows["level_vpp"] = rows["level_vpp"].mask(rows["side"].eq("none"))
    answer = "response" if "response" in rows else "detected"
    if "unanswered" in rows:
        rows.loc[rows.pop("unanswered"), answer] = "timeout"
    rows["rt_s"] = rows["rt_s"].mask(rows[answer].eq("timeout"))
    return rows


def _says_none(columns: ColumnMap) -> bool:
    """Tell whether a map says which rows have no stimulus."""
    words = columns.values  # noqa: PD011 - those of a map, no array
    return any(ours == "none" for _, ours in words.get("side", {}).items())


def silent_rows(rows: pd.DataFrame, columns: ColumnMap) -> tuple[pd.Series[bool], pd.DataFrame]:
    """Tell which rows have the level of no stimulus: 0, or -inf where 0 is a level.

    Returns that, and the rows with n/a in place of -inf.

    >>> from analysis.reading.foreign.columns import ColumnMap
    >>> rows = pd.DataFrame({"level_vpp": [0.0, ANY]})
    >>> [*silent_rows(rows, ColumnMap(axis={"x_scale": "dB", "unit": "dB"}))[0]]
    [False, True]
    """
    level = rows["level_vpp"]
    silent = level.eq(ANY if axis_of(columns.axis).signed else 0)
    return silent, rows.assign(level_vpp=level.mask(level.eq(ANY)))


def _without_stimulus(
    rows: pd.DataFrame, silent: pd.Series[bool], columns: ColumnMap
) -> pd.DataFrame:
    """Make blank trials of those of no level, as others code them beside a side."""
    silent = silent & rows["side"].ne("none")
    if not silent.any():
        return rows
    if columns.task == FORCED:
        signed = axis_of(columns.axis).signed
        other = "" if signed else ', [axis] x_scale = "dB" or "linear" takes 0 for a level'
        message = (
            f"the level is {ANY if signed else 0}, and a forced choice has no trials without a "
            f"stimulus; [rows.skip] of a map leaves them out{other}"
        )
        first = rows[silent].iloc[0]
        raise ResultFileError(first["file"], int(first["line"]), message)
    return rows.assign(side=rows["side"].mask(silent, "none"))


def typed(text: pd.DataFrame, readers: list[CellReader], file: str) -> pd.DataFrame:
    """Read columns of text cells, one by each reader, and tell where each row stands."""
    read = {reader.column.name: reader.read(text[reader.column.name]) for reader in readers}
    first_fault(file, [column for column in read.values() if isinstance(column, CellFault)])
    rows = pd.DataFrame(read)
    # As objects: a file's name need not be text that can be encoded.
    rows["file"] = pd.Series(file, index=rows.index, dtype=object)
    rows["line"] = rows.index
    return rows


def _default(name: str, columns: ColumnMap, lines: pd.Index[Any]) -> Any:
    texts = pd.Series(DEFAULTS.get(name, NOT_AVAILABLE), index=lines, dtype=object)
    return columns.reader(name).read(texts)


def no_rows() -> pd.DataFrame:
    """Return a table of trials without a trial.

    >>> len(no_rows()), no_rows()["level_vpp"].dtype
    (0, dtype('float64'))
    """
    text = pd.DataFrame(columns=list(_NAMES), dtype=object)
    return with_responses(own_rows(text, ""))


def with_responses(rows: pd.DataFrame, task: str = "") -> pd.DataFrame:
    """Turn ``detected`` into the response it stands for, and fill in what is correct.

    A detected stimulus was answered with its side, a missed one with ``none`` or, in a forced
    choice, with the other side. A blank trial has no side: a felt one counts for the only side at
    which its file has stimuli. Then tell where "none" was an answer.

    ``none_offered`` is what the task says; without one it is true where "none" was answered, else
    missing until `offered_to_all`. Hands-off trials tell nothing of it: "none" is always an answer
    there.

    Raises ResultFileError for a felt blank trial in a file with stimuli at more than one side.

    >>> from analysis.reading.foreign.columns import ColumnMap
    >>> text = pd.DataFrame({"participant": "1", "side": ["left", "left", "none"],
    ...     "level_vpp": ["60", "60", "0"], "detected": ["1", "0", "1"]}, index=[2, 3, 4])
    >>> rows = with_responses(mapped_rows(text, "t.csv", ColumnMap(task="yes/no")), "yes/no")
    >>> rows[["response", "correct"]].to_numpy().tolist()
    [['left', True], ['none', False], ['left', False]]
    """
    if "response" not in rows:
        missed = rows["side"].astype(object).map(_OTHER) if task == FORCED else "none"
        answers = rows["detected"].astype(object)
        answers = answers.mask(answers.eq("0"), missed)
        felt = answers.eq("1")
        answers = answers.mask(felt, _felt_side(rows, felt))
        rows["response"] = pd.Categorical(answers, categories=list(RESPONSES))
    stated = rows["correct"].astype("boolean")
    rows["correct"] = stated.fillna(expected_correct(rows))
    none = rows["response"].eq("none") & rows["kind"].ne(HANDS_OFF)
    rows["none_offered"] = (
        pd.array([task == YES_NO] * len(rows), dtype="boolean")
        if task
        else none.astype("boolean").mask(~none)
    )
    return rows[[*_NAMES, "file", "line", "none_offered"]]


def offered_to_all(trials: pd.DataFrame) -> pd.Series[Any]:
    """Return ``none_offered`` with what the answers of others tell where it is missing.

    "none" was an answer for everybody in a condition of a study if anybody gave it there: who never
    felt nothing, or never said so, had the same keys. Tables made elsewhere name no study, and are
    one. What a plan says of its own session stays.

    >>> trials = pd.DataFrame({"condition": ["a", "a", "b"], "study_sha256": "n/a",
    ...     "none_offered": pd.array([True, None, None], dtype="boolean")})
    >>> offered_to_all(trials).tolist()
    [True, True, <NA>]
    """
    told = trials["none_offered"].astype("boolean")
    unknown = told.isna()
    if not unknown.any():
        return told
    yes = told.fillna(value=False)
    anybody = yes.groupby([trials["condition"], trials["study_sha256"]]).transform("any")
    return told.mask(unknown & anybody, other=True)


def _felt_side(rows: pd.DataFrame, felt: pd.Series[bool]) -> pd.Series[Any]:
    sides = rows["side"].astype(object)
    felt_blank = felt & sides.eq("none")
    blanks = rows.loc[felt_blank, ["file", "line"]].drop_duplicates("file")
    answered: dict[str, str] = {}
    for file, line in blanks.itertuples(index=False):
        stimulated = sorted({*sides[rows["file"].eq(file)]} - {"none"})
        if len(stimulated) != 1:
            message = (
                "column 'detected' holds '1' in a blank trial, and the table has stimuli at "
                f"{', '.join(stimulated) or 'no side'}: which side was answered? Map response "
                "instead or, where only felt or not was asked, one [constant] side for all rows in "
                "place of [columns] side"
            )
            raise ResultFileError(file, int(line), message)
        answered[file] = stimulated[0]
    return sides.mask(felt_blank, rows["file"].map(answered))


def expected_correct(rows: pd.DataFrame) -> pd.Series[Any]:
    """Return for each row whether its response names its stimulus, as the task defines it.

    >>> expected_correct(pd.DataFrame({"kind": ["both"], "side": ["both"], "response": ["left"]}))
    0    False
    dtype: boolean
    """
    table = [[LEFT_RIGHT_BOTH.is_correct(s, r) for r in (*RESPONSES, None)] for s in SIDES]
    choices = {"side": SIDES, "response": RESPONSES}
    codes = [pd.Categorical(rows[name], categories=list(c)).codes for name, c in choices.items()]
    answers = pd.array(np.array(table, dtype=object)[tuple(codes)], dtype="boolean")
    return pd.Series(answers, index=rows.index)
