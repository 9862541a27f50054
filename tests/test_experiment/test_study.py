"""study.toml <-> Study: one meaning, one checksum. What is refused stands in test_refusals.py."""

from __future__ import annotations

import json
import tomllib
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment import StudyError, draw_plan, paper_study, read_study
from experiment import study_from_text as read_text
from experiment.study.files import is_recorded, read_levels, study_from_canonical, with_levels
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    MeasuredDisplacement,
    SampledDrive,
)
from tests.plates import on_paper_plate
from tests.test_experiment.studies import discs, measured

if TYPE_CHECKING:
    from pathlib import Path

    from experiment import Study

LAYERS = (
    "piezo_thickness_mm = 0.25\npiezo_youngs_modulus_gpa = 62\npiezo_poisson_ratio = 0.34\n"
    "piezo_d31_pm_v = -180\n"
)
CARRIER = (
    "carrier_thickness_mm = 0.2\ncarrier_youngs_modulus_gpa = 105\ncarrier_poisson_ratio = 0.35\n"
)
OTHER = '[[actuator]]\nname = "{}"\nx_mm = {}\ndiameter_mm = 10\n'


def read(text: str) -> Study:
    return read_text(on_paper_plate(text), "s.toml")


def test_the_paper_preset_is_the_protocol_as_published() -> None:
    # paper, sections III-A, III-B and IV-A; y, rate and limits are this program's
    study = paper_study()
    strip = study.strip
    assert (strip.width_m, strip.length_m, strip.thickness_m) == (0.025, 0.2, 0.0005)
    assert strip.cutoff_hz() == pytest.approx(2900.0, rel=1e-12)
    measured = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    left, right = study.actuators
    assert right.x_m - left.x_m == pytest.approx(0.07)
    assert left.y_m == strip.width_m / 2
    for disc in (left, right):
        assert (disc.shape, disc.diameter_m, disc.finger_diameter_m) == ("disc", 0.0128, 0.01)
        assert disc.basis == measured
    (condition,) = study.conditions
    assert condition.name == "main"
    assert condition.drive == Burst(frequency_hz=500.0, cycles=1, window="none")
    design = study.design
    assert design.levels_vpp == (60.0, 95.0, 130.0, 165.0, 200.0)
    assert (design.trials_per_side, design.both_trials, design.blank_trials) == (75, 5, 0)
    assert design.responses == ("left", "right", "both")
    assert (design.order, design.both_level_vpp) == ("random", None)


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(
    levels=st.lists(st.floats(1.0, 200.0), min_size=1, max_size=6, unique=True).map(sorted),
    trials=st.integers(1, 500),
    blanks=st.integers(0, 100),
    cutoff_hz=st.floats(1950.0, 4300.0),
    frequency_hz=st.floats(20.0, 1000.0),
)
def test_a_study_survives_its_canonical_text(
    levels: list[float], trials: int, blanks: int, cutoff_hz: float, frequency_hz: float
) -> None:
    study = read(
        f"[strip]\nmeasured_cutoff_hz = {cutoff_hz!r}\n[burst]\nfrequency_hz = {frequency_hz!r}\n"
        f"[design]\nlevels_vpp = {levels!r}\ntrials_per_side = {trials}\nblank_trials = {blanks}\n"
        'responses = ["left", "right", "both", "none"]'
    )
    assert study_from_canonical(study.canonical) == study
    assert study.design.levels_vpp == tuple(levels)
    assert study.design.trials_at(2) == 2 * trials + 5 + blanks


def test_actuators_are_listed_left_first_then_the_others_along_the_strip() -> None:
    text = OTHER.format("far", 60) + OTHER.format("near", -70)
    swapped = "".join(f"[[actuator]]{one}" for one in discs().split("[[actuator]]")[:0:-1])
    study = read(text + swapped)
    assert [actuator.label for actuator in study.actuators] == ["left", "right", "near", "far"]
    assert study == read(discs() + text)
    assert study_from_canonical(study.canonical) == study


def test_the_threshold_is_in_micrometres_where_every_displacement_is_known() -> None:
    assert paper_study().simulation.median.threshold_um == 1.57
    assert read(discs(LAYERS, LAYERS)).simulation.median.threshold_um == 1.57
    study = read(discs(LAYERS, ""))
    assert study.actuators[1].basis is None
    unknown = study.simulation.median
    assert (unknown.threshold_um, unknown.threshold_vpp) == (None, 58.0)


TWO_BURSTS = """
[design]
trials_per_side = 30
hands_off_trials_before = 2
hands_off_trials_after = 2
practice_trials = 2
order = "balanced"
both_trials = 3
condition_order = "listed"
[[condition]]
name = "b"
cycles = 3
[[condition]]
name = "a"
cycles = 2
"""
OF_EACH = {"a": (20.5, 33.0), "b": (70.0, 90.5, 140.0)}
LEVELS: Any = [(60.0, 40.0), (), (40.0, 400.0), (float("nan"),), (True, 40.0)]


def test_levels_of_each_condition_are_sealed_with_the_study() -> None:
    study = read(TWO_BURSTS)
    own = with_levels(study, OF_EACH)
    assert {one.name: own.design_of(one.name).levels_vpp for one in own.conditions} == OF_EACH
    assert own.highest_vpp == 140.0
    assert study_from_canonical(own.canonical) == own
    assert with_levels(with_levels(study, OF_EACH), {**OF_EACH, "a": (1.0, 2.0)}) != own
    alone = with_levels(paper_study(), {"main": (40.0, 50.5, 60.0)})
    assert alone == with_levels(paper_study(), (40.0, 50.5, 60.0))


def test_every_trial_has_a_level_of_its_own_condition() -> None:
    study = read(TWO_BURSTS)
    plan = draw_plan(study, participant="01", session="01", seed=7, levels_vpp=OF_EACH)
    of_kind: dict[tuple[str, str], set[float | None]] = {}
    for trial in (*plan.trials, *plan.warm_up):
        of_kind.setdefault((trial.condition, trial.kind), set()).add(trial.level_vpp)
    assert of_kind["a", "single"] == set(OF_EACH["a"])
    assert of_kind["b", "single"] == set(OF_EACH["b"])
    assert of_kind["a", "both"] <= set(OF_EACH["a"])
    assert (of_kind["a", "hands_off"], of_kind["b", "hands_off"]) == ({33.0}, {140.0})
    assert of_kind["b", "practice"] == {140.0}  # warm-up, too
    assert ("a", "practice") not in of_kind


@pytest.mark.parametrize("text", ["", "[]", "{", "{}", '{"design": {"x": 1}}', "[" * 9999])
def test_other_text_than_the_canonical_one_is_refused(text: str) -> None:
    with pytest.raises(StudyError):
        study_from_canonical(text)


@pytest.mark.parametrize(
    ("design", "in_trials"),
    [
        ("repeats_per_level = 15", "trials_per_side = 75"),
        ("levels_vpp = [6, 9]\nrepeats_per_level = 7", "levels_vpp = [6, 9]\ntrials_per_side = 14"),
        ("trials_per_side = 45\nboth_fraction = 0.1", "trials_per_side = 45\nboth_trials = 10"),
        ("repeats_per_level = 15\nboth_fraction = 0.1", "both_trials = 17"),  # 10.2 %
        ("both_fraction = 0", "both_trials = 0"),
        ("both_fraction = 0.0964", "both_trials = 16"),  # 16 of 166, as a refusal names it
    ],
)
def test_trials_may_be_stated_as_a_lab_counts_them(design: str, in_trials: str) -> None:
    first, second = (read(f"[design]\n{text}\n") for text in (design, in_trials))
    assert (first, first.sha256) == (second, second.sha256)
    assert study_from_canonical(first.canonical) == first


SECTIONS = """
study.consent_version = "2.1 of 2025-03-01"
masking = {max_level_dba = 70, measured_level_dba = 64.5, level_dbfs = -35, sound_card = "USB"}
screen = {full_screen = false, index = 1, width_px = 800, text_height = 0.05, right_to_left = true}
keys = {left = ["left", "num_4", "a"], continue = ["return", "num_enter"]}
texts = {welcome = "\u200fأهلاً وسهلاً", rest = "{{{planned}}} / {done}", instructions = "שלום"}
participants = {columns = [{name = "hand", description = "by test", levels = ["left", "right"]}]}
dataset = {name = "Étude", authors = ["A. Author", "B. Author"], license = "CC0"}
design = {hands_off_trials_before = 6, hands_off_trials_after = 10}
simulation = {threshold_vpp = 60, crosstalk_db = -25}
"""


def test_a_study_has_all_that_its_file_states() -> None:
    study = read(SECTIONS)
    for name, table in tomllib.loads(SECTIONS).items():
        section: Any = study.about if name == "study" else getattr(study, name)
        stated = json.loads(json.dumps(section.model_dump(by_alias=True)))
        assert {key: stated[key] for key in table} == table
    assert (study.keys.meanings["both"], study.texts.prompt) == (
        ("down",),
        paper_study().texts.prompt,
    )
    assert study.texts.rest.format(done=3, planned=5, seconds=7) == "{5} / 3"
    median = study.simulation.median
    assert (median.threshold_vpp, median.threshold_um, median.crosstalk_db) == (60.0, None, -25.0)
    assert study_from_canonical(study.canonical) == study


@pytest.mark.parametrize(
    ("keys", "edge"),
    [
        ('edge = "clamped"', CLAMPED),
        ('edge = "simply-supported"', SIMPLY_SUPPORTED),
        ('edge = "elastic"\nedge_stiffness_n = 100', ElasticEdge(stiffness_n=100.0)),
    ],
)
def test_edges_are_those_of_the_study(keys: str, edge: object) -> None:
    study = read(f"[strip]\n{keys}\n")
    assert study.strip.edge == edge
    assert study_from_canonical(study.canonical) == study


def test_an_actuator_may_be_assumed_equal_to_a_measured_one() -> None:
    study = read(discs(measured(5), 'assumed_equal_to = "left"\n'))
    left, right = study.actuators
    assert left.basis == right.basis
    assert "measured_displacement_um" not in right.model_fields_set
    assert study_from_canonical(study.canonical) == study


@pytest.mark.parametrize(
    ("keys", "along_m", "across_m"),
    [
        ("y_mm = 9\ndiameter_mm = 12", (-0.041, -0.029), (0.003, 0.015)),
        ("diameter_mm = 28", (-0.049, -0.021), (0, 0.028)),  # as wide as the plate
        ("shape = 'rectangle'\nlength_x_mm = 6\nlength_y_mm = 18", (-0.038, -0.032), (5e-3, 0.023)),
        ("shape = 'motor'\nlength_x_mm = 6\nlength_y_mm = 18", (-0.038, -0.032), (5e-3, 0.023)),
    ],
)
def test_an_actuator_lies_where_the_study_puts_it(
    keys: str, along_m: tuple[float, float], across_m: tuple[float, float]
) -> None:
    strip = '[strip]\nwidth_mm = 28\nlength_mm = 150\nmaterial = "steel"\nedge = "clamped"\n'
    study = read(strip + discs().replace("diameter_mm = 12.8", keys, 1))
    left, right = study.actuators
    assert (*left.span_x_m, *left.span_y_m) == pytest.approx((*along_m, *across_m), abs=1e-12)
    assert right.y_m == 0.014
    assert (study.strip.material.density_kg_m3, study.plate.youngs_modulus_gpa) == (7850, None)
    assert study_from_canonical(study.canonical) == study


@pytest.mark.parametrize(
    ("text", "levels", "part"),
    [
        (TWO_BURSTS, (40.0, 50.0), "b, a"),
        (TWO_BURSTS, {"b": (40.0, 50.0)}, "b, a"),
        (TWO_BURSTS, OF_EACH | {"c": (1.0,)}, "b, a"),
        (TWO_BURSTS, OF_EACH | {"a": (1.0, 201.0)}, r"condition\[1\].levels_vpp\[1\]: .*device.c"),
        (TWO_BURSTS, OF_EACH | {"a": (1.0, 2.0, 3.0, 4.0)}, "trials_per_side"),
        *(("", levels, r"levels_vpp") for levels in LEVELS),
        (None, "level_vpp = [40]", "level_vpp: .* levels_vpp"),
        (None, "", "levels_vpp"),
        (None, "levels_vpp = 40", r"levels_vpp: .*\(got 40\)"),
        (None, "levels_vpp = ['a']", r'levels_vpp\[0\]: .* 0.1 \(got "a"\)'),
        (None, "levels_vpp = {}", "levels_vpp: .*got {}"),
        (None, "levels_vpp = { a = [4], b = 5 }", r"levels_vpp.b: .*\(got 5\)"),
        (None, "levels_vpp = [50, 40]", r"levels_vpp\[1\]: .*50 \(got 40\)"),
        (None, "participant = 1\nlevels_vpp = [50]", r'participant: .*"1" \(got 1\)'),
        (None, "participant = '2'\nlevels_vpp = [50]", r'participant: .*"1" \(got "2"\)'),
        (None, "levels_vpp = [50", "levels.toml: must be valid TOML: .*at end of document"),
    ],
)
def test_levels_that_cannot_be_run_are_refused(
    text: str | None, levels: Any, part: str, tmp_path: Path
) -> None:
    """Levels of a study, or a file of levels of participant 1."""
    path = tmp_path / "levels.toml"
    path.write_text(str(levels))
    with pytest.raises(StudyError, match=part):
        read_levels(path, "1") if text is None else with_levels(read(text), levels)


def test_levels_are_those_of_the_conditions(tmp_path: Path) -> None:
    same = read(TWO_BURSTS.replace("cycles = 3", "cycles = 2"))
    assert with_levels(same, (40.0, 50.0)).design_of("a").levels_vpp == (40.0, 50.0)
    with pytest.raises(StudyError, match=r"\[1\].levels_vpp"):
        read(TWO_BURSTS + "levels_vpp = [10, 20]")
    study = paper_study()
    other = with_levels(study, (40.0, 50.5, 60.0))
    assert other.design == study.design.changed(levels_vpp=(40.0, 50.5, 60.0))
    assert other.sha256 != study.sha256
    assert with_levels(other, study.design.levels_vpp) == study
    (path := tmp_path / "s.toml").write_text(on_paper_plate(TWO_BURSTS))
    study = read_study(path)
    assert is_recorded(path, study.sha256)
    assert not is_recorded(path, with_levels(study, OF_EACH).sha256)
    path.write_text("[levels_vpp]\none-cycle = [40, 50.5]\n'2' = [7.5]\n")
    assert read_levels(path, "02") == {"one-cycle": (40.0, 50.5), "2": (7.5,)}
    path.write_text('participant = "01"\nlevels_vpp = [40, 50.5]\n')
    assert read_levels(path, "01") == (40.0, 50.5)


@pytest.mark.parametrize(
    ("responses", "counts", "has_both", "has_none"),
    [
        ('["left", "right"]', "both_trials = 0", False, False),
        ('["left", "right", "both"]', "", True, False),
        ('["left", "right", "both", "none"]', "blank_trials = 4", True, True),
        ('["left", "right", "none"]', "both_trials = 0", False, True),
    ],
)
def test_instructions_follow_the_design(
    responses: str, counts: str, *, has_both: bool, has_none: bool
) -> None:
    text = read(f"[design]\nresponses = {responses}\n{counts}").texts.instructions or ""
    assert ("both" in text, "{none}" in text) == (has_both, has_none)


def test_a_condition_takes_from_the_burst_what_it_leaves_out() -> None:
    study = read(
        '[burst]\nwindow = "hann"\naccept_violation = "control"\n[[condition]]\nname = "same"\n'
        '[[condition]]\nname = "other"\nfrequency_hz = 900\n'
    )
    assert [one.accept_violation for one in study.conditions] == ["control", None]
    assert [getattr(one.drive, "window", "") for one in study.conditions] == ["hann", "hann"]
    assert study_from_canonical(study.canonical) == study


def test_a_click_is_read_beside_the_study_and_kept_in_it(tmp_path: Path) -> None:
    (click := tmp_path / "click.csv").write_text("0\n1\n2\n1\n0\n-1\n-2\n-1\n0\n")
    text = on_paper_plate('[burst]\nfile = "click.csv"\n')
    (tmp_path / "study.toml").write_text(text)
    study = read_study(tmp_path / "study.toml")
    (condition,) = study.conditions
    assert condition.file == "click.csv"
    assert isinstance(condition.drive, SampledDrive)
    assert condition.drive.values == (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)
    click.write_text("0\n1\n-1\n0\n")
    assert read_study(tmp_path / "study.toml").sha256 != study.sha256
    click.unlink()
    assert study_from_canonical(study.canonical) == study
    assert with_levels(study, (40.0, 50.0)).conditions == study.conditions
