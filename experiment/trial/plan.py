"""Every trial of a session, written out and sealed with a checksum."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from experiment.perception.gains import (
    OWN_FINGER_ONLY,
    ConditionGains,
    FingerGains,
    gains_from_json,
)
from experiment.rows import KINDS, SIDES

SCHEMA = 3
AUDIBILITY_BLOCK = -1
PRACTICE_BLOCK = 0
CONTROL = "control"
"""The kind of the trials with the fingers off the plate."""


class PlanError(ValueError):
    """A plan that was changed after it was sealed, or that cannot be drawn.

    Examples
    --------
    >>> from experiment import draw_plan, paper_study
    >>> try:
    ...     draw_plan(paper_study(), participant="01", session="01", seed=-1)
    ... except ValueError as error:
    ...     print(type(error).__name__, error)
    PlanError seed must be a whole number >= 0; got -1
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One planned trial.

    Attributes
    ----------
    number : int
        Place in the plan, counted from 1.
    block : int
        Block, counted from 1; 0 is practice and warm-up, -1 the audibility check.
    condition : str
        Name of the study's condition.
    kind : {"single", "both", "blank", "practice", "control"}
        What sort of trial it is.
    side : {"left", "right", "both", "none"}
        Where the stimulus is.
    level_vpp : float or None
        Peak-to-peak volts at the actuator; none for a blank trial.
    foreperiod_s : float
        Wait between the cue and the stimulus, in seconds.

    Raises
    ------
    PlanError
        If kind or side is another word, a blank trial has a level or another one has none, a
        control trial is not on one side, or a kind cannot stand in that block.

    Examples
    --------
    >>> Trial(number=1, block=1, condition="main", kind="blank", side="none", level_vpp=60.0,
    ...       foreperiod_s=1.5)
    Traceback (most recent call last):
    experiment.trial.plan.PlanError: a blank trial cannot have level_vpp = 60.0
    """

    number: int
    block: int
    condition: str
    kind: str
    side: str
    level_vpp: float | None
    foreperiod_s: float

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise PlanError(f"kind must be one of {', '.join(KINDS)}; got {self.kind!r}")
        if self.side not in SIDES:
            raise PlanError(f"side must be one of {', '.join(SIDES)}; got {self.side!r}")
        if (self.level_vpp is None) != (self.kind == "blank"):
            raise PlanError(f"a {self.kind} trial cannot have level_vpp = {self.level_vpp!r}")
        if self.kind == CONTROL and self.side not in {"left", "right"}:
            raise PlanError(f"a control trial's side must be left or right; got {self.side!r}")
        if self.block < AUDIBILITY_BLOCK or (
            self.block == AUDIBILITY_BLOCK and self.kind != CONTROL
        ):
            raise PlanError(f"a {self.kind} trial cannot be of block {self.block}")


_TRIAL_FIELDS = tuple(Trial.__dataclass_fields__)


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
    sources : dict
        Value, source and words of every number of the study, by its key; empty in older plans.
    participant_number : int or None
        By which the order of conditions was chosen, where it is balanced.
    sha256 : str
        Checksum over the canonical form of everything above.

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
    sources: dict[str, dict[str, Any]] = field(default_factory=dict)
    participant_number: int | None = None
    sha256: str = ""

    def answers_to(self, trial: Trial) -> tuple[str, ...]:
        """Return the answers accepted in a trial; ``none`` always is with the fingers off.

        Parameters
        ----------
        trial : Trial
            One of the plan's.

        Returns
        -------
        tuple of str
            Words of `responses`, and perhaps ``none``.
        """
        if trial.kind != CONTROL or "none" in self.responses:
            return self.responses
        return (*self.responses, "none")

    def gains_of(self, condition: str) -> FingerGains:
        """Return what the two fingers get in a condition.

        Parameters
        ----------
        condition : str
            Its name.

        Returns
        -------
        FingerGains
            Of both actuators at both fingers: micrometres per Vpp, or, where its ``basis`` is None,
            parts of what the own finger gets. `OWN_FINGER_ONLY` where the plan has no gains.
        """
        for gains in self.gains:
            if gains.condition == condition:
                return gains.fingers()
        return OWN_FINGER_ONLY

    @property
    def condition_order(self) -> tuple[str, ...]:
        """The conditions in the order of their blocks."""
        blocks = (t for t in self.trials if t.block > PRACTICE_BLOCK and t.kind != CONTROL)
        return tuple(dict.fromkeys(trial.condition for trial in blocks))

    def trials_words(self) -> str:
        """Say how many trials there are.

        Returns
        -------
        str
            Those of practice are counted apart.
        """
        practice = sum(trial.kind == "practice" for trial in self.trials)
        of_practice = f" and {practice} of practice" if practice else ""
        return f"{len(self.trials) - practice} trials{of_practice}"

    def to_json(self) -> str:
        """Write the plan as the text of plan.json.

        Returns
        -------
        str
            JSON, checksum included.
        """
        return (
            json.dumps(_contents(self) | {"sha256": self.sha256}, ensure_ascii=False, indent=1)
            + "\n"
        )


def _contents(plan: Plan) -> dict[str, Any]:
    """List what the checksum covers."""
    contents = {name: getattr(plan, name) for name in Plan.__dataclass_fields__}
    del contents["sha256"]
    if plan.participant_number is None:  # it says nothing, nor did it in plans before there was one
        del contents["participant_number"]
    if not plan.sources:
        del contents["sources"]
    contents["study"] = json.loads(plan.study)
    for name in ("trials", "warm_up"):  # by hand: asdict takes ten times as long
        contents[name] = [{f: getattr(t, f) for f in _TRIAL_FIELDS} for t in contents[name]]
    contents["gains"] = [asdict(gains) for gains in plan.gains]
    return {"schema": SCHEMA} | contents


def _checksum(plan: Plan) -> str:
    canonical = json.dumps(
        _contents(plan),
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
        default=list,
    )
    return hashlib.sha256(canonical.encode()).hexdigest()


# The seal is of what a plan says, not of its file: keys sorted, no blanks. A plan that was laid out
# anew is still the one that was drawn; one in which a level or the study was touched is not: a
# session would go on with trials that nobody drew. It is a checksum, not a signature: it guards
# against slips and half-written copies, not against somebody who computes it again.
def seal(plan: Plan) -> Plan:
    """Return the plan with its checksum."""
    return replace(plan, sha256=_checksum(plan))


def verify(plan: Plan) -> None:
    """Refuse a plan that differs from what was sealed.

    PlanError where the checksum does not match the contents.
    """
    found = _checksum(plan)
    if plan.sha256 != found:
        raise PlanError(
            f"the plan's sha256 must be {found[:12]}...; got {str(plan.sha256)[:12]!r}: "
            "the plan was changed after it was sealed"
        )


def plan_from_json(text: str, *, known: bool = False) -> Plan:
    """Read the text of a plan.json and verify its seal, unless it is `known` to be what was sealed.

    Raises
    ------
    PlanError
        If the text is not a plan of this schema or its checksum does not match.
    """
    try:
        contents = json.loads(text)
        if contents["schema"] != SCHEMA:
            raise PlanError(f"the plan's schema must be {SCHEMA}; got {contents['schema']!r}")
        contents = {"participant_number": None, "sources": {}} | contents
        fields = {name: contents[name] for name in Plan.__dataclass_fields__}
        fields["study"] = json.dumps(
            contents["study"], sort_keys=True, separators=(",", ":"), ensure_ascii=False
        )
        fields["responses"] = tuple(contents["responses"])
        fields["trials"] = tuple(Trial(**trial) for trial in contents["trials"])
        fields["warm_up"] = tuple(Trial(**trial) for trial in contents["warm_up"])
        fields["gains"] = tuple(gains_from_json(gains) for gains in contents["gains"])
        plan = Plan(**fields)
        if not known:
            verify(plan)
    except PlanError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise PlanError(f"not a plan of this program: {error}") from error
    return plan
