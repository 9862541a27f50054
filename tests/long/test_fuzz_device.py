"""A device that gets damaged bytes keeps to its ceiling; firmware and core do the same."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from device.core.reports import Health
from device.emulate.firmware import FirmwareLibrary
from tests.long.test_fuzz import damaged, rounds
from tests.system.differential import compare, make_small_library
from tests.test_device import golden

if TYPE_CHECKING:
    from pathlib import Path

    from device import Emission

STEPS = [
    step
    for step in json.loads(golden.FILE.read_text(encoding="utf-8"))["steps"]
    if "question" in step
]
QUESTIONS = [bytes.fromhex(step["question"]) for step in STEPS]
PING = QUESTIONS[[step["type"] for step in STEPS].index("PING")]


def test_an_endpoint_of_any_bytes_emits_nothing_above_its_ceiling() -> None:
    for number in range(rounds(20_000)):
        rng = np.random.default_rng(number)
        emitted: list[Emission] = []
        device, now_us = golden.power_on(golden.Reader(golden.READING), emitted.append), 0
        for question in QUESTIONS:
            now_us += int(rng.integers(1, 50_000))
            device.receive(now_us, damaged(question, rng) if rng.random() < 0.3 else question)
            if rng.random() < 0.02:
                closed, over = (bool(rng.random() < share) for share in (0.8, 0.1))
                device.core.sense(now_us, Health(switch_closed=closed, over_current=over))
        device.receive(now_us + 1, b"\0")  # ends what the last question may have left open
        answer = device.receive(now_us + 2, PING)
        assert len([frame for frame in answer.split(b"\0") if frame]) == 1
        for burst in emitted:
            for volts in burst.volts:
                assert np.abs(volts).max(initial=0.0) <= golden.LIMITS.ceiling_vpp / 2, number


def test_firmware_and_core_agree_on_five_million_inputs(tmp_path: Path) -> None:
    library = FirmwareLibrary(make_small_library(tmp_path, sanitize="undefined"))
    for number in range(rounds(20_000)):
        compare(library, 10_000 + number)
