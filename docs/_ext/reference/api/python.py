"""The Python API: what `from stimuli import ...` and its like give, a page for each name."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from dataclasses import is_dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from reference.api.constants import constants
from reference.api.held import attributes, enumerated, held
from reference.markdown import prose, table

if TYPE_CHECKING:
    from collections.abc import Iterable

PACKAGES: Final = ("stimuli", "device", "experiment", "analysis")
# Methods that modules of the same package call. They are no part of what is offered: their values
# have no page, and they may change.
INSIDE: Final = {
    "stimuli.Estimate": ("kept",),
    "stimuli.Scene": ("check_frequencies",),
    "analysis.ColumnMap": ("conditions", "filter", "form", "ours", "reader", "sources"),
    "analysis.GuessRate": ("log_density", "nodes"),
}
_OFFERED: Final = """\
# Python

What the four packages offer to a program of yours. Whatever is not named here may change.

The end of a name is its unit, in SI: `width_m` is in metres, `frequency_hz` in hertz,
`youngs_modulus_pa` in pascals, `density_kg_m3` in kilograms per cubic metre; `level_vpp` is in
volts peak to peak at the actuator, `_db` in decibels relative to what the docstring says. Numbers
without such an end have no unit. Equations are numbered as in [the model](/model.md), sections and
figures of "the paper" are those of [its page](/paper.md).
"""
_EQUATIONS: Final = re.compile(r"[Ee]quations? \(\d+\)(?:(?:,| and| to) \(\d+\))*")
_PAGE: Final = re.compile(r"docs/([\w/-]+)\.md")


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
    told = {"python.md": f"{_OFFERED}\n```{{toctree}}\n:maxdepth: 1\n\n{lists}\n```\n"}
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


def aliases() -> dict[str, str]:
    """Return what each name of a face is called in full, so that a type in a docstring is a link.

    >>> aliases()["Strip"]
    'stimuli.Strip'
    """
    return {name: f"{package}.{name}" for package in PACKAGES for name in names(package)}


def link(lines: Iterable[str]) -> list[str]:
    """Make links of the equations and the pages that a docstring names; its examples stay.

    >>> link(["See docs/plate.md and equation (31).", ">>> # docs/plate.md"])
    ['See :doc:`docs/plate.md </plate>` and :doc:`equation (31) </model>`.', '>>> # docs/plate.md']
    """
    return [line if line.lstrip().startswith((">>>", "...")) else _linked(line) for line in lines]


def _linked(line: str) -> str:
    line = _EQUATIONS.sub(r":doc:`\g<0> </model>`", line)
    return _PAGE.sub(r":doc:`\g<0> </\1>`", line)


def shown(package: str, name: str, value: type) -> list[str]:
    """Return the methods and properties of a class that its page shows.

    >>> from stimuli import Scene
    >>> shown("stimuli", "Scene", Scene)
    ['points']
    """
    inside = INSIDE.get(f"{package}.{name}", ())
    owners = [one for one in value.__mro__ if one is value or is_dataclass(one)]
    found = {
        member
        for owner in owners
        for member, one in vars(owner).items()
        if member[0] != "_" and (isinstance(one, property | classmethod) or inspect.isroutine(one))
    }
    return sorted(member for member in found - {*inside} if inspect.getdoc(getattr(value, member)))


def _page(package: str, module: str, name: str) -> str:
    found = getattr(import_module(module), name)
    title = f"{package}.{name}"
    head = f"{title}\n{'=' * len(title)}\n\n"
    if inspect.isclass(found):
        return f"{head}.. autoclass:: {title}\n{_options(title, found)}\n{_of_class(found)}"
    if inspect.isroutine(found):
        return f"{head}.. autofunction:: {title}\n"
    said = "\n".join(link([*text(module, name).splitlines(), "", *held(found).splitlines()]))
    return f"{head}.. py:data:: {title}\n\n{_indented(said)}\n"


def _options(title: str, kind: type) -> str:
    """Write which members a class's page shows; those of an enumeration are in its table."""
    in_its_table = [*kind.__members__] if issubclass(kind, Enum) else []
    left_out = ", ".join([*INSIDE.get(title, ()), *in_its_table])
    told = ["   :members:"]
    if is_dataclass(kind):
        told.append("   :inherited-members:")
    if left_out:
        told.append(f"   :exclude-members: {left_out}")
    return "\n".join(told) + "\n"


def _of_class(kind: type) -> str:
    """Write what is read from a class itself: members, and fields that carry their meaning."""
    if issubclass(kind, Enum):
        return _indented(f".. rubric:: Members\n\n{enumerated(kind)}")
    listed = attributes(kind) if is_dataclass(kind) else ""
    return _indented(f".. rubric:: Attributes\n\n{listed}") if listed else ""


def _indented(content: str) -> str:
    return textwrap.indent(content, "   ")
