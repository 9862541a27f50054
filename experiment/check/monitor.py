"""A monitor beside the check of a device: what it measured, and the keys that would be exact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from experiment.check.findings import Findings, WarningCode

if TYPE_CHECKING:
    from device.monitor.measured import Measured, Planned
    from experiment.study.equipment import MonitorSettings


_WRONG: Final = frozenset({"silent", "swapped", "stray", "doubled", "clipped", "amplifier off"})
"""Faults that no calibration puts right."""
_BY_KEY: Final = {
    "per_unit": frozenset({"too weak", "too strong"}),
    "delay_ms": frozenset({"early", "late"}),
}
"""Those that a key does."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorCalibration:
    """What a monitor measured of a burst of the check, and the keys that would make it exact."""

    side: str
    planned: Planned
    measured: Measured
    settings: MonitorSettings

    @property
    def good(self) -> bool:
        """Whether it was the planned burst by the study's own tolerances, as a session asks for."""
        return self.measured.verified != "false"

    @property
    def _can_calibrate(self) -> bool:
        """Whether what was measured is the burst, be it of another size or at another time."""
        return not self.measured.unmeasured and not _WRONG & {*self.measured.faults}

    @property
    def per_unit(self) -> float | None:
        """The key per_unit of this side with which the measured peak were the planned one."""
        at, one = self._at, self.measured
        peak = (one.peak_left, one.peak_right)[at]
        if not self._can_calibrate or not peak:
            return None
        now = 1.0 if self.settings.per_unit is None else self.settings.per_unit[at]
        return now * self.planned.peaks[at] / peak

    @property
    def delay_ms(self) -> float | None:
        """The key delay_ms of this side with which it had come out when it was told."""
        late_s, stated_ms = self.measured.late_s, self.settings.delay_ms or (0.0, 0.0)
        if late_s is None or not self._can_calibrate:
            return None
        return stated_ms[self._at] + late_s * 1e3

    @property
    def wrong(self) -> str:
        """What a session would pause for, and the keys with which it would not; empty if good."""
        if self.good:
            return ""
        remedies = [
            f"{key} = {value:.4g}"
            for key, faults in _BY_KEY.items()
            if (value := getattr(self, key)) is not None and faults & {*self.measured.faults}
        ]
        exact = f"; {' and '.join(remedies)} on the {self.side} would be exact" if remedies else ""
        return f"{self.measured.words}{exact}"

    @property
    def _correlation(self) -> float | None:
        return (self.measured.correlation_left, self.measured.correlation_right)[self._at]

    @property
    def _at(self) -> int:
        return ("left", "right").index(self.side)

    @property
    def findings(self) -> Findings:
        """Tell it."""
        one, at = self.measured, self._at
        found = Findings()
        peak, noise = (one.peak_left, one.peak_right)[at], (one.noise_left, one.noise_right)[at]
        facts = {
            "tap": one.tap.value,
            "verified": one.verified,
            "faults": [fault.value for fault in one.faults],
            "planned": self.planned.peaks[at],
            "peak": peak,
            "noise": noise,
            "correlation": self._correlation,
            "per_unit": self.per_unit,
            "delay_ms": self.delay_ms,
        }
        found.note(**facts)
        if not self.good:
            found.warn("monitor", WarningCode.UNVERIFIED_BURST, f"WRONG: {one.words}")
        if not self._can_calibrate:
            return found
        beside = "" if noise is None else f", noise {noise:.3g} {one.tap.unit}"
        told = f"{peak:.4g} {one.tap.unit} of {self.planned.peaks[at]:.4g} planned{beside}"
        found.tell("monitor" if self.good else "", f"{one.tap}: {told}")
        if "distorted" in one.faults:
            least, got = self.settings.least_correlation, self._correlation
            found.tell(
                "", f"correlation {got:.4g}, at least {least:g} asked for: no key mends that"
            )
        for key in _BY_KEY:
            value = getattr(self, key)
            if value is not None:
                found.tell("", f"exact with {key} = {value:.5g} on the {self.side}")
        return found
