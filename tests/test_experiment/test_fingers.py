"""What a study's fingers oppose to the plate: its keys, what it changes, and where it is told."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from experiment.preview.check import check_study
from experiment.preview.check_report import check_findings
from experiment.preview.plate import plate_of
from experiment.study.physics import fingertips_of, loads_per_volt, study_gains
from experiment.study.read import paper_study, study_from_canonical, study_from_text
from experiment.study.sources import finger_words, plate_sources
from experiment.study.study import Study, StudyError
from experiment.study.window import chosen_window

LOAD = {
    "mass_g": 0.3,
    "stiffness_n_m": 600.0,
    "damping_n_s_m": 1.5,
    "holds_up_to_hz": 1000.0,
    "source": "our impedance head, 0.5 N",
}


def study_of(load: dict[str, Any] | None = None, *, more: str = "", strip: str = "") -> Study:
    """The paper's study with a loss, fingers that load the plate, and other lines."""
    lines = [f"{key} = {value!r}".replace("'", '"') for key, value in (load or {}).items()]
    head = f"[strip]\n{strip or 'loss_factor = 0.01'}\n"
    return study_from_text("\n".join([head, "[finger_load]", *lines, more]), "study.toml")


LOADED = study_of(LOAD)


def test_nothing_loads_the_plate_unless_it_is_said() -> None:
    assert all(tip.impedance is None for tip in fingertips_of(paper_study()))
    assert study_of().sha256 == study_from_text("[strip]\nloss_factor = 0.01", "s.toml").sha256


def test_the_two_fingers_load_the_plate_and_no_other_place() -> None:
    more = '[[actuator]]\nside = "other"\nname = "third"\nx_mm = 0\ndiameter_mm = 5\n'
    sides = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x}\ndiameter_mm = 12.8\n'
        for side, x in (("left", -35), ("right", 35))
    )
    left, right, third = fingertips_of(study_of(LOAD, more=sides + more))
    assert left.impedance is not None
    assert left.impedance == right.impedance
    assert left.impedance.mass_kg == pytest.approx(3e-4)
    assert third.impedance is None


def test_a_plan_holds_the_load_of_the_fingers() -> None:
    again = study_from_canonical(LOADED.canonical)
    assert again.finger_load == LOADED.finger_load
    assert again.sha256 != study_of().sha256


@pytest.mark.slow
def test_micrometres_per_volt_are_those_of_the_bare_plate() -> None:
    assert loads_per_volt(LOADED) == loads_per_volt(study_of())


@pytest.mark.slow
def test_gains_have_the_load_of_the_fingers() -> None:
    (loaded,), (bare,), (without,) = (
        study_gains(LOADED),
        study_gains(LOADED, bare=True),
        study_gains(study_of()),
    )
    assert bare.per_vpp == without.per_vpp
    assert loaded.level_db(1, 0) < bare.level_db(1, 0) - 5
    assert loaded.per_vpp[0][0] != bare.per_vpp[0][0]


def test_a_load_that_does_not_hold_is_left_out_and_told() -> None:
    study = study_of(LOAD | {"holds_up_to_hz": 600.0})
    assert study_gains(study)[0].per_vpp == study_gains(study_of())[0].per_vpp
    assert finger_words(study, study.conditions[0])[1] == (
        "left out: it holds up to 600 Hz, the burst's band reaches 654 Hz"
    )
    told = {one.key: one for one in plate_sources(study)}
    assert told["finger_load"].value == ("main",)
    assert told["finger_load"].words == "left out: their bursts reach above the band of its values"
    assert check_study(study).conditions[0].bracket == ()


@pytest.mark.slow
def test_the_check_takes_the_worse_of_with_and_without() -> None:
    check = check_study(LOADED)
    (one,) = check.conditions
    assert one.level_db(1, 0) == study_gains(study_of())[0].level_db(1, 0)
    assert one.gains == study_gains(LOADED)[0]
    found = check_findings(check, "study.toml")
    assert "finger load: 0.3 g, 600 N/m, 1.5 N s/m (yours: our impedance head" in found.text
    told = found.facts["conditions"][0]["displacements"]["finger_load"]
    assert told == LOAD | {"applied": True}
    assert found.facts["sources"]["finger_load.mass_g"] == {
        "value": 0.3,
        "source": "yours",
        "words": "yours: our impedance head, 0.5 N",
    }


@pytest.mark.slow
def test_the_micrometres_of_the_check_are_those_of_the_plan() -> None:
    check = check_study(LOADED)
    (gains,) = check.gains
    facts = check_findings(check, "study.toml").facts["conditions"][0]["displacements"]
    level_vpp = LOADED.design.highest_vpp
    for column, one in enumerate(facts["actuators"]):
        (at,) = one["fingers"]
        for row, um in ((column, one["own_um"]), (1 - column, at["peak_um"])):
            assert um == pytest.approx(gains.per_vpp[row][column] * level_vpp, rel=1e-3)
        # the level is the bare plate's, which is the worse one
        assert at["level_of"] == {"finger_load": False, "loss_factor": None}
        assert at["level_db"] >= gains.level_db(1 - column, column)


def test_without_a_load_the_check_says_nothing_of_it() -> None:
    found = check_findings(check_study(study_of()), "study.toml")
    assert "finger load" not in found.text
    assert found.facts["conditions"][0]["displacements"]["finger_load"] is None


@pytest.mark.slow
def test_with_an_assumed_loss_both_are_tried_with_and_without() -> None:
    check = check_study(study_of(LOAD, strip="edge = 'clamped'"))
    assert len(check.conditions[0].bracket) == 4


@pytest.mark.slow
def test_a_window_is_chosen_that_is_quiet_with_and_without() -> None:
    more = '[burst]\nwindow = "auto"\nwanted_level_db = -30\n'
    loaded, bare = (study_of(load, more=more) for load in (LOAD, None))
    found, without = (chosen_window(one, one.conditions[0]).burst for one in (loaded, bare))
    assert dataclasses.astuple(found) >= dataclasses.astuple(without)
    assert all(gains.level_db(1, 0) <= -30 for gains in study_gains(loaded, bare=True))


def measured(text: str) -> Study:
    discs = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x}\ndiameter_mm = 12.8\n{text}\n'
        for side, x in (("left", -35), ("right", 35))
    )
    return study_from_text(f"[strip]\nloss_factor = 0.01\n{discs}", "study.toml")


AT = "measured_displacement_um = {um}\nmeasured_at_vpp = 100\nmeasured_at_hz = 300\n"


def test_a_displacement_from_peak_to_peak_is_twice_the_amplitude() -> None:
    peak = measured(AT.format(um=2.6))
    whole = measured(AT.format(um=5.2) + 'measured_as = "peak-to-peak"')
    assert loads_per_volt(whole) == loads_per_volt(peak)
    told = [
        next(one for one in plate_sources(study) if one.key.endswith("measured_displacement_um"))
        for study in (peak, whole)
    ]
    assert [one.words.split(",")[0] for one in told] == [
        "2.6 um peak at 100 Vpp and 300 Hz",
        "5.2 um peak-to-peak (2.6 um peak) at 100 Vpp and 300 Hz",
    ]
    assert [one.origin for one in told] == ["paper", "measured"]


@pytest.mark.parametrize(
    ("said", "assumed"),
    [
        ("", [("actuator[0].measured_as", "peak"), ("actuator[1].measured_as", "peak")]),
        ('measured_as = "peak"', []),
        ('measured_as = "peak-to-peak"', []),
    ],
)
def test_a_peak_that_nobody_wrote_is_told_as_assumed(
    said: str, assumed: list[tuple[str, str]]
) -> None:
    sources = plate_sources(measured(AT.format(um=2) + said))
    found = [(one.key, one.value) for one in sources if one.key.endswith("measured_as")]
    assert found == assumed
    words = "2 um taken as peak (assumed; measured_as says otherwise) at 100 Vpp and 300 Hz, "
    assert any(one.words.startswith(words) for one in sources) is bool(assumed)
    papers = plate_sources(measured(AT.format(um=2.6) + said.replace("-to-peak", "")))
    assert not [one for one in papers if one.key.endswith("measured_as")]


def test_the_papers_value_from_peak_to_peak_is_not_the_papers() -> None:
    study = measured(AT.format(um=2.6) + 'measured_as = "peak-to-peak"')
    assert [one.origin for one in plate_sources(study) if "x_mm" in one.key] == ["yours", "yours"]


def test_how_nothing_was_measured_is_not_said() -> None:
    with pytest.raises(StudyError, match="measured_displacement_um is missing; measured_as needs"):
        measured('measured_as = "peak-to-peak"')


def test_a_map_says_that_it_is_without_the_fingers() -> None:
    assert plate_of(LOADED).basis.endswith("measured by the paper; without the finger load")


@pytest.mark.parametrize(
    ("change", "strip", "words"),
    [
        ({"source": None}, "", r"finger_load.source is missing; mass_g needs it"),
        ({"mass_g": 0.0}, "", r"finger_load.mass_g must be .* >= 0.01 and <= 10; got 0.0"),
        ({"mass_g": "0,3"}, "", r"finger_load.mass_g must be"),
        ({"damping_n_s_m": -1.0}, "", r"finger_load.damping_n_s_m must be .* >= 0"),
        ({}, 'length_mm = "endless"', r"strip.length_mm must be a number where \[finger_load\]"),
    ],
)
def test_a_load_that_cannot_be_is_refused(change: dict[str, Any], strip: str, words: str) -> None:
    load = {key: value for key, value in (LOAD | change).items() if value is not None}
    with pytest.raises(StudyError, match=words):
        study_of(load, strip=strip)


def test_a_finger_beside_the_plate_is_refused() -> None:
    more = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x}\ny_mm = 4\ndiameter_mm = 5\n'
        for side, x in (("left", -35), ("right", 35))
    )
    with pytest.raises(StudyError, match=r"finger_diameter_mm of the left actuator .* at most 8"):
        study_of(LOAD, more=more)


LONG = (
    '[strip]\nwidth_mm = 30\nlength_mm = 3000\nthickness_mm = 0.5\nmaterial = "steel"\n'
    'edge = "clamped"\n'
    + "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 12\n'
        for side, x_mm in (("left", -35), ("right", 35))
    )
    + "[finger_load]\nmass_g = 0.3\nstiffness_n_m = 600\ndamping_n_s_m = 1.5\n"
    'holds_up_to_hz = 1500\nsource = "x"\n'
)


@pytest.mark.slow
def test_fingers_press_on_a_plate_of_any_length() -> None:
    shorter, longer = (
        study_gains(study_from_text(LONG.replace("3000", length), "s.toml"))[0].per_vpp
        for length in ("3000", "10000")
    )
    assert shorter == longer


def test_what_is_not_known_with_fingers_is_refused_by_the_users_keys(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unknown(*_: object, **__: object) -> None:
        raise ValueError("fingertips must have no impedance where modes do not give rtol = 0.003")

    monkeypatch.setattr("experiment.study.physics.felt_of", unknown)
    with pytest.raises(StudyError, match=r"\[finger_load\] on this .* length_mm$") as caught:
        study_gains(study_from_text(LONG, "s.toml"))
    assert "rtol" not in str(caught.value)
