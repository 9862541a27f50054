"""What `tactstrip check` foretells: thresholds on this plate, half a calibration, what run asks."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import pytest

from experiment.apparatus.rig import full_scale_words, lacking_of
from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.preview.plate import drive_of
from experiment.study.origins import ASSUMED
from experiment.study.read import study_from_text
from experiment.study.sections.equipment import DeviceSettings
from experiment.study.simulated import median_threshold, people_words, unmeasured, unmeasured_words
from experiment.terms.gains import ConditionGains

if TYPE_CHECKING:
    from experiment.preview.findings import Findings

DISCS: Final = '[[actuator]]\nside = "{}"\nx_mm = {}\ndiameter_mm = 12\n'
MEASURED: Final = "measured_displacement_um = 1.8\nmeasured_at_vpp = 100\nmeasured_at_hz = 200\n"
LEFT, RIGHT = DISCS.format("left", -40), DISCS.format("right", 40)
BOTH: Final = LEFT + MEASURED + RIGHT + MEASURED
KNOWN: Final = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=("measured", "measured"),
    per_vpp=((0.009, 0.0001), (0.0001, 0.009)),
)
HALF: Final = replace(KNOWN, bases=("measured", None), per_vpp=((0.009, 0.01), (0.0001, 1.0)))


def told(text: str, gains: ConditionGains = KNOWN, driver: str | None = None) -> Findings:
    """Check a study whose gains are given, which takes no time."""
    study = study_from_text(text, "study.toml")
    device = study.device if driver is None else replace(study.device, driver=driver)
    return check_findings(check_study(study, gains=(gains,)), "study.toml", device=device)


def test_the_threshold_on_this_plate_is_told_with_who_says_so() -> None:
    assumed, stated = told(BOTH), told("[simulation]\nthreshold_um = 1.08\n" + BOTH)
    line = next(one for one in assumed.lines if one.startswith("simulation"))
    assert line[15:] == "Assumed: median threshold 174 V (1.57 um), SD between people 1.5 dB."
    assert "As the study states: median threshold 120 V (1.08 um)" in stated.text
    assert stated.facts["simulated_threshold"] == {
        "threshold_vpp": pytest.approx(120.0),
        "threshold_um": pytest.approx(1.08),
        "source": "yours",
        "levels_lie": "around",
        "levels_db": pytest.approx((-6.02, 4.44), abs=0.01),
        "highest_vpp": 200.0,
    }


def test_a_threshold_in_volts_has_its_micrometres_where_they_are_known() -> None:
    stated = "[simulation]\nthreshold_vpp = 100\n"
    assert "median threshold 100 V (0.9 um)" in told(stated + BOTH).text
    assert "median threshold 100 V, SD" in told(stated + LEFT + RIGHT, HALF).text
    found = median_threshold(study_from_text(stated + BOTH, "study.toml"), KNOWN.fingers())
    assert (found.source_doubt, found.levels_doubt) == ("", "")
    recipe = "state simulation.threshold_um instead; 'Which levels for a new plate', docs/plate.md"
    assert recipe in replace(found, whose=ASSUMED[0]).source_doubt
    unmeasured = replace(found, whose=ASSUMED[0], peak_um=None).source_doubt
    assert "is unknown until displacements are measured, or predicted" in unmeasured
    both = told(f"[design]\nlevels_vpp = [1, 2]\n{LEFT}{RIGHT}", HALF).lines
    (line,) = [one for one in both if "All levels lie below that" in one]
    assert "It is the paper's, of one cycle of 500 Hz in volts of its own plate" in line
    assert "a dry run has an open interval" in line


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("[design]\nlevels_vpp = [60, 140]\n", "All levels lie below that: expect an open"),
        (
            "[design]\nlevels_vpp = [60, 140]\n[device]\nceiling_vpp = 150\n",
            "All levels lie below that, as does device.ceiling_vpp = 150 V: expect an open",
        ),
        ("[design]\nlevels_vpp = [175, 200]\n", "All levels lie above that: expect an open"),
        ("", None),
    ],
)
def test_levels_on_one_side_of_the_threshold_and_a_ceiling_below_it_are_told(
    keys: str, words: str | None
) -> None:
    found = told(keys + BOTH).text
    assert ("All levels lie" in found) is (words is not None)
    assert words is None or words in found


@pytest.mark.parametrize(
    ("levels", "words"),
    [
        (
            "[50, 61, 75, 92, 129]",
            (
                "4 of 5 levels lie below that, the highest 0.6 dB above: the median person would "
                "feel about 15% of the stimuli; see 'Which levels for a new plate', docs/plate.md."
            ),
        ),
        ("[60, 169]", "1 of 2 levels lies below that, the highest 3.0 dB above: the median"),
        ("[90, 160, 200]", "2 of 3 levels lie above that, the lowest 2.5 dB below: the median"),
        ("[100, 130]", "The levels reach only from 1.6 dB below that to 0.7 dB above, a narrow"),
        ("[60, 170]", ""),
    ],
)
def test_levels_that_hardly_reach_beyond_the_threshold_are_told_and_are_fit(
    levels: str, words: str
) -> None:
    text = f"[simulation]\nthreshold_um = 1.08\n[design]\nlevels_vpp = {levels}\n{BOTH}"
    doubt = median_threshold(study_from_text(text, "study.toml"), KNOWN.fingers()).levels_doubt
    assert doubt.startswith(words)
    assert bool(doubt) is bool(words)
    assert "verdict        fit" in told(text).text


def test_each_condition_has_the_median_that_its_people_have() -> None:
    conditions = "".join(
        f'[[condition]]\nname = "{name}"\ncycles = {cycles}\n'
        for name, cycles in (("short", 2), ("long", 8))
    )
    people = "[simulation]\nthreshold_um = 1.08\nthreshold_at_s = 0.004\n"
    text = f"[burst]\nwindow = 'hann'\n[design]\nlevels_vpp = [60, 180]\n{conditions}{people}"

    def words(more: str = "") -> str:
        study = study_from_text(text + more + BOTH, "study.toml")
        weaker = replace(KNOWN, per_vpp=((0.0045, 0.0001), (0.0001, 0.0045)))
        return " ".join(people_words(study, [KNOWN.fingers(), weaker.fingers()]))

    # Hann's window leaves 0.496 of a sine's energy in 2 cycles and 0.382 in 8: 3.02 dB more than
    # without, and 4.85 dB less for four times as long; half of the motion is 6.02 dB more.
    assert words().startswith(
        "As the study states, 1.08 um at 0.004 s: median threshold 170 V (1.53 um) in short, "
        "195 V (0.876 um) in long, SD between people 1.5 dB."
    )
    assert "195 V (0.876 um) in long" not in words("difference_db = 6\n")
    assert "388 V (1.75 um) in long" in words("difference_db = 6\n")
    assert "In long: All levels lie below that" in words("difference_db = 6\n")


def test_a_check_and_a_dry_run_say_the_same_of_the_threshold() -> None:
    study = study_from_text("[design]\nlevels_vpp = [60, 140]\n" + BOTH, "study.toml")
    for words in people_words(study, [KNOWN.fingers()]):
        assert words in told("[design]\nlevels_vpp = [60, 140]\n" + BOTH).text
    assert median_threshold(study, KNOWN.fingers()).levels_lie == "below"


@pytest.mark.slow
def test_one_measured_disc_of_two_is_told_by_check_and_by_field() -> None:
    study = study_from_text(LEFT + MEASURED + RIGHT, "study.toml")
    assert drive_of(study).doubt == (
        "no displacement is stated of right, so that of left is not used: docs/plate.md; "
        'measured_as = "as-left" or "as-right" assumes two like actuators to move alike'
    )
    assert drive_of(study_from_text(BOTH, "study.toml")).doubt == ""
    assert drive_of(study_from_text(LEFT + RIGHT, "study.toml")).doubt == ""
    words = "with none of the right actuator, trials.csv has no micrometres"
    assert words in told(LEFT + MEASURED + RIGHT, HALF).text
    assert words not in told(BOTH).text


def test_what_run_asks_before_a_session_is_foretold() -> None:
    mock, card = told(BOTH), told(BOTH, driver="audio")
    assert "--practice-without-device" in mock.facts["run_asks"]
    assert "whether the hardware is safe, 3 things" in card.facts["run_asks"]
    assert f"run            {card.facts['run_asks']}" in card.lines


def test_all_that_run_refuses_of_a_device_is_foretold_at_once() -> None:
    channels = '[device]\nchannels = [3, 4]\n[masking]\nsound_card = "other"\n'
    refused = told(channels + BOTH, driver="audio").facts["run_refuses"]
    assert refused == [
        (
            "device.port and device.volts_full_scale are missing: the driver audio needs them; "
            "--port gives the first too"
        ),
        (
            "channels must be [1, 2] for the driver audio, got [3, 4]: the example "
            "sound_card_channels is a driver that takes others"
        ),
    ]
    assert lacking_of(DeviceSettings(driver="serial")) == (
        "device.port is missing: the driver serial needs it; --port gives it too"
    )


@pytest.mark.slow
def test_windows_that_were_too_loud_are_listed_with_their_levels() -> None:
    auto = '[burst]\nwindow = "auto"\nwanted_level_db = -45\n'
    found = told(auto)
    (condition,) = found.facts["conditions"]
    louder = condition["windows_too_loud"]
    assert louder[0]["window"] == "none"
    assert all(one["level_db"] > -45 for one in louder)
    assert condition["burst"]["window"] not in {
        one["window"] for one in louder if one["cycles"] == condition["burst"]["cycles"]
    }
    assert f"too loud there: 1 cycle: none {louder[0]['level_db']:.1f}" in found.text
    json.loads(found.json)


CARD: Final = '[design]\nlevels_vpp = [20, 52]\n[device]\ndriver = "audio"\n'


def test_the_full_scale_of_a_sound_card_is_told_from_peak_to_peak() -> None:
    right = told(f"{CARD}ceiling_vpp = 60\nvolts_full_scale = 30\n{BOTH}")
    words = "full scale 30 V peak = 60 V peak-to-peak; the highest level, 52 V, is -1.2 dB re that"
    assert f"{'':15}{words}" in right.lines
    assert "anything else that the card plays" not in right.text


def test_a_card_that_can_exceed_the_ceiling_is_warned_of_and_changes_no_verdict() -> None:
    found = told(f"{CARD}ceiling_vpp = 60\nvolts_full_scale = 47.5\n{BOTH}")
    words = (
        "anything else that the card plays, such as a system sound, reaches 95 V peak-to-peak at "
        "the actuator, more than ceiling_vpp = 60 V allows: turn the card down until full scale "
        "is at most that, docs/hardware.md; or, if volts_full_scale = 47.5 was measured from peak "
        "to peak (only then), write half of it"
    )
    assert f"warning        {words}\n" in found.text
    assert found.facts["verdict"] == "fit"


def test_a_ceiling_that_the_card_cannot_reach_is_noted_and_changes_no_verdict() -> None:
    found = told(f"{CARD}ceiling_vpp = 60\nvolts_full_scale = 28.3\n{BOTH}")
    words = (
        "ceiling_vpp = 60 V is more than twice volts_full_scale, 56.6 V, which limits the levels. "
        "If the amplifier bears more than card x gain reaches, write ceiling_vpp = 56.6; or is "
        "volts_full_scale an effective value, not the peak?"
    )
    assert f"note           {words}\n" in found.text
    assert found.facts["verdict"] == "fit"


def test_a_full_scale_that_no_driver_uses_is_not_told() -> None:
    assert "full scale" not in told(f"[device]\nvolts_full_scale = 28.3\n{BOTH}").text


def test_a_ceiling_near_twice_the_full_scale_is_that_in_round_numbers() -> None:
    device = DeviceSettings(driver="audio", ceiling_vpp=113.0, volts_full_scale=56.6)
    told = full_scale_words(device, 113.2)
    assert set(told) == {""}
    assert "is 0.0 dB re that" in told[""]
    assert set(full_scale_words(replace(device, ceiling_vpp=200.0), 113.2)) == {"", "note"}
    assert set(full_scale_words(replace(device, ceiling_vpp=100.0), 113.2)) == {"", "warning"}


def test_a_ceiling_below_the_threshold_has_a_remedy_and_every_end_its_recipe() -> None:
    def doubt(keys: str) -> str:
        study = study_from_text(keys + BOTH, "study.toml")
        return median_threshold(study, KNOWN.fingers()).levels_doubt

    recipe = "see 'Which levels for a new plate', docs/plate.md."
    low = doubt("[design]\nlevels_vpp = [60, 140]\n[device]\nceiling_vpp = 150\n")
    assert low.endswith(
        "or only a bound; more cycles or a frequency nearer to 250 Hz are felt more easily, or "
        f"let the plate move more; {recipe}"
    )
    for levels in ("[60, 140]", "[175, 200]"):
        words = doubt(f"[design]\nlevels_vpp = {levels}\n")
        assert words.endswith(f"an open interval, or only a bound; {recipe}")


def test_curves_that_do_not_reach_the_burst_are_told_in_one_line() -> None:
    people = "[simulation]\nthreshold_um = 1.57\nthreshold_at_hz = 500\nthreshold_at_s = 0.002\n"
    burst = "[burst]\nfrequency_hz = 300\ncycles = 2\n"
    study = study_from_text(people + burst + BOTH, "study.toml")
    words = "durations of 0.01 to 1 s were measured (a window counts by what it leaves of the "
    words += "energy), got 0.00667 s for the burst and 0.002 s "
    words += "in threshold_at_s"
    assert unmeasured(study) == (words,)
    (line,) = [one for one in told(people + burst + BOTH).lines if "were measured" in one]
    assert line.endswith(f"outside published curves: {words}. A pilot tells the true one.")
    assert unmeasured_words(study_from_text(BOTH, "study.toml")) == ""
