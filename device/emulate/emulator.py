"""The actuator device without an actuator: the device's core behind a line.

In a process of its own it outlives its host, and what it really emitted goes to a file that no
host can touch.
"""

from __future__ import annotations

import base64
import json
import secrets
import zlib
from dataclasses import dataclass, field, replace
from typing import IO, TYPE_CHECKING, Final

import numpy as np

from device.checks import require_real, require_whole
from device.core.core import DeviceCore
from device.core.reports import About, Health
from device.core.states import State
from device.driver import Identity
from device.emulate.amplifier import Amplifier
from device.emulate.faults import FaultyLine
from device.emulate.firmware import FirmwareEndpoint
from device.wire.endpoint import Endpoint

if TYPE_CHECKING:
    from device.clock import Clock
    from device.core.output import Emission, OutputStage
    from device.core.reports import Measurement
    from device.emulate.faults import Faults
    from device.emulate.firmware import FirmwareLibrary
    from device.emulate.lines import Line
    from device.limits import Limits


_QUIET: Final = (State.IDLE, State.LOADED, State.SAFE)


class Truth:
    """A truth file.

    The line of a burst is written at its onset, before any answer reports it. A burst that is cut
    short gets a second line.

    With `volts`, each burst has its samples in volts, channel by channel: little-endian float64 as
    base64.

    >>> import sys
    >>> Truth(sys.stdout).note(0.5, "boot", boot_id=7)
    {"event": "boot", "t_s": 0.5, "boot_id": 7}
    """

    def __init__(self, file: IO[str], *, volts: bool = False) -> None:
        self._file = file
        self._volts = volts
        self._was = State.IDLE
        self._token = 0

    def note(self, t_s: float, event: str, **entries: object) -> None:
        """Write an event down."""
        self._file.write(json.dumps({"event": event, "t_s": t_s} | entries) + "\n")
        self._file.flush()

    def note_state(self, t_s: float, state: State, cause: str) -> None:
        """Write down when the output goes on or off, and why; the watchdog has its own line too."""
        off = state in _QUIET
        if off != (self._was in _QUIET):
            if off and cause == "watchdog":
                self.note(t_s, "watchdog")
            self.note(t_s, "off" if off else "on", cause=cause)
        self._was = state

    def note_burst(self, burst: Emission) -> None:
        """Write a burst down once: at its onset; and again if it was cut short later."""
        if burst.token != self._token:
            self._token = burst.token
            self._note_burst(burst)
        if burst.cut_us is not None:
            self.note(burst.cut_us / 1e6, "cut", token=burst.token)

    def _note_burst(self, burst: Emission) -> None:
        entries = {"token": burst.token} | burst_entries(burst)
        if self._volts:
            volts = burst.volts.astype("<f8").tobytes()
            entries["volts"] = base64.b64encode(volts).decode()
        self.note(burst.start_us / 1e6, "burst", **entries)


def burst_entries(burst: Emission, *, gain: float = 1.0) -> dict[str, object]:
    """Return what a truth file says of a burst, behind an amplifier of a gain.

    >>> from device.core.output import Emission
    >>> volts = np.array([[0.0, 2.0, -2.0, 0.0], [0.0] * 4])
    >>> burst = Emission(token=1, start_us=5, volts=volts, levels_vpp=(4.0, 0.0),
    ...                  sample_rate_hz=1000.0)
    >>> burst_entries(burst, gain=10.0)["levels_mv"]
    [40000, 0]
    """
    volts = burst.volts * gain
    peaks_v = np.abs(volts).max(axis=1, initial=0.0)
    return {
        "channels": [int(peak_v > 0) for peak_v in peaks_v],
        "levels_mv": [round(level_vpp * gain * 1000) for level_vpp in burst.levels_vpp],
        "peak_v": peaks_v.tolist(),
        "crc": zlib.crc32(volts.astype("<f8").tobytes()),
    }


ABOUT: Final = About(firmware="tactstrip emulator")
FIRMWARE_ABOUT: Final = About(firmware="tactstrip firmware 2.0 emulated")
TICK_S: Final = 0.002
"""How late the device notices what is due by itself, such as its watchdog."""

SERIAL_NUMBER: Final = "1"
"""The same in every process: an emulator that is started again is the same device."""

_IDLE_TICK_S: Final = 0.02
_BITS_PER_BYTE: Final = 10
_MAX_NAME_CHARACTERS: Final = 16
_MAX_VPP_OR_HZ: Final = 4_000_000.0
_AWAKE: Final = (State.LIVE, State.ARMED, State.FIRED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Nature:
    """What kind of device is emulated.

    The limits are the device's own. A baud rate models a wire of 10 bits a byte, None one that
    takes no time. Its clock runs `drift_ppm` parts per million faster than the machine's. The
    serial number is 1 to 16 printable ASCII characters without a comma. Behind it hangs an
    amplifier. With `firmware` the core in C runs instead of the one in Python; it has the limits
    that are compiled in, and ceiling and channels must be theirs.

    >>> from device.core.output import OutputStage
    >>> from device.limits import Limits
    >>> Nature(limits=Limits(ceiling_vpp=200.0), output=OutputStage(), baud=115_200).byte_s * 1e6
    86.8...
    """

    limits: Limits
    output: OutputStage
    baud: int | None = None
    drift_ppm: float = 0.0
    serial_number: str = SERIAL_NUMBER
    amplifier: Amplifier = field(default_factory=Amplifier)
    firmware: FirmwareLibrary | None = None

    def __post_init__(self) -> None:
        values = f"{self.limits.ceiling_vpp:g} and {self.output.channels}"
        if self.firmware is not None and values != self.firmware.compiled:
            raise ValueError(
                f"ceiling_vpp and channels must be {self.firmware.compiled}, as compiled into the "
                f"firmware; got {values}"
            )
        require_real("ceiling_vpp", self.limits.ceiling_vpp, minimum=0.001, maximum=_MAX_VPP_OR_HZ)
        require_real(
            "sample_rate_hz", self.output.sample_rate_hz, minimum=0.001, maximum=_MAX_VPP_OR_HZ
        )
        if self.baud is not None:
            require_whole("baud", self.baud, minimum=300, maximum=10_000_000)
        require_real("drift_ppm", self.drift_ppm, minimum=-1e5, maximum=1e5)
        name = self.serial_number
        plain = name.isascii() and name.isprintable() and name == name.strip() and "," not in name
        if not plain or not 1 <= len(name) <= _MAX_NAME_CHARACTERS:
            raise ValueError(
                f"serial_number must be 1 to {_MAX_NAME_CHARACTERS} printable ASCII characters "
                f"without a comma or spaces around, got {name!r}"
            )

    @property
    def byte_s(self) -> float:
        """Seconds that one byte takes on the wire."""
        return 0.0 if self.baud is None else _BITS_PER_BYTE / self.baud


class Emulator:
    """A device between a line and a truth file.

    >>> import sys
    >>> import numpy as np
    >>> from device.clock import VirtualClock
    >>> from device.core.output import OutputStage
    >>> from device.emulate.faults import Faults, FaultScript
    >>> from device.emulate.lines import TcpLine
    >>> from device.limits import Limits
    >>> from device.emulate.emulator import Truth
    >>> line = TcpLine(0)
    >>> emulator = Emulator(line, Nature(limits=Limits(ceiling_vpp=200.0), output=OutputStage()),
    ...                     Faults(FaultScript(), np.random.default_rng(1)),
    ...                     Truth(sys.stdout), VirtualClock())
    {"event": "boot", "t_s": 0.0, "boot_id": ...}
    >>> emulator.turn(0.0)
    >>> line.close()
    """

    def __init__(
        self, line: Line, nature: Nature, faults: Faults, truth: Truth, clock: Clock
    ) -> None:
        self._line = FaultyLine(line, faults, clock, on_reset=self.reset, byte_s=nature.byte_s)
        self._nature = nature
        self._truth = truth
        self._clock = clock
        self._began_s = clock.now_s()
        self._connected = False
        self._missed = np.random.default_rng(0)
        self._was_open = nature.amplifier.switch_open
        self._sensed = Health()
        self._endpoint = self._power_up()

    def run(self) -> None:
        """Serve until an exception, such as KeyboardInterrupt; the outputs are at zero then."""
        try:
            while True:
                awake = self._endpoint.core.state in _AWAKE
                self.turn(min(TICK_S if awake else _IDLE_TICK_S, self.due_in_s))
        finally:
            self._lose_host("end")
            self._line.close()

    def turn(self, timeout_s: float) -> None:
        """Do what is due, and what arrives within a time."""
        data = self._line.read(timeout_s)
        self._endpoint.core.advance(self._now_us())
        self._note_state("watchdog")
        self._sense()
        while data:
            self._connected = True
            self._receive(data)
            data = self._line.read(0.0)
        if data is None and self._connected:
            self._lose_host("line")
        self._connected = data is not None

    @property
    def due_in_s(self) -> float:
        """Seconds until a piece on the wire arrives; infinite if there is none."""
        return self._line.due_in_s

    def reset(self) -> None:
        """Restart the device: new boot id, everything forgotten."""
        self._lose_host("reset")
        self._endpoint = self._power_up()

    def move_switch(self, *, is_open: bool) -> None:
        """Open or close the amplifier's switch, from any thread; the next turn senses it."""
        amplifier = replace(self._nature.amplifier, switch_open=is_open)
        self._nature = replace(self._nature, amplifier=amplifier)

    def _sense(self) -> None:
        amplifier = self._nature.amplifier
        if amplifier.switch_open != self._was_open:
            self._was_open = amplifier.switch_open
            self._truth.note(self._now_us() / 1e6, "switch", closed=not self._was_open)
        sensed = amplifier.sensed_at(self._now_us() / 1e6)
        if sensed != self._sensed or sensed.over_current:  # a fault that stays stops again
            self._sensed = sensed
            self._endpoint.core.sense(self._now_us(), sensed)
            self._note_state("over-current")

    def _receive(self, data: bytes) -> None:
        answers = self._endpoint.receive(self._now_us(), data)
        burst = self._endpoint.core.playing
        if burst is not None:
            self._truth.note_burst(burst)
        self._note_state("host")
        if answers:
            self._line.write(answers)

    def _lose_host(self, cause: str) -> None:
        """Lose the line and what was on it; the outputs go to zero."""
        self._endpoint.hang_up(self._now_us())
        self._note_state(cause)

    def _note_state(self, cause: str) -> None:
        self._truth.note_state(self._now_us() / 1e6, self._endpoint.core.state, cause)

    def _now_us(self) -> int:
        rate = 1.0 + self._nature.drift_ppm * 1e-6
        return int((self._clock.now_s() - self._began_s) * rate * 1e6)

    def _power_up(self) -> Endpoint | FirmwareEndpoint:
        boot_id = secrets.randbits(63)
        endpoint = self._make_endpoint(boot_id)
        endpoint.core.advance(self._now_us())
        self._sensed = self._nature.amplifier.sensed_at(self._now_us() / 1e6)
        endpoint.core.sense(self._now_us(), self._sensed)
        self._truth.note(self._now_us() / 1e6, "boot", boot_id=boot_id, began_s=self._began_s)
        return endpoint

    def _make_endpoint(self, boot_id: int) -> Endpoint | FirmwareEndpoint:
        limits, output = self._nature.limits, self._nature.output
        number = self._nature.serial_number
        identity = Identity.of_emulator("emulator", number, boot_id, limits, output)
        if self._nature.firmware is not None:
            return FirmwareEndpoint(
                self._nature.firmware,
                identity=identity,
                about=FIRMWARE_ABOUT,
                sink=self._truth.note_burst,
                measure=self._measure,
            )
        core = DeviceCore(
            boot_id=boot_id,
            limits=limits,
            output=output,
            sink=self._truth.note_burst,
            measure=self._measure,
            about=ABOUT,
        )
        return Endpoint(core, identity)

    def _measure(self, burst: Emission) -> Measurement | None:
        return self._nature.amplifier.seen(burst, self._missed)
