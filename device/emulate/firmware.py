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
from device.core.reports import TAPS, Entropy, Measurement
from device.core.states import State
from device.wire.protocol import STATES

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.core.reports import About, Health
    from device.driver import Identity

FIRMWARE_CHANNELS: Final = 2
"""Number of outputs of the firmware, which firmware/wire_numbers.py hands to it."""
_MAX_ANSWER_BYTES: Final = 128
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
        ("levels_mvpp", c_uint32 * FIRMWARE_CHANNELS),
        ("slot", c_uint32),
        ("is_cut", ctypes.c_bool),
    )


class MeasuredStruct(ctypes.Structure):
    """`struct measured` of firmware/core/device.h."""

    _fields_ = (
        ("tap", c_uint8),
        ("peaks", c_uint32 * FIRMWARE_CHANNELS),
        ("onset_us", c_uint32),
        ("uncertainty_us", c_uint32),
        ("correlations", c_uint16 * FIRMWARE_CHANNELS),
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
    compiled : str
        Ceiling and number of channels, for messages.

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
        self.compiled = f"{self.ceiling_vpp:g} and {FIRMWARE_CHANNELS}"
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


class FirmwareEndpoint:
    """One power cycle of the firmware, with the interface of `device.wire.endpoint.Endpoint`.

    Parameters
    ----------
    library : FirmwareLibrary
        The compiled firmware, with its limits.
    identity : Identity
        Model, serial number, boot id, sample rate and whether it is emulated are taken from here;
        the rest is compiled in.
    about : About
        Name of the firmware and source of the boot id.
    sink : callable
        Is given each `Emission` once, when it is over.
    measure : callable
        Returns what was measured of an `Emission` that is over, or None.
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
        self._library = library
        self._c = library.functions
        self._sample_rate_hz = identity.sample_rate_hz
        self._sink = sink
        self._measure = measure
        self._onset = (0, 0)
        self._burst: Emission | None = None
        self._answer = ctypes.create_string_buffer(_MAX_ANSWER_BYTES)
        self._memory = ctypes.create_string_buffer(self._c.library_size())
        self._device = self._c.library_device(self._memory)
        description = _AboutStruct(
            identity.model.encode(),
            identity.serial_number.encode(),
            about.firmware.encode(),
            identity.boot_id,
            round(identity.sample_rate_hz * 1000),
            tuple(Entropy).index(about.entropy),
            identity.emulated,
        )
        self._c.endpoint_init(self._memory, ctypes.byref(description))

    @property
    def core(self) -> FirmwareEndpoint:
        """The interface of `DeviceCore`: in C, logic and wire are one structure."""
        return self

    @property
    def state(self) -> State:
        """The state as of the last call."""
        return STATES[self._c.library_state(self._device)]

    @property
    def playing(self) -> Emission | None:
        """The burst that is under way, as of the last call."""
        return self._burst

    def advance(self, now_us: int) -> None:
        """Let happen what was due by `now_us`: end of a burst, end of a time to live, watchdog."""
        self._c.device_advance(self._device, now_us)
        self._update_burst()

    def sense(self, now_us: int, sensed: Health) -> None:
        """Take what switch and amplifier report; over-current is a stop, kept until ENABLE."""
        self.advance(now_us)
        self._c.device_sense(self._device, sensed.reported_bits, sensed.set_bits)
        self._update_burst()

    def receive(self, now_us: int, data: bytes) -> bytes:
        """Take whatever arrived at a device time and return the bytes to send back."""
        self.advance(now_us)
        answers = []
        while data:
            size = c_size_t()
            n_taken = self._c.library_receive(
                self._memory, data, len(data), self._answer, ctypes.byref(size)
            )
            answers.append(self._answer.raw[: size.value])
            self._update_burst()
            data = data[n_taken:]
        return b"".join(answers)

    def hang_up(self, now_us: int) -> None:
        """Notice that the line is gone: the outputs go to zero."""
        self.advance(now_us)
        self._c.endpoint_hang_up(self._memory)
        self._update_burst()

    def _update_burst(self) -> None:
        """Notice a burst that began, and give one that is over to the sink."""
        burst = self._c.library_last_burst(self._device).contents
        # A token that the device has forgotten can fire again: only with its onset it is unique.
        if (burst.token, burst.start_us) != self._onset:
            self._onset = burst.token, burst.start_us
            self._burst = self._emission(burst)
        if self._burst is not None and self.state is not State.FIRED:
            emission, self._burst = self._burst, None
            self._sink(emission.cut(burst.cut_us) if burst.is_cut else emission)
            measurement = None if burst.is_cut else self._measure(emission)
            if measurement is not None:
                self._report(measurement)

    def _emission(self, burst: _BurstStruct) -> Emission:
        steps = np.empty((FIRMWARE_CHANNELS, self._c.library_samples(self._device)), dtype=np.int32)
        self._c.library_render(self._device, steps.ctypes.data)
        return Emission(
            token=burst.token,
            start_us=burst.start_us,
            volts=steps * (self._library.rail_vpp / 2) / full_scale(self._library.bits),
            levels_vpp=tuple(level_mvpp / 1000 for level_mvpp in burst.levels_mvpp),
            sample_rate_hz=self._sample_rate_hz,
        )

    def _report(self, measurement: Measurement) -> None:
        """Have the firmware answer MEASURED of its last burst with this."""
        measured = MeasuredStruct(
            TAPS.index(measurement.tap),
            measurement.peaks,
            measurement.onset_offset_us,
            measurement.onset_uncertainty_us,
            measurement.correlations,
        )
        self._c.device_measure(self._device, ctypes.byref(measured))
