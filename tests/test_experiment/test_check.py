"""`tactstrip init` and `tactstrip check`: what they print, refuse and answer with."""

from __future__ import annotations

import functools
import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import pytest
from click.testing import CliRunner

from device.driver import Lack
from experiment.commands.check import check
from experiment.commands.init import write_study_text
from experiment.participant.window import window_lacks
from experiment.preview.check import check_study
from experiment.preview.device import machine_lacks
from experiment.study.read import paper_study, read_study, study_from_text
from experiment.terms.exits import CommandError, refusals
from stimuli import SIMPLY_SUPPORTED
from tactstrip import main

if TYPE_CHECKING:
    from click.testing import Result

    from tests.conftest import Refused, Run

RECOMMENDED = write_study_text("recommended")
UNFIT = "[burst]\nfrequency_hz = 2800\n"
ACCEPTED = 'accept_unfit = "on purpose"\n'
SUPPORTED = '[strip]\nedge = "simply-supported"\n'
DISC = '[[actuator]]\nside = "{}"\nx_mm = {}\ndiameter_mm = 12.8\n'
MEASURED = "measured_displacement_um = 2.6\nmeasured_at_vpp = 100\nmeasured_at_hz = 300\n"
NEAR = DISC.format("left", -9) + MEASURED + DISC.format("right", 9) + MEASURED
UNMEASURED = DISC.format("left", -35) + DISC.format("right", 35)
ARRAY = (
    NEAR.replace("= 9", "= 35").replace("= -9", "= -35")
    + DISC.format("other", 22)
    + 'name = "mid"\n'
)


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@functools.cache
def checked(text: str, *options: str) -> Result:
    """Check a study; once, because what the fingers get takes seconds to compute."""
    Path("study.toml").write_text(text)
    return CliRunner().invoke(main, ["check", "study.toml", *options])


def report(text: str) -> dict[str, Any]:
    """Return what the check says to other programs: one object in one line."""
    printed = checked(text, "--json").stdout
    assert printed.count("\n") == 1
    found: dict[str, Any] = json.loads(printed)
    return found


def test_init_writes_the_papers_protocol_to_study_toml(run: Run) -> None:
    result = run("init")
    assert result.exit_code == 0
    assert "study.toml" in result.stdout
    assert read_study("study.toml") == paper_study()
    assert [path.name for path in Path().iterdir()] == ["study.toml"]


def test_init_writes_the_recommended_preset_where_it_is_told_to(run: Run) -> None:
    assert run("init", "ours.toml", "--preset", "recommended").exit_code == 0
    assert read_study("ours.toml").design.order == "balanced"


def test_init_leaves_an_existing_file_alone(refused: Refused) -> None:
    Path("study.toml").write_text("# mine\n")
    told = "error: study.toml exists and is left as it is; name another file\n"
    assert refused("init") == told


def test_init_follows_no_dangling_link(run: Run) -> None:
    Path("study.toml").symlink_to("elsewhere.toml")
    assert run("init").exit_code == 2
    assert not Path("elsewhere.toml").exists()


def test_an_unknown_preset_is_a_usage_error(refused: Refused) -> None:
    assert "best" in refused("init", "--preset", "best")


@pytest.mark.parametrize("arguments", [("init", "no/study.toml"), ("check", "no/study.toml")])
def test_a_file_that_is_not_there_is_one_line(arguments: tuple[str, str], refused: Refused) -> None:
    assert refused(*arguments) == "error: no/study.toml: No such file or directory\n"


PAPER_TOLD = (
    "sizes: the paper's; material: the paper's (section II-B)",
    "2900.0 Hz, measured by the paper (figure 4); as of elastic edges",
    "2.6 um peak at 100 Vpp and 300 Hz, measured by the paper (section III-B)\n",
    "K = 141.72 N",
    "main: fit",
    "205.6 to 654.4 Hz",
    "155: 75 left, 75 right, 5 both (3.2% of those with a stimulus), 0 blank",
    "greatest displacement within the fingertip's contact area, at any time, at 200 Vpp",
    "um peak, computed from the paper's measurement at 300 Hz; ",
    "of the plate with its free ends",
    "computed by 40 modes up to 23.2 kHz",
    "no loss is stated: the levels are the worse of loss factors 0.005 and 0.02",
    "-20 dB at the other finger is the limit",
    "\nverdict        fit",
)
TWO_CONDITIONS = '[[condition]]\nname = "low"\n[[condition]]\nname = "high"\nfrequency_hz = 2800\n'
LOSSY = "[strip]\nloss_factor = 0.01\nviscous_time_us = 2\n"
ENDLESS = 'length_mm = "endless"\n'
SECOND = "[strip]\nmeasured_cutoff_hz = 2500\nloss_factor = 0.005\n"
"""The paper's second plate."""
LOSSY_TOLD = (
    # 0.01 at the cut-off of 2900 Hz is 0.549 us, and 2 us are there already
    "loss factor 0.01 computed as the viscous time of the same loss",
    "at 2900 Hz: 2.55 us in all",
)
AUTO = '[burst]\nwindow = "auto"\nwanted_level_db = -45\n'
AUTO_TOLD = (
    "window = auto  the shortest with -45 dB at the other finger; it costs ",
    "ms more than the 2 ms stated",
)
QUIET = "[burst]\nmasking_limit_db = {}\n"
"""The level at the other finger of the paper's burst lies between -23 and -40 dB."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "exit_code", "told"),
    [
        ("", 0, PAPER_TOLD),
        (UNFIT, 1, ("main: unfit", "the limit is 0.01", "UNFIT")),
        (
            UNFIT + ACCEPTED,
            0,
            ("main: accepted", "accepted       on purpose", "unfit, and accepted"),
        ),
        (TWO_CONDITIONS, 1, ("low: fit", "high: unfit", "310: 2 conditions with 75 left")),
        (SUPPORTED, 1, ("computed from simply supported edges", "at the right finger -19.6")),
        (SUPPORTED + ENDLESS, 0, ("main: fit", "of an endless strip")),
        (SECOND, 1, ("2500.0 Hz", "at the right finger -19.7")),
        pytest.param(
            RECOMMENDED, 0, ("15 of each side and level", "in 5 blocks"), id="recommended"
        ),
        (QUIET.format(23) + "[design]\nbreak_every = 0\n", 0, (" min in one block\n",)),
        (NEAR, 1, ("UNFIT", " dB re its own finger; the limit is -20 dB")),
        (NEAR + "[burst]\n" + ACCEPTED, 0, ("main: accepted",)),
        (QUIET.format(23), 0, ("main: fit",)),
        (QUIET.format(40), 1, ("main: unfit",)),
        (QUIET.format(40) + "window = 'hann'\n", 0, ("main: fit",)),
        (UNMEASURED, 0, ("n/a, its displacement is not stated; -",)),
        (ARRAY, 0, ("mid            disc 12.8 mm at x = 22",)),
        (AUTO, 0, AUTO_TOLD),
        (LOSSY, 0, LOSSY_TOLD),
    ],
)
def test_the_check_says_whether_a_study_is_fit_and_why(
    text: str, exit_code: int, told: tuple[str, ...]
) -> None:
    result = checked(text)
    assert (result.exit_code, result.stderr) == (exit_code, "")
    assert [words for words in told if words not in result.stdout] == []
    assert result.stdout.splitlines()[-1].startswith("verdict  ")


@pytest.mark.slow
def test_the_check_gives_the_published_energies() -> None:
    # one cycle of 500 Hz, no window: 3.2958e-4 above 2.9 kHz (40-digit integration)
    (condition,) = report("")["conditions"]
    assert condition["energy_above_cutoff"] == pytest.approx(3.2958e-4, rel=1e-4)
    assert condition["staircase_energy_above_cutoff"] > condition["energy_above_cutoff"]


@pytest.mark.slow
def test_a_slow_device_makes_the_papers_burst_unfit_by_its_staircase() -> None:
    found = report("[device]\nsample_rate_hz = 8000")
    (condition,) = found["conditions"]
    assert found["verdict"] == "unfit"
    assert condition["energy_above_cutoff"] < 1e-2 < condition["staircase_energy_above_cutoff"]


@pytest.mark.slow
def test_the_cutoff_of_a_supported_strip_is_equation_14() -> None:
    found = check_study(study_from_text(SUPPORTED, "s.toml"))
    expected_hz = (
        math.pi / (4 * math.sqrt(3)) * 0.0005 / 0.025**2 * math.sqrt(67e9 / 2700 / (1 - 0.346**2))
    )
    assert found.study.strip.edge is SIMPLY_SUPPORTED
    assert found.cutoff_hz == pytest.approx(expected_hz, rel=1e-12)
    assert found.edge_stiffness_n is None


@pytest.mark.slow
def test_more_trials_take_longer() -> None:
    texts = ("trials_per_side = 50", "trials_per_side = 75", "practice_trials = 50")
    short, paper, practised = (
        check_study(study_from_text(f"[design]\n{text}", "s.toml")).duration_s for text in texts
    )
    assert short < paper < practised


@pytest.mark.slow
def test_the_check_tells_what_balanced_makes_of_the_blocks() -> None:
    uneven = RECOMMENDED.replace("break_every = 43", "break_every = 42")
    assert "\nblocks         5 of 43 trials, each side and level 3 times in each\n" in (
        checked(RECOMMENDED).stdout
    )
    assert (
        "\nblocks         15 of 14 or 15 trials, each side and level once in each\n"
        "               all alike, so shorter than break_every = 42; "
        "for 5 of 43 write break_every = 43\n"
    ) in checked(uneven).stdout
    assert report(RECOMMENDED)["block_trials"] == [43] * 5


@pytest.mark.slow
def test_json_says_the_same_to_other_programs() -> None:
    found = report("")
    assert (checked("", "--json").exit_code, found["verdict"]) == (0, "fit")
    assert found["study"]["sha256"] == paper_study().sha256
    assert found["strip"]["cutoff_hz"] == pytest.approx(2900.0)
    assert found["trials"] == 155
    assert found["conditions"][0]["band_hz"] == pytest.approx([205.634, 654.393], abs=1e-3)
    unfit = report(UNFIT)
    assert (checked(UNFIT, "--json").exit_code, unfit["verdict"]) == (1, "unfit")
    assert unfit["conditions"][0]["reasons"]


DISC_AT_9_KHZ = "".join(
    f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12\n'
    "measured_displacement_um = 2\nmeasured_at_vpp = 100\nmeasured_at_hz = 9000\n"
    for side, x_mm in (("left", -35), ("right", 35))
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[design]\ntrails_per_side = 3", "did you mean trials_per_side?"),
        ("[design", "study.toml:1: "),
        ("[device]\nsample_rate_hz = 1500", "do not go together: sample_rate_hz must be"),
        (
            '[design]\norder = "balanced"\nbreak_every = 2',
            "study.toml: design.break_every must be 0 or at least 11",
        ),
        (
            DISC_AT_9_KHZ,
            "study.toml: the left actuator: measured_at_hz must lie below the plate's first mode, ",
        ),
        (DISC_AT_9_KHZ, "from where on its motion depends on its ends and its loss as much"),
        (
            f'[strip]\nlength_mm = "endless"\n{DISC_AT_9_KHZ}',
            "first cut-off, 2900 Hz, from where on its motion depends on its loss as much",
        ),
    ],
)
@pytest.mark.parametrize("options", [(), ("--json",)])
def test_a_study_that_cannot_be_used_exits_2_with_one_line_on_stderr(
    text: str, said: str, options: tuple[str, ...]
) -> None:
    result = checked(text, *options)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith("error: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.process
def test_the_help_imports_neither_numpy_nor_pydantic() -> None:
    program = (
        "import sys, experiment.commands.check\n"
        "print([name for name in ('numpy', 'pydantic', 'rich') if name in sys.modules])"
    )
    command = [sys.executable, "-c", program]
    found = subprocess.run(command, capture_output=True, check=True, text=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("said", ["[device] driver", "--driver"])
def test_a_driver_that_nobody_has_is_refused_by_name(tmp_path: Path, said: str) -> None:
    study = tmp_path / "study.toml"
    study.write_text('[device]\ndriver = "gpib"\n' if said.startswith("[") else "", "utf-8")
    more = [] if said.startswith("[") else ["--device", "--driver", "gpib"]
    result = CliRunner().invoke(check, [str(study), *more])
    assert result.exit_code == 2
    assert result.stderr.endswith(
        "must be one of mock, serial, generator, audio; got 'gpib', which no installed "
        "distribution offers\n"
    )


def displacements(text: str) -> dict[str, dict[str, Any]]:
    found = report(text)["conditions"][0]["displacements"]
    return {one["name"]: one for one in found["actuators"]}


@pytest.mark.slow
def test_the_check_tells_displacements_and_levels_of_both_fingers() -> None:
    own = r"  left +5\.\d+ um peak, computed from the paper's measurement at 300 Hz; "
    level = r"-\d+\.\d dB at the right finger"
    assert re.search(rf"{own}{level} \(loss factor 0\.005\)", checked("").stdout)
    lossy = checked("[strip]\nloss_factor = 0.01").stdout  # one loss, to which both belong
    assert re.search(rf"{own}0\.\d+ um, {level}$", lossy, re.MULTILINE)
    far = checked('[burst]\nfrequency_hz = 250.0\ncycles = 3\nwindow = "hann"').stdout
    assert "below about -60 dB (assumed) crosstalk" in far
    assert "crosstalk" not in checked("[burst]\nfrequency_hz = 500.0").stdout
    stated, assumed = (displacements(text)["left"] for text in ("[strip]\nloss_factor = 0.01", ""))
    (at,), (worst,) = stated["fingers"], assumed["fingers"]
    assert (at["finger"], at["level_of"]) == ("right", None)
    level_db = 20 * math.log10(at["peak_um"] / stated["own_um"])
    assert at["level_db"] == pytest.approx(level_db, abs=0.01)
    # where no loss is stated the micrometres are those of 0.01, the level is the worst one
    assert (assumed["own_um"], worst["peak_um"]) == (stated["own_um"], at["peak_um"])
    assert worst["level_of"] == {"finger_load": False, "loss_factor": 0.005}
    assert worst["level_db"] > at["level_db"]


@pytest.mark.slow
@pytest.mark.parametrize(("keys", "part"), [("", 0.5), ("both_level = 150\n", 0.75)])
def test_the_displacement_is_that_of_the_highest_level(keys: str, part: float) -> None:
    found_um = displacements(f"[design]\nlevels_vpp = [50, 100]\n{keys}")["left"]["own_um"]
    assert found_um == pytest.approx(part * displacements("")["left"]["own_um"], rel=1e-3)


@pytest.mark.slow
def test_actuators_too_near_are_unfit_and_both_numbers_are_named() -> None:
    assert re.search(
        r"the left actuator's burst is at the right finger -1?\d\.\d{3} dB re its own finger; "
        r"the limit is -20 dB",
        checked(NEAR).stdout,
    )
    found = report(NEAR)
    assert found["masking_limit_db"] == 20
    assert len(found["conditions"][0]["reasons"]) == 2


@pytest.mark.slow
def test_unknown_displacements_still_have_levels() -> None:
    left = displacements(UNMEASURED)["left"]
    assert (left["basis"], left["own_um"], left["fingers"][0]["peak_um"]) == (None, None, None)
    assert left["fingers"][0]["level_db"] < -20


@pytest.mark.slow
def test_an_array_is_predicted_and_only_the_two_under_the_fingers_decide() -> None:
    found = displacements(ARRAY)
    assert list(found) == ["left", "right", "mid"]
    assert [finger["finger"] for finger in found["mid"]["fingers"]] == ["left", "right"]
    assert found["mid"]["fingers"][1]["level_db"] > -20


@pytest.mark.slow
def test_a_chosen_window_is_told_with_what_was_wanted() -> None:
    burst = report(AUTO)["conditions"][0]["burst"]
    assert burst["window"] in {"tukey", "gaussian", "hann"}
    assert burst["wanted_level_db"] == -45


@pytest.mark.slow
def test_a_click_is_checked_like_a_burst() -> None:
    samples = [math.sin(2 * math.pi * k / 96) for k in range(96)]
    Path("click.csv").write_text("".join(f"{value:.9f}\n" for value in [*samples, 0.0]))
    text = '[burst]\nfile = "click.csv"\n'
    result = checked(text)
    assert result.exit_code == 0, result.stderr
    assert "click.csv, scaled to a peak of 1, 2 ms" in result.stdout
    (click,), (burst,) = (report(one)["conditions"] for one in (text, ""))
    # the click is the paper's burst, sampled
    for key in ("energy_above_cutoff", "staircase_energy_above_cutoff"):
        assert click[key] == pytest.approx(burst[key], rel=0.02)
    assert click["band_hz"] == pytest.approx(burst["band_hz"], rel=1e-3)
    own_um = displacements(text)["left"]["own_um"]
    assert own_um == pytest.approx(displacements("")["left"]["own_um"], rel=1e-3)


def test_a_click_that_the_device_cannot_play_is_refused(refused: Refused) -> None:
    Path("click.csv").write_text("0\n1\n1\n0\n")
    Path("study.toml").write_text('[burst]\nfile = "click.csv"\n')
    told = "cannot be played at device.sample_rate_hz = 48000"
    assert told in refused("check", "study.toml")


def test_a_refusal_is_one_line_whatever_it_says() -> None:
    @refusals
    def fail() -> None:
        raise ValueError("first\nsecond")

    with pytest.raises(CommandError, match="first second") as caught:
        fail()
    assert caught.value.exit_code == 2


def test_other_exit_codes_are_kept() -> None:
    @click.command()
    @refusals
    def fail() -> None:
        raise CommandError("device: gone", exit_code=3)

    result = CliRunner().invoke(fail)
    assert (result.exit_code, result.stderr) == (3, "error: device: gone\n")


@pytest.mark.parametrize("mistake", [BrokenPipeError(), KeyError("levels")])
def test_a_broken_pipe_and_a_mistake_of_the_program_are_no_refusals(mistake: Exception) -> None:
    @refusals
    def fail() -> None:
        raise mistake

    with pytest.raises(type(mistake)):
        fail()


AT_A_PORT = '[device]\ndriver = "serial"\nport = "/no/such/port"\nceiling_vpp = 200\n'


def lacks(result: Result) -> list[tuple[str, str]]:
    return [(note["need"], note["lacks"]) for note in json.loads(result.stdout)["machine"]]


@pytest.mark.slow
def test_what_the_machine_lacks_is_a_note_and_changes_no_verdict(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("study.toml").write_text(AT_A_PORT)
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: None)
    monkeypatch.setattr("experiment.participant.window.window_lacks", tuple)
    assert lacks(run("check", "study.toml", "--json")) == [("device", "port")]
    told = run("check", "study.toml")
    assert told.exit_code == 0
    *_, note, space, verdict, last = told.stdout.splitlines()
    assert last.strip().endswith("on this machine the device is missing, see the notes")
    assert note.startswith("note           device: port is missing: /no/such/port is not there; ")
    assert (space, verdict.split()[:2]) == ("", ["verdict", "fit:"])


@pytest.mark.slow
def test_a_machine_that_has_all_gets_no_note(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    Path("study.toml").write_text("")
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: None)
    monkeypatch.setattr("experiment.participant.window.window_lacks", tuple)
    assert lacks(run("check", "study.toml", "--json")) == []
    assert "note  " not in run("check", "study.toml").stdout


@pytest.mark.parametrize(
    ("text", "needs"),
    [
        ("", ["masking noise"]),
        ('[masking]\nnoise = "none"\n', []),
        ('[device]\ndriver = "audio"\nport = "card"\nvolts_full_scale = 100\n', ["device"]),
    ],
)
def test_sound_is_missed_only_by_what_needs_it(
    text: str, needs: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    lack = Lack(what="sound card", remedy="plug one in")
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: lack)
    study = study_from_text(text, "s")
    found = machine_lacks(study.device, study.masking)
    assert [need for need, _ in found][: len(needs)] == needs
    assert {one for _, one in found} <= {lack}


@pytest.mark.slow
def test_the_last_line_says_that_the_device_is_missing_here(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = '[device]\ndriver = "audio"\nport = "card"\nvolts_full_scale = 100\n'
    Path("study.toml").write_text(
        text + '[monitor]\nsource = "none"\nsound_card = "Scarlett"\n', "utf-8"
    )
    lack = Lack(what="sound card", remedy="plug one in")
    monkeypatch.setattr("device.sound.stream.sound_lack", lambda: lack)
    result = run("check", "study.toml")
    assert result.exit_code == 0
    verdict, last = result.stdout.splitlines()[-2:]
    assert verdict.split()[:2] == ["verdict", "fit:"]
    assert last.strip() == "of the study; on this machine the device is missing, see the notes"
    assert "\nwarning        monitor.sound_card is named, but nothing is measured" in result.stdout


def test_a_window_needs_psychopy_and_a_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys, "version_info", (3, 12))
    monkeypatch.setattr("experiment.participant.window.find_spec", lambda name: None)
    monkeypatch.delenv("DISPLAY", raising=False)
    assert [lack.what for lack in window_lacks()] == ["PsychoPy", "display"]
    monkeypatch.setattr(sys, "version_info", (3, 13))
    monkeypatch.setenv("DISPLAY", ":0")
    assert [lack.what for lack in window_lacks()] == ["Python 3.11 or 3.12"]


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--json",)])
def test_a_plate_that_nobody_measured_is_asked_for(
    options: tuple[str, ...], refused: Refused
) -> None:
    thin = '[strip]\nwidth_mm = 30\nthickness_mm = 0.3\nedge = "clamped"\n'
    Path("study.toml").write_text(thin)
    told = refused("check", "study.toml", *options)
    assert "strip needs material (or youngs_modulus_gpa, poisson_ratio and density_kg_m3)" in told
    assert "[[actuator]] is missing" in told
    assert "measured" not in told
    assert [path.name for path in Path().iterdir()] == ["study.toml"]


LAB = """
[strip]
width_mm = 30
thickness_mm = 0.3
length_mm = 200
material = "steel"
edge = "clamped"
measured_cutoff_hz = 1700
measured_by = "A. Person"
measured_on = 2026-05-04
"""


@pytest.mark.slow
@pytest.mark.parametrize(("material", "told"), [("pmma", True), ("glass", False)])
def test_a_plastic_without_a_loss_is_said_to_lose_more_than_is_assumed(
    material: str, *, told: bool
) -> None:
    discs = DISC.format("left", -40) + DISC.format("right", 40)
    plate = (
        f'[strip]\nmaterial = "{material}"\nthickness_mm = 3\nlength_mm = 200\nedge = "clamped"\n'
    )
    words = "plastics lose more: state loss_factor"
    found = checked(plate + discs)
    assert (found.exit_code, words in found.stdout) == (0, told)
    assert words not in checked(f"{plate}loss_factor = 0.05\n{discs}").stdout


@pytest.mark.slow
def test_the_check_tells_whose_every_number_is() -> None:
    text = LAB + UNMEASURED
    assert "sizes: yours" in checked(text).stdout
    assert "material: steel, handbook: structural steel, EN 1993-1-1" in checked(text).stdout
    assert "place and size: yours\n" in checked(text).stdout
    sources = report(text)["sources"]
    assert sources["strip.material"]["source"] == "handbook"
    assert sources["strip.measured_cutoff_hz"] == {
        "value": 1700.0,
        "source": "measured",
        "words": "measured (by: A. Person; on: 2026-05-04)",
    }
    assert sources["strip.loss_factor"]["source"] == "assumed"
    assert sources["actuator[0].x_mm"]["source"] == "yours"
    assert sources["design.levels_vpp"]["source"] == "paper"
    assert {one["source"] for one in report("")["sources"].values()} == {"paper", "assumed"}


@pytest.mark.slow
def test_a_measured_cutoff_beside_ideal_edges_is_compared_and_not_used() -> None:
    text = LAB + UNMEASURED
    strip, without = (
        report(one)["strip"] for one in (text, text.replace("measured_", "# measured_"))
    )
    assert strip["cutoff_hz"] == without["cutoff_hz"]
    assert strip["measured_cutoff_hz"] == 1700
    off = strip["measured_above_computed"]
    assert off == pytest.approx(1700 / strip["cutoff_hz"] - 1)
    assert f"{abs(off):.1%} below the computed one" in checked(text).stdout
    # cut-offs go as thickness
    fits = f"clamped, 1700 Hz fits {0.3 * (1 + off):.3g} mm of thickness"
    assert fits in checked(text).stdout
    assert (without["measured_cutoff_hz"], without["measured_above_computed"]) == (None, None)


def test_a_thickness_that_makes_no_plate_is_not_suggested() -> None:
    plate = paper_study().plate
    assert plate.fitting(4400.0, 150e3) == "fits 4.28 mm of width; you have 0.5 mm and 25 mm"
    assert plate.fitting(4400.0, 1e12).startswith("fits no plate near it; you have")


@pytest.mark.slow
def test_the_papers_micrometres_are_not_said_to_be_measured_on_another_plate() -> None:
    told = checked(SECOND).stdout
    assert "2500.0 Hz, measured (by: not stated; on: not stated)" in told
    assert "n/a, its displacement is not stated; -19.7 dB at the right finger" in told
    assert "by the paper" not in told
    left = displacements(SECOND)["left"]
    assert (left["source"], left["own_um"]) == (None, None)
    by = 'measured_by = "A. Person"\n'
    own = checked(NEAR.replace(MEASURED, MEASURED + by)).stdout
    taken = "taken as peak (assumed; measured_as says otherwise)"
    of = "measured (by: A. Person; on: not stated)"
    assert f"2.6 um {taken} at 100 Vpp and 300 Hz, {of}" in own
    assert "um peak, computed from your measurement at 300 Hz; " in own


NEAR_A_MODE = "".join(
    f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12.8\n'
    "measured_displacement_um = 2\nmeasured_at_vpp = 100\nmeasured_at_hz = {hz}\n"
    for side, x_mm in (("left", -35), ("right", 35))
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hz", "keys", "told"),
    [(2889, "", True), (2600, "", False), (2889, "loss_factor = 0.01\n", False)],
)
def test_a_measurement_next_to_a_mode_is_told_where_the_loss_is_assumed(
    hz: float, keys: str, *, told: bool
) -> None:
    text = f"[strip]\nmeasured_cutoff_hz = 2900\n{keys}{NEAR_A_MODE.format(hz=hz)}"
    said = "left: measured at 2889 Hz, next to the first mode of the plate; its"
    assert (said in checked(text).stdout) == told
    assert ("micrometres differ by a factor of 2." in checked(text).stdout) == told


@pytest.mark.slow
def test_a_burst_much_slower_than_the_cut_off_keeps_the_modes_that_its_level_needs() -> None:
    """The contour solver says -36.303 dB of the left actuator at the right finger."""
    text = """
[strip]
width_mm = 25
thickness_mm = 0.5
length_mm = 906
youngs_modulus_gpa = 71
poisson_ratio = 0.22
density_kg_m3 = 2500
loss_factor = 0.005
edge = "simply-supported"
[[actuator]]
side = "left"
x_mm = -25
diameter_mm = 12
finger_diameter_mm = 6
[[actuator]]
side = "right"
x_mm = 42
diameter_mm = 12
finger_diameter_mm = 6
[burst]
frequency_hz = 150
cycles = 2
window = "none"
"""
    (condition,) = json.loads(checked(text, "--json").stdout)["conditions"]
    levels = [
        finger["level_db"]
        for actuator in condition["displacements"]["actuators"]
        for finger in actuator["fingers"]
    ]
    assert levels[0] == pytest.approx(-36.303, abs=0.01)


def test_a_threshold_curve_beyond_what_was_measured_is_told(run: Run) -> None:
    assert run("init", "ours.toml", "--preset", "realistic").exit_code == 0
    words = "durations of 0.01 to 1 s were measured (a window counts by what it leaves of the "
    words += "energy), got 0.00148 s for the burst and 0.002 s in threshold_at_s"
    told = f"The threshold lies outside published curves: {words}. A pilot tells the true one."
    assert " ".join(run("check", "ours.toml").stdout.split()).count(told) == 1
    facts = json.loads(run("check", "ours.toml", "--json").stdout)
    assert facts["simulation_unmeasured"] == [words]
