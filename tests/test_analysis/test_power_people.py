"""People of a power analysis: stated, of the literature or of a pilot; where numbers come from."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.special import ndtr

from analysis import load_column_map, read_inputs
from analysis.planning.goals import Goal
from analysis.planning.people import literature_people, pilot_people, stated_people, truth_of
from tests.plates import on_paper_plate
from tests.test_analysis.planning import ALONE, BOTH_AND_NONE, study_of
from tests.test_analysis.shared import put, run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment import Study

HALF_WIDTH, DIFFERENCE = Goal.parse("half-width=1dB"), Goal.parse("difference=2dB")
NONE_OFFERED = study_of(BOTH_AND_NONE, "sigma = 0.2")
TWO = '\n[[condition]]\nname = "bare"\n[[condition]]\nname = "glove"\n'


def two_conditions(people: str) -> Study:
    return study_of(
        "levels_vpp = [30.0, 50.0, 70.0, 100.0, 150.0, 200.0]\ntrials_per_side = 60",
        f"threshold_vpp = 70.0\nthreshold_sd_db = 3.0\n{people}{TWO}",
    )


def test_people_of_the_literature_have_a_source_for_each_number() -> None:
    people = literature_people(NONE_OFFERED, HALF_WIDTH)
    values = {number.key: number.value for number in people.parameters}
    assert (values["sigma"], values["threshold_sd_db"]) == (0.2, 3.0)
    assert all(number.source for number in people.parameters)
    assert "threshold_sd_db" in str(people.warnings[0])
    assert people.study.simulation.wander_db == 1.4


@pytest.mark.parametrize(
    ("goal", "study", "without"),
    [
        ("half-width=1dB", NONE_OFFERED, {"difference_sd_db"}),
        ("detection=10%@95V", NONE_OFFERED, {"difference_sd_db"}),
        ("difference=1dB", NONE_OFFERED, set()),
        ("difference=1dB", study_of("", "sigma = 0.2"), {"false_alarm_rate"}),
    ],
)
def test_only_numbers_that_the_goal_hangs_on_are_listed(
    goal: str, study: Study, without: set[str]
) -> None:
    people = literature_people(study, Goal.parse(goal))
    keys = {number.key for number in people.parameters}
    assert keys.isdisjoint(without)
    assert {"difference_sd_db", "false_alarm_rate"} <= keys | without
    assert ("difference_sd_db" in " ".join(map(str, people.warnings))) == (
        "difference_sd_db" in keys
    )


def test_false_alarms_hang_on_no_threshold() -> None:
    goal = Goal.parse("false-alarms=9%")
    people = literature_people(NONE_OFFERED, goal)
    assert [number.key for number in people.parameters] == ["lapse_rate", "false_alarm_rate"]
    simulation, fingers = people.study.simulation, ALONE.at_fingers(people.study.task.sites)
    known = {"threshold_vpp": 60.0, "threshold_um": None}
    others = {"threshold_vpp": 9.0, "threshold_um": None, "threshold_sd_db": 9.0, "sigma": 0.4}
    rates = [
        truth_of(goal, simulation.changed(**keys), people.study, fingers)
        for keys in (known, known | {"side_bias": 0.9}, others, known | {"lapse_rate": 0.2})
    ]
    assert rates[0] == pytest.approx(rates[1]) == pytest.approx(rates[2])
    assert rates[3] > rates[0] + 0.01


def test_stated_people_must_state_how_much_they_differ() -> None:
    with pytest.raises(ValueError, match=r"simulation\.threshold_sd_db"):
        stated_people(NONE_OFFERED, HALF_WIDTH)
    people = stated_people(study_of("", "threshold_sd_db = 4.0"), HALF_WIDTH)
    assert ("threshold_sd_db", 4.0) in {(p.key, p.value) for p in people.parameters}
    assert {p.source for p in people.parameters} == {"stated in the study", "default of tactstrip"}


MAP = """task = "yes/no"
[columns]
level_vpp = "v"
detected = "felt"
[constant]
side = "left"
[axis]
unit = "{}"
"""
HEAD = "participant,condition,v,felt\n"


def map_of(folder: Path, unit: str, scale: float = 1.0) -> Path:
    text = MAP.format(unit) + f"[scale]\nlevel_vpp = {scale}\n" * (scale != 1.0)
    if unit.startswith("dB"):
        text = text.replace("[axis]", '[axis]\nx_scale = "dB"')
    return put(folder / f"{unit}{scale}.toml", text)


def pilot_table(path: Path, in_unit: Callable[[float], str] = "{:g}".format) -> Path:
    """Write an external pilot of 8 people, with a threshold of 70 V bare and of 90 V in a glove."""
    rng, rows = np.random.default_rng(7), []
    for person in range(8):
        for name, median_vpp in (("bare", 70.0), ("glove", 90.0)):
            threshold_vpp = median_vpp * 10 ** (rng.normal(0, 2.0) / 20)
            shown = [30.0, 50.0, 70.0, 100.0, 150.0, 200.0][person == 0 :]  # not all had all
            for v in shown * 15 + [0.0] * 20:
                p = 0.1 + 0.88 * ndtr(math.log10(v / threshold_vpp) / 0.1) if v else 0.1
                rows.append(f"{person},{name},{in_unit(v)},{int(rng.random() < p)}\n")
    return put(path, HEAD + "".join(rows))


@pytest.mark.slow
def test_an_external_table_is_a_pilot_whatever_the_unit_of_its_levels(tmp_path: Path) -> None:
    def people_of(table: Path, *unit: Any) -> Any:
        loaded = read_inputs([table], load_column_map(map_of(tmp_path, *unit)))
        return pilot_people(two_conditions(""), DIFFERENCE, loaded, "there")

    table = pilot_table(tmp_path / "data" / "all.csv")
    people = people_of(table, "V")
    medians = {key: np.median([draw[key] for draw in people.draws]) for key in people.draws[0]}
    assert 55 < medians["threshold_vpp"] < 90
    assert 0.06 < medians["false_alarm_rate"] < 0.16  # a yes to a blank, wherever it was felt
    assert 0.5 < medians["difference_sd_db"] < 5.0
    assert people.warnings == ()
    same = people_of(table, "um")
    assert same.draws == people.draws  # only numbers count
    assert len(same.warnings) == 1
    decibels = pilot_table(
        tmp_path / "db.csv", lambda v: repr(20 * math.log10(v / 100)) if v else "-inf"
    )
    as_db = people_of(decibels, "dB re 100 V")
    assert as_db.unit == "% of 0 dB re 100 V"
    assert len(as_db.warnings) == 1
    for draw, other in zip(people.draws, as_db.draws, strict=True):
        assert draw.keys() == other.keys()
        assert [*other.values()] == pytest.approx([*draw.values()], rel=1e-6)


@pytest.mark.parametrize(
    ("unit", "scale", "options", "parts"),
    [
        (None, 1.0, "--pilot {data}", "--columns MAP.toml"),
        ("nm", 100.0, "--pilot {data}", "--pilot|0.1|1000|3000|20000 nm"),
        ("nm", 0.01, "--pilot {data}", "design.levels_vpp|nm|0.3"),
        ("V", 1.0, "", "--columns|--pilot"),
        ("um", 1.001, "--pilot {data} --levels placed", "--levels placed|um"),
    ],
)
def test_a_pilot_that_does_not_fit_the_study_is_refused(
    tmp_path: Path, unit: str | None, scale: float, options: str, parts: str
) -> None:
    data = pilot_table(tmp_path / "data" / "all.csv").parent
    study = put(
        tmp_path / "study.toml", on_paper_plate(f"[simulation]\nthreshold_sd_db = 2.0\n{TWO}")
    )
    columns = ["--columns", map_of(tmp_path, unit, scale)] if unit else []
    asked = ("--goal", "difference=2dB", "--participants", 4, 4, *columns)
    done = run("power", study, *asked, *options.format(data=data).split())
    assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert all(part in done.stderr for part in parts.split("|"))
