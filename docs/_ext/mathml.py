r"""Equations between dollar signs as MathML, which browsers draw without a script or a network.

docutils translates the LaTeX. The number in `\tag{17}` stands beside its equation, whose anchor is
`equation-17`.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_TAG: Final = re.compile(r"\s*\\tag\{(\d+)\}\s*$")


def write_inline(writer: Any, node: nodes.math) -> None:
    """Write an equation within a line."""
    writer.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def write_block(writer: Any, node: nodes.math_block) -> None:
    """Write an equation on a line of its own, with its number if it has one."""
    latex = node.astext().strip()
    tag = _TAG.search(latex)
    number = f'<span class="eqno">({tag[1]})</span>' if tag else ""
    anchor = f' id="equation-{tag[1]}"' if tag else ""
    equation = tex2mathml(_TAG.sub("", latex), as_block=True)
    writer.body.append(f'<div class="equation"{anchor}><div>{equation}</div>{number}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer that `html_math_renderer` names."""
    app.add_html_math_renderer("mathml", (write_inline, None), (write_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
