"""The stimuli of a session on their way out, measured, and the masking noise meanwhile."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from device.driver import Outcome
from device.errors import DeviceError, RefusedError
from experiment.archive.entries import (
    DeviceFailed,
    NoiseChanged,
    StimulusCommanded,
    StimulusMeasured,
    TrialArmed,
)
from experiment.hardware.monitor import planned_burst
from experiment.hardware.noise import NoiseError
from experiment.hardware.setup import SLOTS, load_condition, read_health
from experiment.hardware.suitability import LONGEST_ARMED_S, onset_interval_s, playing_s
from experiment.perception.gains import significant
from experiment.trial.events import Event

if TYPE_CHECKING:
    from collections.abc import Mapping

    from device.driver import Delivery
    from device.monitor.measured import Measured, Planned
    from experiment.archive.journal import Journal
    from experiment.hardware.noise import NoiseHealth, NoisePlayer
    from experiment.session.setting import Setting
    from experiment.study.study import Study
    from experiment.trial.events import Attempt
    from experiment.trial.plan import Trial


_EVENT_OF: Mapping[Outcome, Event] = {
    Outcome.FIRED: Event.FIRED,
    Outcome.NOT_FIRED: Event.NOT_FIRED,
    Outcome.INDETERMINATE: Event.DELIVERY_UNKNOWN,
}


class StimulusDelivery:
    """The stimuli of a session, one after the other, and what a monitor measures of them.

    Of the current trial, `delivery` is what became of its stimulus, if it was fired, and `onset_s`
    its onset on the clock; `measured` is what the monitor, if there is one, saw of the `planned`
    burst. `failure` is what the device failed with, if it did, and `trouble` what the operator has
    to know of the monitor: empty while bursts are verified.
    """

    def __init__(
        self, setting: Setting, study: Study, journal: Journal, *, last_token: int
    ) -> None:
        self._study = study
        self._device = setting.device
        self._monitor = setting.monitor
        self._clock = setting.clock
        self._journal = journal
        self._conditions = {condition.name: condition for condition in study.conditions}
        self._loaded: str | None = None
        self._duration_s = self._interval_s = 0.0
        self._silent_s = self._rested_s = setting.clock.now_s()
        self._token = last_token
        self.delivery: Delivery | None = None
        self.onset_s = 0.0
        self.planned: Planned | None = None
        self.measured: Measured | None = None
        self.failure: DeviceError | None = None
        self.trouble = ""

    def prepare(self, trial: Trial) -> float:
        """Load the trial's waveforms, if need be; return the earliest time of its onset.

        DeviceError where the device does not take them.
        """
        self.delivery = self.planned = self.measured = None
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

    def arm(self, attempt: Attempt) -> Event:
        """Journal a new token, then arm the device with it, and have the monitor listen."""
        trial = attempt.trial
        level_vpp = trial.level_vpp or min(self._study.design_of(trial.condition).levels_vpp)
        # Tokens rise, also where the calendar's clock was set back: the device relies on it.
        self._token = max(self._token + 1, time.time_ns())
        # On the disk before the device knows it: after a crash only the token tells what was felt.
        armed = TrialArmed(trial=trial.number, attempt=attempt.number, token=self._token)
        self._journal.append(armed, sync=True)
        try:
            self._device.set_levels(level_vpp, level_vpp)
            self._device.arm(self._token, SLOTS[trial.side], time_to_live_s=LONGEST_ARMED_S)
        except DeviceError as error:
            return self.fail(error)
        if self._monitor is not None:
            condition = self._conditions[trial.condition]
            self.planned = planned_burst(self._study, condition, trial.side, level_vpp)
        self._journal.append(StimulusCommanded(token=self._token))
        return Event.ARMED

    def fire(self) -> Event:
        """Emit the stimulus; nothing is journaled of one that went out."""
        if self._monitor is not None and self.planned is not None:
            self._monitor.begin(self._token, self.planned)
        try:
            self.delivery = self._device.fire(self._token)
        except RefusedError as error:
            self._journal.append(_failure_line(error))  # synced with the trial's end
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
        self._journal.append(_failure_line(error), sync=True)
        return Event.DEVICE_FAILED

    def measure(self) -> None:
        """Measure the burst that was fired, unless that was done; touches no disk."""
        monitor, delivery = self._monitor, self.delivery
        if monitor is None or delivery is None or self.measured is not None:
            return
        if delivery.outcome is Outcome.NOT_FIRED:
            return
        from device.monitor.measured import Fault, Measured

        try:
            measured = monitor.end(delivery)
        except DeviceError as error:
            why = " ".join(str(error).split())
            measured = Measured(
                token=delivery.token, tap=monitor.tap, source=monitor.source, unmeasured=why
            )
        # What the device knows of its amplifier counts, too: no tap before it sees its switch.
        with contextlib.suppress(DeviceError):  # the next step reports it
            health = read_health(self._device)
            if health is not None and (
                health.amplifier_enabled is False
                or health.switch_closed is False
                or health.over_current is True
            ):
                measured = replace(measured, faults=(*measured.faults, Fault.AMPLIFIER_OFF))
        self.measured = measured
        trouble = f"monitor ({measured.tap}): {measured.text}; correct this"
        self.trouble = trouble if measured.verified == "false" else ""

    @property
    def is_refused(self) -> bool:
        """Whether the trial is to be presented again for what was measured of its burst."""
        is_mismatch = self.measured is not None and self.measured.verified == "false"
        return is_mismatch and self._study.monitor.disagreement == "repeat"

    def open_monitor(self) -> Event | None:
        """Listen anew, where there is a monitor, after a burst that was not verified."""
        try:
            if self._monitor is not None:
                self._monitor.open()
        except DeviceError as error:
            self.trouble = f"monitor: {error}"
            return Event.BURST_MISMATCH
        self.trouble = ""
        return None


def _failure_line(error: DeviceError) -> DeviceFailed:
    return DeviceFailed(error=type(error).__name__, message=str(error))


def measurement_line(
    attempt: Attempt, measured: Measured, planned: Planned, origin_s: float
) -> StimulusMeasured:
    """Return the journal line of a measurement; its onset is on the session's clock."""
    figures: dict[str, float | None]
    figures = {"planned_left": planned.left, "planned_right": planned.right}
    figures |= {name: getattr(measured, name) for name in _FIGURES}
    values: dict[str, Any] = {
        name: None if value is None else significant(value) for name, value in figures.items()
    }
    values |= {"unit": measured.tap.unit, "burst_verified": measured.verified}
    onset_s = measured.onset_s
    return StimulusMeasured(
        trial=attempt.trial.number,
        attempt=attempt.number,
        token=measured.token,
        tap=measured.tap.value,
        source=measured.source,
        faults=[fault.value for fault in measured.faults],
        noted=[fault.value for fault in measured.noted],
        unmeasured=measured.unmeasured or None,
        onset_s=None if onset_s is None else round(onset_s - origin_s, 7),
        **values,
    )


_FIGURES: Final = (
    *("peak_left", "peak_right", "onset_uncertainty_s", "late_s"),
    *("correlation_left", "correlation_right", "noise_left", "noise_right"),
)
"""What a monitor measures, kept to so many digits as are significant."""


class NoiseMonitor:
    """The masking noise of a session, watched trial by trial.

    `ok` tells whether it played from the current trial's onset on; it is ``False`` also if it was
    lost before. `trouble` is what the operator has to know; empty if it plays.
    """

    def __init__(self, noise: NoisePlayer, journal: Journal) -> None:
        self._noise = noise
        self._journal = journal
        self._noted: tuple[bool | None, int] = (None, 0)
        self._losses: list[NoiseHealth] = []
        self.ok: bool | None = None
        self.trouble = ""

    def hear_onset(self) -> None:
        """Take the health at an onset; touches no disk."""
        self.ok = self._asked().ok

    def lost(self) -> bool:
        """Tell whether it does not play now, or did not at the onset; touches no disk."""
        if self._asked().ok is False:
            self.ok = False
        return self.ok is False

    def note(self) -> None:
        """Journal its health where it changed; never between an onset and its answer.

        A loss is journaled even if it is over: a gap shows only in the first health after it.
        """
        losses, self._losses = self._losses, []
        for health in (*losses, self._noise.health()):
            if (health.ok, health.underruns) != self._noted:
                self._noted = (health.ok, health.underruns)
                line = NoiseChanged(
                    ok=health.ok,
                    text=health.message,
                    frames=health.frames,
                    underruns=health.underruns,
                )
                self._journal.append(line)

    def start_again(self) -> Event | None:
        """Start it after it was lost; journal why not where that cannot be done."""
        try:
            self._noise.start()
        except NoiseError as error:
            self.trouble = str(error)
            self._journal.append(NoiseChanged(ok=False, text=self.trouble))
            return Event.NOISE_LOST
        self.trouble = ""
        return None

    def _asked(self) -> NoiseHealth:
        health = self._noise.health()
        if health.ok is False:
            self._losses = [health]  # the last one is enough
            self.trouble = f"masking noise: {health.message}; correct this"
        return health
