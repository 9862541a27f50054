"""The page of the equations names functions that exist."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
NAMED = re.compile(r"`([a-z_]+)\.([A-Za-z_]+)(?:\.([a-z_]+))?`")


def test_every_equation_is_implemented_where_the_page_says() -> None:
    files = {file.stem: file for file in (ROOT / "stimuli").rglob("*.py")}
    found = 0
    for module, name, method in NAMED.findall((ROOT / "docs" / "model.md").read_text()):
        if module == "experiment":
            continue
        path = files[module].relative_to(ROOT).with_suffix("")
        value = getattr(import_module(".".join(path.parts)), name)
        assert not method or hasattr(value, method), f"{module}.{name}.{method}"
        found += 1
    assert found > 60
