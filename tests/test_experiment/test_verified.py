"""Sessions with a monitor: what was not verified is presented again, told, and never counted."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING

import pytest

from device.sound.audio import AudioDevice
from experiment.apparatus.monitor import make_monitor
from experiment.apparatus.noise import SilentNoise
from experiment.apparatus.slots import host_limits
from experiment.archive.disk import UNWAITED
from experiment.archive.folders import SessionFolder
from experiment.integrity.sessions import examine
from experiment.operator.requests import Requests, StopSignal
from experiment.session.conduct import begin, resume
from experiment.session.setting import Setting
from experiment.session.simulate import simulated_responder
from experiment.study.read import study_from_text
from experiment.trial.draw import draw_plan
from tests.test_device.in_process import LoopCard
from tests.test_experiment.lab import Watching

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.session.setting import Ending

STUDY = """
[burst]
window = "hann"
[device]
driver = "audio"
port = "card"
volts_full_scale = 125
least_interval_s = 0.01
[design]
levels_vpp = [100, 200]
trials_per_side = {trials}
both_trials = 2
blank_trials = 2
responses = ["left", "right", "both", "none"]
foreperiod_s = [0.3, 0.4]
break_every = 0
[masking]
noise = "none"
[simulation]
threshold_vpp = 50
[monitor]
source = "duplex"
tap = "{tap}"
per_unit = [125, 125]
per_volt = [1, 1]
measured_by = "us"
measured_on = 2026-11-22
delay_ms = [5, 5]
disagreement = "{disagreement}"
"""


class Wired:
    """A session on a sound card that hears itself, with a simulated participant."""

    def __init__(
        self, root: Path, *, trials: int = 4, tap: str = "line", disagreement: str = "repeat"
    ) -> None:
        text = STUDY.format(trials=trials, tap=tap, disagreement=disagreement)
        self.study = study_from_text(text, "study.toml")
        self.card = LoopCard()
        self.card.noise = 1e-3
        self.device = AudioDevice(
            self.card.connect,
            limits=host_limits(self.study.device),
            clock=self.card,
            volts_full_scale=125.0,
            sample_rate_hz=48_000.0,
            name="card",
            recorder=self.card.recorder,
        )
        self.monitor = make_monitor(self.study.monitor, self.device, self.card, self.card.recorder)
        self.folder = SessionFolder(root, "01", "01", disk=UNWAITED)
        self.plan = draw_plan(self.study, participant="01", session="01", seed=3)
        self.requests = Requests()
        self.display = Watching()
        self.told: list[str] = []
        self.pauses = 0
        self.at_pause: Callable[[], object] = lambda: None
        self.at_ask: Callable[[int], object] = lambda trial: None

    def setting(self) -> Setting:
        someone = simulated_responder(self.study, self.plan, self.card)
        pause, ask = someone.pause, someone.ask

        def paused(*args: object, **named: object) -> bool:
            self.pauses += 1
            self.at_pause()
            return pause(*args, **named)  # type: ignore[arg-type]

        def asked(question: object) -> object:
            self.at_ask(question.trial)  # type: ignore[attr-defined]
            return ask(question)  # type: ignore[arg-type]

        someone.pause, someone.ask = paused, asked  # type: ignore[method-assign,assignment]
        return Setting(
            device=self.device,
            responder=someone,
            noise=SilentNoise(self.study.masking),
            clock=self.card,
            stop=StopSignal(),
            requests=self.requests,
            display=self.display,
            tell=self.told.append,
            monitor=self.monitor,
            confirmation=None,
        )

    def begin(self) -> Ending:
        return begin(self.folder, self.plan, self.setting())

    def table(self, name: str = "trials.csv") -> list[dict[str, str]]:
        with (self.folder.path / name).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    def cut(self) -> None:
        self.card.path = lambda past: 0 * past

    def repair(self) -> None:
        self.card.path = lambda past: past


@pytest.fixture(autouse=True)
def _anybody_may(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiment.session.conduct.require_confirmed", lambda *_: None)


@pytest.mark.slow
def test_a_session_of_verified_bursts_says_so_in_every_row(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    assert wired.begin().finished
    rows, measured = wired.table(), wired.table("measured.csv")
    assert {row["burst_verified"] for row in rows} == {"line"}
    assert [(row["trial"], row["attempt"]) for row in measured] == [
        (row["trial"], row["attempt"]) for row in rows
    ]
    for row, one in zip(rows, measured, strict=True):
        for side in ("left", "right"):
            wanted = float(row["level_vpp"]) / 2 if row["side"] in {side, "both"} else 0.0
            assert float(one[f"planned_{side}"]) == pytest.approx(wanted, rel=1e-3)
            assert float(one[f"peak_{side}"]) == pytest.approx(wanted, rel=0.02, abs=2.0)
        if row["side"] != "none":
            assert abs(float(one["late_s"])) < 1 / 48e3
            assert float(one["onset_s"]) - float(row["onset_s"]) == pytest.approx(0, abs=0.03)
    header = json.loads((wired.folder.path / "header.json").read_text(encoding="utf-8"))
    assert (header["monitor"]["tap"], header["monitor"]["unit"]) == ("line", "V")
    assert any("never sees the amplifier" in line for line in wired.told)
    assert examine(wired.folder.path).differences == ()


@pytest.mark.slow
def test_a_loop_cut_in_the_middle_pauses_calls_and_counts_nothing_until_it_is_mended(
    tmp_path: Path,
) -> None:
    wired = Wired(tmp_path, trials=28)
    wired.requests.attended = True
    number = 0

    def ask(trial: int) -> None:
        nonlocal number
        number += 1
        if number == 49:  # the next burst is the fiftieth
            wired.cut()

    def mend() -> None:
        assert wired.requests.paused
        if wired.pauses == 2:  # the operator goes on once before anything was mended
            wired.repair()

    wired.at_ask, wired.at_pause = ask, mend
    assert wired.begin().finished
    rows = wired.table()
    assert wired.pauses == 2
    wrong = [row for row in rows if row["burst_verified"] != "line"]
    assert [row["status"] for row in wrong] == ["indeterminate"] * len(wrong)
    assert len(wrong) in {2, 3}  # a blank trial is silent as planned
    ok = [row for row in rows if row["status"] == "ok"]
    assert sorted(int(row["trial"]) for row in ok) == [t.number for t in wired.plan.trials]
    assert {row["burst_verified"] for row in ok} == {"line"}
    trouble = "monitor (line): the burst was silent; put it right, then go on"
    assert trouble in wired.display.messages
    assert {one["faults"] for one in wired.table("measured.csv")} == {"n/a", "silent"}


def test_where_nobody_attends_it_stops_and_can_be_resumed(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    wired.at_ask = lambda trial: wired.cut()
    assert not wired.begin().finished
    assert any(line.startswith("Stopped: monitor (line)") for line in wired.told)
    wired.repair()
    wired.at_ask = lambda trial: None
    assert resume(wired.folder, wired.setting()).finished
    assert {r["burst_verified"] for r in wired.table() if r["status"] == "ok"} == {"line"}


@pytest.mark.slow
def test_flagged_bursts_stay_with_a_mark(tmp_path: Path) -> None:
    wired = Wired(tmp_path, disagreement="flag")
    wired.card.path = lambda past: past[:, ::-1]
    assert wired.begin().finished
    rows = wired.table()
    assert {row["status"] for row in rows} == {"ok"}
    assert all(
        row["burst_verified"] == ("false" if row["side"] in {"left", "right"} else "line")
        for row in rows
    )


@pytest.mark.slow
def test_motion_of_another_size_is_only_noted(tmp_path: Path) -> None:
    wired = Wired(tmp_path, tap="motion")
    wired.card.path = lambda past: 0.6 * past
    assert wired.begin().finished
    assert {row["burst_verified"] for row in wired.table()} == {"motion"}
    assert "too weak" in {one["noted"] for one in wired.table("measured.csv")}


@pytest.mark.slow
def test_a_table_that_was_changed_is_named_and_built_anew(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    wired.begin()
    path = wired.folder.measured_path
    written = path.read_bytes()
    path.write_bytes(written.replace(b"line", b"amplifier", 1))
    (difference,) = examine(wired.folder.path).differences
    assert (difference.path, difference.mended_by) == (path, "export")
    path.unlink()
    (difference,) = examine(wired.folder.path).differences
    assert "is missing" in difference.message
    wired.folder.write_trials()
    assert path.read_bytes() == written


def test_an_answer_whose_burst_was_not_verified_is_no_ok_after_a_kill(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    wired.at_ask = lambda trial: wired.cut()
    wired.begin()
    lines = wired.folder.journal_path.read_bytes().splitlines(keepends=True)
    ends = [i for i, line in enumerate(lines) if b'"trial_end"' in line]
    wired.folder.journal_path.write_bytes(b"".join(lines[: ends[-1]]))
    (wired.folder.path.parent / "sessions.tsv").unlink()
    wired.folder.trials_path.unlink()
    wired.folder.measured_path.unlink()
    wired.repair()
    wired.at_ask = lambda trial: None
    assert resume(wired.folder, wired.setting()).finished
    assert {r["burst_verified"] for r in wired.table() if r["status"] == "ok"} == {"line"}
