"""Simulated participants: a responder that feels and errs like one, and whole studies of them."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from device.clock import VirtualClock
from experiment.apparatus.noise import SilentNoise
from experiment.apparatus.rig import mock_device
from experiment.archive.disk import UNWAITED
from experiment.archive.folders import SessionFolder
from experiment.names import require_whole
from experiment.operator.requests import StopSignal
from experiment.perception.population import threshold_course_db
from experiment.session.conduct import begin
from experiment.session.setting import Setting
from experiment.study.physics import study_gains
from experiment.study.threshold import unmeasured, vibrations
from experiment.trial.draw import draw_plan
from experiment.trial.responder import Press

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from device.clock import Clock
    from experiment.perception.gains import ConditionGains, FingerGains
    from experiment.perception.observer import Observer
    from experiment.study.study import Study
    from experiment.trial.plan import Plan
    from experiment.trial.responder import AwaitedAnswer, Progress, SessionPart


class SimulationError(RuntimeError):
    """A simulated session that did not come to its end."""


class SimulatedResponder:
    """An observer that answers by itself; the same answers whenever a session is interrupted.

    Every trial's chance is drawn from the seed, the trial's number and the attempt; what depends on
    the last answer alone is another after a break of the session, as it is with people. `gains` are
    by the number of the trial, and so is by how much the thresholds of the left and the right
    finger lie higher in it, `shifts_db`; in `untouched` trials the fingers are off the plate:
    nothing is felt.
    """

    simulated = True

    def __init__(
        self,
        observer: Observer,
        clock: Clock,
        *,
        seed: int,
        gains: Mapping[int, FingerGains],
        untouched: frozenset[int] = frozenset(),
        shifts_db: Mapping[int, tuple[float, float]] | None = None,
        facts: Mapping[str, Any] | None = None,
    ) -> None:
        self.observer_facts = {} if facts is None else dict(facts)
        self._shifts_db = {} if shifts_db is None else shifts_db
        self._last_db = 0.0
        self._observer = observer
        self._clock = clock
        self._seed = seed
        self._gains = gains
        self._untouched = untouched

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
        self._wait_until(until_s)
        return None

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Answer as the observer does."""
        rng = np.random.default_rng((self._seed, question.trial, question.attempt))
        levels_vpp = (question.level_left_vpp, question.level_right_vpp)
        answer = self._observer.answer(
            *((0.0, 0.0) if question.trial in self._untouched else levels_vpp),
            responses=question.answers,
            rng=rng,
            response_window_s=question.window_s,
            gains=self._gains[question.trial],
            shift_db=self._shift_db(question.trial),
        )
        self._remember(question, answer.response)
        if answer.response is None or answer.rt_s is None:
            self._wait_until(question.onset_s + question.window_s)
            return None
        time_s = question.onset_s + answer.rt_s
        self._wait_until(time_s)
        return Press(answer.response, time_s)

    def _shift_db(self, trial: int) -> tuple[float, float]:
        left_db, right_db = self._shifts_db.get(trial, (0.0, 0.0))
        return left_db + self._last_db, right_db + self._last_db

    def _remember(self, question: AwaitedAnswer, response: str | None) -> None:
        """Let the next thresholds be lower after something was felt than after ``none``."""
        half_db = self._observer.last_answer_db / 2
        if question.trial in self._untouched or "none" not in question.answers or not half_db:
            return
        self._last_db = {None: 0.0, "none": half_db}.get(response, -half_db)

    def feedback(self, *, correct: bool) -> None:
        """Learn nothing from it."""

    def _wait_until(self, time_s: float) -> None:
        self._clock.wait(max(0.0, time_s - self._clock.now_s()))

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Rest as briefly as is allowed, and go on."""
        self._clock.wait(minimum_s)
        return True

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Leave."""


def simulated_responder(study: Study, plan: Plan, clock: Clock) -> SimulatedResponder:
    """Draw a participant from the study's simulated population by the plan's seed."""
    rng = np.random.default_rng((plan.seed, _OBSERVER_STREAM))
    left, right = study.actuators[:2]
    apart_mm = math.hypot(left.x_mm - right.x_mm, (left.y_m - right.y_m) * 1e3)
    observer = study.simulation.draw(apart_mm, rng)
    of_condition = {c.name: plan.gains_of(c.name) for c in study.conditions}
    trials = (*plan.trials, *plan.warm_up)
    return SimulatedResponder(
        observer,
        clock,
        seed=plan.seed,
        gains={trial.number: of_condition[trial.condition] for trial in trials},
        untouched=frozenset(trial.number for trial in trials if trial.kind == "control"),
        shifts_db=_shifts_db(study, observer, plan),
        facts=asdict(observer) | {"unmeasured": list(unmeasured(study))},
    )


_OBSERVER_STREAM = 2**32 - 1
"""Keeps the observer's own draw apart from those of its trials."""
_COURSE_STREAM = 2**32 - 2
"""The same for the course of its thresholds."""


def _shifts_db(study: Study, observer: Observer, plan: Plan) -> dict[int, tuple[float, float]]:
    """Return by how much both thresholds lie higher in each trial, by its number."""
    known = study.simulation.known_for
    of_condition = {
        name: (known.shift_db(left), known.shift_db(right))
        for name, (left, right) in vibrations(study).items()
    }
    if observer.difference_db and len(study.conditions) > 1:
        second = study.conditions[1].name
        left_db, right_db = of_condition.get(second, (0.0, 0.0))
        of_condition[second] = (
            left_db + observer.difference_db,
            right_db + observer.difference_db,
        )
    courses = (observer.drift_db, observer.block_drift_db, observer.wander_db)
    if not of_condition and not any(courses):
        return {}
    rng = np.random.default_rng((plan.seed, _COURSE_STREAM))
    course_db = threshold_course_db(observer, [trial.block for trial in plan.trials], rng)
    shifts_db = {}
    for trial in (*plan.trials, *plan.warm_up):
        left_db, right_db = of_condition.get(trial.condition, (0.0, 0.0))
        now_db = course_db[min(trial.number, len(course_db)) - 1]
        shifts_db[trial.number] = left_db + now_db, right_db + now_db
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
    return _simulated(study, root, participants, seed, gains)


def _simulated(
    study: Study,
    root: Path,
    participants: int,
    seed: int,
    gains: tuple[ConditionGains, ...] | None,
) -> Iterator[SessionFolder]:
    gains = study_gains(study) if gains is None else gains
    children = np.random.SeedSequence(seed).spawn(participants)
    for number, child in enumerate(children, start=1):
        folder = SessionFolder(root, f"{number:02d}", "01", disk=UNWAITED)
        plan = draw_plan(
            study,
            participant=folder.participant,
            session=folder.session,
            seed=int(child.generate_state(1)[0]),
            gains=gains,
            participant_number=number,
        )
        clock = VirtualClock()
        setting = Setting(
            device=mock_device(study, clock),
            responder=simulated_responder(study, plan, clock),
            noise=SilentNoise(study.masking),
            clock=clock,
            stop=StopSignal(),
        )
        ending = begin(folder, plan, setting)
        if ending.failure is not None:
            raise SimulationError(f"participant {folder.participant}: device: {ending.failure}")
        yield folder
