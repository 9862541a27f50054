"""How many trials were read, of which kinds, and whose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from analysis.reading.load import LoadedTrials


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """How many of what; every trial is in exactly one of single, both, blank and left_out.

    Attributes
    ----------
    trials : int
        All trials that were read.
    single : int
        Single stimuli that count.
    both : int
        Both-finger trials that count.
    blank : int
        Blank trials that count.
    left_out : int
        Trials that do not count.
    timeouts : int
        Trials that count, without an answer in time.
    invalid : int
        Trials that count, with another key.
    participants : int
        Different ones among all trials read.
    sessions : int
        Their sessions; each belongs to a participant.
    conditions : int
        Different ones among all trials read.
    simulated : int
        Trials of simulated participants.
    without_device : int
        Trials of people on a mock device or an emulator.
    unread : int
        Rows of tables made elsewhere that a map leaves out.
    unread_files : int
        Files that it leaves out, whose rows nobody counted.
    """

    trials: int
    single: int
    both: int
    blank: int
    left_out: int
    timeouts: int
    invalid: int
    participants: int
    sessions: int
    conditions: int
    simulated: int
    without_device: int
    unread: int = 0
    unread_files: int = 0


def counts_of(loaded: LoadedTrials) -> Counts:
    """Count trials, or what a table of counts presented."""
    if loaded.cells is not None:
        return _counts_of(loaded, loaded.cells)
    trials = loaded.trials
    counted = trials[trials["reason"].eq("")]
    kinds, answers = counted["kind"].astype(object), counted["response"].astype(object)
    return Counts(
        trials=len(trials),
        single=int(kinds.eq("single").sum()),
        both=int(kinds.eq("both").sum()),
        blank=int(kinds.eq("blank").sum()),
        left_out=len(trials) - len(counted),
        timeouts=int(answers.eq("timeout").sum()),
        invalid=int(answers.eq("invalid").sum()),
        participants=trials["participant"].nunique(),
        sessions=len(trials[["participant", "session"]].drop_duplicates()),
        conditions=trials["condition"].nunique(),
        simulated=int(trials["simulated"].sum()),
        without_device=int(without_device(trials).sum()),
        unread=loaded.left_out,
        unread_files=loaded.left_out_files,
    )


def _counts_of(loaded: LoadedTrials, cells: pd.DataFrame) -> Counts:
    """Count what a table of counts presented: single stimuli and blanks, each person a session."""
    presented, people = int(cells["presented"].sum()), cells["participant"].nunique()
    blanks = 0 if loaded.blanks is None else int(loaded.blanks["presented"].sum())
    return Counts(
        trials=presented + blanks,
        single=presented,
        both=0,
        blank=blanks,
        left_out=0,
        timeouts=0,
        invalid=0,
        participants=people,
        sessions=people,
        conditions=cells["condition"].nunique(),
        simulated=0,
        without_device=0,
        unread=loaded.left_out,
        unread_files=loaded.left_out_files,
    )


def without_device(trials: pd.DataFrame) -> pd.Series[bool]:
    """Tell which trials are of a person whose device moves nothing.

    >>> import pandas as pd
    >>> kinds = {"simulated": [False, False, True], "device_kind": ["mock", None, "mock"]}
    >>> without_device(pd.DataFrame(kinds)).tolist()
    [True, False, False]
    """
    return ~trials["simulated"].astype(bool) & trials["device_kind"].isin(["mock", "emulated"])
