"""Markers over the Lab Streaming Layer: an inlet sees every trial, with the times of the record."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING, Any

import pytest

from experiment.session.markers import RECORDING_START, LslMarkers
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.conftest import Run

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


def test_an_inlet_sees_every_trial_at_the_time_of_the_record(
    sessions: Sessions, inlets: list[Inlet], run: Run
) -> None:
    result = sessions.run("--responder", "simulated", "--lsl", "--seed", "1")
    assert result.exit_code == 0, result.stderr
    rows = sessions.rows()
    answered = [row for row in rows if row["rt_s"] != "n/a"]
    (inlet,) = inlets
    seen = inlet.take(1 + len(rows) + len(answered))
    (start, start_s), *trials = seen
    assert start == RECORDING_START
    (marked,) = sessions.lines("marker")
    at_s = {text: time_s - start_s + marked["at_s"] for text, time_s in trials}
    for row in rows:
        trial = f"trial{row['trial']}/attempt{row['attempt']}"
        level = f"{float(row['level_vpp']):g}Vpp"
        stimulus = (
            f"stimulus/{row['condition']}/{row['kind']}/{row['side']}/{level}/{trial}/interval1"
        )
        assert at_s[stimulus] == pytest.approx(float(row["onset_s"]), abs=2e-6)
        if row in answered:
            answer_s = float(row["onset_s"]) + float(row["rt_s"])
            assert at_s[f"response/{row['response']}/{trial}"] == pytest.approx(answer_s, abs=3e-6)
    assert len(seen) == 1 + len(rows) + len(answered)
    bids = sessions.out.parent / "bids"
    assert run("export", sessions.out, "--bids", bids).exit_code == 0
    (events,) = bids.rglob("*_events.tsv")
    heading, *lines = (line.split("\t") for line in events.read_text("utf-8").splitlines())
    onsets = [float(line[heading.index("onset")]) for line in lines]
    shifted = [float(row["onset_s"]) - marked["at_s"] for row in rows]
    assert onsets == pytest.approx(shifted, abs=1e-6)
