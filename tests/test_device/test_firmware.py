"""The firmware answers byte for byte as the core in Python does, and emits the same.

The contract of devices runs on it by `make -C firmware check`.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from device.driver import Refusal
from tests.test_device.differential import BEAT, KINDS, compare, small_server
from tests.test_device.firmware import Server, limits_of, make, require_tools
from tests.test_device.golden import FILE, ON_THE_HOST

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

pytestmark = pytest.mark.firmware

GOLDEN = json.loads(FILE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with the limits of the golden device."""
    require_tools("gcc", "make")
    folder = tmp_path_factory.mktemp("golden")
    make(folder, "server", sanitize=True, **limits_of(GOLDEN["device"]))
    with Server(folder / "server") as server:
        yield server


def test_the_golden_frames_are_what_the_firmware_answers(golden: Server) -> None:
    golden.switch_on(GOLDEN["device"])
    for step in GOLDEN["steps"]:
        ask(golden, step)
    for step, told in zip(GOLDEN["steps"], golden.told(), strict=True):
        assert (told.frames + told.text).hex(" ") == step.get("answer", ""), step["meaning"]


def ask(server: Server, step: dict[str, Any]) -> None:
    at_us = step["at_us"]
    match step:
        case {"sense": sensed}:
            server.sense(at_us, sensed["known"], sensed["set"])
        case {"hang_up": True}:
            server.hang_up(at_us)
        case {"reading": reading}:
            server.read_from_now_on(at_us, reading and tuple(reading.values()))
        case _:
            server.receive(at_us, bytes.fromhex(step["question"]))


def test_what_is_no_golden_frame_gets_no_answer_of_the_firmware(golden: Server) -> None:
    for noise in GOLDEN["no_frames"]:
        golden.switch_on(GOLDEN["device"])
        golden.receive(1, bytes.fromhex(noise["bytes"]))
        (told,) = golden.told()
        assert told.frames + told.text == b"", noise["meaning"]


def test_firmware_and_core_cannot_be_told_apart(tmp_path: Path) -> None:
    with small_server(tmp_path) as server:
        met = set.union(*(compare(server, seed) for seed in range(1600)))
    known = set(KINDS) - {0}
    refusals = {refusal for kind, refusal in met if kind in known}
    assert refusals == {0, *Refusal} - {Refusal[name] for name in ON_THE_HOST}
    assert {kind for kind, _ in met} >= known - {BEAT}
