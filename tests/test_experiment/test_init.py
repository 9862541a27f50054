"""`tactstrip init`: the presets, a plate from options or answers, and studies from another."""

from __future__ import annotations

import json
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from experiment import paper_study, read_study
from experiment.study.physics import study_gains
from experiment.study.threshold import median_threshold
from experiment.study.writing import discs

if TYPE_CHECKING:
    from tests.conftest import Refused, Run

STEEL = {
    "--width-mm": "30",
    "--thickness-mm": "0.5",
    "--length-mm": "150",
    "--material": "steel",
    "--edge": "clamped",
    "--actuator": "disc:12.8@35",
    "--ceiling-vpp": "113",
}  # options and values
GLASS = STEEL | {"--width-mm": "40", "--thickness-mm": "1", "--material": "glass"}
RECTANGLES = GLASS | {"--edge": "simply-supported", "--actuator": "rectangle:6x18@40"}
ENDLESS = STEEL | {"--length-mm": "endless", "--cutoff-hz": "3000"}


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def command(plate: dict[str, str], *more: str) -> list[str]:
    """Return the command line for a plate."""
    return ["init", "--preset", "plate", *(word for pair in plate.items() for word in pair), *more]


def lines_of(path: str) -> list[str]:
    return Path(path).read_text("utf-8").splitlines()


@pytest.mark.parametrize("preset", ["paper", "recommended", "realistic"])
def test_a_preset_is_a_short_file_that_names_its_schema(preset: str, run: Run) -> None:
    result = run("init", "--preset", preset)
    assert (result.exit_code, result.stderr) == (0, "")
    first, *lines = lines_of("study.toml")
    schema = Path(first.removeprefix("#:schema "))
    assert set(json.loads(schema.read_text("utf-8"))["required"]) == {"strip", "actuator"}
    assert preset != "paper" or len(lines) < 45
    study = read_study("study.toml")
    assert study.name == preset
    assert preset != "paper" or study == paper_study()
    design = study.design
    if preset != "paper":
        assert (design.order, "none" in design.responses) == ("balanced", True)
        assert design.blank_trials >= 59  # so many without a false alarm bound its rate at 5 %
        assert design.trials_at(2) % design.break_every == 0
        threshold = median_threshold(study, study_gains(study)[0].at_fingers(study.task.sites))
        low_db, high_db = threshold.levels_db
        assert low_db < -5 < 5 < high_db  # thresholds of most people lie between the levels
        assert max(design.levels_vpp) < study.device.highest[0]


def test_every_other_key_can_be_added_as_a_comment(run: Run) -> None:
    assert run("init", "--all").exit_code == 0
    assert read_study("study.toml") == paper_study()
    text = Path("study.toml").read_text("utf-8")
    assert max(map(len, text.splitlines())) <= 100
    # a commented key can be used as it stands where it has a default
    active = "\n".join(
        line.removeprefix("# ") if line.startswith("# loop_s = ") else line
        for line in text.replace("# [masking]", "[masking]").splitlines()
    )
    assert tomllib.loads(active)["masking"] == {"loop_s": 30.0}


@pytest.mark.slow
@pytest.mark.parametrize("plate", [STEEL, GLASS, RECTANGLES, ENDLESS])
def test_the_study_of_a_plate_has_what_was_typed_and_is_checked(
    plate: dict[str, str], run: Run
) -> None:
    result = run(*command(plate))
    assert (result.exit_code, result.stderr) == (0, "")
    assert len(lines_of("study.toml")) <= 45
    study = read_study("study.toml")
    length_mm = plate["--length-mm"]
    assert study.plate.length_mm == ("endless" if length_mm == "endless" else float(length_mm))
    assert study.plate.width_mm == float(plate["--width-mm"])
    assert (study.plate.material, study.plate.edge) == (plate["--material"], plate["--edge"])
    assert [actuator.basis for actuator in study.actuators] == [None, None]
    left, right = study.actuators
    assert right.x_mm == -left.x_mm == float(plate["--actuator"].partition("@")[2])
    assert study.device.ceiling_vpp == study.design.levels_vpp[-1] == 113.0
    checked = run("check", "study.toml", "--json")
    assert (checked.exit_code, checked.stderr) == (0, "")
    facts = json.loads(checked.stdout)
    assert (facts["verdict"], facts["blocks"]) == ("within limits", 5)


@pytest.mark.slow
def test_two_actuators_lie_where_each_was_put(run: Run) -> None:
    plate = STEEL | {"--actuator": "disc:10@40"}
    assert run(*command(plate, "--actuator", "motor:8x6@-30")).exit_code == 0
    left, right = read_study("study.toml").actuators
    assert (left.site, left.shape, left.x_mm) == ("left", "motor", -30.0)
    assert (left.length_x_mm, left.length_y_mm) == (8.0, 6.0)
    assert (right.shape, right.x_mm, right.diameter_mm) == ("disc", 40.0, 10.0)


@pytest.mark.slow
def test_a_disc_has_layers_and_a_pilot_its_levels(run: Run, refused: Refused) -> None:
    for name, layers in discs().items():
        assert layers["source"].startswith(name)
    plate = STEEL | {"--actuator": "disc@35", "--disc": "7BB-20-3"}
    assert run(*command(plate, "plate.toml")).exit_code == 0
    study = read_study("plate.toml")
    assert [actuator.diameter_mm for actuator in study.driven] == [12.8, 12.8]
    assert study.simulation.threshold_um is not None
    assert run("init", "--from", "plate.toml", "--pilot").exit_code == 0
    pilot = read_study("pilot.toml")
    assert len(pilot.design.levels_vpp) == 10
    assert pilot.design.both_trials == 0
    assert pilot.design.levels_vpp[-1] <= 113.0
    ratios = [b / a for a, b in pairwise(pilot.design.levels_vpp)]
    assert max(ratios) == pytest.approx(min(ratios), rel=0.02)
    assert pilot.plate == study.plate
    for options in (("--pilot",), ("--from", "plate.toml"), ("--disc", "7BB-20-3")):
        refused("init", "new.toml", *options)
    assert "7BB-20-3" in refused("init", "new.toml", "--from", "plate.toml", "--disc", "7BB")


def test_nothing_is_overwritten_and_no_link_followed(run: Run, refused: Refused) -> None:
    assert run("init").exit_code == 0
    refused("init")
    Path("link.toml").symlink_to("elsewhere.toml")
    assert run("init", "link.toml").exit_code == 2
    assert not Path("elsewhere.toml").exists()
    Path("study.schema.json").write_text("{}")
    refused("init", "new.toml")


@pytest.mark.slow
def test_on_a_terminal_every_omission_is_asked_for_until_it_is_right(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiment.commands.init.on_terminal", lambda: True)
    answers = [
        *("0.025", "25", "0,5", "0.5", "200", "aluminum", "aluminium", "measured-cutoff", "9000"),
        *("2500", "disc:12.8@99", "disc:12.8@35", "0", "60"),
    ]
    result = run("init", "--preset", "plate", typed="\n".join(answers) + "\n")
    assert result.exit_code == 0, result.stderr
    assert result.stderr.count("Error: ") == 6
    study = read_study("study.toml")
    assert (study.plate.measured_cutoff_hz, study.device.ceiling_vpp) == (2500.0, 60.0)
    given = ("init", "new.toml", "--preset", "plate", "--width-mm", "30")
    # the end of answers, and an option that is wrong
    for more, typed in (((), "1\n"), (("--material", "steal"), "")):
        result = run(*given, *more, typed=typed)
        assert (result.exit_code, Path("new.toml").exists()) == (2, False)
