"""Whole sessions over emulators in processes of their own: what is said is what came out."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from collections import Counter
from contextlib import ExitStack
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

from tests.plates import PAPER_PLATE
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Start: TypeAlias = Callable[..., tuple[subprocess.Popen[str], str]]

HANN = PAPER_PLATE + '[burst]\nwindow = "hann"\n'
QUICK = f"""
{HANN}[device]
min_interval_s = 0.01
amplifier_gain = 27.5
volts_full_scale = 110
[simulation]
reaction_time_s = 0.151
reaction_time_spread = 0
"""
PAPER = QUICK + "[design]\nforeperiod_s = [0.01, 0.02]\nmin_break_s = 0\n"
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
TINY = PAPER + "trials_per_side = 1\nboth_trials = 1\nbreak_every = 3\n"
LINES = {"pty": ("--pty",), "tcp": ("--tcp", "0")}
GENERATOR = ("--tcp", "0", "--generator", "keysight", "--amplifier-gain", "27.5")
SOON_S = 60.0
MILLISECOND_S = 0.001


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
        facts = entry.line.model_dump()
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
            levels_vpp = facts["levels_vpp"]
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
        facts = entry.line.model_dump()
        if entry.event == "trial_armed":
            armed_s, told_vpp = entry.wall_s, None
        elif entry.event == "stimulus_confirmed" and facts["outcome"] == "fired":
            told_vpp = facts["levels_vpp"]
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
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as host:
        wait_for_bursts(truth, 4, host)
        move_switch("open", 1)
        codes = [host.wait(SOON_S)]
    while len(codes) == 1 or (codes[-1] != (3 if sensed else 4) and len(codes) < 10):
        codes.append(sessions.run(*options, "--resume").exit_code)  # a busy machine may end it
    assert set(codes) <= {3, 4}
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
        for facts in sessions.lines("trial_armed")
    }
    assert not unfelt & {tokens[row["trial"], row["attempt"]] for row in good}
    assert len(good) < len(rows)


def moves_s(truth: Path) -> list[float]:
    return [event["t_s"] for event in events_of(truth) if event["event"] == "switch"]


@pytest.mark.parametrize("sensed", [True, False])
def test_a_switch_that_opens_in_mid_session_is_told_and_what_nobody_felt_is_played_again(
    tmp_path: Path, truth: Path, start: Start, *, sensed: bool
) -> None:
    more = [] if sensed else ["--unsensed"]
    adc = ("--adc", ADC, "--switch-stdin")
    board, port = start(*LINES["tcp"], *adc, *more, truth=truth)
    sessions = Sessions(tmp_path / "host", MEASURED)
    require_cut_told_and_mended(sessions, truth, board, port, sensed=sensed)


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
    }
    hosts = []
    for name, (driver, line) in links.items():
        sessions, truth = Sessions(tmp_path / name, PAPER), tmp_path / f"{name}.jsonl"
        _, port = start(*line, truth=truth)
        options = over(driver, port)
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
    assert (result.exit_code, result.stderr.count("\n")) == (3, 1)
    assert result.stderr.endswith(" --resume\n")
    assert 4 <= sum(row["status"] == "ok" for row in short.rows()) < 11
    _, port = start("--pty", "--serial-number", "2")
    other = short.run(*over("serial", port, "--resume"))
    assert (other.exit_code, "serial_number" in other.stderr) == (2, True)
    _, port = start(*LINES[kind], truth=truth)
    finish(short, *over("serial", port))
    require_true(short, truth)


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
