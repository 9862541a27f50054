"""`tactstrip init` and `tactstrip check`: what they print, refuse and answer with."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from experiment.commands_study import check, init
from experiment.exits import CommandError, refusals
from experiment.study import paper_study, read_study, study_from_text
from experiment.study_check import check_study
from stimuli import SIMPLY_SUPPORTED

UNFIT = "[burst]\nfrequency_hz = 2800\n"


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(command: click.Command, *arguments: str) -> Result:
    return CliRunner().invoke(command, list(arguments))


def study_file(text: str) -> str:
    Path("study.toml").write_text(text)
    return "study.toml"


# --- init -----------------------------------------------------------------------------------------


def test_init_writes_the_papers_protocol_to_study_toml() -> None:
    result = run(init)
    assert result.exit_code == 0
    assert "study.toml" in result.stdout
    assert read_study("study.toml") == paper_study()
    assert [path.name for path in Path().iterdir()] == ["study.toml"]


def test_init_writes_the_recommended_preset_where_it_is_told_to() -> None:
    assert run(init, "ours.toml", "--preset", "recommended").exit_code == 0
    assert read_study("ours.toml").design.order == "balanced"


def test_init_leaves_an_existing_file_alone() -> None:
    study_file("# mine\n")
    result = run(init)
    assert result.exit_code == 2
    assert result.stderr == "error: study.toml exists and is left as it is; name another file\n"
    assert Path("study.toml").read_text() == "# mine\n"


def test_init_follows_no_dangling_link() -> None:
    Path("study.toml").symlink_to("elsewhere.toml")
    assert run(init).exit_code == 2
    assert not Path("elsewhere.toml").exists()


def test_init_into_a_missing_folder_is_refused_in_one_line() -> None:
    result = run(init, "no/study.toml")
    assert result.exit_code == 2
    assert result.stderr == "error: no/study.toml: No such file or directory\n"


def test_an_unknown_preset_is_a_usage_error() -> None:
    assert run(init, "--preset", "best").exit_code == 2
    assert not Path("study.toml").exists()


# --- check ----------------------------------------------------------------------------------------


def test_the_papers_protocol_is_fit_for_its_plate() -> None:
    result = run(check, study_file(""))
    assert result.exit_code == 0
    assert "2900.0 Hz, measured" in result.stdout
    assert "K = 141.72 N" in result.stdout
    assert "main: fit" in result.stdout
    assert "205.6 to 654.4 Hz" in result.stdout
    assert "155: 75 left, 75 right, 5 both, 0 blank" in result.stdout
    assert result.stdout.splitlines()[-1].startswith("verdict        fit")
    assert result.stderr == ""


def test_the_check_gives_the_published_energies() -> None:
    # one cycle of 500 Hz, no window: 3.2958e-4 above 2.9 kHz (40-digit integration)
    (condition,) = check_study(paper_study()).conditions
    assert condition.burst.energy_above_cutoff == pytest.approx(3.2958e-4, rel=1e-4)
    assert condition.burst.staircase_energy_above_cutoff > condition.burst.energy_above_cutoff


def test_an_unfit_stimulus_exits_1_and_says_why() -> None:
    result = run(check, study_file(UNFIT))
    assert result.exit_code == 1
    assert "main: unfit" in result.stdout
    assert "the limit is 0.01" in result.stdout
    assert "UNFIT" in result.stdout


def test_an_accepted_unfit_stimulus_exits_0_and_says_so() -> None:
    result = run(check, study_file(UNFIT + 'accept_unfit = "spread on purpose"\n'))
    assert result.exit_code == 0
    assert "main: accepted" in result.stdout
    assert "accepted       spread on purpose" in result.stdout
    assert "verdict        unfit, and accepted" in result.stdout


def test_one_unfit_condition_makes_the_study_unfit() -> None:
    conditions = '[[condition]]\nname = "low"\n[[condition]]\nname = "high"\nfrequency_hz = 2800\n'
    result = run(check, study_file(conditions))
    assert result.exit_code == 1
    assert "low: fit" in result.stdout
    assert "high: unfit" in result.stdout
    assert "310: 2 conditions with 75 left" in result.stdout


def test_a_slow_device_makes_the_papers_burst_unfit_by_its_staircase() -> None:
    found = check_study(study_from_text("[device]\nsample_rate_hz = 8000", "s.toml"))
    (condition,) = found.conditions
    assert found.verdict == "unfit"
    assert (
        condition.burst.energy_above_cutoff < 1e-2 < condition.burst.staircase_energy_above_cutoff
    )


def test_the_cutoff_of_a_supported_strip_is_equation_14() -> None:
    text = '[strip]\nedge = "simply-supported"'
    found = check_study(study_from_text(text, "s.toml"))
    expected_hz = (
        math.pi / (4 * math.sqrt(3)) * 0.0005 / 0.025**2 * math.sqrt(67e9 / 2700 / (1 - 0.346**2))
    )
    assert found.study.strip.edge is SIMPLY_SUPPORTED
    assert found.cutoff_hz == pytest.approx(expected_hz, rel=1e-12)
    assert found.edge_stiffness_n is None
    assert "computed from simply-supported edges" in run(check, study_file(text)).stdout


def test_a_balanced_study_is_counted_exactly() -> None:
    run(init, "--preset", "recommended")
    result = run(check, "study.toml")
    assert "15 of each side and level" in result.stdout
    assert "in 5 blocks" in result.stdout


def test_more_trials_take_longer() -> None:
    texts = ("trials_per_side = 50", "trials_per_side = 75", "practice_trials = 50")
    short, paper, practised = (
        check_study(study_from_text(f"[design]\n{text}", "s.toml")).duration_s for text in texts
    )
    assert short < paper < practised


def test_json_is_one_object_and_nothing_else() -> None:
    result = run(check, study_file(""), "--json")
    report = json.loads(result.stdout)
    assert result.exit_code == 0
    assert report["verdict"] == "fit"
    assert report["study"]["sha256"] == paper_study().sha256
    assert report["strip"]["cutoff_hz"] == pytest.approx(2900.0)
    assert report["trials"] == 155
    assert report["conditions"][0]["band_hz"] == pytest.approx([205.634, 654.393], abs=1e-3)
    assert result.stdout.count("\n") == 1


def test_json_of_an_unfit_study_exits_1_and_names_the_reasons() -> None:
    result = run(check, study_file(UNFIT), "--json")
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
    text: str, said: str, options: tuple[str, ...]
) -> None:
    result = run(check, study_file(text), *options)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith("error: ")
    assert said in result.stderr
    assert result.stderr.count("\n") == 1


def test_a_missing_study_exits_2() -> None:
    result = run(check, "none.toml")
    assert result.exit_code == 2
    assert result.stderr == "error: none.toml: No such file or directory\n"


def test_the_help_imports_neither_numpy_nor_pydantic() -> None:
    program = (
        "import sys, experiment.commands_study\n"
        "print([name for name in ('numpy', 'pydantic', 'rich') if name in sys.modules])"
    )
    found = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, check=True, text=True
    )
    assert found.stdout.strip() == "[]"


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

    result = run(fail)
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
