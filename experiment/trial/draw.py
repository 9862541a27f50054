"""Drawing a plan: orders, blocks, practice and waits, all from one seed."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from experiment.names import require_identifier, require_whole
from experiment.tasks.task import BOTH, SINGLE
from experiment.trial.order import balanced_order
from experiment.trial.plan import (
    HANDS_OFF,
    HANDS_OFF_BLOCK,
    PRACTICE,
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
    from experiment.tasks.task import Presentation, Task


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
        The study's gain matrix, to be sealed with the trials; without it no displacement is
        reported.
    participant_number : int, optional
        Number of the participant, counted from 1; used only to balance the order of conditions.

    Returns
    -------
    Plan
        Every trial with its foreperiod, including practice and warm-up, sealed by a checksum.

    Raises
    ------
    PlanError
        If the design cannot be drawn, the seed is below 0, or participant or session is not an
        identifier: ``all``, a name that Windows reserves, or one with other characters.
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
    is_balanced = study.design.condition_order == "balanced"
    number = participant_number if is_balanced else None
    try:
        require_identifier("participant", participant)
        require_identifier("session", session)
        require_whole("seed", seed, 0)
        if is_balanced:
            require_whole("participant_number", number, 1)
    except ValueError as error:
        raise PlanError(str(error)) from None
    file_sha256 = study.sha256
    if levels_vpp is not None:
        from experiment.study.files import with_levels

        study = with_levels(study, levels_vpp)
    rng = np.random.Generator(np.random.PCG64(seed))
    order = _order(study, number, rng)
    hands_off_rng = np.random.Generator(np.random.PCG64((seed, _HANDS_OFF_STREAM)))
    trials = tuple(_draw_trials(study, order, rng, hands_off_rng))
    rules = {}
    if study.levels.is_adaptive:
        rules = {
            condition.name: study.levels.rule_for(study.design_of(condition.name).levels_vpp, seed)
            for condition in study.conditions
        }
        trials = tuple(
            replace(trial, level_vpp=None) if trial.kind == SINGLE else trial for trial in trials
        )
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
            keys_set=study.keys_set,
            participant_number=number,
            level_rules=rules,
        )
    )


def block_count(design: Design, task: Task) -> int:
    """Return into how many blocks one condition's trials are divided.

    ``break_every`` is the largest number of trials in a block, 0 for no break at all. The order
    ``balanced`` puts the same number of every single-finger stimulus into each block, so there the
    count divides the number of trials of a side and level.

    Raises
    ------
    PlanError
        If no block of a balanced design is as short as ``break_every`` asks.
    """
    if design.break_every == 0:
        return 1
    trials = design.trials_at(len(task.sites))
    fewest = math.ceil(trials / design.break_every)
    if design.order == "random":
        return fewest
    repeats = design.trials_per_side // len(design.levels_vpp)
    for count in range(fewest, repeats + 1):
        if repeats % count == 0:
            return count
    shortest = math.ceil(trials / repeats)
    raise PlanError(
        f"design.break_every must be 0 or at least {shortest}, the length of the shortest block "
        f"with the same number of every stimulus; got {design.break_every}"
    )


def block_lengths(design: Design, task: Task) -> tuple[int, ...]:
    """Return how many trials each block of one condition has, in their order.

    It raises PlanError as `block_count` does.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> block_lengths(paper_study().design, paper_study().task)
    (31, 31, 31, 31, 31)
    """
    # The lengths do not depend on chance, so that any generator gives them.
    blocks = shuffled_blocks(design, task, np.random.default_rng(0))
    return tuple(len(stimuli) for stimuli in blocks)


_HANDS_OFF_STREAM = 1
"""The hands-off trials have a stream of their own; the others stay as they are without."""


def _order(study: Study, number: int | None, rng: np.random.Generator) -> list[Condition]:
    """Return the conditions in the order of their blocks; only a random one draws from `rng`."""
    indices: Iterable[int] = range(len(study.conditions))
    if study.design.condition_order == "random":
        indices = rng.permutation(len(study.conditions))
    elif number is not None:
        indices = balanced_order(len(study.conditions), number)
    return [study.conditions[index] for index in indices]


def _draw_trials(
    study: Study,
    conditions: Sequence[Condition],
    rng: np.random.Generator,
    hands_off_rng: np.random.Generator,
) -> Iterator[Trial]:
    # The order of the draws is part of what a seed means: one draw more from `rng`, or two in
    # another order, and the whole plan is another. Hence the hands-off trials, which a study may
    # add or leave out without touching the others, draw from a stream of their own.
    numbers = itertools.count(1)
    designs = [(condition.name, study.design_of(condition.name)) for condition in conditions]

    def present(
        block: int, name: str, design: Design, stimuli: list[Stimulus], rng: np.random.Generator
    ) -> Iterator[Trial]:
        for stimulus in stimuli:
            foreperiod_s = _draw_foreperiod_s(design.foreperiod_s, rng)
            yield Trial(next(numbers), block, name, *stimulus, foreperiod_s)

    def hands_off(block: int, trials: int) -> Iterator[Trial]:
        for name, design in designs:
            stimuli = _easy_stimuli(
                HANDS_OFF, trials, study.task, design.highest_vpp, hands_off_rng
            )
            yield from present(block, name, design, stimuli, hands_off_rng)

    yield from hands_off(HANDS_OFF_BLOCK, study.design.hands_off_trials_before)
    name, design = designs[0]
    easy_vpp = study.task.easiest_vpp(design.levels_vpp)
    practice = _easy_stimuli(PRACTICE, design.practice_trials, study.task, easy_vpp, rng)
    yield from present(PRACTICE_BLOCK, name, design, practice, rng)
    block = 0
    for name, design in designs:
        for stimuli in shuffled_blocks(design, study.task, rng):
            block += 1
            yield from present(block, name, design, stimuli, rng)
    yield from hands_off(block + 1, study.design.hands_off_trials_after)


Stimulus = tuple[str, str, float | None]
"""Kind, side and level of one trial to come."""


def shuffled_blocks(
    design: Design, task: Task, rng: np.random.Generator
) -> Iterator[list[Stimulus]]:
    """Draw the stimuli of one condition, block by block, in their order."""
    for stimuli in _BLOCKS_OF[design.order](design, task, rng):
        yield [stimuli[i] for i in rng.permutation(len(stimuli))]


def _random_blocks(design: Design, task: Task, rng: np.random.Generator) -> list[list[Stimulus]]:
    """Draw every level independently, as in the paper, and cut the shuffled list into blocks."""
    stimuli: list[Stimulus] = [
        (single.kind, single.name, float(rng.choice(design.levels_vpp)))
        for site in task.sites
        for single in _equally_often(task.at_site(site), design.trials_per_side, rng)
    ]
    # Shuffled over all blocks; the caller shuffles each block once more, which changes nothing of
    # the distribution here and is what a balanced block needs.
    stimuli += _catch_stimuli(design, task, rng)
    shuffled = [stimuli[i] for i in rng.permutation(len(stimuli))]
    length = design.break_every or len(shuffled)
    return [shuffled[i : i + length] for i in range(0, len(shuffled), length)]


def _balanced_blocks(design: Design, task: Task, rng: np.random.Generator) -> list[list[Stimulus]]:
    """Give every block the same number of each side and level, the rest as evenly as possible."""
    count = block_count(design, task)
    repeats = design.trials_per_side // len(design.levels_vpp)
    of_level = [
        [(single.kind, single.name, level_vpp) for single in singles]
        for site in task.sites
        for level_vpp in design.levels_vpp
        for singles in [_equally_often(task.at_site(site), repeats, rng)]
    ]
    rounds: list[list[Stimulus]] = [[*one_of_each] for one_of_each in zip(*of_level, strict=True)]
    blocks = [[*itertools.chain(*rounds[i::count])] for i in range(count)]
    for i, stimulus in enumerate(_catch_stimuli(design, task, rng)):
        blocks[i % count].append(stimulus)
    return blocks


_BLOCKS_OF = {"random": _random_blocks, "balanced": _balanced_blocks}


def _equally_often(
    presentations: Sequence[Presentation], trials: int, rng: np.random.Generator
) -> list[Presentation]:
    """Return so many presentations in random order, each equally often if their number allows."""
    if len(presentations) == 1:  # nothing is left to chance, and nothing is drawn
        return [*presentations] * trials
    order = rng.permutation(len(presentations))  # of an odd number, none is favoured
    return [presentations[order[i % len(order)]] for i in rng.permutation(trials)]


def _catch_stimuli(design: Design, task: Task, rng: np.random.Generator) -> list[Stimulus]:
    """Draw the trials that measure no threshold."""
    stimuli: list[Stimulus] = []
    for kind in (kind for kind in task.kinds if kind != SINGLE):
        for catch in _equally_often(task.of_kind(kind), design.trials_of(kind), rng):
            level_vpp = design.both_level_vpp if kind == BOTH else None
            if catch.sites and level_vpp is None:
                level_vpp = float(rng.choice(design.levels_vpp))
            stimuli.append((kind, catch.name, level_vpp))
    return stimuli


def _easy_stimuli(
    kind: str, trials: int, task: Task, level_vpp: float, rng: np.random.Generator
) -> list[Stimulus]:
    """Draw the order of trials at one level, each stimulus at a single site equally often."""
    single = task.of_kind(SINGLE)
    return [(kind, single[i % len(single)].name, level_vpp) for i in rng.permutation(trials)]


def _warm_up(study: Study, planned: tuple[Trial, ...]) -> tuple[Trial, ...]:
    """Return an easy trial at each site, presented again to a person after a resume."""
    condition = planned[0].condition
    design = study.design_of(condition)
    level_vpp = study.task.easiest_vpp(design.levels_vpp)
    foreperiod_s = design.foreperiod_s[1]
    trials = []
    for i, site in enumerate(study.task.sites):
        options = study.task.at_site(site)
        side, number = options[i % len(options)].name, len(planned) + 1 + i
        trials.append(
            Trial(number, PRACTICE_BLOCK, condition, PRACTICE, side, level_vpp, foreperiod_s)
        )
    return tuple(trials)


def _draw_foreperiod_s(limits_s: tuple[float, float], rng: np.random.Generator) -> float:
    """Draw a foreperiod from an exponential distribution truncated to ``limits_s``.

    Its scale is half the range, so that the time already waited says little about the rest.
    """
    # Inverse of the distribution function, truncated at two scales, below which lie 1 - exp(-2).
    # Rounding to the microsecond, as the plan is written, may exceed a limit by less than that.
    least_s, most_s = limits_s
    scale_s = (most_s - least_s) / 2
    u = rng.random()
    wait_s = least_s - scale_s * math.log1p(-u * -math.expm1(-2.0))
    return min(max(round(wait_s, 6), least_s), most_s)
