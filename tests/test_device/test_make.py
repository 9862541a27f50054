"""What of firmware/ is built: with the limits that were asked for, or not at all."""

from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from tests.system.firmware import FIRMWARE, make, making, require_tools

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.firmware

BOARD = ("arm-none-eabi-gcc", "make")


def test_a_board_is_built_anew_with_other_limits_and_only_then(tmp_path: Path) -> None:
    require_tools(*BOARD)
    image = tmp_path / "tactstrip-nucleo.bin"
    ceilings: list[dict[str, int]] = [{}, {"CEILING_MVPP": 150_000}, {}]
    images = []
    for limits in ceilings:
        make(tmp_path, "board", sanitize=False, **limits)
        images.append(image.read_bytes())
    assert images[0] == images[2] != images[1]
    built_at = image.stat().st_mtime_ns
    make(tmp_path, "board")
    assert image.stat().st_mtime_ns == built_at


def test_a_board_takes_each_of_its_limits(tmp_path: Path) -> None:
    require_tools(*BOARD)
    limits = {"LONGEST_WAVEFORM": 1024, "MEMORY_SAMPLES": 4096}
    limits |= {"CEILING_MVPP": 150_000, "RAIL_MVPP": 180_000}
    make(tmp_path, "board", sanitize=False, **limits)


def why_not(folder: Path, target: str, **limits: int) -> str:
    """Return the complaints of the compiler."""
    command = making(folder, target, sanitize=False, **limits)
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    return run.stderr


@pytest.mark.parametrize(
    ("limits", "reason"),
    [
        ({"RAIL_MVPP": 199_999}, "full scale reaches the ceiling"),
        ({"CEILING_MVPP": 0}, "full scale reaches the ceiling"),
        ({"RAIL_MVPP": 2**32}, "levels travel in 32 bits"),
        ({"DC_TOLERANCE_PPM": 1_000_001}, "a ratio"),
        ({"SLOTS": 256}, "how many there are is told in one byte"),
        ({"DATA_WINDOW": 0}, "how many there are is told in one byte"),
        ({"DATA_WINDOW": 256}, "how many there are is told in one byte"),
    ],
)
def test_limits_that_cannot_be_kept_are_not_compiled(
    tmp_path: Path, limits: dict[str, int], reason: str
) -> None:
    require_tools("gcc", "make")
    assert reason in why_not(tmp_path, str(tmp_path / "monitor.so"), **limits)


def test_a_ceiling_beyond_what_the_pins_of_the_board_reach_is_not_compiled(tmp_path: Path) -> None:
    require_tools(*BOARD)
    assert "the buffer of the pins reaches" in why_not(tmp_path, "board", RAIL_MVPP=228_000)


ADC_FORM = '--adc: gain=G[,delay_us=US[,noise=MV]], up to 100, 1000, 100000, got "{}"'


@pytest.mark.parametrize(
    ("option", "complaint"),
    [
        (["--rate", "0"], '--rate: 1 to 50000, got "0"'),
        (["--tcp", "70000"], '--tcp: 0 to 65535, got "70000"'),
        (["--tcp", ""], '--tcp: 0 to 65535, got ""'),
        *(
            (["--adc", adc], ADC_FORM.format(adc))
            for adc in (
                *("", "gain=0", "gain=100.1", "gain=1e1", "gain=.5", "gain=1.2.3", "gain=nan"),
                *("gain=1,noise=5", "gain=1,delay_us=", "gain=1,delay_us=1000.5", "gain=1,"),
                *("gain=1,delay_us=-1", "gain=1,delay_us=0,noise=100001", "tap=line,gain=1"),
            )
        ),
    ],
)
def test_native_and_qemu_refuse_an_option_in_the_same_words(
    native: Path, option: list[str], complaint: str
) -> None:
    qemu = [sys.executable, str(FIRMWARE / "hal/qemu/run.py")]
    for name, command in (("tactstrip-native", [str(native)]), ("run.py", qemu)):
        run = subprocess.run([*command, *option], capture_output=True, text=True, check=False)
        assert (run.returncode, run.stdout) == (2, "")
        assert run.stderr == f"{name}: {complaint}\n"


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The device on this machine."""
    require_tools("gcc", "make")
    return make(tmp_path_factory.mktemp("native"), "native") / "tactstrip-native"
