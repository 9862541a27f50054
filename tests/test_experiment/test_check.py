"""`tactstrip check`: whether stimuli are fit, and what the reader of a study should know."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import click
import pytest
from click.testing import CliRunner

from experiment import check_study, paper_study, study_from_text
from experiment.terms.exits import CommandError, refusals
from stimuli import SIMPLY_SUPPORTED
from tests.test_experiment.people import finger_gains
from tests.test_experiment.studies import (
    KNOWN,
    cases,
    codes_of,
    discs,
    facts_of,
    measured,
    message_of,
)

if TYPE_CHECKING:
    from tests.conftest import Run

"""The level at the other finger of the paper's burst lies between -23 and -40 dB."""
ARRAY = discs(measured()) + (
    '[[actuator]]\nside = "other"\nname = "mid"\nx_mm = 22\ndiameter_mm = 12.8\n'
)
"""The paper's second plate."""
STEEL = (
    '[strip]\nwidth_mm = 30\nthickness_mm = 0.3\nlength_mm = 200\nmaterial = "steel"\n'
    'edge = "clamped"\nmeasured_cutoff_hz = 1700\nmeasured_by = "A. Person"\n'
)


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


EASY = "[burst]\nfrequency_hz = 250.0\ncycles = 3\nwindow = 'hann'\n"
USUAL = {"practice_device", "assumed_value", "unknown_contact", "assumed_loss", "ambiguous_cutoff"}
OUTSIDE = {"threshold_outside_levels", "threshold_of_another_plate"}


def displacements(text: str) -> dict[str, dict[str, Any]]:
    found = facts_of(text)["conditions"][0]["displacements"]
    return {actuator["name"]: actuator for actuator in found["actuators"]}


@pytest.mark.slow
@pytest.mark.parametrize(("text", "expected"), cases("checks"))
def test_a_check_states_verdicts_and_warnings(text: str, expected: str) -> None:
    facts = facts_of(text)
    codes = sorted({*codes_of(facts)} - USUAL - OUTSIDE)
    assert [facts["verdict"], *codes] == expected.split()
    reasons = [reason for condition in facts["conditions"] for reason in condition["reasons"]]
    assert (facts["verdict"] == "fit") == (reasons == [])
    assumed = "loss_factor" not in text and "endless" not in text
    assert ("assumed_loss" in codes_of(facts)) == assumed
    elastic = facts["strip"]["edge"] == "measured-cutoff"
    assert ("ambiguous_cutoff" in codes_of(facts)) == elastic


def test_the_check_of_the_papers_study_is_one_json_object(run: Run) -> None:
    Path("study.toml").touch()
    result = run("check", "study.toml", "--json")
    assert (result.exit_code, result.stderr, result.stdout.count("\n")) == (0, "", 1)
    facts = json.loads(result.stdout)
    assert (facts["verdict"], facts["study"]["sha256"]) == ("fit", paper_study().sha256)
    assert (facts["strip"]["cutoff_hz"], facts["trials"]) == (pytest.approx(2900.0), 155)
    assert facts["strip"]["edge_stiffness_n"] == pytest.approx(141.72, abs=0.005)
    (condition,) = facts["conditions"]
    assert condition["band_hz"] == pytest.approx([205.634, 654.393], abs=1e-3)
    # one cycle of 500 Hz, no window: 3.2958e-4 above 2.9 kHz (40-digit integration)
    assert condition["energy_above_cutoff"] == pytest.approx(3.2958e-4, rel=1e-4)
    assert condition["staircase_energy_above_cutoff"] > condition["energy_above_cutoff"]
    assert condition["displacements"]["computed_by"]["modes"] == 40
    assert {warning["code"] for warning in facts["warnings"]} > USUAL


@pytest.mark.slow
def test_the_exit_code_and_the_page_follow_the_verdict(run: Run) -> None:
    unfit = "[burst]\nfrequency_hz = 2800\n"
    for text, exit_code in ((unfit, 1), (EASY, 0), (unfit + 'accept_unfit = "why"\n', 0)):
        Path("study.toml").write_text(text)
        for options in ((), ("--json",)):
            result = run("check", "study.toml", *options)
            assert (result.exit_code, result.stderr) == (exit_code, "")
        page = run("check", "study.toml").stdout
        assert page.splitlines()[-1].startswith("verdict  ")
        for warning in facts_of(text)["warnings"]:
            if warning["code"] in {"energy_above_cutoff", "assumed_value", "accepted_stimulus"}:
                assert warning["message"] in page


@pytest.mark.slow
def test_the_cutoff_of_a_supported_strip_is_equation_14() -> None:
    found = check_study(study_from_text('strip.edge = "simply-supported"', "s.toml"))
    expected_hz = (
        math.pi / (4 * math.sqrt(3)) * 0.0005 / 0.025**2 * math.sqrt(67e9 / 2700 / (1 - 0.346**2))
    )
    assert found.study.strip.edge is SIMPLY_SUPPORTED
    assert found.cutoff_hz == pytest.approx(expected_hz, rel=1e-12)
    assert found.edge_stiffness_n is None


def test_more_trials_take_longer() -> None:
    design = ("trials_per_side = 50", "trials_per_side = 75", "practice_trials = 50")
    short, paper, practised = (facts_of(f"[design]\n{keys}", ())["duration_s"] for keys in design)
    assert short < paper < practised
    # 155 trials of 1.5 s of foreperiod and 0.8 s for an answer, and breaks
    facts = facts_of("[design]\nbreak_every = 0\nforeperiod_s = [1, 2]", ())
    assert facts["blocks"] == 1
    more = facts_of("[design]\nbreak_every = 0\nforeperiod_s = [2, 3]", ())
    assert more["duration_s"] - facts["duration_s"] == pytest.approx(155)


@pytest.mark.slow
def test_the_check_states_displacements_and_levels_of_both_fingers() -> None:
    stated, assumed = (displacements(text)["left"] for text in ("[strip]\nloss_factor = 0.01", ""))
    (at,), (worst,) = stated["fingers"], assumed["fingers"]
    assert (at["finger"], at["level_of"]) == ("right", None)
    level_db = 20 * math.log10(at["peak_um"] / stated["own_um"])
    assert at["level_db"] == pytest.approx(level_db, abs=0.01)
    # where no loss is stated the micrometres are those of 0.01, the level is the worst one
    assert (assumed["own_um"], worst["peak_um"]) == (stated["own_um"], at["peak_um"])
    assert worst["level_of"] == {"finger_load": False, "loss_factor": 0.005}
    assert worst["level_db"] > at["level_db"]
    unknown = displacements(discs())["left"]
    assert (unknown["basis"], unknown["own_um"], unknown["fingers"][0]["peak_um"]) == (None,) * 3
    assert unknown["fingers"][0]["level_db"] < -20
    array = displacements(ARRAY)
    assert list(array) == ["left", "right", "mid"]
    assert [finger["finger"] for finger in array["mid"]["fingers"]] == ["left", "right"]
    assert array["mid"]["fingers"][1]["level_db"] > -20


@pytest.mark.slow
def test_a_chosen_window_and_those_that_were_too_loud_are_stated() -> None:
    (condition,) = facts_of('[burst]\nwindow = "auto"\nwanted_level_db = -45\n')["conditions"]
    burst, louder = condition["burst"], condition["windows_too_loud"]
    assert burst["window"] in {"tukey", "gaussian", "hann"}
    assert (burst["wanted_level_db"], louder[0]["window"]) == (-45, "none")
    assert all(window["level_db"] > -45 for window in louder)
    assert (burst["cycles"], burst["window"]) not in {
        (window["cycles"], window["window"]) for window in louder
    }


@pytest.mark.slow
def test_a_click_is_checked_like_a_burst() -> None:
    samples = [math.sin(2 * math.pi * k / 96) for k in range(96)]
    Path("click.csv").write_text("".join(f"{value:.9f}\n" for value in [*samples, 0.0]))
    text = '[burst]\nfile = "click.csv"\n'
    (click,), (burst,) = (facts_of(one)["conditions"] for one in (text, ""))
    # the click is the paper's burst, sampled
    for key in ("energy_above_cutoff", "staircase_energy_above_cutoff"):
        assert click[key] == pytest.approx(burst[key], rel=0.02)
    assert click["band_hz"] == pytest.approx(burst["band_hz"], rel=1e-3)
    own_um = displacements(text)["left"]["own_um"]
    assert own_um == pytest.approx(displacements("")["left"]["own_um"], rel=1e-3)


def test_a_refusal_is_one_line_and_other_exit_codes_are_kept() -> None:
    def fails(error: Exception) -> Any:
        @refusals
        def fail() -> None:
            raise error

        return fail

    with pytest.raises(CommandError, match=r"^first second$") as caught:
        fails(ValueError("first\nsecond"))()
    assert caught.value.exit_code == 2
    for mistake in (BrokenPipeError(), KeyError("levels")):  # of the program, no refusal
        with pytest.raises(type(mistake)):
            fails(mistake)()
    command = click.command()(fails(CommandError("gone", exit_code=3)))
    result = CliRunner().invoke(command, [])
    assert (result.exit_code, result.stderr) == (3, "error: gone\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "needs"),
    [
        ("", ["masking noise"]),
        ('[masking]\nnoise = "none"\n', []),
        (
            '[device]\ndriver = "serial"\nport = "/no/such/port"\n[masking]\nnoise = "none"\n',
            ["device"],
        ),
        (
            '[device]\ndriver = "audio"\nport = "card"\nvolts_full_scale = 100\n',
            ["device", "masking noise"],
        ),
    ],
)
def test_what_the_machine_lacks_is_a_warning_and_changes_no_verdict(
    text: str, needs: list[str], run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    lack = SimpleNamespace(what="sound card", remedy="plug one in")
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: lack)
    Path("study.toml").write_text(text)
    facts = json.loads(run("check", "study.toml", "--json").stdout)
    lacking = [need for need in facts["machine"] if not need["need"].startswith("--responder")]
    assert [need["need"] for need in lacking] == needs
    assert codes_of(facts).count("missing_equipment") == len(facts["machine"])
    assert facts["verdict"] == "fit"


@pytest.mark.slow
def test_a_window_needs_psychopy_and_a_display(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    Path("study.toml").touch()
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr("experiment.participant.window.find_spec", lambda name: None)
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: None)
    for version, display, lacks in (
        ((3, 12), "", ["PsychoPy", "display"]),
        ((3, 13), ":0", ["Python 3.11 or 3.12"]),
    ):
        monkeypatch.setattr(sys, "version_info", version)
        monkeypatch.setenv("DISPLAY", display)
        facts = json.loads(run("check", "study.toml", "--json").stdout)
        assert [need["lacks"] for need in facts["machine"]] == lacks


@pytest.mark.slow
def test_a_measured_cutoff_beside_ideal_edges_is_compared_and_not_used() -> None:
    text = STEEL + discs()
    strip, without = (
        facts_of(one)["strip"] for one in (text, text.replace("measured_", "# measured_"))
    )
    assert strip["cutoff_hz"] == without["cutoff_hz"]
    assert strip["measured_cutoff_hz"] == 1700
    off = strip["measured_above_computed"]
    assert off == pytest.approx(1700 / strip["cutoff_hz"] - 1)
    # cut-offs go as thickness
    assert f"{0.3 * (1 + off):.3g} mm" in message_of(facts_of(text), "cutoff_mismatch")
    assert (without["measured_cutoff_hz"], without["measured_above_computed"]) == (None, None)
    plate = paper_study().plate  # a thickness that makes no plate is not named
    assert "4.28 mm" in plate.fitting(4400.0, 150e3)
    assert "thickness" not in plate.fitting(4400.0, 150e3)


@pytest.mark.slow
def test_a_burst_much_slower_than_the_cut_off_keeps_the_modes_that_its_level_needs() -> None:
    """The contour solver says -36.303 dB of the left actuator at the right finger."""
    actuator = '[[actuator]]\nside = "{}"\nx_mm = {}\ndiameter_mm = 12\nfinger_diameter_mm = 6\n'
    text = (
        "[strip]\nwidth_mm = 25\nthickness_mm = 0.5\nlength_mm = 906\nyoungs_modulus_gpa = 71\n"
        "poisson_ratio = 0.22\ndensity_kg_m3 = 2500\nloss_factor = 0.005\n"
        'edge = "simply-supported"\n'
        + actuator.format("left", -25)
        + actuator.format("right", 42)
        + "[burst]\nfrequency_hz = 150\ncycles = 2\n"
    )
    (at,) = displacements(text)["left"]["fingers"]
    assert at["level_db"] == pytest.approx(-36.303, abs=0.01)


# --- thresholds of simulated participants --------------------------------------------------------

BOTH = discs(measured(1.8, 200), x_mm=40)
OUT = "threshold_outside_levels"


def known(text: str, driver: str | None = None) -> dict[str, Any]:
    """Return the check of a study whose displacements are known, which takes no time."""
    return facts_of(text + BOTH, (KNOWN,), driver)


@pytest.mark.parametrize(
    ("keys", "threshold_vpp", "source", "lie", "code"),
    [
        ("", 1.57 / 0.009, "assumed", "around", "threshold_near_end_of_levels"),
        ("[simulation]\nthreshold_um = 1.08\n", 120.0, "yours", "around", None),
        ("[simulation]\nthreshold_vpp = 100\n", 100.0, "yours", "around", None),
        (
            "[design]\nlevels_vpp = [60, 140]\n",
            None,
            "assumed",
            "below",
            "threshold_outside_levels",
        ),
        (
            "[design]\nlevels_vpp = [60, 140]\n[device]\nceiling_vpp = 150\n",
            None,
            "assumed",
            "below",
            "threshold_outside_levels",
        ),
        (
            "[design]\nlevels_vpp = [175, 200]\n",
            None,
            "assumed",
            "above",
            "threshold_outside_levels",
        ),
    ],
)  # fmt: skip - rows of a table
def test_where_levels_lie_re_the_threshold_is_stated(
    keys: str, threshold_vpp: float | None, source: str, lie: str, code: str | None
) -> None:
    facts = known(keys)
    threshold = facts["simulated_threshold"]
    assert threshold["threshold_vpp"] == pytest.approx(threshold_vpp or 1.57 / 0.009)
    assert threshold["threshold_um"] == pytest.approx(0.009 * threshold["threshold_vpp"])
    assert (threshold["source"], threshold["levels_lie"]) == (source, lie)
    found = [one for one in codes_of(facts) if one.startswith("threshold_")]
    assert found == ([] if code is None else [code])
    if "ceiling" in keys:
        assert threshold["highest_vpp"] == 150
        assert "device.ceiling_vpp = 150 V" in message_of(facts, str(code))


@pytest.mark.parametrize(
    ("levels", "parts"),
    [
        ("[50, 61, 75, 92, 129]", ["4 of 5", "0.6 dB", "15%"]),
        ("[60, 169]", ["1 of 2", "3.0 dB"]),
        ("[90, 160, 200]", ["2 of 3", "2.5 dB"]),
        ("[100, 130]", ["1.6 dB", "0.7 dB"]),
        ("[60, 170]", None),
    ],
)
def test_levels_that_hardly_reach_beyond_the_threshold_are_a_warning_and_fit(
    levels: str, parts: list[str] | None
) -> None:
    facts = known(f"[simulation]\nthreshold_um = 1.08\n[design]\nlevels_vpp = {levels}\n")
    code = "threshold_near_end_of_levels"
    assert (facts["verdict"], code in codes_of(facts)) == ("fit", parts is not None)
    message = message_of(facts, code) if parts else ""
    assert [part for part in parts or () if part not in message] == []


def test_each_condition_has_the_median_that_its_participants_have() -> None:
    text = (
        "[burst]\nwindow = 'hann'\n[design]\nlevels_vpp = [60, 180]\n"
        '[[condition]]\nname = "main"\ncycles = 2\n[[condition]]\nname = "long"\ncycles = 8\n'
        "[simulation]\nthreshold_um = 1.08\nthreshold_at_s = 0.004\n{}"
    )
    weaker = replace(KNOWN, condition="long", per_vpp=((0.0045, 0.0001), (0.0001, 0.0045)))
    plain, harder = (
        facts_of(text.format(more) + BOTH, (KNOWN, weaker)) for more in ("", "difference_db = 6\n")
    )
    # Hann's window leaves 0.496 of a sine's energy in 2 cycles and 0.382 in 8: 3.02 dB more than
    # without, and 4.85 dB less for four times as long; half of the motion is 6.02 dB more.
    volts = plain["simulated_thresholds_vpp"]
    assert volts == {"main": pytest.approx(170, abs=0.5), "long": pytest.approx(195, abs=0.5)}
    assert harder["simulated_thresholds_vpp"]["main"] == volts["main"]
    assert harder["simulated_thresholds_vpp"]["long"] == pytest.approx(
        volts["long"] * 1.995, rel=1e-3
    )
    (outside,) = plain["simulation_unmeasured"]
    assert "0.01 to 1 s" in outside
    assert codes_of(plain).count("threshold_outside_curves") == 1


@pytest.mark.parametrize(
    ("right", "left", "db"), [(0.009, 0.009, None), (0.009, 0.018, -6.0), (0.02, 0.01, 6.0)]
)
def test_sides_that_the_same_volts_move_unequally_are_a_warning(
    right: float, left: float, db: float | None
) -> None:
    gains = replace(KNOWN, per_vpp=((left, 0.0001), (0.0001, right)))
    facts = facts_of(BOTH, (gains,))
    (condition,) = facts["conditions"]
    more_db = condition["displacements"]["right_re_left_db"]
    assert more_db == pytest.approx(db or 0.0, abs=0.05)
    assert ("unequal_sides" in codes_of(facts)) == (db is not None)
    assert finger_gains((left, 0.0), (0.0, right)).right_re_left_db == pytest.approx(more_db)


# --- what drives, and what a session asks of it --------------------------------------------------

CARD = '[design]\nlevels_vpp = [20, 52]\n[device]\ndriver = "audio"\nceiling_vpp = {}\n'


@pytest.mark.parametrize(
    ("ceiling_vpp", "full_scale_v", "code"),
    [
        (60, 30, None),
        (60, 47.5, "full_scale_above_ceiling"),
        (60, 28.3, "ceiling_above_full_scale"),
        (113.0, 56.6, None),  # twice the full scale in round numbers
        (200.0, 56.6, "ceiling_above_full_scale"),
        (100.0, 56.6, "full_scale_above_ceiling"),
    ],
)
def test_a_full_scale_other_than_the_ceiling_is_a_warning(
    ceiling_vpp: float, full_scale_v: float, code: str | None
) -> None:
    facts = known(f"{CARD.format(ceiling_vpp)}volts_full_scale = {full_scale_v}\n")
    codes = {"full_scale_above_ceiling", "ceiling_above_full_scale"}
    assert codes & {*codes_of(facts)} == ({code} if code else set())
    assert facts["verdict"] == "fit"
    if code:
        assert f"{2 * full_scale_v:g} V" in message_of(facts, code)
    assert not codes & {*codes_of(known(f"[device]\nvolts_full_scale = {full_scale_v}\n"))}


def test_what_run_asks_and_refuses_is_stated() -> None:
    mock, card = known(""), known("", driver="audio")
    assert "--practice-without-device" in mock["run_asks"]
    assert "practice_device" not in codes_of(card)
    channels = '[device]\nchannels = [3, 4]\n[masking]\nsound_card = "other"\n'
    facts = known(channels, driver="audio")
    keys, others = facts["run_refuses"]
    assert "device.port and device.volts_full_scale" in keys
    assert "[1, 2]" in others
    assert "got [3, 4]" in others
    assert codes_of(facts).count("refused_device") == 2
    assert known("")["run_refuses"] == []


INPUT = (
    'source = "input"\ntap = "line"\nsound_card = "x"\nper_unit = [1, 1]\nmeasured_by = "us"\n'
    "measured_on = 2026-05-04\n"
)


@pytest.mark.parametrize(
    ("monitor", "code"),
    [
        ('source = "none"\nsound_card = "x"', "unused_monitor"),
        ('source = "none"', None),
        (INPUT, "narrow_onset_tolerance"),
        (INPUT + "onset_tolerance_ms = 20", None),
    ],
)
def test_a_monitor_that_cannot_be_right_is_a_warning(monitor: str, code: str | None) -> None:
    facts = known(f"[monitor]\n{monitor}\n[device]\ndriver = 'generator'\n")
    codes = {"unused_monitor", "narrow_onset_tolerance"} & {*codes_of(facts)}
    assert codes == ({code} if code else set())
