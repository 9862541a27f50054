"""What measures the bursts of a session, by its study; and what it is to see of each."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from device.core.host import HostDriver
from device.errors import LinkError
from experiment.rows import NOT_AVAILABLE
from experiment.study.stimulus import drive_samples
from experiment.study.study import StudyError

if TYPE_CHECKING:
    from device.clock import Clock
    from device.driver import BurstDevice
    from device.monitor.measured import Monitor, Planned
    from device.sound.recorder import Recorder
    from device.sound.stream import Stream
    from experiment.study.equipment import DeviceSettings, MonitorSettings
    from experiment.study.stimulus import Condition


def recorder_beside(
    monitor: MonitorSettings, device: DeviceSettings, clock: Clock
) -> Recorder | None:
    """Return what hears the inputs of the sound card that drives; None where nothing does.

    StudyError where no sound card drives, or no device that could measure by itself.
    """
    try:
        monitor.check_driver(device.driver)
    except ValueError as error:
        raise StudyError(str(error)) from error
    if monitor.source != "duplex":
        return None
    from device.sound.recorder import Recorder

    return Recorder(clock, device.sample_rate_hz, channels=monitor.inputs)


def make_monitor(
    settings: MonitorSettings, device: BurstDevice, clock: Clock, recorder: Recorder | None
) -> Monitor | None:
    """Return the monitor of a study, nothing opened yet; None where it has none.

    `recorder` is the one that the device records with.
    """
    if settings.source == "none" or settings.tap is None:
        return None
    # scipy.signal takes a tenth of a second to import: only who measures needs it
    from device.monitor.inputs import Calibration, InputMonitor
    from device.monitor.measured import Tap, Tolerances
    from device.monitor.reported import DeviceMonitor
    from device.sound.recorder import Recorder

    tap = Tap(settings.tap)
    per_unit = (1.0, 1.0) if settings.per_unit is None else settings.per_unit
    delay_s = settings.delay_ms and (settings.delay_ms[0] * 1e-3, settings.delay_ms[1] * 1e-3)
    tolerances = Tolerances(
        peak=settings.peak_tolerance,
        onset_s=settings.onset_tolerance_ms * 1e-3,
        correlation=settings.least_correlation,
        silence=settings.silence,
    )
    if isinstance(device, HostDriver) and settings.source == "device":
        return DeviceMonitor(
            device,
            clock,
            tap=tap,
            per_unit=per_unit,
            delay_s=delay_s or (0.0, 0.0),
            tolerances=tolerances,
        )
    calibration = Calibration(per_unit=per_unit, delay_s=delay_s)
    if recorder is not None:
        return InputMonitor(
            recorder,
            clock,
            tap=tap,
            calibration=calibration,
            tolerances=tolerances,
            source="inputs of the sound card that drives",
            played=getattr(device, "played", None),
            renew=getattr(device, "renew", None),
        )
    card = settings.sound_card
    return InputMonitor(
        Recorder(clock, settings.record_rate_hz, channels=settings.inputs),
        clock,
        tap=tap,
        calibration=calibration,
        tolerances=tolerances,
        source=f"inputs of the sound card {card or 'default'}",
        connect=partial(_open_inputs, settings),
    )


def _open_inputs(settings: MonitorSettings, heard: Recorder) -> Stream:
    """Open a monitor's own card; a `LinkError` names the key that has to be another."""
    from device.sound.stream import open_inputs

    try:
        return open_inputs(heard, card=settings.sound_card)
    except LinkError as error:
        told = str(error)
        if "Invalid number of channels" in told:
            key = f"monitor.inputs must be inputs of the card; got {list(settings.inputs)}"
        elif "Invalid sample rate" in told:
            rate_hz = settings.record_rate_hz
            key = f"monitor.sample_rate_hz must be a rate of the card; got {rate_hz:g}"
        elif told.startswith("cannot"):
            card = settings.sound_card
            key = f"monitor.sound_card must be one that has inputs and is free; got {card!r}"
        else:  # PortAudio itself is missing
            raise
        raise LinkError(f"{key} ({told})") from error


def monitor_facts(monitor: Monitor | None) -> dict[str, str] | str:
    """List what the header keeps of what measured the bursts, and of what it never sees."""
    if monitor is None:
        return NOT_AVAILABLE
    return {
        "source": monitor.source,
        "tap": monitor.tap.value,
        "unit": monitor.tap.unit,
        "never_sees": monitor.unseen,
    }


def monitor_words(settings: MonitorSettings) -> str:
    """Say in a line what measures the bursts, and what it never sees.

    >>> from experiment.study.equipment import MonitorSettings
    >>> monitor_words(MonitorSettings())
    'none: no burst is verified'
    """
    if settings.source == "none" or settings.tap is None:
        return "none: no burst is verified"
    from device.monitor.measured import Tap
    from device.monitor.reported import ALSO_UNSEEN

    by = {
        "duplex": "inputs of the sound card that drives",
        "input": f"inputs of the sound card {settings.sound_card or 'default'}",
        "device": "the device's own converter",
    }
    tap = Tap(settings.tap)
    also = ALSO_UNSEEN if settings.source == "device" else ""
    own = "; each stream's first burst tells its delay, as none is stated"
    delay = own if settings.delay_ms is None and settings.source != "device" else ""
    return f"{tap}, by {by[settings.source]}; it never sees {tap.unseen}{also}{delay}"


INPUT_ONSET_MS: Final = 20.0
"""What two cards need, whose onsets are told by the sound system's word: docs/monitor.md."""


def monitor_doubt(settings: MonitorSettings) -> str:
    """Say why nothing is measured, or good bursts may be told as early or late; or empty.

    >>> from experiment.study.equipment import MonitorSettings
    >>> monitor_doubt(MonitorSettings())
    ''
    >>> monitor_doubt(MonitorSettings(source="none", sound_card="Scarlett"))
    'monitor.sound_card is named, but nothing is measured: monitor.source = "none"'
    """
    if settings.source == "none" and settings.sound_card:
        return 'monitor.sound_card is named, but nothing is measured: monitor.source = "none"'
    if settings.source != "input" or settings.onset_tolerance_ms >= INPUT_ONSET_MS:
        return ""
    return (
        f"monitor.onset_tolerance_ms = {settings.onset_tolerance_ms:g} may be too narrow: two "
        f"cards have no common clock; begin with {INPUT_ONSET_MS:g}, docs/monitor.md"
    )


def planned_burst(
    condition: Condition,
    device: DeviceSettings,
    per_volt: tuple[float, float],
    *,
    side: str,
    level_vpp: float,
) -> Planned:
    """Return what is to be seen at a tap, which has so much per volt, left and right."""
    from device.monitor.measured import Planned

    samples = drive_samples(condition, device)
    peak = float(np.max(np.abs(samples)))
    left, right = (level_vpp / 2 * peak * one for one in per_volt)
    return Planned(
        shape=samples / peak,
        sample_rate_hz=device.sample_rate_hz,
        left=left if side in {"left", "both"} else 0.0,
        right=right if side in {"right", "both"} else 0.0,
        burst=(left, right),
    )
