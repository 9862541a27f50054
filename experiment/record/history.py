"""What a journal says: the rows of trials.csv, and what is left to do after an interruption."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

from device.clock import MachineTime
from experiment.record.entries import (
    LevelChosen,
    MarkerSent,
    MeasuredRow,
    ResponseGiven,
    SessionClosed,
    SessionOpened,
    SessionResumed,
    StimulusConfirmed,
    StimulusMeasured,
    TrialArmed,
    TrialEnded,
    lines_of,
)
from experiment.record.journal import JournalError
from experiment.record.rows import SCHEMA, TrialRow
from experiment.trial.events import Attempt
from experiment.trial.plan import HANDS_OFF

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from experiment.perception.gains import FingerGains
    from experiment.record.entries import Entry
    from experiment.trial.plan import Plan, Trial


@dataclass(slots=True)
class Presentation:
    """What the journal says of one attempt at one trial.

    Attributes
    ----------
    attempt : Attempt
        The trial and its attempt.
    boot_id : int
        The device's power cycle.
    device_kind : str or None
        The kind of the device.
    onset_clock : int
        The clock of its onset.
    interval : int
        The observation interval that was armed last; 0 before the first.
    token : int
        The token by which the device knows the burst of this interval; 0 before it was armed.
    confirmed : dict of int to StimulusConfirmed
        What the device reported about each interval's burst.
    measured : dict of int to StimulusMeasured
        What a monitor measured of it.
    response : ResponseGiven or None
        The answer of the participant.
    end : TrialEnded or None
        How the trial ended; None for the trial in which the session was interrupted.
    """

    attempt: Attempt
    boot_id: int
    device_kind: str | None
    onset_clock: int
    interval: int = 0
    token: int = 0
    confirmed: dict[int, StimulusConfirmed] = field(default_factory=dict)
    measured: dict[int, StimulusMeasured] = field(default_factory=dict)
    response: ResponseGiven | None = None
    end: TrialEnded | None = None

    @property
    def trial(self) -> Trial:
        """The trial."""
        return self.attempt.trial

    @property
    def is_mismatch(self) -> bool:
        """Whether a monitor measured another burst than the planned one in any interval."""
        return any(line.burst_verified == "false" for line in self.measured.values())

    def add(self, line: _TrialLine) -> None:
        """Add a line about this attempt."""
        match line:
            case TrialArmed():
                self.interval, self.token = line.interval, line.token
            case StimulusConfirmed():
                self.confirmed[line.interval] = line
            case StimulusMeasured():
                self.measured[line.interval] = line
            case ResponseGiven():
                self.response = line
            case TrialEnded():
                self.end = line


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """Everything that a journal says about its session.

    Attributes
    ----------
    rows : tuple of TrialRow
        One row per presented trial, in the order of presentation.
    measured : tuple of MeasuredRow
        One row per burst that a monitor measured.
    pending : tuple of Attempt
        The planned trials without an answer, in the order in which they are due.
    interrupted : Presentation or None
        The trial in which the session was interrupted.
    opening : SessionOpened or None
        The first line: host, device and participant; None if the journal is empty.
    warm_up : tuple of Attempt
        The plan's warm-up trials, for the next resume.
    finished : bool
        Whether the session was closed with every planned trial answered.
    last_t_s : float
        Time of the last line on the session's clock.
    last : MachineTime
        The same by the host's own clocks.
    last_token : int
        The largest token of a stimulus so far, 0 before the first.
    onset_clock : int
        1, and one more for every time that the session's clock was broken.
    recording_start_s : float
        When other recordings were first sent the marker of the session's begin, on its clock; 0 if
        none was sent.
    """

    rows: tuple[TrialRow, ...]
    measured: tuple[MeasuredRow, ...]
    pending: tuple[Attempt, ...]
    interrupted: Presentation | None
    opening: SessionOpened | None
    warm_up: tuple[Attempt, ...]
    finished: bool
    last_t_s: float
    last: MachineTime
    last_token: int
    onset_clock: int
    recording_start_s: float

    def due(self, *, warm_up: bool) -> tuple[Attempt, ...]:
        """Return the trials to be presented in the next visit, in their order.

        Parameters
        ----------
        warm_up : bool
            Whether warm-up trials come before the next trial on the plate, if there is one.
        """
        hands_on = any(attempt.trial.kind != HANDS_OFF for attempt in self.pending)
        again = self.warm_up if warm_up and hands_on else ()
        return tuple(sorted((*again, *self.pending), key=lambda attempt: attempt.trial.block))


_TrialLine: TypeAlias = (
    TrialArmed | StimulusConfirmed | StimulusMeasured | ResponseGiven | TrialEnded
)


def replay(plan: Plan, entries: Iterable[Entry]) -> History:
    """Rebuild the history of a session from the lines of its journal.

    Parameters
    ----------
    plan : Plan
        The plan of the session.
    entries : iterable of Entry
        The verified lines of its journal, from the first line on, as `read_journal` returns them.

    Returns
    -------
    History
        ``rows``: one `TrialRow` per presented trial; ``pending``: the planned trials without an
        answer; ``interrupted``: the trial in which the session was interrupted, or None;
        ``finished``: whether the session is complete.

    Raises
    ------
    JournalError
        If the journal belongs to another plan, names a trial that the plan does not have, or
        continues after a trial that has no end.

    Examples
    --------
    Wherever a session is interrupted, the valid and the pending trials make up the plan:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment import paper_study, read_journal, simulate_study
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> with TemporaryDirectory() as results:
    ...     folder, = simulate_study(study, Path(results), participants=1, seed=7, gains=())
    ...     plan, entries = folder.read_plan(), read_journal(folder.journal_path).entries
    >>> replay(plan, entries).finished
    True
    >>> history = replay(plan, entries[:100])
    >>> valid = sum(row.status == "ok" for row in history.rows)
    >>> valid + len(history.pending) == len(plan.trials)
    True
    """
    entries = tuple(entries)
    opening = _opening(plan, entries)
    shown = _presentations(plan, entries)
    ended = [p for p in shown if p.end is not None]
    resumes = lines_of(entries, SessionResumed)
    unended = [p for p in shown if p.end is None]
    # A session has one trial at a time, so that only the last can have been cut off. One that is
    # open further up is a lost line or a second writer, and its row would be made up.
    if len(unended) > 1 or (unended and unended[0] is not shown[-1]):
        raise JournalError(f"trial {unended[0].trial.number} was never ended, yet others followed")
    pending, warm_up = _due(plan, ended)
    gains = {name: plan.gains_of(name) for name in {p.trial.condition for p in ended}}
    return History(
        measured=tuple(
            MeasuredRow(**_trial_columns(plan, p), measured=measured)
            for p in ended
            for measured in p.measured.values()
        ),
        rows=tuple(_row(plan, p, p.end, gains, opening) for p in ended if p.end and opening),
        pending=pending,
        interrupted=unended[0] if unended else None,
        opening=opening,
        warm_up=warm_up,
        finished=any(line.finished for line in lines_of(entries, SessionClosed)),
        last_t_s=entries[-1].t_s if entries else 0.0,
        last=_last(entries),
        last_token=max((p.token for p in shown), default=0),
        onset_clock=1 + sum(line.session_clock == "broken" for line in resumes),
        recording_start_s=next((line.at_s for line in lines_of(entries, MarkerSent)), 0.0),
    )


def _last(entries: tuple[Entry, ...]) -> MachineTime:
    lines = [entry.line for entry in entries]
    boots = [line.host_boot for line in lines if isinstance(line, SessionOpened | SessionResumed)]
    return MachineTime(
        boot=boots[-1] if boots else None,
        up_s=entries[-1].up_s if entries else 0.0,
        wall_s=entries[-1].wall_s if entries else 0.0,
    )


def _opening(plan: Plan, entries: tuple[Entry, ...]) -> SessionOpened | None:
    if not entries:
        return None
    first = entries[0].line
    if not isinstance(first, SessionOpened):
        raise JournalError(f"the first line must be session_open; got {first.event}")
    if first.plan_sha256 != plan.sha256:
        raise JournalError(
            f"the journal belongs to the plan {first.plan_sha256[:12]}..., "
            f"not to this one, {plan.sha256[:12]}...; nothing was changed"
        )
    return first


def _presentations(plan: Plan, entries: Iterable[Entry]) -> list[Presentation]:
    trials = {trial.number: trial for trial in (*plan.trials, *plan.warm_up)}
    shown: dict[tuple[int, int], Presentation] = {}
    chosen: dict[tuple[int, int], LevelChosen] = {}
    boot_id, device_kind, onset_clock = 0, None, 1
    for line in (entry.line for entry in entries):
        # A token is valid only in the power cycle that received it. The lines of a trial do not
        # repeat the power cycle, the kind of device, or whether the clock continued; the last
        # opening of the session above them has all three.
        if isinstance(line, SessionOpened | SessionResumed):
            boot_id, device_kind = line.boot_id, line.device_kind
        if isinstance(line, SessionResumed):
            onset_clock += line.session_clock == "broken"
        if not isinstance(line, _TrialLine | LevelChosen):
            continue
        if line.trial not in trials:
            raise JournalError(
                f"the journal names trial {line.trial}, which the plan does not have"
            )
        if isinstance(line, LevelChosen):
            # A choice counts once its trial is armed: until then nothing was presented.
            chosen[line.trial, line.attempt] = line
            continue
        presentation = shown.setdefault(
            (line.trial, line.attempt),
            Presentation(
                Attempt(trials[line.trial], line.attempt), boot_id, device_kind, onset_clock
            ),
        )
        if presentation.end is not None:
            raise JournalError(f"trial {line.trial}, attempt {line.attempt}, goes on after its end")
        presentation.add(line)
        if isinstance(line, TrialArmed) and plan.is_chosen(presentation.trial):
            if (line.trial, line.attempt) not in chosen:
                raise JournalError(f"trial {line.trial} was armed without a chosen level")
            level_vpp = chosen[line.trial, line.attempt].level_vpp
            presentation.attempt = replace(
                presentation.attempt, trial=replace(presentation.trial, level_vpp=level_vpp)
            )
    return list(shown.values())


def _due(
    plan: Plan, ended: Sequence[Presentation]
) -> tuple[tuple[Attempt, ...], tuple[Attempt, ...]]:
    """Return the unanswered trials, block by block new ones before repeats, and the warm-up."""
    answered: set[int] = set()
    attempts: dict[int, int] = {}
    premature: Counter[int] = Counter()  # of the attempts that have to be repeated
    for presentation in ended:
        number, end = presentation.trial.number, presentation.end
        if end is not None and end.status == "ok":
            answered.add(number)
        elif end is not None and end.premature:
            premature[number] += 1
        # Taken out and put in again, so that the keys are in the order of the last attempts: as in
        # the engine, the trial that failed last comes last in its block.
        attempts.pop(number, None)
        attempts[number] = presentation.attempt.number

    def attempt(trial: Trial, *, warm_up: bool) -> Attempt:
        number = trial.number
        again = attempts.get(number, 0) + 1
        return Attempt(trial, again, warm_up=warm_up, premature=premature[number])

    turn = {number: position for position, number in enumerate(attempts, start=1)}
    waiting = [trial for trial in plan.trials if trial.number not in answered]
    waiting.sort(key=lambda trial: (trial.block, turn.get(trial.number, 0), trial.number))
    return (
        tuple(attempt(trial, warm_up=False) for trial in waiting),
        tuple(attempt(trial, warm_up=True) for trial in plan.warm_up),
    )


def _row(
    plan: Plan,
    presentation: Presentation,
    end: TrialEnded,
    gains: Mapping[str, FingerGains],
    opening: SessionOpened,
) -> TrialRow:
    trial = presentation.trial
    # The levels are those of the burst that has the trial's level.
    interval = plan.task.presentation(trial.side).interval + 1
    confirmed = presentation.confirmed.get(interval)
    measured = presentation.measured.get(interval)
    verified = None if measured is None else measured.burst_verified
    confirmed_lines = map(presentation.confirmed.get, range(1, plan.task.n_intervals + 1))
    *earlier_onsets_s, onset_s = (line.onset_s if line else None for line in confirmed_lines)
    response = presentation.response.response if presentation.response else None
    unknown = (None,) * len(plan.task.sites)
    levels_vpp = (confirmed and confirmed.levels_vpp) or unknown
    peaks_um, basis = _displacements(gains[trial.condition], trial, levels_vpp)
    return TrialRow(
        **_trial_columns(plan, presentation),
        kind=trial.kind,
        response=response,
        rt_s=presentation.response.rt_s if presentation.response else None,
        correct=plan.task.is_correct(trial.side, trial.level_vpp, response),
        earlier_onsets_s=tuple(earlier_onsets_s),
        onset_s=onset_s,
        site_levels_vpp=levels_vpp,
        status=end.status,
        premature=end.premature,
        noise_ok=end.noise_ok,
        foreperiod_s=trial.foreperiod_s,
        site_peaks_um=peaks_um or unknown,
        displacement_basis=basis,
        simulated=opening.simulated,
        device_kind=presentation.device_kind,
        burst_verified="false" if presentation.is_mismatch else verified,
        onset_clock=presentation.onset_clock,
        study_sha256=plan.study_sha256,
    )


def _trial_columns(plan: Plan, presentation: Presentation) -> dict[str, Any]:
    """Return the columns that both tables have."""
    trial = presentation.trial
    return {
        "schema": SCHEMA,
        **{name: getattr(plan, name) for name in ("participant", "session")},
        **{name: getattr(trial, name) for name in ("condition", "block", "side", "level_vpp")},
        "trial": trial.number,
        "attempt": presentation.attempt.number,
    }


def _displacements(
    gains: FingerGains, trial: Trial, levels_vpp: tuple[float | None, ...]
) -> tuple[tuple[float, ...] | None, str | None]:
    """Return what the fingers got for the levels that the device reported, and its basis."""
    known_vpp = tuple(level_vpp for level_vpp in levels_vpp if level_vpp is not None)
    if len(known_vpp) < len(levels_vpp) or trial.kind == HANDS_OFF:
        return None, None
    peaks_um = gains.peaks_um(known_vpp)
    return peaks_um, gains.basis_of(known_vpp) if peaks_um else None
