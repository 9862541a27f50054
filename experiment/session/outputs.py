"""The stimuli of a session on their way out, measured, and the masking noise meanwhile."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from device.driver import Outcome
from device.errors import DeviceError, RefusedError
from experiment.apparatus.monitor import planned_burst
from experiment.apparatus.noise import NoiseError
from experiment.apparatus.slots import (
    LONGEST_ARMED_S,
    SLOTS,
    load_condition,
    onset_interval_s,
    playing_s,
    told_health,
)
from experiment.perception.gains import significant
from experiment.session.setting import fault_facts, trial_name
from experiment.trial.events import Event

if TYPE_CHECKING:
    from collections.abc import Mapping

    from device.driver import BurstDevice, Delivery
    from device.monitor.measured import Measured, Monitor, Planned
    from experiment.apparatus.noise import NoiseHealth, NoisePlayer
    from experiment.archive.journal import Journal
    from experiment.session.setting import Setting
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study
    from experiment.trial.events import Task
    from experiment.trial.plan import Trial


ARM_TO_FIRE_S = LONGEST_ARMED_S
"""How long the device may hold a stimulus ready; later it cannot be fired any more."""

_EVENT_OF: Mapping[Outcome, Event] = {
    Outcome.FIRED: Event.FIRED,
    Outcome.NOT_FIRED: Event.NOT_FIRED,
    Outcome.INDETERMINATE: Event.FIRED_PERHAPS,
}


class StimulusOut:
    """What the device is told of the stimuli, one after the other.

    `delivery` is what became of the current trial's stimulus, if it was fired, `onset_s` its onset
    on the clock; `failure` what the device failed with, if it did.
    """

    def __init__(
        self,
        setting: Setting,
        study: Study,
        journal: Journal,
        *,
        last_token: int,
        watch: BurstWatch,
    ) -> None:
        self._watch = watch
        self._study = study
        self._device = setting.device
        self._clock = setting.clock
        self._journal = journal
        self._conditions = {condition.name: condition for condition in study.conditions}
        self._loaded: str | None = None
        self._duration_s = self._interval_s = 0.0
        self._silent_s = self._rested_s = setting.clock.now_s()
        self._token = last_token
        self.delivery: Delivery | None = None
        self.onset_s = 0.0
        self.failure: DeviceError | None = None

    def prepare(self, trial: Trial) -> float:
        """Load the trial's waveforms, if need be; return the earliest time of its onset.

        DeviceError where the device does not take them.
        """
        self.delivery = None
        self._watch.forget()
        if trial.condition != self._loaded:
            condition = self._conditions[trial.condition]
            # After a key too early the burst before may still play: nothing is loaded then.
            self._clock.wait(max(0.0, self._silent_s - self._clock.now_s()))
            load_condition(self._device, condition, self._study.device)
            self._device.enable()
            self._loaded = trial.condition
            self._duration_s = playing_s(condition, self._study.device)
            self._interval_s = onset_interval_s(condition, self._study.device)
            self._rested_s = max(self._rested_s, self._clock.now_s() + self._interval_s)
        return self._rested_s

    def arm(self, task: Task) -> Event:
        """Journal a new token, then arm the device with it."""
        trial = task.trial
        level_vpp = trial.level_vpp or min(self._study.design_of(trial.condition).levels_vpp)
        # Tokens rise, also where the calendar's clock was set back: the device relies on it.
        self._token = max(self._token + 1, time.time_ns())
        # On the disk before the device knows it: after a crash only the token tells what was felt.
        self._journal.append("trial_armed", trial_name(task) | {"token": self._token}, sync=True)
        try:
            self._device.set_levels(level_vpp, level_vpp)
            self._device.arm(self._token, SLOTS[trial.side], time_to_live_s=ARM_TO_FIRE_S)
        except DeviceError as error:
            return self.fail(error)
        self._watch.expect(self._conditions[trial.condition], trial.side, level_vpp)
        self._journal.append("stimulus_commanded", {"token": self._token})
        return Event.ARMED

    def fire(self) -> Event:
        """Emit the stimulus; nothing is journaled of one that went out."""
        self._watch.begin(self._token)
        try:
            self.delivery = self._device.fire(self._token)
        except RefusedError as error:
            self._journal.append("fault", fault_facts(error))  # synced with the trial's end
            return self._disarmed()
        except DeviceError as error:
            return self.fail(error)
        finally:  # by the latest that it may have begun: the order may have gone out again
            now_s = self._clock.now_s()
            self._silent_s = now_s + self._duration_s
            self._rested_s = now_s + self._interval_s
        self.onset_s = (self.delivery.host_before_s + self.delivery.host_after_s) / 2
        return _EVENT_OF[self.delivery.outcome]

    def _disarmed(self) -> Event:
        """Let go of a token whose FIRE was refused: the next trial's level is refused meanwhile."""
        try:
            self._device.disarm(self._token)
        except DeviceError as error:
            return self.fail(error)
        return Event.NOT_FIRED

    def fail(self, error: DeviceError) -> Event:
        """Note that the device cannot go on."""
        self.failure = error
        self._journal.append("fault", fault_facts(error), sync=True)
        return Event.DEVICE_FAILED


class BurstWatch:
    """What a monitor measures of a session's bursts, where there is one.

    `measured` is what it said of the current trial's, if it was asked; `trouble` what the operator
    has to know, empty while bursts are verified.
    """

    def __init__(self, monitor: Monitor | None, study: Study, device: BurstDevice) -> None:
        self._monitor = monitor
        self._device = device
        self._study = study
        self.planned: Planned | None = None
        self.measured: Measured | None = None
        self.trouble = ""

    def forget(self) -> None:
        """Forget the trial before."""
        self.planned = self.measured = None

    def expect(self, condition: Condition, side: str, level_vpp: float) -> None:
        """Note which burst comes next."""
        if self._monitor is None:
            return
        per_volt = self._study.monitor.at_the_tap
        self.planned = planned_burst(
            condition, self._study.device, per_volt, side=side, level_vpp=level_vpp
        )

    def begin(self, token: int) -> None:
        """Listen: it comes now."""
        if self._monitor is not None and self.planned is not None:
            self._monitor.begin(token, self.planned)

    def measure(self, delivery: Delivery | None) -> None:
        """Measure the burst of a delivery, unless that was done; touches no disk."""
        if self._monitor is None or delivery is None or self.measured is not None:
            return
        if delivery.outcome is Outcome.NOT_FIRED:
            return
        measured = self.measured = self._with_health(self._ended(self._monitor, delivery))
        amiss = measured.verified == "false"
        trouble = f"monitor ({measured.tap}): {measured.words}; put it right, then go on"
        self.trouble = trouble if amiss else ""

    @staticmethod
    def _ended(monitor: Monitor, delivery: Delivery) -> Measured:
        from device.monitor.measured import Measured

        try:
            return monitor.end(delivery)
        except DeviceError as error:
            return Measured(
                token=delivery.token,
                tap=monitor.tap,
                source=monitor.source,
                unmeasured=" ".join(str(error).split()),
            )

    def _with_health(self, measured: Measured) -> Measured:
        """Count what the device knows of its amplifier: no tap before it sees its switch."""
        from device.monitor.measured import Fault

        try:
            health = told_health(self._device)
        except DeviceError:  # the next step tells
            return measured
        off = health is not None and (
            health.amplifier_enabled is False
            or health.switch_closed is False
            or health.over_current is True
        )
        faults = (*measured.faults, Fault.AMPLIFIER_OFF) if off else measured.faults
        return replace(measured, faults=faults)

    def onset_s(self, *, or_told_s: float) -> float:
        """Return the measured onset on the clock; where there is none, what the device told."""
        one = self.measured
        return or_told_s if one is None or one.onset_s is None or one.faults else one.onset_s

    @property
    def refused(self) -> bool:
        """Whether the trial is to be presented again for what was measured of its burst."""
        amiss = self.measured is not None and self.measured.verified == "false"
        return amiss and self._study.monitor.disagreement == "repeat"

    def open_again(self) -> bool:
        """Listen anew after a burst that was not verified; tell whether that could be done."""
        if self._monitor is None:
            return True
        try:
            self._monitor.open()
        except DeviceError as error:
            self.trouble = f"monitor: {error}"
            return False
        self.trouble = ""
        return True


def measured_facts(measured: Measured, planned: Planned, origin_s: float) -> dict[str, object]:
    """List what the journal keeps of what a monitor measured; the onset on the session's clock."""
    onset_s = None if measured.onset_s is None else measured.onset_s - origin_s
    figures = {
        "planned_left": planned.left,
        "planned_right": planned.right,
        "peak_left": measured.peak_left,
        "peak_right": measured.peak_right,
        "onset_uncertainty_s": measured.onset_uncertainty_s,
        "late_s": measured.late_s,
        "correlation_left": measured.correlation_left,
        "correlation_right": measured.correlation_right,
        "noise_left": measured.noise_left,
        "noise_right": measured.noise_right,
    }
    return {
        "token": measured.token,
        "tap": measured.tap.value,
        "source": measured.source,
        "unit": measured.tap.unit,
        "burst_verified": measured.verified,
        "faults": [fault.value for fault in measured.faults],
        "noted": [fault.value for fault in measured.noted],
        "unmeasured": measured.unmeasured or None,
        "onset_s": None if onset_s is None else round(onset_s, 7),
        **{name: None if one is None else significant(one) for name, one in figures.items()},
    }


class NoiseWatch:
    """The masking noise of a session, watched trial by trial.

    `ok` tells whether it played from the current trial's onset on; it is ``False`` also if it was
    lost before. `trouble` is what the operator has to know; empty if it plays.
    """

    def __init__(self, noise: NoisePlayer, journal: Journal) -> None:
        self._noise = noise
        self._journal = journal
        self._noted: tuple[bool | None, int] = (None, 0)
        self._loss: NoiseHealth | None = None
        self.ok: bool | None = None
        self.trouble = ""

    def begin_trial(self) -> None:
        """Forget the trial before."""
        self.ok = None

    def hear_onset(self) -> None:
        """Take the health at an onset; touches no disk."""
        self.ok = self._asked().ok

    def lost(self) -> bool:
        """Tell whether it does not play now, or did not at the onset; touches no disk."""
        if self._asked().ok is False:
            self.ok = False
        return self.ok is False

    def words(self) -> str:
        """Return its health in a few words; touches no disk."""
        return self._noise.health().words

    def note(self) -> None:
        """Journal its health where it changed; never between an onset and its answer.

        A loss is journaled even if it is over: a gap shows only in the first health after it.
        """
        losses = () if self._loss is None else (self._loss,)
        self._loss = None
        for health in (*losses, self._noise.health()):
            if (health.ok, health.underruns) != self._noted:
                self._noted = (health.ok, health.underruns)
                facts = {"frames": health.frames, "underruns": health.underruns}
                self._journal.append(
                    "noise_status", {"ok": health.ok, "words": health.words, **facts}
                )

    def start_again(self) -> bool:
        """Start it after it was lost; tell whether that could be done, and journal why not."""
        try:
            self._noise.start()
        except NoiseError as error:
            self.trouble = str(error)
            self._journal.append("noise_status", {"ok": False, "words": self.trouble})
            return False
        self.trouble = ""
        return True

    def stop(self) -> None:
        """Fall silent."""
        self._noise.stop()

    def _asked(self) -> NoiseHealth:
        health = self._noise.health()
        if health.ok is False:
            self._loss = health
            self.trouble = f"masking noise: {health.words}; put it right, then go on"
        return health
