"""Markers over the Lab Streaming Layer: an inlet sees every trial, with the times of the record."""

from __future__ import annotations

import builtins
import os
import subprocess
import threading
import time
from typing import TYPE_CHECKING, Any

import pytest

from device.clock import MonotonicClock, VirtualClock
from experiment.archive.bids import export_bids
from experiment.integrity.places import find_sessions
from experiment.session.markers import RECORDING_START, LslMarkers, MarkerError
from experiment.session.simulate import SimulatedResponder
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from experiment.terms.responder import Progress

WITHIN_S = 20.0


@pytest.fixture
def pylsl(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    """The library, which looks for this process's streams only: tests run in several."""
    config = tmp_path / "lsl_api.cfg"
    ours = f"[multicast]\nResolveScope = machine\n[lab]\nSessionID = {os.getpid()}\n"
    config.write_text(f"{ours}[log]\nlevel = -3\n")
    monkeypatch.setenv("LSLAPICFG", str(config))
    return pytest.importorskip("pylsl")


class Inlet:
    """Listens to a stream that is about to begin."""

    def __init__(self, pylsl: Any, markers: LslMarkers) -> None:
        uid = markers._outlet.get_info().uid()
        (stream,) = pylsl.resolve_byprop("uid", uid, timeout=WITHIN_S)
        self._inlet = pylsl.StreamInlet(stream)
        self._inlet.open_stream(timeout=WITHIN_S)

    def take(self, n: int) -> list[tuple[str, float]]:
        found: list[tuple[str, float]] = []
        until_s = time.monotonic() + WITHIN_S
        while len(found) < n and time.monotonic() < until_s:
            sample, at_s = self._inlet.pull_sample(timeout=0.1)
            if sample:
                found.append((sample[0], at_s))
        return found

    def close(self) -> None:
        self._inlet.close_stream()


@pytest.fixture
def inlets(pylsl: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Inlet]]:
    """One for every outlet that is made, open before anything is sent."""
    made: list[Inlet] = []
    init = LslMarkers.__init__

    def listening(self: LslMarkers, clock: Any, *, participant: str, session: str) -> None:
        init(self, clock, participant=participant, session=session)
        made.append(Inlet(pylsl, self))

    monkeypatch.setattr(LslMarkers, "__init__", listening)
    yield made
    for inlet in made:
        inlet.close()


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    return Sessions(tmp_path, '[masking]\nnoise = "none"\n' + quick_study_text)


@pytest.mark.process
def test_an_inlet_sees_every_trial_at_the_time_of_the_record(
    sessions: Sessions, inlets: list[Inlet], tmp_path: Path
) -> None:
    result = sessions.run("--responder", "simulated", "--lsl", "--seed", "1")
    assert result.exit_code == 0, result.stderr
    rows = sessions.rows()
    answered = [row for row in rows if row["rt_s"] != "n/a"]
    (inlet,) = inlets
    seen = inlet.take(1 + len(rows) + len(answered))
    (start, start_s), *trials = seen
    assert start == RECORDING_START
    (marked,) = sessions.entries("marker")
    at_s = {text: time_s - start_s + marked.facts["at_s"] for text, time_s in trials}
    for row in rows:
        trial = f"trial{row['trial']}/attempt{row['attempt']}"
        level = f"{float(row['level_vpp']):g}Vpp"
        stimulus = f"stimulus/{row['condition']}/{row['kind']}/{row['side']}/{level}/{trial}"
        assert at_s[stimulus] == pytest.approx(float(row["onset_s"]), abs=2e-6)
        if row in answered:
            felt_s = float(row["onset_s"]) + float(row["rt_s"])
            assert at_s[f"response/{row['response']}/{trial}"] == pytest.approx(felt_s, abs=3e-6)
    assert len(seen) == 1 + len(rows) + len(answered)
    assert sessions.header()["markers"].startswith("LSL stream tactstrip, pylsl ")
    export_bids(find_sessions(sessions.out).sessions, tmp_path / "bids")
    (events,) = (tmp_path / "bids").rglob("*_events.tsv")
    heading, *lines = (line.split("\t") for line in events.read_text("utf-8").splitlines())
    onsets = [float(line[heading.index("onset")]) for line in lines]
    shifted = [float(row["onset_s"]) - marked.facts["at_s"] for row in rows]
    assert onsets == pytest.approx(shifted, abs=1e-6)


class Early:
    """Looks for streams of markers over and over, and connects to the first new one at once."""

    def __init__(self, pylsl: Any) -> None:
        self._pylsl = pylsl
        self._over = threading.Event()
        self._since_s = pylsl.local_clock()
        self.seen: list[str] = []
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        found: list[Any] = []
        while not found and not self._over.is_set():
            streams = self._pylsl.resolve_byprop("type", "Markers", timeout=0.2)
            found = [stream for stream in streams if stream.created_at() > self._since_s]
        if found:
            inlet = self._pylsl.StreamInlet(found[0])
            while not self._over.is_set():
                sample, _ = inlet.pull_sample(timeout=0.05)
                self.seen += sample or []
            inlet.close_stream()

    def close(self) -> None:
        self._over.set()
        self._thread.join()


@pytest.mark.process
def test_a_recorder_that_looks_before_there_is_a_stream_hears_it_from_the_start(
    pylsl: Any, sessions: Sessions
) -> None:
    recorder = Early(pylsl)
    try:
        time.sleep(0.3)  # it looks
        words = sessions.words("--responder", "simulated", "--lsl")
        result = subprocess.run([*COMMAND, *words], capture_output=True, text=True, check=False)
        time.sleep(0.2)  # what was sent last is on its way
    finally:
        recorder.close()
    assert result.returncode == 0, result.stderr
    assert recorder.seen[0] == RECORDING_START
    assert recorder.seen[1].startswith("stimulus/")
    stimuli = [marker for marker in recorder.seen if marker.startswith("stimulus/")]
    assert len(stimuli) == len(sessions.rows())


@pytest.mark.process
def test_a_recorder_that_comes_late_is_sent_the_start_which_is_the_one_kept(
    pylsl: Any, sessions: Sessions, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("experiment.session.markers.LONGEST_S", 0.2)
    inlets: list[Inlet] = []
    outlets: list[LslMarkers] = []
    cue, cued, init = SimulatedResponder.cue, 0, LslMarkers.__init__

    def made(self: LslMarkers, *args: Any, **more: Any) -> None:
        init(self, *args, **more)
        outlets.append(self)

    def late(self: SimulatedResponder, progress: Progress) -> None:
        nonlocal cued
        cued += 1
        if cued == 3:
            inlets.append(Inlet(pylsl, outlets[0]))
        cue(self, progress)

    monkeypatch.setattr(LslMarkers, "__init__", made)
    monkeypatch.setattr(SimulatedResponder, "cue", late)
    result = sessions.run("--responder", "simulated", "--lsl", "--seed", "1")
    assert result.exit_code == 0, result.stderr
    rows = sessions.rows()
    seen = inlets[0].take(2 * (len(rows) - 2) + 1)
    inlets[0].close()
    markers = [marker for marker, _ in seen]
    (at_s,) = (time_s for marker, time_s in seen if marker == RECORDING_START)
    assert markers[0] == RECORDING_START
    assert markers[1].split("/")[-2] == "trial3"
    (kept,) = sessions.entries("marker")
    for row in rows[2:]:
        (felt_s,) = (t for m, t in seen if m.split("/")[-2:] == [f"trial{row['trial']}", "attempt1"]
                     and m.startswith("stimulus"))  # fmt: skip
        onset_s = float(row["onset_s"]) - kept.facts["at_s"]
        assert felt_s - at_s == pytest.approx(onset_s, abs=3e-6)


@pytest.mark.process
def test_a_sitting_has_its_start_after_the_start_key_and_each_resume_its_own(
    sessions: Sessions, inlets: list[Inlet], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(SimulatedResponder, "introduce", lambda *_: False)
        assert sessions.run("--responder", "simulated", "--lsl").exit_code == 4
    with monkeypatch.context() as patch:
        patch.setattr(SimulatedResponder, "begin", lambda *_: False)
        assert sessions.run("--responder", "simulated", "--lsl", "--resume").exit_code == 4
    assert sessions.run("--responder", "simulated", "--lsl", "--resume").exit_code == 0
    assert len(sessions.entries("marker")) == 2
    first, second, third = (inlet.take(1) for inlet in (inlets[0], inlets[2], inlets[2]))
    assert first[0][0] == second[0][0] == RECORDING_START
    assert third[0][0].startswith("stimulus/")


@pytest.mark.process
def test_times_are_on_the_streams_own_clock(pylsl: Any, inlets: list[Inlet]) -> None:
    clock = MonotonicClock()
    markers = LslMarkers(clock, participant="07", session="02")
    markers.send("now", clock.now_s())
    markers.send("a second ago", clock.now_s() - 1.0)
    ((_, now_s), (_, before_s)) = inlets[0].take(2)
    assert now_s == pytest.approx(pylsl.local_clock(), abs=1.0)
    assert now_s - before_s == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ImportError("'pylsl'"), r'pip install -e "\.\[lsl\]"'),
        (RuntimeError("\nmore"), "liblsl"),
    ],
)
def test_without_the_library_it_says_what_is_missing(
    monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
) -> None:
    real = builtins.__import__

    def without(name: str, *args: Any, **kwargs: Any) -> Any:
        if name == "pylsl":
            raise error
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MarkerError, match=said):
        LslMarkers(VirtualClock(), participant="01", session="01")
