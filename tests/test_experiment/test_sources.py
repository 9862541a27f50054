"""Where every number of a study is told to be from, in the check, its JSON and the report."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from experiment.commands.init import write_study_text
from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.study.physics import study_gains
from experiment.study.read import read_study, study_from_canonical, study_from_text, with_levels
from experiment.study.sections.table import stated_of
from experiment.study.sources import study_sources, words_of_the_others
from experiment.study.study import StudyError
from experiment.trial.draw import draw_plan
from experiment.trial.plan import plan_from_json, seal

if TYPE_CHECKING:
    from experiment.preview.findings import Findings
    from tests.conftest import Run

DISCS = "".join(
    f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12\n'
    for side, x_mm in (("left", -35), ("right", 35))
)


def found(text: str) -> Findings:
    """Return what the check of a study tells."""
    return check_findings(check_study(study_from_text(text, "s.toml")), "s.toml")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("edge_loss", "told"), [("plate", "have the plate's loss"), ("none", "have no loss")]
)
def test_the_loss_of_springs_is_told_of_a_plate_without_ends(edge_loss: str, told: str) -> None:
    strip = 'length_mm = "endless"\nedge = "elastic"\nedge_stiffness_n = 200\nloss_factor = 0.02'
    text = f'[strip]\n{strip}\nedge_loss = "{edge_loss}"\n'
    assert f"the springs of the edges {told} (edge_loss = {edge_loss})" in found(text).text


SIZES = "width_mm = 30\nlength_mm = 200\nthickness_mm = 0.5\n"
STEEL = f'[strip]\n{SIZES}material = "steel"\nedge = "clamped"\n{DISCS}'


def told(text: str) -> dict[str, tuple[Any, str]]:
    """Return every number of a study by its key, and where it is from."""
    return {one.key: (one.value, one.origin) for one in study_sources(study_from_text(text, "s"))}


def test_what_the_file_states_is_the_labs_whatever_its_value() -> None:
    text = f"{STEEL}finger_diameter_mm = 10\n[burst]\nfrequency_hz = 500\n"
    found = told(f"{text}[design]\nrepeats_per_level = 15\nboth_fraction = 0.0323\n")
    assert found["burst.frequency_hz"] == (500.0, "yours")
    assert found["burst.cycles"] == (1, "paper")
    assert found["design.repeats_per_level"] == (15, "yours")
    assert found["design.trials_per_side"] == (75, "computed")
    assert found["design.both_fraction"] == (0.0323, "yours")
    assert found["design.both_trials"] == (5, "computed")
    assert found["actuator[0].finger_diameter_mm"] == (10.0, "assumed")
    assert found["actuator[1].finger_diameter_mm"] == (10.0, "yours")
    assert found["strip.cutoff_hz"][1] == "computed"
    assert found["strip.edge"] == ("clamped", "yours")
    assert words_of_the_others(study_from_text(text, "s")).startswith("4 the paper's, 1 yours, ")


def test_a_place_across_that_nobody_stated_is_assumed_in_the_middle() -> None:
    (y_mm,) = (one for one in study_sources(study_from_text(STEEL, "s")) if "[0].y_mm" in one.key)
    assert (y_mm.value, y_mm.words) == (15.0, "assumed: the middle of the plate's width")
    stated = told(STEEL.replace("diameter_mm", "y_mm = 15\ndiameter_mm"))
    assert stated["actuator[0].y_mm"] == (15.0, "yours")
    assert told("")["actuator[0].y_mm"] == (12.5, "paper")
    assert told(DISCS.replace("12", "12.8"))["actuator[0].y_mm"] == (12.5, "assumed")


def test_the_papers_numbers_are_the_labs_where_it_states_them() -> None:
    found = told("[strip]\nwidth_mm = 25\nmeasured_cutoff_hz = 2900\n")
    assert found["strip.width_mm"] == (25.0, "yours")
    assert found["strip.thickness_mm"] == (0.5, "paper")
    assert found["strip.measured_cutoff_hz"] == (2900.0, "measured")
    assert told("")["strip.measured_cutoff_hz"] == (2900.0, "paper")


def test_a_condition_states_its_own_numbers_only() -> None:
    found = told('[[condition]]\nname = "a"\nfrequency_hz = 500\n[[condition]]\nname = "b"\n')
    assert found["condition[0].frequency_hz"] == (500.0, "yours")
    assert not [key for key in found if key.startswith("condition[1]") or key.endswith("].cycles")]


def test_other_levels_are_the_labs_and_leave_the_others_whose_they_are() -> None:
    study = with_levels(study_from_text("[burst]\ncycles = 1\n", "s"), (60.0, 95.0))
    found = {one.key: one.origin for one in study_sources(study)}
    assert (found["design.levels_vpp"], found["burst.cycles"]) == ("yours", "yours")
    assert found["burst.frequency_hz"] == "paper"


@pytest.mark.slow
def test_a_chosen_window_is_computed() -> None:
    found = told('[burst]\nwindow = "auto"\nwanted_level_db = -30\n')
    assert found["burst.wanted_level_db"] == (-30.0, "yours")
    assert found["condition[0].auto_cycles"][1] == "computed"


@pytest.mark.parametrize("preset", ["paper", "recommended"])
def test_what_init_writes_is_not_the_labs(preset: str) -> None:
    text = write_study_text(preset)
    sources = {one.key: one for one in study_sources(study_from_text(text, "s"))}
    assert {one.origin for one in sources.values()} == {"paper", "assumed"}
    if preset == "recommended":
        assert sources["design.blank_trials"].words == "chosen by tactstrip init"
        assert told(text.replace("blank_trials = 60", "blank_trials = 70")) == told(text) | {
            "design.blank_trials": (70, "yours")
        }


STATED = "measured_cutoff_hz = 2900", 'measured_cutoff_hz = 2900\nmeasured_by = "us"'
NOT_MEASURED = [
    ("measured_displacement_um = 2.6", ""),
    ("measured_at_vpp = 100", ""),
    ("measured_at_hz = 300", ""),
    ("threshold_um = 1.57", "threshold_vpp = 60"),
]
STEEL_IN_PLACE = [
    ("youngs_modulus_gpa = 67", 'material = "steel" #'),
    ("poisson_ratio = 0.346", ""),
    ("density_kg_m3 = 2700", ""),
]


@pytest.mark.parametrize(
    "changes",
    [
        [("thickness_mm = 0.5", "thickness_mm = 0.6")],
        [("width_mm = 25", "width_mm = 26")],
        STEEL_IN_PLACE,
    ],
)
def test_what_init_wrote_of_the_papers_plate_was_not_measured_on_another(
    changes: list[tuple[str, str]],
) -> None:
    text = changed(write_study_text("paper"), changes)
    cutoff = r"^s: strip.measured_cutoff_hz = 2900 is the paper's, of its own plate of width_mm "
    with pytest.raises(StudyError, match=f"{cutoff}= 25 .*: leave it out .* with measured_by$"):
        study_from_text(text, "s")
    text = changed(text, [STATED])
    displacement = (
        r"^s: actuator\[0\].measured_displacement_um is the paper's, of its own plate of "
    )
    with pytest.raises(StudyError, match=f"{displacement}width_mm .*, or state yours with meas"):
        study_from_text(text, "s")
    text = changed(text, NOT_MEASURED)
    sources = {one.key: one for one in study_sources(study_from_text(text, "s"))}
    assert "paper" not in {one.origin for key, one in sources.items() if key.startswith("strip.")}
    assert sources["strip.length_mm"].words == "assumed by tactstrip"
    assert sources["actuator[0].x_mm"].words == "assumed by tactstrip"


def test_who_writes_the_papers_numbers_without_init_measured_them() -> None:
    text = changed(write_study_text("paper"), [("thickness_mm = 0.5", "thickness_mm = 0.6")])
    study = study_from_text(text[: text.index("[init]")], "s")
    sources = {one.key: one.origin for one in study_sources(study)}
    assert sources["strip.measured_cutoff_hz"] == "measured"
    assert sources["actuator[0].measured_displacement_um"] == "measured"
    assert study_from_canonical(study.canonical) == study


def changed(text: str, changes: list[tuple[str, str]]) -> str:
    """Return a text with every change made; each is of something in it."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.slow
def test_what_init_chose_for_a_plate_is_told_from_what_it_was_told(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    sizes = ("--width-mm", "25", "--thickness-mm", "0.5", "--length-mm", "150")
    more = ("--material", "steel", "--edge", "clamped", "--actuator", "disc:12.8@35")
    assert run("init", "--preset", "plate", *sizes, *more).exit_code == 0
    sources = {one.key: one for one in study_sources(read_study("study.toml"))}
    for key in ("strip.width_mm", "strip.edge", "actuator[0].x_mm", "actuator[1].diameter_mm"):
        assert sources[key].origin == "yours"
    for key in ("design.levels_vpp", "design.break_every", "burst.frequency_hz"):
        assert sources[key].words == "chosen by tactstrip init"
    assert sources["actuator[0].finger_diameter_mm"].origin == "assumed"
    written = Path("study.toml").read_text(encoding="utf-8")
    measured = "".join(f"{key}\n" for key in MEASURED)
    changes = [
        ("threshold_vpp = 58", "threshold_um = 1.57"),
        ('window = "hann"', 'window = "none"'),
        ("levels_vpp = [40, 80, 120, 160, 200]", "levels_vpp = [60, 95, 130, 165, 200]"),
        ('shape = "disc"', f'{measured}shape = "disc"'),
    ]
    study = study_from_text(changed(written, changes), "s")
    sources = {one.key: one for one in study_sources(study)}
    for key in ("simulation.threshold_um", "design.levels_vpp"):
        assert sources[key].origin == "yours"
    assert sources["actuator[1].measured_displacement_um"].origin == "measured"
    assert set(stated_of(study.burst).keys or ()) == {"window"}
    material = [f"{key} = {value}" for key, value in ALUMINIUM.items()]
    own = changed(written, [('material = "steel"', "\n".join(material))])
    sources = {one.key: one for one in study_sources(study_from_text(own, "s"))}
    assert {sources[f"strip.{key}"].origin for key in ALUMINIUM} == {"yours"}


ALUMINIUM = {"youngs_modulus_gpa": 67, "poisson_ratio": 0.346, "density_kg_m3": 2700}
MEASURED = (
    "measured_displacement_um = 2.6",
    "measured_at_vpp = 100",
    "measured_at_hz = 300",
)


def test_an_actuator_that_init_did_not_write_is_the_labs() -> None:
    third = '[[actuator]]\nside = "other"\nname = "b"\nx_mm = 0\ny_mm = 15\ndiameter_mm = 12\n'
    text = f"{STEEL}{third}[init.chosen]\n'actuator.y_mm' = 15\n"
    assert told(text)["actuator[2].y_mm"] == (15.0, "yours")


@pytest.mark.parametrize("text", ["init = 3", "[init]\ntold = 3", "[init]\nbold = []"])
def test_another_section_init_is_refused(text: str) -> None:
    with pytest.raises(StudyError, match=r"^s: init must be left as `tactstrip init` wrote it"):
        study_from_text(text, "s")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[init]\ntold = ["strip.bogus"]', "strip.bogus"),
        ('[init]\ntold = ["strip.width_m"]', "strip.width_m; did you mean strip.width_mm?"),
        ('[init]\nleft_out = ["strip.bogus"]', "strip.bogus"),
        ("[init.chosen]\n'strip.bogus' = 3", "strip.bogus"),
    ],
)
def test_init_was_told_keys_of_the_study_only(text: str, words: str) -> None:
    with pytest.raises(StudyError, match=f"^s: init: unknown key {re.escape(words)}$"):
        study_from_text(text, "s")


@pytest.mark.parametrize("strip", ['edge = "clamped"', "length_mm = 150", "width_mm = 25.5"])
def test_no_displacement_is_measured_on_a_plate_that_nobody_measured(strip: str) -> None:
    others = f'material = "steel"\nlength_mm = 200\nedge = "clamped"\n{DISCS}'
    text = f"[strip]\n{strip}\n{others if 'width' in strip else ''}"
    (gains,) = study_gains(study_from_text(text, "s"))
    assert gains.bases == (None, None)


@pytest.mark.slow
def test_a_plan_tells_the_levels_and_what_they_were_computed_with() -> None:
    load = "mass_g = 0.3\nstiffness_n_m = 600\ndamping_n_s_m = 1.5\nholds_up_to_hz = 900\n"
    study = study_from_text(f'{STEEL}[finger_load]\n{load}source = "ours"\n', "s")
    (gains,) = study_gains(study)
    plan = draw_plan(study, participant="01", session="01", seed=1, gains=(gains,))
    level = plan.sources["level_db.main.left"]
    assert level["value"] == pytest.approx(gains.level_db(1, 0), abs=1e-3)
    assert level["source"] == "computed"
    assert level["words"].endswith("; loss factor 0.01 (assumed); with the finger load")
    assert plan_from_json(plan.to_json()) == plan
    (key,) = [key for key in plan.sources if key.endswith("mass_g")]
    assert plan.sources[key]["words"] == "yours: ours"


def test_a_plan_without_sources_is_read() -> None:
    plan = draw_plan(study_from_text("", "s"), participant="01", session="01", seed=1)
    older = seal(replace(plan, sources={}))
    assert '"sources"' not in older.to_json()
    assert plan_from_json(older.to_json()) == older
