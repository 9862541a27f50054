"""What someone with a plate and a sound card meets before a first session, on any machine."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.conftest import Run

TINY = """
[strip]
length_mm = "endless"
[design]
levels_vpp = [60, 200]
trials_per_side = 1
both_trials = 0
order = "random"
break_every = 0
[burst]
window = "hann"
"""
SILENT = '[masking]\nnoise = "none"\n'
CARD = '[device]\ndriver = "{}"\nport = "card"\nvolts_full_scale = {}\n'


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of what was opened as a sound card."""
    cards: list[str] = []

    def started(_kind: str, card: str, **_: object) -> None:
        cards.append(card)
        raise AssertionError(f"{card} was opened")

    monkeypatch.setattr("device.sound.stream._started", started)
    return cards


@pytest.fixture
def checked(run: Run, tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """Check the text of a study; returns what --json prints."""

    def checked(text: str, *options: str) -> dict[str, Any]:
        sessions = Sessions(tmp_path, text)
        report: dict[str, Any] = json.loads(run("check", sessions.study, "--json", *options).stdout)
        return report

    return checked


@pytest.mark.parametrize(
    ("driver", "options", "named"),
    [
        ("mock", ("terminal", "--driver", "audio"), "--driver"),
        ("mock", ("terminal", "--driver", "audio", "--confirm-hardware"), "--driver"),
        ("audio", ("simulated",), "--confirm-hardware"),
    ],
)
def test_a_real_device_is_not_opened_for_practice_or_without_a_word_for_its_safety(
    driver: str, options: tuple[str, ...], named: str, tmp_path: Path, opened: list[str]
) -> None:
    sessions = Sessions(tmp_path, TINY + SILENT + CARD.format(driver, 125))
    result = sessions.run("--responder", *options)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert named in result.stderr
    assert (opened, sessions.out.exists()) == ([], False)


@pytest.mark.parametrize("command", [["check"], ["check", "--device"], ["run"]])
def test_levels_are_held_to_the_driver_of_the_command_line(
    command: list[str], run: Run, tmp_path: Path, opened: list[str]
) -> None:
    sessions = Sessions(tmp_path, TINY + CARD.format("mock", 60))
    options = ["--participant", "01"] if command == ["run"] else []
    result = run(*command, sessions.study, "--driver", "audio", *options)
    assert (result.exit_code, result.stderr.count("\n"), opened) == (2, 1, [])
    assert "levels_vpp[1]" in result.stderr
    assert "2 x device.volts_full_scale = 120; got 200" in result.stderr


def test_check_reports_the_driver_in_use_and_what_run_would_refuse(
    checked: Callable[..., dict[str, Any]],
) -> None:
    text = TINY + CARD.format("mock", 100)
    report = checked(text, "--driver", "audio")
    assert (report["device"]["driver"], report["verdict"]) == ("audio", "fit")
    assert [why.split()[0] for why in report["run_refuses"]] == ["masking.sound_card"]
    report = checked(text)
    assert (report["device"]["driver"], report["run_refuses"]) == ("mock", [])
