"""The summary of an analysis: everything that is not a table of trials, as JSON."""

from __future__ import annotations

import json
import math
import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING

from analysis.definitions import definitions_in
from analysis.results.answer import answer
from analysis.results.compared import plain
from analysis.results.rows import levels_told
from experiment.terms.record import NOT_AVAILABLE

if TYPE_CHECKING:
    import pandas as pd

    from analysis.groups.population import PopulationThreshold
    from analysis.results.tables import Analysis


SCHEMA = 1


def summary_text(analysis: Analysis) -> str:
    """Write the summary as JSON: no time, no host, no absolute path; equal data give equal text."""
    summary = {
        "schema": SCHEMA,
        "definitions": {"ci": analysis.ci, **definitions_in(analysis.axis.unit)},
        "inputs": [asdict(file) for file in analysis.inputs],
        "versions": versions(),
        "seed": analysis.seed,
        "counts": asdict(analysis.counts),
        "mark": analysis.mark,
        "answer": [plain(statement) for statement in answer(analysis).statements],
        "devices": devices(analysis.trials),
        "altered": [
            one for told in (*analysis.altered.values(), *analysis.lost.values()) for one in told
        ],
        "not_compared": list(analysis.not_compared),
        "contact": {words: list(which) for words, which in analysis.contacts.items()},
        "excluded": _records(analysis.excluded),
        "levels": _records(levels_told(analysis)),
        "both": _records(analysis.both),
        "blank": _records(analysis.blank),
        "control": _records(analysis.control),
        "thresholds": _records(analysis.thresholds),
        "groups": _records(analysis.groups),
        "differences": _records(analysis.differences),
        "sensitivity": _records(analysis.sensitivity),
        "population": [_population(one) for one in analysis.population],
        "choice": [asdict(one) for one in analysis.choice],
        "reaction_times": _records(analysis.reaction_times),
        "warnings": list(analysis.warnings),
    }
    return json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


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


def _population(one: PopulationThreshold) -> dict[str, object]:
    low, high = one.threshold_limits_vpp
    told = asdict(one) | {"threshold_limits_vpp": [_known(low), _known(high)]}
    return {name: _known(value) for name, value in told.items()}


def _known(value: object) -> object:
    return None if isinstance(value, float) and math.isnan(value) else value


def _records(table: pd.DataFrame) -> list[dict[str, object]]:
    return [
        {name: _known(value) for name, value in zip(table.columns, row, strict=True)}
        for row in table.itertuples(index=False, name=None)
    ]
