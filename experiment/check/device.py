"""The check of a device against a study: who it is, what it takes, one weak burst a channel.

Without a device: what this machine lacks to run the study.
"""

from __future__ import annotations

import os
import time
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Final

from device.driver import Lack, Outcome
from device.drivers import MOCK
from experiment.apparatus.monitor import planned_burst
from experiment.apparatus.rig import require_confirmed
from experiment.apparatus.slots import (
    LONGEST_ARMED_S,
    SLOTS,
    load_condition,
    onset_interval_s,
    require_suitable,
    told_health,
    told_limits,
)
from experiment.check.findings import Findings, WarningCode
from experiment.check.monitor import MonitorCalibration

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from device.core.reports import DeviceLimits, Health
    from device.driver import BurstDevice, Delivery, Identity
    from experiment.apparatus.rig import Confirmation, Rig
    from experiment.study.equipment import DeviceSettings, Masking
    from experiment.study.study import Study


FRACTION: Final = 0.1
"""Of the study's highest level: what a burst of the check has."""

_TOLERANCE: Final = 0.01
_STEP_VPP: Final = 0.002
_QUIET_S: Final = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ChannelCheck:
    """One channel and its burst."""

    side: str
    level_vpp: float
    delivery: Delivery | None  # none if the operator did not want it
    seen: bool | None  # by the operator there and only there; none where nobody was asked
    calibration: MonitorCalibration | None = None  # none without a monitor

    @property
    def read_back_vpp(self) -> float | None:
        """The level that the device says it set on this channel; None if nothing was fired."""
        if self.delivery is None or self.delivery.outcome is not Outcome.FIRED:
            return None
        left = self.side == "left"
        return self.delivery.level_left_vpp if left else self.delivery.level_right_vpp

    @property
    def failed(self) -> bool:
        """Whether the device did not do what it was told, by its own words."""
        if self.delivery is None:
            return False
        if self.read_back_vpp is None:
            return True
        silent_vpp = self.delivery.level_left_vpp + self.delivery.level_right_vpp
        off_vpp = abs(self.read_back_vpp - self.level_vpp)
        return off_vpp > self.level_vpp * _TOLERANCE + _STEP_VPP or silent_vpp != self.read_back_vpp

    @property
    def good(self) -> bool:
        """Whether the burst went out as it should, as far as anybody looked."""
        measured = self.calibration is None or self.calibration.good
        return self.ready and measured

    @property
    def ready(self) -> bool:
        """Whether device and operator say that it went out as it should."""
        return self.delivery is not None and not self.failed and self.seen is not False

    @property
    def text(self) -> str:
        """The result in words."""
        if self.delivery is None:
            return "not tried"
        told = self.delivery.outcome.value.replace("_", " ")
        words = [f"burst of {self.level_vpp:g} Vpp: {told}"]
        if self.read_back_vpp is not None:
            words += [
                f"{self.read_back_vpp:g} Vpp read back",
                f"onset known to {self.delivery.uncertainty_s * 1e3:.2g} ms",
            ]
        if self.failed:
            words.append("WRONG: not what was set")
        if self.seen is not None:
            words.append("seen there alone" if self.seen else "WRONG: not seen there alone")
        return ", ".join(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceCheck:
    """What the check of a device found.

    Attributes
    ----------
    identity : Identity
        Who answered.
    cannot : tuple of str
        What the device cannot promise.
    levels_vpp : tuple of float
        The study's levels; the device armed each of them on both channels.
    channels : tuple of ChannelCheck
        Left, right.
    limits : DeviceLimits or None
        What the device is ready to do, if it tells that.
    health : Health or None
        What it knows of its amplifier, with its output on.
    """

    identity: Identity
    cannot: tuple[str, ...]
    levels_vpp: tuple[float, ...]
    channels: tuple[ChannelCheck, ...]
    limits: DeviceLimits | None = None
    health: Health | None = None


def check_device(
    study: Study,
    rig: Rig,
    *,
    confirmation: Confirmation | None,
    ask: Callable[[str], bool] | None,
) -> DeviceCheck:
    """Open a device, have it take every level, and play one weak burst on each channel.

    The outputs are at zero when this ends, however it ends.

    Parameters
    ----------
    study : Study
        The study.
    rig : Rig
        The device, not yet opened.
    confirmation : Confirmation or None
        The operator's word that a real device is safe.
    ask : callable or None
        Asks the operator, before each burst and after it; None asks nobody and plays both.

    Raises
    ------
    NotConfirmedError
        If the device is real and nobody confirmed that it is safe; nothing was switched on.
    SuitabilityError
        If sample rate, ceiling or a waveform do not go together; nothing was switched on.
    DeviceError
        If the device refuses a step or cannot be reached.

    Examples
    --------
    >>> from experiment.apparatus.rig import assemble
    >>> from experiment.study.files import paper_study
    >>> rig = assemble(paper_study(), driver="mock", port=None, simulated=True)
    >>> found = check_device(paper_study(), rig, confirmation=None, ask=None)
    >>> [channel.read_back_vpp for channel in found.channels]
    [20.0, 20.0]
    """
    device = rig.device
    identity = device.open()
    try:
        require_confirmed(identity, confirmation)
        told = told_limits(device)
        require_suitable(study, identity, told)
        load_condition(device, study.conditions[0], study.device)
        device.enable()
        if rig.monitor is not None:
            rig.monitor.open()
        levels_vpp = _levels_vpp(study)
        for level_vpp, token in zip(levels_vpp, _tokens(), strict=False):
            device.set_levels(level_vpp, level_vpp)
            device.arm(token, SLOTS["both"], time_to_live_s=LONGEST_ARMED_S)
            device.disarm(token)
        channels = tuple(_check_channel(study, rig, side, ask) for side in ("left", "right"))
        return DeviceCheck(
            identity=identity,
            cannot=device.cannot,
            levels_vpp=levels_vpp,
            channels=channels,
            limits=told,
            health=told_health(device),
        )
    finally:
        if rig.monitor is not None:
            rig.monitor.close()
        device.close()


def _levels_vpp(study: Study) -> tuple[float, ...]:
    both_vpp = study.design.both_level_vpp
    levels_vpp = {*study.design.levels_vpp, *(() if both_vpp is None else (both_vpp,))}
    return tuple(sorted(levels_vpp))


def _check_channel(
    study: Study, rig: Rig, side: str, ask: Callable[[str], bool] | None
) -> ChannelCheck:
    level_vpp = round(max(_levels_vpp(study)) * FRACTION, 3)
    if ask is not None and not ask(f"Play one burst of {level_vpp:g} Vpp on the {side} channel?"):
        return ChannelCheck(side=side, level_vpp=level_vpp, delivery=None, seen=None)
    rig.clock.wait(onset_interval_s(study.conditions[0], study.device))
    token = next(_tokens())
    planned = None
    if rig.monitor is not None:
        rig.clock.wait(_QUIET_S)
        per_volt = study.monitor.at_the_tap
        planned = planned_burst(
            study.conditions[0], study.device, per_volt, side=side, level_vpp=level_vpp
        )
        rig.monitor.begin(token, planned)
    delivery = _burst(rig.device, side, level_vpp, token)
    calibration = None
    if rig.monitor is not None and planned is not None and delivery.outcome is Outcome.FIRED:
        calibration = MonitorCalibration(
            side=side,
            planned=planned,
            measured=rig.monitor.end(delivery),
            settings=study.monitor,
        )
    seen = None
    if ask is not None:
        seen = ask(f"Did the {side} output move, and only that one?")
    return ChannelCheck(
        side=side, level_vpp=level_vpp, delivery=delivery, seen=seen, calibration=calibration
    )


def _burst(device: BurstDevice, side: str, level_vpp: float, token: int) -> Delivery:
    device.set_levels(level_vpp, level_vpp)
    device.arm(token, SLOTS[side], time_to_live_s=LONGEST_ARMED_S)
    return device.fire(token)


def _tokens() -> Iterator[int]:
    """Count tokens up from the calendar's clock, as a session does: no device saw one before."""
    token = 0
    while True:
        token = max(token + 1, time.time_ns())
        yield token


def device_findings(check: DeviceCheck) -> Findings:
    """Tell what the check of a device found."""
    levels = " ".join(f"{level_vpp:g}" for level_vpp in check.levels_vpp)
    found = Findings()
    found.tell("answers", str(check.identity), identity=asdict(check.identity))
    if check.limits is not None:
        found.tell("", str(check.limits), limits=asdict(check.limits))
    if check.health is not None:
        found.tell("", str(check.health), health=asdict(check.health))
    found.note(cannot=list(check.cannot))
    for promise in check.cannot:
        found.warn("", WarningCode.MISSING_GUARANTEE, f"cannot {promise}")
    found.tell("takes", f"{levels} Vpp", levels_vpp=list(check.levels_vpp))
    found.parts("channels", map(_channel_findings, check.channels))
    return found


def _channel_findings(channel: ChannelCheck) -> Findings:
    delivery = channel.delivery
    found = Findings()
    found.tell(
        channel.side,
        channel.text,
        side=channel.side,
        level_vpp=channel.level_vpp,
        outcome=None if delivery is None else delivery.outcome.value,
        read_back_vpp=channel.read_back_vpp,
        uncertainty_s=None if delivery is None else delivery.uncertainty_s,
        seen=channel.seen,
        good=channel.good,
    )
    if not channel.ready:
        found.note_warning(WarningCode.FAILED_CHANNEL, f"{channel.side}: {channel.text}")
    if channel.calibration is not None:
        found.part("monitor", channel.calibration.findings)
    return found


def machine_lacks(settings: DeviceSettings, masking: Masking) -> list[tuple[str, Lack]]:
    """Tell what this machine lacks for a device and for masking noise; nothing is opened.

    Parameters
    ----------
    settings : DeviceSettings
        The study's, with the driver and the port that were chosen.
    masking : Masking
        The study's.

    Returns
    -------
    list of (str, Lack)
        What for, and what; empty where nothing is known to be lacking.
    """
    from device.scpi.visa import instrument_lack
    from device.sound.stream import sound_lack
    from device.wire.channels import port_lack

    found: list[tuple[str, Lack | None]] = []
    if settings.driver == "audio":
        found.append(("device", sound_lack()))
    elif settings.driver == "generator" and settings.port is not None:
        found.append(("device", instrument_lack(settings.port)))
    elif settings.driver != MOCK and settings.port is not None:
        found.append(("device", port_lack(settings.port)))
    if masking.noise != "none":
        found.append(("masking noise", sound_lack()))
    if os.name != "posix":
        remedy = "--responder terminal needs Linux or macOS"
        found.append(("answers at the terminal", Lack(what="a POSIX terminal", remedy=remedy)))
    return [(need, lack) for need, lack in found if lack is not None]


def machine_findings(lacks: Iterable[tuple[str, Lack]]) -> Findings:
    """Tell what this machine lacks, a note for each.

    Examples
    --------
    >>> found = machine_findings([("masking noise", Lack(what="sound card", remedy="plug one in"))])
    >>> found.lines[-1]
    'note           masking noise: sound card is missing: plug one in'
    """
    found = Findings()
    notes = []
    for need, lack in lacks:
        note = Findings()
        facts = {"need": need, "lacks": lack.what, "remedy": lack.remedy}
        note.warn("note", WarningCode.MISSING_EQUIPMENT, f"{need}: {lack}", **facts)
        notes.append(note)
    if notes:
        found.space()
    found.parts("machine", notes)
    return found
