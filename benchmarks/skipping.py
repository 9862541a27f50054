"""What a scene saves by what it does not need, beside a scene that needs it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from benchmarks.tables import csv_table
from benchmarks.timing import duration, processor_s
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    Burst,
    ElasticEdge,
    Fingertip,
    MomentDisc,
    Scene,
    Strip,
    fingertip_peaks,
    response,
)
from stimuli.plate.transient import clear_receptances

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_W: Final = 0.025
_SHIFT_M: Final = 1e-4
"""What takes a load off the centre line, and makes equal loads unequal."""
_FREQUENCIES_HZ: Final = np.linspace(50.0, 6000.0, 100)
_PLATE: Final = Strip(
    width_m=_W,
    thickness_m=0.0005,
    material=dataclasses.replace(ALUMINIUM, loss_factor=0.01),
    edge=CLAMPED,
    length_m=0.2,
)
_DISC: Final = MomentDisc(x_m=-0.035, y_m=_W / 2, radius_m=0.0064)


@dataclass(frozen=True, slots=True, kw_only=True)
class Saving:
    """Two scenes that differ in what has to be solved."""

    what: str
    spared: Callable[[], object]
    needed: Callable[[], object]


def _response(strip: Strip, *loads: MomentDisc) -> Callable[[], object]:
    scene = Scene(strip=strip, loads=loads, points_m=((-0.035, _W / 2), (0.035, _W / 2)))
    return partial(response, scene, _FREQUENCIES_HZ)


def _peaks(strip: Strip) -> Callable[[], object]:
    discs = [dataclasses.replace(_DISC, x_m=x_m) for x_m in (-0.035, 0.035)]
    fingertips = [Fingertip(x_m=disc.x_m, y_m=disc.y_m) for disc in discs]
    burst = Burst(frequency_hz=500.0, cycles=1, window="hann")

    def run() -> object:
        clear_receptances()
        return fingertip_peaks(strip, discs, fingertips, burst)

    return run


def savings() -> Iterator[Saving]:
    """Yield what is left out."""
    edge = ElasticEdge(stiffness_n=140.0)
    yield Saving(
        what="odd waves across: a disc on the centre line, or next to it",
        spared=_response(_PLATE, _DISC),
        needed=_response(_PLATE, dataclasses.replace(_DISC, y_m=_W / 2 + _SHIFT_M)),
    )
    yield Saving(
        what="odd modes along: a disc in the middle of the plate, or next to it",
        spared=_response(_PLATE, dataclasses.replace(_DISC, x_m=0.0)),
        needed=_response(_PLATE, dataclasses.replace(_DISC, x_m=_SHIFT_M)),
    )
    yield Saving(
        what="the rest around equal loads: four discs on a plate of 1 m, equal or not",
        spared=_response(
            dataclasses.replace(_PLATE, length_m=1.0),
            *(dataclasses.replace(_DISC, x_m=x_m) for x_m in (-0.15, -0.05, 0.05, 0.15)),
        ),
        needed=_response(
            dataclasses.replace(_PLATE, length_m=1.0),
            *(
                dataclasses.replace(_DISC, x_m=x_m, radius_m=_DISC.radius_m + x_m * _SHIFT_M)
                for x_m in (-0.15, -0.05, 0.05, 0.15)
            ),
        ),
    )
    yield Saving(
        what="exchange of loss between modes: springs with the loss of the plate, or without",
        spared=_response(
            dataclasses.replace(_PLATE, edge=dataclasses.replace(edge, lossless=False)), _DISC
        ),
        needed=_response(dataclasses.replace(_PLATE, edge=edge), _DISC),
    )
    yield Saving(
        what="the plate beyond 20 widths: peaks on a plate of 30 m, or of 1.2 m",
        spared=_peaks(dataclasses.replace(_PLATE, length_m=30.0)),
        needed=_peaks(dataclasses.replace(_PLATE, length_m=1.2)),
    )


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    rows: list[dict[str, object]] = [
        {
            "left out": saving.what,
            "without it": duration(processor_s(saving.spared, 3)),
            "with it": duration(processor_s(saving.needed, 3)),
        }
        for saving in savings()
    ]
    return "\n".join(
        [
            "## What is left out",
            "",
            "Processor times of responses over 100 frequencies, or of peaks at two fingertips, of",
            "a scene that does not need something and of one that does.",
            "",
            csv_table("skipping", rows),
            "",
        ]
    )
