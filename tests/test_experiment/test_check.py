"""`tactstrip init` and `tactstrip check`: what they print, refuse and answer with."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import click
import pytest
from click.testing import CliRunner

from device.drivers import NEEDS, DriverName
from experiment.commands.check import check
from experiment.preview.check import check_study
from experiment.study.read import paper_study, read_study, study_from_text
from experiment.terms.exits import CommandError, refusals
from stimuli import SIMPLY_SUPPORTED

if TYPE_CHECKING:
    from click.testing import Result

    from tests.test_experiment.conftest import Run

UNFIT = "[burst]\nfrequency_hz = 2800\n"


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def study_file(text: str) -> str:
    Path("study.toml").write_text(text)
    return "study.toml"


# --- init -----------------------------------------------------------------------------------------


def test_init_writes_the_papers_protocol_to_study_toml(run: Run) -> None:
    result = run("init")
    assert result.exit_code == 0
    assert "study.toml" in result.stdout
    assert read_study("study.toml") == paper_study()
    assert [path.name for path in Path().iterdir()] == ["study.toml"]


def test_init_writes_the_recommended_preset_where_it_is_told_to(run: Run) -> None:
    assert run("init", "ours.toml", "--preset", "recommended").exit_code == 0
    assert read_study("ours.toml").design.order == "balanced"


def test_init_leaves_an_existing_file_alone(run: Run) -> None:
    study_file("# mine\n")
    result = run("init")
    assert result.exit_code == 2
    assert result.stderr == "error: study.toml exists and is left as it is; name another file\n"
    assert Path("study.toml").read_text() == "# mine\n"


def test_init_follows_no_dangling_link(run: Run) -> None:
    Path("study.toml").symlink_to("elsewhere.toml")
    assert run("init").exit_code == 2
    assert not Path("elsewhere.toml").exists()


def test_init_into_a_missing_folder_is_refused_in_one_line(run: Run) -> None:
    result = run("init", "no/study.toml")
    assert result.exit_code == 2
    assert result.stderr == "error: no/study.toml: No such file or directory\n"


def test_an_unknown_preset_is_a_usage_error(run: Run) -> None:
    assert run("init", "--preset", "best").exit_code == 2
    assert not Path("study.toml").exists()


# --- check ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_papers_protocol_is_fit_for_its_plate(run: Run) -> None:
    result = run("check", study_file(""))
    assert result.exit_code == 0
    assert "2900.0 Hz, measured" in result.stdout
    assert "K = 141.72 N" in result.stdout
    assert "main: fit" in result.stdout
    assert "205.6 to 654.4 Hz" in result.stdout
    assert "155: 75 left, 75 right, 5 both, 0 blank" in result.stdout
    assert result.stdout.splitlines()[-1].startswith("verdict        fit")
    assert result.stderr == ""


@pytest.mark.slow
def test_the_check_gives_the_published_energies() -> None:
    # one cycle of 500 Hz, no window: 3.2958e-4 above 2.9 kHz (40-digit integration)
    (condition,) = check_study(paper_study()).conditions
    assert condition.burst.energy_above_cutoff == pytest.approx(3.2958e-4, rel=1e-4)
    assert condition.burst.staircase_energy_above_cutoff > condition.burst.energy_above_cutoff


@pytest.mark.slow
def test_an_unfit_stimulus_exits_1_and_says_why(run: Run) -> None:
    result = run("check", study_file(UNFIT))
    assert result.exit_code == 1
    assert "main: unfit" in result.stdout
    assert "the limit is 0.01" in result.stdout
    assert "UNFIT" in result.stdout


@pytest.mark.slow
def test_an_accepted_unfit_stimulus_exits_0_and_says_so(run: Run) -> None:
    result = run("check", study_file(UNFIT + 'accept_unfit = "spread on purpose"\n'))
    assert result.exit_code == 0
    assert "main: accepted" in result.stdout
    assert "accepted       spread on purpose" in result.stdout
    assert "verdict        unfit, and accepted" in result.stdout


@pytest.mark.slow
def test_one_unfit_condition_makes_the_study_unfit(run: Run) -> None:
    conditions = '[[condition]]\nname = "low"\n[[condition]]\nname = "high"\nfrequency_hz = 2800\n'
    result = run("check", study_file(conditions))
    assert result.exit_code == 1
    assert "low: fit" in result.stdout
    assert "high: unfit" in result.stdout
    assert "310: 2 conditions with 75 left" in result.stdout


@pytest.mark.slow
def test_a_slow_device_makes_the_papers_burst_unfit_by_its_staircase() -> None:
    found = check_study(study_from_text("[device]\nsample_rate_hz = 8000", "s.toml"))
    (condition,) = found.conditions
    assert found.verdict == "unfit"
    assert (
        condition.burst.energy_above_cutoff < 1e-2 < condition.burst.staircase_energy_above_cutoff
    )


@pytest.mark.slow
def test_the_cutoff_of_a_supported_strip_is_equation_14(run: Run) -> None:
    text = '[strip]\nedge = "simply-supported"'
    found = check_study(study_from_text(text, "s.toml"))
    expected_hz = (
        math.pi / (4 * math.sqrt(3)) * 0.0005 / 0.025**2 * math.sqrt(67e9 / 2700 / (1 - 0.346**2))
    )
    assert found.study.strip.edge is SIMPLY_SUPPORTED
    assert found.cutoff_hz == pytest.approx(expected_hz, rel=1e-12)
    assert found.edge_stiffness_n is None
    assert "computed from simply-supported edges" in run("check", study_file(text)).stdout


@pytest.mark.slow
def test_a_balanced_study_is_counted_exactly(run: Run) -> None:
    run("init", "--preset", "recommended")
    result = run("check", "study.toml")
    assert "15 of each side and level" in result.stdout
    assert "in 5 blocks" in result.stdout


@pytest.mark.slow
def test_more_trials_take_longer() -> None:
    texts = ("trials_per_side = 50", "trials_per_side = 75", "practice_trials = 50")
    short, paper, practised = (
        check_study(study_from_text(f"[design]\n{text}", "s.toml")).duration_s for text in texts
    )
    assert short < paper < practised


@pytest.mark.slow
def test_json_is_one_object_and_nothing_else(run: Run) -> None:
    result = run("check", study_file(""), "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 0
    assert report["verdict"] == "fit"
    assert report["study"]["sha256"] == paper_study().sha256
    assert report["strip"]["cutoff_hz"] == pytest.approx(2900.0)
    assert report["trials"] == 155
    assert report["conditions"][0]["band_hz"] == pytest.approx([205.634, 654.393], abs=1e-3)
    assert result.stdout.count("\n") == 1


@pytest.mark.slow
def test_json_of_an_unfit_study_exits_1_and_names_the_reasons(run: Run) -> None:
    result = run("check", study_file(UNFIT), "--json")
    assert result.exit_code == 1
    report = json.loads(result.stdout)
    assert report["verdict"] == "unfit"
    assert report["conditions"][0]["reasons"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[design]\ntrails_per_side = 3", "did you mean trials_per_side?"),
        ("[design", "study.toml:1: "),
        ("[device]\nsample_rate_hz = 1500", "do not go together: sample_rate_hz must be"),
        (
            '[design]\norder = "balanced"\nbreak_every = 2',
            "study paper: design.break_every must be 0 or at least 11",
        ),
    ],
)
@pytest.mark.parametrize("options", [(), ("--json",)])
def test_a_study_that_cannot_be_used_exits_2_with_one_line_on_stderr(
    text: str,
    said: str,
    options: tuple[str, ...],
    run: Run,
) -> None:
    result = run("check", study_file(text), *options)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_missing_study_exits_2(run: Run) -> None:
    result = run("check", "none.toml")
    assert result.exit_code == 2
    assert result.stderr == "error: none.toml: No such file or directory\n"


@pytest.mark.process
def test_the_help_imports_neither_numpy_nor_pydantic() -> None:
    program = (
        "import sys, experiment.commands.check\n"
        "print([name for name in ('numpy', 'pydantic', 'rich') if name in sys.modules])"
    )
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, check=True, text=True
    )
    assert found.stdout.strip() == "[]"


def test_the_drivers_to_choose_from_are_those_that_can_be_made() -> None:
    (option,) = (option for option in check.params if option.name == "driver")
    assert isinstance(option.type, click.Choice)
    assert tuple(option.type.choices) == tuple(NEEDS) == get_args(DriverName)


# --- what the fingers get -------------------------------------------------------------------------

NEAR = """
[[actuator]]
side = "left"
x_mm = -9
diameter_mm = 12.8
measured_displacement_um = 2.6
measured_at_vpp = 100
measured_at_hz = 300
[[actuator]]
side = "right"
x_mm = 9
diameter_mm = 12.8
measured_displacement_um = 2.6
measured_at_vpp = 100
measured_at_hz = 300
"""


def displacements(result: Result, condition: int = 0) -> dict[str, dict[str, Any]]:
    found = json.loads(result.stdout)["conditions"][condition]["displacements"]
    return {one["name"]: one for one in found["actuators"]}


@pytest.mark.slow
def test_the_check_tells_displacements_and_levels_of_both_fingers(run: Run) -> None:
    result = run("check", study_file(""))
    assert "peak of the burst over the fingertip's contact area at 200 Vpp" in result.stdout
    assert "of an endless strip" in result.stdout
    assert re.search(
        r"  left +5\.\d+ um, measured; 0\.\d+ um, -\d+\.\d dB at the right finger", result.stdout
    )
    assert "-20 dB at the other finger is the limit" in result.stdout
    left = displacements(run("check", "study.toml", "--json"))["left"]
    (right_finger,) = left["fingers"]
    assert right_finger["finger"] == "right"
    assert right_finger["level_db"] == pytest.approx(
        20 * math.log10(right_finger["peak_um"] / left["own_um"]), abs=0.02
    )


@pytest.mark.slow
def test_the_displacement_is_that_of_the_highest_level(run: Run) -> None:
    paper = displacements(run("check", study_file(""), "--json"))["left"]["own_um"]
    half = displacements(run("check", study_file("[design]\nlevels_vpp = [50, 100]\n"), "--json"))
    assert half["left"]["own_um"] == pytest.approx(paper / 2, rel=1e-3)
    both = study_file("[design]\nlevels_vpp = [50, 100]\nboth_level = 150\n")
    assert displacements(run("check", both, "--json"))["left"]["own_um"] == pytest.approx(
        paper * 0.75, rel=1e-3
    )


@pytest.mark.slow
def test_actuators_too_near_are_unfit_and_both_numbers_are_named(run: Run) -> None:
    result = run("check", study_file(NEAR))
    assert result.exit_code == 1
    assert re.search(
        r"the left actuator's burst is at the right finger -1?\d\.\d{3} dB re its own finger; "
        r"the limit is -20 dB",
        result.stdout,
    )
    assert "UNFIT" in result.stdout
    found = json.loads(run("check", "study.toml", "--json").stdout)
    assert found["masking_limit_db"] == 20
    assert len(found["conditions"][0]["reasons"]) == 2


@pytest.mark.slow
def test_too_strong_at_the_other_finger_may_be_accepted(run: Run) -> None:
    result = run("check", study_file(NEAR + '[burst]\naccept_unfit = "how near is too near"\n'))
    assert result.exit_code == 0
    assert "main: accepted" in result.stdout


@pytest.mark.slow
def test_the_masking_limit_decides(run: Run) -> None:
    # the level at the other finger of the paper's burst lies between the two
    assert run("check", study_file("[burst]\nmasking_limit_db = 25\n")).exit_code == 0
    assert run("check", study_file("[burst]\nmasking_limit_db = 40\n")).exit_code == 1
    assert (
        run("check", study_file("[burst]\nmasking_limit_db = 40\nwindow = 'hann'\n")).exit_code == 0
    )


@pytest.mark.slow
def test_unknown_displacements_still_have_levels(run: Run) -> None:
    text = re.sub("measured_.*\n", "", NEAR).replace("= 9", "= 35").replace("= -9", "= -35")
    result = run("check", study_file(text))
    assert result.exit_code == 0
    assert "n/a, its displacement is not stated; -" in result.stdout
    left = displacements(run("check", "study.toml", "--json"))["left"]
    assert (left["basis"], left["own_um"], left["fingers"][0]["peak_um"]) == (None, None, None)
    assert left["fingers"][0]["level_db"] < -20


@pytest.mark.slow
def test_an_array_is_predicted_and_only_the_two_under_the_fingers_decide(run: Run) -> None:
    text = NEAR.replace("= 9", "= 35").replace("= -9", "= -35")
    text += '[[actuator]]\nside = "other"\nname = "mid"\nx_mm = 22\ndiameter_mm = 8\n'
    result = run("check", study_file(text))
    assert result.exit_code == 0
    found = displacements(run("check", "study.toml", "--json"))
    assert list(found) == ["left", "right", "mid"]
    assert [finger["finger"] for finger in found["mid"]["fingers"]] == ["left", "right"]
    assert found["mid"]["fingers"][1]["level_db"] > -20
    assert "mid            disc 8 mm at x = 22" in result.stdout


@pytest.mark.slow
def test_a_chosen_window_is_told_with_what_it_costs(run: Run) -> None:
    result = run("check", study_file('[burst]\nwindow = "auto"\nwanted_level_db = -45\n'))
    assert result.exit_code == 0
    assert "window = auto  the shortest with -45 dB at the other finger; it costs " in result.stdout
    assert "ms more than the 2 ms stated" in result.stdout
    burst = json.loads(run("check", "study.toml", "--json").stdout)["conditions"][0]["burst"]
    assert burst["window"] in {"tukey", "gaussian", "hann"}
    assert burst["wanted_level_db"] == -45


@pytest.mark.slow
def test_a_click_is_checked_like_a_burst(run: Run) -> None:
    samples = [math.sin(2 * math.pi * k / 96) for k in range(96)]
    Path("click.csv").write_text("".join(f"{value:.9f}\n" for value in [*samples, 0.0]))
    result = run("check", study_file('[burst]\nfile = "click.csv"\n'))
    assert result.exit_code == 0, result.stderr
    assert "click.csv, scaled to a peak of 1, 2 ms" in result.stdout
    click = json.loads(run("check", "study.toml", "--json").stdout)["conditions"][0]
    burst = json.loads(run("check", study_file(""), "--json").stdout)["conditions"][0]
    # the click is the paper's burst, sampled
    for key in ("energy_above_cutoff", "staircase_energy_above_cutoff"):
        assert click[key] == pytest.approx(burst[key], rel=0.02)
    assert click["band_hz"] == pytest.approx(burst["band_hz"], rel=1e-3)
    own = [one["displacements"]["actuators"][0]["own_um"] for one in (click, burst)]
    assert own[0] == pytest.approx(own[1], rel=1e-3)


def test_a_click_that_the_device_cannot_play_is_refused(run: Run) -> None:
    Path("click.csv").write_text("0\n1\n1\n0\n")
    result = run("check", study_file('[burst]\nfile = "click.csv"\n'))
    assert result.exit_code == 2
    assert "cannot be played at device.sample_rate_hz = 48000" in result.stderr


@pytest.mark.slow
def test_a_constant_loss_is_turned_to_a_viscous_one_and_the_check_says_so(run: Run) -> None:
    result = run("check", study_file("[strip]\nloss_factor = 0.01\nviscous_time_us = 2\n"))
    # 0.01 at the cut-off of 2900 Hz is 0.549 us, and 2 us are there already
    assert "loss factor 0.01 computed as the viscous time of the same loss" in result.stdout
    assert "at 2900 Hz: 2.55 us in all" in result.stdout
    assert "loss factor" not in run("check", study_file("")).stdout


# --- exits ----------------------------------------------------------------------------------------


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


def test_a_broken_pipe_is_no_refusal() -> None:
    @refusals
    def fail() -> None:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        fail()


def test_a_mistake_of_the_program_is_no_refusal() -> None:
    @refusals
    def fail() -> None:
        raise KeyError("levels")

    with pytest.raises(KeyError):
        fail()
