"""The check of a device against a study: its identity and limits, and one weak burst a channel.

Without a device: what this computer lacks to run the study.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from itertools import count
from typing import TYPE_CHECKING, Any, Final

from device.driver import Outcome
from device.drivers import MOCK
from experiment.check.warnings import apply_rules
from experiment.hardware.monitor import planned_burst
from experiment.hardware.safety import require_confirmed
from experiment.hardware.setup import load_condition, read_health, read_limits
from experiment.hardware.suitability import LONGEST_ARMED_S, onset_interval_s, require_suitable

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.driver import Lack
    from device.monitor.measured import Measured, Planned
    from experiment.check.warnings import CheckWarning
    from experiment.hardware.safety import Confirmation
    from experiment.hardware.setup import Hardware
    from experiment.study.equipment import DeviceSettings, Masking, MonitorSettings
    from experiment.study.study import Study


FRACTION: Final = 0.1
"""Level of a test burst, as a fraction of the study's highest level."""

_TOLERANCE: Final = 0.01
_STEP_VPP: Final = 0.002
_QUIET_S: Final = 1.0
_NOT_THE_BURST: Final = frozenset(
    {"silent", "swapped", "stray", "doubled", "clipped", "amplifier off"}
)
"""Faults with which a measurement is no measurement of the burst: no key corrects them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorCheck:
    """What a monitor measured of a test burst, and the keys with which it would be exact.

    `planned` and `peak` are in `unit` at the tap; `per_unit` and `delay_ms` are values of these
    keys, None where it measured another burst or none.
    """

    tap: str
    unit: str
    verified: str | None
    faults: tuple[str, ...]
    unmeasured: str | None
    planned: float
    peak: float | None
    noise: float | None
    correlation: float | None
    per_unit: float | None
    delay_ms: float | None

    @property
    def failure(self) -> str | None:
        """What is wrong with the burst, or why it was not measured."""
        return ", ".join(self.faults) or self.unmeasured

    @property
    def is_verified(self) -> bool:
        """Whether it was the planned burst by the study's tolerances, as in a session."""
        return self.verified != "false"


def check_monitor(
    index: int, planned: Planned, measured: Measured, settings: MonitorSettings
) -> MonitorCheck:
    """Compare what a monitor measured of a burst on one channel with the planned one."""
    none = (None,) * len(planned.peaks)
    faults = tuple(fault.value for fault in measured.faults)
    peak = (measured.peaks or none)[index]
    is_burst = not measured.unmeasured and not _NOT_THE_BURST & {*faults}
    scale = 1.0 if settings.per_unit is None else settings.per_unit[index]
    late_s = measured.late_s
    delay_ms = 0.0 if settings.delay_ms is None else settings.delay_ms[index]
    return MonitorCheck(
        tap=measured.tap.value,
        unit=measured.tap.unit,
        verified=measured.verified,
        faults=faults,
        unmeasured=measured.unmeasured or None,
        planned=planned.peaks[index],
        peak=peak,
        noise=(measured.noise or none)[index],
        correlation=(measured.correlations or none)[index],
        per_unit=scale * planned.peaks[index] / peak if is_burst and peak else None,
        delay_ms=None if late_s is None or not is_burst else delay_ms + late_s * 1e3,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelCheck:
    """One channel and its test burst.

    Attributes
    ----------
    outcome : str or None
        What the device reports of the burst; None if the operator declined it.
    read_back_vpp : float or None
        The level that the device reports for this channel; None if nothing was fired.
    failed : bool
        Whether the device reports that it deviated from its commands.
    seen : bool or None
        Whether the operator saw the burst on this channel only; None without a question.
    good : bool
        Whether the burst was correct, as far as it was checked.
    """

    side: str
    level_vpp: float
    outcome: str | None = None
    read_back_vpp: float | None = None
    uncertainty_s: float | None = None
    failed: bool = False
    seen: bool | None = None
    good: bool = False
    monitor: MonitorCheck | None = None

    @property
    def ready(self) -> bool:
        """Whether device and operator say that the burst went out as it should."""
        return self.outcome is not None and not self.failed and self.seen is not False


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceCheck:
    """The result of the check of a device.

    Attributes
    ----------
    identity : dict of str
        The device's answer.
    cannot : tuple of str
        What the device cannot guarantee.
    levels_vpp : tuple of float
        The study's levels; the device armed each of them on both channels.
    channels : tuple of ChannelCheck
        Left, right.
    limits, health : dict of str, or None
        The limits that the device reports, and the state of its amplifier with the output on.
    """

    identity: dict[str, Any]
    cannot: tuple[str, ...]
    levels_vpp: tuple[float, ...]
    channels: tuple[ChannelCheck, ...]
    limits: dict[str, Any] | None = None
    health: dict[str, Any] | None = None

    @property
    def warnings(self) -> tuple[CheckWarning, ...]:
        """What the operator should look at."""
        rules = [(True, "missing_guarantee", {"limitation": text}) for text in self.cannot]
        for channel in self.channels:
            data: dict[str, Any] = {"side": channel.side, "level_vpp": channel.level_vpp}
            rules.append((not channel.ready, "failed_channel", data))
            if (monitor := channel.monitor) is not None:
                data = {"side": channel.side, "faults": monitor.failure}
                rules.append((not monitor.is_verified, "unverified_burst", data))
        return apply_rules(rules)


def check_device(
    study: Study,
    rig: Hardware,
    *,
    confirmation: Confirmation | None,
    ask: Callable[[str], bool] | None,
) -> DeviceCheck:
    """Open a device, set every level, and play one weak burst on each channel.

    The outputs are at zero when this function returns or raises an error.

    Parameters
    ----------
    study : Study
        The study.
    rig : Hardware
        The device, not yet opened.
    confirmation : Confirmation or None
        The operator's confirmation that a real device is safe.
    ask : callable or None
        Asks the operator before and after each burst; None plays all bursts without a question.

    Raises
    ------
    ValueError
        If a real device was not confirmed to be safe; nothing was switched on.
    SuitabilityError
        If the device does not suit the study's sample rate, levels or waveforms; nothing was
        switched on.
    DeviceError
        If the device refuses a step or cannot be reached.

    Examples
    --------
    >>> from experiment.hardware.setup import assemble
    >>> from experiment.study.files import paper_study
    >>> rig = assemble(paper_study(), driver="mock", port=None, simulated=True)
    >>> check = check_device(paper_study(), rig, confirmation=None, ask=None)
    >>> [channel.read_back_vpp for channel in check.channels]
    [20.0, 20.0]
    """
    device = rig.device
    identity = device.open()
    try:
        require_confirmed(identity, confirmation)
        limits = read_limits(device)
        require_suitable(study, identity, limits)
        load_condition(device, study.conditions[0], study)
        device.enable()
        if rig.monitor is not None:
            rig.monitor.open()
        both_vpp = study.design.both_level_vpp
        levels_vpp = sorted({*study.design.levels_vpp, *([both_vpp] if both_vpp else [])})
        slots = study.task.slots
        widest = max(range(len(slots)), key=lambda slot: len(slots[slot]))
        # from the calendar's clock on, as in a session, so that no device saw a token before
        tokens = count(time.time_ns())
        for level_vpp, token in zip(levels_vpp, tokens, strict=False):
            device.set_levels([level_vpp] * len(study.task.sites))
            device.arm(token, widest, time_to_live_s=LONGEST_ARMED_S)
            device.disarm(token)
        test_vpp = round(levels_vpp[-1] * FRACTION, 3)
        channels = tuple(
            _check_channel(study, rig, side=side, level_vpp=test_vpp, token=next(tokens), ask=ask)
            for side in study.task.sites
        )
        return DeviceCheck(
            identity=asdict(identity),
            cannot=device.cannot,
            levels_vpp=tuple(levels_vpp),
            channels=channels,
            limits=None if limits is None else asdict(limits),
            health=None if (health := read_health(device)) is None else asdict(health),
        )
    finally:
        if rig.monitor is not None:
            rig.monitor.close()
        device.close()


def _check_channel(
    study: Study,
    rig: Hardware,
    *,
    side: str,
    level_vpp: float,
    token: int,
    ask: Callable[[str], bool] | None,
) -> ChannelCheck:
    """Play one weak burst on a channel, and measure it if the study has a monitor."""
    condition, device, monitor = study.conditions[0], rig.device, rig.monitor
    sites = study.task.sites
    channel = sites.index(side)
    if ask is not None and not ask(f"Play one burst of {level_vpp:g} Vpp on the {side} channel?"):
        return ChannelCheck(side=side, level_vpp=level_vpp)
    rig.clock.wait(onset_interval_s(condition, study))
    planned = planned_burst(study, condition, (side,), level_vpp)
    if monitor is not None:
        rig.clock.wait(_QUIET_S)
        monitor.begin(token, planned)
    device.set_levels([level_vpp] * len(sites))
    device.arm(token, study.task.slots.index((side,)), time_to_live_s=LONGEST_ARMED_S)
    delivery = device.fire(token)
    is_fired = delivery.outcome is Outcome.FIRED
    measured = None
    if monitor is not None and is_fired:
        measured = check_monitor(channel, planned, monitor.end(delivery), study.monitor)
    seen = None if ask is None else ask(f"Did the {side} output move, and only that one?")
    levels_vpp = delivery.levels_vpp or (0.0,) * len(sites)
    read_back_vpp = levels_vpp[channel]
    is_off = abs(read_back_vpp - level_vpp) > level_vpp * _TOLERANCE + _STEP_VPP
    failed = not is_fired or is_off or sum(levels_vpp) != read_back_vpp
    is_verified = measured is None or measured.is_verified
    return ChannelCheck(
        side=side,
        level_vpp=level_vpp,
        outcome=delivery.outcome.value,
        read_back_vpp=read_back_vpp if is_fired else None,
        uncertainty_s=delivery.uncertainty_s,
        failed=failed,
        seen=seen,
        good=not failed and seen is not False and is_verified,
        monitor=measured,
    )


def missing_equipment(settings: DeviceSettings, masking: Masking) -> list[tuple[str, Lack]]:
    """Return what this computer lacks for a device and for masking noise; nothing is opened.

    Parameters
    ----------
    settings : DeviceSettings
        The study's, with the driver and the port that were chosen.
    masking : Masking
        The study's.

    Returns
    -------
    list of (str, Lack)
        What needs it, and what is missing.
    """
    from device.scpi.visa import instrument_lack
    from device.sound.stream import sound_lack
    from device.wire.channels import port_lack

    lacks: list[tuple[str, Lack | None]] = []
    if settings.driver == "audio":
        lacks.append(("device", sound_lack()))
    elif settings.driver != MOCK and settings.port is not None:
        find_lack = instrument_lack if settings.driver == "generator" else port_lack
        lacks.append(("device", find_lack(settings.port)))
    if masking.noise != "none":
        lacks.append(("masking noise", sound_lack()))
    return [(need, lack) for need, lack in lacks if lack is not None]
