"""The people of a study to come: what is stated of them, and where it is from."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Final

from experiment.study.sections.table import stated_of

if TYPE_CHECKING:
    from experiment.study.study import Study
    from experiment.terms.gains import FingerGains
    from experiment.terms.observer import Observer


SPREAD: Final = "threshold_sd_db"
_ALWAYS: Final = (
    "threshold_um", "threshold_vpp", SPREAD, "sigma", "lapse_rate", "false_alarm_rate",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """A number of the population: its key in [simulation], its value, and whose it is."""

    key: str
    value: float
    source: str


def require_spread(study: Study) -> None:
    """Refuse a study that does not state how much people differ: everything hangs on it."""
    keys = stated_of(study.simulation).keys
    if keys is not None and SPREAD in keys:
        return
    raise ValueError(
        f"simulation.{SPREAD} must be stated, how much thresholds differ between people in dB: "
        "in the study, from a pilot (--pilot DIR), or as assumed (--people literature); got none"
    )


def stated_people(study: Study) -> tuple[Stated, ...]:
    """Return the numbers of [simulation] that a study's people are drawn from, with their source.

    Those that always count, and the others that are used.
    """
    section = study.simulation
    stated = stated_of(section)
    keys = stated.keys or {}
    return tuple(
        Stated(
            key=key,
            value=float(value),
            source="stated in the study" if key in keys else "assumed by tactstrip",
        )
        for key, value in asdict(section).items()
        if (key in _ALWAYS or key in keys) and isinstance(value, int | float)
    )


def threshold_vpp(person: Observer, gains: FingerGains) -> float:
    """Return the level that a person feels half of the time, in the middle of both fingers."""
    if person.threshold_vpp is not None:
        return person.threshold_vpp
    assert person.threshold_um is not None  # one of the two is given
    return person.threshold_um / math.sqrt(gains.left[0] * gains.right[1])
