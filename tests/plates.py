"""Study files for tests that are about other sections than the plate."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tomlkit

import experiment

if TYPE_CHECKING:
    from experiment import Study

PRESETS = Path(experiment.__file__).parent / "study" / "presets"
_CONSTANTS = ("youngs_modulus_gpa", "poisson_ratio", "density_kg_m3")


PAPER_PLATE = "".join(
    f"{section}\n"
    for section in re.split(
        r"\n(?=\[)", (PRESETS / "paper.toml").read_text("utf-8").replace("\n\n", "\n")
    )
    if section.startswith(("[strip]", "[[actuator]]"))
)
"""The sections of the paper's plate and actuators."""


@cache
def _paper() -> dict[str, Any]:
    return tomllib.loads((PRESETS / "paper.toml").read_text("utf-8"))


def on_paper_plate(text: str) -> str:
    """Complete a study file with the paper's plate and actuators where it has none.

    A [strip] may give some keys of another plate; text that is not TOML stays as it is.
    """
    if text.startswith(PAPER_PLATE):
        return text
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError):
        return text
    paper = _paper()
    strip = tables.pop("strip", {})
    if isinstance(strip, dict):
        omitted = {"source"}
        if "material" in strip:
            omitted |= set(_CONSTANTS)
        if strip.get("edge", "measured-cutoff") != "measured-cutoff":
            omitted.add("measured_cutoff_hz")
        plate = {key: value for key, value in paper["strip"].items() if key not in omitted}
        strip = plate | strip
    # first, so that keys can be added to the last section of the text
    return tomlkit.dumps(
        {"strip": strip, "actuator": tables.pop("actuator", paper["actuator"])} | tables
    )


def toml(tables: dict[str, Any]) -> str:
    """Write tables as TOML."""
    return tomlkit.dumps(tables)


def study_from_text(text: str, file_name: str = "study.toml") -> Study:
    """Read a study that has the paper's plate unless its text has another."""
    return experiment.study_from_text(on_paper_plate(text), file_name)
