"""Sessions with a monitor: what was not verified is presented again, told, and never counted."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import pytest

from analysis.reading.load import read_inputs
from analysis.reading.text import ResultFileError
from analysis.results.protocol import measured_rows, monitored
from analysis.results.tables import analyse
from device.clock import VirtualClock
from device.core.reports import Health
from device.emulate.amplifier import Adc
from device.emulate.mock import MockDevice
from device.errors import LinkError
from device.monitor import inputs, matching
from device.scpi.dialects import DIALECTS
from device.sound.audio import AudioDevice
from experiment.apparatus.monitor import make_monitor, planned_burst
from experiment.apparatus.noise import SilentNoise
from experiment.apparatus.rig import Rig, assemble, confirmed_now
from experiment.apparatus.slots import SLOTS, host_limits, load_condition
from experiment.archive.disk import UNWAITED
from experiment.archive.folders import SessionFolder
from experiment.archive.journal import read_journal
from experiment.commands.check import end_check
from experiment.integrity.sessions import examine, unaltered
from experiment.operator.requests import Requests, StopSignal
from experiment.preview.device import check_device, device_findings
from experiment.session.conduct import begin, resume
from experiment.session.setting import Setting
from experiment.session.simulate import simulated_responder
from experiment.study.read import study_from_text
from experiment.study.sections import equipment
from experiment.study.study import StudyError
from experiment.terms.exits import CommandError
from experiment.trial.draw import draw_plan
from tests.test_device.in_process import LoopCard
from tests.test_experiment.lab import Watching
from tests.test_experiment.test_integrity import chained

if TYPE_CHECKING:
    from collections.abc import Callable

    from analysis.results.tables import Analysis
    from experiment.session.setting import Ending
    from experiment.terms.responder import AwaitedAnswer, Press
    from tests.conftest import Run

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
measured_on = 2026-05-04
delay_ms = [5, 5]
disagreement = "{disagreement}"
"""


class Wired:
    """A session on a sound card that hears itself, with a simulated participant."""

    def __init__(
        self,
        root: Path,
        *,
        trials: int = 4,
        tap: str = "line",
        disagreement: str = "repeat",
        more: str = "",
    ) -> None:
        text = STUDY.format(trials=trials, tap=tap, disagreement=disagreement) + more
        self.study = study_from_text(text, "study.toml")
        self.card = LoopCard()
        self.card.line.noise = 1e-3
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
        self.card.line.path = lambda past: 0 * past

    def repair(self) -> None:
        self.card.line.path = lambda past: past


def counted(rows: list[dict[str, str]], tap: str = "line") -> bool:
    """Tell whether all bursts were verified, and no blank, in which there is nothing to verify."""
    return all(row["burst_verified"] == ("n/a" if row["side"] == "none" else tap) for row in rows)


@pytest.fixture(autouse=True)
def _anybody_may(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiment.session.conduct.require_confirmed", lambda *_: None)


@pytest.mark.slow
def test_a_session_of_verified_bursts_says_so_in_every_row(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    assert wired.begin().finished
    rows, measured = wired.table(), wired.table("measured.csv")
    assert counted(rows)
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
    assert any("amplifier" in line for line in wired.told)
    assert examine(wired.folder.path).differences == ()
    found = analyse(read_inputs([tmp_path]))
    assert len(found.measured) == len(rows)
    _, *told = measured_rows(found)
    assert {row[3] for row in told} == {"0 V", "50 V", "100 V"}
    assert all(row[6] == row[7] for row in told if row[2] != "none")
    assert {(*row[2:4], *row[6:11]) for row in told if row[2] == "none"} == {
        ("none", "0 V", "2", "0", "0", "2", "0")
    }


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
    wrong = [row for row in rows if row["burst_verified"] == "false"]
    assert [row["status"] for row in wrong] == ["indeterminate"] * len(wrong)
    assert len(wrong) in {2, 3}  # a blank trial is silent as planned
    ok = [row for row in rows if row["status"] == "ok"]
    assert sorted(int(row["trial"]) for row in ok) == [t.number for t in wired.plan.trials]
    assert counted(ok)
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
    assert counted([row for row in wired.table() if row["status"] == "ok"])


@pytest.mark.slow
def test_flagged_bursts_stay_with_a_mark(tmp_path: Path) -> None:
    wired = Wired(tmp_path, disagreement="flag")
    wired.card.line.path = lambda past: past[:, ::-1]
    assert wired.begin().finished
    rows = wired.table()
    assert {row["status"] for row in rows} == {"ok"}
    swapped = [row for row in rows if row["side"] in {"left", "right"}]
    assert {row["burst_verified"] for row in swapped} == {"false"}
    assert counted([row for row in rows if row not in swapped])


@pytest.mark.slow
def test_a_delay_that_jumps_within_its_tolerance_is_noted_and_counted(tmp_path: Path) -> None:
    wired = Wired(tmp_path, more="onset_tolerance_ms = 20\n")
    wired.card.line.delays = [480.0, 480.0]

    def ask(trial: int) -> None:
        if len(asked) == 5:  # after an xrun, say, the same way takes 14 ms instead of 10
            wired.card.line.delays = [672.0, 672.0]
        asked.append(trial)

    asked: list[int] = []
    wired.at_ask = ask
    assert wired.begin().finished
    assert counted(wired.table())
    noted = [one["noted"] for one in wired.table("measured.csv")]
    assert sorted({*noted}) == ["delay changed", "n/a"]
    assert noted.count("delay changed") == 1
    _, *told = measured_rows(analyse(read_inputs([tmp_path])))
    assert sum(int(row[10]) for row in told) in {1, 2}  # a burst on both channels has two rows


def test_a_report_tells_where_a_planned_monitor_measured_nothing() -> None:
    study = study_from_text(MONITOR, "study.toml")
    sessions = SimpleNamespace(counts=SimpleNamespace(sessions=3), measured=())
    words = "line, by inputs of the sound card that drives; it never sees the amplifier"
    told = monitored(study, cast("Analysis", sessions))
    assert told.startswith(f"none: no burst was verified; the plan has {words}")
    row = SimpleNamespace(participant="01", session="01")
    sessions.measured = (row, row)
    assert monitored(study, cast("Analysis", sessions)).endswith("; in 1 of 3 sessions")
    sessions.counts.sessions = 1
    assert monitored(study, cast("Analysis", sessions)).startswith(words)


@pytest.mark.slow
def test_motion_of_another_size_is_only_noted(tmp_path: Path) -> None:
    wired = Wired(tmp_path, tap="motion")
    wired.card.line.path = lambda past: 0.6 * past
    assert wired.begin().finished
    assert counted(wired.table(), "motion")
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


@pytest.mark.slow
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
    assert counted([row for row in wired.table() if row["status"] == "ok"])


BY_ITSELF = """
[burst]
window = "hann"
[design]
levels_vpp = [100, 200]
trials_per_side = 4
both_trials = 2
foreperiod_s = [0.3, 0.4]
[masking]
noise = "none"
[simulation]
threshold_vpp = 50
[monitor]
source = "device"
tap = "{tap}"
per_volt = [{gain}, {gain}]
"""


class ByItself(Wired):
    """The same on a mock whose own converter measures."""

    def __init__(self, root: Path, *, tap: str = "amplifier", gain: float = 1.0) -> None:
        super().__init__(root)
        self.study = study_from_text(BY_ITSELF.format(tap=tap, gain=gain), "study.toml")
        self.clock = VirtualClock()
        limits = host_limits(self.study.device)
        self.mock = MockDevice(self.clock, limits=limits, adc=Adc(tap=tap))
        self.monitor = make_monitor(self.study.monitor, self.mock, self.clock, None)
        self.plan = draw_plan(self.study, participant="01", session="01", seed=3)

    def setting(self) -> Setting:
        someone = simulated_responder(self.study, self.plan, self.clock)
        ask = someone.ask

        def asked(question: AwaitedAnswer) -> Press | None:
            self.at_ask(question.trial)
            return ask(question)

        someone.ask = asked  # type: ignore[method-assign]
        made = super().setting()
        return replace(made, device=self.mock, responder=someone, clock=self.clock)


def test_a_device_s_own_converter_verifies(tmp_path: Path) -> None:
    rig = ByItself(tmp_path)
    assert rig.begin().finished
    assert {row["burst_verified"] for row in rig.table()} == {"amplifier"}
    header = json.loads((rig.folder.path / "header.json").read_text(encoding="utf-8"))
    assert header["monitor"]["never_sees"].endswith(", nor that a burst was clipped or doubled")
    assert any("never sees" in line and "clipped" in line for line in rig.told)
    measured = rig.table("measured.csv")
    assert {row["source"] for row in measured} == {"the device's own converter"}
    for row in measured:
        assert float(row["peak_left"]) == pytest.approx(float(row["planned_left"]), rel=0.02)


def test_another_size_than_planned_is_a_fault_of_a_device_s_own_converter_too(
    tmp_path: Path,
) -> None:
    rig = ByItself(tmp_path, gain=1.3)
    assert not rig.begin().finished
    assert rig.table()[0]["burst_verified"] == "false"
    assert any("too weak" in line for line in rig.told)


@pytest.mark.parametrize("tap", ["line", "amplifier"])
def test_an_amplifier_that_goes_off_while_it_drives_is_seen_beside_any_tap(
    tmp_path: Path, tap: str
) -> None:
    rig = ByItself(tmp_path, tap=tap)
    off = Health(amplifier_enabled=True, switch_closed=False, over_current=False)

    def open_switch(trial: int) -> None:
        if len(rig.mock.emitted) == 5:
            rig.mock.sense(off)

    rig.mock.sense(Health(amplifier_enabled=True, switch_closed=True, over_current=False))
    rig.at_ask = open_switch
    assert not rig.begin().finished
    rows = rig.table()
    assert [row["burst_verified"] for row in rows] == [tap] * 4 + ["false"]
    assert rows[-1]["status"] == "indeterminate"
    assert any("amplifier off" in line for line in rig.told)


def test_markers_carry_the_measured_onset(tmp_path: Path) -> None:
    rig = ByItself(tmp_path)
    rig.mock = MockDevice(
        rig.clock, limits=host_limits(rig.study.device), adc=Adc(tap="amplifier", delay_us=700.0)
    )
    rig.monitor = make_monitor(rig.study.monitor, rig.mock, rig.clock, None)
    sent: list[tuple[str, float]] = []

    class Heard:
        words = "a list"

        def heard(self) -> bool:
            return True

        def send(self, marker: str, time_s: float) -> None:
            sent.append((marker, time_s))

    begin(rig.folder, rig.plan, replace(rig.setting(), markers=Heard()))
    stimuli = [time_s for marker, time_s in sent if marker.startswith("stimulus/")]
    answers = [time_s for marker, time_s in sent if marker.startswith("response/")]
    rows = rig.table()
    assert len(stimuli) == len(rows)
    for row, time_s in zip(rows, stimuli, strict=True):
        assert time_s - float(row["onset_s"]) == pytest.approx(7e-4, abs=2e-5)
    answered = [float(r["onset_s"]) + float(r["rt_s"]) for r in rows if r["rt_s"] != "n/a"]
    assert answers == pytest.approx(answered, abs=2e-5)


MONITOR = STUDY.format(trials=4, tap="line", disagreement="repeat")


@pytest.mark.parametrize(
    ("key", "instead", "told"),
    [
        ('source = "duplex"\n', "", r"monitor\.source"),
        ("[125, 125]", "[1e-15, 125]", "1e-12 away from 0"),
        ('"duplex"', '"duplex"\nsound_card = "x"', "sound_card"),
        ('"repeat"', '"repeat"\nonset_tolerance_ms = 200', r"onset_tolerance_ms"),
        ('"repeat"', '"repeat"\nsample_rate_hz = 96000', "sample_rate_hz"),
        (
            "[1, 1]",
            "[0, 1]",
            ">= 1e-09 and .* got 0",
        ),
        (
            "[0.3, 0.4]\nbreak_every = 0",
            "[0.1, 0.4]\nbreak_every = 0",
            r".foreperiod_s\[0\], 50",
        ),
        (
            "hann",
            'hann"\ncycles = 20 #',
            r"\.foreperiod_s\[0\]",
        ),
        (
            "hann",
            'hann"\ncycles = 64 #',
            r"0\.125 s .* = duplex; got 0\.128 s",
        ),
        (
            "hann",
            'hann"\nfrequency_hz = 15000 #',
            r"device\.sample_rate_hz",
        ),
        ('"duplex"', '"device"', "source"),
        ('"audio"', '"serial"', "source"),
        ("2026-05-04", '"soon"', "-month-day, .*"),
        ("2026-05-04", "2999-01-01", "'2999-01-01'"),
        (
            "2026-05-04",
            '"20260504"',
            "monitor.measured_on",
        ),
    ],
)
def test_a_key_of_the_monitor_that_could_mislead_is_refused(
    key: str, instead: str, told: str
) -> None:
    text = MONITOR.replace("delay_ms", "onset_tolerance_ms = 60\ndelay_ms")
    text = MONITOR if "onset" in instead else text
    assert key in text
    study_from_text(text, "study.toml")
    with pytest.raises(StudyError, match=told):
        study_from_text(text.replace(key, instead), "study.toml")


def test_a_device_that_tells_magnitudes_has_no_inverted_channel() -> None:
    text = BY_ITSELF.format(tap="line", gain=1)
    for channels, good in (("[2, 1]", True), ("[-1, 1]", False)):
        keys = f"{text}per_unit = {channels}\n"
        if good:
            study_from_text(keys, "study.toml")
            continue
        with pytest.raises(StudyError, match="0 with source = device"):
            study_from_text(keys, "study.toml")


def test_a_burst_above_the_band_of_the_inputs_is_refused() -> None:
    text = MONITOR.replace("duplex", "input").replace("hann", 'hann"\nfrequency_hz = 2000 #')
    study_from_text(text, "study.toml")
    told = r"monitor\.sample_rate_hz must be at least .* burst of condition main, .*; got 8000"
    with pytest.raises(StudyError, match=told):
        study_from_text(f"{text}sample_rate_hz = 8000\n", "study.toml")


def test_source_and_driver_must_go_together() -> None:
    by_itself = BY_ITSELF.format(tap="line", gain=1) + "[device]\nvolts_full_scale = 125\n"
    for text, driver in ((MONITOR, "serial"), (by_itself, "audio")):
        study = study_from_text(text, "study.toml")
        with pytest.raises(StudyError, match=r"monitor\.source"):
            assemble(study, driver=driver, port="x", simulated=True)


@pytest.mark.parametrize(
    ("why", "told"),
    [
        (
            "'nosuch'",
            r"monitor\.sound_card .* got 'nosuch' \(cann",
        ),
        ("[PaErrorCode -9998]", r"monitor\.inputs .* got \[3, 7\] \(c"),
        (
            "[-9997]",
            r"monitor\.sample_rate_hz must be .* got 96000 \(cannot op",
        ),
    ],
)
def test_a_card_of_the_monitor_s_own_that_cannot_be_opened_is_told_by_its_key(
    monkeypatch: pytest.MonkeyPatch, why: str, told: str
) -> None:
    def refuse(**_: object) -> None:
        raise ValueError(why)

    library = SimpleNamespace(PortAudioError=OSError, InputStream=refuse)
    monkeypatch.setitem(sys.modules, "sounddevice", library)
    keys = 'sound_card = "nosuch"\ninputs = [3, 7]\nsample_rate_hz = 96000\n'
    study = study_from_text(MONITOR.replace("duplex", "input") + keys, "study.toml")
    clock = VirtualClock()
    device = MockDevice(clock, limits=host_limits(study.device))
    monitor = make_monitor(study.monitor, device, clock, None)
    assert monitor is not None
    with pytest.raises(LinkError, match=told):
        monitor.open()


def test_the_quiet_that_a_study_is_asked_for_is_what_a_monitor_needs() -> None:
    assert equipment.LEAST_QUIET == matching.LEAST_QUIET
    assert equipment.LEAST_QUIET_S == inputs.LEAST_QUIET_S
    assert equipment.MOST_QUIET_S == inputs.MOST_QUIET_S


def test_no_generator_reaches_more_than_a_study_is_told() -> None:
    assert max(one.most_vpp for one in DIALECTS) == equipment.GENERATOR_MOST_VPP


@pytest.mark.parametrize("port", ["", " ", "two\nlines"])
def test_a_port_of_no_name_is_told_by_its_option(port: str) -> None:
    study = study_from_text(MONITOR, "study.toml")
    with pytest.raises(StudyError, match="^--port"):
        assemble(study, driver=None, port=port, simulated=True)


WATCHED = """
import os, sys
from pathlib import Path
from tests.test_experiment import test_verified
import experiment.session.conduct as conduct
conduct.require_confirmed = lambda *_: None
wired = test_verified.Wired(Path(sys.argv[1]))
fire, end = wired.device.fire, wired.monitor.end
def mark(words):
    os.access(words, os.F_OK)
def fired(token):
    mark("FIRE")
    return fire(token)
def ended(delivery):
    told = end(delivery)
    mark("KEY")
    return told
wired.device.fire, wired.monitor.end = fired, ended
assert wired.begin().finished
"""


@pytest.mark.process
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed")
def test_nothing_touches_the_disk_from_the_onset_to_the_measurement(tmp_path: Path) -> None:
    told = tmp_path / "calls.txt"
    calls = "access,faccessat,faccessat2,write,writev,pwrite64,fsync,fdatasync,sync,rename,creat"
    command = ["strace", "-f", "-o", str(told), "-e", f"trace={calls},openat,unlink"]
    root = tmp_path / "root"
    command += [sys.executable, "-c", WATCHED, str(root)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "ptrace" in done.stderr:
        pytest.skip("strace may not watch here")
    assert done.returncode == 0, done.stderr
    between, seen, windows = False, [], 0
    for line in told.read_text(encoding="utf-8").splitlines():
        if '"FIRE"' in line:
            between = True
            windows += 1
        elif '"KEY"' in line:
            between = False
        elif between and (str(root) in line or "sync" in line or " write" in line):
            seen.append(line)
    assert windows == 12
    assert seen == []


def test_the_check_of_a_device_tells_gain_and_delay_of_its_monitor(tmp_path: Path) -> None:
    wired = Wired(tmp_path)
    wired.card.line.delays = [252.0, 264.0]
    wired.card.line.path = lambda past: 0.95 * past
    assert wired.monitor is not None
    rig = Rig(
        device=wired.device, clock=wired.card, settings=wired.study.device, monitor=wired.monitor
    )
    word = confirmed_now("asked")
    found = check_device(wired.study, rig, confirmation=word, ask=None)
    for channel, delay in zip(found.channels, (252, 264), strict=True):
        told = channel.calibration
        assert told is not None
        assert channel.good
        assert told.per_unit == pytest.approx(125 / 0.95, rel=0.02)
        assert told.delay_ms == pytest.approx(delay / 48, abs=0.02)
    text = device_findings(found).text
    assert "V of 10 planned, noise" in text
    assert text.count("exact with delay_ms = 5.") == 2
    wired.cut()
    found = check_device(wired.study, rig, confirmation=word, ask=None)
    assert not any(channel.good for channel in found.channels)


@pytest.mark.parametrize(
    ("adc", "keys", "told"),
    [
        (
            {"gain": 0.5},
            "",
            "per_unit = 2",
        ),
        ({"gain": 1.2}, "", "per_unit = 0.833"),
        ({"delay_us": 5e4}, "", "delay_ms = 50"),
        ({"delay_us": 1e4}, "delay_ms = [30, 10]", "delay_ms = 10 on"),
        ({"noise": 200.0}, "least_correlation = 0.9999", "distorted"),
        ({"loss": 1.0}, "", "silent"),
        (
            {"delay_us": 1e4, "gain": 0.5},
            'disagreement = "flag"',
            "per_unit = 2 and delay_ms = 10",
        ),
        ({"gain": 0.95, "delay_us": 900.0}, "", ""),
        ({"delay_us": 1e4}, "delay_ms = [9.5, 10.5]", ""),
    ],
)
def test_a_check_ends_with_1_where_a_session_would_count_no_burst(
    tmp_path: Path, adc: dict[str, float], keys: str, told: str
) -> None:
    rig = ByItself(tmp_path)
    text = BY_ITSELF.format(tap="amplifier", gain=1) + keys
    study = study_from_text(text, "study.toml")
    mock = MockDevice(rig.clock, limits=host_limits(study.device), adc=Adc(**adc))  # type: ignore[arg-type]
    monitor = make_monitor(study.monitor, mock, rig.clock, None)
    made = Rig(device=mock, clock=rig.clock, settings=study.device, monitor=monitor)
    found = check_device(study, made, confirmation=None, ask=None)
    if not told:
        end_check(found)
        return
    with pytest.raises(CommandError) as ended:
        end_check(found)
    words = str(ended.value)
    assert words.startswith("the monitor does not verify the bursts: left: ")
    assert told in words
    assert ended.value.exit_code == 1
    assert ("exact with" in device_findings(found).text) == ("silent" not in told)


@pytest.mark.parametrize(
    ("side", "delay_ms", "fault"),
    [
        ("left", 20, ()),
        ("left", 10, ("early",)),
        ("right", 10, ()),
        ("right", 20, ("late",)),
        ("both", 10, ()),
        ("both", 20, ("late",)),
    ],
)
def test_a_device_has_a_delay_for_each_side(
    side: str, delay_ms: float, fault: tuple[str, ...]
) -> None:
    text = BY_ITSELF.format(tap="amplifier", gain=1) + "delay_ms = [20, 10]"
    study, clock = study_from_text(text, "study.toml"), VirtualClock()
    adc = Adc(delay_us=1e3 * delay_ms)
    mock = MockDevice(clock, limits=host_limits(study.device), adc=adc)
    monitor = make_monitor(study.monitor, mock, clock, None)
    assert monitor is not None
    condition = study.conditions[0]
    mock.open()
    load_condition(mock, condition, study.device)
    mock.enable()
    mock.set_levels(20.0, 20.0)
    mock.arm(1, SLOTS[side], time_to_live_s=1.0)
    monitor.begin(1, planned_burst(condition, study.device, (1, 1), side=side, level_vpp=20.0))
    assert monitor.end(mock.fire(1)).faults == fault


@pytest.fixture
def measured(tmp_path: Path) -> ByItself:
    """A session that was measured and has ended."""
    rig = ByItself(tmp_path / "results")
    assert rig.begin().finished
    return rig


def test_a_sealed_table_of_what_was_measured_is_read_as_the_journal_tells_it(
    measured: ByItself, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, whole = unaltered(measured.folder.path), examine(measured.folder.path)
    assert whole.history
    assert found == replace(whole, history=None)
    monkeypatch.setattr("experiment.integrity.sessions.replay", None)
    (progress,) = read_inputs([measured.folder.root]).progress
    assert progress.measured == whole.history.measured != ()


def edited(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b"amplifier", b"line", 1))


def of_another(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b",01,", b",02,"))


@pytest.mark.parametrize(
    ("change", "line"),
    [(edited, 2), (of_another, 2), (Path.unlink, None), (lambda path: path.write_bytes(b""), 1)],
)
def test_an_analysis_names_another_measured_csv_and_export_builds_it(
    measured: ByItself, run: Run, change: Callable[[Path], object], line: int | None
) -> None:
    path = measured.folder.measured_path
    written = path.read_bytes()
    change(path)
    place = re.escape(str(path) if line is None else f"{path}:{line}")
    with pytest.raises(ResultFileError, match=f"^{place}: .*export DIR builds it anew"):
        read_inputs([measured.folder.root])
    done = run("export", measured.folder.root)
    assert (done.exit_code, path.read_bytes()) == (0, written)
    assert done.stdout.splitlines() == [str(measured.folder.trials_path), str(path)]
    assert done.stderr.splitlines()[0].startswith(f"{path}")
    assert done.stderr.splitlines()[0].endswith("it is built anew")
    assert not read_inputs([measured.folder.root]).altered


def test_a_measured_csv_that_no_checksum_seals_is_compared(measured: ByItself) -> None:
    path, heads = measured.folder.journal_path, measured.folder.path.parent / "sessions.tsv"
    lines = path.read_bytes().splitlines()
    lines[-1] = re.sub(b',"measured_sha256":"[0-9a-f]+"', b"", lines[-1])
    path.write_bytes(chained(lines))
    head = read_journal(path).head_sha256
    heads.write_text(re.sub("[0-9a-f]{64}", head, heads.read_text("utf-8")), encoding="utf-8")
    assert unaltered(measured.folder.path) is None
    assert examine(measured.folder.path).differences == ()
