"""Who the simulated people of a study are, and what its stimuli ask of their threshold curves."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from statistics import NormalDist, fmean
from typing import TYPE_CHECKING, Any, Final, Literal

from experiment.perception.gains import UNEQUAL_DB
from experiment.perception.thresholds import Vibration
from experiment.study.origins import ASSUMED, YOURS, stated
from experiment.study.simulation import CURVE_KEYS, Simulation
from experiment.study.study import UnusableStudyError
from stimuli import Burst

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.study.equipment import DeviceSettings
    from experiment.study.origins import Origin
    from experiment.study.study import Study


_NEAR_DB: Final = 3.0
"""Levels that end nearer to the threshold leave a part of the median person's curve untried."""
_SEE: Final = "see 'Which levels for a new plate', docs/plate.md."


def threshold_vpp(population: Simulation, gains: FingerGains) -> float:
    """Return the level that the median person feels half of the time, in the middle of fingers."""
    if population.threshold_vpp is not None:
        return population.threshold_vpp
    assert population.threshold_um is not None  # one of the two is given
    return population.threshold_um / _um_per_vpp(gains)


def _um_per_vpp(gains: FingerGains) -> float:
    return math.sqrt(gains.left[0] * gains.right[1])


@dataclass(frozen=True, slots=True, kw_only=True)
class MedianThreshold:
    """What the median person feels half of the time of a condition, and who says so.

    `level_vpp` and `peak_um` are for its burst; `peak_um` is none where no displacement is known.
    Where the same volts move the right finger more, by `right_re_left_db`, the level is between
    those of the two.
    `known` is the number that the study has, in `unit`, and `known_for` what it is known
    for, in words, if that is another vibration than the burst.
    """

    level_vpp: float
    peak_um: float | None
    right_re_left_db: float
    whose: Origin
    known: float
    unit: str
    known_for: str
    sigma: float  # width of the median person's psychometric function, log10 units
    levels_vpp: tuple[float, ...]
    highest: tuple[float, str]  # what no level may exceed, Vpp, and the key that says so

    @property
    def levels_lie(self) -> Literal["around", "below", "above"]:
        """Where the study's levels lie: all on one side of the threshold, or on both."""
        if max(self.levels_vpp) <= self.level_vpp:
            return "below"
        return "around" if min(self.levels_vpp) < self.level_vpp else "above"

    @property
    def words(self) -> str:
        """The threshold in V, and in um where that is known."""
        if self.peak_um is None:
            return f"{self.level_vpp:.3g} V"
        each = [self.level_vpp * 10 ** (sign * self.right_re_left_db / 40) for sign in (1, -1)]
        apart = ": {:.3g} V left, {:.3g} V right".format(*each)
        told = apart if abs(self.right_re_left_db) >= UNEQUAL_DB else ""
        return f"{self.level_vpp:.3g} V ({self.peak_um:.3g} um{told})"

    @property
    def source_words(self) -> str:
        """Who says so, and of which vibration, where that is another one."""
        known = f", {self.known:g} {self.unit}{self.known_for}" if self.known_for else ""
        return f"{'As the study states' if self.whose == YOURS[0] else 'Assumed'}{known}"

    @property
    def source_doubt(self) -> str:
        """What is wrong with a number of another plate; or empty."""
        if self.whose == YOURS[0] or self.unit != "V":
            return ""
        remedy = (
            "what it is in volts on this one is unknown until displacements are measured, or "
            "predicted from the discs' layers"
            if self.peak_um is None
            else "as displacements are known here, state simulation.threshold_um instead"
        )
        return (
            f"It is the paper's, of one cycle of 500 Hz in volts of its own plate: {remedy}; "
            "'Which levels for a new plate', docs/plate.md, tells how."
        )

    @property
    def levels_doubt(self) -> str:
        """What is to be expected of levels on one side of it, or nearly so; or empty."""
        if self.levels_lie != "around":
            (highest_vpp, key), beyond, remedy = self.highest, "", ""
            if highest_vpp < self.level_vpp:
                beyond = f", as does {key} = {highest_vpp:g} V"
                remedy = (
                    "; more cycles or a frequency nearer to 250 Hz are felt more easily, "
                    "or let the plate move more"
                )
            expect = f"expect an open interval, or only a bound{remedy}"
            if self.source_doubt:
                expect = "a dry run has an open interval, or only a bound; people may well differ"
            return f"All levels lie {self.levels_lie} that{beyond}: {expect}; {_SEE}"
        return self._barely

    @property
    def levels_db(self) -> tuple[float, float]:
        """The lowest and the highest level, in dB re the threshold."""
        low_db, high_db = (
            20 * math.log10(one(self.levels_vpp) / self.level_vpp) for one in (min, max)
        )
        return low_db, high_db

    @property
    def _barely(self) -> str:
        """What levels on both sides tell little of that hardly reach beyond it; or empty."""
        low_db, high_db = self.levels_db
        if self.levels_lie != "around":
            return ""
        few_below, few_above = -low_db < _NEAR_DB, high_db < _NEAR_DB
        if not few_below and not few_above:
            return ""
        if few_below and few_above:
            reach = f"from {-low_db:.1f} dB below that to {high_db:.1f} dB above"
            return f"The levels reach only {reach}, a narrow range for people who differ; {_SEE}"
        below = sum(one < self.level_vpp for one in self.levels_vpp)
        count, where = (below, "below") if few_above else (len(self.levels_vpp) - below, "above")
        end = (
            f"the highest {high_db:.1f} dB above"
            if few_above
            else f"the lowest {-low_db:.1f} dB below"
        )
        lie = "lies" if count == 1 else "lie"
        felt = f"the median person would feel about {self.felt:.0%} of the stimuli"
        return f"{count} of {len(self.levels_vpp)} levels {lie} {where} that, {end}: {felt}; {_SEE}"

    @property
    def felt(self) -> float:
        """How many single stimuli the median person feels, where each level comes as often."""
        curve = NormalDist(math.log10(self.level_vpp), self.sigma)
        return fmean(curve.cdf(math.log10(one)) for one in self.levels_vpp)

    @property
    def facts(self) -> dict[str, Any]:
        """The same to other programs."""
        return {
            "threshold_vpp": self.level_vpp,
            "threshold_um": self.peak_um,
            "source": self.whose,
            "levels_lie": self.levels_lie,
            "levels_db": self.levels_db,
            "highest_vpp": self.highest[0],
        }


def median_threshold(
    study: Study, gains: FingerGains, device: DeviceSettings | None = None, *, place: int = 0
) -> MedianThreshold:
    """Return where simulated people's thresholds lie for one of the conditions, by its place.

    `gains` are those of that condition, `device` the settings in use, where they are others than
    the study's.
    """
    people = study.simulation
    key, unit = ("threshold_vpp", "V") if people.threshold_um is None else ("threshold_um", "um")
    both = vibrations(study).get(study.conditions[place].name, ())
    shift_db = sum(people.known_for.shift_db(one) for one in both) / 2
    shift_db += (people.difference_db or 0.0) * (place == 1)
    level_vpp = threshold_vpp(people, gains) * 10 ** (shift_db / 20)
    return MedianThreshold(
        level_vpp=level_vpp,
        peak_um=None if gains.basis is None else level_vpp * _um_per_vpp(gains),
        right_re_left_db=gains.right_re_left_db,
        whose=(stated(people, key, by_value=False) or ASSUMED)[0],
        known=getattr(people, key),
        unit=unit,
        known_for=people.known_for.words if both else "",
        sigma=people.sigma,
        levels_vpp=study.design.levels_vpp,
        highest=(study.device if device is None else device).highest,
    )


def people_words(
    study: Study, gains: Sequence[FingerGains], device: DeviceSettings | None = None
) -> tuple[str, ...]:
    """Say where simulated people's thresholds lie, who says so, and what it makes of the levels.

    `gains` are those of each condition, `device` the settings in use.

    >>> from experiment.study.files import study_from_text
    >>> from experiment.perception.gains import OWN_FINGER_ONLY
    >>> text = "simulation = { threshold_vpp = 100 }"
    >>> print(*people_words(study_from_text(text, "study.toml"), [OWN_FINGER_ONLY]))
    As the study states: median threshold 100 V, SD between people 1.5 dB.
    """
    every = [
        median_threshold(study, fingers, device, place=place) for place, fingers in enumerate(gains)
    ]
    medians, doubts = every[0].words, [every[0].source_doubt, every[0].levels_doubt]
    if len(every) > 1:
        named = list(zip((one.name for one in study.conditions), every, strict=True))
        medians = ", ".join(f"{one.words} in {name}" for name, one in named)
        doubts[1:] = [f"In {name}: {one.levels_doubt}" for name, one in named if one.levels_doubt]
    spread = f"SD between people {study.simulation.threshold_sd_db:g} dB"
    words = f"{every[0].source_words}: median threshold {medians}, {spread}."
    doubt = " ".join(filter(None, doubts))
    return (words, doubt) if doubt else (words,)


def people_for_burst(study: Study) -> Simulation:
    """Return the people with their threshold for the first condition's burst, which has no curve.

    UnusableStudyError where fingers of two sizes have two thresholds.

    >>> from experiment.study.files import study_from_text
    >>> text = "simulation = { threshold_vpp = 70, threshold_at_hz = 250 }"
    >>> people = people_for_burst(study_from_text(text, "study.toml"))
    >>> people.threshold_vpp > 70, people.threshold_at_hz  # the paper's burst has 500 Hz
    (True, None)
    """
    people = study.simulation
    both = vibrations(study).get(study.conditions[0].name, ())
    if not both:
        return people
    left_db, right_db = (people.known_for.shift_db(one) for one in both)
    if not math.isclose(left_db, right_db, abs_tol=1e-9):
        raise UnusableStudyError(
            study.name,
            "simulation.threshold_at_cm2 must be left out where finger_diameter_mm of the left and "
            "the right actuator differ; got one that gives them "
            f"thresholds {abs(left_db - right_db):.2g} dB apart",
        )
    name = "threshold_vpp" if people.threshold_um is None else "threshold_um"
    known: float = getattr(people, name)
    shifted = {name: known * 10 ** (left_db / 20)}
    return Simulation(**(asdict(people) | dict.fromkeys(CURVE_KEYS) | shifted))


def vibrations(study: Study) -> dict[str, tuple[Vibration, Vibration]]:
    """Return what left and right finger get in each condition; nothing where no curve is used.

    >>> from experiment.study.files import paper_study
    >>> vibrations(paper_study())
    {}
    """
    if not study.simulation.known_for.stated:
        return {}
    return {
        one.name: vibrations_of(study, one.drive)
        for one in study.conditions
        if isinstance(one.drive, Burst)  # others are refused
    }


def vibrations_of(study: Study, burst: Burst) -> tuple[Vibration, Vibration]:
    """Return what the left and the right finger of a study get of a burst."""
    left, right = (
        Vibration(
            frequency_hz=burst.frequency_hz,
            duration_s=burst.energy_duration_s,
            area_cm2=math.pi * (100 * one.finger_diameter_m) ** 2 / 4,
        )
        for one in study.actuators[:2]
    )
    return left, right


def dry_run_difference_db(study: Study, gains: Sequence[ConditionGains]) -> float:
    """Return by how much the second condition's threshold of a dry run lies above the first's.

    In dB of volts: what the study states, the curves of its people and the displacements add up.
    """
    people, both = study.simulation, vibrations(study)
    first_db, second_db = (
        20 * math.log10(threshold_vpp(people, of.fingers()))
        + fmean([people.known_for.shift_db(one) for one in both.get(condition.name, ())] or [0.0])
        for condition, of in zip(study.conditions[:2], gains, strict=False)
    )
    return second_db - first_db + (people.difference_db or 0.0)


def unmeasured(study: Study) -> tuple[str, ...]:
    """Say where the curves that a study uses were not measured, each curve once."""
    every = [one for both in vibrations(study).values() for one in both]
    return study.simulation.known_for.unmeasured(*every)


def unmeasured_words(study: Study) -> str:
    """Say what that makes of the threshold, in a sentence; nothing where curves hold."""
    if not (told := "; ".join(unmeasured(study))):
        return ""
    return f"The threshold lies outside published curves: {told}. A pilot tells the true one."
