"""The keys of JSON reports, which programs rely on: a change of the list is noted in CHANGELOG."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.conftest import Run

KEYS: Final = Path(__file__).parent / "json"
COMMANDS: Final = {
    "check": ("check", "study.toml"),
    "device": ("check", "study.toml", "--device"),
    "bursts": ("bursts", "study.toml", "--frequency-hz", "300,500", "--cycles", "1"),
    "field": ("field", "study.toml"),
}


def key_paths(value: Any, path: str = "") -> Iterator[str]:
    """Yield the paths of a JSON value's keys; the items of a list share theirs."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from key_paths(item, f"{path}.{key}" if path else key)
    elif isinstance(value, list) and value:
        for item in value:
            yield from key_paths(item, f"{path}[]")
    else:
        yield path


@pytest.mark.parametrize("name", COMMANDS)
def test_a_report_has_the_keys_that_programs_rely_on(
    name: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("init", "--preset", "recommended").exit_code == 0
    study = Path("study.toml")
    text = study.read_text(encoding="utf-8")
    # levels above the simulated threshold, for the keys of that warning
    study.write_text(re.sub(r"levels_vpp = .*", "levels_vpp = [60, 95, 130]", text), "utf-8")
    result = run(*COMMANDS[name], "--json")
    assert (result.exit_code, result.stderr, result.stdout.count("\n")) == (0, "", 1)
    keys = "\n".join(sorted(set(key_paths(json.loads(result.stdout))))) + "\n"
    golden = KEYS / f"{name}.txt"
    if "TACTSTRIP_ACCEPT" in os.environ:
        golden.write_text(keys, encoding="utf-8")
    assert keys == golden.read_text(encoding="utf-8")
