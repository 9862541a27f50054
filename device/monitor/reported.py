"""What a device measured by itself, with its own converter, as a monitor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from device.errors import LinkError, Refusal, RefusedError
from device.monitor.delays import Delays
from device.monitor.measured import Fault, Measured, Planned, Tap, Tolerances, void

if TYPE_CHECKING:
    from device.clock import Clock
    from device.core.host import HostDriver
    from device.core.reports import Measurement
    from device.driver import Delivery

_SCALE: Final = {"mV": 1e-3, "uA": 1e-6, "nm": 1e-3}
"""From what travels to the unit of the tap."""
_PER_ONE: Final = 1e-4
_PATIENCE_S: Final = 2.0
_POLL_S: Final = 0.005


ALSO_UNSEEN: Final = ", nor that a burst was clipped or doubled"


class DeviceMonitor:
    """A `Monitor` by MEASURED: peaks, onset and correlation that a device tells of its last burst.

    It tells no noise and of no second burst: what it calls measured is taken for it.
    `per_unit`: at the tap for what the device tells, left and right.
    """

    source = "the device's own converter"

    def __init__(
        self,
        device: HostDriver,
        clock: Clock,
        *,
        tap: Tap,
        per_unit: tuple[float, float],
        delay_s: tuple[float, float],
        tolerances: Tolerances,
    ) -> None:
        self.tap = tap
        self._device = device
        self._clock = clock
        self._per_unit = per_unit
        self._delay_s = delay_s
        self._tolerances = tolerances
        self._planned: Planned | None = None
        self._delays = Delays()

    @property
    def unseen(self) -> str:
        """What is never seen at its tap, nor by it."""
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
        told = self._asked(delivery.token)
        if told is None or told.tap != self.tap:
            at = "it" if told is None else f"at the tap {told.tap}, not {self.tap}"
            why = (
                f"the device did not measure {at}" if told is None else f"the device measures {at}"
            )
            return Measured(token=delivery.token, tap=self.tap, source=self.source, unmeasured=why)
        return self._judged(delivery, told, self._planned)

    def _asked(self, token: int) -> Measurement | None:
        give_up_s = self._clock.now_s() + _PATIENCE_S
        while True:
            try:
                return self._device.measured(token)
            except RefusedError as error:
                if error.code is not Refusal.BUSY or self._clock.now_s() > give_up_s:
                    raise
            self._clock.wait(_POLL_S)

    def _judged(self, delivery: Delivery, told: Measurement, planned: Planned) -> Measured:
        scale = _SCALE[told.unit]
        left = told.left * scale * self._per_unit[0]
        right = told.right * scale * self._per_unit[1]
        correlations = told.correlation_left * _PER_ONE, told.correlation_right * _PER_ONE
        sounding = [at for at, peak in enumerate(planned.peaks) if peak] or [0, 1]
        delay_s = min(self._delay_s[at] for at in sounding)  # MEASURED has one onset: the first
        late_s = told.onset_offset_us * 1e-6 - delay_s
        parts = left / planned.burst[0], right / planned.burst[1]
        faults = self._faults(planned, parts, correlations, late_s)
        heard = any(part >= self._tolerances.silence for part in parts)
        told_s = (delivery.host_before_s + delivery.host_after_s) / 2
        voided = void(faults, self.tap)
        noted = tuple(one for one in faults if one not in voided)
        if heard and not voided:
            known_s = told.onset_uncertainty_us * 1e-6
            noted += (Fault.DELAYED,) * self._delays.changed(late_s, known_s)
        return Measured(
            token=delivery.token,
            tap=self.tap,
            source=self.source,
            peak_left=left,
            peak_right=right,
            onset_s=told_s + late_s if heard else None,
            onset_uncertainty_s=(
                delivery.uncertainty_s + told.onset_uncertainty_us * 1e-6 if heard else None
            ),
            late_s=late_s if heard else None,
            correlation_left=correlations[0] if parts[0] >= self._tolerances.silence else None,
            correlation_right=correlations[1] if parts[1] >= self._tolerances.silence else None,
            faults=voided,
            noted=noted,
            blank=planned.blank,
        )

    def _faults(
        self,
        planned: Planned,
        parts: tuple[float, float],
        correlations: tuple[float, float],
        late_s: float,
    ) -> tuple[Fault, ...]:
        limits = self._tolerances
        faults: list[Fault] = []
        sides = list(zip(planned.peaks, parts, correlations, strict=True))
        for peak, part, correlation in sides:
            if not peak:
                faults += [Fault.STRAY] if part >= limits.silence else []
            elif part < limits.silence:
                faults.append(Fault.SILENT)
            else:
                faults += [Fault.WEAK] if part < 1 - limits.peak else []
                faults += [Fault.STRONG] if part > 1 + limits.peak else []
                faults += [Fault.DISTORTED] if correlation < limits.correlation else []
        if {Fault.SILENT, Fault.STRAY} <= {*faults}:
            return (Fault.SWAPPED,)
        if any(planned.peaks) and Fault.SILENT not in faults and abs(late_s) > limits.onset_s:
            faults.append(Fault.LATE if late_s > 0 else Fault.EARLY)
        return tuple(dict.fromkeys(faults))
