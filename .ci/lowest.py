"""Print the lower bounds of pyproject.toml as constraints: the oldest versions that it allows."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

PROJECT = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]

for requirement in (
    *PROJECT["dependencies"],
    *(
        requirement
        for extra in ("bench", "cluster", "visa", "test")
        for requirement in EXTRAS[extra]
    ),
):
    if bound := re.match(r"([\w-]+)(?:\[\w+\])?>=([\d.]+)", requirement):
        print("{}=={}".format(*bound.groups()))
