"""study.toml <-> Study: one meaning, one checksum, and a refusal that names the key."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment.commands.init import write_study_text
from experiment.study.read import (
    paper_study,
    read_levels,
    read_study,
    study_from_canonical,
    study_from_text,
    with_levels,
)
from experiment.study.study import StudyError
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    MeasuredDisplacement,
    PiezoLayers,
    SampledDrive,
)

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.study.sections.stimulus import Condition
    from experiment.study.study import Study

TWO_ACTUATORS = """
[[actuator]]
side = "left"
x_mm = {left_x}
y_mm = {left_y}
diameter_mm = 12.8
measured_displacement_um = 2.6
measured_at_vpp = 100
measured_at_hz = 300
[[actuator]]
side = "right"
x_mm = 35
diameter_mm = 12.8
measured_displacement_um = 2.6
measured_at_vpp = 100
measured_at_hz = 300
"""


FIRST_FILE = """
[strip]
edge = "measured-cutoff"
measured_cutoff_hz = 2900
[[actuator]]
side = "left"
shape = "disc"
x_mm = -35
y_mm = 12.5
diameter_mm = 12.8
[[actuator]]
side = "right"
shape = "disc"
x_mm = 35
y_mm = 12.5
diameter_mm = 12.8
[burst]
frequency_hz = 500
cycles = 1
window = "none"
max_energy_above_cutoff = 0.01
[simulation]
threshold_vpp = 58
threshold_sd_db = 1.5
crosstalk_db = -30
"""
"""The paper's protocol without displacements."""


def burst_of(condition: Condition) -> Burst:
    assert isinstance(condition.drive, Burst)
    return condition.drive


def refusal(text: str) -> str:
    with pytest.raises(StudyError) as caught:
        study_from_text(text, "s.toml")
    message = str(caught.value)
    assert message.startswith("s.toml:")
    assert "\n" not in message
    return message


# --- what a study file means ---------------------------------------------------------------------


def test_an_empty_file_is_the_papers_protocol() -> None:
    assert study_from_text("", "s.toml") == paper_study()


def test_the_papers_protocol_is_the_one_published() -> None:
    # paper, sections III-A and IV-A; y, rate and limits are this program's
    study = paper_study()
    assert (study.strip.width_m, study.strip.length_m, study.strip.thickness_m) == (
        0.025,
        0.2,
        0.0005,
    )
    assert study.strip.cutoff_hz() == pytest.approx(2900.0, rel=1e-12)
    left, right = study.actuators
    assert right.x_m - left.x_m == pytest.approx(0.07)
    assert left.y_m == study.strip.width_m / 2
    assert (left.shape, left.diameter_m) == ("disc", 0.0128)
    (condition,) = study.conditions
    assert condition.name == "main"
    assert condition.drive == Burst(frequency_hz=500.0, cycles=1, window="none")
    design = study.design
    assert design.levels_vpp == (60.0, 95.0, 130.0, 165.0, 200.0)
    assert (design.trials_per_side, design.both_trials, design.blank_trials) == (75, 5, 0)
    assert design.responses == ("left", "right", "both")
    assert design.order == "random"
    assert design.both_level_vpp is None


def test_the_written_paper_preset_reads_back_as_the_papers_study() -> None:
    assert study_from_text(write_study_text("paper"), "s.toml") == paper_study()


def test_the_recommended_preset_measures_guesses_in_equal_blocks() -> None:
    design = study_from_text(write_study_text("recommended"), "s.toml").design
    assert design.order == "balanced"
    assert "none" in design.responses
    assert design.blank_trials >= 59  # so many without a false alarm bound its rate at 5 %
    assert design.trials % design.break_every == 0


def test_both_presets_say_what_every_key_is() -> None:
    for preset in ("paper", "recommended"):
        text = write_study_text(preset)
        assert max(map(len, text.splitlines())) <= 100
        assert "pydantic" not in text
        assert 'window = "' in text
        assert "none | hann | tukey | gaussian" in text


def test_an_unknown_preset_is_refused() -> None:
    with pytest.raises(ValueError, match="paper, recommended"):
        write_study_text("best")


def test_comments_order_and_repeated_defaults_keep_the_checksum() -> None:
    text = '[masking]\nnoise = "pink" # so\n[burst]\ncycles = 1\nfrequency_hz = 500.0\n'
    assert study_from_text(text, "s.toml").sha256 == paper_study().sha256


@pytest.mark.process
def test_the_checksum_is_the_same_in_every_process() -> None:
    program = "from experiment.study.read import paper_study; print(paper_study().sha256)"
    found = {
        subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
            text=True,
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert found == {paper_study().sha256}


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
    study = study_from_text(
        f"[strip]\nmeasured_cutoff_hz = {cutoff_hz!r}\n[burst]\nfrequency_hz = {frequency_hz!r}\n"
        f"[design]\nlevels_vpp = {levels!r}\ntrials_per_side = {trials}\nblank_trials = {blanks}\n"
        'responses = ["left", "right", "both", "none"]',
        "s.toml",
    )
    assert study_from_canonical(study.canonical) == study
    assert study.design.levels_vpp == tuple(levels)
    assert study.design.trials == 2 * trials + 5 + blanks


def test_canonical_text_is_sorted_json_without_white_space() -> None:
    text = paper_study().canonical
    tables = json.loads(text)
    assert text == json.dumps(tables, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    assert tables["strip"]["width_mm"] == 25.0


@pytest.mark.parametrize("text", ["", "[]", "{", "{}", '{"design": {"x": 1}}', "[" * 9999])
def test_other_text_than_the_canonical_one_is_refused(text: str) -> None:
    with pytest.raises(StudyError, match="the recorded study"):
        study_from_canonical(text)


# --- the strip ------------------------------------------------------------------------------------


def test_the_edge_is_what_the_file_says() -> None:
    edges = {
        'edge = "clamped"': CLAMPED,
        'edge = "simply-supported"': SIMPLY_SUPPORTED,
        'edge = "elastic"\nedge_stiffness_n = 100': ElasticEdge(stiffness_n=100.0),
    }
    for text, edge in edges.items():
        assert study_from_text(f"[strip]\n{text}", "s.toml").strip.edge == edge


def test_another_plate_needs_its_own_measured_cutoff() -> None:
    message = refusal("[strip]\nwidth_mm = 30")
    assert "strip.measured_cutoff_hz is missing" in message


def test_a_key_of_another_edge_is_refused() -> None:
    message = refusal('[strip]\nedge = "clamped"\nmeasured_cutoff_hz = 2900')
    assert "measured_cutoff_hz is for edge = measured-cutoff only; got edge = clamped" in message


def test_an_elastic_edge_without_its_stiffness_is_refused() -> None:
    assert "strip.edge_stiffness_n is missing" in refusal('[strip]\nedge = "elastic"')


def test_a_cutoff_that_no_elastic_edge_can_have_is_refused_with_the_range() -> None:
    message = refusal("[strip]\nmeasured_cutoff_hz = 5000")
    assert "strip.measured_cutoff_hz must lie" in message
    assert "1926.03" in message
    assert "4366.09" in message


def test_a_strip_may_be_endless() -> None:
    assert study_from_text('[strip]\nlength_mm = "endless"', "s.toml").strip.length_m is None


# --- the actuators --------------------------------------------------------------------------------


def test_actuators_are_listed_left_first_in_any_order() -> None:
    text = TWO_ACTUATORS.format(left_x=-35, left_y=12.5)
    first, second = text.split("[[actuator]]")[1:]
    swapped = f"[[actuator]]{second}\n[[actuator]]{first}"
    assert study_from_text(swapped, "s.toml") == study_from_text(text, "s.toml") == paper_study()


def test_an_actuator_without_y_lies_on_the_centre_line() -> None:
    text = "[strip]\nwidth_mm = 28\nmeasured_cutoff_hz = 2500\n"
    text += TWO_ACTUATORS.format(left_x=-35, left_y=10)
    left, right = study_from_text(text, "s.toml").actuators
    assert (left.y_m, right.y_m) == (0.01, 0.014)


def test_a_patch_as_wide_as_the_strip_is_accepted() -> None:
    text = TWO_ACTUATORS.format(left_x=-35, left_y=12.5).replace("12.8", "25.0")
    assert study_from_text(text, "s.toml").actuators[0].span_y_m[0] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("left_x", "left_y", "said"),
    [
        (-35, 5, "from y = 0 mm to 25 mm; got a disc from -1.4 mm to 11.4 mm"),
        (-99, 12.5, "from x = -100 mm to 100 mm; got a disc from -105.4 mm to -92.6 mm"),
        (30, 12.5, "before the right one begins at 28.6 mm; got an end at 36.4 mm"),
        (60, 12.5, "before the right one begins at 28.6 mm; got an end at 66.4 mm"),
    ],
)
def test_a_patch_off_the_strip_or_over_the_other_is_refused(
    left_x: float, left_y: float, said: str
) -> None:
    assert said in refusal(TWO_ACTUATORS.format(left_x=left_x, left_y=left_y))


def test_sizes_go_with_the_shape() -> None:
    disc = TWO_ACTUATORS.format(left_x=-35, left_y=12.5)
    rectangle = disc.replace("diameter_mm = 12.8", 'shape = "rectangle"\nlength_x_mm = 6', 1)
    assert "actuator[0].length_y_mm is missing; got shape = rectangle" in refusal(rectangle)
    whole = rectangle.replace("length_x_mm = 6", "length_x_mm = 6\nlength_y_mm = 18")
    left = study_from_text(whole, "s.toml").actuators[0]
    assert left.span_x_m == pytest.approx((-0.038, -0.032))
    assert left.span_y_m == pytest.approx((0.0035, 0.0215))
    assert "for shape = disc only" in refusal(whole.replace("_mm = 18", "_mm = 18\ndiameter_mm=1"))


@pytest.mark.parametrize("sides", [("left",), ("left", "left"), ("left", "right", "right")])
def test_each_side_has_exactly_one_actuator(sides: tuple[str, ...]) -> None:
    text = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {20 * i}\ndiameter_mm = 5\n'
        for i, side in enumerate(sides)
    )
    assert "left and right, each once" in refusal(text)


# --- what an actuator does ------------------------------------------------------------------------

LAYERS = (
    "piezo_thickness_mm = 0.25\npiezo_youngs_modulus_gpa = 62\npiezo_poisson_ratio = 0.34\n"
    "piezo_d31_pm_v = -180\n"
)
CARRIER = (
    "carrier_thickness_mm = 0.2\ncarrier_youngs_modulus_gpa = 105\ncarrier_poisson_ratio = 0.35\n"
)


def left_with(keys: str) -> str:
    return (
        f'[[actuator]]\nside = "left"\nx_mm = -35\ndiameter_mm = 12.8\n{keys}'
        '[[actuator]]\nside = "right"\nx_mm = 35\ndiameter_mm = 12.8\n'
    )


def test_the_papers_discs_have_the_displacement_that_was_measured() -> None:
    # paper, section III-B
    measured = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    assert [actuator.basis for actuator in paper_study().actuators] == [measured, measured]
    assert [actuator.finger_diameter_m for actuator in paper_study().actuators] == [0.01, 0.01]


def test_layers_come_in_si_units() -> None:
    left, right = study_from_text(left_with(LAYERS), "s.toml").actuators
    layers = PiezoLayers(
        thickness_m=0.25e-3, youngs_modulus_pa=62e9, poisson_ratio=0.34, d31_m_v=-180e-12
    )
    assert left.basis == layers
    assert right.basis is None
    left, _ = study_from_text(left_with(LAYERS + CARRIER), "s.toml").actuators
    assert left.basis == replace(
        layers,
        carrier_thickness_m=0.2e-3,
        carrier_youngs_modulus_pa=105e9,
        carrier_poisson_ratio=0.35,
    )


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        (
            "measured_displacement_um = 2.6\nmeasured_at_vpp = 100\n",
            "actuator[0].measured_at_hz is missing; measured_displacement_um needs it",
        ),
        (
            "measured_at_hz = 300\n",
            "actuator[0].measured_displacement_um is missing; measured_at_hz needs it",
        ),
        (LAYERS.replace("piezo_d31_pm_v = -180\n", ""), "actuator[0].piezo_d31_pm_v is missing"),
        (
            LAYERS + "measured_displacement_um = 1\nmeasured_at_vpp = 1\nmeasured_at_hz = 1\n",
            "measured_displacement_um and piezo_thickness_mm exclude each other; got both",
        ),
        (CARRIER, "actuator[0].piezo_thickness_mm is missing; carrier_thickness_mm needs it"),
        (LAYERS + "carrier_thickness_mm = 1\n", "carrier_youngs_modulus_gpa is missing"),
        (LAYERS.replace("-180", "0"), "actuator[0].piezo_d31_pm_v must not be 0"),
        ('name = "a"\n', "actuator[0].name must be given where side is other, and only there"),
    ],
)
def test_half_a_basis_or_two_are_refused(keys: str, said: str) -> None:
    assert said in refusal(left_with(keys))


def test_a_motor_has_a_contact_and_no_layers() -> None:
    motor = left_with("").replace(
        "diameter_mm = 12.8", 'shape = "motor"\nlength_x_mm = 8\nlength_y_mm = 6', 1
    )
    left, _ = study_from_text(motor, "s.toml").actuators
    assert (left.shape, left.length_x_m, left.length_y_m) == ("motor", 0.008, 0.006)
    assert "piezo_thickness_mm is for patches only" in refusal(
        motor.replace("length_y_mm = 6\n", f"length_y_mm = 6\n{LAYERS}")
    )


OTHER = '[[actuator]]\nside = "other"\nname = "{}"\nx_mm = {}\ndiameter_mm = 10\n'


def test_an_array_has_left_and_right_first_and_the_others_along_the_strip() -> None:
    text = OTHER.format("far", 60) + OTHER.format("near", -70) + left_with("")
    labels = [actuator.label for actuator in study_from_text(text, "s.toml").actuators]
    assert labels == ["left", "right", "near", "far"]
    study = study_from_text(text, "s.toml")
    assert study_from_canonical(study.canonical) == study


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (OTHER.format("a", 30), "the actuators right and a must not overlap"),
        (OTHER.format("a", 0) + OTHER.format("b", 5), "the actuators a and b must not overlap"),
        (OTHER.format("a", 0) + OTHER.format("a", 60), "names must be distinct; got a, a"),
        (OTHER.format("a", 99), "the a actuator must lie on the strip"),
        (OTHER.format("left", 0), "actuator[2].name must be 1 to 32"),
        (OTHER.format("a b", 0), "actuator[2].name must be 1 to 32"),
        (OTHER.format("a", 0).replace('name = "a"\n', ""), "name must be given where side is"),
    ],
)
def test_an_array_whose_actuators_collide_is_refused(more: str, said: str) -> None:
    assert said in refusal(left_with("") + more)


# --- an older file --------------------------------------------------------------------------------


def test_a_file_without_displacements_keeps_its_meaning() -> None:
    # what was written for the paper's protocol before displacements were known
    study = study_from_text(FIRST_FILE, "s.toml")
    assert study.simulation.median.threshold_vpp == 58.0
    assert study.simulation.median.crosstalk_db == -30.0
    assert [actuator.basis for actuator in study.actuators] == [None, None]


def test_every_key_stands_in_the_canonical_text() -> None:
    tables = json.loads(study_from_text(FIRST_FILE, "s.toml").canonical)
    assert tables["burst"]["masking_limit_db"] == 20.0
    assert tables["actuator"][0]["finger_diameter_mm"] == 10.0
    assert tables["device"]["port"] is None


# --- whom a dry run simulates ---------------------------------------------------------------------


def test_the_threshold_is_in_micrometres_where_displacements_are_known() -> None:
    assert paper_study().simulation.median.threshold_um == 1.57
    known = left_with(LAYERS).replace("x_mm = 35", f"x_mm = 35\n{LAYERS}")
    assert study_from_text(known, "s.toml").simulation.median.threshold_um == 1.57
    unknown = study_from_text(left_with(LAYERS), "s.toml").simulation.median
    assert (unknown.threshold_um, unknown.threshold_vpp) == (None, 58.0)


def test_two_thresholds_or_one_that_nothing_tells_are_refused() -> None:
    both = "[simulation]\nthreshold_um = 1\nthreshold_vpp = 58\n"
    assert "simulation.threshold_um and threshold_vpp exclude each other" in refusal(both)
    message = refusal("[simulation]\nthreshold_um = 1\n" + left_with(LAYERS))
    assert "simulation.threshold_um needs the displacement or the layers" in message


# --- clicks and windows to be chosen --------------------------------------------------------------


@pytest.fixture
def click_folder(tmp_path: Path) -> Path:
    wave = "".join(f"{value}\n" for value in [0, 1, 2, 1, 0, -1, -2, -1, 0])
    (tmp_path / "click.csv").write_text(wave)
    return tmp_path


def read(folder: Path, text: str) -> Study:
    path = folder / "study.toml"
    path.write_text(text)
    return read_study(path)


def test_a_click_is_read_beside_the_study_and_kept_in_it(click_folder: Path) -> None:
    study = read(click_folder, '[burst]\nfile = "click.csv"\n')
    (condition,) = study.conditions
    assert condition.file == "click.csv"
    assert isinstance(condition.drive, SampledDrive)
    assert condition.drive.values == (0.0, 0.5, 1.0, 0.5, 0.0, -0.5, -1.0, -0.5, 0.0)
    (click_folder / "click.csv").unlink()
    assert study_from_canonical(study.canonical) == study
    assert with_levels(study, (40.0, 50.0)).conditions == study.conditions


def test_a_changed_click_is_another_study(click_folder: Path) -> None:
    text = '[burst]\nfile = "click.csv"\n'
    first = read(click_folder, text)
    assert read(click_folder, text).sha256 == first.sha256
    (click_folder / "click.csv").write_text("0\n1\n-1\n0\n")
    assert read(click_folder, text).sha256 != first.sha256


def test_conditions_mix_clicks_bursts_and_windows(click_folder: Path) -> None:
    text = (
        '[burst]\nfile = "click.csv"\n[[condition]]\nname = "click"\n'
        '[[condition]]\nname = "sine"\nfrequency_hz = 250\n'
    )
    click, sine = read(click_folder, text).conditions
    assert isinstance(click.drive, SampledDrive)
    assert sine.drive == Burst(frequency_hz=250.0, cycles=1, window="none")
    text = '[[condition]]\nname = "sine"\n[[condition]]\nname = "click"\nfile = "click.csv"\n'
    sine, click = read(click_folder, text).conditions
    assert sine.drive == paper_study().conditions[0].drive
    assert isinstance(click.drive, SampledDrive)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[burst]\nfile = 'a.wav'\ncycles = 2", "burst.cycles and file exclude each other"),
        ("[burst]\nfile = 'a.wav'", "a.wav: No such file"),
        ("[burst]\nfile = 'a.mp3'", "a.mp3: must be a .wav or .csv file"),
        ("[burst]\nwindow = 'auto'", "burst.wanted_level_db is missing; window = auto needs it"),
        ("[burst]\nwanted_level_db = -30", "burst.wanted_level_db is for window = auto only"),
        (
            "[[condition]]\nname = 'a'\nfile = 'a.wav'\nwindow = 'hann'",
            "condition[0].window and file exclude each other",
        ),
        (
            "[[condition]]\nname = 'a'\nwindow = 'auto'",
            "condition[0].wanted_level_db is missing; window = auto needs it",
        ),
        (
            "[burst]\nfile = 'a.wav'\n[[condition]]\nname = 'a'\ncycles = 2",
            "condition[0].frequency_hz is missing; [burst] has a file instead",
        ),
        (
            "[[condition]]\nname = 'a'\nauto_cycles = 2",
            "condition[0].auto_cycles and auto_window are for window = auto only",
        ),
        (
            "[[condition]]\nname = 'a'\nfile = 'a.wav'\nsample_rate_hz = 44100",
            "condition[0].samples_base64 is missing; sample_rate_hz needs it",
        ),
    ],
)
def test_stimuli_that_contradict_themselves_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert said in refusal(text)


@pytest.mark.slow
def test_a_chosen_window_is_recorded_and_never_chosen_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = '[burst]\nwindow = "auto"\nwanted_level_db = -40\n'
    study = study_from_text(text, "s.toml")
    (table,) = json.loads(study.canonical)["condition"]
    assert (table["window"], table["cycles"], table["wanted_level_db"]) == ("auto", 1, -40)
    (condition,) = study.conditions
    assert (table["auto_cycles"], table["auto_window"]) == (
        burst_of(condition).cycles,
        burst_of(condition).window,
    )

    def never(*_: object) -> Burst:
        raise AssertionError

    monkeypatch.setattr("experiment.study.physics.chosen_burst", never)
    assert study_from_canonical(study.canonical) == study
    assert with_levels(study, (40.0, 50.0)).conditions == study.conditions


@pytest.mark.slow
def test_a_condition_may_ask_for_a_quieter_window_than_the_burst() -> None:
    text = (
        '[burst]\nwindow = "auto"\nwanted_level_db = -25\n[[condition]]\nname = "loud"\n'
        '[[condition]]\nname = "quiet"\nwanted_level_db = -45\n'
        '[[condition]]\nname = "hann"\nwindow = "hann"\n'
    )
    loud, quiet, hann = study_from_text(text, "s.toml").conditions
    assert burst_of(loud).window == "none"
    assert burst_of(quiet).window != "none"
    assert hann.wanted_level_db is None
    assert burst_of(hann).window == "hann"


# --- the conditions -------------------------------------------------------------------------------


def test_a_condition_takes_from_the_burst_what_it_leaves_out() -> None:
    text = (
        '[burst]\nwindow = "hann"\n[[condition]]\nname = "one"\n'
        '[[condition]]\nname = "two"\ncycles = 2\n'
    )
    one, two = study_from_text(text, "s.toml").conditions
    assert (burst_of(one).cycles, burst_of(one).window) == (1, "hann")
    assert two.drive == replace(burst_of(one), cycles=2)


def test_a_reason_for_an_unfit_burst_is_none_for_another_burst() -> None:
    text = (
        '[burst]\naccept_unfit = "control"\n[[condition]]\nname = "same"\n'
        '[[condition]]\nname = "other"\nfrequency_hz = 900\n'
    )
    same, other = study_from_text(text, "s.toml").conditions
    assert (same.accept_unfit, other.accept_unfit) == ("control", None)
    study = study_from_text(text, "s.toml")
    assert study_from_canonical(study.canonical) == study


def test_condition_names_are_distinct_and_fit_for_files() -> None:
    assert "distinct" in refusal('[[condition]]\nname = "a"\n' * 2)
    assert "condition[0].name must be 1 to 32" in refusal('[[condition]]\nname = "a/b"\n')
    assert "condition names must be distinct, at least one" in refusal("condition = []")


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[design]\ntrails_per_side = 60",
            "unknown key design.trails_per_side; did you mean trials_per_side?",
        ),
        ("[desing]\n", "unknown key desing; did you mean design?"),
        ("[study]\nqqq = 1", "unknown key study.qqq"),
        ("self = 1", "unknown key self"),
        ("[design]\n__dataclass_self__ = 1", "unknown key design.__dataclass_self__"),
        (
            '[[condition]]\nname = "a"\ncycle = 1',
            "unknown key condition[0].cycle; did you mean cycles?",
        ),
    ],
)
def test_an_unknown_key_is_refused_by_name_with_the_nearest_one(text: str, said: str) -> None:
    assert refusal(text) == f"s.toml: {said}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("levels_vpp = [60, 60]", "design.levels_vpp[1] must be a finite number > 60, got 60"),
        ("levels_vpp = [60, nan]", "design.levels_vpp[1] must be a finite number >= 0.1; got nan"),
        ("levels_vpp = [60, inf]", "design.levels_vpp[1] must be a finite number >= 0.1; got inf"),
        (
            "levels_vpp = [60, true]",
            "design.levels_vpp[1] must be a finite number >= 0.1; got True",
        ),
        (
            "levels_vpp = [60, '95']",
            "design.levels_vpp[1] must be a finite number >= 0.1; got '95'",
        ),
        ("levels_vpp = 60", "design.levels_vpp must be a list; got 60"),
        ("levels_vpp = []", "design.levels_vpp must hold at least one level"),
        ("levels_vpp = [60, 201]", "design.levels_vpp[1] must be at most device.ceiling_vpp = 200"),
        ("both_level = 250", "design.both_level must be at most device.ceiling_vpp = 200; got 250"),
        (
            "both_level = 'often'",
            "design.both_level must be a finite number >= 0.1 or 'random'; got 'often'",
        ),
        (
            "trials_per_side = 75.0",
            "design.trials_per_side must be a whole number from 1 to 10000; got 75.0",
        ),
        ("order = 'shuffled'", "design.order must be 'random' or 'balanced'; got 'shuffled'"),
        ("responses = ['left', 'right']", "missing both"),
        ("responses = ['left', 'both']", "missing right"),
        ("responses = ['left', 'right', 'both', 'up']", "design.responses[3] must be one of"),
        ("responses = ['left', 'right', 'both', 'both']", "design.responses must be distinct"),
        ("blank_trials = 10", "missing none"),
        ("order = 'balanced'\ntrials_per_side = 76", "multiple of the number of levels, 5"),
        ("foreperiod_s = [2, 1]", "design.foreperiod_s[1] must be a finite number >= 2"),
        ("foreperiod_s = [1, 2, 3]", "design.foreperiod_s must be a list of 2; got [1, 2, 3]"),
        ("foreperiod_s = [1]", "design.foreperiod_s[1] is missing"),
    ],
)
def test_a_design_that_cannot_be_run_is_refused_by_key(text: str, said: str) -> None:
    assert said in refusal(f"[design]\n{text}")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[burst]\nfrequency_hz = 1" + "0" * 400, "burst.frequency_hz must be a finite number >="),
        ("[burst]\nfrequency_hz = 0x1" + "0" * 6000, "got a number of thousands of digits"),
        (
            "[burst]\nwindow = 'hamming'",
            "burst.window must be 'none', 'hann', 'tukey', 'gaussian' or 'auto'",
        ),
        ("[burst]\ncycles = 2000", "must last at most design.response_window_s = 3; got 4 s"),
        ("[burst]\naccept_unfit = ' '", "burst.accept_unfit must be a reason"),
        (
            "[device]\ndriver = 'none'",
            "device.driver must be 'mock', 'serial', 'generator' or 'audio'; got 'none'",
        ),
        ("[study]\nname = 2024-01-01", "study.name must be text; got datetime.date(2024, 1, 1)"),
        ("[study]\nname = 'my study'", "study.name must be 1 to 32"),
        ("strip = 5", "strip must be a table; got 5"),
        ("[actuator]\nside = 'left'", "actuator must be given as [[actuator]]"),
        ("[[actuator]]\nside = 'left'", "actuator[0].x_mm is missing"),
    ],
)
def test_every_table_refuses_what_it_cannot_use(text: str, said: str) -> None:
    assert said in refusal(text)


def test_several_faults_stand_in_one_line() -> None:
    message = refusal("[design]\na = 1\nb = 2\norder = 3\n[study]\nname = 4\n")
    assert message.count(";") >= 3
    assert message.endswith("and 1 more")


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("[design]\nlevels_vpp = [60,\n\nx", "s.toml:4: "),
        ("[design]\nlevels_vpp = [60,\n", "s.toml:3: "),
        ("[a]\n[a]\n", "s.toml:2: "),
        ("x = " + "[" * 9999, "s.toml: nested too deeply"),
    ],
)
def test_a_syntax_error_is_told_with_its_line(text: str, place: str) -> None:
    assert refusal(text).startswith(place)


def test_a_file_that_cannot_be_read_is_one_clear_line(tmp_path: Path) -> None:
    cases = {
        "bom.toml": (b"\xef\xbb\xbf[study]\n", "byte order mark"),
        "latin.toml": ("[study]\n# \xe9\n".encode("latin-1"), "latin.toml:2: must be UTF-8"),
        "utf16.toml": ("[study]".encode("utf-16"), "must be UTF-8"),
    }
    for name, (data, said) in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(StudyError, match=said):
            read_study(tmp_path / name)
    with pytest.raises(StudyError, match="No such file"):
        read_study(tmp_path / "missing.toml")
    with pytest.raises(StudyError, match="directory"):
        read_study(tmp_path)


# --- levels placed for one participant ------------------------------------------------------------


def test_other_levels_make_another_study_and_the_same_ones_the_same() -> None:
    study = paper_study()
    other = with_levels(study, (40.0, 50.5, 60.0))
    assert other.design == replace(study.design, levels_vpp=(40.0, 50.5, 60.0))
    assert other.sha256 != study.sha256
    assert with_levels(other, study.design.levels_vpp) == study


@pytest.mark.parametrize("levels", [(60.0, 40.0), (), (40.0, 400.0), (float("nan"),), (True, 40.0)])
def test_levels_that_cannot_be_run_are_refused_so_nothing_changed(
    levels: tuple[float, ...],
) -> None:
    study = paper_study()
    with pytest.raises(StudyError, match=r"design\.levels_vpp"):
        with_levels(study, levels)
    assert study == paper_study()


def test_balanced_levels_must_divide_the_trials() -> None:
    study = study_from_text(write_study_text("recommended"), "s.toml")
    with pytest.raises(StudyError, match="multiple of the number of levels, 4"):
        with_levels(study, (40.0, 50.0, 60.0, 70.0))


def test_levels_are_read_for_their_owner_only(tmp_path: Path) -> None:
    path = tmp_path / "levels.toml"
    path.write_text('participant = "01"\nlevels_vpp = [40, 50.5]\n')
    assert read_levels(path, "01") == (40.0, 50.5)
    with pytest.raises(StudyError, match="participant must be '02'; got '01'"):
        read_levels(path, "02")
    path.write_text("levels_vpp = [40, 50.5]\n")
    assert read_levels(path, "02") == (40.0, 50.5)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("level_vpp = [40]", "unknown key level_vpp; did you mean levels_vpp"),
        ("", "levels_vpp must be a list of numbers; got None"),
        ("levels_vpp = 40", "levels_vpp must be a list of numbers; got 40"),
        ("levels_vpp = ['a']", r"levels_vpp\[0\] must be a finite number >= 0.1; got 'a'"),
        ("levels_vpp = [50, 40]", r"levels_vpp\[1\] must be a finite number > 50"),
        ("participant = 1\nlevels_vpp = [50]", "participant must be '1'; got 1"),
        ("levels_vpp = [50", "levels.toml:1: "),
    ],
)
def test_a_file_that_holds_no_levels_is_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "levels.toml"
    path.write_text(text)
    with pytest.raises(StudyError, match=said):
        read_levels(path, "1")
