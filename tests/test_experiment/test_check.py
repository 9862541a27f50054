"""`tactstrip check`: verdicts, warnings, and the numbers of its JSON output."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import click
import pytest
from click.testing import CliRunner

from experiment import paper_study
from experiment.exits import CommandError, refusals
from tests.plates import on_paper_plate
from tests.test_experiment.people import finger_gains
from tests.test_experiment.studies import (
    KNOWN,
    cases,
    codes_of,
    discs,
    facts_of,
    measured,
)

if TYPE_CHECKING:
    from tests.conftest import Run

"""The level at the other finger of the paper's burst lies between -23 and -40 dB."""
ARRAY = discs(measured()) + ('[[actuator]]\nname = "mid"\nx_mm = 22\ndiameter_mm = 12.8\n')
"""The paper's second plate."""
STEEL = (
    '[strip]\nwidth_mm = 30\nthickness_mm = 0.3\nlength_mm = 200\nmaterial = "steel"\n'
    'edge = "clamped"\nmeasured_cutoff_hz = 1700\nmeasured_by = "A. Person"\n'
)


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


EASY = "[burst]\nfrequency_hz = 250.0\ncycles = 3\nwindow = 'hann'\n"
USUAL = {
    *("practice_device", "assumed_value", "assumed_position"),
    *("unknown_contact", "assumed_loss", "ambiguous_cutoff"),
}
OUTSIDE = {"threshold_outside_levels", "threshold_of_another_plate"}


def displacements(text: str) -> dict[str, dict[str, Any]]:
    moved = facts_of(text)["conditions"][0]["displacements"]
    return {actuator["name"]: actuator for actuator in moved["actuators"]}


@pytest.mark.slow
@pytest.mark.parametrize(("text", "expected"), cases("checks"))
def test_a_check_has_a_verdict_and_warnings(text: str, expected: str) -> None:
    facts = facts_of(text)
    codes = sorted({*codes_of(facts)} - USUAL - OUTSIDE)
    assert [facts["verdict"].split()[0], *codes] == expected.split()
    reasons = [reason for condition in facts["conditions"] for reason in condition["reasons"]]
    assert (facts["verdict"] == "within limits") == (reasons == [])
    assumed = "loss_factor" not in text and "endless" not in text
    assert ("assumed_loss" in codes_of(facts)) == assumed
    elastic = facts["strip"]["edge"] == "measured-cutoff"
    assert ("ambiguous_cutoff" in codes_of(facts)) == elastic


def test_the_check_of_the_papers_study_is_one_json_object(run: Run) -> None:
    assert run("init").exit_code == 0
    result = run("check", "study.toml", "--json")
    assert (result.exit_code, result.stderr, result.stdout.count("\n")) == (0, "", 1)
    facts = json.loads(result.stdout)
    assert (facts["verdict"], facts["study"]["sha256"]) == ("within limits", paper_study().sha256)
    assert (facts["strip"]["cutoff_hz"], facts["trials"]) == (pytest.approx(2900.0), 155)
    assert facts["strip"]["edge_stiffness_n"] == pytest.approx(141.72, abs=0.005)
    (condition,) = facts["conditions"]
    assert condition["band_hz"] == pytest.approx([205.634, 654.393], abs=1e-3)
    # one cycle of 500 Hz, no window: 3.2958e-4 above 2.9 kHz (40-digit integration)
    assert condition["energy_above_cutoff"] == pytest.approx(3.2958e-4, rel=1e-4)
    assert condition["staircase_energy_above_cutoff"] > condition["energy_above_cutoff"]
    (work,) = condition["displacements"]["work"]
    assert work.endswith("in 2 of 4 symmetries")
    assert {warning["code"] for warning in facts["warnings"]} > USUAL


@pytest.mark.slow
def test_the_check_states_displacements_and_levels_of_both_fingers() -> None:
    stated, assumed = (displacements(text)["left"] for text in ("[strip]\nloss_factor = 0.01", ""))
    (at,), (worst,) = stated["fingers"], assumed["fingers"]
    assert (at["finger"], at["variants"]) == ("right", [])
    level_db = 20 * math.log10(at["peak_um"] / stated["peak_um"])
    assert at["crosstalk_db"] == pytest.approx(level_db, abs=0.01)
    # where no loss is set the micrometres are those of 0.01, the crosstalk is the worst
    assert (assumed["peak_um"], worst["peak_um"]) == (stated["peak_um"], at["peak_um"])
    low, high = worst["variants"]
    assert (low["loss_factor"], low["finger_load"], high["loss_factor"]) == (0.005, False, 0.02)
    assert worst["crosstalk_db"] == low["crosstalk_db"] > high["crosstalk_db"]
    unknown = displacements(discs())["left"]
    assert (unknown["basis"], unknown["peak_um"], unknown["fingers"][0]["peak_um"]) == (None,) * 3
    assert unknown["fingers"][0]["crosstalk_db"] < -20
    array = displacements(ARRAY)
    assert list(array) == ["left", "right", "mid"]
    assert [finger["finger"] for finger in array["mid"]["fingers"]] == ["left", "right"]
    assert array["mid"]["fingers"][1]["crosstalk_db"] > -20


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
    Path("study.toml").write_text(on_paper_plate(text))
    facts = json.loads(run("check", "study.toml", "--json").stdout)
    lacking = [need for need in facts["machine"] if not need["need"].startswith("--responder")]
    assert [need["need"] for need in lacking] == needs
    assert codes_of(facts).count("missing_equipment") == len(facts["machine"])
    assert facts["verdict"] == "within limits"


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
    (warning,) = (one for one in facts_of(text)["warnings"] if one["code"] == "cutoff_mismatch")
    assert warning["data"]["deviation"] == off
    assert (without["measured_cutoff_hz"], without["measured_above_computed"]) == (None, None)


# --- thresholds of simulated participants --------------------------------------------------------

BOTH = discs(measured(1.8, 200), x_mm=40)
OUT = "threshold_outside_levels"


def known(text: str, driver: str | None = None) -> dict[str, Any]:
    """Return the check of a study whose displacements are known, which takes no time."""
    return facts_of(text + BOTH, (KNOWN,), driver)


BELOW, ABOVE = "[design]\nlevels_vpp = [60, 140]\n", "[design]\nlevels_vpp = [175, 200]\n"


@pytest.mark.parametrize(
    ("keys", "threshold_vpp", "is_set", "lie", "code"),
    [
        ("", 174.4, False, "around", "threshold_near_end_of_levels"),
        ("[simulation]\nthreshold_um = 1.08\n", 120.0, True, "around", ""),
        ("[simulation]\nthreshold_vpp = 100\n", 100.0, True, "around", ""),
        (BELOW, 174.4, False, "below", OUT),
        (ABOVE, 174.4, False, "above", OUT),
    ],
)
def test_where_levels_lie_re_the_threshold_is_stated(
    keys: str, threshold_vpp: float, *, is_set: bool, lie: str, code: str
) -> None:
    facts = known(keys)
    (threshold,) = facts["simulated"]["thresholds"]
    assert threshold["threshold_vpp"] == pytest.approx(threshold_vpp, abs=0.05)
    assert threshold["threshold_um"] == pytest.approx(0.009 * threshold["threshold_vpp"])
    assert (facts["simulated"]["is_set"], threshold["levels_lie"]) == (is_set, lie)
    assert [one for one in codes_of(facts) if one.startswith("threshold_")] == code.split()


@pytest.mark.parametrize(
    ("levels", "reach_db"),
    [
        ("[50, 61, 75, 92, 129]", (-7.6, 0.6)),
        ("[60, 169]", (-6.0, 3.0)),
        ("[90, 160, 200]", (-2.5, 4.4)),
        ("[100, 130]", (-1.6, 0.7)),
        ("[60, 170]", None),
    ],
)
def test_levels_that_hardly_reach_beyond_the_threshold_are_a_warning(
    levels: str, reach_db: tuple[float, float] | None
) -> None:
    facts = known(f"[simulation]\nthreshold_um = 1.08\n[design]\nlevels_vpp = {levels}\n")
    data = [
        one["data"] for one in facts["warnings"] if one["code"] == "threshold_near_end_of_levels"
    ]
    assert facts["verdict"] == "within limits"
    expected = [] if reach_db is None else [pytest.approx(reach_db, abs=0.05)]
    assert [(one["low_db"], one["high_db"]) for one in data] == expected


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
    volts, harder_v = (
        {one["condition"]: one["threshold_vpp"] for one in facts["simulated"]["thresholds"]}
        for facts in (plain, harder)
    )
    assert volts == {"main": pytest.approx(170, abs=0.5), "long": pytest.approx(195, abs=0.5)}
    assert harder_v["main"] == volts["main"]
    assert harder_v["long"] == pytest.approx(volts["long"] * 1.995, rel=1e-3)
    (outside,) = (
        one["data"] for one in plain["warnings"] if one["code"] == "threshold_outside_curves"
    )
    assert (outside["min"], outside["max"]) == (0.01, 1.0)


@pytest.mark.parametrize(
    ("right", "left", "db"), [(0.009, 0.009, None), (0.009, 0.018, -6.0), (0.02, 0.01, 6.0)]
)
def test_sides_that_the_same_volts_move_unequally_are_a_warning(
    right: float, left: float, db: float | None
) -> None:
    gains = replace(KNOWN, per_vpp=((left, 0.0001), (0.0001, right)))
    facts = facts_of(BOTH, (gains,))
    (condition,) = facts["conditions"]
    more_db = condition["displacements"]["re_first_db"][1]
    assert more_db == pytest.approx(db or 0.0, abs=0.05)
    assert ("unequal_sides" in codes_of(facts)) == (db is not None)
    assert finger_gains((left, 0.0), (0.0, right)).re_first_db[1] == pytest.approx(more_db)


# --- what drives, and what a session asks of it --------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "codes"),
    [
        ("ceiling_vpp = 60\nvolts_full_scale = 30", ""),
        ("ceiling_vpp = 60\nvolts_full_scale = 47.5", "full_scale_above_ceiling"),
        ("ceiling_vpp = 60\nvolts_full_scale = 28.3", "ceiling_above_full_scale"),
        ("ceiling_vpp = 113\nvolts_full_scale = 56.6", ""),  # twice that in round numbers
        ("channels = [3, 4]\nvolts_full_scale = 100", "refused_device"),
        ("volts_full_scale = 100\n[monitor]\nsource = 'none'", ""),
        ("volts_full_scale = 100\n[monitor]\nsource = 'none'\nsound_card = 'x'", "unused_monitor"),
        ("volts_full_scale = 100\n[masking]\nsound_card = ''", "refused_device"),
    ],
)
def test_what_drives_and_measures_has_warnings(keys: str, codes: str) -> None:
    """Of a sound card; the mock uses no full scale, and is for practice only."""
    if "masking" not in keys:
        keys += "\n[masking]\nsound_card = 'other'"
    text = f"[design]\nlevels_vpp = [20, 52]\n[device]\nport = 'card'\n{keys}\n"
    facts = known(text, driver="audio")
    names = ("full_scale", "monitor", "refused", "practice")
    found = [code for code in codes_of(facts) if any(name in code for name in names)]
    assert (" ".join(found), facts["verdict"]) == (codes, "within limits")
    assert len(facts["run_refuses"]) == codes.count("refused_device")
    mock = known(text)
    assert "practice_device" in codes_of(mock)
    assert not [code for code in codes_of(mock) if "full_scale" in code]


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "recommended", "realistic"])
def test_the_first_page_of_a_preset_is_short(
    preset: str, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    assert run("init", "study.toml", "--preset", preset).exit_code == 0
    lines = run("check", "study.toml").stdout.splitlines()
    assert lines[0].startswith("verdict")
    assert len(lines) <= 14
    assert max(map(len, lines)) <= 100
    details = run("check", "study.toml", "--details").stdout.splitlines()
    assert len(details) > len(lines)
    assert max(map(len, details)) <= 100
