"""Tables of the reference that a phone can show: there each row is a block, each cell a line.

A cell is given its column's heading as a class, by which the style sheet names it.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from docutils import nodes

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_LEAST: Final = 3
"""Columns of a table that does not fit a phone."""


def stack(app: Sphinx, doctree: nodes.document) -> None:
    """Mark the tables of a page of the reference, and their cells."""
    if not app.env.current_document.docname.startswith("reference/"):
        return
    for group in doctree.findall(nodes.tgroup):
        heads = [entry.astext() for head in group.findall(nodes.thead) for entry in head[0]]
        if len(heads) < _LEAST:
            continue
        group.parent["classes"].append("stacked")
        for body in group.findall(nodes.tbody):
            for row in body:
                for head, entry in zip(heads, row, strict=True):
                    name = re.sub(r"\W+", "-", head.lower())
                    entry["classes"] += [f"of-{name}"] if entry.astext() else ["is-empty"]


def setup(app: Sphinx) -> dict[str, bool]:
    """Mark them as each page is read."""
    app.connect("doctree-read", stack)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
