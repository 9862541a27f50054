"""Every trial of a session, written out and sealed with a checksum."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import Field, TypeAdapter, ValidationError

from experiment.levels import Bayesian, Staircase
from experiment.names import OTHER_VERSION
from experiment.perception.gains import ConditionGains, FingerGains, without_crosstalk
from experiment.study.base import first_fault
from experiment.tasks import make_task
from experiment.tasks.task import SINGLE

if TYPE_CHECKING:
    from experiment.tasks.task import Task


_Rule = Annotated[Staircase | Bayesian, Field(discriminator="kind")]
SCHEMA = 6
PRACTICE = "practice"
HANDS_OFF = "hands_off"
"""The kind of the trials with the hands off the plate."""
HANDS_OFF_BLOCK = -1
"""The block of the hands-off trials before practice; those after the task have the last block."""
PRACTICE_BLOCK = 0


class PlanError(ValueError):
    """A plan that was changed after it was sealed, or that cannot be drawn.

    Examples
    --------
    >>> from experiment import draw_plan, paper_study
    >>> try:
    ...     draw_plan(paper_study(), participant="01", session="01", seed=-1)
    ... except ValueError as error:
    ...     print(type(error).__name__, error)
    PlanError seed: must be a whole number of at least 0 (got -1)
    """


@dataclass(frozen=True, slots=True)
class Trial:
    """One planned trial.

    Attributes
    ----------
    number : int
        Place in the plan, counted from 1.
    block : int
        Block, counted from 1; 0 is practice and warm-up, -1 the hands-off trials before them.
    condition : str
        Name of the study's condition.
    kind : str
        A kind of the task's presentations, ``practice`` or ``hands_off``.
    side : str
        Which of the task's presentations it is.
    level_vpp : float or None
        Peak-to-peak volts at the actuator; none for a blank trial, and where a rule chooses it
        during the session.
    foreperiod_s : float
        Wait between the cue and the stimulus, in seconds; before each interval.

    Examples
    --------
    >>> from experiment import draw_plan, paper_study
    >>> trial = draw_plan(paper_study(), participant="01", session="01", seed=7).trials[0]
    >>> trial.number, trial.kind, trial.side in paper_study().task.presentation_names
    (1, 'single', True)
    """

    number: int
    block: int
    condition: str
    kind: str
    side: str
    level_vpp: float | None
    foreperiod_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A session's sealed list of trials.

    Attributes
    ----------
    participant, session : str
        Identifiers of the session's folder.
    seed : int
        Seed of the generator that drew the trials.
    generator : str
        Name of numpy's bit generator, and numpy's version.
    study : str
        The study as canonical JSON text.
    study_sha256 : str
        Checksum of that text.
    file_sha256 : str
        Checksum of the study as its file states it, before levels were placed.
    responses : tuple of str
        The answers that the study offers.
    response_window_s : float
        How long an answer is waited for.
    trials : tuple of Trial
        Every trial in its order.
    warm_up : tuple of Trial
        The trials presented to a person again after a resume.
    gains : tuple of ConditionGains
        The gain matrix of every condition; empty where displacements are not known.
    keys_set : tuple of str
        The keys that the study file sets, with their sections; the others have their defaults.
    participant_number : int or None
        By which the order of conditions was chosen, where it is balanced.
    level_rules : mapping of str to LevelRule
        What chooses levels during the session, by condition; empty where the plan has all levels.
    sha256 : str
        Checksum over the canonical form of everything above.

    Raises
    ------
    PlanError
        If the task has no such trial, or a trial has no level and no rule chooses it.

    Examples
    --------
    `draw_plan` makes one. What was changed after it was sealed is refused:

    >>> from experiment import draw_plan, paper_study
    >>> from experiment.trial.plan import plan_from_json
    >>> plan = draw_plan(paper_study(), participant="01", session="01", seed=7)
    >>> plan_from_json(plan.to_json()) == plan
    True
    >>> plan_from_json(plan.to_json().replace('"seed": 7', '"seed": 8'))
    Traceback (most recent call last):
    experiment.trial.plan.PlanError: the plan's sha256 must be ...
    """

    participant: str
    session: str
    seed: int
    generator: str
    study: str
    study_sha256: str
    file_sha256: str
    responses: tuple[str, ...]
    response_window_s: float
    trials: tuple[Trial, ...]
    warm_up: tuple[Trial, ...]
    gains: tuple[ConditionGains, ...] = ()
    keys_set: tuple[str, ...] = ()
    participant_number: int | None = None
    level_rules: dict[str, _Rule] = field(default_factory=dict)
    sha256: str = ""

    def __post_init__(self) -> None:
        sites = self.task.sites
        for gains in self.gains:
            if gains.actuators[: len(sites)] != sites:
                raise PlanError(
                    f"actuators must begin with {', '.join(sites)}; got {gains.actuators}"
                )
        for trial in (*self.trials, *self.warm_up):
            self._check(trial)
            if self.is_chosen(trial) and trial.condition not in self.level_rules:
                raise PlanError(f"trial {trial.number} must have a level; got {trial.level_vpp!r}")

    def _check(self, trial: Trial) -> None:
        """Refuse a trial that the task does not have."""
        first_block = HANDS_OFF_BLOCK if trial.kind == HANDS_OFF else PRACTICE_BLOCK
        shown = {p.name: p for p in self.task.presentations}.get(trial.side)
        kinds = (PRACTICE,) if shown is None or shown.kind != SINGLE else (PRACTICE, HANDS_OFF)
        if (
            shown is None
            or trial.kind not in {shown.kind, *kinds}
            or trial.block < first_block
            or bool(shown.sites) != (trial.level_vpp is not None or self.is_chosen(trial))
        ):
            raise PlanError(
                f"a {trial.kind} trial cannot have side = {trial.side!r}, level_vpp = "
                f"{trial.level_vpp!r}, block = {trial.block}"
            )

    @staticmethod
    def is_chosen(trial: Trial) -> bool:
        """Return whether a rule chooses the level of a trial of the plan.

        Parameters
        ----------
        trial : Trial
            One of the plan's.

        Returns
        -------
        bool
        """
        return trial.kind == SINGLE and trial.level_vpp is None

    def answers_to(self, trial: Trial) -> tuple[str, ...]:
        """Return the answers accepted in a trial; with the hands off, "nothing" always is.

        Parameters
        ----------
        trial : Trial
            One of the plan's.

        Returns
        -------
        tuple of str
            `responses`, and perhaps the task's answer that nothing was noticed.
        """
        return self.task.offered(self.responses, hands_off=trial.kind == HANDS_OFF)

    @property
    def task(self) -> Task:
        """The task that the participant is given."""
        return _task_of(self.study)

    def gains_of(self, condition: str) -> FingerGains:
        """Return the gains at the task's sites in a condition.

        Parameters
        ----------
        condition : str
            Its name.

        Returns
        -------
        FingerGains
            Micrometres per Vpp; where the basis is None, relative to the driven finger. If the plan
            has no gains, there is no crosstalk.
        """
        sites = self.task.sites
        gains = {gains.condition: gains for gains in self.gains}.get(condition)
        return without_crosstalk(len(sites)) if gains is None else gains.at_fingers(sites)

    @property
    def condition_order(self) -> tuple[str, ...]:
        """The conditions in the order of their blocks."""
        blocks = (t for t in self.trials if t.block > PRACTICE_BLOCK and t.kind != HANDS_OFF)
        return tuple(dict.fromkeys(trial.condition for trial in blocks))

    def describe_trials(self) -> str:
        """Say how many trials there are.

        Returns
        -------
        str
            Those of practice are counted apart.
        """
        practice = sum(trial.kind == PRACTICE for trial in self.trials)
        of_practice = f" and {practice} of practice" if practice else ""
        return f"{len(self.trials) - practice} trials{of_practice}"

    def to_json(self) -> str:
        """Write the plan as the text of plan.json.

        Returns
        -------
        str
            JSON, checksum included.
        """
        contents = _contents(self) | {"sha256": self.sha256}
        return json.dumps(contents, ensure_ascii=False, indent=1) + "\n"


@lru_cache
def _task_of(study: str) -> Task:
    """Return the task of a study's canonical text."""
    try:
        tables = json.loads(study)
        choice, actuators = tables["task"], tables["actuator"]
        sites = tuple(each["site"] for each in actuators if each["site"] is not None)
        return make_task(choice["kind"], choice["reference_vpp"], sites)
    except (KeyError, TypeError, ValueError) as error:
        raise PlanError(f"the plan's task cannot be used: {error}") from error


_PLANS: Final = TypeAdapter(Plan)
_CANONICAL: Final[dict[str, Any]] = {
    "sort_keys": True,
    "separators": (",", ":"),
    "ensure_ascii": False,
}
"""How JSON is written of which a checksum is taken."""


def _contents(plan: Plan) -> dict[str, Any]:
    """List what the checksum covers."""
    contents: dict[str, Any] = _PLANS.dump_python(
        plan, mode="json", exclude={"sha256"}, warnings=False
    )
    if plan.participant_number is None:  # it says nothing, nor did it in plans before there was one
        del contents["participant_number"]
    if not plan.level_rules:
        del contents["level_rules"]
    return {"schema": SCHEMA} | contents | {"study": json.loads(plan.study)}


def _checksum(plan: Plan) -> str:
    canonical = json.dumps(_contents(plan), **_CANONICAL, allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


# The seal covers the content of a plan, not its file: keys are sorted and blanks removed. A plan
# that was reformatted is still the one that was drawn. A plan with a changed level or study is not,
# because its session would continue with trials that were never drawn. The seal is a checksum, not
# a signature: it guards against mistakes and incomplete copies, not against a forger.
def seal(plan: Plan) -> Plan:
    """Return the plan with its checksum."""
    return replace(plan, sha256=_checksum(plan))


def verify(plan: Plan) -> None:
    """Refuse a plan that differs from what was sealed.

    PlanError where the checksum does not match the contents.
    """
    expected = _checksum(plan)
    if plan.sha256 != expected:
        raise PlanError(
            f"the plan's sha256 must be {expected[:12]}...; got {str(plan.sha256)[:12]!r}: "
            "the plan was changed after it was sealed"
        )


def plan_from_json(text: str) -> Plan:
    """Read the text of a plan.json and verify its seal.

    Raises
    ------
    PlanError
        If the text is not a plan of this schema or its checksum does not match.
    """
    try:
        contents = json.loads(text)
        if contents["schema"] != SCHEMA:
            raise PlanError(
                f"the plan's schema must be {SCHEMA}; got {contents['schema']!r}: {OTHER_VERSION}"
            )
        study = json.dumps(contents["study"], **_CANONICAL)
        # as JSON, where a list is a tuple but the text "7" is no number
        plan = _PLANS.validate_json(json.dumps(contents | {"study": study}), strict=True)
        verify(plan)
    except PlanError:
        raise
    except ValidationError as error:
        raise PlanError(f"not a plan of this program: {first_fault(error)}") from error
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise PlanError(f"not a plan of this program: {error}") from error
    return plan
