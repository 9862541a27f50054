"""How it was measured: plate, stimuli, design and device of the sealed plans."""

from __future__ import annotations

import json
from operator import attrgetter
from typing import TYPE_CHECKING, Final, NamedTuple

import pandas as pd

from analysis.results.rendering import phrases, sentence
from experiment.record.entries import MEASURED_COLUMNS
from experiment.study.base import format_value

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from analysis.reading.session import SessionProgress
    from analysis.results.analysis import Analysis
    from experiment.record.entries import MeasuredRow
    from experiment.study.study import Study


_MEASURED: Final = ("condition", "tap", "unit", "burst_verified", "noted", "late_s")


class Planned(NamedTuple):
    """The different studies of plans, each by its text and the keys that its file sets.

    `faults` say why other plans cannot be read.
    """

    studies: dict[tuple[str, tuple[str, ...]], Study]
    faults: list[str]


def read_studies(sessions: Iterable[SessionProgress]) -> Planned:
    """Read the studies in the plans of sessions."""
    from experiment.study.files import study_from_canonical

    plans = Planned({}, [])
    studies = dict.fromkeys((session.plan.study, session.plan.keys_set) for session in sessions)
    for text, keys in studies:
        try:
            plans.studies[text, keys] = study_from_canonical(text)
        except ValueError as error:
            plans.faults.append(str(error))
    return plans


def protocol_rows(analysis: Analysis) -> dict[str, pd.DataFrame]:
    """Return the rows of the tables of protocol and sources, by their names in tables.toml."""
    files = [{"name": file.name, "sha256": file.sha256} for file in analysis.loaded.inputs]
    return {
        "protocol": _quantities(analysis),
        "measured": measured_bursts(
            (row for s in analysis.loaded.progress for row in s.measured), analysis.task.sites
        ),
        "keys": _keys(analysis.plans.studies),
        "files": pd.DataFrame(files),
    }


def _quantities(analysis: Analysis) -> pd.DataFrame:
    """Return quantities of the study with their values; several where sessions differ."""
    values = [
        (quantity, sentence("study.jinja", key, study=study))
        for key, quantity in phrases()["protocol"].items()
        for study in analysis.plans.studies.values()
    ]
    contacts = analysis.contacts
    if analysis.plans.studies or {*contacts} - {"not stated"}:
        values += [
            (
                "Force and contact of the fingers",
                f"{text}: {', '.join(who)}" if len(contacts) > 1 else text,
            )
            for text, who in contacts.items()
        ]
    return pd.DataFrame([*dict.fromkeys(values)], columns=["quantity", "value"])


def measured_bursts(rows: Iterable[MeasuredRow], sites: tuple[str, ...]) -> pd.DataFrame:
    """Return the measured and the planned peaks."""
    columns = [*_MEASURED, "at_sites", "peaks"]
    attributes = [*(MEASURED_COLUMNS[name] for name in _MEASURED), "measured.planned"]
    cells = attrgetter(*attributes, "measured.peaks")
    bursts = pd.DataFrame(map(cells, rows), columns=columns)
    if bursts.empty:
        return bursts
    bursts["late_ms"] = bursts["late_s"].astype(float).abs() * 1e3
    is_blank = ~bursts["at_sites"].map(any)
    channels = [bursts[is_blank].assign(channel="none", planned=0.0, peak=None)]
    for index, side in enumerate(sites):
        driven = bursts[bursts["at_sites"].str[index].ne(0)]
        peaks = {"planned": driven["at_sites"].str[index], "peak": driven["peaks"].str[index]}
        channels.append(driven.assign(channel=side, **peaks))
    table = pd.concat(channels).astype({"peak": float}).rename(columns={"unit": "peak_unit"})
    table["is_noted"] = table["noted"].astype(bool)
    table["is_false"] = table["burst_verified"].eq("false")
    groups = table.groupby(["condition", "tap", "channel", "planned", "peak_unit"])
    counts = {
        "bursts": groups.size(),
        "false_bursts": groups["is_false"].sum(),
        "unknown": groups.size() - groups["burst_verified"].count(),
        "noted": groups["is_noted"].sum(),
        "late_median_ms": groups["late_ms"].median(),
        "late_max_ms": groups["late_ms"].max(),
    }
    return groups["peak"].agg(["median", "min", "max"]).assign(**counts).reset_index()


def _keys(studies: Mapping[tuple[str, tuple[str, ...]], Study]) -> pd.DataFrame:
    """Return the keys that study files set, with values and sources."""
    rows = []
    for (_, keys), study in studies.items():
        values = json.loads(study.canonical)
        for path in keys:
            section, key = path.rsplit(".", 1)
            name, _, index = section.rstrip("]").partition("[")
            table = values[name][int(index)] if index else values[name]
            if key != "source":  # the source has a column of its own
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
