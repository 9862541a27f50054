"""What a journal says: the rows of trials.csv, and what is left to do after an interruption."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, Final

from device.clock import MachineTime
from experiment.archive.journal import Entry, JournalError
from experiment.rows import HANDS_OFF, NOT_AVAILABLE, SCHEMA, MeasuredRow, TrialRow
from experiment.trial.events import Attempt

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from experiment.perception.gains import FingerGains
    from experiment.trial.plan import Plan, Trial


@dataclass(frozen=True, slots=True)
class InterruptedTrial:
    """A trial whose stimulus was armed and whose end was never written.

    Attributes
    ----------
    attempt : Attempt
        The trial and its attempt.
    token : int
        The token by which the device knows its stimulus.
    boot_id : int
        The device's power cycle in which it was armed.
    outcome : str or None
        What the device said of the stimulus, where that was still written.
    response : str or None
        The answer of the participant, where it was still written.
    premature : bool
        Whether there was a premature response.
    noise_ok : bool or None
        Whether the masking noise played, where that was still written with the answer.
    verified : str or None
        What a monitor said of the burst, where that was still written with the answer.
    """

    attempt: Attempt
    token: int
    boot_id: int
    outcome: str | None
    response: str | None
    premature: bool
    noise_ok: bool | None
    verified: str | None


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
    interrupted : InterruptedTrial or None
        The trial in which the session was interrupted.
    opening : mapping
        What the first line says of host, device and participant; empty before the first line.
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
        When other recordings were first told that the session begins, on its clock; 0 where none
        were.
    """

    rows: tuple[TrialRow, ...]
    measured: tuple[MeasuredRow, ...]
    pending: tuple[Attempt, ...]
    interrupted: InterruptedTrial | None
    opening: Mapping[str, Any]
    warm_up: tuple[Attempt, ...]
    finished: bool
    last_t_s: float
    last: MachineTime
    last_token: int
    onset_clock: int
    recording_start_s: float

    def due(self, *, warm_up: bool) -> tuple[Attempt, ...]:
        """Return what is to be presented in the next sitting, in its order.

        Parameters
        ----------
        warm_up : bool
            Whether warm-up trials come before the next trial on the plate, if there is one.
        """
        hands_on = any(attempt.trial.kind != HANDS_OFF for attempt in self.pending)
        again = self.warm_up if warm_up and hands_on else ()
        return tuple(sorted((*again, *self.pending), key=lambda attempt: attempt.trial.block))


@dataclass(slots=True)
class _Presentation:
    """What the journal has said so far of one attempt at one trial."""

    trial: Trial
    attempt: int
    token: int | None = None
    boot_id: int = 0
    device_kind: str | None = None
    onset_clock: int = 1
    stimulus: Mapping[str, Any] = field(default_factory=dict)
    measured: Mapping[str, Any] = field(default_factory=dict)
    answer: Mapping[str, Any] = field(default_factory=dict)
    end: Mapping[str, Any] = field(default_factory=dict)


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
        If the journal belongs to another plan, names a trial that the plan does not have, lacks a
        member of a line, or continues after a trial that has no end.

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
    try:
        return _history(plan, tuple(entries))
    except (KeyError, TypeError, AttributeError) as error:
        raise JournalError(f"a line of the journal lacks what it must say: {error}") from error


def _history(plan: Plan, entries: tuple[Entry, ...]) -> History:
    opening = _opening(plan, entries)
    shown = _presentations(plan, entries)
    ended = [p for p in shown if p.end]
    unended = [p for p in shown if not p.end]
    # A session has one trial at a time, so that only the last can have been cut off. One that is
    # open further up is a lost line or a second writer, and its row would be made up.
    if len(unended) > 1 or (unended and unended[0] is not shown[-1]):
        raise JournalError(f"trial {unended[0].trial.number} was never ended, yet others followed")
    pending, warm_up = _due(plan, ended)
    gains = {name: plan.gains_of(name) for name in {p.trial.condition for p in ended}}
    return History(
        measured=tuple(_measured_row(plan, p) for p in ended if p.measured),
        rows=tuple(_row(plan, p, gains, simulated=opening["simulated"]) for p in ended),
        pending=pending,
        interrupted=_interrupted(unended[0]) if unended else None,
        opening=opening,
        warm_up=warm_up,
        finished=any(e.event == "session_close" and e.facts["finished"] for e in entries),
        last_t_s=entries[-1].t_s if entries else 0.0,
        last=_last(entries),
        last_token=max((p.token for p in shown if p.token is not None), default=0),
        onset_clock=1 + sum(_breaks_clock(entry) for entry in entries),
        recording_start_s=next((e.facts["at_s"] for e in entries if e.event == "marker"), 0.0),
    )


BROKEN: Final = "broken"
"""What a resume says of the session's clock where nobody can tell how long the interruption was."""


def _breaks_clock(entry: Entry) -> bool:
    return entry.event == "session_resume" and entry.facts["session_clock"] == BROKEN


def _last(entries: tuple[Entry, ...]) -> MachineTime:
    boots = [entry.facts["host_boot"] for entry in entries if entry.event in _OPENINGS]
    has_boot = boots and boots[-1] != NOT_AVAILABLE
    return MachineTime(
        boot=boots[-1] if has_boot else None,
        up_s=entries[-1].up_s if entries else 0.0,
        wall_s=entries[-1].wall_s if entries else 0.0,
    )


def _opening(plan: Plan, entries: tuple[Entry, ...]) -> Mapping[str, Any]:
    if not entries:
        return {}
    first = entries[0]
    if first.event != "session_open":
        raise JournalError(f"the first line must be session_open; got {first.event}")
    if first.facts["plan_sha256"] != plan.sha256:
        raise JournalError(
            f"the journal belongs to the plan {first.facts['plan_sha256'][:12]}..., "
            f"not to this one, {plan.sha256[:12]}...; nothing was changed"
        )
    return first.facts


_OPENINGS = ("session_open", "session_resume")
_PART = {
    "stimulus_confirmed": "stimulus",
    "stimulus_measured": "measured",
    "response": "answer",
    "trial_end": "end",
}


def _presentations(plan: Plan, entries: Iterable[Entry]) -> list[_Presentation]:
    trials = {trial.number: trial for trial in (*plan.trials, *plan.warm_up)}
    shown: dict[tuple[int, int], _Presentation] = {}
    boot_id, device_kind, onset_clock = 0, None, 1
    for entry in entries:
        # A token means something to the power cycle that heard it and to no other. The lines of a
        # trial do not repeat which that is: it stands in the last opening of the session above
        # them; and so does what sort of device that is, and whether the clock went on.
        if entry.event in _OPENINGS:
            boot_id, device_kind = entry.facts["boot_id"], entry.facts["device_kind"]
            onset_clock += _breaks_clock(entry)
        if entry.event != "trial_armed" and entry.event not in _PART:
            continue
        number, attempt = entry.facts["trial"], entry.facts["attempt"]
        if number not in trials:
            raise JournalError(f"the journal names trial {number}, which the plan does not have")
        if (number, attempt) not in shown:
            shown[number, attempt] = _Presentation(
                trials[number], attempt, device_kind=device_kind, onset_clock=onset_clock
            )
        presentation = shown[number, attempt]
        if presentation.end:
            raise JournalError(f"trial {number}, attempt {attempt}, goes on after its end")
        if entry.event == "trial_armed":
            presentation.token, presentation.boot_id = entry.facts["token"], boot_id
        else:
            setattr(presentation, _PART[entry.event], entry.facts)
    return list(shown.values())


def _due(
    plan: Plan, ended: Sequence[_Presentation]
) -> tuple[tuple[Attempt, ...], tuple[Attempt, ...]]:
    """Return the unanswered trials, block by block new ones before repeats, and the warm-up."""
    answered: set[int] = set()
    attempts: dict[int, int] = {}
    premature: Counter[int] = Counter()  # of the attempts that have to be repeated
    for presentation in ended:
        number, end = presentation.trial.number, presentation.end
        if end["status"] == "ok":
            answered.add(number)
        elif end["premature"]:
            premature[number] += 1
        # Taken out and put in again, so that the keys are in the order of the last attempts: as in
        # the engine, the trial that failed last comes last in its block.
        attempts.pop(number, None)
        attempts[number] = presentation.attempt

    def attempt(trial: Trial, *, warm_up: bool) -> Attempt:
        number = trial.number
        again = attempts.get(number, 0) + 1
        return Attempt(trial, again, warm_up=warm_up, premature=premature[number])

    turn = {number: place for place, number in enumerate(attempts, start=1)}
    waiting = [trial for trial in plan.trials if trial.number not in answered]
    waiting.sort(key=lambda trial: (trial.block, turn.get(trial.number, 0), trial.number))
    return (
        tuple(attempt(trial, warm_up=False) for trial in waiting),
        tuple(attempt(trial, warm_up=True) for trial in plan.warm_up),
    )


def _interrupted(presentation: _Presentation) -> InterruptedTrial:
    # Before its token nothing is written of a trial but its end, and with an end it is not open:
    # one that is given up in the foreperiod was never armed.
    assert presentation.token is not None
    return InterruptedTrial(
        attempt=Attempt(presentation.trial, presentation.attempt),
        token=presentation.token,
        boot_id=presentation.boot_id,
        outcome=presentation.stimulus.get("outcome"),
        response=presentation.answer.get("response"),
        premature=presentation.answer.get("premature", False),
        noise_ok=presentation.answer.get("noise_ok"),
        verified=presentation.measured.get("burst_verified"),
    )


def _row(
    plan: Plan,
    presentation: _Presentation,
    gains: Mapping[str, FingerGains],
    *,
    simulated: bool,
) -> TrialRow:
    trial, stimulus = presentation.trial, presentation.stimulus
    response = presentation.answer.get("response")
    left_um, right_um, basis = _displacements(gains[trial.condition], trial, stimulus)
    return TrialRow(
        **_trial_columns(plan, presentation),
        kind=trial.kind,
        response=response,
        rt_s=presentation.answer.get("rt_s"),
        correct=plan.task.is_correct(trial.side, response),
        onset_s=stimulus.get("onset_s"),
        level_left_vpp=stimulus.get("level_left_vpp"),
        level_right_vpp=stimulus.get("level_right_vpp"),
        **{name: presentation.end[name] for name in ("status", "premature", "noise_ok")},
        foreperiod_s=trial.foreperiod_s,
        peak_left_um=left_um,
        peak_right_um=right_um,
        displacement_basis=basis,
        simulated=simulated,
        device_kind=presentation.device_kind,
        burst_verified=presentation.measured.get("burst_verified"),
        onset_clock=presentation.onset_clock,
        study_sha256=plan.study_sha256,
    )


def _measured_row(plan: Plan, presentation: _Presentation) -> MeasuredRow:
    columns = _trial_columns(plan, presentation)
    measured = presentation.measured
    lists = {name: "/".join(measured[name]) or None for name in ("faults", "noted")}
    values = {f.name: measured[f.name] for f in fields(MeasuredRow) if f.name not in columns}
    return MeasuredRow(**columns, **values | lists)


def _trial_columns(plan: Plan, presentation: _Presentation) -> dict[str, Any]:
    """Return the columns that both tables have."""
    trial = presentation.trial
    return {
        "schema": SCHEMA,
        **{name: getattr(plan, name) for name in ("participant", "session")},
        **{name: getattr(trial, name) for name in ("condition", "block", "side", "level_vpp")},
        "trial": trial.number,
        "attempt": presentation.attempt,
    }


def _displacements(
    gains: FingerGains, trial: Trial, stimulus: Mapping[str, Any]
) -> tuple[float | None, float | None, str | None]:
    """Return what the fingers got for the levels that the device reported, and its basis."""
    left_vpp, right_vpp = stimulus.get("level_left_vpp"), stimulus.get("level_right_vpp")
    if left_vpp is None or right_vpp is None or trial.kind == HANDS_OFF:
        return None, None, None
    peaks_um = gains.peaks_um(left_vpp, right_vpp)
    return (*peaks_um, gains.basis_of(left_vpp, right_vpp)) if peaks_um else (None, None, None)
