"""What someone with a plate and a sound card meets before a first session, on any machine."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from device.driver import Lack
from experiment.apparatus.rig import assemble, chosen_settings
from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.study.read import study_from_text
from experiment.study.study import StudyError
from tactstrip import main
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
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


def test_practice_without_a_device_has_the_mock_in_its_place(
    tmp_path: Path, opened: list[str]
) -> None:
    sessions = Sessions(tmp_path, TINY + SILENT + CARD.format("audio", 125))
    practice = ("--practice-without-device", "--seed", "1")
    result = sessions.run("--responder", "simulated", *practice)
    assert result.exit_code == 0, result.stderr
    told = "Note: the mock takes the place of the driver audio: no device is opened, nothing moves."
    assert result.stdout.count(told) == 1
    assert "actuators" not in result.stderr  # nobody is asked whether they are safe
    assert (opened, sessions.header()["device_identity"]["model"]) == ([], "tactstrip mock")


@pytest.mark.parametrize("word", [(), ("--confirm-hardware",)])
def test_practice_without_a_device_and_a_real_one_is_refused(
    word: tuple[str, ...], tmp_path: Path, opened: list[str]
) -> None:
    sessions = Sessions(tmp_path, TINY + SILENT + CARD.format("mock", 125))
    result = sessions.run("--responder", "terminal", "--driver", "audio", *word)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert "leave out --driver and --port" in result.stderr
    assert (opened, sessions.out.exists()) == ([], False)


@pytest.mark.parametrize("command", [["check"], ["check", "--device"], ["run"]])
def test_levels_are_held_to_the_driver_of_the_command_line(
    command: list[str], run: Run, tmp_path: Path, opened: list[str]
) -> None:
    sessions = Sessions(tmp_path, TINY + CARD.format("mock", 60))
    options = ["--participant", "01"] if command == ["run"] else []
    result = run(*command, sessions.study, "--driver", "audio", *options)
    assert (result.exit_code, result.stderr.count("\n"), opened) == (2, 1, [])
    assert "2 x device.volts_full_scale = 120; got 200" in (
        result.stderr
    )


def test_a_monitor_that_the_driver_of_the_command_line_lacks_is_refused_offline() -> None:
    told = r"^study verified: monitor\.source must be input, .* the driver serial; got duplex"
    keys = 'tap = "line"\nper_unit = [1, 1]\nmeasured_by = "me"\nmeasured_on = 2026-05-04\n'
    text = f'[study]\nname = "verified"\n[monitor]\nsource = "duplex"\n{keys}'
    with pytest.raises(StudyError, match=told):
        chosen_settings(study_from_text(text, "study.toml"), driver="serial", port="p")


def test_check_tells_the_driver_in_use_and_what_run_would_refuse(run: Run, tmp_path: Path) -> None:
    sessions = Sessions(tmp_path, TINY + CARD.format("mock", 100))
    result = run("check", sessions.study, "--driver", "audio")
    assert result.exit_code == 0
    lines = [line for line in result.stdout.splitlines() if line.startswith(("device", "warning"))]
    assert lines[0].startswith("device         audio instead of the study's mock at 48000 Hz")
    assert lines[1].startswith("warning        run refuses a person: masking.sound_card must be")
    told = json.loads(run("check", sessions.study, "--driver", "audio", "--json").stdout)
    assert (told["device"]["driver"], told["verdict"]) == ("audio", "fit")
    assert [why.split()[0] for why in told["run_refuses"]] == ["masking.sound_card"]
    own = json.loads(run("check", sessions.study, "--json").stdout)
    assert (own["device"]["driver"], own["run_refuses"]) == ("mock", [])


@pytest.mark.parametrize("card", ["", "card", "headphones"])
def test_check_warns_of_the_noise_that_run_refuses(card: str) -> None:
    from experiment.apparatus.rig import shared_card

    masking = f'[masking]\nsound_card = "{card}"\n'
    study = study_from_text(masking + CARD.format("audio", 125), "study.toml")
    told = shared_card(study, study.device)
    if card == "headphones":
        assert told is None
        return
    assert told is not None
    with pytest.raises(StudyError) as refused:
        assemble(study, driver=None, port=None, simulated=False)
    assert str(refused.value) == told


@pytest.mark.parametrize(
    "lack", [None, Lack(what="sound card", remedy="plug"), Lack(what="PortAudio", remedy="")]
)
def test_devices_has_the_diagnosis_of_check(
    lack: Lack | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("serial.tools.list_ports.comports", list)
    monkeypatch.setattr("device.sound.stream.sound_cards", tuple)
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: lack)
    said = CliRunner().invoke(main, ["devices"]).stdout.splitlines()[-1]
    why = "" if lack is None else f": {lack}"
    assert said == f"No sound card with two outputs is seen{why}."


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


@pytest.mark.slow
def test_beside_a_computed_cut_off_stands_what_the_other_edge_gives() -> None:
    clamped, supported = (
        check_findings(check_study(study_from_text(OWN.format(edge), "s.toml")), "s.toml").facts
        for edge in ("clamped", "simply-supported")
    )
    for here, there in ((clamped, supported), (supported, clamped)):
        other = here["strip"]["other_edge"]
        assert other["edge"] == there["strip"]["edge"]
        assert other["cutoff_hz"] == there["strip"]["cutoff_hz"]
        levels = there["conditions"][0]["displacements"]["actuators"]
        assert other["level_db"] == max(at["fingers"][0]["level_db"] for at in levels)


@pytest.mark.slow
def test_patches_that_count_have_the_other_edge_too() -> None:
    patch = (
        "diameter_mm = 9\npatch_counts = true\npiezo_thickness_mm = 0.13\n"
        "piezo_youngs_modulus_gpa = 61\npiezo_poisson_ratio = 0.3\npiezo_d31_pm_v = -170\n"
        "piezo_density_kg_m3 = 7700\n"
    )
    clamped, supported = (
        check_study(
            study_from_text(OWN.format(edge).replace("diameter_mm = 12.8\n", patch), "s.toml")
        )
        for edge in ("clamped", "simply-supported")
    )
    other = check_findings(clamped, "s.toml").facts["strip"]["other_edge"]
    (there,) = supported.conditions
    assert other["level_db"] == max(there.level_db(0, 1), there.level_db(1, 0))
    assert other["level_db"] > clamped.conditions[0].level_db(0, 1) + 10


@pytest.mark.slow
def test_a_measurement_that_the_other_edge_cannot_have_is_named() -> None:
    measured = (
        "diameter_mm = 12.8\nmeasured_displacement_um = 2.9\nmeasured_at_vpp = 140\n"
        "measured_at_hz = 1800\n"
    )
    text = OWN.format("clamped").replace("diameter_mm = 12.8\n", measured)
    found = check_findings(check_study(study_from_text(text, "s.toml")), "s.toml")
    assert "measured_at_hz" in found.facts["strip"]["other_edge"]["refusal"]


def test_a_measured_cut_off_needs_no_other_edge() -> None:
    day = 'measured_cutoff_hz = 2870\nmeasured_by = "me"\nmeasured_on = 2026-05-04\n'
    for edge, text in (("clamped", day), ("measured-cutoff", day), ("clamped", "")):
        study = study_from_text(OWN.format(edge).replace("[burst]", f"{text}[burst]"), "s.toml")
        found = check_findings(check_study(study, gains=()), "s.toml")
        assert ("other_edge" in found.facts["strip"]) == (not text)


def test_a_monitor_s_missing_keys_are_named_together() -> None:
    monitor = '[monitor]\nsource = "input"\n'
    for text, told in (
        ("", "tap, per_unit, measured_by and measured_on are missing; source = input needs them"),
        (
            'tap = "motion"\nper_unit = [1, 1]\nmeasured_by = "me"\n',
            "measured_on and per_volt are missing; source = input and tap = motion need them",
        ),
        (
            'tap = "motion"\nper_unit = [1, 1]\nmeasured_by = "me"\nmeasured_on = 2026-05-04\n',
            "per_volt is missing; tap = motion needs it",
        ),
    ):
        with pytest.raises(StudyError) as refused:
            study_from_text(monitor + text, "s.toml")
        assert str(refused.value) == f"s.toml: monitor.{told}"


def test_a_second_card_with_the_tolerance_of_the_first_is_warned_of() -> None:
    keys = 'tap = "line"\nper_unit = [1, 1]\nmeasured_by = "me"\nmeasured_on = 2026-05-04\n'
    for source, more, warned in (
        ("duplex", "", False),
        ("input", "", True),
        ("input", "onset_tolerance_ms = 20\n", False),
    ):
        study = study_from_text(f'[monitor]\nsource = "{source}"\n{keys}{more}', "s.toml")
        lines = check_findings(check_study(study, gains=()), "s.toml").lines
        told = [line for line in lines if line.startswith("warning")]
        assert [line.split()[1] for line in told] == ["monitor.onset_tolerance_ms"] * warned
