"""Every range in the schema of a study file: refused just outside, accepted just inside."""

from __future__ import annotations

import base64
import json
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ValidationError

from experiment import Study, StudyError, paper_study, study_from_text
from experiment.study.base import describe, schema_of
from tests.plates import on_paper_plate, toml

if TYPE_CHECKING:
    from collections.abc import Iterator

PLACE = {"site": "left", "x_mm": 0.0, "y_mm": 12.5}
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
    "min_reaction_time_s": 0.0,
    "masking_slope": 0.2,
    "wander_db": 1.0,
    "wander_trials": 9.0,
}
BESIDE = {"foreperiod_s": 60.0, "channels": 100, "inputs": 100, "delay_ms": 0.0, "per_volt": 1.0}
"""The second value of pairs."""


def companions(section: str, key: str) -> dict[str, Any]:
    """Return the keys that another needs beside it."""
    if section == "actuator":
        if key.startswith("length"):
            return RECTANGLE
        if key.endswith("density_kg_m3"):
            return DISC | LAYERS | DENSITIES
        groups = {"measured": MEASURED, "piezo": LAYERS, "carrier": LAYERS}
        return DISC | groups.get(key.split("_", maxsplit=1)[0], {})
    if key in {"max_crosstalk_db", "auto_cycles"}:
        return {"window": "auto", "max_crosstalk_db": -30.0}
    if section == "condition" and key == "sample_rate_hz":
        samples = np.array([0.0, 1.0, 0.0], dtype="<f8").tobytes()
        return {"file": "a", "samples_base64": base64.b64encode(samples).decode()}
    wide = {"width_mm": 1000.0} if key == "thickness_mm" else {}
    plate = {"width_mm": 25.0, "thickness_mm": 0.5, "length_mm": 200.0} | METAL | wide
    others: dict[str, dict[str, Any]] = {
        "strip": plate | {"edge": "elastic", "edge_stiffness_n": 100.0},
        "finger_load": FINGERS,
        "design": {} if key == "levels_vpp" else {"levels_vpp": [1.0]},
        "masking": {"max_level_dba": 20.0},
        "contact": {"control": "instructed"},
        "monitor": {"source": "none"},
        "simulation": SIMULATED,
        "task": {
            "kind": "amplitude-discrimination",
            **({} if key == "reference_vpp" else {"reference_vpp": 1.0}),
        },
    }
    return others.get(section, {})


def table_schema(section: str) -> dict[str, Any]:
    """Return the schema of a section's table."""
    root = schema_of(Study)
    schema = root["properties"][section]
    name = schema.get("items", schema)["$ref"].rsplit("/", 1)[-1]
    table: dict[str, Any] = root["$defs"][name]
    return table


def numbers(schema: dict[str, Any]) -> Iterator[tuple[dict[str, Any], bool]]:
    """Yield the schemas of numbers in that of a key, and whether they are items of a list."""
    for choice in schema.get("anyOf", [schema]):
        if choice.get("type") in {"number", "integer"}:
            yield choice, False
        elif choice.get("type") == "array":
            item = choice.get("prefixItems", [choice.get("items", {})])[0]
            yield from ((number, True) for number, _ in numbers(item))


def ranges() -> Iterator[Any]:
    """Yield both sides of each end of every range."""
    for section in schema_of(Study)["properties"]:
        for key, schema in table_schema(section)["properties"].items():
            if key == "measured_cutoff_hz":  # the plate decides which is possible
                continue
            for number, is_item in numbers(schema):
                step = number.get("multipleOf", 1) if number["type"] == "integer" else None
                for end, away, is_outside in (
                    ("minimum", -1, False),
                    ("maximum", 1, False),
                    ("exclusiveMinimum", -1, True),
                    ("exclusiveMaximum", 1, True),
                ):
                    if end not in number:
                        continue
                    bound = number[end]
                    near = bound + away * step if step else math.nextafter(bound, away * math.inf)
                    outside = bound if is_outside else near
                    inside = bound - away * 1e-9 if is_outside else bound
                    yield pytest.param(
                        section, key, outside, inside, is_item, id=f"{section}.{key}-{end}"
                    )


def values_of(section: str, key: str, value: object, *, is_item: bool) -> dict[str, Any]:
    pair = [value, BESIDE[key]] if key in BESIDE else [value]
    return companions(section, key) | {key: pair if is_item else value}


@pytest.mark.parametrize(("section", "key", "outside", "inside", "is_item"), list(ranges()))
def test_a_range_ends_where_its_key_says(
    section: str, key: str, *, outside: float, inside: float, is_item: bool
) -> None:
    def faults(value: object) -> list[str]:
        table = values_of(section, key, value, is_item=is_item)
        tables = {section: [table] if section in {"actuator", "condition"} else table}
        try:
            Study.from_tables(tables)
        except StudyError as error:
            return [fault.key for fault in error.faults]
        return []

    several = section in {"actuator", "condition"}
    path = (f"{section}[0].{key}" if several else f"{section}.{key}") + "[0]" * is_item
    assert path not in faults(inside)
    for refused in (outside, math.nan, math.inf, True, "9"):
        assert path in faults(refused), refused


def test_every_number_of_a_study_has_a_range() -> None:
    unbounded = {
        f"{section}.{key}"
        for section in schema_of(Study)["properties"]
        for key, schema in table_schema(section)["properties"].items()
        for number, _ in numbers(schema)
        if not {"minimum", "exclusiveMinimum"} & set(number)
    }
    assert unbounded == set()


def test_every_key_has_a_description() -> None:
    for section in schema_of(Study)["properties"]:
        for key, schema in table_schema(section)["properties"].items():
            assert schema.get("description"), f"{section}.{key}"
            assert "Any" not in describe(schema)


def test_a_section_is_immutable_and_validated_when_it_is_changed() -> None:
    study = paper_study()
    with pytest.raises(StudyError, match="port"):
        study.device.changed(port="")
    with pytest.raises(StudyError, match=r"design\.break_every.*10000.*-1"):
        study.changed(design={"break_every": -1})
    with pytest.raises(ValidationError):
        study.design.break_every = 1
    assert study.changed(design={"levels_vpp": [60, 95]}).design.levels_vpp == (60.0, 95.0)


def test_the_keys_that_a_file_sets_are_known() -> None:
    text = on_paper_plate(toml({"design": {"trials_per_side": 75}, "screen": {"index": 0}}))
    keys = set(study_from_text(text, "s.toml").keys_set)
    assert {"design.trials_per_side", "screen.index", "strip.width_mm"} <= keys
    assert not keys & {"design.both_trials", "actuator[0].y_mm", "simulation.threshold_um"}


def test_a_schema_allows_what_a_study_file_has() -> None:
    schema = json.loads(json.dumps(schema_of(Study)))
    assert {"strip", "actuator"} <= set(schema["required"])
    assert schema["additionalProperties"] is False
