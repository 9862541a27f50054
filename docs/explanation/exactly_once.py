"""Draw exactly_once.png: a trial between journal, program and device, and what a cut makes of it.

Usage: python docs/explanation/exactly_once.py [OUT.png]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

JOURNAL, PROGRAM, DEVICE = 0.5, 2.3, 4.1
LINES = ((JOURNAL, "journal\non disk"), (PROGRAM, "program"), (DEVICE, "device"))
STEPS = (
    (0.7, PROGRAM, JOURNAL, "token 42"),
    (1.7, PROGRAM, DEVICE, "ARM 42"),
    (2.5, PROGRAM, DEVICE, "FIRE 42"),
    (3.7, DEVICE, PROGRAM, "42 fired"),
    (4.6, None, PROGRAM, "key"),
    (5.5, PROGRAM, JOURNAL, "onset, answer,\nend of trial"),
)
CUTS = (
    (-0.2, 0.7, "#F2F2F2", "nothing was done:\nthe trial as planned"),
    (0.7, 2.75, "#DCEAF5", "device: not fired\n→ aborted"),
    (2.75, 5.5, "#FBE3CF", "device: fired\n→ voided"),
    (5.5, 6.3, "#DDF0E4", "the answer stands\n→ ok"),
)
"""Between which heights a program that is killed leaves what; the borders are those of STEPS."""


def draw() -> Figure:
    """Draw it."""
    figure = Figure(figsize=(5.2, 5.6), layout="constrained")
    axes = figure.subplots()
    axes.set(xlim=(-0.35, 7.2), ylim=(7.35, -1.15))
    axes.axis("off")
    for begins, ends, colour, told in CUTS:
        axes.axhspan(begins, ends, color=colour, linewidth=0)
        axes.text(4.75, (begins + ends) / 2, told, va="center", fontsize=9)
    axes.text(4.75, -0.45, "killed here:", fontsize=9, weight="bold")
    for x, name in LINES:
        axes.plot([x, x], [-0.2, 6.3], color="#7F7F7F", linewidth=1)
        axes.text(x, -0.35, name, ha="center", va="bottom", weight="bold", fontsize=10)
    for height, source, target, words in STEPS:
        _arrow(axes, height, source, target, words)
    axes.add_patch(_played())
    axes.text(DEVICE - 0.15, 3.1, "plays", ha="right", va="center", fontsize=9)
    axes.text(
        3.4,
        6.85,
        "If the device was restarted or keeps no tokens it cannot say:\n"
        "aborted and voided then read indeterminate.",
        ha="center",
        va="center",
        fontsize=9,
    )
    return figure


def _arrow(axes: Axes, height: float, source: float | None, target: float, words: str) -> None:
    begins = target - 0.9 if source is None else source
    axes.annotate(
        "",
        (target, height),
        (begins, height),
        arrowprops={"arrowstyle": "-|>", "color": "#0072B2", "shrinkA": 0, "shrinkB": 0},
    )
    axes.text((begins + target) / 2, height - 0.08, words, ha="center", va="bottom", fontsize=9)


def _played() -> Rectangle:
    return Rectangle((DEVICE - 0.09, 2.75), 0.18, 0.7, color="#D55E00")


def main() -> None:
    """Draw and save."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "exactly_once.png")
    draw().savefig(path, dpi=150)
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
