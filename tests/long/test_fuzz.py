"""What takes minutes by itself: `make long`. TACTSTRIP_LONG=0.1 runs a seeded tenth of each."""

from __future__ import annotations

import json
import math
import os
from typing import TYPE_CHECKING

import numpy as np
import pytest
from click.testing import CliRunner

from analysis import ResultFileError, read_trials
from analysis.answers.intervals import group_interval
from benchmarks.calibration import BETWEEN_DB, SCENARIOS, SIGMA, Scenario, ours
from device.core.messages import Ping
from device.core.reports import Health
from device.wire import codec
from device.wire.frames import Decoder, Frame, encode
from experiment.archive.folders import SessionFolder
from experiment.archive.journal import JournalError, RecordSchemaError, read_journal
from experiment.integrity.sessions import FILES, examine
from experiment.session.simulate import simulate_study
from experiment.study.study import StudyError
from tactstrip import main
from tests.system.differential import STEPS, compare, small_server
from tests.test_device import golden

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.core.output import Emission
    from experiment.study.study import Study

pytestmark = pytest.mark.long

SHARE = float(os.environ.get("TACTSTRIP_LONG", "1"))
GOLDEN = json.loads(golden.FILE.read_text(encoding="utf-8"))
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


@pytest.mark.parametrize(
    "scenario", SCENARIOS[:4], ids=lambda s: f"{s.levels_vpp[0]}-{s.guess_rate}"
)
def test_limits_of_thresholds_cover_them(scenario: Scenario) -> None:
    found = ours(scenario, scenario.counts(rounds(4000)))
    truth = math.log10(scenario.threshold_vpp)
    covered = (found[:, 0] <= truth) & (truth <= found[:, 2])
    slack = 4 * math.sqrt(0.05 * 0.95 / len(covered))
    print(f"{scenario.row()} {covered.mean():.1%} of {len(covered)}")
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
    questions = [bytes.fromhex(step["question"]) for step in GOLDEN["steps"] if "question" in step]
    for number in range(rounds(20_000)):
        rng = np.random.default_rng(number)
        emitted: list[Emission] = []
        device, now_us = golden.power_on(golden.Reader(golden.READING), emitted.append), 0
        core = device.core
        for question in questions:
            now_us += int(rng.integers(1, 50_000))
            device.receive(now_us, damaged(question, rng) if rng.random() < 0.3 else question)
            if rng.random() < 0.02:
                closed, over = (bool(rng.random() < share) for share in (0.8, 0.1))
                core.sense(now_us, Health(switch_closed=closed, over_current=over))
        ping = encode(Frame(kind=2, sequence=1, payload=codec.payload(Ping(), core.boot_id)))
        device.receive(now_us + 1, b"\0")  # ends what the last question may have left open
        assert len(Decoder().feed(device.receive(now_us + 2, ping))) == 1
        for burst in emitted:
            for volts in (burst.left_v, burst.right_v):
                assert np.abs(volts).max(initial=0.0) <= golden.LIMITS.ceiling_vpp / 2, number


@pytest.mark.firmware
def test_five_million_inputs_tell_firmware_and_core_not_apart(tmp_path: Path) -> None:
    with small_server(tmp_path) as server:
        for number in range(rounds(20_000)):
            compare(server, 10_000 + number)
    print(f"{rounds(20_000) * STEPS} inputs")
