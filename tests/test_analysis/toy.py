"""Work to spread that workers can import: drawn numbers, and chunks that end their process."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.workers.chunks import spread
from analysis.workers.kept import Kept

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

STUDIES = 60


@dataclass(frozen=True)
class Studies:
    """Some studies of a point; `lost_once` names a file whose absence ends the process."""

    point: int
    first: int
    last: int
    spin_s: float = 0.0
    lost_once: str = ""


def chunks(size: int, spin_s: float = 0.0) -> list[Studies]:
    """Cut the studies of two points."""
    return [
        Studies(point, first, min(first + size, STUDIES), spin_s)
        for point in range(2)
        for first in range(0, STUDIES, size)
    ]


def draw(chunk: Studies) -> list[tuple[int, float]]:
    """Draw a number a study, each from a seed of its own."""
    until_s = time.process_time() + chunk.spin_s
    while time.process_time() < until_s:
        pass
    if chunk.lost_once and not (lost := Path(chunk.lost_once)).exists():
        lost.touch()
        os._exit(9)
    seeds = ((chunk.point, study) for study in range(chunk.first, chunk.last))
    return [
        (key[1], float(np.random.default_rng(np.random.SeedSequence(7, spawn_key=key)).normal()))
        for key in seeds
    ]


def end_the_process(chunk: Studies) -> None:
    """End whatever computes it, as the system does with one that takes too much memory."""
    os._exit(9)


def begin(
    work: Iterable[Studies], function: Callable[[Studies], object] = draw, **options: Any
) -> Iterator[tuple[Studies, Any]]:
    """Spread work; its results come as they are asked for."""
    return spread(function, work, **options)


def numbers(results: Iterable[tuple[Studies, Any]]) -> list[tuple[int, int, float]]:
    """Return what was drawn, by point and study."""
    return sorted((chunk.point, study, x) for chunk, result in results for study, x in result)


def keeping(path: Path, **changed: object) -> Kept:
    """Open a file that keeps results."""
    return Kept(path, {"study_sha256": "5f" * 32, "seed": 7} | changed)
