"""Whole sessions over emulators in processes of their own: what is said is what came out."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest
from click.testing import CliRunner, Result

import device.emulate.generator
from device.emulate.generator import GeneratorEmulator
from device.emulate.lines import TcpLine
from experiment.apparatus.rig import assemble
from experiment.archive.journal import read_journal
from experiment.study.study import StudyError
from tactstrip import main

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from experiment.study.study import Study

    Start: TypeAlias = Callable[..., tuple[subprocess.Popen[str], str]]

COMMAND = (sys.executable, "-c", "from tactstrip import main; main()")
QUICK = """
[burst]
window = "hann"
[device]
least_interval_s = 0.01
amplifier_gain = 27.5
volts_full_scale = 110
[simulation]
reaction_time_s = 0.151
reaction_time_spread = 0
"""
PAPER = QUICK + "[design]\nforeperiod_s = [0.01, 0.02]\nminimum_break_s = 0\n"
SHORT = PAPER + "trials_per_side = 5\nboth_trials = 1\nbreak_every = 6\n"
TINY = PAPER + "trials_per_side = 1\nboth_trials = 1\nbreak_every = 3\n"
SOON_S = 60.0
MILLISECOND_S = 0.001


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start `tactstrip emulate`; returns the process and its port. All are killed at the end."""
    processes: list[subprocess.Popen[str]] = []

    def started(*options: str) -> tuple[subprocess.Popen[str], str]:
        process = subprocess.Popen(
            [*COMMAND, "emulate", *options], stdout=subprocess.PIPE, text=True
        )
        processes.append(process)
        assert process.stdout is not None
        return process, process.stdout.readline().strip()

    yield started
    for process in processes:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def study_file(tmp_path: Path, text: str) -> str:
    path = tmp_path / "study.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def run_options(study: str, out: Path, *options: str) -> list[str]:
    return [
        *("run", study, "--participant", "01", "--responder", "simulated", "--out", str(out)),
        *options,
    ]


def invoke(*options: str, answers: str | None = None) -> Result:
    return CliRunner().invoke(main, list(options), input=answers)


def rows_of(out: Path, session: str = "01") -> list[dict[str, str]]:
    path = out / "sub-01" / f"ses-{session}" / "trials.csv"
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def events_of(truth: Path) -> list[dict[str, Any]]:
    lines = truth.read_text(encoding="utf-8").splitlines(keepends=True) if truth.exists() else []
    return [json.loads(line) for line in lines if line.endswith("\n")]


def bursts_of(truth: Path) -> list[dict[str, Any]]:
    return [event for event in events_of(truth) if event["event"] == "burst"]


def wait_for_bursts(truth: Path, count: int, process: subprocess.Popen[Any]) -> None:
    give_up_s = time.monotonic() + SOON_S
    while len(bursts_of(truth)) < count:
        assert process.poll() is None
        assert time.monotonic() < give_up_s
        time.sleep(0.003)


def require_true(out: Path, truth: Path, session: str = "01") -> Counter[str]:
    """Join journal and truth by token: the journal says what came out, or that nobody knows."""
    folder = out / "sub-01" / f"ses-{session}"
    armed: dict[int, tuple[int, int]] = {}
    told: dict[tuple[int, int], dict[str, Any]] = {}
    ended: dict[tuple[int, int], str] = {}
    for entry in read_journal(folder / "journal.jsonl").entries:
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
    planned = json.loads((folder / "plan.json").read_text(encoding="utf-8"))["trials"]
    assert answered == Counter(trial["number"] for trial in planned)
    return Counter(ended.values())


def require_true_by_time(out: Path, truth: Path) -> Counter[str]:
    """Join journal and truth by the calendar's clock: a generator knows no tokens."""
    bursts = bursts_of(truth)
    folder = out / "sub-01" / "ses-01"
    armed_s, told_vpp, ended = 0.0, None, Counter[str]()
    for entry in read_journal(folder / "journal.jsonl").entries:
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


def finish(command: list[str], out: Path, *, session: str = "01") -> int:
    """Run a session to its end through every failure of the device; return how many there were."""
    for failures in range(100):
        begun = (out / "sub-01" / f"ses-{session}" / "plan.json").exists()
        result = invoke(*command, *(["--resume"] if begun else []))
        if result.exit_code == 0:
            return failures
        assert result.exit_code == 3, result.output
        assert len(result.stderr.splitlines()) == 1
    pytest.fail("it never came to its end")


ANSWERS = ("trial", "kind", "side", "level_vpp", "response", "rt_s", "correct", "foreperiod_s")


def answers_of(out: Path) -> dict[str, list[str]]:
    """Return what the first attempt at each trial came to, where it was answered."""
    return {
        row["trial"]: [row[column] for column in ANSWERS]
        for row in rows_of(out)
        if row["status"] == "ok" and row["attempt"] == "1"
    }


@pytest.mark.slow
def test_a_whole_paper_session_gives_the_same_answers_over_every_link(
    tmp_path: Path, start: Start
) -> None:
    study = study_file(tmp_path, PAPER)
    mock = tmp_path / "mock"
    assert invoke(*run_options(study, mock, "--seed", "7")).exit_code == 0
    expected = answers_of(mock)
    assert len(expected) == 155
    generator = ("--tcp", "0", "--generator", "keysight", "--amplifier-gain", "27.5")
    links = {
        "pty": ("serial", ("--pty",)),
        "tcp": ("serial", ("--tcp", "0")),
        "generator": ("generator", generator),
    }
    hosts = {}
    for name, (driver, options) in links.items():
        _, port = start(*options, "--truth", str(tmp_path / f"{name}.jsonl"))
        command = run_options(study, tmp_path / name, "--driver", driver, "--port", port)
        hosts[name] = command, subprocess.Popen([*COMMAND, *command, "--seed", "7"])
    for name, (command, host) in hosts.items():
        out = tmp_path / name
        if host.wait() != 0:  # the machine stood still for longer than the watchdog waits
            finish(command, out)
        repeated = {row["trial"] for row in rows_of(out) if row["attempt"] != "1"}
        found = answers_of(out)
        assert set(found) == set(expected) - repeated
        assert found == {trial: expected[trial] for trial in found}
        assert len(bursts_of(tmp_path / f"{name}.jsonl")) >= 155
    for name in ("pty", "tcp"):
        assert require_true(tmp_path / name, tmp_path / f"{name}.jsonl")["ok"] == 155
    require_true_by_time(tmp_path / "generator", tmp_path / "generator.jsonl")


@pytest.mark.process
@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_an_emulator_that_dies_in_mid_session_costs_no_trial_and_no_truth(
    kind: str, tmp_path: Path, start: Start
) -> None:
    study, out, truth = study_file(tmp_path, SHORT), tmp_path / "out", tmp_path / "truth.jsonl"
    emulator, port = start(f"--{kind}", *(["0"] if kind == "tcp" else []), "--truth", str(truth))

    def unplug() -> None:
        wait_for_bursts(truth, 5, emulator)
        emulator.kill()

    killer = threading.Thread(target=unplug)
    killer.start()
    result = invoke(*run_options(study, out, "--driver", "serial", "--port", port))
    killer.join()
    assert result.exit_code == 3
    assert len(result.stderr.splitlines()) == 1
    assert "go on with --resume" in result.stderr
    assert 4 <= sum(row["status"] == "ok" for row in rows_of(out)) < 11
    _, port = start("--pty", "--serial-number", "2")
    other = invoke(*run_options(study, out, "--driver", "serial", "--port", port), "--resume")
    assert other.exit_code == 2
    assert "serial_number '1'; got '2': give --resume-anyway" in other.stderr
    _, port = start(f"--{kind}", *(["0"] if kind == "tcp" else []), "--truth", str(truth))
    finish(run_options(study, out, "--driver", "serial", "--port", port), out)
    require_true(out, truth)


@pytest.mark.process
def test_a_device_that_resets_on_a_bad_line_costs_no_trial_and_no_truth(
    tmp_path: Path, start: Start
) -> None:
    study, out, truth = study_file(tmp_path, SHORT), tmp_path / "out", tmp_path / "truth.jsonl"
    faults = "reset=0.01,drop=0.002,corrupt=0.002"
    _, port = start("--pty", "--truth", str(truth), "--fault", faults, "--seed", "5")
    failures = 0
    for number in range(1, 21):
        session = f"{number:02d}"
        options = ("--driver", "serial", "--port", port, "--session", session)
        failures += finish(run_options(study, out, *options), out, session=session)
        boots = sum(event["event"] == "boot" for event in events_of(truth))
        if boots > 1 and failures:
            break
    else:
        pytest.fail("no reset in twenty sessions")
    tokens = [burst["token"] for burst in bursts_of(truth)]
    assert len(tokens) == len(set(tokens))
    for done in range(1, number + 1):
        require_true(out, truth, f"{done:02d}")


@pytest.mark.process
def test_a_generator_on_a_line_that_breaks_costs_no_trial_and_no_truth(
    tmp_path: Path, start: Start
) -> None:
    study, out, truth = study_file(tmp_path, SHORT), tmp_path / "out", tmp_path / "truth.jsonl"
    faults = ("--fault", "disconnect_at=6000,reset=0.003,delay=0.02", "--seed", "3")
    generator = ("--generator", "keysight", "--amplifier-gain", "27.5", "--truth", str(truth))
    _, port = start("--tcp", "0", *generator, *faults)
    options = ("--driver", "generator", "--port", port)
    failures = finish(run_options(study, out, *options), out)
    assert failures > 0
    assert require_true_by_time(out, truth)["ok"] == 11


@pytest.mark.process
@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_a_host_that_is_killed_doubles_nothing(kind: str, tmp_path: Path, start: Start) -> None:
    study, out, truth = study_file(tmp_path, SHORT), tmp_path / "out", tmp_path / "truth.jsonl"
    _, port = start(f"--{kind}", *(["0"] if kind == "tcp" else []), "--truth", str(truth))
    options = run_options(study, out, "--driver", "serial", "--port", port)
    for count, again in ((3, []), (7, ["--resume"])):
        with subprocess.Popen([*COMMAND, *options, *again], stdout=subprocess.DEVNULL) as host:
            wait_for_bursts(truth, count, host)
            os.kill(host.pid, signal.SIGKILL)
    finish(options, out)
    assert [event["event"] for event in events_of(truth)].count("off") >= 3
    assert require_true(out, truth)["ok"] == 11


@pytest.mark.process
def test_an_answer_on_the_machines_clock_comes_after_its_reaction_time(
    tmp_path: Path, start: Start
) -> None:
    study, out = study_file(tmp_path, TINY), tmp_path / "out"
    _, port = start("--pty")
    options = ("--driver", "serial", "--port", port)
    began_s = time.monotonic()
    assert invoke(*run_options(study, out, *options)).exit_code == 0
    assert time.monotonic() - began_s > 3 * 0.151
    onsets_s = [float(row["onset_s"]) for row in rows_of(out)]
    assert all(later - earlier > 0.151 for earlier, later in pairwise(onsets_s))


# --- a real device, and what it asks for


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
    command: str, tmp_path: Path, real: RealGenerator
) -> None:
    study, out = study_file(tmp_path, TINY), tmp_path / "out"
    reached = ("--driver", "generator", "--port", real.port)
    words = run_options(study, out) if command == "run" else ["check", study, "--device"]
    result = invoke(*words, *reached)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
    assert "--confirm-hardware" in result.stderr
    assert set(real.received.split()) == {b"*IDN?"}
    assert not out.exists()


@pytest.mark.process
def test_a_word_for_its_safety_is_kept_with_what_the_device_cannot_promise(
    tmp_path: Path, real: RealGenerator
) -> None:
    study, out = study_file(tmp_path, TINY), tmp_path / "out"
    options = ("--driver", "generator", "--port", real.port, "--confirm-hardware")
    result = invoke(*run_options(study, out, *options))
    assert result.exit_code == 0, result.stderr
    first = "this device cannot bring its outputs to zero when this program or the line to it dies"
    assert first in result.stdout
    header = json.loads((out / "sub-01" / "ses-01" / "header.json").read_text(encoding="utf-8"))
    assert len(header["device_cannot"]) == result.stdout.count("Note: this device cannot ") == 3
    confirmed = header["hardware_confirmed"]
    assert confirmed["how"] == "--confirm-hardware"
    assert confirmed["by"]
    assert confirmed["at"].endswith("+00:00")
    assert len(confirmed["confirmed"]) == 3


@pytest.mark.process
@pytest.mark.parametrize(("answers", "exit_code"), [("y\n", 0), ("n\n", 2), ("", 2)])
def test_the_operator_is_asked_once_on_a_terminal(
    answers: str,
    exit_code: int,
    tmp_path: Path,
    real: RealGenerator,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("experiment.commands.options.on_terminal", lambda: True)
    study, out = study_file(tmp_path, TINY), tmp_path / "out"
    options = ("--driver", "generator", "--port", real.port)
    result = invoke(*run_options(study, out, *options), answers=answers)
    assert result.exit_code == exit_code, result.stderr
    assert result.stderr.count("All of it is so?") == 1
    assert out.exists() == (exit_code == 0)
    assert (b"OUTP" in real.received.upper()) == (exit_code == 0)


@pytest.mark.process
@pytest.mark.parametrize("given", [(), ("--confirm-hardware",)])
def test_an_emulator_is_not_asked_about_and_says_so_in_the_header(
    given: tuple[str, ...], tmp_path: Path, start: Start
) -> None:
    study, out = study_file(tmp_path, TINY), tmp_path / "out"
    _, port = start("--pty")
    options = ("--driver", "serial", "--port", port, *given)
    assert invoke(*run_options(study, out, *options)).exit_code == 0
    header = json.loads((out / "sub-01" / "ses-01" / "header.json").read_text(encoding="utf-8"))
    assert header["hardware_confirmed"] == "n/a"
    assert header["device_identity"]["emulated"] is True
    assert header["device_cannot"] == []


@pytest.mark.slow
def test_a_sound_card_without_a_word_is_not_even_opened(tmp_path: Path) -> None:
    study, out = study_file(tmp_path, TINY), tmp_path / "out"
    result = invoke(*run_options(study, out, "--driver", "audio", "--port", "no such card"))
    assert result.exit_code == 2
    assert "--confirm-hardware" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--driver", "serial"], "device.port is missing"),
        (["--driver", "generator", "--port", "p"], "device.amplifier_gain is missing"),
        (["--driver", "audio", "--port", "p"], "device.volts_full_scale is missing"),
    ],
)
def test_a_driver_says_which_key_it_lacks(options: list[str], told: str, tmp_path: Path) -> None:
    study = study_file(tmp_path, '[burst]\nwindow = "hann"\n')
    result = invoke(*run_options(study, tmp_path / "out", *options))
    assert result.exit_code == 2
    assert told in result.stderr


@pytest.mark.process
def test_the_study_names_driver_and_port_and_options_name_others(
    tmp_path: Path, start: Start
) -> None:
    _, port = start("--pty")
    named = TINY.replace("[device]", f'[device]\ndriver = "serial"\nport = "{port}"')
    out = tmp_path / "out"
    result = invoke(*run_options(study_file(tmp_path, named), out))
    assert result.exit_code == 0, result.stderr
    study = study_file(tmp_path, named.replace(port, "/no/such/port"))
    result = invoke(*run_options(study, tmp_path / "b"))
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert not (tmp_path / "b").exists()
    assert invoke(*run_options(study, tmp_path / "c", "--port", port)).exit_code == 0


@pytest.mark.process
def test_the_mocks_ceiling_is_none_of_another_devices(tmp_path: Path, start: Start) -> None:
    loud = TINY.replace("[device]", "[device]\nceiling_vpp = 260") + "levels_vpp = [60, 250]\n"
    loud = loud.replace("trials_per_side = 1", "trials_per_side = 2")
    study, truth = study_file(tmp_path, loud), tmp_path / "truth.jsonl"
    refused = invoke(*run_options(study, tmp_path / "mock"))
    assert (refused.exit_code, "own ceiling, 200 Vpp" in refused.stderr) == (2, True)
    _, port = start("--tcp", "0", "--ceiling-vpp", "260", "--truth", str(truth))
    assert check(study, port).exit_code == 0
    options = ("--driver", "serial", "--port", port, "--seed", "1")
    result = invoke(*run_options(study, tmp_path / "out", *options))
    assert result.exit_code == 0, result.stderr
    assert 250_000 in {level for burst in bursts_of(truth) for level in burst["levels_mv"]}


# --- the check of a device


def check(study: str, port: str, *more: str, answers: str | None = None) -> Result:
    reached = ("--device", "--driver", "serial", "--port", port)
    return invoke("check", study, *reached, *more, answers=answers)


@pytest.mark.process
def test_the_check_of_a_device_plays_a_tenth_on_each_channel(tmp_path: Path, start: Start) -> None:
    truth = tmp_path / "truth.jsonl"
    _, port = start("--pty", "--truth", str(truth))
    study = study_file(tmp_path, QUICK)
    result = check(study, port)
    assert result.exit_code == 0, result.stderr
    assert "ceiling 200 Vpp, 48000 Hz" in result.stdout
    assert "60 95 130 165 200 Vpp" in result.stdout
    assert result.stdout.count("burst of 20 Vpp: fired, 20 Vpp read back") == 2
    assert [burst["levels_mv"] for burst in bursts_of(truth)] == [[20_000, 0], [0, 20_000]]
    assert events_of(truth)[-1]["event"] == "off"
    found = json.loads(check(study, port, "--json").stdout)
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
    options: tuple[str, str], told: str, tmp_path: Path, start: Start
) -> None:
    truth = tmp_path / "truth.jsonl"
    _, port = start("--pty", "--truth", str(truth), *options)
    result = check(study_file(tmp_path, QUICK), port)
    assert result.exit_code == 1
    assert told in result.stderr
    assert {event["event"] for event in events_of(truth)} == {"boot"}


def test_a_check_without_a_device_ends_with_3(tmp_path: Path) -> None:
    result = check(study_file(tmp_path, QUICK), "socket://127.0.0.1:1")
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)


@pytest.mark.process
@pytest.mark.parametrize(
    ("answers", "exit_code", "told"),
    [
        ("y\n" * 5, 0, "seen there alone"),
        ("y\ny\ny\ny\nn\n", 1, "right burst of 20 Vpp: fired"),
        ("y\nn\nn\n", 1, "left not tried, right not tried"),
    ],
)
def test_each_burst_of_a_check_is_asked_for_and_confirmed(
    answers: str,
    exit_code: int,
    told: str,
    tmp_path: Path,
    real: RealGenerator,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("experiment.commands.options.on_terminal", lambda: True)
    words = ("check", study_file(tmp_path, QUICK), "--device", "--driver", "generator")
    result = invoke(*words, "--port", real.port, answers=answers)
    assert result.exit_code == exit_code, result.stderr
    assert told in result.output
    assert len(bursts_of(tmp_path / "real.jsonl")) == answers.count("y") // 2


def test_options_of_a_device_need_the_device(tmp_path: Path) -> None:
    result = invoke("check", study_file(tmp_path, QUICK), "--port", "p")
    assert result.exit_code == 2
    assert "need --device" in result.stderr


def test_noise_on_the_actuators_sound_card_is_refused(
    make_study: Callable[[str], Study],
) -> None:
    text = 'masking = { noise = "pink", sound_card = "pulse" }\n'
    device = '[device]\ndriver = "audio"\nport = "pulse"\nvolts_full_scale = 125\n'
    study = make_study(text + device)
    with pytest.raises(StudyError, match="must be named and another one"):
        assemble(study, driver=None, port=None, simulated=False)
    assert assemble(study, driver=None, port=None, simulated=True).settings.driver == "audio"
