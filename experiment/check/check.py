"""What is to be known of a study before anyone takes part: is it fit, and how long does it take."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from device.clock import VirtualClock
from device.drivers import MOCK
from experiment.apparatus.rig import chosen_settings, mock_device
from experiment.apparatus.slots import require_playable, require_suitable, told_limits
from experiment.check.findings import CheckWarning, WarningCode
from experiment.exits import ANSWER_IS_NO, CommandError
from experiment.perception.gains import OWN_FINGERS
from experiment.study.design import ASSUMED_ANSWER_S
from experiment.study.study import UnusableStudyError
from experiment.trial.draw import block_count
from stimuli import Burst, BurstCheck, ElasticEdge, SampledDrive, check_burst

if TYPE_CHECKING:
    from experiment.perception.gains import ConditionGains
    from experiment.study.physics import PatchErrors
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


Verdict = Literal["fit", "accepted", "unfit"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TriedGains:
    """A gain matrix that the check tries beside the plan's, and what it was computed with."""

    gains: ConditionGains
    loss_factor: float | None  # none where the study states its loss
    loaded: bool  # by the fingers


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionCheck:
    """A condition and how its burst goes with the strip and the fingers."""

    condition: Condition
    burst: BurstCheck
    gains: ConditionGains | None  # none where nobody computed it
    # with the least and the greatest loss assumed, where the study states none; with and without
    # the load of the fingers, where it states one
    bracket: tuple[TriedGains, ...]
    # by how much the level at the other finger must lie below that at the own
    masking_limit_db: float
    # where patches count and the gains were computed: the worst of these and those of `bracket`
    patch_errors: PatchErrors | None = None

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the stimulus is unfit, a sentence each; empty if it is fit."""
        return tuple(warning.message for warning in self.warnings)

    @property
    def warnings(self) -> tuple[CheckWarning, ...]:
        """The reasons, each with its code."""
        energy = WarningCode.ENERGY_ABOVE_CUTOFF
        warnings = [CheckWarning(energy, text) for text in self.burst.reasons]
        if self.gains is None:
            return tuple(warnings)
        for own, other in ((0, 1), (1, 0)):
            level_db, limit_db = self.level_db(other, own), -self.masking_limit_db
            errors = self.patch_errors
            doubt_db = 0.0 if errors is None else float(errors.levels_db[other, own])
            if level_db + doubt_db <= limit_db:
                continue
            at = (
                f"the {OWN_FINGERS[own]} actuator's burst is at the {OWN_FINGERS[other]} "
                f"finger {level_db:.3f} dB re its own finger"
            )
            if level_db > limit_db:
                code, reason = WarningCode.CROSSTALK_ABOVE_LIMIT, f"; the limit is {limit_db:g} dB"
            else:
                code = WarningCode.UNCERTAIN_CROSSTALK
                reason = (
                    f", known within {doubt_db:.2g} dB: above the limit of {limit_db:g} dB "
                    "cannot be excluded"
                )
            warnings.append(CheckWarning(code, f"{at}{reason}"))
        return tuple(warnings)

    def worst(self, place: int, actuator: int) -> TriedGains | None:
        """Return what of `bracket` has the greatest level above another actuator.

        Parameters
        ----------
        place, actuator : int
            Row and column of the gain matrix.
        """
        levels = self.bracket
        return max(levels, key=lambda one: one.gains.level_db(place, actuator), default=None)

    def level_db(self, place: int, actuator: int) -> float:
        """Return the level above another actuator: the worst of those in `bracket`, if any."""
        worst = self.worst(place, actuator)
        gains = self.gains if worst is None else worst.gains
        if gains is None:
            raise ValueError(f"condition {self.condition.name} must have gains; got none")
        return gains.level_db(place, actuator)

    @property
    def verdict(self) -> Verdict:
        """``accepted`` where the burst is unfit and the study says why it is wanted."""
        if not self.reasons:
            return "fit"
        return "unfit" if self.condition.accept_unfit is None else "accepted"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyCheck:
    """What the check of a study found.

    Attributes
    ----------
    study : Study
        The study.
    cutoff_hz : float
        First cut-off of its strip.
    conditions : tuple of ConditionCheck
        Its conditions, as listed.
    trials : int
        Trials of all conditions, practice and those with the fingers off the plate left out.
    blocks : int
        Blocks that they are divided into.
    audibility_trials, control_trials : int
        Trials of all conditions with the fingers off the plate, at the beginning and at the end.
    duration_s : float
        Estimated length of a session with all of them: every foreperiod in the middle of its range,
        every answer after `ASSUMED_ANSWER_S`, every break at its shortest.
    """

    study: Study
    cutoff_hz: float
    conditions: tuple[ConditionCheck, ...]
    trials: int
    blocks: int
    audibility_trials: int
    control_trials: int
    duration_s: float

    @property
    def gains(self) -> tuple[ConditionGains, ...]:
        """The gain matrix of every condition, to be sealed into a plan."""
        return tuple(one.gains for one in self.conditions if one.gains is not None)

    @property
    def verdict(self) -> Verdict:
        """The worst of the conditions' verdicts."""
        verdicts = {condition.verdict for condition in self.conditions}
        if "unfit" in verdicts:
            return "unfit"
        return "accepted" if "accepted" in verdicts else "fit"

    @property
    def thinness(self) -> float:
        """(k h)^2 at the cut-off: by about this part the theory of thin plates is wrong there."""
        strip = self.study.strip
        mass_kg_m2 = strip.material.density_kg_m3 * strip.thickness_m
        omega = 2 * math.pi * self.cutoff_hz
        return omega * math.sqrt(mass_kg_m2 / strip.bending_stiffness_n_m) * strip.thickness_m**2

    @property
    def edge_stiffness_n(self) -> float | None:
        """Stiffness of an elastic edge; none for simply supported and clamped ones."""
        edge = self.study.strip.edge
        return edge.stiffness_n if isinstance(edge, ElasticEdge) else None


def check_study(
    study: Study, gains: tuple[ConditionGains, ...] | None = None, *, levels_only: bool = False
) -> StudyCheck:
    """Check every burst of a study against its strip and fingers, and count its trials.

    Parameters
    ----------
    study : Study
        The study.
    gains : tuple of ConditionGains, optional
        The gain matrices as a plan holds them, even if none; computed by default.
    levels_only : bool
        Whether no plan is made of it, so that where levels are those of other losses or without
        fingers the first of these stand for its gain matrices.

    Returns
    -------
    StudyCheck
        The verdict, the cut-off frequency in Hz, the checks of all conditions, the numbers of
        trials and blocks, and the estimated duration in seconds.

    Raises
    ------
    StudyError
        If no device can play a burst at a level, or the design cannot be divided into blocks.

    Examples
    --------
    What the fingers get takes a second or two to compute, and is left out here:

    >>> from experiment.study.files import paper_study
    >>> check = check_study(paper_study(), gains=())
    >>> check.verdict, round(check.cutoff_hz), check.trials, check.blocks
    ('fit', 2900, 155, 5)
    """
    trials = study.design.trials * len(study.conditions)
    bursts = [_check_burst(study, condition) for condition in study.conditions]
    try:
        blocks = block_count(study.design) * len(study.conditions)
        require_playable(study)
    except ValueError as error:
        raise UnusableStudyError(study.name, str(error)) from error
    bracket: tuple[TriedGains, ...] = ()
    errors: list[PatchErrors | None] = [None] * len(study.conditions)
    if gains is None:
        from experiment.study.physics import (
            ASSUMED_LOSS,
            LEAST_LOSS,
            MOST_LOSS,
            patch_errors,
            study_gains,
        )

        stated, load = study.plate.is_loss_stated, study.finger_load.impedance
        losses = (ASSUMED_LOSS,) if stated else (LEAST_LOSS, MOST_LOSS)
        loaded = [load is not None and load.holds_for(one.drive) for one in study.conditions]
        rests = any(loaded)
        planned = not levels_only or (stated and not rests)
        gains = study_gains(study) if planned else None
        if rests or not stated:
            bracket = tuple(
                TriedGains(
                    gains=one, loss_factor=None if stated else loss, loaded=holds and not bare
                )
                for bare in ((False, True) if rests else (True,))
                for loss in losses
                for one, holds in zip(study_gains(study, loss, bare=bare), loaded, strict=True)
            )
        gains = tuple(one.gains for one in bracket) if gains is None else gains
        tried = dict.fromkeys((*[ASSUMED_LOSS] * planned, *losses))
        errors = [
            patch_errors(study, one, tried, (False, True) if holds else (False,))
            for one, holds in zip(study.conditions, loaded, strict=True)
        ]
    gains_of = {one.condition: one for one in reversed(gains)}
    conditions = tuple(
        ConditionCheck(
            condition=condition,
            burst=burst,
            gains=gains_of.get(condition.name),
            bracket=tuple(one for one in bracket if one.gains.condition == condition.name),
            masking_limit_db=study.burst.masking_limit_db,
            patch_errors=error,
        )
        for condition, burst, error in zip(study.conditions, bursts, errors, strict=True)
    )
    return StudyCheck(
        study=study,
        cutoff_hz=study.strip.cutoff_hz(),
        conditions=conditions,
        trials=trials,
        blocks=blocks,
        audibility_trials=study.design.audibility_trials * len(study.conditions),
        control_trials=study.design.control_trials * len(study.conditions),
        duration_s=_duration_s(study, blocks),
    )


def require_mock_suitable(study: Study, driver: str | None = None) -> None:
    """Refuse a study that the mock cannot play, where the mock is what plays it.

    Parameters
    ----------
    study : Study
        The study.
    driver : str, optional
        Instead of the study's. Any other device is asked for itself once it is open.

    Raises
    ------
    StudyError
        If the mock has another sample rate, or a lower ceiling than the study's levels.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> require_mock_suitable(paper_study())
    """
    if (driver or study.device.driver) != MOCK:
        return
    try:
        device = mock_device(study, VirtualClock())
        require_suitable(study, device.open(), told_limits(device))
    except ValueError as error:
        raise UnusableStudyError(study.name, str(error)) from error


def _check_burst(study: Study, condition: Condition) -> BurstCheck:
    try:
        return _check_drive(study, condition.drive)
    except ValueError as error:
        raise UnusableStudyError(
            study.name,
            f"condition {condition.name}: [burst] and device.sample_rate_hz "
            f"do not go together: {error}",
        ) from error


def _check_drive(study: Study, drive: Burst | SampledDrive) -> BurstCheck:
    """Check the energy of a drive above the cut-off; a click's is that of its samples."""
    rate_hz, limit = study.device.sample_rate_hz, study.burst.max_energy_above_cutoff
    if isinstance(drive, Burst):
        return check_burst(
            drive, study.strip, sample_rate_hz=rate_hz, max_energy_above_cutoff=limit
        )
    cutoff_hz = study.strip.cutoff_hz()
    held = SampledDrive(samples=drive.values, sample_rate_hz=drive.sample_rate_hz, held=True)
    return BurstCheck(
        cutoff_hz=cutoff_hz,
        peak_hz=drive.peak_hz(),
        band_hz=drive.band_hz(),
        energy_above_cutoff=drive.energy_above(cutoff_hz),
        staircase_energy_above_cutoff=held.energy_above(cutoff_hz),
        max_energy_above_cutoff=limit,
        sample_rate_hz=rate_hz,
    )


def _duration_s(study: Study, blocks: int) -> float:
    design = study.design
    each = design.trials + design.audibility_trials + design.control_trials
    trials = each * len(study.conditions) + design.practice_trials
    breaks = blocks - 1 + (design.control_trials > 0)
    answer_s = min(ASSUMED_ANSWER_S, design.response_window_s)
    trial_s = sum(design.foreperiod_s) / 2 + answer_s
    return trials * trial_s + breaks * design.minimum_break_s


def require_fit(study: Study, *, driver: str | None = None) -> StudyCheck:
    """Return the check of a study, or end the command where a stimulus of it is unfit.

    Parameters
    ----------
    study : Study
        The study that is to be run.
    driver : str, optional
        Instead of the study's.

    Raises
    ------
    StudyError
        If the study cannot be played.
    CommandError
        With exit code 1, if a burst puts too much energy above the strip's cut-off or is too
        strong at the other finger, and the study does not accept that.
    """
    if driver is not None:
        chosen_settings(study, driver=driver, port=None)
    check = check_study(study)
    require_mock_suitable(study, driver)
    for found in check.conditions:
        if found.verdict == "unfit":
            raise CommandError(
                f"the stimulus of condition {found.condition.name} is unfit for this strip: "
                f'{"; ".join(found.reasons)}; accept_unfit = "reason" runs it on purpose',
                exit_code=ANSWER_IS_NO,
            )
    return check
