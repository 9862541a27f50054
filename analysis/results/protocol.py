"""How it was measured: plate, stimuli, design and device of the sealed plans."""

from __future__ import annotations

import json
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Final

import pandas as pd

from analysis.results.rendering import phrases, sentence
from experiment.study.base import format_value

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analysis.results.analysis import Analysis
    from experiment.rows import MeasuredRow
    from experiment.study.study import Study


_MEASURED: Final = ("condition", "tap", "unit", "burst_verified", "noted", "late_s")
_PEAKS: Final = ("planned_left", "planned_right", "peak_left", "peak_right")


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """The different studies of the plans, with the keys that their files set.

    `faults` are plans that cannot be read.
    """

    studies: tuple[Study, ...]
    keys_set: tuple[tuple[str, ...], ...]
    faults: tuple[str, ...]


def planned(analysis: Analysis) -> Planned:
    """Read the studies in the plans beside the tables."""
    from experiment.study.files import study_from_canonical

    studies: dict[tuple[str, tuple[str, ...]], Study] = {}
    faults: dict[str, None] = {}
    for text, keys in dict.fromkeys((s.study, s.keys_set) for s in analysis.loaded.progress):
        try:
            studies[text, keys] = study_from_canonical(text)
        except ValueError as error:
            faults[str(error)] = None
    keys_set = tuple(keys for _, keys in studies)
    return Planned(studies=(*studies.values(),), keys_set=keys_set, faults=(*faults,))


def protocol_rows(analysis: Analysis, plans: Planned) -> dict[str, pd.DataFrame]:
    """Return the rows of the tables of protocol and sources, by their names in tables.toml."""
    files = [{"name": file.name, "sha256": file.sha256} for file in analysis.loaded.inputs]
    return {
        "protocol": _quantities(analysis, plans),
        "measured": measured_bursts(row for s in analysis.loaded.progress for row in s.measured),
        "keys": _keys(plans),
        "files": pd.DataFrame(files),
    }


def _quantities(analysis: Analysis, plans: Planned) -> pd.DataFrame:
    """Return quantities of the study with their values; several where sessions differ."""
    values = [
        (quantity, sentence("study.jinja", key, study=study))
        for key, quantity in phrases()["protocol"].items()
        for study in plans.studies
    ]
    summaries = analysis.contacts
    if plans.studies or {*summaries} - {"not stated"}:
        several = len(summaries) > 1
        values += [
            ("Force and contact of the fingers", f"{text}: {', '.join(who)}" if several else text)
            for text, who in summaries.items()
        ]
    return pd.DataFrame([*dict.fromkeys(values)], columns=["quantity", "value"])


def measured_bursts(rows: Iterable[MeasuredRow]) -> pd.DataFrame:
    """Return the peaks that a monitor measured beside the planned ones."""
    columns = [*_MEASURED, *_PEAKS]
    bursts = pd.DataFrame(map(attrgetter(*columns), rows), columns=columns)
    if bursts.empty:
        return bursts
    bursts["late_ms"] = bursts["late_s"].astype(float).abs() * 1e3
    is_blank = bursts["planned_left"].eq(0) & bursts["planned_right"].eq(0)
    channels = [bursts[is_blank].assign(channel="none", planned=0.0, peak=None)]
    for side in ("left", "right"):
        driven = bursts[bursts[f"planned_{side}"].ne(0)]
        peaks = {"planned": driven[f"planned_{side}"], "peak": driven[f"peak_{side}"]}
        channels.append(driven.assign(channel=side, **peaks))
    table = pd.concat(channels).astype({"peak": float}).rename(columns={"unit": "peak_unit"})
    table["is_false"] = table["burst_verified"].eq("false")
    groups = table.groupby(["condition", "tap", "channel", "planned", "peak_unit"])
    counts = {
        "bursts": groups.size(),
        "false_bursts": groups["is_false"].sum(),
        "unknown": groups.size() - groups["burst_verified"].count(),
        "noted": groups["noted"].count(),
        "late_median_ms": groups["late_ms"].median(),
        "late_max_ms": groups["late_ms"].max(),
    }
    return groups["peak"].agg(["median", "min", "max"]).assign(**counts).reset_index()


def _keys(plans: Planned) -> pd.DataFrame:
    """Return the keys that study files set, with values and sources."""
    rows = []
    for study, keys in zip(plans.studies, plans.keys_set, strict=True):
        values = json.loads(study.canonical)
        for path in keys:
            section, key = path.rsplit(".", 1)
            name, _, index = section.rstrip("]").partition("[")
            table = values[name][int(index)] if index else values[name]
            if key != "source":  # it stands beside the values that it is of
                row = {"key": path, "value": format_value(table[key])}
                rows.append(row | {"source": table.get("source") or ""})
    if not rows:
        return pd.DataFrame()
    of_keys = pd.DataFrame(rows).groupby("key", sort=False)
    table = of_keys.agg(_join_different).reset_index()
    return table.assign(
        source=table["source"].mask(table["source"].eq(table["source"].shift()), "")
    )


def _join_different(texts: pd.Series[str]) -> str:
    return "; ".join(dict.fromkeys(texts))
