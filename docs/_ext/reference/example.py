"""A plate of one's own, from its file to the report of a dry run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reference.markdown import code

if TYPE_CHECKING:
    from reference.sample import Sample

_TITLES = (
    "The plate",
    "Is a stimulus fit for it?",
    "Where the plate moves",
    "A dry run",
)
_TEXTS = (
    (
        "Width, thickness, length, material and edges are given; the burst is the first of those "
        "tried that is fit."
    ),
    (
        "Here the file has two conditions, of one and of two cycles, and trials with the fingers "
        "off the plate."
    ),
    "![The plate moves above the driven disc, and hardly at the other](_site/example/field.png)",
    (
        "Five simulated people on the mock device. Its tables, figures and the report are what the "
        "sessions of real people give."
    ),
)
_REPORT = """\
## The report

One file, without scripts, as any browser shows it:

```{raw} html
<iframe class="report" src="../example/report.html" title="The report of the dry run"></iframe>
<p><a href="../example/report.html">The report on a page of its own</a></p>
```
"""


def page(sample: Sample) -> str:
    """Write the page: each command with what it prints, the field and the report."""
    told = [
        "# An example: a plate of one's own\n",
        (
            "A steel plate of 30 x 0.5 mm, clamped, with two discs. The commands ran when this "
            "site was built.\n"
        ),
    ]
    for title, text, (command, printed) in zip(_TITLES, _TEXTS, sample.printed, strict=True):
        told += [f"## {title}\n", f"{text}\n", code(f"$ {command}\n{printed}")]
    told.append(_REPORT)
    return "\n".join(told)
