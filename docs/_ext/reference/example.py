"""An example of your own plate, from its file to the report of a dry run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from reference.markdown import code

if TYPE_CHECKING:
    from reference.sample import Sample

_TITLES = (
    "The plate",
    "The check",
    "The displacement of the plate",
    "A dry run",
)
_TEXTS = (
    (
        "The options state width, thickness, length, material and edges; the burst is the shortest "
        "within all limits."
    ),
    "The file now also has two conditions, of one and of two cycles, and hands-off trials.",
    "![The plate moves above the driven disc, and hardly at the other](_site/example/field.png)",
    (
        "Five simulated participants on the mock device. The tables, figures and the report are of "
        "the same form as those of real sessions."
    ),
)
_REPORT = """\
## The report

The report is one file without scripts:

```{raw} html
<iframe class="report" src="../example/report.html" title="The report of the dry run"></iframe>
<p><a href="../example/report.html">The report on its own page</a></p>
```
"""


def page(sample: Sample) -> str:
    """Write the page: each command with what it prints, the field and the report."""
    told = [
        "# An example: your own plate\n",
        (
            "A steel plate of 30 x 0.5 mm, clamped, with two discs. The commands ran when this "
            "site was built.\n"
        ),
    ]
    for title, text, (command, printed) in zip(_TITLES, _TEXTS, sample.printed, strict=True):
        told += [f"## {title}\n", f"{text}\n", code(f"$ {command}\n{printed}")]
    told.append(_REPORT)
    return "\n".join(told)
