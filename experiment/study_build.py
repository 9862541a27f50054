"""Checked tables of a study file -> `Study`: millimetres and gigapascals end here."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, TypeVar

from experiment.actuator import Actuator
from experiment.design import Design
from experiment.observer import Observer
from experiment.study_values import Condition, DeviceSettings, Masking, Simulation, Study
from stimuli import CLAMPED, SIMPLY_SUPPORTED, Burst, ElasticEdge, IdealEdge, Material, Strip

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from experiment.study_tables import (
        ActuatorTable,
        BurstTable,
        ConditionTable,
        DesignTable,
        SimulationTable,
        StripTable,
        StudyTables,
    )

_Table = TypeVar("_Table")
_Value = TypeVar("_Value")


def built_study(tables: StudyTables) -> Study:
    """Turn checked tables into a study.

    Parameters
    ----------
    tables : StudyTables
        Complete tables.

    Raises
    ------
    ValueError
        If a value is out of its range, or two do not go together; it begins with the key's path.
    """
    canonical = json.dumps(
        tables.model_dump(), sort_keys=True, separators=(",", ":"), ensure_ascii=False
    )
    _at("burst", _require_burst, tables.burst)
    return Study(
        name=tables.study.name,
        strip=_at("strip", _strip, tables.strip),
        edge_basis=tables.strip.edge,
        actuators=_each("actuator", _actuator, tables.actuator),
        conditions=_each("condition", _condition, tables.condition),
        design=_at("design", _design, tables.design),
        device=_at("device", lambda table: DeviceSettings(**table.model_dump()), tables.device),
        masking=_at("masking", lambda table: Masking(**table.model_dump()), tables.masking),
        simulation=_at("simulation", _simulation, tables.simulation),
        max_energy_above_cutoff=tables.burst.max_energy_above_cutoff,
        canonical=canonical,
        sha256=hashlib.sha256(canonical.encode()).hexdigest(),
    )


def _at(path: str, build: Callable[[_Table], _Value], table: _Table) -> _Value:
    """Build a value; a refusal gets the path of the table before its first word, the key."""
    try:
        return build(table)
    except ValueError as error:
        raise ValueError(f"{path}.{error}") from error


def _each(
    path: str, build: Callable[[_Table], _Value], tables: Iterable[_Table]
) -> tuple[_Value, ...]:
    return tuple(_at(f"{path}[{i}]", build, table) for i, table in enumerate(tables))


def _strip(table: StripTable) -> Strip:
    strip = Strip(
        width_m=table.width_mm / 1e3,
        length_m=None if table.length_mm == "endless" else table.length_mm / 1e3,
        thickness_m=table.thickness_mm / 1e3,
        material=Material(
            youngs_modulus_pa=table.youngs_modulus_gpa * 1e9,
            poisson_ratio=table.poisson_ratio,
            density_kg_m3=table.density_kg_m3,
        ),
        edge=_edge(table),
    )
    if table.measured_cutoff_hz is None:
        return strip
    try:
        return strip.with_cutoff(table.measured_cutoff_hz)
    except ValueError as error:
        raise ValueError(f"measured_cutoff_hz {_without_name(error)}") from error


def _without_name(error: ValueError) -> str:
    """Return a refusal without its first word, the argument's name; the file's key is another."""
    return str(error).split(" ", maxsplit=1)[-1]


def _edge(table: StripTable) -> IdealEdge | ElasticEdge:
    if table.edge_stiffness_n is not None:
        return ElasticEdge(stiffness_n=table.edge_stiffness_n)
    return SIMPLY_SUPPORTED if table.edge == "simply-supported" else CLAMPED


def _actuator(table: ActuatorTable) -> Actuator:
    lengths_mm = table.model_dump(exclude={"side", "shape"}, exclude_none=True)
    lengths_m = {f"{key[:-3]}_m": length_mm / 1e3 for key, length_mm in lengths_mm.items()}
    return Actuator(side=table.side, shape=table.shape, **lengths_m)


def _require_burst(table: BurstTable) -> None:
    """Refuse [burst] by its own name, before the conditions that take it over."""
    burst = Burst(frequency_hz=table.frequency_hz, cycles=table.cycles, window=table.window)
    Condition(name="burst", burst=burst, accept_unfit=table.accept_unfit)


def _condition(table: ConditionTable) -> Condition:
    keys = table.model_dump(exclude={"name", "accept_unfit"})
    return Condition(name=table.name, burst=Burst(**keys), accept_unfit=table.accept_unfit)


def _design(table: DesignTable) -> Design:
    keys = table.model_dump(exclude={"both_level"})
    return Design(**keys, both_level_vpp=None if table.both_level == "random" else table.both_level)


def _simulation(table: SimulationTable) -> Simulation:
    median = Observer(**table.model_dump(exclude={"threshold_sd_db"}))
    return Simulation(median=median, threshold_sd_db=table.threshold_sd_db)
