"""Scenes of the reference values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import stimuli
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    ElasticEdge,
    Fingertip,
    Impedance,
    Layer,
    Load,
    Material,
    Strip,
)

REFERENCE = Path(__file__).with_name("reference")
_EDGES = {"simply supported": SIMPLY_SUPPORTED, "clamped": CLAMPED}


def reference_rows(name: str) -> list[dict[str, Any]]:
    """Return the scenes of a file with their answers."""
    rows: list[dict[str, Any]] = json.loads((REFERENCE / name).read_text("utf-8"))
    return rows


def strip_of(row: dict[str, Any]) -> Strip:
    """Return the strip of a scene."""
    data = {**row["strip"]}
    edge = {**data.pop("edge")}
    kind = edge.pop("kind")
    patches = [
        BondedPatch(**{**patch, "layers": tuple(Layer(**layer) for layer in patch["layers"])})
        for patch in data.pop("patches", ())
    ]
    return Strip(
        **{**data, "material": Material(**data["material"])},
        edge=_EDGES.get(kind) or ElasticEdge(**edge),
        patches=tuple(patches),
    )


def load_of(data: dict[str, Any]) -> Load:
    """Return a load of a scene."""
    values = {**data}
    load: Load = getattr(stimuli, values.pop("kind"))(**values)
    return load


def fingertip_of(data: dict[str, Any]) -> Fingertip:
    """Return a fingertip of a scene."""
    impedance = data["impedance"] and Impedance(**data["impedance"])
    return Fingertip(**{**data, "impedance": impedance})
