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
OWN = """
[strip]
width_mm = 30
thickness_mm = 0.5
length_mm = 150
material = "steel"
edge = "{}"
[burst]
window = "hann"
[[actuator]]
side = "left"
x_mm = -35
diameter_mm = 12.8
[[actuator]]
side = "right"
x_mm = 35
diameter_mm = 12.8
"""
PATCH = """diameter_mm = 9
patch_counts = true
piezo_thickness_mm = 0.13
piezo_youngs_modulus_gpa = 61
piezo_poisson_ratio = 0.3
piezo_d31_pm_v = -170
piezo_density_kg_m3 = 7700
"""
DAY = 'measured_cutoff_hz = 2870\nmeasured_by = "me"\nmeasured_on = 2026-05-04\n'
MONITOR = 'tap = "line"\nper_unit = [1, 1]\nmeasured_by = "me"\nmeasured_on = 2026-05-04\n'


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


@pytest.mark.parametrize("word", [(), ("--confirm-hardware",)])
def test_practice_without_a_device_and_a_real_one_is_refused(
    word: tuple[str, ...], tmp_path: Path, opened: list[str]
) -> None:
    sessions = Sessions(tmp_path, TINY + SILENT + CARD.format("mock", 125))
    result = sessions.run("--responder", "terminal", "--driver", "audio", *word)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "--driver" in result.stderr
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


@pytest.mark.slow
@pytest.mark.parametrize("patch", ["diameter_mm = 12.8\n", PATCH])
def test_beside_a_computed_cut_off_stands_what_the_other_edge_gives(
    checked: Callable[..., dict[str, Any]], patch: str
) -> None:
    text = OWN.replace("diameter_mm = 12.8\n", patch)
    clamped, supported = (checked(text.format(edge)) for edge in ("clamped", "simply-supported"))
    for here, there in ((clamped, supported), (supported, clamped)):
        other = here["strip"]["other_edge"]
        assert other["edge"] == there["strip"]["edge"]
        if patch != PATCH:
            assert other["cutoff_hz"] == there["strip"]["cutoff_hz"]
        levels = there["conditions"][0]["displacements"]["actuators"]
        level_db = max(finger["level_db"] for at in levels for finger in at["fingers"][:1])
        assert other["level_db"] == pytest.approx(level_db, abs=1e-9)


def test_the_other_edge_is_named_where_a_cut_off_is_computed_and_can_be(
    checked: Callable[..., dict[str, Any]],
) -> None:
    measured = "measured_displacement_um = 2.9\nmeasured_at_vpp = 140\nmeasured_at_hz = 1800\n"
    text = OWN.format("clamped").replace("12.8\n", f"12.8\n{measured}")
    refusal = checked(text)["strip"]["other_edge"]["refusal"]
    assert "measured_at_hz" in refusal  # above the other edge's cut-off frequency
    for edge, day in (("clamped", DAY), ("measured-cutoff", DAY)):
        report = checked(OWN.format(edge).replace("[burst]", f"{day}[burst]"))
        assert "other_edge" not in report["strip"]
