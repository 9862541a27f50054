"""How a session speaks to whatever drives the actuators: the protocol and its values.

Levels are peak-to-peak volts at the actuator: a waveform that reaches +1 and -1, sent at a level of
200 Vpp, swings from -100 V to +100 V.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Final, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from device.checks import require_positive, require_real, require_whole
from device.limits import MAX_CHANNELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from device.core.output import OutputStage
    from device.limits import Limits

FloatArray: TypeAlias = NDArray[np.float64]

PROTOCOL_VERSION: Final = "2.0"
"""Version of the wire format. With the minor number, types and refusals may be added; none changes
its layout or meaning."""

LARGEST_TOKEN = 2**64 - 1
"""Tokens and boot ids are 64 bit on the wire; token 0 is no token."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lack:
    """What a machine lacks, and what helps.

    >>> print(Lack(what="sound card", remedy="plug one in"))
    sound card is missing: plug one in
    """

    what: str
    remedy: str

    def __str__(self) -> str:
        """Say it in a line."""
        return f"{self.what} is missing: {self.remedy}"


def installing(extra: str, constraints: str = "constraints.txt") -> str:
    """Say how an extra is installed; the project is in no package index.

    >>> installing("audio")
    'in the clone of tactstrip: pip install -e ".[audio]" -c constraints.txt'
    """
    return f'in the clone of tactstrip: pip install -e ".[{extra}]" -c {constraints}'


class Outcome(StrEnum):
    """What became of a burst: felt, surely not, or not known.

    Examples
    --------
    >>> Outcome("not_fired") is Outcome.NOT_FIRED
    True
    """

    FIRED = "fired"
    """It surely began; nothing but a stop can have cut it short."""
    NOT_FIRED = "not_fired"
    """It surely did not come out, and never will."""
    INDETERMINATE = "indeterminate"
    """The outcome is unknown: the trial is neither a stimulus nor a miss."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Who answered, and what it can do.

    Parameters
    ----------
    model, serial_number : str
        The device's own names.
    boot_id : int
        Random number of this power cycle; another one means that all tokens are forgotten.
    protocol_version : str
        Version of the wire format it speaks.
    sample_rate_hz : float
        Rate at which waveforms are played.
    bits : int
        Of its converters.
    channels : int
        Number of outputs that it drives.
    ceiling_vpp : float
        Its own ceiling in peak-to-peak volts at the actuator.
    longest_waveform : int
        In samples.
    emulated : bool
        True where no actuator can move.

    Raises
    ------
    ValueError
        A field is out of range.

    Examples
    --------
    >>> print(Identity(model="m", serial_number="1", boot_id=7, protocol_version="2.0",
    ...                sample_rate_hz=48e3, bits=16, channels=2, ceiling_vpp=200.0,
    ...                longest_waveform=4096, emulated=True))
    m 1 (emulated), ceiling 200 Vpp, 48000 Hz, 16 bit, 2 channels of up to 4096 samples
    """

    model: str
    serial_number: str
    boot_id: int
    protocol_version: str
    sample_rate_hz: float
    bits: int
    channels: int
    ceiling_vpp: float
    longest_waveform: int
    emulated: bool

    def __post_init__(self) -> None:
        require_whole("boot_id", self.boot_id, minimum=0, maximum=LARGEST_TOKEN)
        require_positive("sample_rate_hz", self.sample_rate_hz)
        require_whole("bits", self.bits, minimum=2, maximum=32)
        require_whole("channels", self.channels, minimum=1, maximum=MAX_CHANNELS)
        require_positive("ceiling_vpp", self.ceiling_vpp)
        require_whole("longest_waveform", self.longest_waveform, minimum=1, maximum=2**31)

    @classmethod
    def of_emulator(
        cls, model: str, serial_number: str, boot_id: int, limits: Limits, output: OutputStage
    ) -> Self:
        """Return the identity of a device without actuators, with its limits and converter.

        Parameters
        ----------
        model, serial_number : str
            Model and serial number.
        boot_id : int
            Random number of the power cycle.
        limits : Limits
            Limits of the device.
        output : OutputStage
            The converter.

        Returns
        -------
        Identity
        """
        return cls(
            model=model,
            serial_number=serial_number,
            boot_id=boot_id,
            protocol_version=PROTOCOL_VERSION,
            sample_rate_hz=output.sample_rate_hz,
            bits=output.bits,
            channels=output.channels,
            ceiling_vpp=limits.ceiling_vpp,
            longest_waveform=limits.longest_waveform,
            emulated=True,
        )

    def __str__(self) -> str:
        """Return the identity in one line."""
        emulated = " (emulated)" if self.emulated else ""
        return (
            f"{self.model} {self.serial_number}{emulated}, ceiling {self.ceiling_vpp:g} Vpp, "
            f"{self.sample_rate_hz:g} Hz, {self.bits} bit, {self.channels} channels of up to "
            f"{self.longest_waveform} samples"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivery:
    """What is known of one burst.

    Parameters
    ----------
    outcome : Outcome
        INDETERMINATE is neither a stimulus nor a miss: leave the trial out and repeat it.
    token : int
        Token of the burst.
    boot_id : int
        Power cycle of the device that answered. NOT_FIRED holds for this power cycle only; treat it
        as INDETERMINATE if the token was armed in another one.
    device_us : int or None
        Onset on the device's clock in microseconds; None if NOT_FIRED.
    host_before_s, host_after_s : float
        Host clock readings in seconds between which the burst began. Unless FIRED, the request and
        its answer lie between them.
    uncertainty_s : float
        Half of that interval plus the uncertainty of the clocks.
    retries : int
        How often the request was repeated.
    levels_vpp : tuple of float
        Level that the device set on each channel, in peak-to-peak volts; 0 for a channel whose
        waveform is zero throughout. Empty unless FIRED.

    Raises
    ------
    ValueError
        A field is out of range, or `device_us` contradicts the outcome.

    Examples
    --------
    >>> Delivery(outcome=Outcome.NOT_FIRED, token=1, boot_id=7, device_us=None, host_before_s=0.0,
    ...          host_after_s=0.1, uncertainty_s=0.05, retries=0).outcome.value
    'not_fired'
    """

    outcome: Outcome
    token: int
    boot_id: int
    device_us: int | None
    host_before_s: float
    host_after_s: float
    uncertainty_s: float
    retries: int
    levels_vpp: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        contradictory = Outcome.FIRED if self.device_us is None else Outcome.NOT_FIRED
        if self.outcome is contradictory:
            raise ValueError(
                f"device_us must be given if FIRED and None if NOT_FIRED, got {self.device_us!r}"
            )
        require_whole("token", self.token, minimum=1, maximum=LARGEST_TOKEN)
        require_whole("boot_id", self.boot_id, minimum=0, maximum=LARGEST_TOKEN)
        if self.device_us is not None:
            require_whole("device_us", self.device_us, minimum=0, maximum=2**63 - 1)
        require_real("host_before_s", self.host_before_s)
        require_real("host_after_s", self.host_after_s, minimum=self.host_before_s)
        require_real("uncertainty_s", self.uncertainty_s, minimum=0.0)
        require_whole("retries", self.retries, minimum=0, maximum=2**31)
        for level_vpp in self.levels_vpp:
            require_real("levels_vpp", level_vpp, minimum=0.0)


class BurstDevice(ABC):
    """Channels that play loaded waveforms, each at most once per token.

    The steps of a session: `open`, `load`, `enable`, then for each trial `set_levels`, `arm`,
    `fire`; at the end `close`. A heartbeat, where the device wants one, is the driver's own
    business. Every step may raise `RefusedError` (illegal now, nothing was sent), `Rejected` (the
    device or its limits said no, nothing changed), `SettingError` or `LinkError`.

    Examples
    --------
    >>> from device import Limits, MockDevice, VirtualClock
    >>> device: BurstDevice = MockDevice(VirtualClock(), limits=Limits(ceiling_vpp=200.0))
    >>> device.open().emulated
    True
    >>> device.cannot
    ()
    """

    @property
    def cannot(self) -> tuple[str, ...]:
        """What this device cannot promise, each to be read after "it cannot"."""
        return ()

    @abstractmethod
    def open(self) -> Identity:
        """Connect.

        Returns
        -------
        Identity
            Who answered, and what it can do.
        """

    @abstractmethod
    def load(self, slot: int, samples: FloatArray) -> None:
        """Store a waveform for each channel; played at a level, 1 is half of its volts.

        Parameters
        ----------
        slot : int
            Where, from 0.
        samples : ndarray of float64, shape (n_channels, n_samples)
            At the device's rate, from -1 to 1, the first and the last of each channel 0.
        """

    @abstractmethod
    def enable(self) -> None:
        """Switch the output on; the only way out of a stop."""

    @abstractmethod
    def set_levels(self, levels_vpp: Sequence[float]) -> None:
        """Set the level of each channel.

        Parameters
        ----------
        levels_vpp : sequence of float
            Peak-to-peak volts at each actuator.
        """

    @abstractmethod
    def arm(self, token: int, slot: int, *, time_to_live_s: float) -> None:
        """Allow `fire(token)` to play a slot.

        Parameters
        ----------
        token : int
            A number from 1 to 2**64 - 1 that was never used before.
        slot : int
            Which waveforms.
        time_to_live_s : float
            For how many seconds from now.
        """

    @abstractmethod
    def fire(self, token: int) -> Delivery:
        """Play the armed slot; the same token again gives the same record, not another burst.

        Parameters
        ----------
        token : int
            The armed one, or the last one that was fired.

        Returns
        -------
        Delivery
            What is known of the burst.
        """

    @abstractmethod
    def disarm(self, token: int) -> None:
        """Make sure that a token cannot fire from now on; what it did before stays.

        Parameters
        ----------
        token : int
            The armed one, or any other.
        """

    @abstractmethod
    def query(self, token: int) -> Delivery:
        """Ask what became of a token.

        Parameters
        ----------
        token : int
            The armed one, or any other.

        Returns
        -------
        Delivery
            INDETERMINATE while it is armed.
        """

    @abstractmethod
    def stop(self) -> None:
        """Bring outputs to zero: from any thread, in any state, any number of times, no lock."""

    @abstractmethod
    def close(self) -> None:
        """Stop, then disconnect."""
