"""The reference, read from the program by each build of the site: no page of it is kept by hand."""

from __future__ import annotations

import ast
import inspect
import itertools
import json
import re
import textwrap
from collections.abc import Mapping
from dataclasses import is_dataclass
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from click.testing import CliRunner

import tactstrip
from analysis.axis import VOLTS, Axis
from analysis.results.summary import column_meanings
from device import Refusal
from experiment.record.entries import MEASURED_COLUMNS, StimulusMeasured
from experiment.record.rows import COLUMNS
from experiment.study.base import describe, schema_of
from experiment.study.stimulus import PLANNED_KEYS
from experiment.study.study import section_models

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from sphinx.application import Sphinx

PACKAGES: Final = ("stimuli", "device", "experiment", "analysis")
MAX_REPR: Final = 400
INTERNAL: Final = {
    "stimuli.Estimate": ("kept",),
    "stimuli.Scene": ("check_frequencies",),
    "analysis.ColumnMap": ("conditions", "filter", "form", "ours", "reader", "sources"),
    "analysis.GuessRate": ("log_density", "nodes"),
}
"""Methods that only other modules of the package call."""
_INDEX: Final = """\
# Reference

These pages are generated from the program when the site is built.

```{toctree}
:maxdepth: 1

study
commands
tables
/glossary
python
```
"""
_PYTHON: Final = """\
# Python

The public names of the four packages. The end of a name is its unit. Equations are numbered as
in [the model](/model.md).
"""
_STUDY: Final = """\
# Keys of study files

`[strip]` and an `[[actuator]]` for each site are required. Every other section and key can be
omitted and then has its default. `tactstrip init --all` writes every key as a comment.
"""
_EQUATIONS: Final = re.compile(r"[Ee]quations? \(\d+\)(?:(?:,| and| to) \(\d+\))*")
_PAGE: Final = re.compile(r"docs/([\w/-]+)\.md")


def table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    r"""Write a table; a bar in a cell does not end it.

    >>> print(table(["key"], [["a | b"]]))
    | key |
    |---|
    | a \| b |
    <BLANKLINE>
    """
    cells = [[" ".join(cell.split()).replace("|", r"\|") for cell in row] for row in rows]
    lines = [" | ".join(row) for row in (heading, *cells)]
    return (
        "\n".join(
            [f"| {lines[0]} |", "|---" * len(heading) + "|"] + [f"| {x} |" for x in lines[1:]]
        )
        + "\n"
    )


def literal(text: str) -> str:
    """Write a name of the program; nothing for none."""
    return f"`{text}`" if text else ""


def summary(text: str | None) -> str:
    """Return the first paragraph of a docstring."""
    return " ".join((text or "").strip().partition("\n\n")[0].split()).replace("``", "`")


def constants(module: str) -> dict[str, str]:
    """Return the text below each constant of a module, which Python does not keep.

    >>> constants("experiment.exits")["BAD_INPUT"]
    'Exit code: bad input or usage.'
    """
    texts = {}
    body = ast.parse(inspect.getsource(import_module(module))).body
    for statement, text in itertools.pairwise(body):
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
            targets = getattr(statement, "targets", [getattr(statement, "target", None)])
            for target in targets:
                if isinstance(target, ast.Name):
                    texts[target.id] = inspect.cleandoc(str(text.value.value))
    return texts


def study_keys() -> Iterator[tuple[str, str, str, str, str]]:
    """Yield section, name, meaning, allowed values and default of every key of a study file."""
    for section, model in section_models().items():
        schema = schema_of(model)
        for name, key in schema["properties"].items():
            if section == "condition" and name in PLANNED_KEYS:
                continue
            default = key.get("default")
            written = "" if default is None else literal(json.dumps(default, ensure_ascii=False))
            default_text = "required" if name in schema.get("required", []) else written
            meaning = key.get("description", "").strip()
            yield section, name, meaning, describe(key), default_text


def study_page() -> str:
    """Write the page of study keys."""
    texts, keys = [_STUDY], list(study_keys())
    for section, model in section_models().items():
        rows = [(literal(name), *rest) for of, name, *rest in keys if of == section]
        texts.append(f"## {section}\n\n{summary(model.__doc__)}\n")
        texts.append(table(("key", "meaning", "allowed", "default"), rows))
    return "\n".join(texts)


def exit_codes() -> list[tuple[int, str]]:
    """Return each exit code with its meaning."""
    codes = {0: "done"}
    for module in ("experiment.exits", "tactstrip"):
        for name, text in constants(module).items():
            if text.startswith("Exit code"):
                meaning = text.partition(": ")[2] or text.removeprefix("Exit code ")
                codes.setdefault(getattr(import_module(module), name), meaning.rstrip("."))
    return sorted(codes.items())


def commands_page() -> str:
    """Write the page of commands, with the help of each on 80 columns."""
    texts = ["# Commands and exit codes\n"]
    texts.append(table(("exit code", "meaning"), [(str(n), text) for n, text in exit_codes()]))
    for command in ("", *tactstrip.COMMANDS):
        words = [*filter(None, [command]), "--help"]
        printed = CliRunner().invoke(tactstrip.main, words, prog_name="tactstrip").output
        texts += [f"## tactstrip {command or '--help'}\n", f"```text\n{printed.rstrip()}\n```\n"]
    return "\n".join(texts)


def tables_page() -> str:
    """Write the page of the columns of every table."""
    trials = [
        (
            literal(column.name),
            column.description + (f": {', '.join(column.choices)}" if column.choices else ""),
            column.type + (", or n/a" if column.optional else ""),
        )
        for column in COLUMNS
    ]
    known = {name: str(f.description) for name, f in StimulusMeasured.model_fields.items()}
    known |= {column.name: column.description for column in COLUMNS}
    paths = ((n, path.removeprefix("measured.")) for n, path in MEASURED_COLUMNS.items())
    measured = [(literal(name), known.get(name) or known[path]) for name, path in paths]
    volts = column_meanings(VOLTS)
    others = column_meanings(Axis(unit="UNIT"), one_place=True).items()
    return "\n".join(
        [
            "# Columns of the tables, refusals of a device\n",
            "UTF-8, commas, `n/a` for a missing value. [](/statistics.md) defines the numbers.\n",
            "## trials.csv\n\nOne row for each presented trial, built from the journal.\n",
            table(("column", "meaning", "type"), trials),
            "## measured.csv\n\nOne row for each burst that a monitor measured.\n",
            table(("column", "meaning"), measured),
            "## Tables of an analysis\n\nThe meaning does not depend on the table.\n",
            table(("column", "meaning"), [(literal(n), x) for n, x in volts.items()]),
            "## Levels in another unit\n\nThese columns replace those in volts.\n",
            table(("column", "meaning"), [(literal(n), x) for n, x in others if n not in volts]),
            "## Refusals of a device\n\nThe numbers are those of the [protocol](/protocol.md).\n",
            table(("number", "name", "reason"), [(str(int(r)), r.name, r.text) for r in Refusal]),
        ]
    )


def names(package: str) -> dict[str, str]:
    """Return the public names of a package, each with the module that defines it."""
    stub = Path(str(import_module(package).__file__)).with_suffix(".pyi")
    return {
        alias.name: f"{package}.{node.module}"
        for node in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def aliases() -> dict[str, str]:
    """Return the full name of each public name, so that a type in a docstring becomes a link.

    >>> aliases()["Strip"]
    'stimuli.Strip'
    """
    return {name: f"{package}.{name}" for package in PACKAGES for name in names(package)}


def link(lines: Iterable[str]) -> list[str]:
    """Make links of the equations and pages that a docstring names, but not in its examples.

    >>> link(["See docs/plate.md and equation (31).", ">>> # docs/plate.md"])
    ['See :doc:`docs/plate.md </plate>` and :doc:`equation (31) </model>`.', '>>> # docs/plate.md']
    """
    return [
        line
        if line.lstrip().startswith((">>>", "..."))
        else _PAGE.sub(r":doc:`\g<0> </\1>`", _EQUATIONS.sub(r":doc:`\g<0> </model>`", line))
        for line in lines
    ]


def _entry(package: str, module: str, name: str) -> str:
    """Write a public name of a package as reStructuredText."""
    value, title = getattr(import_module(module), name), f"{package}.{name}"
    head = f"{name}\n{'-' * len(name)}\n\n"
    if inspect.isroutine(value):
        return f"{head}.. autofunction:: {title}\n"
    if inspect.isclass(value):
        options = ["   :members:"] + ["   :undoc-members:"] * issubclass(value, Enum)
        options += ["   :inherited-members:"] * is_dataclass(value)
        options += [f"   :exclude-members: {', '.join(INTERNAL.get(title, ()))}"]
        return "\n".join([f"{head}.. autoclass:: {title}", *options, ""])
    values = value if isinstance(value, Mapping) else {name: value}
    lines = [f"{key} = {item!r}"[:MAX_REPR] for key, item in values.items()]
    text = "\n".join([*link(constants(module)[name].splitlines()), "", "::", ""])
    body = f"{text}\n{textwrap.indent(chr(10).join(lines), '    ')}"
    return f"{head}.. py:data:: {title}\n\n{textwrap.indent(body, '   ')}\n"


def python_pages() -> dict[str, str]:
    """Write a page for each package."""
    tree = "\n".join(f"api/{package}" for package in PACKAGES)
    pages = {"python.md": f"{_PYTHON}\n```{{toctree}}\n:maxdepth: 1\n\n{tree}\n```\n"}
    for package in PACKAGES:
        about = inspect.cleandoc(import_module(package).__doc__ or "")
        entries = [_entry(package, module, name) for name, module in sorted(names(package).items())]
        title = f"{package}\n{'=' * len(package)}\n"
        pages[f"api/{package}.rst"] = "\n".join([title, f"{about}\n", *entries])
    return pages


def write_reference(folder: Path) -> None:
    """Write every page; one that has not changed is left alone, so that Sphinx does not read it."""
    texts = {
        "index.md": _INDEX,
        "study.md": study_page(),
        "commands.md": commands_page(),
        "tables.md": tables_page(),
        **python_pages(),
    }
    for name, text in texts.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")


def _link_docstring(*event: Any) -> None:
    """Make links in the lines of a docstring, the last argument of the event."""
    event[-1][:] = link(event[-1])


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", lambda app, _: write_reference(Path(app.srcdir) / "reference"))
    app.connect("autodoc-process-docstring", _link_docstring)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
