"""Drawing a plan: orders, blocks, practice and waits, all from one seed."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from experiment.names import require_identifier, require_whole
from experiment.study.design import MAX_TRIALS
from experiment.trial.order import balanced_order
from experiment.trial.plan import (
    AUDIBILITY_BLOCK,
    CONTROL,
    PRACTICE_BLOCK,
    Plan,
    PlanError,
    Trial,
    seal,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from experiment.perception.gains import ConditionGains
    from experiment.study.design import Design
    from experiment.study.files import Levels
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


WARM_UP_SIDES = ("left", "right")
"""Two easy trials, presented again to a person whenever a session is resumed."""


def draw_plan(
    study: Study,
    *,
    participant: str,
    session: str,
    seed: int,
    levels_vpp: Levels | None = None,
    gains: tuple[ConditionGains, ...] = (),
    participant_number: int | None = None,
) -> Plan:
    """Draw and seal a session's trials.

    Parameters
    ----------
    study : Study
        The study.
    participant, session : str
        Identifiers of the session's folder, 1 to 32 letters or digits each.
    seed : int
        Seed, 0 or more; the same seed gives the same plan.
    levels_vpp : sequence of float, or mapping of them by the conditions' names, optional
        Levels placed for this participant, instead of the study's, in peak-to-peak volts.
    gains : tuple of ConditionGains
        The study's gain matrix, to be sealed with the trials; without it no displacement is told.
    participant_number : int, optional
        Counted from 1; needed where the order of conditions is balanced, else it says nothing.

    Returns
    -------
    Plan
        Every trial with its wait, those of practice and warm-up included, sealed by a checksum.

    Raises
    ------
    PlanError
        If the design cannot be drawn as the study asks, the seed is below 0, or participant or
        session is no identifier: ``all``, a name that Windows reserves, or other characters.
    StudyError
        If the study cannot be run at these levels.

    Examples
    --------
    The same seed gives the same plan, another one another order:

    >>> from experiment import draw_plan, paper_study
    >>> one, same, other = (draw_plan(paper_study(), participant="01", session="01", seed=seed)
    ...                     for seed in (7, 7, 8))
    >>> one == same, one.trials == other.trials, len(one.trials)
    (True, False, 155)
    """
    _refuse_unfit(participant, session, seed)
    number = participant_number if study.design.condition_order == "balanced" else None
    if study.design.condition_order == "balanced" and (number is None or number < 1):
        raise PlanError(
            "participant_number must be a whole number >= 1 where design.condition_order is "
            f"balanced; got {number}"
        )
    file_sha256 = study.sha256
    if levels_vpp is not None:
        from experiment.study.files import with_levels

        study = with_levels(study, levels_vpp)
    from experiment.study.sources import planned_sources

    rng = np.random.Generator(np.random.PCG64(seed))
    order = _order(study, number, rng)
    trials = tuple(_number(_draw_trials(study, order, rng, _off_plate_generator(seed))))
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
            warm_up=_warm_up(study, trials),
            gains=gains,
            sources={one.key: one.facts for one in planned_sources(study, gains)},
            participant_number=number,
        )
    )


def _refuse_unfit(participant: str, session: str, seed: int) -> None:
    """Refuse identifiers that no session's folder can have, and a seed that is none."""
    try:
        require_identifier("participant", participant)
        require_identifier("session", session)
        require_whole("seed", seed, 0)
    except ValueError as error:
        raise PlanError(str(error)) from None


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
    total = design.trials
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
    least = f" or at least {shortest}" if shortest <= MAX_TRIALS else ""
    raise PlanError(
        f"design.break_every must be 0{least} (the shortest block with the same number of every "
        f"stimulus has {shortest} trials); got {design.break_every}"
    )


def block_lengths(design: Design) -> tuple[int, ...]:
    """Return how many trials each block of one condition has, in their order.

    It raises PlanError as `block_count` does.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> block_lengths(paper_study().design)
    (31, 31, 31, 31, 31)
    """
    count = block_count(design)
    if design.order == "random":
        length = design.break_every or design.trials
        return tuple(min(length, design.trials - length * block) for block in range(count))
    # dealt out one by one, as `_balanced_blocks` does: the first blocks get one more
    each, left_over = divmod(design.both_trials + design.blank_trials, count)
    single = 2 * design.trials_per_side // count
    return tuple(single + each + (block < left_over) for block in range(count))


def block_words(design: Design) -> list[str]:
    r"""Say how long the blocks of one condition become, a line each.

    The order ``balanced`` may make them much shorter than ``break_every``; then the next longer
    ones are told, with the key that gives them.

    Examples
    --------
    >>> from experiment.study.design import Design
    >>> words = ("left", "right", "both", "none")
    >>> design = Design(order="balanced", blank_trials=60, responses=words, break_every=42)
    >>> print(*block_words(design), sep="\n")
    15 of 14 or 15 trials, each side and level once in each
    all alike, so shorter than break_every = 42; for 5 of 43 write break_every = 43
    """
    lengths = block_lengths(design)
    told = f"{len(lengths)} of {_range(lengths)} trials"
    if design.order == "random":
        return [told]
    repeats = design.trials_per_side // len(design.levels_vpp)
    times = repeats // len(lengths)
    lines = [f"{told}, each side and level {_times(times)} in each"]
    fewer = [count for count in range(1, len(lengths)) if repeats % count == 0]
    asked = math.ceil(design.trials / (design.break_every or design.trials))
    if fewer and len(lengths) > asked:
        longest = math.ceil(design.trials / fewer[-1])
        longer = block_lengths(replace(design, break_every=longest))
        lines.append(
            f"all alike, so shorter than break_every = {design.break_every}; "
            f"for {len(longer)} of {_range(longer)} write break_every = {longest}"
        )
    return lines


def _range(lengths: tuple[int, ...]) -> str:
    ends = sorted({min(lengths), max(lengths)})
    joined = " or " if ends[-1] - ends[0] == 1 else " to "
    return joined.join(map(str, ends))


def _times(times: int) -> str:
    return {1: "once", 2: "twice"}.get(times, f"{times} times")


def _number(trials: Iterator[Trial]) -> Iterator[Trial]:
    for number, trial in enumerate(trials, start=1):
        yield replace(trial, number=number)


def _off_plate_generator(seed: int) -> np.random.Generator:
    """Return what draws the trials with the fingers off; the others stay as they are without."""
    return np.random.Generator(np.random.PCG64((seed, _OFF_PLATE_STREAM)))


_OFF_PLATE_STREAM = 1


def _order(study: Study, number: int | None, rng: np.random.Generator) -> list[Condition]:
    """Return the conditions in the order of their blocks; only a random one draws from `rng`."""
    places: Iterable[int] = range(len(study.conditions))
    if study.design.condition_order == "random":
        places = rng.permutation(len(study.conditions))
    elif number is not None:
        places = balanced_order(len(study.conditions), number)
    return [study.conditions[place] for place in places]


def _draw_trials(
    study: Study,
    conditions: Sequence[Condition],
    rng: np.random.Generator,
    off_plate: np.random.Generator,
) -> Iterator[Trial]:
    # The order of the draws is part of what a seed means: one draw more from `rng`, or two in
    # another order, and the whole plan is another. Hence the trials off the plate, which a study
    # may add or leave out without touching the others, draw from a stream of their own.
    audibility, control = study.design.audibility_trials, study.design.control_trials
    yield from _off_plate(study, conditions, AUDIBILITY_BLOCK, audibility, off_plate)
    yield from _practice(study.design_of(conditions[0].name), conditions[0], rng)
    next_block = 1
    for condition in conditions:
        design = study.design_of(condition.name)
        for stimuli in shuffled_blocks(design, rng):
            for stimulus in stimuli:
                yield _trial(design, condition, next_block, stimulus, rng)
            next_block += 1
    yield from _off_plate(study, conditions, next_block, control, off_plate)


Stimulus = tuple[str, str, float | None]
"""Kind, side and level of one trial to come."""


def shuffled_blocks(design: Design, rng: np.random.Generator) -> Iterator[list[Stimulus]]:
    """Draw the stimuli of one condition, block by block, in their order."""
    for stimuli in _BLOCKS_OF[design.order](design, rng):
        yield [stimuli[place] for place in rng.permutation(len(stimuli))]


def _random_blocks(design: Design, rng: np.random.Generator) -> list[list[Stimulus]]:
    """Draw every level independently, as in the paper, and cut the shuffled list into blocks."""
    stimuli: list[Stimulus] = [
        ("single", side, float(rng.choice(design.levels_vpp)))
        for side in ("left", "right")
        for _ in range(design.trials_per_side)
    ]
    # Shuffled over all blocks; the caller shuffles each block once more, which changes nothing of
    # the distribution here and is what a balanced block needs.
    stimuli += _both(design, rng) + _blank(design)
    shuffled = [stimuli[i] for i in rng.permutation(len(stimuli))]
    length = design.break_every or len(shuffled)
    return [shuffled[i : i + length] for i in range(0, len(shuffled), length)]


def _balanced_blocks(design: Design, rng: np.random.Generator) -> list[list[Stimulus]]:
    """Give every block the same number of each side and level, the rest as evenly as possible."""
    count = block_count(design)
    repeats = design.trials_per_side // len(design.levels_vpp) // count
    each: list[Stimulus] = [
        ("single", side, level) for side in ("left", "right") for level in design.levels_vpp
    ]
    blocks = [each * repeats for _ in range(count)]
    others = _both(design, rng) + _blank(design)
    for place, stimulus in enumerate(others):
        blocks[place % count].append(stimulus)
    return blocks


_BLOCKS_OF = {"random": _random_blocks, "balanced": _balanced_blocks}


def _both(design: Design, rng: np.random.Generator) -> list[Stimulus]:
    levels = [
        design.both_level_vpp or float(rng.choice(design.levels_vpp))
        for _ in range(design.both_trials)
    ]
    return [("both", "both", level) for level in levels]


def _blank(design: Design) -> list[Stimulus]:
    return [("blank", "none", None)] * design.blank_trials


def _practice(design: Design, condition: Condition, rng: np.random.Generator) -> Iterator[Trial]:
    """Draw the practice trials: both sides alike, at the highest level."""
    sides = [WARM_UP_SIDES[i % 2] for i in range(design.practice_trials)]
    for place in rng.permutation(len(sides)):
        stimulus = ("practice", sides[place], max(design.levels_vpp))
        yield _trial(design, condition, PRACTICE_BLOCK, stimulus, rng)


def _off_plate(
    study: Study,
    conditions: Sequence[Condition],
    block: int,
    trials: int,
    rng: np.random.Generator,
) -> Iterator[Trial]:
    """Draw one block with the fingers off the plate: condition by condition, both sides alike."""
    for condition in conditions:
        design = study.design_of(condition.name)
        for place in rng.permutation(trials):
            stimulus = (CONTROL, WARM_UP_SIDES[place % 2], design.highest_vpp)
            yield _trial(design, condition, block, stimulus, rng)


def _warm_up(study: Study, planned: tuple[Trial, ...]) -> tuple[Trial, ...]:
    design = study.design_of(planned[0].condition)
    return tuple(
        Trial(
            number=len(planned) + place,
            block=PRACTICE_BLOCK,
            condition=planned[0].condition,
            kind="practice",
            side=side,
            level_vpp=max(design.levels_vpp),
            foreperiod_s=design.foreperiod_s[1],
        )
        for place, side in enumerate(WARM_UP_SIDES, start=1)
    )


def _trial(
    design: Design,
    condition: Condition,
    block: int,
    stimulus: Stimulus,
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
    # The distribution function turned round, cut at two scales, where 1 - exp(-2) of it is left.
    # Rounding to the microsecond, as the plan is written, may step over a limit by less than that.
    least_s, most_s = limits_s
    scale_s = (most_s - least_s) / 2
    u = rng.random()
    wait_s = least_s - scale_s * math.log1p(-u * -math.expm1(-2.0))
    return min(max(round(wait_s, 6), least_s), most_s)
