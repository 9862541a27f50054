"""Every range that a section of study.toml states: refused just outside, accepted just inside."""

from __future__ import annotations

import base64
import math
import re
from dataclasses import FrozenInstanceError, replace
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import pytest

from experiment import Study, paper_study
from experiment.study.base import file_keys, range_of

if TYPE_CHECKING:
    from collections.abc import Iterator

PLACE = {"side": "left", "x_mm": 0.0, "y_mm": 12.5}
DISC = PLACE | {"diameter_mm": 5.0}
RECTANGLE = PLACE | {"shape": "rectangle", "length_x_mm": 5.0, "length_y_mm": 5.0}
MEASURED = {"measured_displacement_um": 1.0, "measured_at_vpp": 1.0, "measured_at_hz": 1.0}
LAYERS = {
    "piezo_thickness_mm": 0.25,
    "piezo_youngs_modulus_gpa": 62.0,
    "piezo_poisson_ratio": 0.34,
    "piezo_d31_pm_v": -180.0,
    "carrier_thickness_mm": 0.2,
    "carrier_youngs_modulus_gpa": 105.0,
    "carrier_poisson_ratio": 0.35,
}
DENSITIES = {
    "patch_counts": True,
    "piezo_density_kg_m3": 7800.0,
    "carrier_density_kg_m3": 8530.0,
}
FINGERS = {
    "mass_g": 0.3,
    "stiffness_n_m": 600.0,
    "damping_n_s_m": 1.5,
    "holds_up_to_hz": 800.0,
    "source": "ours",
}
METAL = {"youngs_modulus_gpa": 200.0, "poisson_ratio": 0.3, "density_kg_m3": 7900.0}
SIMULATED = {
    "reaction_time_s": 20.0,
    "reaction_time_least_s": 0.0,
    "masking_slope": 0.2,
    "wander_db": 1.0,
    "wander_trials": 9.0,
}
ALL_ANSWERS = ["left", "right", "both", "none"]


def companions(section: str, key: str) -> dict[str, Any]:
    """Return the keys that one needs beside it to be taken at all."""
    if section == "actuator":
        if key.startswith("length"):
            return RECTANGLE
        if key.endswith("density_kg_m3"):
            return DISC | LAYERS | DENSITIES
        groups = {"measured": MEASURED, "piezo": LAYERS, "carrier": LAYERS}
        return DISC | groups.get(key.split("_", maxsplit=1)[0], {})
    if key in {"wanted_level_db", "auto_cycles"}:
        names = {"name": "a"} if section == "condition" else {}
        return names | {"window": "auto", "wanted_level_db": -30.0}
    if section == "condition" and key == "sample_rate_hz":
        samples = np.array([0.0, 1.0, 0.0], dtype="<f8").tobytes()
        return {"name": "a", "file": "a", "samples_base64": base64.b64encode(samples).decode()}
    wide = {"width_mm": 1000.0} if key == "thickness_mm" else {}
    others: dict[str, dict[str, Any]] = {
        "strip": {"edge": "elastic", "edge_stiffness_n": 100.0, "length_mm": 200.0} | METAL | wide,
        "finger_load": FINGERS,
        "condition": {"name": "a"},
        "design": {"responses": ALL_ANSWERS, "levels_vpp": [1.0]},
        "masking": {"max_level_dba": 20.0},
        "contact": {"control": "instructed"},
        "monitor": {"source": "none"},
        "simulation": SIMULATED,
    }
    return others.get(section, {})


def section_of(name: str) -> type:
    """Return the class of a section; of one of several where they are listed."""
    kind = file_keys(Study)[name].annotation
    found: type = get_args(get_args(kind)[0])[0] if get_args(kind) else kind  # type: ignore[assignment]
    return found


def ranges() -> Iterator[Any]:
    """List every key that states a range, and both sides of each of its ends."""
    for name in file_keys(Study):
        for key, field in file_keys(section_of(name)).items():
            kind, listed = field.annotation, False
            limits = range_of(kind, tuple(field.metadata))
            if limits is None and get_args(kind):
                kind, listed = get_args(kind)[0], True
                limits = range_of(kind)
            if limits is None or key == "measured_cutoff_hz":  # which one is, the plate decides
                continue
            whole = "int" in str(kind)
            for end in ("gt", "ge", "le", "lt"):
                bound = getattr(limits, end)
                if bound is None:
                    continue
                away = -1 if end in {"gt", "ge"} else 1
                near = bound + away if whole else math.nextafter(bound, away * math.inf)
                outside = bound if end in {"gt", "lt"} else near
                inside = bound - away * 1e-9 if end in {"gt", "lt"} else bound
                bounds = limits.words(whole=whole)
                yield pytest.param(
                    name, key, outside, inside, bounds, listed, id=f"{name}.{key}-{end}"
                )


@pytest.mark.parametrize(("name", "key", "outside", "inside", "bounds", "listed"), list(ranges()))
def test_a_range_ends_where_its_key_says(
    name: str,
    key: str,
    *,
    outside: float,
    inside: float,
    bounds: str,
    listed: bool,
) -> None:
    def table(value: object) -> dict[str, Any]:
        # these are of two
        beside: dict[str, list[object]] = {
            "foreperiod_s": [value],
            "channels": [100],
            "inputs": [100],
            "delay_ms": [0.0],
        }
        several = [value, *beside.get(key, [])]
        return companions(name, key) | {key: several if listed else value}

    section_of(name)(**table(inside))
    several = name in {"actuator", "condition"}
    path = (f"{name}[0].{key}" if several else f"{name}.{key}") + ("[0]" if listed else "")
    for refused in (outside, math.nan, math.inf, True, "9", *([9.0] if "whole" in bounds else [])):
        tables: dict[str, Any] = {name: [table(refused)] if several else table(refused)}
        with pytest.raises(ValueError, match=re.escape(f"{path} must be {bounds}")):
            Study(**tables)


def test_the_ranges_are_those_of_every_number_that_is_not_a_place() -> None:
    listed = {f"{param.values[0]}.{param.values[1]}" for param in ranges()}
    numbers = {
        f"{name}.{key}"
        for name in file_keys(Study)
        for key, field in file_keys(section_of(name)).items()
        if {"float", "int"} & set(str(field.annotation).replace("'", " ").replace("|", " ").split())
    }
    assert numbers - listed <= {"actuator.x_mm", "actuator.y_mm", "strip.measured_cutoff_hz"}


def test_a_section_that_is_made_anew_is_refused_in_one_line_too() -> None:
    study = paper_study()
    with pytest.raises(ValueError, match=r"^port .*; got ''$"):
        replace(study.device, port="")
    with pytest.raises(ValueError, match=r" colour$"):
        type(study.masking)(colour="pink")  # type: ignore[call-arg]
    with pytest.raises(ValueError, match=r"^design\.break_every .* 0 to .* got -1"):
        study.changed(design={"break_every": -1})
    with pytest.raises(FrozenInstanceError):
        paper_study().design.break_every = 1  # type: ignore[misc]
