"""The study as physics: its strip, loads and fingertips, and the gain matrix computed from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Final

import numpy as np

from experiment.names import inward
from experiment.perception.gains import ConditionGains, significant
from experiment.study.study import UnusableStudyError
from stimuli import Fingertip, ForceRectangle, Load, MomentDisc, MomentRectangle, Strip
from stimuli.fingers.mirrored import to_the_right
from stimuli.motion.modes import AboveFirstModeError
from stimuli.motion.peaks import TOO_MANY_FOR_PATCHES, PatchesUnknownError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from experiment.study.actuator import Actuator
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study
    from stimuli.drive.sampled import Drive
    from stimuli.fingers.work import Felt


ASSUMED_LOSS: Final = 0.01
"""Loss factor of a plate whose study states none: the middle of what glued aluminium shows."""

LEAST_LOSS, MOST_LOSS = 0.005, 0.02
"""Between these it is likely to lie; a stimulus has to be fit with both."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatchErrors:
    """How well displacements are known where patches count.

    Attributes
    ----------
    own : float
        Part of the displacements of the own fingers, the worst.
    levels_db : ndarray of float64, shape (n_fingers, n_actuators)
        Of the levels at the other fingers.
    """

    own: float
    levels_db: NDArray[np.float64]

    @property
    def facts(self) -> dict[str, float]:
        """The worst of each."""
        others = ~np.eye(len(self.levels_db), dtype=bool)
        return {"own": self.own, "level_db": float(np.max(self.levels_db[others]))}

    @property
    def words(self) -> str:
        """The same in words."""
        return (
            f"patches counted: own fingers known within {self.own:.1%}, levels within "
            f"{self.facts['level_db']:.2g} dB"
        )


def study_gains(
    study: Study, loss_factor: float = ASSUMED_LOSS, *, bare: bool = False
) -> tuple[ConditionGains, ...]:
    """Return the gain matrix of every condition of a study, equation (71).

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
    tips = fingertips_of(study, bare=bare)
    return tuple(
        ConditionGains(
            condition=condition.name,
            actuators=labels,
            bases=tuple(basis for _, basis in per_volt),
            per_vpp=_per_vpp(_felt_m(study, strip, tips, condition), [one for one, _ in per_volt]),
        )
        for condition in study.conditions
    )


def own_per_load_m(study: Study) -> float:
    """Return what unit loads do at their own fingers, in m, under the first condition's burst.

    The geometric mean of left and right, which is known even where no displacement per volt is: it
    compares bursts.
    """
    peaks_m = _felt_m(study, field_strip(study), fingertips_of(study), study.conditions[0])
    return math.sqrt(peaks_m[0, 0] * peaks_m[1, 1])


def loads_per_volt(
    study: Study, strip: Strip | None = None
) -> list[tuple[float | None, str | None]]:
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
    from stimuli import load_per_volt

    strip = field_strip(study) if strip is None else strip
    found: list[tuple[float | None, str | None]] = []
    for actuator, load in zip(study.actuators, loads_of(study), strict=True):
        if actuator.basis is None:
            found.append((None, None))
            continue
        try:
            known = load_per_volt(strip, to_the_right(strip, load), actuator.basis)
        except AboveFirstModeError as error:
            first, ends = ("cut-off", "") if strip.length_m is None else ("mode", "its ends and ")
            named = f"the plate's first {first}, {inward(error.first_hz, least=False)} Hz"
            raise UnusableStudyError(
                study.name,
                f"the {actuator.label} actuator: measured_at_hz must lie below {named}, from where "
                f"on its motion depends on {ends}its loss as much as on the actuator; got "
                f"{actuator.measured_at_hz:.10g}: measure at a lower frequency",
            ) from error
        except ValueError as error:
            too_many = str(error).startswith(TOO_MANY_FOR_PATCHES)
            why = _long_in_keys(study) if too_many else error
            raise UnusableStudyError(
                study.name, f"the displacement of the {actuator.label} actuator: {why}"
            ) from error
        found.append((known.load_per_v, "predicted" if actuator.alike else known.basis))
    return found


def _per_vpp(
    per_load_m: NDArray[np.float64], loads_per_v: list[float | None]
) -> tuple[tuple[float, ...], ...]:
    """Return the matrix of a condition; a column without a load per volt is relative."""
    columns = []
    for place, load_per_v in enumerate(loads_per_v):
        column = per_load_m[:, place]
        # a level in Vpp is twice the amplitude; 1e6 um are 1 m
        factor = 1 / column[place] if load_per_v is None else 1e6 * load_per_v / 2
        columns.append([significant(float(gain)) for gain in factor * column])
    return tuple(zip(*columns, strict=True))


def _felt_m(
    study: Study, strip: Strip, tips: tuple[Fingertip, ...], condition: Condition
) -> NDArray[np.float64]:
    """Return the peaks of unit loads driven by the burst as it is played: with a peak of 1."""
    from experiment.study.stimulus import unscaled_peak

    try:
        found = felt_of(strip, loads_of(study), tips, condition.drive)
    except ValueError as error:
        raise UnusableStudyError(
            study.name,
            f"condition {condition.name}: the displacement: {_in_keys(study, condition, error)}",
        ) from error
    scaled: NDArray[np.float64] = found.peak_m / unscaled_peak(condition, study.device)
    return scaled


@lru_cache(maxsize=16)
def felt_of(
    strip: Strip, loads: tuple[Load, ...], tips: tuple[Fingertip, ...], drive: Drive
) -> Felt:
    """Return what fingertips feel, kept for all that a check asks of the same plate.

    ValueError as for `felt`.
    """
    from stimuli.fingers.work import felt_known

    return felt_known(strip, loads, tips, drive)


def _in_keys(study: Study, condition: Condition, refusal: ValueError) -> str:
    """Say what a field over time refuses by the keys of the study, with what helps."""
    drive, error = condition.drive, str(refusal)
    if isinstance(refusal, PatchesUnknownError):
        return _patch_in_keys(study, refusal)
    if error.startswith(TOO_MANY_FOR_PATCHES):
        return _long_in_keys(study)
    if error.startswith("burst must have its peak"):
        plate = study.plate
        return (
            f"a plate of width_mm = {plate.width_mm:g} and thickness_mm = {plate.thickness_mm:g} "
            f"is too wide and thin for a drive with its peak at {drive.peak_hz():.6g} Hz; take a "
            "lower frequency, or a narrower or thicker plate"
        )
    if error.startswith("rtol must"):
        return (
            f"the drive, with its peak at {drive.peak_hz():.6g} Hz, ends too sharply for this "
            'plate; take a window such as "hann", fade the file out, or state a loss_factor'
        )
    if error.startswith(("fingertips must have no", "length_m must be one whose modes")):
        return (
            "[finger_load] on this plate is not computed to 0.5 %: leave it out, or lower length_mm"
        )
    return error


def _patch_in_keys(study: Study, refusal: PatchesUnknownError) -> str:
    """Say whose patch leaves the displacement unknown; where it has none, any may be it."""
    actuator = study.actuators[refusal.load]
    sizes_mm = {
        "diameter_mm": actuator.diameter_m,
        "length_x_mm": actuator.length_x_m,
        "length_y_mm": actuator.length_y_m,
    }
    size = ", ".join(f"{key} = {1e3 * m:.6g}" for key, m in sizes_mm.items() if m is not None)
    return (
        f"what the fingers get of the {actuator.label} actuator ({size}) on the plate with its "
        f"patches {refusal.words}; leave patches out of the plate's stiffness and mass with "
        "patch_counts = false, or take patches of another size or place"
    )


def _long_in_keys(study: Study) -> str:
    plate = study.strip
    return (
        f"a plate of length_mm = {1e3 * (plate.length_m or 0.0):.6g} and width_mm = "
        f"{1e3 * plate.width_m:.6g} has too many modes for its patches to be counted; "
        "leave their stiffness and mass out with patch_counts = false, or take a shorter plate"
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
    return tuple(_load(actuator) for actuator in study.actuators)


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
            x_m=one.x_m,
            y_m=one.y_m,
            radius_m=one.finger_diameter_m / 2,
            impedance=None if one.side == "other" else load,
        )
        for one in study.actuators
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
    return replace(bare_strip(study, loss_factor), patches=counted)


def bare_strip(study: Study, loss_factor: float = ASSUMED_LOSS) -> Strip:
    """Return the same plate without its patches' stiffness and mass."""
    if study.plate.is_loss_stated:
        return study.strip
    return replace(study.strip, material=replace(study.strip.material, loss_factor=loss_factor))


def patch_errors(
    study: Study,
    condition: Condition,
    losses: Iterable[float] = (ASSUMED_LOSS,),
    bare: Iterable[bool] = (False,),
) -> PatchErrors | None:
    """Return how well the displacements of a plate are known whose patches count; else none.

    The worst of several loss factors, where the study states none, with and without the fingers.
    """
    strips = tuple(dict.fromkeys(field_strip(study, loss) for loss in losses))
    if not strips[0].patches:
        return None
    parts = []
    for strip, without in product(strips, bare):
        tips = fingertips_of(study, bare=without)
        found = felt_of(strip, loads_of(study), tips, condition.drive)
        if found.error_m is not None:
            parts.append(found.error_m / found.peak_m)
    part = np.max(parts, axis=0)
    levels_db = 20 * np.log10((1 + part) * (1 + np.diag(part)))
    return PatchErrors(own=float(np.max(np.diag(part))), levels_db=levels_db)


def _load(actuator: Actuator) -> Load:
    x_m, y_m = actuator.x_m, actuator.y_m
    if actuator.diameter_m is not None:
        return MomentDisc(x_m=x_m, y_m=y_m, radius_m=actuator.diameter_m / 2)
    shape = ForceRectangle if actuator.shape == "motor" else MomentRectangle
    return shape(
        x_m=x_m,
        y_m=y_m,
        length_x_m=actuator.length_x_m or 0.0,
        length_y_m=actuator.length_y_m or 0.0,
    )
