"""Simulated participants: a responder that feels and errs like one, and whole studies of them."""

from __future__ import annotations

from dataclasses import KW_ONLY, asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from device.clock import VirtualClock
from experiment.hardware.noise import SilentNoise
from experiment.hardware.setup import mock_device
from experiment.names import require_whole
from experiment.operator.requests import StopSignal
from experiment.perception.answers import draw_answers
from experiment.perception.population import threshold_course_db
from experiment.record.files import UNWAITED
from experiment.record.folder import SessionFolder
from experiment.session.config import SessionConfig
from experiment.session.run import run
from experiment.study.physics import study_gains
from experiment.study.threshold import extrapolations, vibrations
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.trial.draw import draw_plan
from experiment.trial.plan import HANDS_OFF
from experiment.trial.responder import Press, Responder

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from device.clock import Clock
    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.perception.observer import Observer
    from experiment.study.study import Study
    from experiment.tasks.task import Task
    from experiment.trial.plan import Plan
    from experiment.trial.responder import AwaitedAnswer, Progress, SessionPart


class SimulationError(RuntimeError):
    """A simulated session that did not come to its end."""


@dataclass
class SimulatedResponder(Responder):
    """An observer that answers by itself; the same answers whenever a session is interrupted.

    Every trial's chance is drawn from the seed, the trial's number and the attempt; what depends on
    the last answer alone is another after a break of the session, as it is with people. `gains` are
    by the number of the trial, and so is by how much the threshold at each site lies higher in it,
    `shifts_db`; in `untouched` trials the fingers are off the plate:
    nothing is felt.
    """

    simulated = True
    observer: Observer
    clock: Clock
    _: KW_ONLY
    seed: int
    gains: Mapping[int, FingerGains]
    untouched: frozenset[int] = frozenset()
    shifts_db: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    observer_values: dict[str, Any] = field(default_factory=dict)
    task: Task = LEFT_RIGHT_BOTH
    _last_db: float = field(default=0.0, init=False)

    def begin(self, progress: Progress) -> bool:
        """Need no instruction."""
        return True

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Need no introduction."""
        return True

    def cue(self, progress: Progress) -> None:
        """See the cue."""

    def wait(self, until_s: float) -> Press | None:
        """Wait, and press nothing."""
        self.clock.wait(max(0.0, until_s - self.clock.now_s()))
        return None

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Answer as the observer does."""
        rng = np.random.default_rng((self.seed, question.trial, question.attempt))
        shifts_db = self.shifts_db.get(question.trial, (0.0,))
        levels_vpp = question.levels_vpp
        if question.trial in self.untouched:
            levels_vpp = tuple((0.0,) * len(burst) for burst in levels_vpp)
        answer, rt_s = draw_answers(
            [self.observer],
            levels_vpp,
            question.answers,
            question.window_s,
            rng,
            gains=self.gains[question.trial],
            shift_db=tuple(shift_db + self._last_db for shift_db in shifts_db),
            task=self.task,
        )
        response = (*question.answers, None)[answer.item()]
        # The next thresholds are lower after something was felt than after nothing was.
        half_db, nothing = self.observer.last_answer_db / 2, self.task.nothing
        if question.trial not in self.untouched and nothing in question.answers:
            self._last_db = {None: 0.0, nothing: half_db}.get(response, -half_db)
        until_s = question.onset_s + (question.window_s if response is None else rt_s.item())
        self.wait(until_s)
        return None if response is None else Press(response, until_s)

    def feedback(self, *, correct: bool) -> None:
        """Learn nothing from it."""

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Rest as briefly as is allowed, and go on."""
        self.clock.wait(minimum_s)
        return True

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Leave."""


def simulated_responder(study: Study, plan: Plan, clock: Clock) -> SimulatedResponder:
    """Draw a participant from the study's simulated population by the plan's seed."""
    rng = np.random.default_rng((plan.seed, _OBSERVER_STREAM))
    observer = study.simulation.draw(study.site_distance_mm, rng)
    of_condition = {c.name: plan.gains_of(c.name) for c in study.conditions}
    trials = (*plan.trials, *plan.warm_up)
    return SimulatedResponder(
        observer,
        clock,
        seed=plan.seed,
        gains={trial.number: of_condition[trial.condition] for trial in trials},
        untouched=frozenset(trial.number for trial in trials if trial.kind == HANDS_OFF),
        shifts_db=_shifts_db(study, observer, plan),
        observer_values=asdict(observer)
        | {"unmeasured": [e.curve.key for e in extrapolations(study)]},
        task=study.task,
    )


_OBSERVER_STREAM = 2**32 - 1
"""Keeps the observer's own draw apart from those of its trials."""
_COURSE_STREAM = 2**32 - 2
"""The same for the course of its thresholds."""


def _shifts_db(study: Study, observer: Observer, plan: Plan) -> dict[int, tuple[float, ...]]:
    """Return by how much the threshold at each site lies higher in each trial, by its number."""
    reference, zero_db = study.simulation.reference_vibration, np.zeros(len(study.driven))
    condition_db = {
        name: np.array([reference.shift_db(vibration) for vibration in fingers])
        for name, fingers in vibrations(study).items()
    }
    if observer.difference_db and len(study.conditions) > 1:
        second = study.conditions[1].name
        condition_db[second] = condition_db.get(second, zero_db) + observer.difference_db
    rng = np.random.default_rng((plan.seed, _COURSE_STREAM))
    course_db = threshold_course_db(observer, [trial.block for trial in plan.trials], rng)
    shifts_db = {}
    for trial in (*plan.trials, *plan.warm_up):
        now_db = course_db[min(trial.number, len(course_db)) - 1]
        of_sites_db = condition_db.get(trial.condition, zero_db) + now_db
        shifts_db[trial.number] = tuple(of_sites_db.tolist())
    return shifts_db


def simulate_study(
    study: Study,
    root: Path,
    *,
    participants: int,
    seed: int,
    gains: tuple[ConditionGains, ...] | None = None,
) -> Iterator[SessionFolder]:
    """Run one session each of simulated participants on mock devices and virtual clocks.

    Parameters
    ----------
    study : Study
        The study.
    root : Path
        Folder for the sessions ``sub-01/ses-01``, ``sub-02/ses-01``, ...
    participants : int
        How many, at least 1.
    seed : int
        Seed, 0 or more; the same seed gives the same trials.csv.
    gains : tuple of ConditionGains, optional
        The study's gain matrix, where it was computed already.

    Yields
    ------
    SessionFolder
        Each session when it is complete.

    Raises
    ------
    ValueError
        For less than one participant and a seed below 0, when it is called.
    SimulationError
        If the mock device refuses a stimulus.

    Examples
    --------
    The same seed gives the same people, who give the same answers:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from experiment import paper_study
    >>> study = paper_study().changed(design={"trials_per_side": 5, "both_trials": 0},
    ...                               simulation={"threshold_vpp": 100.0})
    >>> tables = []
    >>> for _ in range(2):
    ...     with TemporaryDirectory() as results:
    ...         one, = simulate_study(study, Path(results), participants=1, seed=7, gains=())
    ...         tables.append(one.trials_path.read_bytes())
    >>> tables[0] == tables[1]
    True
    """
    require_whole("participants", participants, 1)
    require_whole("seed", seed, 0)
    gains = study_gains(study) if gains is None else gains
    children = np.random.SeedSequence(seed).spawn(participants)
    return (
        _simulate_session(study, root, number, int(child.generate_state(1)[0]), gains)
        for number, child in enumerate(children, start=1)
    )


def _simulate_session(
    study: Study, root: Path, number: int, seed: int, gains: tuple[ConditionGains, ...]
) -> SessionFolder:
    folder = SessionFolder(root, f"{number:02d}", "01", disk=UNWAITED)
    plan = draw_plan(
        study,
        participant=folder.participant,
        session=folder.session,
        seed=seed,
        gains=gains,
        participant_number=number,
    )
    clock = VirtualClock()
    config = SessionConfig(
        device=mock_device(study, clock),
        responder=simulated_responder(study, plan, clock),
        noise=SilentNoise(),
        clock=clock,
        stop=StopSignal(),
    )
    result = run(folder, plan, config)
    if result.failure is not None:
        raise SimulationError(f"participant {folder.participant}: device: {result.failure}")
    return folder
