"""The check of a study: whether its bursts are within limits, and how long a session takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, get_args

from device.clock import VirtualClock
from device.drivers import MOCK
from experiment.check.warnings import Rule, apply_rules
from experiment.exits import ANSWER_IS_NO, CommandError
from experiment.hardware.setup import chosen_settings, mock_device, read_limits
from experiment.hardware.suitability import require_playable, require_suitable
from experiment.perception.gains import significant
from experiment.study.base import Fault
from experiment.trial.draw import block_count
from stimuli import Burst, BurstCheck, SampledDrive, check_burst

if TYPE_CHECKING:
    from experiment.check.warnings import CheckWarning
    from experiment.perception.gains import ConditionGains
    from experiment.study.physics import PeakErrors
    from experiment.study.plate import EdgeBasis
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


Verdict = Literal["within limits", "accepted", "violates a limit"]
"""From the best to the worst."""

_ALTERNATIVES: Final[dict[str, EdgeBasis]] = {
    "clamped": "simply-supported",
    "simply-supported": "clamped",
}


def alternative_edge(study: Study) -> EdgeBasis | None:
    """Return the other ideal edge, as a real edge lies between the two.

    None for elastic edges and where a cut-off was measured: then it is known how they hold.
    """
    is_measured = study.plate.measured_cutoff_hz is not None
    return None if is_measured else _ALTERNATIVES.get(study.plate.edge)


def with_each_edge(study: Study) -> tuple[Study, ...]:
    """Return the study, and the same study with the alternative edge if there is one.

    >>> from experiment.study.files import paper_study
    >>> paper = paper_study()
    >>> plate = paper.plate.changed(edge="clamped", measured_cutoff_hz=None)
    >>> [study.plate.edge for study in with_each_edge(paper.changed(strip=plate))]
    ['clamped', 'simply-supported']
    >>> len(with_each_edge(paper))
    1
    """
    edge = alternative_edge(study)
    if edge is None:
        return (study,)
    return study, study.changed(strip=study.plate.changed(edge=edge))


@dataclass(frozen=True, slots=True, kw_only=True)
class GainVariant:
    """A gain matrix that the check computes in addition to the plan's, and its assumptions."""

    gains: ConditionGains
    loss_factor: float | None  # None where the study sets its loss
    loaded: bool  # by the fingers


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionCheck:
    """A condition, and its burst compared with the limits of strip and fingers."""

    condition: Condition
    sites: tuple[str, ...]
    burst: BurstCheck
    gains: ConditionGains | None  # None where it was not computed
    # with the least and the greatest loss assumed, where the study sets none; with and without the
    # load of the fingers, where it has one
    variants: tuple[GainVariant, ...]
    # by how much the peak at the undriven finger must lie below that at the driven one
    masking_threshold_db: float
    # where the gains were computed: the worst of these and those of `variants`
    peak_errors: PeakErrors | None = None

    @property
    def reasons(self) -> tuple[str, ...]:
        """Which limits the stimulus violates, a sentence each; empty if it is within limits."""
        return tuple(warning.message for warning in self.violations)

    @property
    def violations(self) -> tuple[CheckWarning, ...]:
        """The limits that the stimulus violates."""
        burst, rules = self.burst, list[Rule]()
        for form, energy in (
            ("ideal burst", burst.energy_above_cutoff),
            ("sampled burst", burst.staircase_energy_above_cutoff),
        ):
            data = {"form": form, "part": energy, "limit": burst.max_energy_above_cutoff}
            rules.append((energy > burst.max_energy_above_cutoff, "energy_above_cutoff", data))
        limit_db = -self.masking_threshold_db
        for driven, site in enumerate(self.sites):
            level_db, error_db = self.crosstalk_of(driven)
            if level_db is not None:
                code = "crosstalk_above_limit" if level_db > limit_db else "uncertain_crosstalk"
                data = {"driven": site, "crosstalk_db": level_db, "error_db": error_db or 0.0}
                is_violated = level_db + (error_db or 0.0) > limit_db
                rules.append((is_violated, code, data | {"limit_db": limit_db}))
        return apply_rules(rules)

    def level_db(self, finger: int, actuator: int) -> float:
        """Return the crosstalk of an actuator at a finger: the worst of the variants, if any."""
        every = [self.gains] if not self.variants else [variant.gains for variant in self.variants]
        return max(gains.level_db(finger, actuator) for gains in every if gains is not None)

    def level_error_db(self, finger: int, actuator: int) -> float | None:
        """Return the error of the crosstalk, the worst of the variants; None where unknown."""
        errors = self.peak_errors
        return None if errors is None else float(errors.levels_db[finger, actuator])

    def peak_um(self, finger: int, actuator: int, level_vpp: float) -> float | None:
        """Return the peak displacement at a finger; None where that of the actuator is unknown."""
        if self.gains is None or self.gains.bases[actuator] is None:
            return None
        return significant(self.gains.per_vpp[finger][actuator] * level_vpp)

    def crosstalk_of(self, driven: int) -> tuple[float | None, float | None]:
        """Return the greatest crosstalk of a driven actuator, and its error; None where unknown.

        It is that at the undriven finger that gets most. A single site has none.
        """
        others = [finger for finger in range(len(self.sites)) if finger != driven]
        if self.gains is None or not others:
            return None, None
        worst = max(others, key=lambda finger: self.level_db(finger, driven))
        return self.level_db(worst, driven), self.level_error_db(worst, driven)

    @property
    def crosstalk_db(self) -> float | None:
        """The greatest crosstalk of all sites; None where it was not computed."""
        levels_db = [self.crosstalk_of(driven)[0] for driven in range(len(self.sites))]
        return max((level_db for level_db in levels_db if level_db is not None), default=None)

    @property
    def crosstalk_error_db(self) -> float | None:
        """The greatest error of all."""
        errors_db = [self.crosstalk_of(driven)[1] for driven in range(len(self.sites))]
        return max((error_db for error_db in errors_db if error_db is not None), default=None)

    @property
    def verdict(self) -> Verdict:
        """``accepted`` if the burst violates a limit and the study states a reason for it."""
        if not self.violations:
            return "within limits"
        return "violates a limit" if self.condition.accept_violation is None else "accepted"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyCheck:
    """The result of the check of a study.

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
    duration_s : float
        Estimated length of a session with all of them: every foreperiod in the middle of its range,
        every answer after `ASSUMED_ANSWER_S`, every break at its shortest.
    """

    study: Study
    cutoff_hz: float
    conditions: tuple[ConditionCheck, ...]
    trials: int
    blocks: int
    duration_s: float

    @property
    def gains(self) -> tuple[ConditionGains, ...]:
        """The gain matrix of every condition, to be sealed into a plan."""
        return tuple(check.gains for check in self.conditions if check.gains is not None)

    @property
    def verdict(self) -> Verdict:
        """The worst of the conditions' verdicts."""
        verdicts = (condition.verdict for condition in self.conditions)
        return max(verdicts, key=get_args(Verdict).index)

    @property
    def crosstalk_db(self) -> float | None:
        """The greatest crosstalk of all conditions; None where it was not computed."""
        levels_db = (check.crosstalk_db for check in self.conditions)
        return max((level for level in levels_db if level is not None), default=None)


def check_study(study: Study, gains: tuple[ConditionGains, ...] | None = None) -> StudyCheck:
    """Check every burst of a study against its strip and fingers, and count its trials.

    Parameters
    ----------
    study : Study
        The study.
    gains : tuple of ConditionGains, optional
        The gain matrices as a plan holds them, even if none; computed by default.

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
    ('within limits', 2900, 155, 5)
    """
    trials = study.design.trials_at(len(study.driven)) * len(study.conditions)
    bursts = [_check_burst(study, condition) for condition in study.conditions]
    try:
        blocks = block_count(study.design, study.task) * len(study.conditions)
        require_playable(study)
    except ValueError as error:
        raise study.refused(Fault("", str(error))) from error
    variants: tuple[GainVariant, ...] = ()
    errors: list[PeakErrors | None] = [None] * len(study.conditions)
    if gains is None:
        from experiment.study.physics import (
            ASSUMED_LOSS,
            MAX_LOSS,
            MIN_LOSS,
            peak_errors,
            study_gains,
        )

        has_loss, load = study.plate.has_loss_factor, study.finger_load.impedance
        losses = (ASSUMED_LOSS,) if has_loss else (MIN_LOSS, MAX_LOSS)
        loaded = [load is not None and load.holds_for(one.drive) for one in study.conditions]
        if any(loaded) or not has_loss:
            variants = tuple(
                GainVariant(
                    gains=one, loss_factor=None if has_loss else loss, loaded=holds and not bare
                )
                for bare in ((False, True) if any(loaded) else (True,))
                for loss in losses
                for one, holds in zip(study_gains(study, loss, bare=bare), loaded, strict=True)
            )
        gains, losses = study_gains(study), (ASSUMED_LOSS, *losses)
        errors = [
            peak_errors(study, one, losses, (False, True) if holds else (False,))
            for one, holds in zip(study.conditions, loaded, strict=True)
        ]
    gains_of = {one.condition: one for one in gains}
    conditions = tuple(
        ConditionCheck(
            condition=condition,
            sites=study.task.sites,
            burst=burst,
            gains=gains_of.get(condition.name),
            variants=tuple(one for one in variants if one.gains.condition == condition.name),
            masking_threshold_db=study.burst.masking_threshold_db,
            peak_errors=error,
        )
        for condition, burst, error in zip(study.conditions, bursts, errors, strict=True)
    )
    return StudyCheck(
        study=study,
        cutoff_hz=study.strip.cutoff_hz(),
        conditions=conditions,
        trials=trials,
        blocks=blocks,
        duration_s=_duration_s(study, blocks),
    )


def require_mock_suitable(study: Study, driver: str | None = None) -> None:
    """Refuse a study for the mock device that the mock cannot play.

    Parameters
    ----------
    study : Study
        The study.
    driver : str, optional
        Driver instead of the study's. Other devices than the mock are checked once they are open.

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
        require_suitable(study, device.open(), read_limits(device))
    except ValueError as error:
        raise study.refused(Fault("", str(error))) from error


def _check_burst(study: Study, condition: Condition) -> BurstCheck:
    """Check the energy of a drive above the cut-off; a click's is that of its samples."""
    drive, limit = condition.drive, study.burst.max_energy_above_cutoff
    rate_hz, cutoff_hz = study.device.sample_rate_hz, study.strip.cutoff_hz()
    try:
        if isinstance(drive, Burst):
            return check_burst(
                drive, study.strip, sample_rate_hz=rate_hz, max_energy_above_cutoff=limit
            )
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
    except ValueError as error:
        rule = f"does not suit the burst of condition {condition.name}: {error}"
        raise study.refused(Fault("device.sample_rate_hz", rule, rate_hz)) from error


def _duration_s(study: Study, blocks: int) -> float:
    design = study.design
    each = (
        design.trials_at(len(study.driven))
        + design.hands_off_trials_before
        + design.hands_off_trials_after
    )
    trials = each * len(study.conditions) + design.practice_trials
    breaks = blocks - 1 + (design.hands_off_trials_after > 0)
    return trials * study.trial_s + breaks * design.min_break_s


def require_fit(study: Study, *, driver: str | None = None) -> StudyCheck:
    """Return the check of a study, or end the command where a stimulus violates a limit.

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
    for condition in check.conditions:
        if condition.verdict == "violates a limit":
            raise CommandError(
                f"condition {condition.condition.name} violates a limit: "
                f"{' '.join(condition.reasons)} Compare bursts with tactstrip bursts, or run it "
                'on purpose with accept_violation = "reason".',
                exit_code=ANSWER_IS_NO,
            )
    return check
