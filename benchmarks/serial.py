"""How often a serial effect is found: where there is none, and where there is one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.answers.drift import drift_p
from analysis.answers.serial import (
    EFFECTS,
    FOLLOWING_Z,
    SerialEffects,
    Session,
    canonical,
    following_z,
    runs,
    serial_effects,
)
from benchmarks.people import HONEST
from experiment.perception.answers import draw_answers
from experiment.perception.gains import OWN_FINGER_ONLY
from experiment.perception.population import draw_observer, threshold_course_db
from experiment.rows import RESPONSES, SIDES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from experiment.perception.observer import Observer

LEVELS_VPP: Final = (40.0, 50.0, 62.0, 78.0, 98.0)
SPARSE_VPP: Final = tuple(float(x) for x in np.geomspace(30, 120, 12).round(1))
WITH_NONE: Final = ("left", "right", "both", "none")
_BLANK: Final = ("none", 0.0)
_BLOCK: Final = 30
_PEOPLE: Final = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """Stimuli of one person's session and how they are put in order.

    `how` is a name of `_DRAWN` or ``staircase``.
    """

    how: str
    repeats: int
    levels_vpp: tuple[float, ...] = LEVELS_VPP
    sides: tuple[str, ...] = ("left",)
    blanks: int = 1  # in each repetition
    people: int = _PEOPLE
    responses: tuple[str, ...] = WITH_NONE

    @property
    def each(self) -> list[tuple[str, float]]:
        """The stimuli of one repetition."""
        stimuli = [(side, level) for level in self.levels_vpp for side in self.sides]
        return [*stimuli, *[_BLANK] * self.blanks]

    @property
    def words(self) -> str:
        """What is printed of it."""
        stimuli = f"{len(self.each)} x {self.repeats}"
        if self.how in {"continuous", "staircase"}:
            stimuli = f"{len(self.each) * self.repeats} trials"
        places = ", two places" * (len(self.sides) > 1)
        people = {1: ", one person", _PEOPLE: ""}.get(self.people, f", {self.people} people")
        return f"{self.how.removesuffix(' a repetition')}{places}, {stimuli}{people}"


Stimuli = list[tuple[str, float]]


def _repetitions(order: Order, rng: np.random.Generator) -> Stimuli:
    return [order.each[i] for _ in range(order.repeats) for i in rng.permutation(len(order.each))]


def _shuffled(order: Order, rng: np.random.Generator) -> Stimuli:
    every = order.each * order.repeats
    return [every[i] for i in rng.permutation(len(every))]


def _downward(order: Order, rng: np.random.Generator) -> Stimuli:
    number = len(order.each) * order.repeats
    middle = np.linspace(len(order.each) - 1.0, 0.0, number) + rng.normal(0, 1.5, number)
    ranked = [_BLANK] * order.blanks + [
        (side, level) for level in order.levels_vpp for side in order.sides
    ]
    return [ranked[i] for i in middle.round().clip(0, len(ranked) - 1).astype(int)]


def _alternating(order: Order, rng: np.random.Generator) -> Stimuli:
    levels = [level for _, level in _shuffled(order, rng)]
    turn = (SIDES[i % 2] for i in range(len(levels)))
    return [(next(turn), level) if level else _BLANK for level in levels]


def _continuous(order: Order, rng: np.random.Generator) -> Stimuli:
    low, high = np.log10([order.levels_vpp[0], order.levels_vpp[-1]])
    return [
        (side, round(float(10 ** rng.uniform(low, high)), 2) if level else 0.0)
        for side, level in _shuffled(order, rng)
    ]


_DRAWN: Final = {
    "each once a repetition": _repetitions,
    "shuffled": _shuffled,
    "shuffled, breaks": _shuffled,
    "balanced": _repetitions,
    "downward": _downward,
    "sides in turn": _alternating,
    "continuous": _continuous,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Answered:
    """One session: stimuli and answers as places in `SIDES` and `RESPONSES`, levels, blocks."""

    stimulus: NDArray[np.int64]
    level_vpp: NDArray[np.float64]
    answer: NDArray[np.int64]
    block: NDArray[np.int64]

    @property
    def run(self) -> NDArray[np.int32]:
        """The run of each trial."""
        key = np.unique(self.level_vpp * 4 + self.stimulus * 1e6, return_inverse=True)[1]
        return runs(key.astype(np.int64), self.block)

    @property
    def linked(self) -> NDArray[np.bool_]:
        """Whether a trial follows the one before it."""
        return np.asarray(np.diff(self.block, prepend=-1) == 0)


def session(order: Order, median: Observer, rng: np.random.Generator) -> Answered:
    """Draw a person and let them answer."""
    person = draw_observer(median, 1.5, rng)
    number = len(order.each) * order.repeats
    block = np.zeros(number, dtype=np.int64)
    if order.how == "balanced":
        block = np.arange(number) // len(order.each)
    elif order.how == "shuffled, breaks":
        block = np.arange(number) // _BLOCK
    course_db = threshold_course_db(person, block.tolist(), rng)
    stimuli = _DRAWN[order.how](order, rng) if order.how in _DRAWN else []
    answers: list[int] = []
    level, last_db = order.levels_vpp[-1], 0.0
    for trial in range(number):
        if order.how == "staircase":
            stimuli.append((order.sides[0], round(level, 6)))
        side, level_vpp = stimuli[trial]
        now_db = course_db[trial] + last_db
        answer, _ = draw_answers(
            [person],
            (level_vpp * (side == "left"), level_vpp * (side == "right")),
            order.responses,
            60.0,
            rng,
            gains=OWN_FINGER_ONLY,
            shift_db=(now_db, now_db),
        )
        response = (*order.responses, "timeout")[answer.item()]
        last_db = person.last_answer_db / 2 * (1 if response == "none" else -1)
        level *= 10 ** ((2 if response == "none" else -2) / 20)
        answers.append(RESPONSES.index(response))
    return Answered(
        stimulus=np.array([SIDES.index(side) for side, _ in stimuli]),
        level_vpp=np.array([level for _, level in stimuli]),
        answer=np.array(answers),
        block=block,
    )


def effects(people: list[Answered], seed: int = 0) -> SerialEffects:
    """Return the effects of all together, as an analysis has them."""
    sessions = [
        Session(
            codes=(one.stimulus * len(RESPONSES) + one.answer).astype(np.int8),
            linked=one.linked,
            runs=one.run,
        )
        for one in people
    ]
    return serial_effects(
        [canonical([one]) for one in sessions],
        seed,
        none_offered=True,
        adaptive=levels_follow(people) < FOLLOWING_Z,
    )[1]


def levels_follow(people: list[Answered]) -> float:
    """Return by how many standard deviations levels rise after a detected stimulus."""
    run = [one.run.astype(np.int64) + 10_000 * i for i, one in enumerate(people)]
    return following_z(
        np.concatenate([np.where(one.stimulus < 2, one.level_vpp, np.nan) for one in people]),
        np.concatenate([one.stimulus == one.answer for one in people]),
        np.concatenate(run),
        np.concatenate([one.linked for one in people]),
    )


def drifts(people: list[Answered]) -> NDArray[np.float64]:
    """Return the probability of each person's drift."""
    tables = [
        pd.DataFrame(
            {
                "participant": str(i),
                "session": "01",
                "condition": "main",
                "trial": np.arange(len(one.answer)),
                "level_vpp": one.level_vpp,
                "side": np.array(SIDES)[one.stimulus],
                "response": np.array(RESPONSES)[one.answer],
            }
        )
        for i, one in enumerate(people)
    ]
    every = pd.concat(tables)
    return drift_p(every[every["side"].isin(["left", "right"])].reset_index(drop=True))[0]


def whole_trials_p(people: list[Answered], rng: np.random.Generator, draws: int = 999) -> float:
    """Return the p of `felt` against random orders of whole trials, stimulus and answer together.

    What an analysis must not do: it takes the order of the stimuli for an effect.
    """
    total = np.zeros(1 + draws)
    for one in people:
        order = np.tile(np.arange(len(one.answer))[:, None], 1 + draws)
        for block in np.unique(one.block):
            own = np.flatnonzero(one.block == block)
            order[own, 1:] = rng.permuted(order[own, 1:], axis=0)
        felt, single = (one.answer < 3)[order], (one.stimulus < 2)[order]
        linked = one.linked[1:, None] & single[1:] & (one.answer < 4)[order][1:]
        linked = linked & (one.answer < 4)[order][:-1]
        before, now = felt[:-1] & linked, felt[1:] & linked
        number = np.maximum(linked.sum(axis=0), 1)
        total += (before & now).sum(axis=0) - before.sum(axis=0) * now.sum(axis=0) / number
    above, below = (total[1:] >= total[0] - 1e-9).sum(), (total[1:] <= total[0] + 1e-9).sum()
    return float(min(1.0, 2 * (1 + min(above, below)) / (1 + draws)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """How many of so many have p < .05, and the mean difference."""

    small: int
    of: int
    difference: float = float("nan")

    def words(self, tables: int) -> str:
        """Return the share in %, or counts where few of so many tables tell it."""
        if not self.of:
            return "none told"
        if 2 * self.of < tables:
            return f"{self.small} of {self.of}"
        return f"{100 * self.small / self.of:.1f}"


def found(
    order: Order, median: Observer, tables: int, *, seed: int = 1, compared: bool = True
) -> dict[str, Found]:
    """Draw so many tables and count what is found in them.

    Of `correct`, `felt` and `side`, of the `drift` of each person, and, if `compared`, of `felt`
    against ``whole trials`` in random order.
    """
    told: dict[str, list[tuple[float, float]]] = {
        name: [] for name in ("correct", "felt", "side", "drift", "whole trials")
    }
    for number in range(tables):
        rng = np.random.default_rng((seed, number))
        people = [session(order, median, rng) for _ in range(order.people)]
        every = effects(people)
        for name in EFFECTS:
            one = getattr(every, name)
            if one.p is not None and one.difference is not None:
                told[name].append((one.p, one.difference))
        told["drift"] += [(p, 0.0) for p in drifts(people).tolist()]
        if compared:
            told["whole trials"].append((whole_trials_p(people, rng), 0.0))
    return {
        name: Found(
            small=sum(p < 0.05 for p, _ in values),
            of=len(values),
            difference=float(np.mean([d for _, d in values])) if values else float("nan"),
        )
        for name, values in told.items()
    }


SIDES_BOTH: Final = ("left", "right")
_ONCE: Final = Order(how="each once a repetition", repeats=12)
NO_EFFECT: Final[dict[str, tuple[Order, Observer]]] = {
    "": (_ONCE, HONEST),
    "one person": (replace(_ONCE, people=1), HONEST),
    "12 people": (replace(_ONCE, people=12, repeats=20), HONEST),
    "many lapses": (_ONCE, replace(HONEST, lapse_rate=0.15)),
    "few of a stimulus": (replace(_ONCE, levels_vpp=SPARSE_VPP, repeats=3), HONEST),
    "two": (replace(_ONCE, sides=SIDES_BOTH, blanks=2, repeats=8), HONEST),
    "shuffled": (replace(_ONCE, how="shuffled"), HONEST),
    "breaks": (Order(how="shuffled, breaks", repeats=12, sides=SIDES_BOTH, blanks=2), HONEST),
    "balanced": (Order(how="balanced", repeats=12, sides=SIDES_BOTH, blanks=2), HONEST),
    "downward": (replace(_ONCE, how="downward"), HONEST),
    "downward, few": (replace(_ONCE, how="downward", levels_vpp=SPARSE_VPP, repeats=6), HONEST),
    "turns": (Order(how="sides in turn", repeats=8, sides=SIDES_BOTH, blanks=2), HONEST),
    "biased": (
        Order(how="sides in turn", repeats=8, sides=SIDES_BOTH, blanks=2),
        replace(HONEST, side_bias=0.2, false_alarm_rate=0.3),
    ),
    "continuous": (replace(_ONCE, how="continuous"), HONEST),
    "staircase, one": (
        Order(how="staircase", repeats=40, levels_vpp=(98.0,), blanks=0, people=1),
        HONEST,
    ),
    "staircase": (Order(how="staircase", repeats=60, levels_vpp=(98.0,), blanks=0), HONEST),
}
"""Orders, and people in them without a serial effect."""
DRIFT: Final[dict[str, tuple[Order, Observer]]] = {
    f"{name}, {what}": (NO_EFFECT[name][0], person)
    for what, person in (
        ("drift", replace(HONEST, drift_db=4.0)),
        ("block drift", replace(HONEST, block_drift_db=2.0)),
        ("wander", replace(HONEST, wander_db=1.4, wander_trials=11.0)),
    )
    for name in ("", "breaks", "balanced")
}
LAST: Final[dict[str, tuple[Order, Observer]]] = {
    f"{name}, {db}": (NO_EFFECT[name][0], replace(HONEST, last_answer_db=db))
    for name in ("", "12 people", "few of a stimulus", "balanced")
    for db in (0.35, 1.0, 2.0)
}


TABLES: Final = 400
"""Of people without an effect; of others half as many."""


def _what(median: Observer) -> str:
    """Say what differs from the honest person."""
    named = {"lapse_rate": "lapses", "side_bias": "says left"}
    told = [
        f", {words} {getattr(median, key):g}"
        for key, words in named.items()
        if getattr(median, key) != getattr(HONEST, key)
    ]
    return "".join(told)


_UNTOLD: Final = "downward"
"""Of those without an effect, which the tests have and the page has not."""


def _cell(name: str, one: dict[str, Found], tables: int) -> str:
    if name == "difference":
        return f"{one['felt'].difference:+.3f}"
    return one[name].words(tables)


def _beside(name: str, told: list[dict[str, Found]], tables: int) -> str:
    """Return least and most of what has no column, where most tables tell it."""
    key = "felt" if name == "difference" else name
    some = [one for one in told if 2 * one[key].of >= max(tables, 1)]
    cells = sorted((_cell(name, one, tables) for one in some), key=float)
    return f"`{name}` {cells[0]} to {cells[-1]}" if cells else f"`{name}` of none"


def _table(
    title: str,
    kinds: dict[str, tuple[Order, Observer]],
    tables: int,
    columns: tuple[str, ...],
    others: tuple[str, ...],
) -> list[str]:
    """Return the lines of a table: a row for each order, in a cell a number for each people."""
    rows: dict[str, list[dict[str, Found]]] = {}
    for order, median in kinds.values():
        told = rows.setdefault(order.words + _what(median), [])
        told.append(found(order, median, tables, compared="whole trials" in columns))
    every = [one for told in rows.values() for one in told]
    beside = ", ".join(_beside(name, every, tables) for name in others)
    return [
        "",
        f"{title}, {tables} tables each ({beside}):",
        "",
        f"| order | {' | '.join(columns)} |",
        "|---" * (1 + len(columns)) + "|",
        *(
            f"| {words} | "
            + " | ".join(", ".join(_cell(name, one, tables) for one in told) for name in columns)
            + " |"
            for words, told in rows.items()
        ),
    ]


_WORDS: Final = (
    "Simulated people (62 V, 1.5 dB between people, sigma 0.1, lapses 0.03, false alarms 0.05) who "
    f"can say none, a session each; levels {LEVELS_VPP[0]:g} to {LEVELS_VPP[-1]:g} V (where there "
    f"are 13 stimuli, {SPARSE_VPP[0]:g} to {SPARSE_VPP[-1]:g} V) and blanks. Beside each order: "
    "stimuli x trials of each; unless told there is one place, and a table has five people. "
    "Columns: per cent of tables with p < 0.05 of `felt`, `correct` and `side`, of sessions with "
    "that of a `drift`, of tables with that of `felt` against [random orders of whole "
    "trials](statistics.md#13-simulated-studies); the mean `difference` of `felt`. 95 % limits "
    "(Wilson) of 5 % are 3.3 to 7.6 % by 400 tables and 2.7 to 9.0 % by 200, of 50 % 45 to 55 and "
    "43 to 57 %; those of a drift are narrower."
)


def section() -> str:
    """Return the section of the page."""
    few = TABLES // 2
    none = {name: one for name, one in NO_EFFECT.items() if name != _UNTOLD}
    lines = [
        *_table(
            "No serial effect",
            none,
            TABLES,
            ("felt", "correct", "drift", "whole trials"),
            ("side", "difference"),
        ),
        *_table(_DRIFTING, DRIFT, few, ("felt", "correct", "drift", "difference"), ("side",)),
        *_table(_LOWER, LAST, few, ("felt", "correct", "difference"), ("side", "drift")),
    ]
    return "\n".join(["## Serial effects", "", _WORDS, *lines, ""])


_DRIFTING: Final = (
    "None, but thresholds that drift by 4 dB, drift by 2 dB in each block, or wander by 1.4 dB"
)
_LOWER: Final = "Thresholds lower after something was felt, by 0.35, 1 and 2 dB"
