"""Whole sessions over emulators in processes of their own: what is said is what came out."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import ExitStack
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

import device.emulate.generator
from device.driver import installing
from device.emulate.generator import GeneratorEmulator
from device.emulate.lines import TcpLine
from experiment.apparatus.rig import assemble
from experiment.study.study import StudyError
from tests.test_device.buses import BUSES, Instrument
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from click.testing import Result

    from experiment.study.study import Study
    from tests.conftest import Run

    Start: TypeAlias = Callable[..., tuple[subprocess.Popen[str], str]]

HANN = '[burst]\nwindow = "hann"\n'
QUICK = f"""
{HANN}[device]
least_interval_s = 0.01
amplifier_gain = 27.5
volts_full_scale = 110
[simulation]
reaction_time_s = 0.151
reaction_time_spread = 0
"""
PAPER = QUICK + "[design]\nforeperiod_s = [0.01, 0.02]\nminimum_break_s = 0\n"
SHORT = PAPER + "trials_per_side = 5\nboth_trials = 1\nbreak_every = 6\n"
MEASURED = (
    SHORT
    + """
[monitor]
source = "device"
tap = "amplifier"
per_unit = [1.25, 1.25]
delay_ms = [0.1, 0.1]
"""
)
ADC = "gain=0.8,delay_us=100,noise=300"
REFUSED = 3, "the amplifier is off: its safety switch is open"
SILENT = 4, "monitor (amplifier): the burst was silent; put it right, then go on"
TINY = PAPER + "trials_per_side = 1\nboth_trials = 1\nbreak_every = 3\n"
LINES = {"pty": ("--pty",), "tcp": ("--tcp", "0")}
GENERATOR = ("--tcp", "0", "--generator", "keysight", "--amplifier-gain", "27.5")
SOON_S = 60.0
MILLISECOND_S = 0.001


@pytest.fixture
def tiny(tmp_path: Path) -> Sessions:
    return Sessions(tmp_path, TINY)


@pytest.fixture
def short(tmp_path: Path) -> Sessions:
    return Sessions(tmp_path, SHORT)


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    return tmp_path / "truth.jsonl"


@pytest.fixture
def start() -> Iterator[Start]:
    """Start `tactstrip emulate`; returns the process and its port. All are killed at the end."""
    with ExitStack() as processes:

        def started(*options: str, truth: Path | None = None) -> tuple[subprocess.Popen[str], str]:
            told = [] if truth is None else ["--truth", str(truth)]
            command = [*COMMAND, "emulate", *options, *told]
            pipe = subprocess.PIPE
            process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
            processes.enter_context(process)
            processes.callback(process.kill)
            assert process.stdout is not None
            return process, process.stdout.readline().strip()

        yield started


def over(driver: str, port: str, *more: str) -> list[str]:
    return ["--responder", "simulated", "--driver", driver, "--port", port, *more]


def events_of(truth: Path) -> list[dict[str, Any]]:
    lines = truth.read_text(encoding="utf-8").splitlines(keepends=True) if truth.exists() else []
    whole = [line for line in lines if line.endswith("\n")]
    # A reset may tear the line of a burst that has ended; the next one then tells of the start.
    torn = [one for one, after in pairwise(whole) if not one.endswith("}\n") and '"boot"' in after]
    return [json.loads(line) for line in whole if line not in torn]


def bursts_of(truth: Path) -> list[dict[str, Any]]:
    return [event for event in events_of(truth) if event["event"] == "burst"]


def wait_for_bursts(truth: Path, count: int, process: subprocess.Popen[Any]) -> None:
    give_up_s = time.monotonic() + SOON_S
    while len(bursts_of(truth)) < count:
        assert process.poll() is None
        assert time.monotonic() < give_up_s
        time.sleep(0.003)


def require_true(sessions: Sessions, truth: Path, session: str = "01") -> Counter[str]:
    """Join journal and truth by token: the journal says what came out, or that nobody knows."""
    armed: dict[int, tuple[int, int]] = {}
    told: dict[tuple[int, int], dict[str, Any]] = {}
    ended: dict[tuple[int, int], str] = {}
    for entry in sessions.entries(session=session):
        facts: Any = entry.facts
        if entry.event == "trial_armed":
            armed[facts["token"]] = facts["trial"], facts["attempt"]
        elif entry.event == "stimulus_confirmed":
            told[facts["trial"], facts["attempt"]] = facts
        elif entry.event == "trial_end":
            ended[facts["trial"], facts["attempt"]] = facts["status"]
    assert len(set(armed.values())) == len(armed)  # an attempt is armed once
    burst_of = {burst["token"]: burst for burst in bursts_of(truth)}
    assert len(burst_of) == len(bursts_of(truth))  # a token fires once
    for token, attempt in armed.items():
        outcome = told.get(attempt, {}).get("outcome")
        if outcome == "fired":
            burst, facts = burst_of[token], told[attempt]
            levels_vpp = facts["level_left_vpp"], facts["level_right_vpp"]
            assert burst["levels_mv"] == [round(1000 * level_vpp) for level_vpp in levels_vpp]
            assert ended[attempt] in {"ok", "voided"}
        elif ended[attempt] != "indeterminate":
            assert token not in burst_of
            assert ended[attempt] in {"device_error", "aborted"}
    answered = Counter(trial for (trial, _), status in ended.items() if status == "ok")
    planned = sessions.folder(session).read_plan().trials
    assert answered == Counter(trial.number for trial in planned)
    return Counter(ended.values())


def require_true_by_time(sessions: Sessions, truth: Path) -> Counter[str]:
    """Join journal and truth by the calendar's clock: a generator knows no tokens."""
    bursts = bursts_of(truth)
    armed_s, told_vpp, ended = 0.0, None, Counter[str]()
    for entry in sessions.entries():
        facts: Any = entry.facts
        if entry.event == "trial_armed":
            armed_s, told_vpp = entry.wall_s, None
        elif entry.event == "stimulus_confirmed" and facts["outcome"] == "fired":
            told_vpp = facts["level_left_vpp"], facts["level_right_vpp"]
        elif entry.event == "trial_end":
            latest_s = entry.wall_s + MILLISECOND_S
            during = [b for b in bursts if armed_s - MILLISECOND_S < b["wall_s"] < latest_s]
            levels_mv = [burst["levels_mv"] for burst in during]
            if told_vpp is not None:
                assert levels_mv == [[round(1000 * level_vpp) for level_vpp in told_vpp]]
            else:
                assert len(during) <= (facts["status"] == "indeterminate")
            bursts = [burst for burst in bursts if burst not in during]
            ended[facts["status"]] += 1
    assert not bursts
    return ended


def finish(sessions: Sessions, *options: str, session: str = "01") -> int:
    """Run a session to its end through every failure of the device; return how many there were."""
    for failures in range(100):
        again = ["--resume"] if sessions.folder(session).plan_path.exists() else []
        result = sessions.run(*options, "--session", session, *again)
        if result.exit_code == 0:
            return failures
        assert result.exit_code == 3, result.output
        assert len(result.stderr.splitlines()) == 1
    pytest.fail("it never came to its end")


def require_cut_told_and_mended(
    sessions: Sessions, truth: Path, board: subprocess.Popen[str], port: str, *, sensed: bool
) -> None:
    """Open the amplifier's switch in mid-session: told, no trial counts, and it goes on after."""
    options = over("serial", port, "--seed", "7")

    def move_switch(word: str, n_moves: int) -> None:
        assert board.stdin is not None
        board.stdin.write(f"{word}\n")
        board.stdin.flush()
        while len(moves_s(truth)) < n_moves:
            assert board.poll() is None
            time.sleep(0.003)

    command = [*COMMAND, *sessions.words(*options)]
    pipe, into_it = subprocess.PIPE, subprocess.STDOUT
    with subprocess.Popen(command, stdout=pipe, stderr=into_it, text=True) as host:
        wait_for_bursts(truth, 4, host)
        move_switch("open", 1)
        told, _ = host.communicate(timeout=SOON_S)
    ends = [(host.returncode, told)]
    code, words = REFUSED if sensed else SILENT
    for _ in range(10):
        still = sessions.run(*options, "--resume")
        ends.append((still.exit_code, still.output))
        if still.exit_code == code and words in still.output:
            break  # else a busy machine ended it
    assert words in ends[-1][1], ends
    assert {end for end, _ in ends} <= {3, 4}
    move_switch("closed", 2)
    finish(sessions, *options)
    rows = sessions.rows()
    good = [row for row in rows if row["status"] == "ok"]
    assert {row["burst_verified"] for row in good} == {"amplifier"}
    planned = sessions.folder().read_plan().trials
    assert sorted(int(row["trial"]) for row in good) == [trial.number for trial in planned]
    opened_s, closed_s = moves_s(truth)
    unfelt = {burst["token"] for burst in bursts_of(truth) if opened_s < burst["t_s"] < closed_s}
    assert bool(unfelt) != sensed
    tokens = {
        (str(facts["trial"]), str(facts["attempt"])): facts["token"]
        for facts in (dict(entry.facts) for entry in sessions.entries("trial_armed"))
    }
    assert not unfelt & {tokens[row["trial"], row["attempt"]] for row in good}
    assert len(good) < len(rows)


def moves_s(truth: Path) -> list[float]:
    return [event["t_s"] for event in events_of(truth) if event["event"] == "switch"]


@pytest.mark.process
@pytest.mark.parametrize("sensed", [True, False])
def test_a_switch_that_opens_in_mid_session_is_told_and_what_nobody_felt_is_played_again(
    tmp_path: Path, truth: Path, start: Start, *, sensed: bool
) -> None:
    more = [] if sensed else ["--unsensed"]
    adc = ("--adc", ADC, "--switch-stdin")
    board, port = start(*LINES["tcp"], *adc, *more, truth=truth)
    sessions = Sessions(tmp_path / "host", MEASURED)
    require_cut_told_and_mended(sessions, truth, board, port, sensed=sensed)


def as_visa(url: str) -> str:
    """Return the name of a socket as a VISA resource."""
    host, port = url.removeprefix("socket://").split(":")
    return f"visa:TCPIP::{host}::{port}::SOCKET"


ANSWERS = ("trial", "kind", "side", "level_vpp", "response", "rt_s", "correct", "foreperiod_s")


def answers_of(sessions: Sessions) -> dict[str, list[str]]:
    """Return what the first attempt at each trial came to, where it was answered."""
    return {
        row["trial"]: [row[column] for column in ANSWERS]
        for row in sessions.rows()
        if row["status"] == "ok" and row["attempt"] == "1"
    }


@pytest.mark.slow
def test_a_whole_session_gives_the_same_answers_over_every_link(
    tmp_path: Path, start: Start
) -> None:
    mock = Sessions(tmp_path / "mock", PAPER)
    assert mock.run("--responder", "simulated", "--seed", "7").exit_code == 0
    expected = answers_of(mock)
    assert len(expected) == 155
    links = {
        "pty": ("serial", LINES["pty"]),
        "tcp": ("serial", LINES["tcp"]),
        "scpi": ("generator", GENERATOR),
        "visa": ("generator", GENERATOR),
    }
    hosts = []
    for name, (driver, line) in links.items():
        sessions, truth = Sessions(tmp_path / name, PAPER), tmp_path / f"{name}.jsonl"
        _, port = start(*line, truth=truth)
        options = over(driver, as_visa(port) if name == "visa" else port)
        host = subprocess.Popen([*COMMAND, *sessions.words(*options, "--seed", "7")])
        hosts.append((sessions, truth, options, host))
    for sessions, truth, options, host in hosts:
        if host.wait() != 0:  # the machine stood still for longer than the watchdog waits
            finish(sessions, *options)
        repeated = {row["trial"] for row in sessions.rows() if row["attempt"] != "1"}
        found = answers_of(sessions)
        assert set(found) == set(expected) - repeated
        assert found == {trial: expected[trial] for trial in found}
        assert len(bursts_of(truth)) >= 155
        if "generator" in options:
            require_true_by_time(sessions, truth)
        else:
            assert require_true(sessions, truth)["ok"] == 155


@pytest.mark.process
@pytest.mark.parametrize("kind", LINES)
def test_an_emulator_that_dies_in_mid_session_costs_no_trial_and_no_truth(
    kind: str, short: Sessions, truth: Path, start: Start
) -> None:
    emulator, port = start(*LINES[kind], truth=truth)

    def unplug() -> None:
        wait_for_bursts(truth, 5, emulator)
        emulator.kill()

    killer = threading.Thread(target=unplug)
    killer.start()
    result = short.run(*over("serial", port))
    killer.join()
    assert result.exit_code == 3
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.endswith(" --resume\n")
    assert 4 <= sum(row["status"] == "ok" for row in short.rows()) < 11
    _, port = start("--pty", "--serial-number", "2")
    other = short.run(*over("serial", port, "--resume"))
    assert other.exit_code == 2
    assert "serial_number '1'; got '2': give --resume-anyway" in other.stderr
    _, port = start(*LINES[kind], truth=truth)
    finish(short, *over("serial", port))
    require_true(short, truth)


@pytest.mark.process
def test_a_device_that_resets_on_a_bad_line_costs_nothing(
    short: Sessions, truth: Path, start: Start
) -> None:
    faults = "reset=0.01,drop=0.002,corrupt=0.002"
    _, port = start("--pty", "--fault", faults, "--seed", "5", truth=truth)
    failures = 0
    for number in range(1, 21):
        failures += finish(short, *over("serial", port), session=f"{number:02d}")
        boots = sum(event["event"] == "boot" for event in events_of(truth))
        if boots > 1 and failures:
            break
    else:
        pytest.fail("no reset in twenty sessions")
    tokens = [burst["token"] for burst in bursts_of(truth)]
    assert len(tokens) == len(set(tokens))
    for done in range(1, number + 1):
        require_true(short, truth, f"{done:02d}")


@pytest.mark.process
@pytest.mark.parametrize("named", [str, as_visa])
def test_a_generator_on_a_line_that_breaks_costs_nothing(
    named: Callable[[str], str], short: Sessions, truth: Path, start: Start
) -> None:
    faults = ("--fault", "disconnect_at=6000,reset=0.003,delay=0.02", "--seed", "3")
    _, port = start(*GENERATOR, *faults, truth=truth)
    assert finish(short, *over("generator", named(port))) > 0
    assert require_true_by_time(short, truth)["ok"] == 11


@pytest.mark.process
@pytest.mark.parametrize("kind", BUSES)
def test_a_session_over_visa_says_what_came_out(
    kind: str, short: Sessions, truth: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    instrument = Instrument(BUSES[kind](monkeypatch), gain=27.5)
    try:
        result = short.run(*over("generator", instrument.name))
    finally:
        instrument.close()
    assert result.exit_code == 0, result.output
    truth.write_text(instrument.truth.getvalue(), encoding="utf-8")
    assert require_true_by_time(short, truth) == {"ok": 11}


@pytest.mark.parametrize("command", ["run", "check"])
def test_visa_without_its_extra_is_one_line(
    command: str, short: Sessions, check: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyvisa", None)
    words = ("--driver", "generator", "--port", "visa:TCPIP::lab::INSTR")
    if command == "run":
        result = short.run("--responder", "simulated", *words)
    else:
        result = check("--device", *words)
    assert result.exit_code == 3
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.endswith(f"VISA needs pyvisa: {installing('visa')}\n")
    assert not short.folder().path.exists()


@pytest.mark.process
@pytest.mark.parametrize("kind", LINES)
def test_a_killed_host_doubles_nothing(
    kind: str, short: Sessions, truth: Path, start: Start
) -> None:
    _, port = start(*LINES[kind], truth=truth)
    for count, again in ((3, []), (7, ["--resume"])):
        command = [*COMMAND, *short.words(*over("serial", port, *again))]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as host:
            wait_for_bursts(truth, count, host)
            os.kill(host.pid, signal.SIGKILL)
    finish(short, *over("serial", port))
    assert [event["event"] for event in events_of(truth)].count("off") >= 3
    assert require_true(short, truth)["ok"] == 11


@pytest.mark.process
def test_an_answer_in_real_time_takes_its_reaction_time(tiny: Sessions, start: Start) -> None:
    _, port = start("--pty")
    began_s = time.monotonic()
    assert tiny.run(*over("serial", port)).exit_code == 0
    assert time.monotonic() - began_s > 3 * 0.151
    onsets_s = [float(row["onset_s"]) for row in tiny.rows()]
    assert all(later - earlier > 0.151 for earlier, later in pairwise(onsets_s))


class RealGenerator:
    """A generator that does not say that it is emulated, and keeps what it was sent."""

    def __init__(self, truth: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(
            device.emulate.generator, "IDENTITY", "Keysight Technologies,33512B,MY01,1.0"
        )
        self.line = TcpLine(0)
        self.port = self.line.name
        self.received = b""
        self._read = self.line.read
        monkeypatch.setattr(self.line, "read", self._keep)
        self._over = threading.Event()
        self.truth = truth
        self._file = truth.open("w", encoding="utf-8")
        self._emulator = GeneratorEmulator(self.line, self._file, amplifier_gain=27.5)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _keep(self, timeout_s: float) -> bytes | None:
        data = self._read(timeout_s)
        self.received += data or b""
        return data

    def _serve(self) -> None:
        while not self._over.is_set():
            self._emulator.turn()

    def end(self) -> None:
        self._over.set()
        self._thread.join()
        self.line.close()
        self._file.close()


@pytest.fixture
def real(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RealGenerator]:
    generator = RealGenerator(tmp_path / "real.jsonl", monkeypatch)
    yield generator
    generator.end()


@pytest.mark.process
@pytest.mark.parametrize("command", ["run", "check"])
def test_without_a_word_for_its_safety_a_real_device_is_sent_nothing(
    command: str, tiny: Sessions, run: Run, real: RealGenerator
) -> None:
    reached = ("--driver", "generator", "--port", real.port)
    if command == "run":
        result = tiny.run("--responder", "simulated", *reached)
    else:
        result = run("check", tiny.study, "--device", *reached)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert "--confirm-hardware" in result.stderr
    assert set(real.received.split()) == {b"*IDN?"}
    assert not tiny.out.exists()


@pytest.mark.process
def test_a_word_for_its_safety_is_kept_with_what_it_cannot_promise(
    tiny: Sessions, real: RealGenerator
) -> None:
    result = tiny.run(*over("generator", real.port, "--confirm-hardware"))
    assert result.exit_code == 0, result.stderr
    first = "this device cannot bring its outputs to zero when this program or the line to it dies"
    assert first in result.stdout
    header = tiny.header()
    assert len(header["device_cannot"]) == result.stdout.count("Note: this device cannot ") == 3
    confirmed = header["hardware_confirmed"]
    assert confirmed["how"] == "--confirm-hardware"
    assert confirmed["by"]
    assert confirmed["at"].endswith("+00:00")
    assert len(confirmed["confirmed"]) == 3


@pytest.fixture
def on_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("experiment.commands.options.hardware.on_terminal", lambda: True)


@pytest.mark.process
@pytest.mark.usefixtures("on_terminal")
@pytest.mark.parametrize(("answers", "exit_code"), [("y\n", 0), ("n\n", 2), ("", 2)])
def test_the_operator_is_asked_once_on_a_terminal(
    answers: str, exit_code: int, tiny: Sessions, real: RealGenerator
) -> None:
    result = tiny.run(*over("generator", real.port), typed=answers)
    assert result.exit_code == exit_code, result.stderr
    assert result.stderr.count("All of it is so?") == 1
    assert tiny.out.exists() == (exit_code == 0)
    assert (b"OUTP" in real.received.upper()) == (exit_code == 0)


@pytest.mark.process
@pytest.mark.parametrize("given", [(), ("--confirm-hardware",)])
def test_an_emulator_is_not_asked_about_and_says_so_in_the_header(
    given: tuple[str, ...], tiny: Sessions, start: Start
) -> None:
    _, port = start("--pty")
    assert tiny.run(*over("serial", port, *given)).exit_code == 0
    assert {row["device_kind"] for row in tiny.rows()} == {"emulated"}
    tiny.practice = False
    person = ("--responder", "terminal", "--driver", "serial", "--port", port, "--session", "02")
    refused = tiny.run(*person, *given)  # before it is seen that there is no terminal
    assert (refused.exit_code, "emulator" in refused.stderr) == (2, True)
    assert not tiny.folder("02").path.exists()
    header = tiny.header()
    assert (header["hardware_confirmed"], header["device_cannot"]) == ("n/a", [])
    assert header["device_identity"]["emulated"] is True


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        (HANN, ["--driver", "serial"], "device.port is missing"),
        (HANN, ["--driver", "generator", "--port", "p"], "device.amplifier_gain is missing"),
        (HANN, ["--driver", "audio", "--port", "p"], "device.volts_full_scale is missing"),
        (TINY, ["--driver", "audio", "--port", "such"], "--confirm-hardware"),
    ],
)
def test_what_a_driver_lacks_is_said_before_anything_is_opened(
    text: str, options: list[str], told: str, tmp_path: Path
) -> None:
    result = Sessions(tmp_path, text).run("--responder", "simulated", *options)
    assert result.exit_code == 2
    assert told in result.stderr


@pytest.mark.process
def test_the_study_names_driver_and_port_and_options_others(tiny: Sessions, start: Start) -> None:
    _, port = start("--pty")
    named = TINY.replace("[device]", f'[device]\ndriver = "serial"\nport = "{port}"')
    tiny.write(named)
    result = tiny.run("--responder", "simulated")
    assert result.exit_code == 0, result.stderr
    tiny.write(named.replace(port, "/no/such/port"))
    second = ("--responder", "simulated", "--session", "02")
    result = tiny.run(*second)
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert not tiny.folder("02").plan_path.exists()
    assert tiny.run(*second, "--port", port).exit_code == 0


@pytest.mark.process
def test_the_mocks_ceiling_is_none_of_another_devices(
    tiny: Sessions, truth: Path, start: Start, run: Run
) -> None:
    loud = TINY.replace("[device]", "[device]\nceiling_vpp = 260") + "levels_vpp = [60, 250]\n"
    tiny.write(loud.replace("trials_per_side = 1", "trials_per_side = 2"))
    refused = tiny.run("--responder", "simulated")
    assert (refused.exit_code, "own ceiling, 200 Vpp" in refused.stderr) == (2, True)
    _, port = start("--tcp", "0", "--ceiling-vpp", "260", truth=truth)
    assert run("check", tiny.study, "--device", "--driver", "serial", "--port", port).exit_code == 0
    result = tiny.run(*over("serial", port, "--seed", "1"))
    assert result.exit_code == 0, result.stderr
    assert 250_000 in {level for burst in bursts_of(truth) for level in burst["levels_mv"]}


@pytest.fixture
def check(tmp_path: Path, run: Run) -> Run:
    """Check a study, and the device that is given."""

    def check(*options: str, typed: str | None = None) -> Result:
        return run("check", Sessions(tmp_path, QUICK).study, *options, typed=typed)

    return check


@pytest.mark.process
def test_the_check_plays_a_tenth_on_each_channel(check: Run, truth: Path, start: Start) -> None:
    _, port = start("--pty", truth=truth)
    reached = ("--device", "--driver", "serial", "--port", port)
    result = check(*reached)
    assert result.exit_code == 0, result.stderr
    assert "ceiling 200 Vpp, 48000 Hz" in result.stdout
    assert "60 95 130 165 200 Vpp" in result.stdout
    assert result.stdout.count("burst of 20 Vpp: fired, 20 Vpp read back") == 2
    assert [burst["levels_mv"] for burst in bursts_of(truth)] == [[20_000, 0], [0, 20_000]]
    assert events_of(truth)[-1]["event"] == "off"
    found = json.loads(check(*reached, "--json").stdout)
    assert [channel["good"] for channel in found["device_check"]["channels"]] == [True, True]


@pytest.mark.process
@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--sample-rate-hz", "44100"), "device.sample_rate_hz"),
        (("--ceiling-vpp", "150"), "own ceiling, 150 Vpp"),
    ],
)
def test_a_device_that_does_not_suit_the_study_ends_the_check_with_1(
    options: tuple[str, str], told: str, check: Run, truth: Path, start: Start
) -> None:
    _, port = start("--pty", *options, truth=truth)
    result = check("--device", "--driver", "serial", "--port", port)
    assert result.exit_code == 1
    assert told in result.stderr
    assert result.stdout == ""
    assert {event["event"] for event in events_of(truth)} == {"boot"}


@pytest.mark.process
@pytest.mark.usefixtures("on_terminal")
@pytest.mark.parametrize(
    ("answers", "exit_code", "told"),
    [
        ("y\n" * 5, 0, "there"),
        ("y\ny\ny\ny\nn\n", 1, "20 Vpp: fired"),
        ("y\nn\nn\n", 1, "tried"),
    ],
)
def test_each_burst_of_a_check_is_asked_for_and_confirmed(
    answers: str, exit_code: int, told: str, check: Run, real: RealGenerator
) -> None:
    result = check("--device", "--driver", "generator", "--port", real.port, typed=answers)
    assert result.exit_code == exit_code, result.stderr
    assert told in result.output
    assert len(bursts_of(real.truth)) == answers.count("y") // 2


@pytest.mark.parametrize(
    ("options", "exit_code", "told"),
    [
        (("--device", "--driver", "serial", "--port", "socket://127.0.0.1:1"), 3, "127.0.0.1:1"),
        (("--confirm-hardware",), 2, "needs --device"),
    ],
)
def test_a_check_without_a_device_says_so_in_one_line(
    options: tuple[str, ...], exit_code: int, told: str, check: Run
) -> None:
    result = check(*options)
    assert (result.exit_code, len(result.stderr.splitlines())) == (exit_code, 1)
    assert told in result.stderr
    assert result.stdout == ""


def test_noise_on_the_actuators_sound_card_is_refused(make_study: Callable[[str], Study]) -> None:
    text = 'masking = { noise = "pink", sound_card = "pulse" }\n'
    device = '[device]\ndriver = "audio"\nport = "pulse"\nvolts_full_scale = 125\n'
    study = make_study(text + device)
    with pytest.raises(StudyError, match="another"):
        assemble(study, driver=None, port=None, simulated=False)
    with pytest.raises(StudyError, match="another"):
        assemble(study, driver="mock", port=None, simulated=False)  # the noise is real
    assert assemble(study, driver=None, port=None, simulated=True).settings.driver == "audio"
