"""The study as physics: its strip, loads and fingertips, and the gain matrix computed from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from experiment.perception.gains import ConditionGains, significant
from experiment.study.actuator import SIZE_KEYS
from experiment.study.base import Fault
from stimuli import Fingertip
from stimuli.errors import PlateError, Rule

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from experiment.study.stimulus import Condition
    from experiment.study.study import Study
    from stimuli import Load, Strip, WindowChoice
    from stimuli.drive.sampled import Drive
    from stimuli.fingers.actuator import Basis
    from stimuli.plate.response import Estimate


ASSUMED_LOSS: Final = 0.01
"""Loss factor of a plate whose study states none: the middle of what glued aluminium shows."""

MIN_LOSS, MAX_LOSS = 0.005, 0.02
"""Between these it is likely to lie; a stimulus has to be fit with both."""

_RULES: Final = {
    Rule.ABOVE_FIRST_MODE: "must be below {first_hz:.6g} Hz, the first mode of this plate: above "
    "it, the displacement depends on the loss as much as on the actuator",
    Rule.UNCERTAIN_PEAK: "the peak at the {actuator.label} actuator's finger ({size}) has an error "
    "of {error_percent:.1f} % (at most {max_percent:g} %); take an actuator of another size or "
    "place, or leave its stiffness and mass out with patch_counts = false",
    Rule.TOO_MANY_FUNCTIONS: "a plate of length_mm = {plate.length_mm}, width_mm = "
    "{plate.width_mm:.6g} and thickness_mm = {plate.thickness_mm:.6g} needs {n_functions} "
    "functions for a drive with its peak at {peak_hz:.6g} Hz (at most {max_functions}); take a "
    "lower frequency, or a shorter, narrower or thicker plate",
    Rule.DRIVE_OUT_OF_RANGE: "a plate of width_mm = {plate.width_mm:.6g} and thickness_mm = "
    "{plate.thickness_mm:.6g} is computed for drives of at most {max_s:g} s with a band below "
    "{max_hz:.6g} Hz; this one lasts {duration_s:.6g} s, with its peak at {peak_hz:.6g} Hz; take a "
    "lower frequency, or a narrower or thicker plate",
    Rule.LEVEL_NOT_REACHED: "must be at least {lowest_db:.2f}, which {cycles} cycles with window "
    "{window} leave",
}
"""What a study must change where the physics refuses it, in the names of its keys."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeakErrors:
    """How well the displacements at the fingers are known.

    Attributes
    ----------
    driven : float
        Relative error of the displacements at the driven fingers, the worst.
    levels_db : ndarray of float64, shape (n_fingers, n_actuators)
        Error of the crosstalk.
    """

    driven: float
    levels_db: NDArray[np.float64]


def study_gains(
    study: Study, loss_factor: float = ASSUMED_LOSS, *, bare: bool = False
) -> tuple[ConditionGains, ...]:
    """Return the gain matrix of every condition of a study, equation (30).

    Parameters
    ----------
    study : Study
        The study.
    loss_factor : float
        Of a plate with ends whose study states no loss.
    bare : bool
        Whether the load of the fingers is left out, if the study states one.

    Returns
    -------
    tuple of ConditionGains
        In the order of the study's conditions.

    Raises
    ------
    StudyError
        If the displacement of an actuator cannot be had from what is stated of it, or the field of
        the strip cannot be computed.

    Examples
    --------
    The paper's discs, 2.6 um of amplitude at 100 Vpp and 300 Hz, do a little more in the burst,
    and the other finger gets about 25 dB less:

    >>> from experiment.study.files import paper_study
    >>> (gains,) = study_gains(paper_study())
    >>> 0.025 < gains.per_vpp[0][0] < 0.03, -25 < gains.level_db(1, 0) < -24.5
    (True, True)
    """
    labels = tuple(actuator.label for actuator in study.actuators)
    strip = field_strip(study, loss_factor)
    per_volt = loads_per_volt(study)  # of the bare plate, as it was measured
    bases = tuple(basis for _, basis in per_volt)
    matrices = []
    for condition in study.conditions:
        peaks_m = _peaks_m(study, strip, fingertips_of(study, bare=bare), condition)
        # A level in Vpp is twice the amplitude; 1e6 um are 1 m. A column without a load per volt is
        # relative to the actuator's finger.
        factors = [
            1 / driven_m if load_per_v is None else 1e6 * load_per_v / 2
            for driven_m, (load_per_v, _) in zip(np.diag(peaks_m), per_volt, strict=True)
        ]
        gains = (np.array(factors) * peaks_m).tolist()
        per_vpp = tuple(tuple(map(significant, row)) for row in gains)
        matrices.append(
            ConditionGains(condition=condition.name, actuators=labels, bases=bases, per_vpp=per_vpp)
        )
    return tuple(matrices)


def driven_per_load_m(study: Study) -> float:
    """Return what unit loads do at their own fingers, in m, under the first condition's burst.

    The geometric mean of left and right, which is known even where no displacement per volt is: it
    compares bursts.
    """
    peaks_m = _peaks_m(study, field_strip(study), fingertips_of(study), study.conditions[0])
    return math.sqrt(peaks_m[0, 0] * peaks_m[1, 1])


def loads_per_volt(
    study: Study, strip: Strip | None = None
) -> list[tuple[float | None, Basis | None]]:
    """Return the unit loads per volt of amplitude of every actuator, and what they rest on.

    Parameters
    ----------
    study : Study
        The study.
    strip : Strip, optional
        Its plate, such as the one without patches; `field_strip(study)` by default.

    Returns
    -------
    list of (float or None, str or None)
        For each actuator; none and none where its displacement is not known.

    Raises
    ------
    StudyError
        If the displacement of an actuator cannot be had from what is stated of it.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> [basis for _, basis in loads_per_volt(paper_study())]
    ['measured', 'measured']
    """
    from stimuli.fingers.actuator import loads_per_volt as solve

    strip = field_strip(study) if strip is None else strip
    known = [number for number, actuator in enumerate(study.actuators) if actuator.basis]
    loads = tuple(study.actuators[number].load for number in known)
    bases = tuple(basis for actuator in study.actuators if (basis := actuator.basis))
    per_volt: list[tuple[float | None, Basis | None]] = [(None, None)] * len(study.actuators)
    try:
        solved = solve(strip, loads, bases) if known else ()
    except PlateError as error:
        actuator = study.actuators[known[int(error.values.get("load", 0))]]
        key = f"actuator[{study.actuators.index(actuator)}].measured_at_hz"
        fault = Fault(key, _rule_of(error, study), actuator.measured_at_hz)
        raise study.refused(fault) from error
    except ValueError as error:
        rule = f"the displacement of the actuators: {_rule_of(error, study)}"
        raise study.refused(Fault("", rule)) from error
    for number, load in zip(known, solved, strict=True):
        is_assumed = study.actuators[number].assumed_equal_to
        per_volt[number] = (load.load_per_v, "predicted" if is_assumed else load.basis)
    return per_volt


def _peaks_m(
    study: Study, strip: Strip, tips: tuple[Fingertip, ...], condition: Condition
) -> NDArray[np.float64]:
    """Return the peaks of unit loads driven by the burst as it is played: with a peak of 1."""
    from experiment.study.stimulus import unscaled_peak

    try:
        peaks = peaks_of(strip, loads_of(study), tips, condition.drive)
    except ValueError as error:
        rule = _rule_of(error, study, condition.drive.peak_hz())
        fault = Fault("", f"condition {condition.name}: displacement: {rule}")
        raise study.refused(fault) from error
    scaled: NDArray[np.float64] = peaks.value / unscaled_peak(condition, study.device)
    return scaled


@lru_cache(maxsize=16)
def peaks_of(
    strip: Strip, loads: tuple[Load, ...], tips: tuple[Fingertip, ...], drive: Drive
) -> Estimate[NDArray[np.float64]]:
    """Return the peak displacements at fingertips, kept for all that a check asks of one plate.

    ValueError as for `fingertip_peaks`.
    """
    from stimuli.fingers.peaks import fingertip_peaks

    return fingertip_peaks(strip, loads, tips, drive)


def _rule_of(error: ValueError, study: Study, peak_hz: float = 0.0) -> str:
    """Return the rule that a study violates, in the names of its keys."""
    if not isinstance(error, PlateError) or error.rule not in _RULES:
        return str(error)
    values = error.values
    actuator = study.actuators[int(values.get("load", 0))]
    sizes_mm = {key: getattr(actuator, key) for key in SIZE_KEYS}
    size = ", ".join(f"{key} = {mm:.6g}" for key, mm in sizes_mm.items() if mm is not None)
    return _RULES[error.rule].format(
        **values, plate=study.plate, actuator=actuator, size=size, peak_hz=peak_hz
    )


def loads_of(study: Study) -> tuple[Load, ...]:
    """Return the load of each actuator of a study: a bonded patch of 1 N m per metre, or 1 N.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    tuple of Load
        In the order of the study's actuators; a disc is a `MomentDisc`, a rectangle a
        `MomentRectangle`, a motor a `ForceRectangle` over its contact.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> left, right = loads_of(paper_study())
    >>> left.x_m == -right.x_m, left.radius_m
    (True, 0.0064)
    """
    return tuple(actuator.load for actuator in study.actuators)


def fingertips_of(study: Study, *, bare: bool = False) -> tuple[Fingertip, ...]:
    """Return the fingertip above the centre of each actuator: left, right, then the others.

    Parameters
    ----------
    study : Study
        The study.
    bare : bool
        Whether the load of the two fingers is left out, if the study states one.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> [(finger.x_m, finger.radius_m) for finger in fingertips_of(paper_study())]
    [(-0.035, 0.005), (0.035, 0.005)]
    """
    load = None if bare else study.finger_load.impedance
    return tuple(
        Fingertip(
            x_m=actuator.x_m,
            y_m=actuator.y_m,
            radius_m=actuator.finger_diameter_m / 2,
            impedance=None if actuator.site is None else load,
        )
        for actuator in study.actuators
    )


def field_strip(study: Study, loss_factor: float = ASSUMED_LOSS) -> Strip:
    """Return the plate of a study with the patches that count, and a loss where it states none.

    Parameters
    ----------
    study : Study
        The study.
    loss_factor : float
        Of a plate with ends whose study states no loss.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> strip = field_strip(paper_study())
    >>> strip.length_m, strip.material.loss_factor
    (0.2, 0.01)
    """
    counted = tuple(actuator.patch for actuator in study.actuators if actuator.patch is not None)
    material = study.strip.material
    if not study.plate.has_loss_factor:
        material = replace(material, loss_factor=loss_factor)
    return replace(study.strip, material=material, patches=counted)


def peak_errors(
    study: Study,
    condition: Condition,
    losses: Iterable[float] = (ASSUMED_LOSS,),
    bare: Iterable[bool] = (False,),
) -> PeakErrors:
    """Return how well the displacements at the fingers are known.

    The worst of several loss factors, where the study states none, with and without the fingers.
    """
    strips = tuple(dict.fromkeys(field_strip(study, loss) for loss in losses))
    peaks = (
        peaks_of(strip, loads_of(study), fingertips_of(study, bare=without), condition.drive)
        for strip, without in product(strips, bare)
    )
    error = np.max([estimate.error / estimate.value for estimate in peaks], axis=0)
    levels_db = 20 * np.log10((1 + error) * (1 + np.diag(error)))
    return PeakErrors(driven=float(np.max(np.diag(error))), levels_db=levels_db)


def chosen_window(study: Study, condition: Condition) -> WindowChoice:
    """Return the shortest standard burst that does what ``window = "auto"`` asks for.

    Where no loss is stated it has to do so with the least and with the greatest that is assumed.
    ValueError where none keeps the crosstalk below the limit.
    """
    max_crosstalk_db = condition.max_crosstalk_db
    if max_crosstalk_db is None:
        raise ValueError(f"condition {condition.name}: must have window = auto")
    strip, *also = dict.fromkeys(field_strip(study, loss) for loss in (MIN_LOSS, MAX_LOSS))
    n_driven = len(study.driven)
    loads, tips = loads_of(study)[:n_driven], fingertips_of(study)[:n_driven]
    try:
        return _shortest_window(
            strip, loads, tips, condition.sine, max_crosstalk_db, also=tuple(also)
        )
    except PlateError as error:
        key = study.stimulus_key(condition, "max_crosstalk_db")
        raise study.refused(Fault(key, _rule_of(error, study), max_crosstalk_db)) from error


@lru_cache(maxsize=8)
def _shortest_window(*setting: Any, also: tuple[Strip, ...]) -> WindowChoice:
    """Choose once: a check asks for what was found when its study was read."""
    from stimuli import shortest_window

    return shortest_window(*setting, also=also)
