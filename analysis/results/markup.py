"""HTML built as a tree: text is escaped where it is written, so that none can become markup."""

from __future__ import annotations

import base64
import hashlib
from typing import TYPE_CHECKING, TypeAlias
from xml.etree import ElementTree as ET

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    Content: TypeAlias = str | ET.Element


_PLAIN = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0; background: #fff; color: #1a1a1a; font: 1rem/1.5 system-ui, sans-serif;
  overflow-wrap: break-word; }
main { max-width: 72rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: .5rem 0; }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .5rem; border-bottom: 1px solid #767676; }
p, ul, dl { max-width: 45rem; }
.mark { border: 2px solid #1a1a1a; padding: .5rem .75rem; font-weight: 700; }
figure { margin: 1rem 0; }
img { display: block; width: 100%; max-width: 34rem; height: auto; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .9rem;
  font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 700; padding: .25rem 0; }
th, td { padding: .25rem .8rem .25rem 0; text-align: right; vertical-align: top;
  border-bottom: 1px solid #c8c8c8; }
td { white-space: nowrap; }
thead th { border-bottom: 2px solid #1a1a1a; vertical-align: bottom; }
.text { white-space: normal; }
.text, tbody th, thead th:first-child { text-align: left; }
tbody th { font-weight: 600; }
dt { font-weight: 700; margin-top: .5rem; }
dd { margin: 0 0 0 1rem; }
code { font-size: .85em; }
bdi, code { overflow-wrap: anywhere; }
"""
# A row becomes a block, each value beside the word for it.
_BLOCKS = """
@media screen and (max-width: WIDTH) {
  KIND, KIND tbody, KIND caption { display: block; width: 100%; }
  KIND thead { position: absolute; width: 1px; height: 1px; overflow: hidden;
    clip-path: inset(50%); }
  KIND tr { display: block; border-top: 2px solid #1a1a1a; padding: .25rem 0 .6rem; }
  KIND tbody th { display: block; border: 0; padding: 0; }
  KIND td { display: flex; justify-content: space-between; gap: 1rem; padding: 0 0 0 1rem;
    text-align: right; border: 0; white-space: normal; }
  KIND td:empty { display: none; }
  KIND td::before { content: attr(data-label); text-align: left; flex: none; max-width: 55%; }
}
"""
_PRINT = """
@media print {
  body { font-size: 9pt; }
  main { max-width: none; padding: 0; }
  table { font-size: 7.5pt; }
  .wide { font-size: 6.5pt; }
  th, td { padding-right: .35rem; }
  tr, figure, .mark { break-inside: avoid; }
  h2, caption { break-after: avoid; }
  img { width: auto; max-width: 10cm; max-height: 22cm; }
}
"""
_FEW, _MANY = 3, 8
_WIDTHS = {"table.middle": "48rem", "table.wide": "68rem"}
STYLE = (
    _PLAIN
    + "".join(_BLOCKS.replace("KIND", kind).replace("WIDTH", w) for kind, w in _WIDTHS.items())
    + _PRINT
)


def element(tag: str, *content: Content, **attributes: str) -> ET.Element:
    """Return an element with texts, which are escaped where they are written, and elements in it.

    Of an attribute's name a trailing underscore falls away, another one is a hyphen.

    >>> ET.tostring(element("p", "a < ", element("b", "<script>"), class_='"'), encoding="unicode")
    '<p class="&quot;">a &lt; <b>&lt;script&gt;</b></p>'
    """
    names = {name.removesuffix("_").replace("_", "-"): text for name, text in attributes.items()}
    made = ET.Element(tag, names)
    for one in content:
        if not isinstance(one, str):
            made.append(one)
        elif len(made):
            made[-1].tail = (made[-1].tail or "") + one
        else:
            made.text = (made.text or "") + one
    return made


def foreign(text: str) -> ET.Element:
    """Return a name that came from a file: letters that run right to left stay within it."""
    return element("bdi", text)


def table(
    caption: str,
    header: Sequence[str],
    rows: Iterable[Sequence[Content]],
    texts: Sequence[str] = (),
) -> ET.Element:
    """Return a table; on a screen too narrow for its columns each row is a block of lines.

    The first cell names the row; `texts` are the headers of columns that hold words, not numbers.
    """
    looks = {name: {"class": "text"} if name in texts else {} for name in header}
    # The roles stand, because a table that is displayed as blocks loses them.
    heads = [_cell("th", name, "columnheader", looks[name], scope="col") for name in header]
    body = []
    for first, *rest in rows:
        cells = zip(header[1:], rest, strict=True)
        values = [_cell("td", cell, "cell", looks[name], data_label=name) for name, cell in cells]
        named = _cell("th", first, "rowheader", {}, scope="row")
        body.append(element("tr", named, *values, role="row"))
    look = "small" if len(header) <= _FEW else "middle" if len(header) <= _MANY else "wide"
    return element(
        "table",
        element("caption", caption),
        element("thead", element("tr", *heads, role="row"), role="rowgroup"),
        element("tbody", *body, role="rowgroup"),
        role="table",
        class_=look,
    )


def _cell(
    tag: str, content: Content, role: str, look: dict[str, str], **attributes: str
) -> ET.Element:
    """Return a cell; its content is one element, which stands opposite the label in a block."""
    parts = [] if content == "" else [element("span", content)]
    made = element(tag, *parts, role=role, **attributes)
    made.attrib.update(look)
    return made


def figure(svg: bytes, alt: str) -> ET.Element:
    """Return a figure with the picture in it."""
    source = "data:image/svg+xml;base64," + base64.b64encode(svg).decode("ascii")
    return element("figure", element("img", src=source, alt=alt))


def page(title: str, body: Iterable[ET.Element]) -> str:
    """Return a whole page: it may load nothing but pictures that stand in it, and run nothing.

    >>> text = page("A & B", [element("h1", "A & B")])
    >>> "<title>A &amp; B</title>" in text, "<script" in text
    (True, False)
    """
    digest = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode("ascii")
    policy = (
        f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'; base-uri 'none'; "
        "form-action 'none'"
    )
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=policy),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("link", rel="icon", href="data:,"),
        element("style", STYLE),
    )
    root = element("html", head, element("body", element("main", *body)), lang="en")
    return f"<!DOCTYPE html>\n{ET.tostring(root, encoding='unicode', method='html')}\n"
