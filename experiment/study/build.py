"""Checked tables of a study file -> `Study`: millimetres and gigapascals end here."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from experiment.study.sections.dataset import Dataset, ParticipantColumn
from experiment.study.sections.design import Design
from experiment.study.sections.equipment import DeviceSettings, Masking
from experiment.study.sections.plate import CARRIER_KEYS, MEASURED_KEYS, PIEZO_KEYS, Actuator
from experiment.study.sections.presentation import (
    Keys,
    Screen,
    Texts,
    check_keys,
    check_screen,
    check_texts,
)
from experiment.study.sections.simulation import Simulation
from experiment.study.sections.stimulus import SINE_KEYS, AutoWindow, Condition
from experiment.study.study import Study
from experiment.terms.observer import Observer
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    IdealEdge,
    Material,
    MeasuredDisplacement,
    PiezoLayers,
    SampledDrive,
    Strip,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from experiment.study.sections.plate import ActuatorTable, StripTable
    from experiment.study.sections.presentation_tables import KeysTable, ScreenTable, TextsTable
    from experiment.study.sections.stimulus import BurstTable, ConditionTable
    from experiment.study.tables import DesignTable, SimulationTable, StudyTables


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
        conditions=_each(
            "condition",
            lambda table: _condition(table, tables.device.sample_rate_hz),
            tables.condition,
        ),
        design=_at("design", _design, tables.design),
        device=_at("device", lambda table: DeviceSettings(**table.model_dump()), tables.device),
        masking=_at("masking", lambda table: Masking(**dict(table)), tables.masking),
        simulation=_at("simulation", _simulation, tables.simulation),
        max_energy_above_cutoff=tables.burst.max_energy_above_cutoff,
        masking_limit_db=tables.burst.masking_limit_db,
        canonical=canonical,
        sha256=hashlib.sha256(canonical.encode()).hexdigest(),
        screen=_at("screen", _screen, tables.screen),
        keys=_at("keys", _keys, tables.keys),
        texts=_at("texts", _texts, tables.texts),
        consent_version=tables.study.consent_version,
        participant_columns=_each(
            "participants.columns",
            lambda table: ParticipantColumn(**table.model_dump()),
            tables.participants.columns,
        ),
        dataset=_at("dataset", lambda table: Dataset(**table.model_dump()), tables.dataset),
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
            loss_factor=table.loss_factor,
            viscous_time_s=table.viscous_time_us / 1e6,
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
    lengths_mm = {key: getattr(table, key) for key in _LENGTHS_MM}
    lengths_m = {
        f"{key[:-3]}_m": length_mm / 1e3
        for key, length_mm in lengths_mm.items()
        if length_mm is not None
    }
    return Actuator(
        side=table.side, name=table.name, shape=table.shape, basis=_basis(table), **lengths_m
    )


_LENGTHS_MM: Final = (
    "x_mm",
    "y_mm",
    "diameter_mm",
    "length_x_mm",
    "length_y_mm",
    "finger_diameter_mm",
)


def _basis(table: ActuatorTable) -> MeasuredDisplacement | PiezoLayers | None:
    """Return what is known of the displacement; a refusal names the value as the file's key."""
    try:
        if table.measured_displacement_um is not None:
            return _measured(table)
        return None if table.piezo_thickness_mm is None else _layers(table)
    except ValueError as error:
        sort = "piezo" if table.measured_displacement_um is None else "measured"
        prefix = "" if str(error).startswith("carrier") else f"{sort}_"
        raise ValueError(f"{prefix}{error}") from error


def _measured(table: ActuatorTable) -> MeasuredDisplacement:
    displacement_um, level_vpp, frequency_hz = _given(table, MEASURED_KEYS)
    return MeasuredDisplacement(
        displacement_m=displacement_um / 1e6, level_vpp=level_vpp, frequency_hz=frequency_hz
    )


def _layers(table: ActuatorTable) -> PiezoLayers:
    thickness_mm, modulus_gpa, poisson_ratio, d31_pm_v = _given(table, PIEZO_KEYS)
    layers = PiezoLayers(
        thickness_m=thickness_mm / 1e3,
        youngs_modulus_pa=modulus_gpa * 1e9,
        poisson_ratio=poisson_ratio,
        d31_m_v=d31_pm_v / 1e12,
    )
    if table.carrier_thickness_mm is None:
        return layers
    carrier_mm, carrier_gpa, carrier_ratio = _given(table, CARRIER_KEYS)
    return replace(
        layers,
        carrier_thickness_m=carrier_mm / 1e3,
        carrier_youngs_modulus_pa=carrier_gpa * 1e9,
        carrier_poisson_ratio=carrier_ratio,
    )


def _given(table: ActuatorTable, keys: Iterable[str]) -> list[float]:
    return [getattr(table, key) for key in keys]


def _require_burst(table: BurstTable) -> None:
    """Refuse [burst] by its own name, before the conditions that take it over."""
    if table.file is None:
        _sine(table)
    if table.accept_unfit is not None:
        burst = Burst(frequency_hz=500.0)
        Condition(name="burst", burst=burst, accept_unfit=table.accept_unfit)


def _sine(table: BurstTable | ConditionTable) -> Burst:
    """Return the burst as the file states it; without a window where it is to be chosen."""
    if table.frequency_hz is None or table.cycles is None or table.window is None:
        missing = next(key for key in SINE_KEYS if getattr(table, key) is None)
        raise ValueError(f"{missing} is missing")
    window = "none" if table.window == "auto" else table.window
    return Burst(frequency_hz=table.frequency_hz, cycles=table.cycles, window=window)


def _condition(table: ConditionTable, sample_rate_hz: float) -> Condition:
    if table.file is not None:
        burst: Burst | SampledDrive = _sampled(table, sample_rate_hz)
        return Condition(
            name=table.name, burst=burst, accept_unfit=table.accept_unfit, file=table.file
        )
    burst, auto = _sine(table), None
    if table.wanted_level_db is not None:
        auto = AutoWindow(wanted_level_db=table.wanted_level_db, stated_s=burst.duration_s)
    if table.auto_cycles is not None and table.auto_window is not None:
        burst = replace(burst, cycles=table.auto_cycles, window=table.auto_window)
    return Condition(name=table.name, burst=burst, accept_unfit=table.accept_unfit, auto=auto)


def _sampled(table: ConditionTable, sample_rate_hz: float) -> SampledDrive:
    if table.samples_base64 is None:
        raise ValueError(f"file was not read; got {table.file!r}")
    try:
        data = base64.b64decode(table.samples_base64, validate=True)
        samples = np.frombuffer(data, dtype="<f8")
    except (binascii.Error, ValueError) as error:
        raise ValueError(f"samples_base64 must hold samples; got {error}") from error
    return SampledDrive(samples=samples.astype(np.float64), sample_rate_hz=sample_rate_hz)


def _design(table: DesignTable) -> Design:
    keys = table.model_dump(exclude={"both_level"})
    return Design(**keys, both_level_vpp=None if table.both_level == "random" else table.both_level)


def _simulation(table: SimulationTable) -> Simulation:
    median = Observer(**table.model_dump(exclude={"threshold_sd_db"}))
    return Simulation(median=median, threshold_sd_db=table.threshold_sd_db)


def _screen(table: ScreenTable) -> Screen:
    screen = Screen(**table.model_dump())
    check_screen(screen)
    return screen


def _keys(table: KeysTable) -> Keys:
    keys = Keys(**table.model_dump())
    check_keys(keys)
    return keys


def _texts(table: TextsTable) -> Texts:
    texts = Texts(**table.model_dump())
    check_texts(texts)
    return texts
