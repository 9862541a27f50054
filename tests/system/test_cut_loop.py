"""A participant's session on real sound whose recording is cut in the sound server."""

from __future__ import annotations

import csv
import json
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiment.integrity.sessions import examine
from tests.system.test_operator_view import Terminal
from tests.test_experiment.test_own_device import offer

if TYPE_CHECKING:
    import pytest

    from tests.processes import NullSink

STUDY = """
[burst]
window = "hann"
[device]
driver = "audio"
port = "pulse"
volts_full_scale = 125
least_interval_s = 0.01
[design]
levels_vpp = [100, 200]
trials_per_side = 27
both_trials = 2
blank_trials = 2
responses = ["left", "right", "both", "none"]
foreperiod_s = [0.13, 0.15]
break_every = 0
[masking]
noise = "none"
[monitor]
source = "duplex"
tap = "line"
per_unit = [125, 125]
measured_by = "us"
measured_on = 2026-05-04
"""
PLANNED = 58
CUT_AT = 50
SOMEBODY = """
from experiment.terms.responder import Press

class Somebody:
    simulated = False

    def __init__(self, settings, clock):
        self.requests, self.clock = settings.requests, clock

    def begin(self, progress):
        return True

    def introduce(self, part, progress):
        return True

    def cue(self, progress):
        pass

    def wait(self, until_s):
        self.clock.wait(until_s - self.clock.now_s())

    def ask(self, question):
        self.wait(question.onset_s + 0.16)
        return Press("left", self.clock.now_s())

    def feedback(self, *, correct):
        pass

    def pause(self, progress, *, paused, minimum_s):
        while not self.requests.take_go_on():
            self.clock.wait(0.02)
        return True

    def end(self, progress, *, finished):
        pass
"""
"""It is a person to the program, who feels nothing and answers at once."""
RUN = "from tactstrip import main; main()"
LONGEST_S = 300.0
MOST_SITTINGS = 5
"""On a busy machine PortAudio may give a stream up; then the session is resumed."""
DEVICE_FAILED = 3


class Operator:
    """Watches the journal, cuts the recording before the fiftieth trial, and mends it later."""

    def __init__(self, folder: Path, sink: NullSink) -> None:
        self._journal = folder / "journal.jsonl"
        self._sink = sink
        self.cut_after = 0
        self.silent = self.others = 0

    def _events(self, name: str) -> list[dict[str, Any]]:
        if not self._journal.exists():
            return []
        lines = self._journal.read_text(encoding="utf-8").split("\n")[:-1]
        return [entry for entry in map(json.loads, lines) if entry["event"] == name]

    def _mute(self, *, on: bool) -> None:
        self._sink.control("set-source-mute", "plate.monitor", str(int(on)))

    def look(self, terminal: Terminal) -> None:
        """Do what is to be done now; r is pressed in every pause, in vain while it is cut."""
        terminal.read()
        ended = len(self._events("trial_end"))
        if ended >= CUT_AT - 1 and not self.cut_after:
            self._mute(on=True)
            self.cut_after = ended
        pauses = self._events("pause")
        if len(pauses) == self.silent + self.others:
            return
        why = str(pauses[-1]["operator_called"])
        if self.cut_after and "the burst was silent" in why:
            terminal.expect("the burst was silent")
            self.silent += 1
            if self.silent == 2:
                self._mute(on=False)
        else:
            self.others += 1
        terminal.type("r")


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_a_recording_cut_at_the_fiftieth_trial_pauses_and_nothing_unverified_is_counted(
    null_sink: NullSink, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site, study = tmp_path / "site", tmp_path / "study.toml"
    offer(site, "[tactstrip.responders]\nsomebody = somebody:Somebody\n", {"somebody": SOMEBODY})
    monkeypatch.setenv("PYTHONPATH", f"{site}{os.pathsep}{Path.cwd()}")
    study.write_text(STUDY, encoding="utf-8")
    words = ["run", str(study), "--participant", "01", "--responder", "somebody", "--seed", "7"]
    words += ["--confirm-hardware", "--out", str(tmp_path / "out")]
    session = tmp_path / "out" / "sub-01" / "ses-01"
    operator = Operator(session, null_sink)
    until_s = time.monotonic() + LONGEST_S
    for _ in range(MOST_SITTINGS):
        resumed = ["--resume"] if (session / "journal.jsonl").exists() else []
        with Terminal(RUN, *words, *resumed) as terminal:
            while terminal.process.poll() is None:
                operator.look(terminal)
                assert time.monotonic() < until_s, terminal.seen
            ended = terminal.ended()
        if ended != DEVICE_FAILED:
            break
    assert ended == 0, terminal.seen
    rows, measured = table(session / "trials.csv"), table(session / "measured.csv")
    ok = [row for row in rows if row["status"] == "ok" and row["kind"] != "practice"]
    assert len({row["trial"] for row in ok}) == len(ok) == PLANNED
    assert all(row["burst_verified"] == ("n/a" if row["side"] == "none" else "line") for row in ok)
    assert {row["simulated"] for row in rows} == {"false"}
    after = measured[operator.cut_after :]
    first = next(i for i, one in enumerate(after) if one["faults"] == "silent")
    verified = [one for one in after[:first] if one["burst_verified"] == "line"]
    assert len(verified) <= 1  # of a trial that had begun
    assert operator.silent >= 2
    assert examine(session).differences == ()
    torn = len(rows) - len(ok) - operator.silent
    print(f"{len(ok)} of {PLANNED} verified, {operator.silent} silent, {torn} torn by the server")
