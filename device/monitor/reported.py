"""What a device measured by itself, with its own converter, as a monitor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from device.errors import LinkError, Refusal, RefusedError
from device.monitor.judge import correlations_of, judge
from device.monitor.matching import TemplateMatch
from device.monitor.measured import Measured, Planned, Tap, Tolerances, void

if TYPE_CHECKING:
    from device.clock import Clock
    from device.core.host import HostDriver
    from device.core.reports import Measurement
    from device.driver import Delivery

_SCALE: Final = {Tap.LINE: 1e-3, Tap.AMPLIFIER: 1e-3, Tap.CURRENT: 1e-6, Tap.MOTION: 1e-3}
"""From what travels to the unit of the tap."""
_PER_ONE: Final = 1e-4
_NO_NOISE: Final = 1e-6
"""Of a burst: the device reports no noise, and what it calls measured is taken for it."""
_RESPONSE_TIMEOUT_S: Final = 2.0
_POLL_S: Final = 0.005


ALSO_UNSEEN: Final = ", nor that a burst was clipped or doubled"


class DeviceMonitor:
    """A `Monitor` by MEASURED: what a device reports of its last burst.

    The device matches the recording itself: 0.1 s of two channels at 48 kHz are 19 kB, which take
    3.1 s to come back at 115200 baud. It reports peaks, onset and correlation, but no noise and no
    second burst. `per_unit` is each channel's value at the tap for what the device reports.
    """

    source = "the device's own converter"

    def __init__(
        self,
        device: HostDriver,
        clock: Clock,
        *,
        tap: Tap,
        per_unit: tuple[float, ...],
        delay_s: tuple[float, ...],
        tolerances: Tolerances,
    ) -> None:
        self.tap = tap
        self._device = device
        self._clock = clock
        self._per_unit = per_unit
        self._delay_s = delay_s
        self._tolerances = tolerances
        self._planned: Planned | None = None

    @property
    def unseen(self) -> str:
        """What is never seen at its tap, nor by the device."""
        return self.tap.unseen + ALSO_UNSEEN

    def open(self) -> None:
        """Need nothing: the device listens by itself."""

    def close(self) -> None:
        """Need nothing."""

    def begin(self, token: int, planned: Planned) -> None:
        """Note what is to be seen."""
        self._planned = planned

    def end(self, delivery: Delivery) -> Measured:
        """Ask the device."""
        if self._planned is None:
            raise LinkError("nothing was begun that could be measured")
        report = self._read(delivery.token)
        if report is not None and report.tap == self.tap:
            return self._judge(delivery, report, self._planned)
        reason = "the device did not measure it"
        if report is not None:
            reason = f"the device measures at the tap {report.tap}, not {self.tap}"
        return Measured(token=delivery.token, tap=self.tap, source=self.source, unmeasured=reason)

    def _read(self, token: int) -> Measurement | None:
        give_up_s = self._clock.now_s() + _RESPONSE_TIMEOUT_S
        while True:
            try:
                return self._device.measured(token)
            except RefusedError as error:
                if error.code is not Refusal.BUSY or self._clock.now_s() > give_up_s:
                    raise
            self._clock.wait(_POLL_S)

    def _judge(self, delivery: Delivery, report: Measurement, planned: Planned) -> Measured:
        scale = _SCALE[self.tap]
        # A device may have more channels than are driven, which are its first ones.
        reported = zip(report.peaks, report.correlations, strict=True)
        channels = zip(reported, planned.burst, self._per_unit, strict=False)
        matches = [
            TemplateMatch(
                amplitude=peak * scale * per_unit,
                largest=peak * scale * per_unit,
                correlation=correlation * _PER_ONE,
                noise_rms=_NO_NOISE * full,
            )
            for (peak, correlation), full, per_unit in channels
        ]
        delays_s = zip(self._delay_s, planned.peaks, strict=True)
        delay_s = min(delay_s for delay_s, peak in delays_s if peak or planned.blank)
        late_s = report.onset_offset_us * 1e-6 - delay_s  # MEASURED has one onset: the first
        faults, _ = judge(
            planned,
            matches,
            tap=self.tap,
            tolerances=self._tolerances,
            late_s=[late_s] * len(matches),
            sample_rate_hz=planned.sample_rate_hz,
        )
        voiding = void(faults, self.tap)
        correlations = correlations_of(planned, matches, self._tolerances.silence)
        is_heard = any(correlation is not None for correlation in correlations)
        reported_s = (delivery.host_before_s + delivery.host_after_s) / 2
        uncertainty_s = delivery.uncertainty_s + report.onset_uncertainty_us * 1e-6
        return Measured(
            token=delivery.token,
            tap=self.tap,
            source=self.source,
            peaks=tuple(match.amplitude for match in matches),
            onset_s=reported_s + late_s if is_heard else None,
            onset_uncertainty_s=uncertainty_s if is_heard else None,
            late_s=late_s if is_heard else None,
            correlations=correlations,
            faults=voiding,
            noted=tuple(fault for fault in faults if fault not in voiding),
            blank=planned.blank,
        )
