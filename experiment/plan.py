"""Every trial of a session: drawn from a seed, written out, and sealed with a checksum."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from experiment.record import KINDS, SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from experiment.study import Condition, Design, Study

SCHEMA = 1
PRACTICE_BLOCK = 0
WARM_UP_SIDES = ("left", "right")
"""Two easy trials, presented again to a person whenever a session is resumed."""


class PlanError(ValueError):
    """A plan that is not what it was when it was sealed, or that cannot be drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One planned trial.

    Attributes
    ----------
    number : int
        Place in the plan, counted from 1.
    block : int
        Block, counted from 1; 0 is practice and warm-up.
    condition : str
        Name of the study's condition.
    kind, side : str
        A word of `record.KINDS` and of `record.SIDES`.
    level_vpp : float or None
        Peak-to-peak volts at the actuator; none for a blank trial.
    foreperiod_s : float
        Wait between the cue and the stimulus.
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
    sha256 : str
        Checksum over the canonical form of everything above.
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
    sha256: str = ""

    def to_json(self) -> str:
        """Write the plan as the text of plan.json, checksum included."""
        return (
            json.dumps(_contents(self) | {"sha256": self.sha256}, ensure_ascii=False, indent=1)
            + "\n"
        )


def _contents(plan: Plan) -> dict[str, Any]:
    """List what the checksum covers."""
    contents = asdict(plan)
    del contents["sha256"]
    contents["study"] = json.loads(plan.study)
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


def seal(plan: Plan) -> Plan:
    """Return the plan with its checksum."""
    return replace(plan, sha256=_checksum(plan))


def verify(plan: Plan) -> None:
    """Refuse a plan that differs from what was sealed.

    Raises
    ------
    PlanError
        If the checksum does not match the contents.
    """
    found = _checksum(plan)
    if plan.sha256 != found:
        raise PlanError(
            f"the plan's sha256 must be {found[:12]}...; got {str(plan.sha256)[:12]!r}: "
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
            raise PlanError(f"the plan's schema must be {SCHEMA}; got {contents['schema']!r}")
        fields = {name: contents[name] for name in Plan.__dataclass_fields__}
        fields["study"] = json.dumps(
            contents["study"], sort_keys=True, separators=(",", ":"), ensure_ascii=False
        )
        fields["responses"] = tuple(contents["responses"])
        fields["trials"] = tuple(Trial(**trial) for trial in contents["trials"])
        fields["warm_up"] = tuple(Trial(**trial) for trial in contents["warm_up"])
        plan = Plan(**fields)
    except PlanError:
        raise
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        raise PlanError(f"not a plan of this program: {error}") from error
    verify(plan)
    return plan


def draw_plan(
    study: Study,
    *,
    participant: str,
    session: str,
    seed: int,
    levels_vpp: Sequence[float] | None = None,
) -> Plan:
    """Draw and seal a session's trials.

    Parameters
    ----------
    study : Study
        The study.
    participant, session : str
        Identifiers of the session's folder.
    levels_vpp : sequence of float, optional
        Levels placed for this participant, instead of the study's.
    seed : int
        Seed, 0 or more; the same seed gives the same plan.

    Raises
    ------
    PlanError
        If the design cannot be drawn as the study asks.
    StudyError
        If the study cannot be run at these levels.
    """
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise PlanError(f"seed must be a whole number >= 0; got {seed!r}")
    file_sha256 = study.sha256
    if levels_vpp is not None:
        from experiment.study import with_levels

        study = with_levels(study, levels_vpp)
    rng = np.random.Generator(np.random.PCG64(seed))
    trials = tuple(_number(_draw_trials(study, rng)))
    return seal(
        Plan(
            participant=participant,
            session=session,
            seed=seed,
            generator=f"PCG64 of numpy {np.__version__}",
            study=study.canonical,
            study_sha256=study.sha256,
            file_sha256=file_sha256,
            responses=study.design.responses,
            response_window_s=study.design.response_window_s,
            trials=trials,
            warm_up=_warm_up(study, len(trials)),
        )
    )


def block_count(design: Design) -> int:
    """Return into how many blocks one condition's trials are divided.

    ``break_every`` is the largest number of trials in a block, 0 for no break at all. The order
    ``balanced`` puts the same number of every single-finger stimulus into each block, so there the
    count divides the number of trials of a side and level.

    Raises
    ------
    PlanError
        If no block of a balanced design is as short as ``break_every`` asks.
    """
    total = 2 * design.trials_per_side + design.both_trials + design.blank_trials
    if design.break_every == 0:
        return 1
    fewest = math.ceil(total / design.break_every)
    if design.order == "random":
        return fewest
    repeats = design.trials_per_side // len(design.levels_vpp)
    for count in range(fewest, repeats + 1):
        if repeats % count == 0:
            return count
    shortest = math.ceil(total / repeats)
    raise PlanError(
        f"design.break_every must be 0 or at least {shortest} (the shortest block with the same "
        f"number of every stimulus); got {design.break_every}"
    )


def _number(trials: Iterator[Trial]) -> Iterator[Trial]:
    for number, trial in enumerate(trials, start=1):
        yield replace(trial, number=number)


def _draw_trials(study: Study, rng: np.random.Generator) -> Iterator[Trial]:
    conditions = list(study.conditions)
    if study.design.condition_order == "random":
        conditions = [conditions[i] for i in rng.permutation(len(conditions))]
    yield from _practice(study.design, conditions[0], rng)
    first_block = 1
    for condition in conditions:
        blocks = _BLOCKS_OF[study.design.order](study.design, rng)
        for block, stimuli in enumerate(blocks, start=first_block):
            for place in rng.permutation(len(stimuli)):
                yield _trial(study.design, condition, block, stimuli[place], rng)
        first_block += len(blocks)


_Stimulus = tuple[str, str, float | None]
"""Kind, side and level of one trial to come."""


def _random_blocks(design: Design, rng: np.random.Generator) -> list[list[_Stimulus]]:
    """Draw every level independently, as in the paper, and cut the shuffled list into blocks."""
    stimuli: list[_Stimulus] = [
        ("single", side, float(rng.choice(design.levels_vpp)))
        for side in ("left", "right")
        for _ in range(design.trials_per_side)
    ]
    stimuli += _both(design, rng) + _blank(design)
    shuffled = [stimuli[i] for i in rng.permutation(len(stimuli))]
    length = design.break_every or len(shuffled)
    return [shuffled[i : i + length] for i in range(0, len(shuffled), length)]


def _balanced_blocks(design: Design, rng: np.random.Generator) -> list[list[_Stimulus]]:
    """Give every block the same number of each side and level, the rest as evenly as possible."""
    count = block_count(design)
    repeats = design.trials_per_side // len(design.levels_vpp) // count
    each: list[_Stimulus] = [
        ("single", side, level) for side in ("left", "right") for level in design.levels_vpp
    ]
    blocks = [each * repeats for _ in range(count)]
    others = _both(design, rng) + _blank(design)
    for place, stimulus in enumerate(others):
        blocks[place % count].append(stimulus)
    return blocks


_BLOCKS_OF = {"random": _random_blocks, "balanced": _balanced_blocks}


def _both(design: Design, rng: np.random.Generator) -> list[_Stimulus]:
    levels = [design.both_level_vpp or float(rng.choice(design.levels_vpp))
              for _ in range(design.both_trials)]  # fmt: skip
    return [("both", "both", level) for level in levels]


def _blank(design: Design) -> list[_Stimulus]:
    return [("blank", "none", None)] * design.blank_trials


def _practice(design: Design, condition: Condition, rng: np.random.Generator) -> Iterator[Trial]:
    """Draw the practice trials: both sides alike, at the highest level."""
    sides = [WARM_UP_SIDES[i % 2] for i in range(design.practice_trials)]
    for place in rng.permutation(len(sides)):
        stimulus = ("practice", sides[place], max(design.levels_vpp))
        yield _trial(design, condition, PRACTICE_BLOCK, stimulus, rng)


def _warm_up(study: Study, planned: int) -> tuple[Trial, ...]:
    return tuple(
        Trial(
            number=planned + place,
            block=PRACTICE_BLOCK,
            condition=study.conditions[0].name,
            kind="practice",
            side=side,
            level_vpp=max(study.design.levels_vpp),
            foreperiod_s=study.design.foreperiod_s[1],
        )
        for place, side in enumerate(WARM_UP_SIDES, start=1)
    )


def _trial(
    design: Design,
    condition: Condition,
    block: int,
    stimulus: _Stimulus,
    rng: np.random.Generator,
) -> Trial:
    kind, side, level_vpp = stimulus
    return Trial(
        number=0,
        block=block,
        condition=condition.name,
        kind=kind,
        side=side,
        level_vpp=level_vpp,
        foreperiod_s=_draw_foreperiod_s(design.foreperiod_s, rng),
    )


def _draw_foreperiod_s(limits_s: tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a wait from an exponential distribution cut to ``limits_s``, to the microsecond.

    Its scale is half the range, so that a wait that has lasted tells little about what remains.
    """
    least_s, most_s = limits_s
    scale_s = (most_s - least_s) / 2
    u = rng.random()
    wait_s = least_s - scale_s * math.log1p(-u * -math.expm1(-2.0))
    return min(max(round(wait_s, 6), least_s), most_s)
