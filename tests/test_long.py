"""What takes minutes by itself: `make long`. TACTSTRIP_LONG=0.1 runs a seeded tenth of each."""

from __future__ import annotations

import csv
import json
import math
import os
import signal
import time
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from click.testing import CliRunner

from analysis import ResultFileError, read_trials
from analysis.answers.intervals import group_interval
from benchmarks.calibration import BETWEEN_DB, SETTINGS, SIGMA, Setting, ours
from device.core.core import DeviceCore
from device.core.messages import Ping
from device.core.output import Emission, OutputStage
from device.driver import Identity
from device.limits import Limits
from device.wire import codec
from device.wire.endpoint import Endpoint
from device.wire.frames import Decoder, Frame, encode
from experiment.archive.folders import SessionFolder
from experiment.archive.journal import JournalError, RecordSchemaError, read_journal
from experiment.integrity.sessions import FILES, examine
from experiment.session.simulate import simulate_study
from experiment.study.study import StudyError
from tactstrip import main
from tests.test_experiment.sessions import Sessions
from tests.test_experiment.test_terminal import Terminal

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.study.study import Study

pytestmark = pytest.mark.long

SHARE = float(os.environ.get("TACTSTRIP_LONG", "1"))
GOLDEN = json.loads((Path(__file__).parent / "golden_frames.json").read_text(encoding="utf-8"))
CHANGES = ((os, ("write", "fsync", "unlink", "rmdir", "mkdir")), (Path, ("replace", "rename")))
NASTY = (
    *(b"", b"\0", b"\xff\xfe", b"\r\n", b'"', b"n/a", b"-1", b"1e999", b"nan", b"["),
    "\u202e".encode(),
)


def rounds(most: int) -> int:
    """How many of so many rounds are run; each draws from its own number."""
    return max(1, math.ceil(SHARE * most))


def damaged(raw: bytes, rng: np.random.Generator) -> bytes:
    """Change, cut, repeat or insert something in one place, or in a few."""
    if rng.random() < 0.2:
        return raw[: rng.integers(len(raw))]
    for _ in range(rng.integers(1, 3)):
        at, end = sorted(rng.integers(0, len(raw) + 1, 2).tolist())
        end = min(end, at + 40)
        some = bytes(rng.integers(0, 256, 3, dtype=np.uint8))
        put = (NASTY[rng.integers(len(NASTY))], some, raw[at:end] * 2, b"")[rng.integers(4)]
        raw = raw[:at] + put + raw[end:]
    return raw


# --- calibration


@pytest.mark.parametrize("setting", SETTINGS, ids=lambda s: f"{s.name}-{s.guess_rate}")
def test_limits_of_thresholds_cover_them(setting: Setting) -> None:
    found = ours(setting, setting.counts(rounds(4000)))
    truth = math.log10(setting.threshold_vpp)
    covered = (found[:, 0] <= truth) & (truth <= found[:, 2])
    slack = 4 * math.sqrt(0.05 * 0.95 / len(covered))
    print(f"{setting.name}, gamma {setting.guess_rate}: {covered.mean():.1%} of {len(covered)}")
    assert 0.91 - slack <= covered.mean() <= 0.99 + slack


@pytest.mark.parametrize("level_vpp", [60.0, 95.0])
def test_intervals_of_groups_cover_their_probability(level_vpp: float) -> None:
    rng = np.random.default_rng(3)
    x = math.log10(level_vpp / 70)
    offsets = BETWEEN_DB / 20 * rng.standard_normal((rounds(20_000), 5))
    p = np.array([[math.erfc(-v / math.sqrt(2)) / 2 for v in row] for row in (x + offsets) / SIGMA])
    truth = math.erfc(-x / math.hypot(SIGMA, BETWEEN_DB / 20) / math.sqrt(2)) / 2
    limits = np.array([group_interval(k, [30] * 5) for k in rng.binomial(30, p)])
    covered = (limits[:, 0] <= truth) & (truth <= limits[:, 1])
    print(f"{level_vpp} V: {covered.mean():.1%} of {len(covered)}")
    assert covered.mean() >= 0.91 - 4 * math.sqrt(0.05 * 0.95 / len(covered))


# --- kills


def killed(step: int, *arguments: str) -> bool:
    """Run a command in a copy of this process, killed before its n-th change of the disk."""
    pid = os.fork()
    if pid:
        status = os.waitpid(pid, 0)[1]
        assert os.WIFSIGNALED(status) or os.waitstatus_to_exitcode(status) == 0, arguments
        return os.WIFSIGNALED(status)
    left = step

    def counted(change: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            nonlocal left
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return change(*args, **kwargs)

        return call

    for owner, names in CHANGES:
        for name in names:
            setattr(owner, name, counted(getattr(owner, name)))
    os._exit(CliRunner().invoke(main, arguments).exit_code)


def test_a_session_killed_thousands_of_times_loses_and_doubles_nothing(
    tmp_path: Path, quick_study_text: str
) -> None:
    (tmp_path / "study.toml").write_text(quick_study_text, encoding="utf-8")
    kills = session = 0
    while kills < rounds(2000):
        session += 1
        rng = np.random.default_rng(session)
        out = tmp_path / f"results-{session}"
        run = ["run", str(tmp_path / "study.toml"), "--participant", "01", "--out", str(out)]
        run += ["--responder", "simulated"]
        folder = SessionFolder(out, "01", "01")
        answered: dict[tuple[object, object], object] = {}
        more = ["--seed", str(session)]
        while killed(int(rng.integers(1, 40)), *run, *more):
            kills += 1
            if folder.plan_path.exists():
                more = ["--resume"]
                amiss = examine(folder.path).differences
                assert {one.mended_by for one in amiss} <= {"resume"}, amiss
            if folder.journal_path.exists():
                for entry in read_journal(folder.journal_path).entries:
                    if entry.event == "response":
                        key = (entry.facts["trial"], entry.facts["attempt"])
                        answered[key] = entry.facts["response"]
        with (folder.path / "trials.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert examine(folder.path).differences == ()
        ok = Counter(int(row["trial"]) for row in rows if row["status"] == "ok")
        assert ok == {trial.number: 1 for trial in folder.read_plan().trials}
        said = {(int(r["trial"]), int(r["attempt"])): r["response"] for r in rows}
        assert answered.items() <= said.items()
    print(f"{kills} kills in {session} sessions")


STEPS = {b"Enter goes on": b"\n", b" ?": b"\x1b[D"}
"""What a person at the terminal does about what is shown."""


def sat_through(terminal: Terminal, kill_at_s: float) -> int | None:
    """Press what is asked for; kill the process at a time, or return how it ended before."""
    done = 0
    while time.monotonic() < kill_at_s:
        if not terminal.read(min(kill_at_s, time.monotonic() + 0.1)):
            ended = terminal.process.poll()
            if ended is not None:
                return ended
        for place, asked in sorted(
            (place, asked)
            for asked in STEPS
            if (place := terminal.shown.find(asked, done)) >= 0
        ):  # fmt: skip
            time.sleep(0.11 if asked == b" ?" else 0.0)
            terminal.press(STEPS[asked])
            done = place + len(asked)
    terminal.process.kill()
    return None


def test_a_person_at_a_terminal_who_is_killed_again_and_again_loses_nothing(
    tmp_path: Path, quick_study_text: str
) -> None:
    """With the chain of hashes and markers on; killed at any time, not only at the disk's."""
    kills = number = 0
    while kills < rounds(60):
        number += 1
        rng = np.random.default_rng(number)
        text = quick_study_text + 'minimum_break_s = 0\n[masking]\nnoise = "none"\n'
        sessions = Sessions(tmp_path / f"{number}", text)
        folder = sessions.folder()
        more = ["--seed", str(number)]
        ended = None
        while ended is None:
            with Terminal(sessions, "--lsl", *more) as terminal:
                ended = sat_through(terminal, time.monotonic() + rng.uniform(0.8, 2.5))
            kills += ended is None
            if folder.plan_path.exists():
                more = ["--resume"]
                amiss = examine(folder.path).differences
                assert {one.mended_by for one in amiss} <= {"resume"}, amiss
        assert ended == 0
        assert examine(folder.path).differences == ()
        rows = sessions.rows()
        ok = Counter(int(row["trial"]) for row in rows if row["status"] == "ok")
        planned = {trial.number for trial in folder.read_plan().trials}
        assert {trial: n for trial, n in ok.items() if trial in planned} == dict.fromkeys(
            planned, 1
        )
    print(f"{kills} kills in {number} sessions at a terminal")


# --- fuzzing


def refused(
    raw: bytes, most: int, read: Callable[[bytes], object], error: type[Exception]
) -> list[str]:
    """Read damaged bytes and return what is said of those that are refused."""
    told = []
    for number in range(rounds(most)):
        try:
            read(damaged(raw, np.random.default_rng(number)))
        except error as refusal:
            told.append(str(refusal))
    print(f"{len(told)} of {rounds(most)} refused")
    assert told
    return told


def test_a_study_file_of_any_text_is_read_or_refused(
    tmp_path: Path, make_study: Callable[[str], Study]
) -> None:
    path = tmp_path / "study.toml"
    assert CliRunner().invoke(main, ["init", str(path)]).exit_code == 0

    def read(raw: bytes) -> None:
        make_study(raw.decode(errors="replace"))

    told = refused(path.read_bytes(), 20_000, read, StudyError)
    assert all("study.toml" in line for line in told)


@pytest.fixture
def simulated(
    tmp_path: Path, quick_study_text: str, make_study: Callable[[str], Study]
) -> SessionFolder:
    """A session of a simulated participant."""
    list(simulate_study(make_study(quick_study_text), tmp_path, participants=1, seed=7))
    return SessionFolder(tmp_path, "01", "01")


def test_a_journal_of_any_bytes_is_a_beginning_or_refused(simulated: SessionFolder) -> None:
    path = simulated.journal_path
    whole = read_journal(path).entries

    def read(raw: bytes) -> None:
        path.write_bytes(raw)
        entries = read_journal(path).entries
        assert entries == whole[: len(entries)]

    refused(path.read_bytes(), 20_000, read, JournalError)


@pytest.mark.parametrize("name", FILES)
def test_whatever_is_changed_in_a_record_is_found(simulated: SessionFolder, name: str) -> None:
    path = simulated.path / name
    whole = path.read_bytes()
    assert examine(simulated.path).differences == ()
    for number in range(rounds(3000)):
        raw = damaged(whole, np.random.default_rng(number))
        path.write_bytes(raw)
        try:
            found = bool(examine(simulated.path).differences)
        except RecordSchemaError:
            found = True
        assert found == (raw != whole), number


def test_a_table_of_any_bytes_is_read_or_refused(simulated: SessionFolder, tmp_path: Path) -> None:
    raw, table = (simulated.path / "trials.csv").read_bytes(), tmp_path / "alone.csv"

    def read(raw: bytes) -> int:
        table.write_bytes(raw)
        return len(read_trials([table]))

    assert read(raw) == 5
    assert all("alone.csv" in line for line in refused(raw, 10_000, read, ResultFileError))


def test_an_endpoint_of_any_bytes_emits_nothing_above_its_ceiling() -> None:
    facts = GOLDEN["device"]
    questions = [bytes.fromhex(step["question"]) for step in GOLDEN["exchanges"]]
    for number in range(rounds(20_000)):
        rng = np.random.default_rng(number)
        emitted: list[Emission] = []
        output = OutputStage(sample_rate_hz=facts["sample_rate_hz"], bits=facts["bits"])
        limits = Limits(
            ceiling_vpp=facts["ceiling_vpp"], least_interval_s=facts["least_interval_s"]
        )
        core = DeviceCore(
            boot_id=facts["boot_id"], limits=limits, output=output, sink=emitted.append
        )
        identity = Identity(
            model="fuzzed",
            serial_number="1",
            boot_id=core.boot_id,
            protocol_version="1.0",
            sample_rate_hz=facts["sample_rate_hz"],
            bits=facts["bits"],
            channels=2,
            ceiling_vpp=limits.ceiling_vpp,
            longest_waveform=limits.longest_waveform,
            emulated=True,
        )
        device, now_us = Endpoint(core, identity), 0
        for question in questions:
            now_us += int(rng.integers(1, 50_000))
            device.receive(now_us, damaged(question, rng) if rng.random() < 0.3 else question)
        ping = encode(Frame(kind=2, sequence=1, payload=codec.payload(Ping(), core.boot_id)))
        device.receive(now_us + 1, b"\0")  # ends what the last question may have left open
        assert len(Decoder().feed(device.receive(now_us + 2, ping))) == 1
        for burst in emitted:
            for volts in (burst.left_v, burst.right_v):
                assert np.abs(volts).max(initial=0.0) <= facts["ceiling_vpp"] / 2, number
