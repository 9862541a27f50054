"""The bursts and the masking noise of a session, watched trial by trial."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from device.driver import Outcome
from device.errors import DeviceError
from experiment.hardware.monitor import planned_burst
from experiment.hardware.noise import NoiseError
from experiment.hardware.setup import read_health
from experiment.perception.gains import significant
from experiment.record.entries import NoiseChanged, StimulusMeasured
from experiment.trial.events import Event

if TYPE_CHECKING:
    from device.driver import Delivery
    from device.monitor.measured import Measured, Planned
    from experiment.hardware.noise import NoiseHealth, NoisePlayer
    from experiment.record.journal import Journal
    from experiment.session.config import SessionConfig
    from experiment.study.study import Study
    from experiment.trial.events import Attempt


class BurstMonitor:
    """What the monitor of a session, if there is one, measures of its bursts.

    Of the current interval, `planned` is the burst that the monitor should see, and `measured` what
    it saw. `trouble` is the operator's message; it is empty while bursts are verified.
    """

    def __init__(self, config: SessionConfig, study: Study) -> None:
        self._monitor = config.monitor
        self._device = config.device
        self._study = study
        self._conditions = {condition.name: condition for condition in study.conditions}
        self.planned: Planned | None = None
        self.measured: Measured | None = None
        self.trouble = ""

    def clear(self) -> None:
        """Forget the burst before."""
        self.planned = self.measured = None

    def expect(self, condition: str, sites: tuple[str, ...], level_vpp: float) -> None:
        """Compute what the burst of a condition at these sites should be at the tap."""
        if self._monitor is not None:
            self.planned = planned_burst(self._study, self._conditions[condition], sites, level_vpp)

    def begin(self, token: int) -> None:
        """Record from now on."""
        if self._monitor is not None and self.planned is not None:
            self._monitor.begin(token, self.planned)

    def measure(self, delivery: Delivery | None) -> None:
        """Measure the burst that was fired, unless that was done; touches no disk."""
        monitor = self._monitor
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
    def is_repeated(self) -> bool:
        """Whether the trial is presented again because its burst was not the planned one."""
        is_mismatch = self.measured is not None and self.measured.verified == "false"
        return is_mismatch and self._study.monitor.disagreement == "repeat"

    def reopen(self) -> Event | None:
        """Open the monitor again after a burst that was not verified."""
        try:
            if self._monitor is not None:
                self._monitor.open()
        except DeviceError as error:
            self.trouble = f"monitor: {error}"
            return Event.BURST_MISMATCH
        self.trouble = ""
        return None

    def line(self, attempt: Attempt, interval: int, origin_s: float) -> StimulusMeasured | None:
        """Return the journal's line of the measurement; its onset is on the session's clock."""
        measured, planned = self.measured, self.planned
        if measured is None or planned is None:
            return None
        none = (None,) * len(planned.peaks)
        by_site = {name: getattr(measured, name) or none for name in _BY_SITE}
        by_site["planned"] = planned.peaks
        values: dict[str, Any] = {name: _kept(getattr(measured, name)) for name in _FIGURES}
        values |= {name: tuple(map(_kept, figures)) for name, figures in by_site.items()}
        values |= {"unit": measured.tap.unit, "burst_verified": measured.verified}
        onset_s = measured.onset_s
        return StimulusMeasured(
            trial=attempt.trial.number,
            attempt=attempt.number,
            interval=interval,
            token=measured.token,
            tap=measured.tap.value,
            source=measured.source,
            faults=[fault.value for fault in measured.faults],
            noted=[fault.value for fault in measured.noted],
            unmeasured=measured.unmeasured or None,
            onset_s=None if onset_s is None else round(onset_s - origin_s, 7),
            **values,
        )


_FIGURES: Final = ("onset_uncertainty_s", "late_s")
_BY_SITE: Final = ("peaks", "correlations", "noise")
"""What a monitor measures, kept to so many digits as are significant."""


def _kept(figure: float | None) -> float | None:
    return None if figure is None else significant(figure)


class NoiseMonitor:
    """The masking noise of a session, watched trial by trial.

    `ok` is whether it has played since the onset of the current trial, and ``False`` also if it was
    lost before. `trouble` is the message for the operator; empty if the noise plays.
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
        self.ok = self._check_health().ok

    def lost(self) -> bool:
        """Return whether it is silent now, or was at the onset; touches no disk."""
        if self._check_health().ok is False:
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

    def _check_health(self) -> NoiseHealth:
        health = self._noise.health()
        if health.ok is False:
            self._losses = [health]  # the last one is enough
            self.trouble = f"masking noise: {health.message}; correct this"
        return health
