"""The device and the clock of a session by name, and the operator's word that a real one is safe.

Software is not the safety device: what keeps a person safe is wired, and only a person can tell
that it is.
"""

from __future__ import annotations

import getpass
import math
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

from device.clock import MonotonicClock, VirtualClock
from device.drivers import (
    MOCK,
    MOCK_MODEL,
    NEEDS,
    DriverSettings,
    is_emulated,
    make_device,
    make_mock,
    own_driver,
)
from device.wire.channels import LineSettings
from experiment.apparatus.monitor import make_monitor, recorder_beside
from experiment.apparatus.slots import host_limits
from experiment.names import is_line
from experiment.study.study import StudyError, UnusableStudyError

if TYPE_CHECKING:
    from device.clock import Clock
    from device.driver import BurstDevice, Identity
    from device.emulate.mock import MockDevice
    from device.monitor.measured import Monitor
    from experiment.study.equipment import DeviceSettings
    from experiment.study.study import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """A device, not yet opened, with the clock that it runs on.

    Attributes
    ----------
    device : BurstDevice
        The device.
    clock : Clock
        The machine's, or a virtual one for a session in which nothing and nobody is real.
    settings : DeviceSettings
        What it was made by: the study's, with the driver and the port that were chosen.
    monitor : Monitor or None
        What measures its bursts, not yet opened; none of a device that moves nothing.
    """

    device: BurstDevice
    clock: Clock
    settings: DeviceSettings
    monitor: Monitor | None

    @property
    def driver_from(self) -> str | None:
        """Which distribution the driver is of, where it is a lab's own."""
        name = self.settings.driver
        return None if name in NEEDS else own_driver(name).distribution

    def is_emulated(self) -> bool:
        """Ask the device whether it is an emulator; nothing is set, loaded or switched on.

        Raises
        ------
        LinkError
            If nothing answers that this driver can drive.
        """
        return is_emulated(self.settings.driver, self.settings.port, line_settings(self.settings))


def assemble(
    study: Study,
    *,
    driver: str | None,
    port: str | None,
    simulated: bool,
    practice: bool = False,
) -> Rig:
    """Return the device and the clock of a session.

    Parameters
    ----------
    study : Study
        The study.
    driver, port : str or None
        Instead of the study's.
    simulated : bool
        Whether the participant is.
    practice : bool
        Whether a person tries it out without a device, and so without noise.

    Raises
    ------
    StudyError
        If the driver needs a port, or a key of [device], that is not given.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> assemble(paper_study(), driver="serial", port=None, simulated=True)
    Traceback (most recent call last):
    experiment.study.study.StudyError: device.port is missing: the driver serial needs it;
    --port gives it too
    """
    settings = chosen_settings(study, driver=driver, port=port)
    if lacking := lacking_of(settings):
        raise StudyError(lacking)
    if not simulated and not practice and (shared := shared_card(study, settings)):
        raise StudyError(shared)
    real = settings.driver != MOCK or not simulated
    clock = MonotonicClock() if real else VirtualClock()
    recorder = None if settings.driver == MOCK else recorder_beside(study.monitor, settings, clock)
    made_from = DriverSettings(
        limits=host_limits(settings),
        port=settings.port,
        sample_rate_hz=settings.sample_rate_hz,
        amplifier_gain=settings.amplifier_gain,
        volts_full_scale=settings.volts_full_scale,
        channels=settings.channels,
        line=line_settings(settings),
        recorder=recorder,
    )
    try:
        device = make_device(settings.driver, made_from, clock)
    except ValueError as error:
        raise StudyError(f"device: {error}") from error
    monitor = None
    if settings.driver != MOCK:
        monitor = make_monitor(study.monitor, device, clock, recorder)
    return Rig(device=device, clock=clock, settings=settings, monitor=monitor)


def line_settings(settings: DeviceSettings) -> LineSettings:
    """Return what a study says of the line to its device."""
    return LineSettings(
        baud=settings.baud,
        dtr=settings.dtr,
        opens_within_s=settings.opens_within_s,
        patience_s=settings.patience_s,
    )


def chosen_settings(study: Study, *, driver: str | None, port: str | None) -> DeviceSettings:
    """Return a study's device settings with another driver or port, where one is given.

    StudyError where no driver has that name, built in or installed, where a level of the study is
    above what that device reaches, or its monitor does not go with it.
    """
    settings = study.device
    name = settings.driver if driver is None else driver
    if port is not None and not is_line(port):
        raise StudyError(f"--port must be a name in one line of text; got {port!r}")
    if name not in NEEDS:
        try:
            own_driver(name)
        except ValueError as error:
            key = "device.driver" if driver is None else "--driver"
            raise StudyError(f"{key} {error}") from error
    chosen = replace(settings, driver=name, port=settings.port if port is None else port)
    try:
        study.check_levels(chosen)
        study.monitor.check_driver(name)
    except ValueError as error:
        raise UnusableStudyError(study.name, str(error)) from error
    return chosen


def lacking_of(settings: DeviceSettings) -> str | None:
    """Say which keys are missing that the driver needs; None where it has all.

    >>> from experiment.study.equipment import DeviceSettings
    >>> lacking_of(DeviceSettings(driver="audio", port="card"))
    'device.volts_full_scale is missing: the driver audio needs it'
    """
    missing = [key for key in NEEDS.get(settings.driver, ()) if getattr(settings, key) is None]
    if not missing:
        return None
    keys = " and ".join(f"device.{key}" for key in missing)
    is_missing, it = ("is missing", "it") if len(missing) == 1 else ("are missing", "them")
    hint = f"; --port gives {'it' if len(missing) == 1 else 'the first'} too"
    told = f"{keys} {is_missing}: the driver {settings.driver} needs {it}"
    return told + hint * ("port" in missing)


def asked_of(settings: DeviceSettings) -> str:
    """Say what `run` asks of whoever starts a session with a person, which this device decides.

    >>> from experiment.study.equipment import DeviceSettings
    >>> asked_of(DeviceSettings())[:41], asked_of(DeviceSettings(driver="serial"))[:41]
    ('a person needs a real device (--driver, -', 'you are asked whether the hardware is saf')
    """
    if settings.driver == MOCK:
        keys = dict.fromkeys(key for needed in NEEDS.values() for key in needed)
        unused = [key for key in keys if getattr(settings, key) is not None]
        told = f'; driver = "mock" uses no {" and no ".join(unused)}' if unused else ""
        return (
            f"a person needs a real device (--driver, --port), or --practice-without-device{told}"
        )
    return (
        f"you are asked whether the hardware is safe, {len(QUESTION)} things (docs/hardware.md), "
        "unless an emulator answers; --confirm-hardware says yes"
    )


def full_scale_words(settings: DeviceSettings, highest_vpp: float) -> dict[str, str]:
    """Say what a full scale comes to, and note or warn of it, by heading; nothing if none is used.

    >>> from experiment.study.equipment import DeviceSettings
    >>> card = DeviceSettings(driver="audio", volts_full_scale=30.0, ceiling_vpp=60.0)
    >>> full_scale_words(card, 52.0)[""]
    'full scale 30 V peak = 60 V peak-to-peak; the highest level, 52 V, is -1.2 dB re that'
    """
    peak_v, key = settings.volts_full_scale, "volts_full_scale"
    if peak_v is None or key not in NEEDS.get(settings.driver, (key,)):  # one's own may need it
        return {}
    full_vpp, ceiling_vpp = 2 * peak_v, settings.ceiling_vpp
    level_db = round(20 * math.log10(highest_vpp / full_vpp), 1) + 0.0  # no minus before 0.0
    told = {
        "": f"full scale {peak_v:g} V peak = {full_vpp:g} V peak-to-peak; "
        f"the highest level, {highest_vpp:g} V, is {level_db:.1f} dB re that"
    }
    if math.isclose(ceiling_vpp, full_vpp, rel_tol=0.01):  # in round numbers
        return told
    if ceiling_vpp < full_vpp:
        told["warning"] = (
            f"anything else that the card plays, such as a system sound, reaches {full_vpp:g} V "
            f"peak-to-peak at the actuator, more than ceiling_vpp = {ceiling_vpp:g} V allows: turn "
            "the card down until full scale is at most that, docs/hardware.md; or, if "
            f"{key} = {peak_v:g} was measured from peak to peak (only then), write half of it"
        )
    else:
        told["note"] = (
            f"ceiling_vpp = {ceiling_vpp:g} V is more than twice {key}, {full_vpp:g} V, "
            "which limits the levels. If the amplifier bears more than card x gain reaches, write "
            f"ceiling_vpp = {full_vpp:g}; or is {key} an effective value, not the peak?"
        )
    return told


def shared_card(study: Study, settings: DeviceSettings) -> str | None:
    """Say why a person's masking noise would be played to the actuators; None where it is not.

    `settings` are those of the device in use. The card that the study names drives the actuators
    also where the mock takes its place.
    """
    masking = study.masking
    for device in (settings, study.device):
        if device.driver != "audio" or masking.noise == "none":
            continue
        if masking.sound_card in {"", device.port}:
            card = "" if device.port is None else f", {device.port!r}"
            return (
                f"masking.sound_card must be named and another one than the actuators'{card}; "
                f'got {masking.sound_card!r}; noise = "none" plays none'
            )
    return None


def mock_device(study: Study, clock: Clock) -> MockDevice:
    """Return a mock device under the study's limits.

    Parameters
    ----------
    study : Study
        Gives the ceiling, the rest between bursts and the sample rate.
    clock : Clock
        The host's clock.
    """
    return make_mock(host_limits(study.device), clock, study.device.sample_rate_hz)


def device_kind(identity: Identity) -> str:
    """Return a word of `DEVICE_KINDS`: what a device that was opened is.

    >>> from device.clock import VirtualClock
    >>> from experiment.study.files import paper_study
    >>> device_kind(mock_device(paper_study(), VirtualClock()).open())
    'mock'
    """
    if not identity.emulated:
        return "real"
    return "mock" if identity.model == MOCK_MODEL else "emulated"


class NoDeviceError(ValueError):
    """A person in front of a device that moves nothing."""


def require_device(kind: str, *, simulated: bool, practice: bool) -> None:
    """Refuse a person on a device that moves nothing, unless it is to be practice.

    Parameters
    ----------
    kind : str
        As `device_kind` returns it.
    simulated : bool
        Whether the participant is.
    practice : bool
        The operator's word that the session is for trying out.

    Raises
    ------
    NoDeviceError
        If a person would sit before a mock device or an emulator.

    Examples
    --------
    >>> require_device("mock", simulated=False, practice=False)
    Traceback (most recent call last):
    experiment.apparatus.rig.NoDeviceError: the device is a mock: nothing moves, and a person ...
    """
    if kind == "real" or simulated or practice:
        return
    what = {"mock": "a mock", "emulated": "an emulator"}[kind]
    raise NoDeviceError(
        f"the device is {what}: nothing moves, and a person would feel nothing; give --driver and "
        "--port of a real one, or --practice-without-device to try it out: no analysis counts "
        "such a session by itself"
    )


QUESTION: Final = (
    "the amplifier's enable has a switch within the participant's and the operator's reach",
    "a current limit stands between the amplifier and the actuators",
    "the plate is bonded to protective earth, or insulated with its leakage measured",
)
"""What has to be so; docs/hardware.md says more."""


class NotConfirmedError(ValueError):
    """A real device that nobody has confirmed to be safe."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """The operator's word that what `QUESTION` lists is so.

    Attributes
    ----------
    by : str
        The user of the machine who gave it.
    at : str
        When, in UTC.
    how : str
        ``asked`` on a terminal, or by ``--confirm-hardware``.
    """

    by: str
    at: str
    how: str

    @property
    def facts(self) -> dict[str, Any]:
        """List what the record keeps of it."""
        return asdict(self) | {"confirmed": list(QUESTION)}


def confirmed_now(how: str) -> Confirmation:
    """Return the confirmation that is given at this moment.

    Examples
    --------
    >>> confirmed_now("asked").how
    'asked'
    """
    try:
        user = getpass.getuser()
    except (OSError, KeyError, ImportError):  # a user without a name
        user = "unknown"
    return Confirmation(by=user, at=datetime.now(UTC).isoformat(timespec="seconds"), how=how)


def require_confirmed(identity: Identity, confirmation: Confirmation | None) -> None:
    """Refuse a real device without a confirmation.

    Parameters
    ----------
    identity : Identity
        What the opened device said of itself.
    confirmation : Confirmation or None
        The operator's.

    Raises
    ------
    NotConfirmedError
        If there is none and the device is no emulator.
    """
    if confirmation is None and not identity.emulated:
        raise NotConfirmedError(
            f"{identity.model} {identity.serial_number} drives real actuators: read "
            "docs/hardware.md, then give --confirm-hardware"
        )
