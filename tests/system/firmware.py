"""The firmware in C: compiled with given limits, run in this process, and under QEMU."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from device import Emission
from device.core.reports import About, Entropy
from device.emulate.firmware import FirmwareEndpoint
from tests.processes import require
from tests.test_device import rigs
from tests.test_device.bursts import identity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    import pytest

    from device.emulate.firmware import FirmwareLibrary
    from tests.test_device.golden import Reader

FIRMWARE: Final = Path(__file__).parents[2] / "firmware"
IDENTITY: Final = (
    *("model", "serial_number", "boot_id", "sample_rate_hz"),
    *("bits", "ceiling_vpp", "longest_waveform", "emulated"),
)


def require_tools(*tools: str) -> None:
    """Skip a test, or fail it where the firmware is required, if a tool is missing."""
    require("firmware", [tool for tool in tools if shutil.which(tool) is None])


def make(folder: Path, target: str, *, sanitize: str = "", **limits: int) -> Path:
    """Make a target of firmware/Makefile in a folder, with limits of firmware/hal/limits.h."""
    subprocess.run(make_command(folder, target, sanitize=sanitize, **limits), check=True)
    return folder


def make_command(folder: Path, target: str, *, sanitize: str = "", **limits: int) -> list[str]:
    """Return the command that makes a target."""
    defines = " ".join(f"-D{name}={value}U" for name, value in limits.items())
    command = ["make", "--silent", "-C", str(FIRMWARE), f"BUILD={folder}", f"DEFINES={defines}"]
    return [*command, f"PYTHON={sys.executable}", f"SANITIZE={sanitize}", target]


def limits_of(device: Mapping[str, Any]) -> dict[str, int]:
    """Return what is compiled in for a device of tests/test_device/golden_frames.json."""
    names = (
        *("least_interval_us", "max_duty_ppm", "dc_tolerance_ppm", "longest_time_to_live_us"),
        *("slots", "memory_samples", "longest_waveform", "bits"),
    )
    ceiling_mvpp = round(1000 * device["ceiling_vpp"])
    return {name.upper(): device[name] for name in names} | {"CEILING_MVPP": ceiling_mvpp}


def firmware_device(
    library: FirmwareLibrary,
    device: Mapping[str, Any],
    reader: Reader,
    sink: Callable[[Emission], None],
) -> FirmwareEndpoint:
    """Return the firmware as a device of tests/test_device/golden_frames.json, switched on."""
    entropy = tuple(Entropy)[device["entropy"]]
    return FirmwareEndpoint(
        library,
        identity=identity(**{name: device[name] for name in IDENTITY}),
        about=About(firmware=device["firmware"], entropy=entropy),
        sink=sink,
        measure=reader,
    )


def firmware_rig(request: pytest.FixtureRequest) -> rigs.Rig:
    """Return a rig around the emulator that runs the core in C."""
    require_tools("gcc", "make")
    folder = make(request.getfixturevalue("firmware_build"), "library", sanitize="undefined")
    return rigs.emulator_rig("tcp", firmware=str(folder / "firmware.so"))(request)


def qemu_rig(request: pytest.FixtureRequest) -> rigs.Rig:
    """Return a rig around the firmware under QEMU."""
    require_tools("arm-none-eabi-gcc", "qemu-system-arm", "make")
    image = make(request.getfixturevalue("firmware_build"), "qemu") / "tactstrip-qemu.elf"
    folder: Path = request.getfixturevalue("tmp_path")
    truth, inputs = folder / "truth.txt", folder / "inputs"
    os.mkfifo(inputs)
    command = [sys.executable, str(FIRMWARE / "hal/qemu/run.py"), "--image", str(image)]
    command += [
        "--truth",
        str(truth),
        "--inputs",
        str(inputs),
        "--rate",
        str(round(rigs.EMULATED_RATE_HZ)),
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)

    def end() -> None:
        process.kill()
        process.communicate()

    request.addfinalizer(end)
    assert process.stdout is not None
    port = process.stdout.readline().strip()
    return rigs.process_rig(
        port,
        lambda: tuple(read_qemu_truth(truth)),
        overload=lambda: inputs.write_bytes(CLOSED_AND_OVER_CURRENT),
        lose_line=lambda: inputs.write_bytes(LINE_LOST),
    )


FIRMWARE_RIGS: Final[rigs.Rigs] = {"firmware": firmware_rig, "qemu": qemu_rig}
"""The core in C: on this machine behind the emulator, and as an image for a processor."""

CLOSED_AND_OVER_CURRENT, LINE_LOST = b"\x06", b"\x80"
"""What hal/qemu/main.c takes of amplifier and line: its UART cannot see a host go."""

RAIL_V: Final = 100.0
"""Volts of the full scale of the image's converter."""


def read_qemu_truth(truth: Path) -> Iterator[Emission]:
    """Return the bursts that hal/qemu/main.c wrote down, cut where they were cut."""
    lines = truth.read_text(encoding="ascii").splitlines()
    cuts_us = {line[1:17]: int(line[17:33], 16) for line in lines if line.startswith("c")}
    for line in lines:
        if not line.startswith("b"):
            continue
        steps = np.frombuffer(bytes.fromhex(line[49:]), dtype=">i2").reshape(2, -1)
        burst = Emission(
            token=int(line[1:17], 16),
            start_us=int(line[17:33], 16),
            volts=steps * RAIL_V / 32_767,
            levels_vpp=(int(line[33:41], 16) / 1000, int(line[41:49], 16) / 1000),
            sample_rate_hz=rigs.EMULATED_RATE_HZ,
        )
        yield burst.cut(cuts_us[line[1:17]]) if line[1:17] in cuts_us else burst
