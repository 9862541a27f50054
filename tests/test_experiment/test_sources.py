"""Where every number of a study is from: the paper, the lab, a handbook, or nobody but us."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from experiment import StudyError, draw_plan, read_study, study_from_text, study_gains
from tests.test_experiment.studies import cases, discs, facts_of, recorded_plan, sources_of

if TYPE_CHECKING:
    from tests.conftest import Run

DISCS = discs(mm=12)
SIZES = "width_mm = 30\nlength_mm = 200\nthickness_mm = 0.5\n"
STEEL = f'[strip]\n{SIZES}material = "steel"\nedge = "clamped"\n{DISCS}'
STATED = f"{STEEL}finger_diameter_mm = 10\n[burst]\nfrequency_hz = 500\n"


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def origins(text: str) -> dict[str, tuple[Any, str]]:
    """Return every number of a study by its key, and where it is from."""
    return {key: (source.value, source.origin) for key, source in sources_of(text).items()}


@pytest.mark.parametrize(("text", "expected"), cases("origins"))
def test_every_number_has_its_origin(text: str, expected: str) -> None:
    key, *value_and_origin = expected.split(" | ")
    source = sources_of(text)[key]
    assert [source.printed, source.origin] == value_and_origin


def test_the_check_states_every_origin(run: Run) -> None:
    facts = facts_of(STATED, ())
    assert facts["sources"]["strip.edge"]["source"] == "yours"
    assert facts["sources"]["strip.cutoff_hz"]["source"] == "computed"
    assert {one["source"] for one in facts_of("", ())["sources"].values()} == {"paper", "assumed"}


def test_a_condition_states_its_own_numbers_only() -> None:
    found = origins('[[condition]]\nname = "a"\nfrequency_hz = 500\n[[condition]]\nname = "b"\n')
    assert found["condition[0].frequency_hz"] == (500.0, "yours")
    assert not [key for key in found if key.startswith("condition[1]") or key.endswith("].cycles")]


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


def changed(text: str, changes: list[tuple[str, str]]) -> str:
    """Return a text with every change made; each is of something in it."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def preset(run: Run, name: str, *more: str) -> str:
    """Return the study file that init writes."""
    Path("study.toml").unlink(missing_ok=True)
    assert run("init", "--preset", name, *more).exit_code == 0
    return Path("study.toml").read_text("utf-8")


@pytest.mark.parametrize("name", ["paper", "recommended"])
def test_what_init_writes_is_not_the_labs(name: str, run: Run) -> None:
    text = preset(run, name)
    assert {origin for _, origin in origins(text).values()} == {"paper", "assumed"}
    if name == "recommended":
        more = origins(text.replace("blank_trials = 60", "blank_trials = 70"))
        assert more == origins(text) | {"design.blank_trials": (70, "yours")}


@pytest.mark.parametrize(
    "changes",
    [
        [("thickness_mm = 0.5", "thickness_mm = 0.6")],
        [("width_mm = 25", "width_mm = 26")],
        STEEL_IN_PLACE,
    ],
)
def test_what_init_wrote_of_the_papers_plate_was_not_measured_on_another(
    changes: list[tuple[str, str]], run: Run
) -> None:
    text = changed(preset(run, "paper"), changes)
    with pytest.raises(StudyError, match=r"strip.measured_cutoff_hz = 2900 .* measured_by$"):
        study_from_text(text, "s")
    stated = "measured_cutoff_hz = 2900"
    text = changed(text, [(stated, f'{stated}\nmeasured_by = "us"')])
    with pytest.raises(StudyError, match=r"\[0\].measured_displacement_um .*width_mm = 25 "):
        study_from_text(text, "s")
    sources = sources_of(changed(text, NOT_MEASURED))
    strip = {one.origin for key, one in sources.items() if key.startswith("strip.")}
    assert "paper" not in strip
    assert (sources["strip.length_mm"].origin, sources["actuator[0].x_mm"].origin) == (
        "assumed",
        "assumed",
    )


@pytest.mark.slow
def test_what_init_chose_for_a_plate_is_known_from_what_it_was_given(run: Run) -> None:
    sizes = ("--width-mm", "25", "--thickness-mm", "0.5", "--length-mm", "150")
    more = ("--material", "steel", "--edge", "clamped", "--actuator", "disc:12.8@35")
    written = preset(run, "plate", *sizes, *more)
    sources = sources_of(read_study("study.toml"))
    for key in ("strip.width_mm", "strip.edge", "actuator[0].x_mm", "actuator[1].diameter_mm"):
        assert sources[key].origin == "yours"
    for key in ("design.levels_vpp", "burst.frequency_hz", "actuator[0].finger_diameter_mm"):
        assert sources[key].origin == "assumed"
    own = [("levels_vpp = [40, 80, 120, 160, 200]", "levels_vpp = [60, 95, 130, 165, 200]")]
    assert sources_of(changed(written, own))["design.levels_vpp"].origin == "yours"
    metal = "youngs_modulus_gpa = 67\npoisson_ratio = 0.346\ndensity_kg_m3 = 2700"
    sources = sources_of(changed(written, [('material = "steel"', metal)]))
    assert sources["strip.density_kg_m3"].origin == "yours"


@pytest.mark.slow
def test_a_plan_has_the_levels_and_what_they_were_computed_with() -> None:
    load = "mass_g = 0.3\nstiffness_n_m = 600\ndamping_n_s_m = 1.5\nholds_up_to_hz = 900\n"
    study = study_from_text(f'{STEEL}[finger_load]\n{load}source = "ours"\n', "s")
    (gains,) = study_gains(study)
    plan = draw_plan(study, participant="01", session="01", seed=1, gains=(gains,))
    level = plan.sources["level_db.main.left"]
    assert (level["value"], level["source"]) == (
        pytest.approx(gains.level_db(1, 0), abs=1e-3),
        "computed",
    )
    assert "0.01 (assumed)" in level["words"]
    assert recorded_plan(plan.to_json()) == plan
    assert plan.sources["finger_load.mass_g"]["source"] == "yours"
