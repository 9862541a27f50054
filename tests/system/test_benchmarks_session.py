"""The benchmark of a session sees what it says is not there."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, cast

import pytest

from benchmarks import session_path

if TYPE_CHECKING:
    from pathlib import Path

    from device.wire.channels import SerialChannel
    from experiment.session.simulate import SimulatedResponder
    from experiment.terms.responder import AwaitedAnswer

pytestmark = pytest.mark.gallery


def test_a_file_written_while_an_answer_is_awaited_is_counted_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_path, "_WRITE", lambda channel, data: None)
    monkeypatch.setattr(session_path, "_ASK", lambda responder, question: None)
    probe = session_path.Probe()
    handle = os.open(tmp_path / "file", os.O_WRONLY | os.O_CREAT)
    read_end, write_end = os.pipe()
    probe.write_file(handle, b"before")
    probe._fire_s = 0.0
    probe.write(cast("SerialChannel", None), b"fire")
    probe.write_file(handle, b"meanwhile")
    probe.write_file(write_end, b"no file")
    probe.sync_file(handle)
    probe.heed("open", ("name", "r", 0))
    probe.heed("compile", ())
    probe.ask(cast("SimulatedResponder", None), cast("AwaitedAnswer", None))
    probe.write_file(handle, b"after")
    probe.heed("open", ("name", "r", 0))
    for each in (handle, read_end, write_end):
        os.close(each)
    found = probe.finish()
    assert (found.written_awaited, found.written_all, found.opened) == (2, 4, 1)
    assert len(found.fire_to_byte_s) == len(found.arm_to_byte_s) == found.awaited == 1
