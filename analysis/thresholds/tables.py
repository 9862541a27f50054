"""Tables of counts: from arrays, which are checked, from trials, and from tables of counts."""

from __future__ import annotations

import reprlib
from typing import TYPE_CHECKING, Final, get_args

import numpy as np
import pandas as pd

from analysis.axis import LARGEST, VOLTS, Axis, XScale
from analysis.counts.intervals import checked_counts
from analysis.counts.table import PERSON, count_answers, count_levels, counted
from analysis.task_columns import task_of
from analysis.thresholds.function import FunctionName
from analysis.thresholds.guess import (
    GuessRate,
    chances_of,
    forced_guess_rate,
    guess_rate_of,
)
from analysis.thresholds.likelihood import Tables

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from analysis.reading.trials import LoadedTrials

    Floats = NDArray[np.float64]

MAX_PRESENTED: Final = 10**12


def checked_tables(
    levels: ArrayLike,
    detected: ArrayLike,
    presented: ArrayLike,
    guess_rate: float | GuessRate | None = None,
    blanks: tuple[ArrayLike, ArrayLike] | None = None,
    *,
    x_scale: XScale = "log10",
    function: FunctionName = "normal",
    name: str = "levels",
) -> Tables:
    """Check the counts of people, (people, levels).

    `name` is what messages call the levels.
    """
    if function not in get_args(FunctionName):
        allowed = ", ".join(get_args(FunctionName))
        raise ValueError(f"function must be one of {allowed}; got {function!r}")
    if function == "weibull" and x_scale == "linear":
        raise ValueError('function="weibull" needs x_scale="log10"; on a linear axis use "gumbel"')
    k, n = checked_counts(detected, presented)
    x = np.asarray(levels)
    if x.ndim != 1 or k.shape != n.shape or k.shape != (len(np.atleast_1d(k)), x.size):
        raise ValueError(
            f"detected and presented must have the length of {name}, for each person; got the "
            f"shapes {k.shape}, {n.shape} and {x.shape}"
        )
    if (n > MAX_PRESENTED).any():
        raise ValueError(f"presented must be at most {MAX_PRESENTED:.0e}; got {n.max():g}")
    if not (n > 0).any(axis=1).all():
        raise ValueError("presented must hold at least one stimulus of each person; got none")
    return Tables(
        levels=np.broadcast_to(_checked_levels(x, x_scale, name), k.shape),
        detected=k,
        presented=n,
        guesses=_guess_rates(len(k), guess_rate, blanks),
        axis=Axis(x_scale=x_scale, unit="dB" if x_scale == "dB" else "level"),
        function=function,
    )


def _checked_levels(levels: NDArray[np.generic], x_scale: XScale, name: str) -> Floats:
    """Return levels that can lie on the axis."""
    if levels.size and levels.dtype.kind not in "iuf":
        raise ValueError(f"{name} must be finite numbers; got {reprlib.repr(levels.tolist())}")
    x = levels.astype(np.float64)
    if not (np.abs(x) <= LARGEST).all():
        wrong = reprlib.repr(x[~(np.abs(x) <= LARGEST)].tolist())
        raise ValueError(f"{name} must be finite and at most {LARGEST:g}; got {wrong}")
    if x_scale not in get_args(XScale):
        raise ValueError(f"x_scale must be one of {', '.join(get_args(XScale))}; got {x_scale!r}")
    if x_scale == "log10" and (x <= 0).any():
        raise ValueError(
            f"{name} must be above 0 on the axis log10; got {reprlib.repr(x[x <= 0].tolist())}: "
            'use x_scale="dB" for levels in dB, else x_scale="linear"'
        )
    return x


def _guess_rates(
    people: int, guess_rate: float | GuessRate | None, blanks: tuple[ArrayLike, ArrayLike] | None
) -> list[GuessRate]:
    """Return the guess rate of each person, known or after blank trials."""
    if guess_rate is not None and blanks is None:
        rate = guess_rate if isinstance(guess_rate, GuessRate) else GuessRate(mean=guess_rate)
        return [rate] * people
    if blanks is None or guess_rate is not None:
        raise ValueError("exactly one of guess_rate and blanks must be given")
    answered, shown = checked_counts(*blanks)
    if answered.shape != (people,) or shown.shape != (people,):
        raise ValueError(
            f"blanks must be two lists of {people}, a number for each person; got the shapes "
            f"{answered.shape} and {shown.shape}"
        )
    return [
        GuessRate.after_blanks(answered=float(a), blanks=int(b))
        for a, b in zip(answered, shown, strict=True)
    ]


def tables_in(loaded: LoadedTrials, cells: pd.DataFrame) -> Tables:
    """Return the tables of trials, or of a table of counts where there is one, and of its cells."""
    blanks = _count_sided_answers(loaded.trials) if loaded.cells is None else loaded.blanks
    forced = forced_guess_rate(task_of(loaded.trials), loaded.alternatives)
    return tables_of_counts(cells, blanks, axis=loaded.axis, forced=forced)


def tables_of(
    trials: pd.DataFrame, *, axis: Axis = VOLTS, alternatives: int | None = None
) -> Tables:
    """Count the single stimuli and their detections, and find what guesses are worth.

    `alternatives` are those of a forced choice, by default as the task has them.

    >>> import pandas as pd
    >>> from experiment.tasks import LEFT_RIGHT_BOTH
    >>> left, right = LEFT_RIGHT_BOTH.sites
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": left, "level_vpp": [60.0, 60.0, 90.0], "reason": "",
    ...     "response": [left, right, left], "none_offered": True})
    >>> tables = tables_of(trials)
    >>> tables.names, tables.detected.tolist(), tables.presented.tolist()
    ((('main', '1'),), [[1.0, 1.0]], [[2.0, 1.0]])
    """
    cells, blanks = count_levels(count_answers(trials)), _count_sided_answers(trials)
    forced = forced_guess_rate(task_of(trials), alternatives)
    return tables_of_counts(cells, blanks, axis=axis, forced=forced)


def tables_of_counts(
    cells: pd.DataFrame,
    blanks: pd.DataFrame | None = None,
    *,
    axis: Axis = VOLTS,
    forced: GuessRate | None = None,
) -> Tables:
    """Lay cells and blanks of `analysis.reading.foreign.sum_counts` out by participant."""
    always = cells.groupby(PERSON)["none_offered"].all()
    answered = {} if blanks is None else blanks.set_index(PERSON).to_dict("index")
    guesses = {}
    for name, none_offered in always.items():
        answers = answered.get(name, {"felt": 0, "sides": 1, "presented": 0})
        guesses[name] = guess_rate_of(
            none_offered=bool(none_offered),
            sided_answers=answers["felt"] / answers["sides"],
            blanks=int(answers["presented"]),
            forced=forced,
        )
    cells = cells.sort_values([*PERSON, "level_vpp"])
    people = cells.groupby(PERSON)
    row, column = people.ngroup().to_numpy(), people.cumcount().to_numpy()
    names = tuple(dict.fromkeys(zip(cells["condition"], cells["participant"], strict=True)))
    shape = (len(names), int(column.max(initial=0)) + 1)
    levels, detected, presented = np.ones(shape), np.zeros(shape), np.zeros(shape)
    levels[row, column] = cells["level_vpp"]
    detected[row, column] = cells["detected"]
    presented[row, column] = cells["presented"]
    return Tables(
        levels=levels,
        detected=detected,
        presented=presented,
        guesses=[guesses[name] for name in names],
        names=names,
        axis=axis,
    )


def _count_sided_answers(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the blank trials, and the chance hits among them, as `sum_counts` of counts does.

    A chance hit is an answer that would detect a single stimulus. Of a task with stimuli at one
    side only, answers with the other are none.
    """
    single, blank = counted(trials, "single"), counted(trials, "blank")
    presented = single.astype({"side": object}).groupby(PERSON, observed=True)["side"].unique()
    chances = {person: chances_of(task_of(trials), sides) for person, sides in presented.items()}
    answers = blank[[*PERSON, "response"]].itertuples(index=False, name=None)
    hits = [
        chances.get(person, {}).get(answer, 0.0)
        for *key, answer in answers
        for person in [tuple(key)]
    ]
    groups = blank[PERSON].assign(hits=hits).groupby(PERSON, observed=True)["hits"]
    people = pd.DataFrame({"felt": groups.sum(), "presented": groups.size(), "sides": 1})
    return people.reset_index()
