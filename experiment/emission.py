"""The stimuli of a session on their way out: loaded, armed, fired, and what became of them."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from device.driver import DeviceError, Outcome, RefusedError
from experiment import steps
from experiment.entries import fault_facts, trial_name
from experiment.stimulus import SLOTS, load_condition, onset_interval_s

if TYPE_CHECKING:
    from collections.abc import Mapping

    from device.clock import Clock
    from device.driver import BurstDevice, Delivery
    from experiment.journal import Journal
    from experiment.plan import Trial
    from experiment.study import Study

ARM_TO_FIRE_S = 1.0
"""How long the device may hold a stimulus ready; later it cannot be fired any more."""

_EVENT_OF: Mapping[Outcome, steps.Event] = {
    Outcome.FIRED: steps.Fired(),
    Outcome.NOT_FIRED: steps.NotFired(),
    Outcome.INDETERMINATE: steps.FiredPerhaps(),
}


class Emission:
    """What the device is told of the stimuli, one after the other.

    Parameters
    ----------
    study : Study
        The study, with its conditions.
    device : BurstDevice
        The actuators, opened.
    clock : Clock
        The clock of the device.
    journal : Journal
        Where tokens and faults are noted.

    Attributes
    ----------
    delivery : Delivery or None
        What became of the current trial's stimulus, if it was fired.
    onset_s : float
        Its onset on the clock.
    failure : DeviceError or None
        What the device failed with, if it did.
    """

    def __init__(
        self, *, study: Study, device: BurstDevice, clock: Clock, journal: Journal
    ) -> None:
        self._study = study
        self._device = device
        self._clock = clock
        self._journal = journal
        self._conditions = {condition.name: condition for condition in study.conditions}
        self._loaded: str | None = None
        self._interval_s = 0.0
        self._rested_s = clock.now_s()
        self._token = 0
        self.delivery: Delivery | None = None
        self.onset_s = 0.0
        self.failure: DeviceError | None = None

    def prepare(self, trial: Trial) -> float:
        """Load the trial's waveforms, if need be; return the earliest time of its onset.

        Raises
        ------
        DeviceError
            If the device does not take them.
        """
        self.delivery = None
        if trial.condition != self._loaded:
            condition = self._conditions[trial.condition]
            load_condition(self._device, condition, self._study.device)
            self._device.enable()
            self._loaded = trial.condition
            self._interval_s = onset_interval_s(condition, self._study.device)
            self._rested_s = max(self._rested_s, self._clock.now_s() + self._interval_s)
        return self._rested_s

    def arm(self, task: steps.Task) -> steps.Event:
        """Journal a new token, then arm the device with it."""
        trial = task.trial
        level_vpp = trial.level_vpp or min(self._study.design.levels_vpp)
        self._token = max(self._token + 1, time.time_ns())
        self._journal.append("trial_armed", trial_name(task) | {"token": self._token}, sync=True)
        try:
            self._device.set_levels(level_vpp, level_vpp)
            self._device.arm(self._token, SLOTS[trial.side], time_to_live_s=ARM_TO_FIRE_S)
        except DeviceError as error:
            return self.fail(error)
        self._journal.append("stimulus_commanded", {"token": self._token})
        return steps.Armed()

    def fire(self) -> steps.Event:
        """Emit the stimulus; nothing is journaled of one that went out."""
        self._rested_s = self._clock.now_s() + self._interval_s
        try:
            self.delivery = self._device.fire(self._token)
        except RefusedError as error:
            self._journal.append("fault", fault_facts(error), sync=True)
            return steps.NotFired()
        except DeviceError as error:
            return self.fail(error)
        self.onset_s = (self.delivery.host_before_s + self.delivery.host_after_s) / 2
        return _EVENT_OF[self.delivery.outcome]

    def fail(self, error: DeviceError) -> steps.Event:
        """Note that the device cannot go on."""
        self.failure = error
        self._journal.append("fault", fault_facts(error), sync=True)
        return steps.DeviceFailed()
