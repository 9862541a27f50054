"""The stimuli of a session: each is armed and fired once, under a token of its own."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from device.driver import Outcome
from device.errors import DeviceError, RefusedError
from experiment.hardware.setup import load_condition
from experiment.hardware.suitability import LONGEST_ARMED_S, onset_interval_s, playing_s
from experiment.record.entries import DeviceFailed, StimulusCommanded, TrialArmed
from experiment.trial.events import Event

if TYPE_CHECKING:
    from collections.abc import Mapping

    from device.driver import Delivery
    from experiment.record.entries import LevelChosen
    from experiment.record.journal import Journal
    from experiment.session.config import SessionConfig
    from experiment.study.study import Study
    from experiment.trial.events import Attempt
    from experiment.trial.plan import Trial


_EVENT_OF: Mapping[Outcome, Event] = {
    Outcome.FIRED: Event.FIRED,
    Outcome.NOT_FIRED: Event.NOT_FIRED,
    Outcome.INDETERMINATE: Event.DELIVERY_UNKNOWN,
}


class StimulusDelivery:
    """Delivers the stimuli of a session, one after the other.

    Of the current burst, `token`, `level_vpp` and `sites` are those that were armed, `delivery` is
    what became of it, if it was fired, and `onset_s` its onset on the clock; `deliveries` has those
    of all intervals of the trial. No burst begins before `rested_s`. `failure` is the failure of
    the device that ended the session.
    """

    def __init__(
        self, config: SessionConfig, study: Study, journal: Journal, *, last_token: int
    ) -> None:
        self._study = study
        self._device = config.device
        self._clock = config.clock
        self._journal = journal
        self._conditions = {condition.name: condition for condition in study.conditions}
        self._loaded: str | None = None
        self._duration_s = self._interval_s = 0.0
        self._silent_s = self.rested_s = config.clock.now_s()
        self.token = last_token
        self.level_vpp = 0.0
        self.sites: tuple[str, ...] = ()
        self.delivery: Delivery | None = None
        self.deliveries: list[Delivery] = []
        self.onset_s = 0.0
        self.failure: DeviceError | None = None

    def prepare(self, trial: Trial) -> None:
        """Load the trial's waveforms, if need be; DeviceError where the device refuses them."""
        self.delivery, self.deliveries = None, []
        if trial.condition != self._loaded:
            condition = self._conditions[trial.condition]
            # After a key too early the burst before may still play: nothing is loaded then.
            self._clock.wait(max(0.0, self._silent_s - self._clock.now_s()))
            load_condition(self._device, condition, self._study)
            self._device.enable()
            self._loaded = trial.condition
            self._duration_s = playing_s(condition, self._study)
            self._interval_s = onset_interval_s(condition, self._study)
            self.rested_s = max(self.rested_s, self._clock.now_s() + self._interval_s)

    def arm(self, attempt: Attempt, interval: int, chosen: LevelChosen | None = None) -> Event:
        """Journal a new token, and the level if it was chosen; then arm the device with it.

        The interval is counted from 1. A silent one is armed and fired like any other, at a level
        of the study.
        """
        trial, task = attempt.trial, self._study.task
        burst = task.presentation(trial.side).bursts[interval - 1]
        level_vpp = task.reference_vpp if burst.is_reference else trial.level_vpp
        self.level_vpp = level_vpp or min(self._study.design_of(trial.condition).levels_vpp)
        self.sites, self.delivery = burst.sites, None
        # Tokens rise, also where the calendar's clock was set back: the device relies on it.
        self.token = max(self.token + 1, time.time_ns())
        # On the disk before it is sent: after a crash, only the token can show what was presented.
        if chosen is not None:
            self._journal.append(chosen)
        armed = TrialArmed(
            trial=trial.number, attempt=attempt.number, interval=interval, token=self.token
        )
        self._journal.append(armed, sync=True)
        try:
            self._device.set_levels([self.level_vpp] * len(task.sites))
            self._device.arm(
                self.token, task.slots.index(burst.sites), time_to_live_s=LONGEST_ARMED_S
            )
        except DeviceError as error:
            return self.fail(error)
        self._journal.append(StimulusCommanded(token=self.token))
        return Event.ARMED

    def fire(self) -> Event:
        """Emit the stimulus; nothing is journaled of one that went out."""
        try:
            self.delivery = self._device.fire(self.token)
        except RefusedError as error:
            self._journal.append(_failure_line(error))  # synced with the trial's end
            return self._disarm()
        except DeviceError as error:
            return self.fail(error)
        finally:  # by the latest that it may have begun: the order may have gone out again
            now_s = self._clock.now_s()
            self._silent_s = now_s + self._duration_s
            self.rested_s = now_s + self._interval_s
        self.deliveries.append(self.delivery)
        self.onset_s = (self.delivery.host_before_s + self.delivery.host_after_s) / 2
        return _EVENT_OF[self.delivery.outcome]

    def _disarm(self) -> Event:
        """Disarm a token whose FIRE was refused; an armed device refuses the next trial's level."""
        try:
            self._device.disarm(self.token)
        except DeviceError as error:
            return self.fail(error)
        return Event.NOT_FIRED

    def fail(self, error: DeviceError) -> Event:
        """Keep and journal a failure that ends the session."""
        self.failure = error
        self._journal.append(_failure_line(error), sync=True)
        return Event.DEVICE_FAILED


def _failure_line(error: DeviceError) -> DeviceFailed:
    return DeviceFailed(error=type(error).__name__, message=str(error))
