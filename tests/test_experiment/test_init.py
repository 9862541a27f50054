"""`tactstrip init`: the presets, and a lab's own plate from options."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from experiment import paper_study, read_study
from tests.test_experiment.studies import sources_of

if TYPE_CHECKING:
    from tests.conftest import Run

STEEL = {
    "--width-mm": "30",
    "--thickness-mm": "0.5",
    "--length-mm": "150",
    "--material": "steel",
    "--edge": "clamped",
    "--actuator": "disc:12.8@35",
}  # options and values
GLASS = {
    "--width-mm": "40",
    "--thickness-mm": "1",
    "--length-mm": "200",
    "--material": "glass",
    "--edge": "simply-supported",
    "--actuator": "rectangle:6x18@40",
}  # options and values
ALUMINIUM = {
    "--width-mm": "25",
    "--thickness-mm": "0.5",
    "--length-mm": "200",
    "--material": "aluminium",
    "--cutoff-hz": "2500",
    "--actuator": "disc:12.8@35",
}  # options and values
LOW = STEEL | {"--edge": "simply-supported", "--thickness-mm": "0.3"}
HOPELESS = LOW | {"--width-mm": "60"}


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def words(plate: dict[str, str], *more: str) -> list[str]:
    """Return the command line for a plate."""
    return ["init", "--preset", "plate", *(word for pair in plate.items() for word in pair), *more]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plate", "edge", "cutoff_hz"),
    [
        (STEEL, "clamped", None),
        (GLASS, "simply-supported", None),
        (ALUMINIUM, "measured-cutoff", 2500.0),
        (LOW, "simply-supported", None),
        (STEEL | {"--length-mm": "endless", "--cutoff-hz": "3000"}, "clamped", 3000.0),
    ],
)
def test_the_study_of_a_plate_says_what_was_typed_and_passes_its_check(
    plate: dict[str, str], edge: str, cutoff_hz: float | None, run: Run
) -> None:
    result = run(*words(plate))
    assert (result.exit_code, result.stderr) == (0, "")
    study = read_study("study.toml")
    length_mm = plate["--length-mm"]
    assert study.plate.length_mm == ("endless" if length_mm == "endless" else float(length_mm))
    assert study.plate.width_mm == float(plate["--width-mm"])
    assert (study.plate.material, study.plate.edge) == (plate["--material"], edge)
    assert study.plate.measured_cutoff_hz == cutoff_hz
    assert [one.basis for one in study.actuators] == [None, None]
    left, right = study.actuators
    assert right.x_mm == -left.x_mm == float(plate["--actuator"].partition("@")[2])
    checked = run("check", "study.toml", "--json")
    assert (checked.exit_code, checked.stderr) == (0, "")
    facts = json.loads(checked.stdout)
    assert (facts["verdict"], facts["blocks"]) == ("fit", 5)


def test_two_actuators_lie_where_each_was_put(run: Run) -> None:
    plate = STEEL | {"--actuator": "disc:10@40"}
    assert run(*words(plate, "--actuator", "motor:8x6@-30")).exit_code == 0
    left, right = read_study("study.toml").actuators
    assert (left.side, left.shape, left.x_mm) == ("left", "motor", -30.0)
    assert (left.length_x_mm, left.length_y_mm) == (8.0, 6.0)
    assert (right.shape, right.x_mm, right.diameter_mm) == ("disc", 40.0, 10.0)
    assert 'as-left"  ' not in Path("study.toml").read_text("utf-8")


def test_the_ceiling_is_yours_and_the_levels_go_up_to_it(run: Run) -> None:
    assert run(*words(STEEL | {"--ceiling-vpp": "26"})).exit_code == 0
    study = read_study("study.toml")
    assert study.device.ceiling_vpp == 26.0
    assert study.design.levels_vpp == (5.2, 10.4, 15.6, 20.8, 26.0)
    sources = sources_of(study)
    assert sources["device.ceiling_vpp"].origin == "yours"
    assert sources["design.levels_vpp"].origin == "assumed"
    Path("study.toml").unlink()
    assert run(*words(STEEL)).exit_code == 0
    study = read_study("study.toml")
    assert study.design.levels_vpp == (40.0, 80.0, 120.0, 160.0, 200.0)
    assert sources_of(study)["device.ceiling_vpp"].origin == "assumed"


def test_init_writes_the_papers_protocol_and_follows_no_dangling_link(run: Run) -> None:
    result = run("init")
    assert (result.exit_code, "study.toml" in result.stdout) == (0, True)
    assert read_study("study.toml") == paper_study()
    assert [path.name for path in Path().iterdir()] == ["study.toml"]
    Path("link.toml").symlink_to("elsewhere.toml")
    assert run("init", "link.toml").exit_code == 2
    assert not Path("elsewhere.toml").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "burst", "verdict", "other"),
    [
        ({"--edge": "clamped"}, (200, 3), "fit", "fit"),
        ({"--edge": "clamped", "--thickness-mm": "0.4"}, None, "fit", "unfit"),
        ({"--cutoff-hz": "600"}, None, "fit", None),
        ({"--edge": "simply-supported", "--thickness-mm": "0.3"}, None, "unfit", None),
    ],
)
def test_a_plate_gets_the_shortest_burst_that_is_fit_with_both_edges(
    options: dict[str, str],
    burst: tuple[int, int] | None,
    verdict: str,
    other: str | None,
    run: Run,
) -> None:
    plate = STEEL | {"--width-mm": "60", "--length-mm": "200", "--actuator": "disc:12.8@40"}
    del plate["--edge"]
    assert run(*words(plate | options)).exit_code == 0
    (condition,) = read_study("study.toml").conditions
    if burst is not None:
        assert (condition.stated.frequency_hz, condition.stated.cycles) == burst
    facts = json.loads(run("check", "study.toml", "--json").stdout)
    assert facts["verdict"] == verdict
    if other is not None:
        assert facts["strip"]["other_edge"]["verdict"] == other


def test_on_a_terminal_what_is_missing_is_asked_for_until_it_is_right(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiment.commands.options.plate.on_terminal", lambda: True)
    answers = [
        *("0.025", "25", "0,5", "0.5", "200", "aluminum", "aluminium", "measured-cutoff", "9000"),
        *("2500", "disc:12.8@99", "disc:12.8@35"),
    ]
    result = run("init", "--preset", "plate", typed="\n".join(answers) + "\n")
    assert result.exit_code == 0, result.stderr
    assert result.stderr.count("Error: ") == 5
    assert read_study("study.toml").plate.measured_cutoff_hz == 2500.0
    given = ("init", "new.toml", *words(STEEL)[1:5])
    # what the command line has is refused before any question; so is the end of answers
    for more, typed in ((("--material", "steal"), ""), ((), "1\n")):
        result = run(*given, *more, typed=typed)
        assert (result.exit_code, Path("new.toml").exists()) == (2, False)
        assert ("Length" in result.stderr) == (not more)
