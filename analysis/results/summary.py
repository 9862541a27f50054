"""The summary of an analysis as JSON, and the meaning of the columns of its tables."""

from __future__ import annotations

import json
import math
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final

from analysis.results.answer import answer
from analysis.results.rendering import read_toml, texts_of, words_of
from experiment.names import NOT_AVAILABLE
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    import pandas as pd

    from analysis.axis import Axis
    from analysis.results.analysis import Analysis
    from experiment.tasks.task import Task


SCHEMA: Final = 2
_COUNTS: Final = ("false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b")
_OF_NAMED_SITES: Final = ("over_report", "mislocalised")
"""Columns of answers that name another site, or more of them."""
INFORMATION: Final = ("bits", "bits_low", "bits_high", "max_bits")
"""Columns that only an identification has."""
_TABLES: Final = (
    *("excluded", "levels", "both", "blank", "hands_off", "thresholds", "groups", "sides"),
    *("side_groups", "differences", "sensitivity", "d_prime_differences", "reaction_times"),
    "information",
)


def summary_text(analysis: Analysis) -> str:
    """Write the summary as JSON: no time, no host, no absolute path; equal data give equal text."""
    loaded, axis = analysis.loaded, analysis.axis
    modified = (*loaded.altered.values(), *loaded.lost.values())
    tables = {name: getattr(analysis, name) for name in _TABLES} | {"levels": any_side(analysis)}
    summary = {
        "schema": SCHEMA,
        "ci": analysis.ci,
        "inputs": [asdict(file) for file in loaded.inputs],
        "versions": versions(),
        "seed": analysis.seed,
        "axis": {"x_scale": axis.x_scale, "unit": axis.unit},
        "counts": asdict(analysis.counts),
        "mark": analysis.mark,
        "answer": [asdict(row) for row in answer(analysis)],
        "devices": devices(analysis.trials),
        "altered": [difference for each in modified for difference in each],
        "not_compared": list(loaded.not_compared),
        "contact": {text: list(names) for text, names in analysis.contacts.items()},
        "side_p": dict(analysis.side_p),
        **{name: _records(table, analysis) for name, table in tables.items()},
        "warnings": [asdict(warning) for warning in analysis.warnings],
    }
    options: dict[str, Any] = {"indent": 1, "ensure_ascii": False, "allow_nan": False}
    return json.dumps(summary, default=lambda number: number.item(), **options) + "\n"


def any_side(analysis: Analysis) -> pd.DataFrame:
    """Return the levels with ``detected_any``, NaN where "none" could not be answered."""
    table = analysis.detected_any
    return analysis.levels.assign(detected_any=math.nan if table is None else table["detected_any"])


def reported_columns(table: pd.DataFrame, analysis: Analysis) -> pd.DataFrame:
    """Return a table of results with the columns that suit the unit and the place of its stimuli.

    Where levels are no volts peak-to-peak, columns lose their ``_vpp`` and a last one has the
    unit. An external table of one place, whose side only the map states, has no side.
    """
    side, unit = analysis.one_place, analysis.axis.unit
    if side:
        answers = {side: "felt", "none": "not_felt"}
        sided = {"side", *analysis.task.named_answers, "over_report", "mislocalised"} - {side}
        sided |= {f"level_{site}_vpp" for site in analysis.task.sites}
        sided |= {f"peak_{site}_um" for site in analysis.task.sites}
        table = table.drop(columns=[*sided & {*table}]).rename(columns=answers)
        if "response" in table:
            table = table.assign(response=table["response"].astype(object).replace(answers))
    if not analysis.axis.is_vpp and any(str(name).endswith("_vpp") for name in table):
        names = {name: str(name).removesuffix("_vpp") for name in table}
        table = table.rename(columns=names).assign(unit=unit)
    return table


def written_columns(table: pd.DataFrame, analysis: Analysis) -> pd.DataFrame:
    """Return a table as files have it: `reported_columns`, called as the task calls them.

    Without answers that name sites, nothing can be answered with another site.
    """
    without = () if analysis.task.named_answers else _OF_NAMED_SITES
    table = table.drop(columns=[name for name in without if name in table])
    table = table.rename(columns=_names_of(analysis.task))
    return reported_columns(table, analysis)


def _names_of(task: Task) -> dict[str, str]:
    """Return what columns are called in a task, those of its sites included."""
    return {
        ours.format(site=site): name.format(site=site)
        for ours, name in words_of(task.scoring)["columns"].items()
        for site in task.sites
    }


def column_meanings(
    axis: Axis, *, one_place: bool = False, task: Task = LEFT_RIGHT_BOTH
) -> dict[str, str]:
    """Return what the columns of the tables mean, of `written_columns`.

    >>> from analysis.axis import Axis
    >>> column_meanings(Axis(unit="vol"))["threshold_db"]
    'the threshold in dB re 1 vol'
    """
    texts, columns = read_toml("columns.toml"), _names_of(task)
    named = {**texts["columns"], **texts_of("columns.toml", task.scoring)}
    if task.answer_names != LEFT_RIGHT_BOTH.answer_names:
        hidden = {*LEFT_RIGHT_BOTH.named_answers, *texts["both_sites"]["names"]}
        hidden |= set() if task.named_answers else {*_OF_NAMED_SITES}
        named = {name: text for name, text in named.items() if name not in hidden}
        for answer in task.answers:
            text = f"trials answered {answer.name}: {answer.meaning}"
            named[answer.name] = "; ".join(filter(None, (named.get(answer.name), text)))
    for name in (name for name in [*named] if "{site}" in name):
        text = named.pop(name)
        named |= {name.format(site=site): text.replace("{site}", site) for site in task.sites}
    if not task.is_identification:
        named = {name: text for name, text in named.items() if name not in INFORMATION}
    named = {columns.get(name, name): text for name, text in named.items()}
    unit = "volts peak-to-peak" if axis.is_vpp else axis.unit
    db = axis.unit if axis.unit.lower().startswith("db") else f"dB re 1 {axis.label}"
    meanings = {
        name if axis.is_vpp else name.replace("_vpp", ""): text.format(unit=unit, db=db)
        for name, text in named.items()
    }
    if not axis.is_vpp:
        meanings |= texts["own_unit"]
    if one_place:
        hidden = texts["two_places"]["names"]
        meanings = {name: text for name, text in meanings.items() if name not in hidden}
        meanings |= texts["one_place"]
    return meanings


def columns_text(analysis: Analysis) -> str:
    """Write what the columns mean as JSON."""
    one_place = bool(analysis.one_place)
    meanings = column_meanings(analysis.axis, one_place=one_place, task=analysis.task)
    return json.dumps(meanings, indent=1, ensure_ascii=False) + "\n"


def versions() -> dict[str, str]:
    """Name the versions that numbers and figures depend on.

    >>> [*versions()]
    ['python', 'tactstrip', 'numpy', 'scipy', 'pandas', 'matplotlib']
    """
    names = ("tactstrip", "numpy", "scipy", "pandas", "matplotlib")
    return {"python": platform.python_version()} | {name: version(name) for name in names}


def devices(trials: pd.DataFrame) -> dict[str, int]:
    """Count the trials of each kind of device; an external table may not have it.

    >>> import pandas as pd
    >>> devices(pd.DataFrame({"device_kind": ["mock", "mock", None]}))
    {'mock': 2, 'n/a': 1}
    """
    kinds = trials["device_kind"].astype(object)
    counts = kinds.where(kinds.notna(), NOT_AVAILABLE).value_counts()
    return {str(kind): int(counts[kind]) for kind in sorted(counts.index)}


def _records(table: pd.DataFrame, analysis: Analysis) -> list[dict[str, object]]:
    """Return the rows of a table, null for NaN, and counts whole where others are missing."""
    table = written_columns(table, analysis)
    table = table.astype({name: "Int64" for name in _COUNTS if name in table}).astype(object)
    return [
        dict(zip(table.columns, row, strict=True))
        for row in table.where(table.notna(), None).itertuples(index=False, name=None)
    ]
