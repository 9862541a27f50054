"""The window that `window = "auto"` comes to, and the shorter bursts that were too loud."""

from __future__ import annotations

from functools import lru_cache
from itertools import groupby
from typing import TYPE_CHECKING, Final

from experiment.study.physics import (
    LEAST_LOSS,
    MOST_LOSS,
    field_strip,
    fingertips_of,
    loads_of,
)

if TYPE_CHECKING:
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study
    from stimuli import Burst, Fingertip, Load, Strip, WindowChoice

_MOST_ROWS: Final = 4
"""So many lines are told; programs are told of all."""


def chosen_window(study: Study, condition: Condition) -> WindowChoice:
    """Return the shortest standard burst that does what ``window = "auto"`` asks for.

    Where no loss is stated it has to do so with the least and with the greatest that is assumed.
    ValueError where none keeps the wanted level at the other finger.
    """
    wanted_level_db = condition.wanted_level_db
    if wanted_level_db is None:
        raise ValueError(
            f"condition {condition.name} must have window = auto; got {condition.window}"
        )
    strip, *also = dict.fromkeys(field_strip(study, loss) for loss in (LEAST_LOSS, MOST_LOSS))
    try:
        return _choice(
            strip,
            loads_of(study)[:2],
            fingertips_of(study)[:2],
            condition.stated,
            wanted_db=wanted_level_db,
            also=tuple(also),
        )
    except ValueError as error:
        told = str(error).replace("wanted_db", "wanted_level_db")
        raise ValueError(f"condition {condition.name}: window = auto: {told}") from error


@lru_cache(maxsize=8)
def _choice(
    strip: Strip,
    loads: tuple[Load, ...],
    tips: tuple[Fingertip, ...],
    burst: Burst,
    *,
    wanted_db: float,
    also: tuple[Strip, ...],
) -> WindowChoice:
    """Choose: a check asks for what was found when its study was read."""
    from stimuli import shortest_window

    return shortest_window(strip, loads, tips, burst, wanted_db, also=also)


def louder_words(choice: WindowChoice) -> list[str]:
    """Say which bursts were tried before the chosen one and how loud they are, cycles by cycles.

    >>> from stimuli import Burst, WindowChoice
    >>> plain, hann = (Burst(frequency_hz=500.0, cycles=1, window=w) for w in ("none", "hann"))
    >>> louder = ((plain, -25.0),)
    >>> louder_words(WindowChoice(burst=hann, level_db=-41.0, extra_s=0.0, louder=louder))
    ['too loud there: 1 cycle: none -25.0 dB']
    """
    rows = []
    for cycles, several in groupby(choice.louder, key=lambda one: one[0].cycles):
        told = ", ".join(f"{burst.window} {level_db:.1f}" for burst, level_db in several)
        rows.append(f"{cycles} cycle{'s' * (cycles > 1)}: {told} dB")
    if len(rows) > _MOST_ROWS:
        rows = [rows[0], "...", *rows[2 - _MOST_ROWS :]]
    return [f"too loud there: {rows[0]}", *rows[1:]] if rows else []
