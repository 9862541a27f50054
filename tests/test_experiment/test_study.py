"""study.toml <-> Study: one meaning, one checksum. What is refused stands in test_refusals.py."""

from __future__ import annotations

import json
import tomllib
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment import StudyError, draw_plan, paper_study, read_study
from experiment import study_from_text as read_text
from experiment.study.read import is_recorded, read_levels, study_from_canonical, with_levels
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    MeasuredDisplacement,
    PiezoLayers,
    SampledDrive,
)
from tests.test_experiment.studies import codes_of, discs, facts_of, measured, message_of

if TYPE_CHECKING:
    from pathlib import Path

    from experiment import Study
    from tests.conftest import Run

LAYERS = (
    "piezo_thickness_mm = 0.25\npiezo_youngs_modulus_gpa = 62\npiezo_poisson_ratio = 0.34\n"
    "piezo_d31_pm_v = -180\n"
)
CARRIER = (
    "carrier_thickness_mm = 0.2\ncarrier_youngs_modulus_gpa = 105\ncarrier_poisson_ratio = 0.35\n"
)
OTHER = '[[actuator]]\nside = "other"\nname = "{}"\nx_mm = {}\ndiameter_mm = 10\n'
EVERY_WORD = """
[study]
consent_version = "2.1 of 2025-03-01"
[masking]
noise = "pink"
max_level_dba = 70
measured_level_dba = 64.5
level_dbfs = -35
sound_card = "USB Audio"
loop_s = 12.5
sample_rate_hz = 44100
[screen]
full_screen = false
index = 1
width_px = 800
height_px = 600
text_height = 0.05
right_to_left = true
font = "Noto Sans Arabic"
[keys]
left = ["left", "num_4", "a"]
right = ["right", "num_6"]
go_on = ["return", "num_enter"]
[texts]
welcome = "\u200fأهلاً وسهلاً"
rest = "{planned} / {done}, {seconds}"
instructions = "שלום\\n\\nようこそ"
[participants]
columns = [
    { name = "age", description = "in years", levels = [] },
    { name = "handedness", description = "by questionnaire", levels = ["left", "right"] },
]
[dataset]
name = "Étude"
authors = ["A. Author", "B. Author"]
license = "CC0"
ethics_approvals = ["Board 1, 2025-17"]
task_description = "Where was it felt?"
[design]
audibility_trials = 6
control_trials = 10
[simulation]
threshold_vpp = 60
crosstalk_db = -25
"""


def read(text: str) -> Study:
    return read_text(text, "s.toml")


def bursts(text: str) -> list[Burst]:
    """Return the stimuli of a study's conditions, all of them bursts."""
    drives = [condition.drive for condition in read(text).conditions]
    assert all(isinstance(drive, Burst) for drive in drives)
    return drives  # type: ignore[return-value]


def test_an_empty_file_is_the_papers_protocol_as_published() -> None:
    # paper, sections III-A, III-B and IV-A; y, rate and limits are this program's
    study = paper_study()
    assert read("") == study
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


def test_a_study_says_all_of_it_in_its_own_words() -> None:
    study = read(EVERY_WORD)
    for name, table in tomllib.loads(EVERY_WORD).items():
        section: Any = study.about if name == "study" else getattr(study, name)
        stated = json.loads(json.dumps(asdict(section)))
        assert {key: stated[key] for key in table} == table
    assert (study.keys.both, study.texts.prompt) == (("down",), paper_study().texts.prompt)
    median = study.simulation.median
    assert (median.threshold_vpp, median.threshold_um, median.crosstalk_db) == (60.0, None, -25.0)
    assert study_from_canonical(study.canonical) == study


def test_braces_beside_placeholders_are_doubled() -> None:
    text = read("[texts]\nrest = '{{{done}}}'").texts.rest
    assert text.format(done=3, planned=5, seconds=7) == "{3}"


@pytest.mark.parametrize(
    ("in_lab_words", "in_trials"),
    [
        ("repeats_per_level = 15", "trials_per_side = 75"),
        (
            "levels_vpp = [60, 90]\nrepeats_per_level = 7",
            "levels_vpp = [60, 90]\ntrials_per_side = 14",
        ),
        ("trials_per_side = 45\nboth_fraction = 0.1", "trials_per_side = 45\nboth_trials = 10"),
        ("repeats_per_level = 15\nboth_fraction = 0.1", "both_trials = 17"),  # 10.2 %
        ("repeats_per_level = 9\nboth_fraction = 0.1", "trials_per_side = 45\nboth_trials = 10"),
        ("both_fraction = 0", "both_trials = 0"),
        ("both_fraction = 0.0964", "both_trials = 16"),  # 16 of 166, as a refusal tells it
    ],
)
def test_trials_may_be_said_as_a_lab_counts_them(in_lab_words: str, in_trials: str) -> None:
    first, second = (read(f"[design]\n{text}\n") for text in (in_lab_words, in_trials))
    assert first == second
    assert first.sha256 == second.sha256
    assert study_from_canonical(first.canonical) == first


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
    assert study.design.trials == 2 * trials + 5 + blanks


@pytest.mark.parametrize(
    ("keys", "as_measured"),
    [
        ("length_mm = 150", False),
        ('edge = "clamped"', False),
        ("measured_cutoff_hz = 2500", False),
        ("loss_factor = 0.01", True),
        ('length_mm = "endless"', True),
    ],
)
def test_the_papers_plate_is_its_width_its_thickness_and_its_material(
    keys: str, *, as_measured: bool
) -> None:
    stated = "width_mm = 25\nthickness_mm = 0.5\ndensity_kg_m3 = 2700\n"
    study = read(f"[strip]\n{stated}{keys}\n")
    assert study == read(f"[strip]\n{keys}\n")
    assert study.plate.is_the_papers
    for found, papers in zip(study.actuators, paper_study().actuators, strict=True):
        assert (found.x_mm, found.diameter_mm) == (papers.x_mm, papers.diameter_mm)
        assert found.basis == (papers.basis if as_measured else None)
    assert study_from_canonical(study.canonical) == study


def test_canonical_text_is_sorted_json_of_every_key_without_white_space() -> None:
    text = read(discs()).canonical
    tables = json.loads(text)
    assert text == json.dumps(tables, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert tables["strip"]["width_mm"] == 25.0
    assert tables["burst"]["masking_limit_db"] == 20.0
    assert tables["actuator"][0]["finger_diameter_mm"] == 10.0
    assert tables["device"]["port"] is None
    assert tables["texts"] == asdict(paper_study().texts)
    assert tables["participants"] == {"columns": []}
    assert (tables["study"]["consent_version"], tables["masking"]["loop_s"]) == (None, 30.0)


def test_actuators_are_listed_left_first_then_the_others_along_the_strip() -> None:
    text = OTHER.format("far", 60) + OTHER.format("near", -70)
    swapped = "".join(f"[[actuator]]{one}" for one in discs().split("[[actuator]]")[:0:-1])
    study = read(text + swapped)
    assert [actuator.label for actuator in study.actuators] == ["left", "right", "near", "far"]
    assert study == read(discs() + text)
    assert study_from_canonical(study.canonical) == study


def test_layers_come_in_si_units() -> None:
    left, right = read(discs(LAYERS, LAYERS + CARRIER)).actuators
    assert left.basis == PiezoLayers(
        thickness_m=0.25e-3, youngs_modulus_pa=62e9, poisson_ratio=0.34, d31_m_v=-180e-12
    )
    assert right.basis == replace(
        left.basis,
        carrier_thickness_m=0.2e-3,
        carrier_youngs_modulus_pa=105e9,
        carrier_poisson_ratio=0.35,
    )


def test_the_threshold_is_in_micrometres_where_every_displacement_is_known() -> None:
    assert paper_study().simulation.median.threshold_um == 1.57
    assert read(discs(LAYERS, LAYERS)).simulation.median.threshold_um == 1.57
    study = read(discs(LAYERS, ""))
    assert study.actuators[1].basis is None
    unknown = study.simulation.median
    assert (unknown.threshold_um, unknown.threshold_vpp) == (None, 58.0)


CLICK = '[burst]\nfile = "click.csv"\n'


@pytest.fixture
def click_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "click.csv"
    path.write_text("0\n1\n2\n1\n0\n-1\n-2\n-1\n0\n")
    return path


def test_a_click_is_read_beside_the_study_and_kept_in_it(click_file: Path) -> None:
    folder = click_file.parent / "lab"
    folder.mkdir()
    click_file = click_file.rename(folder / "click.csv")
    (folder / "study.toml").write_text(CLICK)
    study = read_study(folder / "study.toml")
    (condition,) = study.conditions
    assert condition.file == "click.csv"
    assert isinstance(condition.drive, SampledDrive)
    assert condition.drive.values == (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)
    click_file.unlink()
    assert study_from_canonical(study.canonical) == study
    assert with_levels(study, (40.0, 50.0)).conditions == study.conditions


def test_a_changed_click_is_another_study(click_file: Path) -> None:
    first = read(CLICK)
    assert read(CLICK).sha256 == first.sha256
    click_file.write_text("0\n1\n-1\n0\n")
    assert read(CLICK).sha256 != first.sha256


@pytest.mark.slow
def test_a_chosen_window_is_recorded_and_never_chosen_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study = read('[burst]\nwindow = "auto"\nwanted_level_db = -40\n')
    (table,) = json.loads(study.canonical)["condition"]
    assert (table["window"], table["cycles"], table["wanted_level_db"]) == ("auto", 1, -40)
    drive = study.conditions[0].drive
    assert isinstance(drive, Burst)
    assert (table["auto_cycles"], table["auto_window"]) == (drive.cycles, drive.window)

    def never(*_: object) -> Burst:
        raise AssertionError

    monkeypatch.setattr("experiment.study.window.chosen_window", never)
    assert study_from_canonical(study.canonical) == study
    assert with_levels(study, (40.0, 50.0)).conditions == study.conditions


@pytest.mark.slow
def test_a_condition_may_ask_for_a_quieter_window_than_the_burst() -> None:
    text = (
        '[burst]\nwindow = "auto"\nwanted_level_db = -20\n[[condition]]\nname = "loud"\n'
        '[[condition]]\nname = "quiet"\nwanted_level_db = -45\n'
        '[[condition]]\nname = "hann"\nwindow = "hann"\n'
    )
    loud, quiet, hann = bursts(text)
    assert (loud.window, hann.window) == ("none", "hann")
    assert quiet.window != "none"
    assert read(text).conditions[2].wanted_level_db is None


def test_a_condition_takes_from_the_burst_what_it_leaves_out() -> None:
    conditions = '[[condition]]\nname = "one"\n[[condition]]\nname = "two"\ncycles = 2\n'
    one, two = bursts(f'[burst]\nwindow = "hann"\n{conditions}')
    assert (one.cycles, one.window) == (1, "hann")
    assert two == replace(one, cycles=2)


def test_a_reason_for_an_unfit_burst_is_none_for_another_burst() -> None:
    study = read(
        '[burst]\naccept_unfit = "control"\n[[condition]]\nname = "same"\n'
        '[[condition]]\nname = "other"\nfrequency_hz = 900\n'
    )
    assert [condition.accept_unfit for condition in study.conditions] == ["control", None]
    assert study_from_canonical(study.canonical) == study


TWO_BURSTS = """
[design]
trials_per_side = 30
audibility_trials = 2
control_trials = 2
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


def test_levels_of_each_condition_are_sealed_with_the_study() -> None:
    study = read(TWO_BURSTS)
    own = with_levels(study, OF_EACH)
    assert {one.name: own.design_of(one.name).levels_vpp for one in own.conditions} == OF_EACH
    assert own.highest_vpp == 140.0
    assert study_from_canonical(own.canonical) == own
    assert "levels_vpp" not in json.loads(study.canonical)["condition"][0]
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
    assert (of_kind["a", "control"], of_kind["b", "control"]) == ({33.0}, {140.0})
    assert of_kind["b", "practice"] == {140.0}  # warm-up, too
    assert ("a", "practice") not in of_kind


def test_a_study_with_placed_levels_is_known_by_its_file(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(TWO_BURSTS.replace("cycles = 3", 'window = "auto"\nwanted_level_db = -40'))
    study = read_study(path)
    assert is_recorded(path, with_levels(study, OF_EACH).canonical, study.sha256)


def test_levels_are_read_for_their_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "levels.toml"
    path.write_text('participant = "01"\nlevels_vpp = [40, 50.5]\n')
    assert read_levels(path, "01") == (40.0, 50.5)
    with pytest.raises(StudyError, match="'02'; got '01'"):
        read_levels(path, "02")
    path.write_text("levels_vpp = [40, 50.5]\n")
    assert read_levels(path, "02") == (40.0, 50.5)
    path.write_text("[levels_vpp]\none-cycle = [40, 50.5]\n'2' = [7.5]\n")
    assert read_levels(path, "02") == {"one-cycle": (40.0, 50.5), "2": (7.5,)}


def test_presets_are_the_papers_protocol_and_one_that_measures_guesses(
    run: Run, tmp_path: Path
) -> None:
    for preset in ("paper", "recommended"):
        assert run("init", tmp_path / f"{preset}.toml", "--preset", preset).exit_code == 0
    assert read_study(tmp_path / "paper.toml").sha256 == paper_study().sha256
    design = read_study(tmp_path / "recommended.toml").design
    assert (design.order, "none" in design.responses) == ("balanced", True)
    assert design.blank_trials >= 59  # so many without a false alarm bound its rate at 5 %
    assert design.trials % design.break_every == 0


@pytest.mark.parametrize(
    ("strip", "edge"),
    [
        ('edge = "clamped"', CLAMPED),
        ('edge = "simply-supported"', SIMPLY_SUPPORTED),
        ('edge = "elastic"\nedge_stiffness_n = 100', ElasticEdge(stiffness_n=100.0)),
    ],
)
def test_the_edge_is_what_the_file_says(strip: str, edge: object) -> None:
    assert read(f"[strip]\n{strip}").strip.edge == edge
    assert read(f'[strip]\nlength_mm = "endless"\n{strip}').strip.length_m is None


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


def test_what_the_paper_measured_on_its_plate_is_asked_for_on_another() -> None:
    assert read(discs(measured())) == paper_study()
    for keys in ("length_mm = 150", 'edge = "clamped"', "measured_cutoff_hz = 2500"):
        with pytest.raises(StudyError, match=r"actuator\[0\].measured_displacement_um"):
            read(f"[strip]\n{keys}\n{discs(measured())}")
        own = measured() + 'measured_by = "us"\n'
        assert all(read(f"[strip]\n{keys}\n{discs(own)}").actuators)


@pytest.mark.parametrize("text", ["", "[]", "{", "{}", '{"design": {"x": 1}}', "[" * 9999])
def test_other_text_than_the_canonical_one_is_refused(text: str) -> None:
    with pytest.raises(StudyError):
        study_from_canonical(text)


@pytest.mark.parametrize(
    ("text", "levels", "part"),
    [
        (TWO_BURSTS, (40.0, 50.0), "b, a"),
        (TWO_BURSTS, {"b": (40.0, 50.0)}, "a$"),
        (TWO_BURSTS, OF_EACH | {"c": (1.0,)}, "got c"),
        (TWO_BURSTS, OF_EACH | {"a": (1.0, 201.0)}, r"condition\[1\].levels_vpp\[1\] .*device.c"),
        (TWO_BURSTS, OF_EACH | {"a": (1.0, 2.0, 3.0, 4.0)}, "trials_per_side"),
        ("", (60.0, 40.0), r"design\.levels_vpp"),
        ("", (), r"design\.levels_vpp"),
        ("", (40.0, 400.0), r"design\.levels_vpp"),
        ("", (float("nan"),), r"design\.levels_vpp"),
        ("", (True, 40.0), r"design\.levels_vpp"),
    ],
)
def test_levels_that_cannot_be_run_are_refused(text: str, levels: Any, part: str) -> None:
    with pytest.raises(StudyError, match=part):
        with_levels(read(text), levels)


def test_levels_are_those_of_the_conditions() -> None:
    same = read(TWO_BURSTS.replace("cycles = 3", "cycles = 2"))
    assert with_levels(same, (40.0, 50.0)).design_of("a").levels_vpp == (40.0, 50.0)
    with pytest.raises(StudyError, match=r"\[1\].levels_vpp"):
        read(TWO_BURSTS + "levels_vpp = [10, 20]")
    study = paper_study()
    other = with_levels(study, (40.0, 50.5, 60.0))
    assert other.design == replace(study.design, levels_vpp=(40.0, 50.5, 60.0))
    assert other.sha256 != study.sha256
    assert with_levels(other, study.design.levels_vpp) == study


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("level_vpp = [40]", "level_vpp; .* levels_vpp"),
        ("", "got None"),
        ("levels_vpp = 40", "levels_vpp .* got 40"),
        ("levels_vpp = ['a']", r"levels_vpp\[0\] .* >= 0.1; got 'a'"),
        ("levels_vpp = {}", "levels_vpp .* got {}"),
        ("levels_vpp = { a = [4], b = 5 }", "toml: b: levels_vpp .* got 5"),
        ("levels_vpp = [50, 40]", r"levels_vpp\[1\] .* > 50"),
        ("participant = 1\nlevels_vpp = [50]", "participant .* '1'; got 1"),
        ("levels_vpp = [50", "levels.toml:1: "),
    ],
)
def test_a_file_that_holds_no_levels_is_refused(tmp_path: Path, text: str, part: str) -> None:
    path = tmp_path / "levels.toml"
    path.write_text(text)
    with pytest.raises(StudyError, match=part):
        read_levels(path, "1")


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
    study = read(f"[design]\nresponses = {responses}\n{counts}")
    text = study.shown_texts.instructions
    assert text is not None
    assert ("both" in text, "{none}" in text) == (has_both, has_none)
    assert study.texts.instructions is None  # another design makes others


@pytest.mark.parametrize(
    ("texts", "keys"),
    [
        ('main = "Press F or J."', ["main", "F and J"]),
        ('main = "Drücken Sie F für links, J für rechts."', ["F and J"]),
        ('main = "F: links, J: rechts"', ["F and J"]),
        ('main = "Appuyez sur «f» ou [j], ou F1."', ["f and j and F1"]),
        ('main = "press 5 or the space bar"', ["5"]),
        ('main = "A vibration follows. I wait. Press a key, or {left}. S-Bahn, U.S."', None),
        ('main = "Naciśnij {left}. Z lewej, w prawo. O 5."', None),
        ('main = "Press F or J."\n[keys]\nleft = ["f"]\nright = ["j"]', None),
        ('prompt = "←, ↓ or →?"', None),
        ('prompt = "←, ↓?"\n[design]\nresponses = ["left", "right"]\nboth_trials = 0', ["↓"]),
        ('go_on = "Press Enter."', None),
        ('go_on = "Press Enter."\n[keys]\ngo_on = ["f5"]', ["Enter"]),
        ('go_on = "Press the left arrow."', ["left arrow", "{go_on}"]),
    ],
)
def test_keys_that_a_text_names_and_the_study_has_not_are_a_warning(
    texts: str, keys: list[str] | None
) -> None:
    facts = facts_of(f"[texts]\n{texts}", ())
    assert ("unknown_key" in codes_of(facts)) == ("key_doubts" in facts) == (keys is not None)
    if keys is not None:
        message = message_of(facts, "unknown_key")
        assert [key for key in keys if key not in message] == []


@pytest.mark.parametrize(
    ("text", "code", "key"),
    [
        (
            '[texts]\ninstructions = "Press {left} or {right}."',
            "incomplete_instructions",
            "{both}",
        ),
        ('[keys]\npause = ["lalt"]', "untyped_key", "keys.pause"),
        ('[keys]\nleft = ["4"]\nright = ["num_4"]', "untyped_key", "keys.left"),
    ],
)
def test_what_participants_cannot_know_or_type_is_a_warning(text: str, code: str, key: str) -> None:
    facts = facts_of(text, ())
    assert key in message_of(facts, code)
    assert {"unsaid", "untyped_keys"} & set(facts)
    assert code not in codes_of(facts_of("", ()))
