"""The reference, read from the program by each build of the site; nothing of it is kept by hand."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from reference import commands, example, journal, refusals, study, tables
from reference.api import python
from reference.sample import make_sample

if TYPE_CHECKING:
    from sphinx.application import Sphinx

SITE = "_site"
"""Folder of what becomes a part of the site as it is."""
_INDEX = """\
# Reference

These pages are generated from the program when the site is built.

```{toctree}
:maxdepth: 1

example
study
commands
tables
journal
refusals
/glossary
python
```
"""


def write_reference(folder: Path) -> None:
    """Write every page of the reference into a folder, and the files of its example."""
    with TemporaryDirectory() as place:
        sample = make_sample(Path(place))
        texts = {
            "index.md": _INDEX,
            "study.md": study.page(),
            "commands.md": commands.page(),
            "tables.md": tables.page(sample),
            "journal.md": journal.page(),
            "refusals.md": refusals.page(Path(place)),
            "example.md": example.page(sample),
            **python.pages(),
        }
        for name, text in texts.items():
            put(folder / name, text.encode())
        put(folder / SITE / "journal.schema.json", journal.schema_text().encode())
        for path in (sample.analysis / "report.html", sample.field):
            put(folder / SITE / "example" / path.name, path.read_bytes())


def put(path: Path, data: bytes) -> None:
    """Write a file; one that is as it should be is left alone, so that Sphinx need not read it."""
    if not path.exists() or path.read_bytes() != data:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def _link(*told: Any) -> None:
    """Make links in the lines of a docstring, the last of what Sphinx tells of it."""
    lines = told[-1]
    lines[:] = python.link(lines)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", lambda app, _: write_reference(Path(app.srcdir) / "reference"))
    app.connect("autodoc-process-docstring", _link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
