"""`run`: who answers, who operates, which noise, and what header and journal keep of it."""

from __future__ import annotations

import json
import subprocess
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, Self

import pytest
from click.testing import CliRunner

from experiment.apparatus.noise import NoiseError, NoiseFacts, NoiseHealth
from experiment.archive.folders import SessionFolder
from experiment.archive.journal import read_journal
from experiment.session.setting import LONGEST_NAME, Sitting
from experiment.study.sections.presentation import Screen, Texts
from experiment.terms.responder import Press
from tactstrip import main

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

    from device.clock import Clock
    from experiment.operator.requests import Requests
    from experiment.terms.responder import AwaitedAnswer, Progress, SessionPart

STUDY = """
[study]
consent_version = "2.1"
[masking]
noise = "{noise}"
[screen]
full_screen = false
[keys]
left = ["left", "num_4"]
[texts]
welcome = "\u200fأهلاً"
"""


@pytest.fixture
def study_path(tmp_path: Path, quick_study_text: str) -> Path:
    path = tmp_path / "study.toml"
    text = STUDY.format(noise="none") + quick_study_text
    path.write_text(text + "audibility_trials = 2\ncontrol_trials = 2\n", encoding="utf-8")
    return path


def run(study_path: Path, *more: str) -> Result:
    arguments = ["run", str(study_path), "--participant", "01", *more]
    return CliRunner().invoke(main, [*arguments, "--out", str(study_path.parent / "results")])


def folder_of(study_path: Path) -> SessionFolder:
    return SessionFolder(study_path.parent / "results", "01", "01")


def header_of(study_path: Path) -> dict[str, Any]:
    text = (folder_of(study_path).path / "header.json").read_text(encoding="utf-8")
    facts: dict[str, Any] = json.loads(text)
    return facts


class FakeScreen:
    """A participant in front of a window that nobody sees: answers ``none`` to everything."""

    simulated = False
    asked: ClassVar[dict[str, Any]] = {}
    parts: ClassVar[list[str]] = []
    refusal: ClassVar[str] = ""

    def __init__(self, clock: Clock, **asked: Any) -> None:
        self._clock = clock
        type(self).asked = asked
        type(self).parts = []

    def __enter__(self) -> Self:
        if self.refusal:
            raise ValueError(self.refusal)
        return self

    def __exit__(self, *_: object) -> None:
        self.parts.append("closed")

    def begin(self, progress: Progress) -> bool:
        return True

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        self.parts.append(str(part))
        return True

    def cue(self, progress: Progress) -> None: ...

    def wait(self, until_s: float) -> Press | None:
        self._clock.wait(max(0.0, until_s - self._clock.now_s()))
        return None

    def ask(self, question: AwaitedAnswer) -> Press | None:
        time_s = question.onset_s + 0.15
        self._clock.wait(max(0.0, time_s - self._clock.now_s()))
        return Press("none", time_s)

    def feedback(self, *, correct: bool) -> None: ...

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        return not paused

    def end(self, progress: Progress, *, finished: bool) -> None: ...


class FakeNoise:
    """A sound card that does as it is told."""

    def __init__(self, log: list[str], failure: str = "") -> None:
        self._log = log
        self._failure = failure

    @property
    def facts(self) -> NoiseFacts:
        return NoiseFacts(noise="pink", played=True, sha256="ab", measured_level_dba=64.0)

    def start(self) -> None:
        if self._failure:
            raise NoiseError(self._failure)
        self._log.append("start")

    def health(self) -> NoiseHealth:
        return NoiseHealth(ok=True, words="plays")

    def stop(self) -> None:
        self._log.append("stop")


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> type[FakeScreen]:
    """What `run --responder screen` finds for a window."""
    module = ModuleType("experiment.participant.screen")
    vars(module)["ScreenResponder"] = FakeScreen
    monkeypatch.setitem(sys.modules, "experiment.participant.screen", module)
    monkeypatch.setattr(FakeScreen, "refusal", "")
    monkeypatch.setattr("experiment.participant.window.require_window", lambda: None)
    return FakeScreen


def play(monkeypatch: pytest.MonkeyPatch, noise: FakeNoise) -> list[dict[str, Any]]:
    """Put another sound card in; return what it is asked for."""
    asked: list[dict[str, Any]] = []

    def noise_player(masking: object, clock: object, *, simulated: bool) -> FakeNoise:
        asked.append({"masking": masking, "simulated": simulated})
        return noise

    monkeypatch.setattr("experiment.apparatus.noise.noise_player", noise_player)
    return asked


# --- the header -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_simulated_session_says_that_nobody_was_there(study_path: Path) -> None:
    assert run(study_path, "--responder", "simulated").exit_code == 0
    header = header_of(study_path)
    assert header["responder"] == "simulated"
    assert [header[key] for key in ("operator", "response_mapping", "screen", "texts")] == (
        ["n/a"] * 4
    )
    assert header["consent_version"] == "2.1"


@pytest.mark.slow
def test_the_header_keeps_operator_consent_keys_and_screen(
    study_path: Path, screen: type[FakeScreen]
) -> None:
    result = run(study_path, "--responder", "screen", "--operator", "B. Müller")
    assert result.exit_code == 0, result.stderr
    header = header_of(study_path)
    assert (header["operator"], header["consent_version"]) == ("B. Müller", "2.1")
    assert header["responder"] == "screen"
    assert header["response_mapping"] == {
        "left": ["left", "num_4"],
        "right": ["right"],
        "both": ["down"],
        "none": ["space"],
        "pause": ["escape"],
        "go_on": ["return"],
    }
    assert header["screen"]["full_screen"] is False
    assert header["texts"]["welcome"] == "\u200fأهلاً"
    assert header["texts"]["prompt"] == Texts().prompt


@pytest.mark.slow
def test_the_mapping_names_accepted_answers_only(
    study_path: Path, screen: type[FakeScreen]
) -> None:
    text = study_path.read_text("utf-8").split("audibility_trials")[0]
    study_path.write_text(text, encoding="utf-8")
    run(study_path, "--responder", "screen")
    assert "none" not in header_of(study_path)["response_mapping"]


@pytest.mark.slow
def test_the_window_gets_what_the_study_says(study_path: Path, screen: type[FakeScreen]) -> None:
    run(study_path, "--responder", "screen")
    assert set(screen.asked) == {"responses", "screen", "keys", "texts", "requests", "stop"}
    assert screen.asked["screen"] == Screen(full_screen=False)
    assert screen.asked["responses"] == ("left", "right", "both")
    assert screen.parts == ["audibility", "main", "control", "closed"]


@pytest.mark.slow
def test_none_is_an_answer_with_the_fingers_off_and_invalid_with_them_on(
    study_path: Path, screen: type[FakeScreen]
) -> None:
    assert run(study_path, "--responder", "screen").exit_code == 0
    folder = folder_of(study_path)
    rows = folder.read_history(folder.read_plan()).rows
    assert {(row.kind, row.response) for row in rows} == {
        ("control", "none"),
        ("single", "invalid"),
        ("both", "invalid"),
    }
    control = [row for row in rows if row.kind == "control"]
    assert [row.block for row in control] == [-1, -1, 3, 3]
    assert {(row.peak_left_um, row.displacement_basis) for row in control} == {(None, None)}


@pytest.mark.slow
def test_whoever_resumes_is_noted_anew(study_path: Path, screen: type[FakeScreen]) -> None:
    assert run(study_path, "--responder", "screen", "--operator", "first").exit_code == 0
    folder = folder_of(study_path)
    lines = folder.journal_path.read_text("utf-8").splitlines(keepends=True)
    folder.journal_path.write_text("".join(lines[:6]), encoding="utf-8")
    folder.trials_path.unlink()
    more = ("--responder", "screen", "--operator", "second", "--resume")
    assert run(study_path, *more).exit_code == 0
    (resumed,) = [
        entry
        for entry in read_journal(folder.journal_path).entries
        if entry.event == "session_resume"
    ]
    assert (resumed.facts["operator"], resumed.facts["responder"]) == ("second", "screen")
    assert resumed.facts["response_mapping"]["right"] == ["right"]
    assert header_of(study_path)["operator"] == "first"


@pytest.mark.parametrize("name", ["", " ", "a\nb", "a" * (LONGEST_NAME + 1)])
def test_an_operator_without_a_name_is_refused_so_nothing_is_begun(
    study_path: Path, name: str
) -> None:
    result = run(study_path, "--responder", "simulated", "--operator", name)
    assert result.exit_code == 2
    assert "operator must be a name in one line" in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (study_path.parent / "results").exists()


def test_an_unknown_responder_is_refused() -> None:
    robot: Any = "robot"
    with pytest.raises(ValueError, match="responder must be one of screen, terminal, simulated"):
        Sitting(responder=robot)


# --- refusals and noise ---------------------------------------------------------------------------


def test_a_machine_without_a_window_is_told_before_anything_else(
    study_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    result = run(study_path, "--responder", "screen")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.count("\n") == 1
    assert not (study_path.parent / "results").exists()


@pytest.mark.slow
def test_no_window_ends_it_in_one_line_and_nothing_is_begun(
    study_path: Path, screen: type[FakeScreen], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(screen, "refusal", "--responder screen needs a display")
    result = run(study_path, "--responder", "screen")
    assert result.exit_code == 2
    assert result.stderr == "error: --responder screen needs a display\n"
    assert not (study_path.parent / "results").exists()


@pytest.mark.slow
def test_the_noise_is_played_from_before_the_session_to_its_end(
    study_path: Path, screen: type[FakeScreen], monkeypatch: pytest.MonkeyPatch
) -> None:
    log: list[str] = []
    asked = play(monkeypatch, FakeNoise(log))
    assert run(study_path, "--responder", "screen").exit_code == 0
    assert (asked[0]["simulated"], asked[0]["masking"].noise) == (False, "none")
    assert (log[0], log[-1]) == ("start", "stop")
    header = header_of(study_path)
    assert (header["masking_noise_played"], header["noise_level_dba"]) == (True, 64.0)


@pytest.mark.slow
def test_noise_that_cannot_be_played_is_a_failed_device_and_nothing_is_begun(
    study_path: Path, screen: type[FakeScreen], monkeypatch: pytest.MonkeyPatch
) -> None:
    play(monkeypatch, FakeNoise([], "no sound card: plug one in"))
    result = run(study_path, "--responder", "screen")
    assert result.exit_code == 3
    assert result.stderr == (
        'error: no sound card: plug one in; a study with noise = "none" in [masking] plays none\n'
    )
    assert not folder_of(study_path).plan_path.exists()


@pytest.mark.slow
def test_a_simulated_participant_is_told_to_the_noise(
    study_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = play(monkeypatch, FakeNoise([]))
    run(study_path, "--responder", "simulated")
    assert [one["simulated"] for one in asked] == [True]


@pytest.mark.slow
def test_the_operator_sees_it_unless_the_terminal_is_the_participants(
    study_path: Path, screen: type[FakeScreen], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Requests] = []

    class View:
        def __init__(self, requests: Requests, stop: object) -> None:
            seen.append(requests)

        def __enter__(self) -> Self:
            return self

        def __exit__(self, *_: object) -> None: ...

        def show(self, status: object) -> None: ...

    module = ModuleType("experiment.operator.view")
    vars(module)["OperatorView"] = View
    monkeypatch.setitem(sys.modules, "experiment.operator.view", module)
    run(study_path, "--responder", "screen")
    assert seen == [screen.asked["requests"]]
    run(study_path, "--session", "02", "--responder", "terminal")
    assert len(seen) == 1


@pytest.mark.process
def test_sessions_without_a_window_never_import_psychopy(study_path: Path) -> None:
    program = (
        "import sys; from click.testing import CliRunner; from tactstrip import main\n"
        "for arguments in ([*sys.argv[1:], '--responder', 'simulated'],\n"
        "                  ['check', sys.argv[2]]):\n"
        "    assert CliRunner().invoke(main, arguments).exit_code == 0\n"
        "heavy = ('psychopy', 'experiment.participant.screen')\n"
        "print(*[name for name in heavy if name in sys.modules])\n"
    )
    out = str(study_path.parent / "results")
    arguments = ["run", str(study_path), "--participant", "01", "--out", out]
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], capture_output=True, check=True, text=True
    )
    assert done.stdout.strip() == ""
