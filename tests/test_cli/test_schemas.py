"""The JSON Schemas in docs/schema are those of the program, and its files obey them.

The program has the models of study and journal. The schema of a report is read from reports: its
keys, those that every report has, and the types of their values. ``TACTSTRIP_ACCEPT=1`` writes
the schemas.
"""

from __future__ import annotations

import json
import os
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import jsonschema
import pytest

from experiment.record.entries import LINES
from tests.plates import on_paper_plate

if TYPE_CHECKING:
    from tests.conftest import Run

pytestmark = pytest.mark.slow
SCHEMAS: Final = Path(__file__).parents[2] / "docs" / "schema"
PRESETS: Final = ("paper", "recommended", "realistic")
CHAIN: Final = ("crc", "schema", "seq", "prev", "t_s", "wall_s", "up_s")
"""Members of every line of a journal, beyond those of its event."""
REPORTS: Final = {
    "check": ("check", "study.toml", "--json"),
    "bursts": ("bursts", "study.toml", "--frequency-hz", "300,500", "--cycles", "1", "--json"),
    "field": ("field", "study.toml", "--json"),
    "summary": ("dry-run", "study.toml", "--participants", "2", "--seed", "1", "--no-figures"),
}
DESIGN: Final = """
[design]
levels_vpp = [40, 80, 160]
trials_per_side = 6
blank_trials = 4
"""
TYPES: Final = {bool: "boolean", int: "number", float: "number", str: "string", type(None): "null"}


def schema_of(values: list[Any]) -> dict[str, Any]:
    """Return a schema that these values obey: keys, required keys, and types."""
    objects = [value for value in values if isinstance(value, dict)]
    lists = [value for value in values if isinstance(value, list)]
    types = {TYPES[type(value)] for value in values if type(value) in TYPES}
    schema: dict[str, Any] = {}
    if objects:
        types.add("object")
        keys = sorted({key for value in objects for key in value})
        schema["properties"] = {
            key: schema_of([value[key] for value in objects if key in value]) for key in keys
        }
        schema["required"] = [key for key in keys if all(key in value for value in objects)]
    if lists:
        types.add("array")
        schema["items"] = schema_of([item for value in lists for item in value])
    return {"type": sorted(types)} | schema if types else {}


def test_a_schema_of_values_is_obeyed_by_them_and_not_by_others() -> None:
    values = [{"a": 1, "b": [None, "x"]}, {"a": 2.5}]
    schema = schema_of(values)
    for value in values:
        jsonschema.validate(value, schema)
    others: list[Any] = [{"b": []}, {"a": "1"}, {"a": 1, "b": [2]}, []]
    for other in others:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(other, schema)


def kept(name: str, written: dict[str, Any]) -> dict[str, Any]:
    """Return the schema in docs/schema, which must be the one that the program writes."""
    path = SCHEMAS / f"{name}.schema.json"
    if "TACTSTRIP_ACCEPT" in os.environ:
        path.write_text(json.dumps(written, indent=1) + "\n", encoding="utf-8")
    schema: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    assert schema == written
    return schema


def test_every_preset_obeys_the_schema_that_init_writes(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for preset in PRESETS:
        assert run("init", f"{preset}.toml", "--preset", preset).exit_code == 0
    schema = kept("study", json.loads(Path("study.schema.json").read_text(encoding="utf-8")))
    for preset in PRESETS:
        study = tomllib.loads(Path(f"{preset}.toml").read_text(encoding="utf-8"))
        jsonschema.validate(study, schema)
        study["design"]["trails_per_side"] = 5
        with pytest.raises(jsonschema.ValidationError, match="trails_per_side"):
            jsonschema.validate(study, schema)


def test_every_line_of_a_journal_obeys_the_schema_of_its_models(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    schema = kept("journal", LINES.json_schema(mode="serialization"))
    Path("study.toml").write_text(on_paper_plate(DESIGN), encoding="utf-8")
    session = ("--participant", "01", "--responder", "simulated", "--seed", "1")
    assert run("run", "study.toml", *session).exit_code == 0
    text = Path("results/sub-01/ses-01/journal.jsonl").read_text(encoding="utf-8")
    lines = [json.loads(line) for line in text.splitlines()]
    assert len(lines) > 50
    validator = jsonschema.Draft202012Validator(schema)
    for line in lines:
        validator.validate({name: line[name] for name in line if name not in CHAIN})


@pytest.mark.parametrize("name", REPORTS)
def test_a_report_obeys_its_schema(
    name: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    reports = []
    for text in (DESIGN, f'{DESIGN}responses = ["left", "right", "both", "none"]\n'):
        Path("study.toml").write_text(on_paper_plate(text), encoding="utf-8")
        result = run(*REPORTS[name])
        assert result.exit_code == 0, result.output
        summaries = sorted(Path().glob("dry-run-*/analysis/summary.json"))
        printed = summaries[-1].read_text(encoding="utf-8") if summaries else result.stdout
        reports.append(json.loads(printed))
    schema = kept(name, schema_of(reports))
    for report in reports:
        jsonschema.validate(report, schema)
