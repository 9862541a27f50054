"""The device logic in C behind the same interface as the one in Python, called through ctypes.

`make -C firmware library` compiles it. Lines, clock, faults, amplifier and truth stay those of the
emulator in Python.
"""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_char, c_int, c_size_t, c_uint8, c_uint16, c_uint32, c_uint64
from typing import TYPE_CHECKING, Final

import numpy as np

from device.core.messages import full_scale
from device.core.output import Emission
from device.core.reports import TAPS, UNITS, Entropy, Measurement
from device.core.states import State
from device.wire.codec import STATES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.core.reports import About, Health
    from device.driver import Identity

_CHANNELS: Final = 2
_LONGEST_ANSWER: Final = 128
"""Bytes; at least LONGEST_ANSWER of firmware/core/endpoint.h."""


class _AboutStruct(ctypes.Structure):
    """`struct about` of firmware/core/endpoint.h."""

    _fields_ = (
        ("model", c_char * 16),
        ("serial_number", c_char * 16),
        ("firmware", c_char * 32),
        ("boot_id", c_uint64),
        ("sample_rate_mhz", c_uint32),
        ("entropy", c_int),
        ("emulated", ctypes.c_bool),
    )


class _BurstStruct(ctypes.Structure):
    """`struct burst` of firmware/core/device.h."""

    _fields_ = (
        ("token", c_uint64),
        ("start_us", c_uint64),
        ("duration_us", c_uint64),
        ("cut_us", c_uint64),
        ("levels_mvpp", c_uint32 * _CHANNELS),
        ("slot", c_uint32),
        ("is_cut", ctypes.c_bool),
    )


class MeasuredStruct(ctypes.Structure):
    """`struct measured` of firmware/core/device.h."""

    _fields_ = (
        ("tap", c_uint8),
        ("unit", c_uint8),
        ("left", c_uint32),
        ("right", c_uint32),
        ("onset_us", c_uint32),
        ("uncertainty_us", c_uint32),
        ("correlation_left", c_uint16),
        ("correlation_right", c_uint16),
    )


class FirmwareLibrary:
    """The firmware, compiled as a shared library.

    Parameters
    ----------
    path : Path
        The library, such as firmware/build/firmware.so.

    Attributes
    ----------
    functions : ctypes.CDLL
        The functions of the library, as declared in the headers of firmware/.
    bits : int
        Resolution of the converter, as compiled in.
    ceiling_vpp, rail_vpp : float
        Ceiling of the device, and the volts that the full scale of its converter reaches, both
        peak-to-peak at the actuator, as compiled in.

    Raises
    ------
    ValueError
        The file is not a shared library of this machine, or not one of the firmware.
    """

    def __init__(self, path: Path) -> None:
        try:
            self.functions = ctypes.CDLL(str(path.resolve()))
            self.bits, ceiling_mvpp, rail_mvpp = (
                c_uint32.in_dll(self.functions, f"library_{name}").value
                for name in ("bits", "ceiling_mvpp", "rail_mvpp")
            )
        except (OSError, ValueError) as error:
            raise ValueError(
                f"firmware must be a library that make -C firmware library compiled; got {path}: "
                f"{error}"
            ) from error
        self.ceiling_vpp, self.rail_vpp = ceiling_mvpp / 1000, rail_mvpp / 1000
        self._declare()

    def _declare(self) -> None:
        pointer, size_pointer = ctypes.c_void_p, POINTER(c_size_t)
        c = self.functions
        c.library_size.restype = c.library_samples.restype = c.library_receive.restype = c_size_t
        c.library_device.restype = pointer
        c.library_last_burst.restype = POINTER(_BurstStruct)
        c.endpoint_init.argtypes = [pointer, POINTER(_AboutStruct)]
        c.endpoint_hang_up.argtypes = [pointer]
        c.device_advance.argtypes = [pointer, c_uint64]
        c.device_sense.argtypes = [pointer, c_uint8, c_uint8]
        c.device_measure.argtypes = [pointer, POINTER(MeasuredStruct)]
        c.library_receive.argtypes = [pointer, ctypes.c_char_p, c_size_t, pointer, size_pointer]
        c.library_render.argtypes = [pointer, pointer]
        for function in (c.library_device, c.library_state, c.library_last_burst):
            function.argtypes = [pointer]
        c.library_samples.argtypes = [pointer]


class FirmwareCore:
    """One power cycle of the firmware, with the interface of `DeviceCore` that an emulator uses.

    Parameters
    ----------
    library : FirmwareLibrary
        The compiled firmware.
    device : int
        Address of its `struct device`.
    sample_rate_hz : float
        Sample rate of the converter.
    sink : callable
        Is given each `Emission` once, when it is over.
    measure : callable
        Returns what was measured of an `Emission` that is over, or None.
    """

    def __init__(
        self,
        library: FirmwareLibrary,
        device: int,
        *,
        sample_rate_hz: float,
        sink: Callable[[Emission], None],
        measure: Callable[[Emission], Measurement | None],
    ) -> None:
        self._library = library
        self._device = device
        self._sample_rate_hz = sample_rate_hz
        self._sink = sink
        self._measure = measure
        self._onset = (0, 0)
        self._burst: Emission | None = None

    @property
    def state(self) -> State:
        """The state as of the last call."""
        return STATES[self._library.functions.library_state(self._device)]

    @property
    def playing(self) -> Emission | None:
        """The burst that is under way, as of the last call."""
        return self._burst

    def advance(self, now_us: int) -> None:
        """Let happen what was due by `now_us`: end of a burst, end of a time to live, watchdog."""
        self._library.functions.device_advance(self._device, now_us)
        self.update_burst()

    def sense(self, now_us: int, sensed: Health) -> None:
        """Take what switch and amplifier report; over-current is a stop, kept until ENABLE."""
        self.advance(now_us)
        bits = sensed.reported_bits, sensed.set_bits
        self._library.functions.device_sense(self._device, *bits)
        self.update_burst()

    def update_burst(self) -> None:
        """Notice a burst that began, and give one that is over to the sink."""
        burst = self._library.functions.library_last_burst(self._device).contents
        # A token that the device has forgotten can fire again: only with its onset it is unique.
        if (burst.token, burst.start_us) != self._onset:
            self._onset = burst.token, burst.start_us
            self._burst = self._emission(burst)
        if self._burst is not None and self.state is not State.FIRED:
            emission, self._burst = self._burst, None
            self._sink(emission.cut(burst.cut_us) if burst.is_cut else emission)
            if not burst.is_cut:
                self._hand_over(self._measure(emission))

    def _emission(self, burst: _BurstStruct) -> Emission:
        n_samples = self._library.functions.library_samples(self._device)
        steps = np.empty((_CHANNELS, n_samples), dtype=np.int32)
        self._library.functions.library_render(self._device, steps.ctypes.data)
        rail_v = self._library.rail_vpp / 2
        left_v, right_v = steps * rail_v / full_scale(self._library.bits)
        left_mvpp, right_mvpp = burst.levels_mvpp
        return Emission(
            token=burst.token,
            start_us=burst.start_us,
            left_v=left_v,
            right_v=right_v,
            level_left_vpp=left_mvpp / 1000,
            level_right_vpp=right_mvpp / 1000,
            sample_rate_hz=self._sample_rate_hz,
        )

    def _hand_over(self, measurement: Measurement | None) -> None:
        if measurement is None:
            return
        measured = MeasuredStruct(
            tap=TAPS.index(measurement.tap),
            unit=UNITS.index(measurement.unit),
            left=measurement.left,
            right=measurement.right,
            onset_us=measurement.onset_offset_us,
            uncertainty_us=measurement.onset_uncertainty_us,
            correlation_left=measurement.correlation_left,
            correlation_right=measurement.correlation_right,
        )
        self._library.functions.device_measure(self._device, ctypes.byref(measured))


class FirmwareEndpoint:
    """The device's end of the wire in C, with the interface of `device.wire.endpoint.Endpoint`.

    Parameters
    ----------
    library : FirmwareLibrary
        The compiled firmware, with its limits.
    identity : Identity
        Model, serial number, boot id, sample rate and whether it is emulated are taken from here;
        the rest is compiled in.
    about : About
        Name of the firmware and source of the boot id.
    sink, measure : callable
        See `FirmwareCore`.
    """

    def __init__(
        self,
        library: FirmwareLibrary,
        *,
        identity: Identity,
        about: About,
        sink: Callable[[Emission], None],
        measure: Callable[[Emission], Measurement | None],
    ) -> None:
        self._c = library.functions
        self._memory = ctypes.create_string_buffer(self._c.library_size())
        self._answer = ctypes.create_string_buffer(_LONGEST_ANSWER)
        description = _AboutStruct(
            model=identity.model.encode(),
            serial_number=identity.serial_number.encode(),
            firmware=about.firmware.encode(),
            boot_id=identity.boot_id,
            sample_rate_mhz=round(identity.sample_rate_hz * 1000),
            entropy=tuple(Entropy).index(about.entropy),
            emulated=identity.emulated,
        )
        self._c.endpoint_init(self._memory, ctypes.byref(description))
        self.core = FirmwareCore(
            library,
            self._c.library_device(self._memory),
            sample_rate_hz=identity.sample_rate_hz,
            sink=sink,
            measure=measure,
        )

    def receive(self, now_us: int, data: bytes) -> bytes:
        """Take whatever arrived at a device time and return the bytes to send back."""
        self.core.advance(now_us)
        answers = []
        while data:
            size = c_size_t()
            n_taken = self._c.library_receive(
                self._memory, data, len(data), self._answer, ctypes.byref(size)
            )
            answers.append(self._answer.raw[: size.value])
            self.core.update_burst()
            data = data[n_taken:]
        return b"".join(answers)

    def hang_up(self, now_us: int) -> None:
        """Notice that the line is gone: the outputs go to zero."""
        self.core.advance(now_us)
        self._c.endpoint_hang_up(self._memory)
        self.core.update_burst()
