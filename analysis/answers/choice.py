"""What was answered to what: confusion, information, sensitivity, sides and serial effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from analysis.answers.counting import COUNTED_KINDS, offers_none
from analysis.answers.information import WORDS, Information, information
from analysis.answers.sensitivity import (
    Sensitivity,
    Share,
    SidePreference,
    detection_sensitivity,
    mean_sensitivity,
    side_preference,
    spatial_sensitivity,
)
from analysis.answers.serial import (
    FOLLOWING_Z,
    Canonical,
    SerialEffects,
    Session,
    canonical,
    following_z,
    runs,
    serial_effects,
)
from analysis.definitions import TOTAL
from experiment.rows import RESPONSES, SIDES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray


CONFUSION_COLUMNS = ("condition", "kind", "side", *RESPONSES, "presented")
_KIND_OF_SIDE = ("single", "single", "both", "blank")
_LEFT, _RIGHT, _BOTH, _NONE = range(WORDS)
_SINGLE = [_LEFT, _RIGHT]
_FELT = [_LEFT, _RIGHT, _BOTH]


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """What one participant, or all in one condition, answered.

    Attributes
    ----------
    condition, participant : str
        Whose; `analysis.definitions.TOTAL` are all of that condition.
    over_report, mislocalised : Share
        Single stimuli answered ``both``, and with the other side.
    information : Information
        Of stimuli left, right, both, none and the same answers.
    detection : Sensitivity
        Felt single stimuli against felt blank trials.
    spatial : Sensitivity
        Left against right among left and right answers to single stimuli.
    wrong_side : SidePreference
        Left and right among the answers with the other side.
    blank_side : SidePreference
        Left and right answered to blank trials.
    extinction : SidePreference
        Only left and only right answered to both-finger trials.
    both : Share
        Both-finger trials answered ``both``.
    serial : SerialEffects
        Dependence on the trial before.
    """

    condition: str
    participant: str
    over_report: Share
    mislocalised: Share
    information: Information
    detection: Sensitivity
    spatial: Sensitivity
    wrong_side: SidePreference
    blank_side: SidePreference
    extinction: SidePreference
    both: Share
    serial: SerialEffects


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Coded:
    """The n trials of one condition that count, sorted, as codes."""

    names: tuple[str, ...]  # participants, sorted
    person: NDArray[np.int64]  # position in `names`
    stimulus: NDArray[np.int64]  # position in `SIDES`
    answer: NDArray[np.int64]  # position in `RESPONSES`
    level: NDArray[np.float64]  # of a single stimulus, else nan
    session: NDArray[np.int64]  # a number that changes where another session begins
    run: NDArray[np.int32]  # of the trials of a session, as `runs` numbers them
    linked: NDArray[np.bool_]  # follows directly the one before it in the plan of the same block

    def counts(self) -> NDArray[np.int64]:
        """Count answers, shape (P, 4, 6)."""
        shape = (len(self.names), len(SIDES), len(RESPONSES))
        flat = np.ravel_multi_index((self.person, self.stimulus, self.answer), shape)
        return np.bincount(flat, minlength=int(np.prod(shape))).reshape(shape).astype(np.int64)

    def sequences(self) -> list[Canonical]:
        """Return each participant's sessions as `canonical` writes them."""
        codes = (self.stimulus * len(RESPONSES) + self.answer).astype(np.int8)
        sessions: list[list[Session]] = [[] for _ in self.names]
        for of in _parts(self.session):
            one = Session(codes=codes[of], linked=self.linked[of], runs=self.run[of])
            sessions[self.person[of.start]].append(one)
        return [canonical(each) for each in sessions]

    def adaptive(self) -> bool:
        """Tell whether levels follow from the answers before them."""
        run = self.session * (int(self.run.max(initial=0)) + 1) + self.run
        return following_z(self.level, self.stimulus == self.answer, run, self.linked) < FOLLOWING_Z


def _parts(numbers: NDArray[np.int64]) -> Iterator[slice]:
    """Yield where each number stands, for numbers that do not come again."""
    starts = np.flatnonzero(np.diff(numbers, prepend=-1)).tolist()
    yield from map(slice, starts, [*starts[1:], len(numbers)])


def confusion_table(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the answers to each kind of stimulus, over levels and participants.

    Columns `CONFUSION_COLUMNS`; one row per condition, kind and side that was presented. The
    answers of a row add up to ``presented``.

    >>> trials = pd.DataFrame({"condition": "main", "kind": "single", "side": "left",
    ...     "response": ["left", "both"], "reason": ""})
    >>> confusion_table(trials)[["side", "left", "both", "presented"]].to_numpy().tolist()
    [['left', 1, 1, 2]]
    """
    rows = []
    for condition, part in _counted(trials).groupby("condition"):
        stimulus, answer = _codes(part["side"], SIDES), _codes(part["response"], RESPONSES)
        shape = (len(SIDES), len(RESPONSES))
        flat = np.bincount(stimulus * len(RESPONSES) + answer, minlength=len(SIDES) * shape[1])
        for kind, side, counts in zip(_KIND_OF_SIDE, SIDES, flat.reshape(shape), strict=True):
            if counts.any():
                rows.append([condition, kind, side, *counts.tolist(), int(counts.sum())])
    return pd.DataFrame(rows, columns=list(CONFUSION_COLUMNS))


def choices(trials: pd.DataFrame, seed: int = 0) -> tuple[Choices, ...]:
    """Return what was answered to what, by condition and participant.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    seed : int
        Of the permutations, at least 0. They depend on it and on what was observed: neither the
        order of rows nor names change a value, and exchanging left and right mirrors all of them.

    Returns
    -------
    tuple of Choices
        Sorted by condition and participant; the last of each condition is `TOTAL`.

    Raises
    ------
    ValueError
        For a seed below 0.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "session": "01", "block": 1,
    ...     "trial": [1, 2], "attempt": 1, "kind": "single", "side": ["left", "right"],
    ...     "level_vpp": 60.0, "response": ["left", "both"], "reason": "",
    ...     "none_offered": False})
    >>> [(one.participant, one.over_report.p) for one in choices(trials)]
    [('1', 0.5), ('all', 0.5)]
    """
    chosen = _counted(trials)
    parts = chosen.groupby("condition")
    return tuple(one for name, part in parts for one in _condition(str(name), part, seed))


def _condition(condition: str, part: pd.DataFrame, seed: int) -> Iterator[Choices]:
    coded, offered = _coded(part), offers_none(part)
    counts = coded.counts()
    serial, together = serial_effects(
        coded.sequences(), seed, none_offered=offered, adaptive=coded.adaptive()
    )
    detections = [_detection(each, none_offered=offered) for each in counts]
    spatials = [_spatial(each) for each in counts]
    told, told_together = information(counts[:, :, :WORDS], seed)
    parts = zip(told, detections, spatials, serial, strict=True)
    for name, each, given in zip(coded.names, counts, parts, strict=True):
        yield _choices((condition, name), each, given)
    means = (mean_sensitivity(tuple(detections)), mean_sensitivity(tuple(spatials)))
    yield _choices((condition, TOTAL), counts.sum(axis=0), (told_together, *means, together))


def _choices(
    whose: tuple[str, str],
    table: NDArray[np.int64],
    given: tuple[Information, Sensitivity, Sensitivity, SerialEffects],
) -> Choices:
    """Put together what follows from the counts, shape (4, 6), and what is given."""
    told, detection, spatial, serial = given
    single, to_both, to_blank = table[_SINGLE], table[_BOTH], table[_NONE]
    presented = int(single.sum())
    to_left, to_right = int(table[_RIGHT, _LEFT]), int(table[_LEFT, _RIGHT])
    sided = single[:, _SINGLE].sum(axis=1)
    return Choices(
        condition=whose[0],
        participant=whose[1],
        over_report=Share(count=int(single[:, _BOTH].sum()), of=presented),
        mislocalised=Share(count=to_left + to_right, of=presented),
        information=told,
        detection=detection,
        spatial=spatial,
        wrong_side=side_preference(
            to_left,
            to_right,
            odds=(int(sided[_RIGHT]), int(sided[_LEFT])),
            of="single stimulus was answered with the other side",
        ),
        blank_side=_preference(to_blank, "blank trial was answered left or right"),
        extinction=_preference(to_both, "both-finger trial was answered left or right"),
        both=Share(count=int(to_both[_BOTH]), of=int(to_both.sum())),
        serial=serial,
    )


def _preference(answers: NDArray[np.int64], of: str) -> SidePreference:
    return side_preference(int(answers[_LEFT]), int(answers[_RIGHT]), of=of)


def _detection(table: NDArray[np.int64], *, none_offered: bool) -> Sensitivity:
    single, blank = table[_SINGLE].sum(axis=0), table[_NONE]
    return detection_sensitivity(
        Share(count=int(single[_FELT].sum()), of=int(single.sum())),
        Share(count=int(blank[_FELT].sum()), of=int(blank.sum())),
        reason="" if none_offered else '"none" was not offered',
    )


def _spatial(table: NDArray[np.int64]) -> Sensitivity:
    left, right = table[_LEFT], table[_RIGHT]
    return spatial_sensitivity(
        Share(count=int(left[_LEFT]), of=int(left[_SINGLE].sum())),
        Share(count=int(right[_LEFT]), of=int(right[_SINGLE].sum())),
    )


def _counted(trials: pd.DataFrame) -> pd.DataFrame:
    return trials[trials["reason"].eq("") & trials["kind"].isin(COUNTED_KINDS)]


def _codes(words: pd.Series[str], known: tuple[str, ...]) -> NDArray[np.int64]:
    codes = pd.Index(known, dtype=object).get_indexer(pd.Index(words, dtype=object))
    if np.any(codes < 0):
        raise ValueError(f"{words.name} must be one of {', '.join(known)} where a trial counts")
    return np.asarray(codes, dtype=np.int64)


def _coded(part: pd.DataFrame) -> _Coded:
    """Sort and code the trials of a condition; a trial links to its neighbour in the plan.

    A trial that was presented again came later than its number says: it links to nothing.
    """
    ordered = part.sort_values(["participant", "session", "block", "trial", "attempt"])
    names = sorted(ordered["participant"].unique())
    place = ["participant", "session", "block"]
    new = ordered[place].ne(ordered[place].shift()).to_numpy(np.int64)
    session, block = np.cumsum([new[:, :2].max(axis=1), new.max(axis=1)], axis=1, dtype=np.int64)
    first = ordered["attempt"].eq(1).to_numpy()
    follows = np.diff(ordered["trial"].to_numpy(), prepend=-1) == 1
    equal = ordered.groupby(["side", "level_vpp"], observed=True, dropna=False).ngroup()
    stimulus = np.asarray(equal.to_numpy(), dtype=np.int64)
    single = ordered["kind"].eq("single").to_numpy()
    return _Coded(
        names=tuple(names),
        person=_codes(ordered["participant"], tuple(names)),
        stimulus=_codes(ordered["side"], SIDES),
        answer=_codes(ordered["response"], RESPONSES),
        level=np.where(single, ordered["level_vpp"].to_numpy(float), np.nan),
        session=session,
        run=np.concatenate([runs(stimulus[of], block[of]) for of in _parts(session)]),
        linked=(np.diff(block, prepend=0) == 0) & follows & first & np.roll(first, 1),
    )
