"""The Python API: what `from stimuli import ...` and its like give, a page for each name."""

from __future__ import annotations

import ast
import inspect
from importlib import import_module
from pathlib import Path
from typing import Final

from reference.constants import constants
from reference.markdown import prose, table

PACKAGES: Final = ("stimuli", "device", "experiment", "analysis")


def names(package: str) -> dict[str, str]:
    """Return the names of a package's face, each with the module that has it."""
    stub = Path(str(import_module(package).__file__)).with_suffix(".pyi")
    return {
        alias.name: f"{package}.{node.module}"
        for node in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def pages() -> dict[str, str]:
    """Write a page for each name, a list for each package and one of all."""
    lists = "\n".join(f"api/{package}" for package in PACKAGES)
    told = {
        "python.md": "# Python\n\nWhat the four packages offer to a program of yours. Whatever is "
        f"not named here may change.\n\n```{{toctree}}\n:maxdepth: 1\n\n{lists}\n```\n"
    }
    for package in PACKAGES:
        about = (import_module(package).__doc__ or "").strip()
        rows, listed = [], []
        for name, module in sorted(names(package).items()):
            said = text(module, name)
            told[f"api/{package}.{name}.rst"] = _page(package, module, name)
            rows.append((f"[{name}]({package}.{name}.rst)", prose(said).split("\n")[0]))
            listed.append(f"{package}.{name}")
        tree = "\n".join(listed)
        told[f"api/{package}.md"] = (
            f"# {package}\n\n{about}\n\n{table(('name', 'what'), rows)}\n"
            f"```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
        )
    return told


def text(module: str, name: str) -> str:
    """Return what a name's docstring says, or what stands below a constant."""
    found = getattr(import_module(module), name)
    if inspect.isclass(found) or inspect.isroutine(found):
        return inspect.getdoc(found) or ""
    return constants(module).get(name, "")


def _page(package: str, module: str, name: str) -> str:
    found = getattr(import_module(module), name)
    title = f"{package}.{name}"
    head = f"{title}\n{'=' * len(title)}\n\n"
    if inspect.isclass(found):
        return f"{head}.. autoclass:: {title}\n   :members:\n"
    if inspect.isroutine(found):
        return f"{head}.. autofunction:: {title}\n"
    return f"{head}.. py:data:: {title}\n\n   {text(module, name)}\n"
