"""What measures the bursts of a session, by its study; and what it is to see of each."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from device.core.converter import ConverterDevice
from device.core.host import HostDriver
from device.errors import LinkError, SoundCardError
from experiment.study.stimulus import drive_samples

if TYPE_CHECKING:
    from device.clock import Clock
    from device.driver import BurstDevice
    from device.monitor.measured import Monitor, Planned
    from device.sound.recorder import Recorder
    from device.sound.stream import Stream
    from experiment.study.equipment import MonitorSettings
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


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

    tap, delay_s = Tap(settings.tap), None
    if settings.delay_ms is not None:
        delay_s = tuple(delay_ms * 1e-3 for delay_ms in settings.delay_ms)
    per_unit = settings.per_unit or (1.0,) * len(settings.inputs)
    tolerances = Tolerances(
        peak=settings.peak_tolerance,
        onset_s=settings.onset_tolerance_ms * 1e-3,
        correlation=settings.min_correlation,
        silence=settings.silence,
    )
    shared: dict[str, Any] = {"tap": tap, "tolerances": tolerances}
    if isinstance(device, HostDriver) and settings.source == "device":
        delay_s = delay_s or (0.0,) * len(per_unit)
        return DeviceMonitor(device, clock, per_unit=per_unit, delay_s=delay_s, **shared)
    shared["calibration"] = Calibration(per_unit=per_unit, delay_s=delay_s)
    card = "that drives"
    if recorder is None:
        recorder = Recorder(clock, settings.record_rate_hz, channels=settings.inputs)
        card, shared["connect"] = settings.sound_card or "default", partial(_open_inputs, settings)
    elif isinstance(device, ConverterDevice):
        shared["card"] = device.converter
    return InputMonitor(recorder, clock, source=f"inputs of the sound card {card}", **shared)


def _open_inputs(settings: MonitorSettings, heard: Recorder) -> Stream:
    """Open a monitor's own card; a `LinkError` names the key that has to be another."""
    from device.sound.stream import INVALID_CHANNEL_COUNT, INVALID_SAMPLE_RATE, open_inputs

    rules = {
        INVALID_CHANNEL_COUNT: ("inputs", "inputs of the card", list(settings.inputs)),
        INVALID_SAMPLE_RATE: ("sample_rate_hz", "a rate of the card", settings.record_rate_hz),
    }
    free = ("sound_card", "a sound card with inputs that no program uses", settings.sound_card)
    try:
        return open_inputs(heard, card=settings.sound_card)
    except SoundCardError as error:
        key, rule, value = rules.get(error.code, free) if error.code is not None else free
        raise LinkError(f"monitor.{key} must be {rule}; got {value!r} ({error})") from error


def describe_monitor(monitor: Monitor) -> dict[str, str]:
    """List what the header keeps of a monitor, and what it never sees."""
    return {
        "source": monitor.source,
        "tap": monitor.tap.value,
        "unit": monitor.tap.unit,
        "never_sees": monitor.unseen,
    }


def planned_burst(
    study: Study, condition: Condition, sites: tuple[str, ...], level_vpp: float
) -> Planned:
    """Return what is to be seen at the study's tap of a burst at these sites."""
    from device.monitor.measured import Planned

    samples = drive_samples(condition, study.device)
    peak = float(np.max(np.abs(samples)))
    all_sites = study.task.sites
    per_volt = study.monitor.per_volt or (1.0,) * len(all_sites)
    burst = tuple(level_vpp / 2 * peak * at_tap for at_tap in per_volt)
    return Planned(
        shape=samples / peak,
        sample_rate_hz=study.device.sample_rate_hz,
        peaks=tuple(
            amplitude if site in sites else 0.0
            for site, amplitude in zip(all_sites, burst, strict=True)
        ),
        burst=burst,
    )
