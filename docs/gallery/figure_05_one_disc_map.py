"""Figure 5: displacement of the first built plate at 300 Hz, one disc at 50 V peak-to-peak
========================================================================================

The paper measures 1 um above the disc and next to nothing elsewhere. Ours predicts the disc's
moment from its layers (data of the ceramic assumed, see paper_plate.py), which is good to a factor
of 1.5 to 2 at best, on an endless plate without loss whose edge has the measured cut-off of 2.9
kHz. Nothing is fitted.

The number: 1.23 um. The plate is linear, and the 2.6 um that the paper has at 100 V (figure 6) are
1.3 um at 50 V: the paper's own two values differ by 1.3 if "1 um" is meant to the digit.

Usage: python docs/gallery/figure_05_one_disc_map.py [OUT.png]
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from paper_plate import BUZZER, DISC, FIRST, PatchMap, draw_map, patch_map, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def numbers() -> PatchMap:
    """Compute the figure."""
    return patch_map(FIRST, DISC, BUZZER, frequency_hz=300.0, level_vpp=50.0)


def draw(found: PatchMap) -> Figure:
    """Draw the map."""
    return draw_map(found.plate, title="One disc, 300 Hz, 50 Vpp (predicted)")


def main() -> None:
    """Compute, draw and save."""
    save(draw(numbers()), "figure_05.png")


if __name__ == "__main__":
    main()
