"""The summary of an analysis: everything that is not a table of trials, as JSON."""

from __future__ import annotations

import json
import math
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING

from analysis.definitions import DEFINITIONS, OF_ONE_PLACE, OF_SIDES, definitions_in
from analysis.results.answer import answer
from analysis.results.methods.words import plain
from analysis.results.rows import levels_told
from experiment.rows import NOT_AVAILABLE

if TYPE_CHECKING:
    import pandas as pd

    from analysis.groups.population import PopulationThreshold
    from analysis.results.tables import Analysis


SCHEMA = 1
_COUNTS = ("false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b")
_SIDED = ("left_vpp", "right_vpp", "left_um", "right_um")


def summary_text(analysis: Analysis) -> str:
    """Write the summary as JSON: no time, no host, no absolute path; equal data give equal text."""
    answered = answer(analysis)
    summary = {
        "schema": SCHEMA,
        "definitions": {"ci": analysis.ci, **definitions_of(analysis)},
        "inputs": [asdict(file) for file in analysis.inputs],
        "versions": versions(),
        "seed": analysis.seed,
        "axis": {"x_scale": analysis.axis.x_scale, "unit": analysis.axis.unit},
        "counts": asdict(analysis.counts),
        "mark": analysis.mark,
        "answer": [plain(statement) for statement in answered.statements],
        "answer_codes": answered.codes,
        "devices": devices(analysis.trials),
        "altered": [
            one for each in (*analysis.altered.values(), *analysis.lost.values()) for one in each
        ],
        "not_compared": list(analysis.not_compared),
        "contact": {words: list(which) for words, which in analysis.contacts.items()},
        "excluded": _records(analysis.excluded, analysis),
        "levels": _records(levels_told(analysis), analysis),
        "both": _records(analysis.both, analysis),
        "blank": _records(analysis.blank, analysis),
        "hands_off": _records(analysis.hands_off, analysis),
        "thresholds": _records(analysis.thresholds, analysis),
        "groups": _records(analysis.groups, analysis),
        "differences": _records(analysis.differences, analysis),
        "sensitivity": _records(analysis.sensitivity, analysis),
        "d_prime_differences": _records(analysis.d_prime_differences, analysis),
        "population": [_population(one, analysis) for one in analysis.population],
        "choice": [asdict(one) for one in analysis.choice],
        "reaction_times": _records(analysis.reaction_times, analysis),
        "warnings": [asdict(one) for one in analysis.warnings],
    }
    return json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def in_own_words(table: pd.DataFrame, analysis: Analysis) -> pd.DataFrame:
    """Return a table of results with a lab's own unit and place.

    Where levels are no volts peak-to-peak, columns lose their ``_vpp`` and a last one tells the
    unit. Where a table made elsewhere has one place, whose side only the map states, no side is
    told.
    """
    side, unit = analysis.one_place, analysis.axis.unit
    if side:
        felt = {side: "felt", "none": "not_felt"}
        sided = {"side", "left", "right", "both", "over_report", "mislocalised"} - {side}
        sided |= {f"{of}_{at}" for of in ("level", "peak") for at in _SIDED}
        table = table.drop(columns=[name for name in table if name in sided]).rename(columns=felt)
        if "response" in table:
            table = table.assign(response=table["response"].astype(object).replace(felt))
    if not analysis.axis.is_vpp and any(str(name).endswith("_vpp") for name in table):
        names = {name: str(name).removesuffix("_vpp") for name in table}
        table = table.rename(columns=names).assign(unit=unit)
    return table


def definitions_of(analysis: Analysis) -> dict[str, str]:
    """Return what the columns mean, of `in_own_words`."""
    axis = analysis.axis
    definitions = dict(DEFINITIONS if axis.is_vpp else definitions_in(axis.unit))
    if analysis.one_place:
        definitions = {n: text for n, text in definitions.items() if n not in OF_SIDES}
        definitions.update(OF_ONE_PLACE)
    return definitions


def versions() -> dict[str, str]:
    """Name the versions that numbers and figures depend on.

    >>> [*versions()]
    ['python', 'tactstrip', 'numpy', 'scipy', 'pandas', 'matplotlib']
    """
    names = ("tactstrip", "numpy", "scipy", "pandas", "matplotlib")
    return {"python": platform.python_version()} | {name: version(name) for name in names}


def devices(trials: pd.DataFrame) -> dict[str, int]:
    """Count the trials of each kind of device; a table made elsewhere may not tell it.

    >>> import pandas as pd
    >>> devices(pd.DataFrame({"device_kind": ["mock", "mock", None]}))
    {'mock': 2, 'n/a': 1}
    """
    kinds = trials["device_kind"].astype(object)
    counts = kinds.where(kinds.notna(), NOT_AVAILABLE).value_counts()
    return {str(kind): int(counts[kind]) for kind in sorted(counts.index)}


def _population(one: PopulationThreshold, analysis: Analysis) -> dict[str, object]:
    limits = [_known(limit) for limit in one.threshold_limits_vpp]
    told = {n: _known(value) for n, value in asdict(one).items()} | {"threshold_limits_vpp": limits}
    if analysis.axis.is_vpp:
        return told
    return {n.removesuffix("_vpp"): value for n, value in told.items()} | {
        "unit": analysis.axis.unit
    }


def _known(value: object) -> object:
    return None if isinstance(value, float) and math.isnan(value) else value


def _records(table: pd.DataFrame, analysis: Analysis) -> list[dict[str, object]]:
    table = in_own_words(table, analysis)
    return [
        {
            name: _counted(name, _known(value))
            for name, value in zip(table.columns, row, strict=True)
        }
        for row in table.itertuples(index=False, name=None)
    ]


def _counted(name: str, value: object) -> object:
    """Write a count as one, where its column holds floats for the rows without it."""
    return int(value) if name in _COUNTS and isinstance(value, float) else value
