"""What a journal says: the rows of trials.csv, and what is left to do after an interruption."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from device.clock import MachineTime
from experiment.archive.journal import Entry, JournalError
from experiment.rows import (
    CONSTANT,
    NOT_AVAILABLE,
    SCHEMA,
    MeasuredRow,
    TrialRow,
    is_correct,
)
from experiment.trial.events import Task

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from experiment.perception.gains import FingerGains
    from experiment.trial.plan import Plan, Trial


@dataclass(frozen=True, slots=True)
class OpenTrial:
    """A trial whose stimulus was armed and whose end was never written.

    Attributes
    ----------
    task : Task
        The trial and its attempt.
    token : int
        The token by which the device knows its stimulus.
    boot_id : int
        The device's power cycle in which it was armed.
    outcome : str or None
        What the device said of the stimulus, where that was still written.
    response : str or None
        The answer of the participant, where it was still written.
    anticipated : bool
        Whether a key came too early.
    noise_ok : bool or None
        Whether the masking noise played, where that was still written with the answer.
    verified : str or None
        What a monitor said of the burst, where that was still written with the answer.
    """

    task: Task
    token: int
    boot_id: int
    outcome: str | None
    response: str | None
    anticipated: bool
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
    pending : tuple of Task
        The planned trials without an answer, in the order in which they are due.
    open_trial : OpenTrial or None
        The trial in which the session was interrupted.
    opening : mapping
        What the first line says of host, device and participant; empty before the first line.
    warm_up : tuple of Task
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
    pending: tuple[Task, ...]
    open_trial: OpenTrial | None
    opening: Mapping[str, Any]
    warm_up: tuple[Task, ...]
    finished: bool
    last_t_s: float
    last: MachineTime
    last_token: int
    onset_clock: int
    recording_start_s: float

    def due(self, *, warm_up: bool) -> tuple[Task, ...]:
        """Return what is to be presented in the next sitting, in its order.

        Parameters
        ----------
        warm_up : bool
            Whether warm-up trials come before the next trial on the plate, if there is one.
        """
        touched = any(task.trial.kind != "control" for task in self.pending)
        again = self.warm_up if warm_up and touched else ()
        return tuple(sorted((*again, *self.pending), key=lambda task: task.trial.block))


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
        answer; ``open_trial``: the trial in which the session was interrupted, or None;
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
    entries = tuple(entries)
    try:
        return _history(plan, entries)
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
    return History(
        measured=tuple(_measured_row(plan, p) for p in ended if p.measured),
        rows=tuple(_row(plan, p, simulated=opening["simulated"]) for p in ended),
        pending=_pending(plan, ended),
        open_trial=_open_trial(unended[0]) if unended else None,
        opening=opening,
        warm_up=_warm_up(plan, ended),
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
    known = boots and boots[-1] != NOT_AVAILABLE
    return MachineTime(
        boot=boots[-1] if known else None,
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


def _warm_up(plan: Plan, ended: Sequence[_Presentation]) -> tuple[Task, ...]:
    attempts = {presentation.trial.number: presentation.attempt for presentation in ended}
    early = _early(ended)
    return tuple(
        Task(trial, attempts.get(trial.number, 0) + 1, warm_up=True, early=early[trial.number])
        for trial in plan.warm_up
    )


def _early(ended: Iterable[_Presentation]) -> Counter[int]:
    """Count, trial by trial, the attempts to be repeated in which a key came too early."""
    return Counter(
        presentation.trial.number
        for presentation in ended
        if presentation.end["anticipated"] and presentation.end["status"] != "ok"
    )


def _pending(plan: Plan, ended: Sequence[_Presentation]) -> tuple[Task, ...]:
    """List unanswered trials: block by block, those never presented before the repeats."""
    answered: set[int] = set()
    attempts: dict[int, int] = {}
    for presentation in ended:
        number = presentation.trial.number
        if presentation.end["status"] == "ok":
            answered.add(number)
        # Taken out and put in again, so that the keys are in the order of the last attempts: as in
        # the engine, the trial that failed last comes last in its block.
        attempts.pop(number, None)
        attempts[number] = presentation.attempt
    turn = {number: place for place, number in enumerate(attempts, start=1)}
    waiting = [trial for trial in plan.trials if trial.number not in answered]
    waiting.sort(key=lambda trial: (trial.block, turn.get(trial.number, 0), trial.number))
    early = _early(ended)
    return tuple(
        Task(trial, attempts.get(trial.number, 0) + 1, early=early[trial.number])
        for trial in waiting
    )


def _open_trial(presentation: _Presentation) -> OpenTrial:
    # Before its token nothing is written of a trial but its end, and with an end it is not open:
    # one that is given up in the foreperiod was never armed.
    assert presentation.token is not None
    return OpenTrial(
        task=Task(presentation.trial, presentation.attempt),
        token=presentation.token,
        boot_id=presentation.boot_id,
        outcome=presentation.stimulus.get("outcome"),
        response=presentation.answer.get("response"),
        anticipated=presentation.answer.get("anticipated", False),
        noise_ok=presentation.answer.get("noise_ok"),
        verified=presentation.measured.get("burst_verified"),
    )


def _row(plan: Plan, presentation: _Presentation, *, simulated: bool) -> TrialRow:
    trial, stimulus = presentation.trial, presentation.stimulus
    response = presentation.answer.get("response")
    gains = plan.gains_of(trial.condition)
    left_um, right_um, basis = _displacements(gains, stimulus, trial.kind)
    return TrialRow(
        schema=SCHEMA,
        participant=plan.participant,
        session=plan.session,
        condition=trial.condition,
        block=trial.block,
        trial=trial.number,
        attempt=presentation.attempt,
        kind=trial.kind,
        side=trial.side,
        level_vpp=trial.level_vpp,
        response=response,
        rt_s=presentation.answer.get("rt_s"),
        correct=is_correct(trial.kind, trial.side, response),
        status=presentation.end["status"],
        onset_s=stimulus.get("onset_s"),
        foreperiod_s=trial.foreperiod_s,
        level_left_vpp=stimulus.get("level_left_vpp"),
        level_right_vpp=stimulus.get("level_right_vpp"),
        peak_left_um=left_um,
        peak_right_um=right_um,
        displacement_basis=basis,
        anticipated=presentation.end["anticipated"],
        noise_ok=presentation.end["noise_ok"],
        simulated=simulated,
        device_kind=presentation.device_kind,
        level_rule=CONSTANT,
        level_planned_vpp=trial.level_vpp,
        burst_verified=presentation.measured.get("burst_verified"),
        onset_clock=presentation.onset_clock,
        study_sha256=plan.study_sha256,
    )


def _measured_row(plan: Plan, presentation: _Presentation) -> MeasuredRow:
    trial, facts = presentation.trial, presentation.measured
    return MeasuredRow(
        schema=SCHEMA,
        participant=plan.participant,
        session=plan.session,
        condition=trial.condition,
        block=trial.block,
        trial=trial.number,
        attempt=presentation.attempt,
        side=trial.side,
        level_vpp=trial.level_vpp,
        faults="/".join(facts["faults"]) or None,
        noted="/".join(facts["noted"]) or None,
        **{name: facts[name] for name in _AS_MEASURED},
    )


_AS_MEASURED: Final = (
    *("tap", "source", "unit", "burst_verified", "unmeasured", "planned_left", "planned_right"),
    *("peak_left", "peak_right", "onset_s", "onset_uncertainty_s", "late_s"),
    *("correlation_left", "correlation_right", "noise_left", "noise_right"),
)


def _displacements(
    gains: FingerGains, stimulus: Mapping[str, Any], kind: str
) -> tuple[float | None, float | None, str | None]:
    """Return what the fingers got for the levels that the device reported, and its basis."""
    left_vpp, right_vpp = stimulus.get("level_left_vpp"), stimulus.get("level_right_vpp")
    if left_vpp is None or right_vpp is None or kind == "control":
        return None, None, None
    peaks_um = gains.peaks_um(left_vpp, right_vpp)
    if peaks_um is None:
        return None, None, None
    return *peaks_um, gains.basis_of(left_vpp, right_vpp)
