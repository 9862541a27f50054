"""`run`: who answers, who operates, which noise, and what header and journal keep of it."""

from __future__ import annotations

import csv
import json
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Self

import pytest

from experiment import Press
from experiment.study.presentation import Screen, Texts
from tests.test_experiment.lab import FakeNoise, Scripted
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from pathlib import Path

    from device import Clock
    from experiment import AwaitedAnswer, Progress, ResponderSettings, SessionPart
    from tests.conftest import Run

STUDY = """
[study]
consent_version = "2.1"
[masking]
noise = "none"
[screen]
full_screen = false
[keys]
left = ["left", "num_4"]
[texts]
welcome = "\u200fأهلاً"
"""


@pytest.fixture
def sessions(tmp_path: Path, quick_study_text: str) -> Sessions:
    off_plate = "hands_off_trials_before = 2\nhands_off_trials_after = 2\n"
    return Sessions(tmp_path, STUDY + quick_study_text + off_plate)


LONGEST_NAME = 100


class FakeScreen(Scripted):
    """A person in front of a window that nobody sees."""

    simulated = False
    settings: ClassVar[ResponderSettings]
    log: ClassVar[list[str]] = []

    def __init__(self, settings: ResponderSettings, clock: Clock) -> None:
        super().__init__(clock)
        type(self).settings, type(self).log = settings, []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.log.append("closed")

    def ask(self, question: AwaitedAnswer) -> Press | None:
        self._clock.wait(max(0.0, question.onset_s + 0.15 - self._clock.now_s()))
        return Press(question.answers[-1], self._clock.now_s())

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        self.log.append(str(part))
        return True

    def feedback(self, *, correct: bool) -> None:
        self.log.append(f"correct: {correct}")

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        return not paused


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> type[FakeScreen]:
    """What `run --responder screen` finds for a window."""
    module = ModuleType("experiment.participant.screen")
    vars(module)["ScreenResponder"] = FakeScreen
    monkeypatch.setitem(sys.modules, "experiment.participant.screen", module)
    monkeypatch.setattr("experiment.participant.window.require_window", lambda: None)
    return FakeScreen


@pytest.fixture
def noise(monkeypatch: pytest.MonkeyPatch) -> FakeNoise:
    """Play on a sound card that is none."""
    card = FakeNoise()

    def noise_player(masking: Any, clock: object, *, is_silent: bool) -> FakeNoise:
        card.calls.append(f"{masking.noise} {is_silent}")
        return card

    monkeypatch.setattr("experiment.hardware.noise.noise_player", noise_player)
    return card


def test_a_simulated_session_says_nobody_was_there(sessions: Sessions, noise: FakeNoise) -> None:
    sessions.practice = False
    assert sessions.run("--responder", "simulated").exit_code == 0
    header = sessions.header()
    assert header["responder"] == "simulated"
    assert header["operator"] is None
    assert header["consent_version"] == "2.1"
    assert noise.calls[0] == "none True"
    assert {row["device_kind"] for row in sessions.rows()} == {"mock"}


@pytest.mark.slow
def test_header_and_window_get_what_is_given(sessions: Sessions, screen: type[FakeScreen]) -> None:
    result = sessions.run("--responder", "screen", "--operator", "B. Müller")
    assert result.exit_code == 0, result.stderr
    header = sessions.header()
    assert (header["operator"], header["consent_version"]) == ("B. Müller", "2.1")
    assert header["responder"] == "screen"
    assert screen.settings.keys.meanings == {
        "left": ("left", "num_4"),
        "right": ("right",),
        "both": ("down",),
        "none": ("space",),
        "pause": ("escape",),
        "continue": ("return",),
    }
    assert screen.settings.texts.welcome == "\u200fأهلاً"
    assert screen.settings.texts.prompt
    assert screen.settings.screen == Screen(full_screen=False)
    assert screen.settings.responses == ("left", "right", "both")
    assert screen.log == ["hands_off_before", "main", "hands_off_after", "closed"]
    assert {(row["kind"], row["response"]) for row in sessions.rows()} == {
        ("hands_off", "none"),
        ("single", "both"),
        ("both", "both"),
    }


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_whoever_resumes_is_noted_anew(sessions: Sessions) -> None:
    by_screen = ("--responder", "screen", "--operator")
    assert sessions.run(*by_screen, "first").exit_code == 0
    folder = sessions.folder()
    lines = folder.journal_path.read_text("utf-8").splitlines(keepends=True)
    folder.journal_path.write_text("".join(lines[:6]), encoding="utf-8")
    folder.trials_path.unlink()
    (folder.path.parent / "sessions.tsv").unlink()
    assert sessions.run(*by_screen, "second", "--resume").exit_code == 0
    (resumed,) = sessions.lines("session_resume")
    assert (resumed["operator"], resumed["responder"]) == ("second", "screen")
    header = sessions.header()
    assert header["operator"] == "first"
    for key in ("device_limits", "device_health"):
        assert resumed[key] == header[key]
    assert header["device_limits"]["slots"] == 64


@pytest.mark.parametrize(
    ("option", "value"),
    [
        *(("--operator", name) for name in ("", " ", "a\nb", "a" * (LONGEST_NAME + 1))),
        ("--responder", "robot"),
    ],
)
def test_an_impossible_operator_or_responder_begins_nothing(
    sessions: Sessions, option: str, value: str
) -> None:
    result = sessions.run("--responder", "simulated", option, value)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert option.removeprefix("--") in result.stderr
    assert not sessions.out.exists()


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_practice_without_a_device_plays_no_noise_and_judges_no_answer(
    sessions: Sessions, screen: type[FakeScreen]
) -> None:
    card = '[device]\ndriver = "audio"\nport = "card"\nvolts_full_scale = 125\n'
    text = sessions.text.replace('noise = "none"', 'noise = "pink"') + "practice_trials = 2\n"
    sessions.write(card + text)  # the noise would be played to the actuators
    result = sessions.run("--responder", "screen")
    assert result.exit_code == 0, result.stderr
    assert sessions.header()["masking_noise_played"] is False
    assert {row["noise_ok"] for row in sessions.rows()} == {"n/a"}
    assert screen.settings.texts.practice != Texts().practice
    assert "practice" in screen.log
    assert not [line for line in screen.log if line.startswith("correct")]
    assert [row["kind"] for row in sessions.rows()].count("practice") == 2


@pytest.mark.slow
def test_a_rehearsal_plays_the_noise_and_judges_answers_on_the_mock(
    sessions: Sessions, screen: type[FakeScreen], noise: FakeNoise
) -> None:
    text = sessions.text.replace('noise = "none"', 'noise = "pink"') + "practice_trials = 2\n"
    sessions.write('[device]\ndriver = "serial"\nport = "/dev/none"\n' + text)
    sessions.practice = False
    result = sessions.run("--responder", "screen", "--rehearse")
    assert result.exit_code == 0, result.stderr
    assert noise.calls[:2] == ["pink False", "start"]
    assert screen.settings.texts.practice == Texts().practice
    assert [line for line in screen.log if line.startswith("correct")]
    assert {row["device_kind"] for row in sessions.rows()} == {"rehearsal"}
    refused = sessions.run("--rehearse", "--practice-without-device", "--resume")
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)


@pytest.mark.parametrize("responder", ["screen", "terminal"])
def test_a_person_on_the_mock_needs_the_option_for_practice_on_a_resume_too(
    sessions: Sessions, screen: type[FakeScreen], responder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if responder == "screen":
        monkeypatch.setattr(screen, "introduce", lambda *_: False)
        assert sessions.run("--responder", "screen").exit_code == 4
    resume = ["--resume"] if responder == "screen" else []
    monkeypatch.setattr(screen, "log", [])
    sessions.practice = False
    result = sessions.run("--responder", responder, *resume)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "--practice-without-device" in result.stderr
    assert sessions.out.exists() == (responder == "screen")
    assert screen.log == []


@pytest.mark.slow
@pytest.mark.usefixtures("screen")
def test_practice_is_analysed_and_exported_only_when_asked_for_and_marked(
    sessions: Sessions, run: Run, tmp_path: Path
) -> None:
    assert sessions.run("--responder", "screen").exit_code == 0
    assert sessions.header()["device_kind"] == "mock"
    assert {row["device_kind"] for row in sessions.rows()} == {"mock"}
    assert {row["simulated"] for row in sessions.rows()} == {"false"}
    out, bids = tmp_path / "analysis", tmp_path / "bids"
    commands = (("analyze", "--out", out), ("export", "--bids", bids))
    for command, option, target in commands:
        result = run(command, sessions.out, option, target)
        assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
        assert "--allow-simulated" in result.stderr
        assert not target.exists()
        done = run(command, sessions.out, option, target, "--allow-simulated")
        assert done.exit_code == 0, done.output
    trials = len(sessions.rows())
    summary = json.loads((out / "summary.json").read_bytes())
    assert summary["devices"] == {"mock": trials}
    assert summary["counts"]["without_device"] == trials
    assert summary["mark"] in (out / "report.html").read_text("utf-8")
    for name in ("levels.csv", "participants.csv", "trials_clean.csv"):
        with (out / name).open(encoding="utf-8", newline="") as file:
            assert {row["device_kind"] for row in csv.DictReader(file)} == {"mock"}
    for name in ("sub-01/sub-01_sessions.tsv", "sub-01/ses-01/beh/*_events.tsv"):
        (table,) = bids.glob(name)
        with table.open(encoding="utf-8", newline="") as file:
            assert {row["device_kind"] for row in csv.DictReader(file, delimiter="\t")} == {"mock"}


CARD = '[device]\ndriver = "{}"\nport = "card"\nvolts_full_scale = {}\n'


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of what was opened as a sound card."""
    cards: list[str] = []
    monkeypatch.setattr("device.sound.stream._started", lambda _, card, **__: cards.append(card))
    return cards


@pytest.mark.parametrize(
    ("driver", "options", "named"),
    [
        ("mock", ("terminal", "--driver", "audio"), "--driver"),
        ("mock", ("terminal", "--driver", "audio", "--confirm-hardware"), "--driver"),
        ("audio", ("simulated",), "--confirm-hardware"),
    ],
)
def test_a_real_device_is_not_opened_for_practice_or_without_a_word_for_its_safety(
    driver: str, options: tuple[str, ...], named: str, sessions: Sessions, opened: list[str]
) -> None:
    sessions.write(CARD.format(driver, 125) + sessions.text)
    result = sessions.run("--responder", *options)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert named in result.stderr
    assert (opened, sessions.out.exists()) == ([], False)


@pytest.mark.parametrize("command", [["check"], ["check", "--device"], ["run"]])
def test_levels_are_held_to_the_driver_of_the_command_line(
    command: list[str], run: Run, sessions: Sessions, opened: list[str]
) -> None:
    text = sessions.text
    sessions.write(CARD.format("mock", 60) + text)
    options = ["--participant", "01"] if command == ["run"] else []
    result = run(*command, sessions.study, "--driver", "audio", *options)
    assert (result.exit_code, result.stderr.count("\n"), opened) == (2, 1, [])
    assert "2 x device.volts_full_scale = 120 (got 160" in result.stderr
    if command == ["check"]:
        sessions.write(CARD.format("mock", 100) + text.replace('[masking]\nnoise = "none"', ""))
        report = json.loads(run("check", sessions.study, "--driver", "audio", "--json").stdout)
        assert (report["device"]["driver"], report["verdict"]) == ("audio", "within limits")
        assert [why.split()[0] for why in report["run_refuses"]] == ["masking.sound_card:"]
