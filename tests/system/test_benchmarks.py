"""The benchmarks run: the smallest case of each."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis.reading.load import read_trials
from analysis.thresholds.density import Nodes
from analysis.workers.chunks import spread
from benchmarks import __main__ as command
from benchmarks import (
    analysis,
    calibration,
    crosscheck,
    field,
    gains,
    groups,
    hard_cases,
    people,
    power,
    precision,
    screen,
    serial,
    single,
    skipping,
    stability,
    sweep,
    timing,
)
from benchmarks.exact import exact
from benchmarks.plate_fem import direct, modal, model
from experiment.study.physics import study_gains
from stimuli import CLAMPED, SIMPLY_SUPPORTED, MomentRectangle, PointForce, displacement

if TYPE_CHECKING:
    from pathlib import Path

    from stimuli import Load, Strip

pytestmark = pytest.mark.gallery


W = 0.025


@pytest.mark.parametrize(
    ("strip", "load", "place", "known_m", "rel"),
    [
        # contour integrals and modal sums, 16 digits
        (hard_cases.strip_on(SIMPLY_SUPPORTED), PointForce(x_m=0.0, y_m=W / 2), (0.0, W / 2, 300.0),
         1.35672670270450974e-05, 1e-15),
        (hard_cases.strip_on(CLAMPED), PointForce(x_m=0.0, y_m=W / 2), (0.07, W / 2, 300.0),
         3.70695978412616636e-11, 1e-15),
        # with free ends: polynomial and finite-element models, 12 digits
        (field.scene(SIMPLY_SUPPORTED).strip,
         MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.005, length_y_m=0.015),
         (0.02, 0.0075, 500.0), -1.9807964221232675e-06 - 2.2596465628158454e-08j, 1e-12),
    ],
)  # fmt: skip
def test_the_evaluator_gives_values_known_from_other_methods(
    strip: Strip, load: Load, place: tuple[float, float, float], known_m: complex, rel: float
) -> None:
    assert float(abs(exact(strip, load, *place) / known_m - 1)) < rel


def test_a_sweep_tells_its_error_and_that_it_was_told() -> None:
    found = sweep.measured(next(sweep.cases()), lambda *runs: [1.0] * len(runs))
    assert found.error < found.told < sweep.RTOL
    assert "| 1.0, 1.0 |" in sweep.row("one", (found, found))


def test_one_frequency_tells_its_error_and_that_it_was_told() -> None:
    found = single.measured(next(single.cases()), lambda *runs: [1.0] * len(runs))
    assert found.error < found.told < sweep.RTOL


def test_a_stability_section_tells_error_and_estimate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    sweep = hard_cases.sweeps()[1]
    small = hard_cases.Sweep(name=sweep.name, axis=sweep.axis, cases=sweep.cases[4:6])
    monkeypatch.setattr(stability, "sweeps", lambda: (small,))
    monkeypatch.setattr(stability, "FIGURE", tmp_path / "figure.png")
    text = stability.section()
    assert "| Cut-off | " in text
    assert "a cut-off itself is refused." in text
    assert (tmp_path / "figure.png").exists()


def test_a_field_section_sets_finite_elements_beside_the_field(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(field, "MESHES_M", (12.5e-3,))
    monkeypatch.setattr(field, "MODES", (4, 8))
    monkeypatch.setattr(field, "COUNTS", (1, 3))
    monkeypatch.setattr(field, "RTOLS", (1e-2, 1e-6))
    monkeypatch.setattr(field, "FIGURE", tmp_path / "figure.png")
    monkeypatch.setattr(field, "growth", lambda: iter(()))
    text = field.section()
    assert text.count("| supported | ") == text.count("| clamped | ") == 2
    assert (tmp_path / "figure.png").exists()


def test_finite_elements_on_a_coarse_grid_are_right_to_a_percent() -> None:
    place = field.scene(SIMPLY_SUPPORTED)
    plate = model(place.strip, field.PATCH, place.points_m, 6e-3)
    asked = field.frequencies(3)
    true = displacement(place, asked, 1e-6)[:, 0]
    assert field.error_of(direct(plate, asked), true) < 1e-2
    assert field.error_of(modal(40, plate, asked), true) < 1e-2


def test_growth_is_timed_over_points_loads_and_frequencies() -> None:
    assert len(list(field.growth(most=10))) == 3


def test_a_saving_changes_its_count() -> None:
    saving = next(skipping.savings())
    assert " of 121 pairs" in skipping.row(saving)


def test_a_timed_run_is_told_its_number() -> None:
    seen: list[int] = []
    timing.median_s(seen.append, 3)
    assert seen == [0, 1, 2, 3]


def test_a_window_section_says_why_it_is_not_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.version_info", (3, 13, 0))
    assert "Not measured: --responder screen needs Python 3.11 or 3.12" in screen.section()


def test_a_crosscheck_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crosscheck, "find_spec", lambda _: None)
    assert "Not measured: needs the extra `crosscheck`" in crosscheck.section()


def test_an_analysis_section_sets_pandas_beside_the_command(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(analysis, "SIZES", (2,))
    text = analysis.section()
    assert "155 trials each" in text
    assert text.count("| 2 |") == 4


def test_a_calibration_section_tells_coverage_and_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(calibration, "STUDIES", 20)
    monkeypatch.setattr(calibration, "BESIDE", 0)
    monkeypatch.setattr(calibration, "SCENARIOS", calibration.SCENARIOS[:2])
    text = calibration.section()
    assert "\n| wilson | " in text
    assert text.count("| 62, 0.1, ") == 2
    assert "\n| twelve | 0.32: " in text
    assert "The first 2 together have an RMSE of " in text


def test_statsmodels_agrees_where_there_are_neither_guesses_nor_lapses() -> None:
    one = calibration.Scenario(
        levels_vpp=calibration.PAPER, threshold_vpp=100, guess_rate=0, lapse_rate=0, presented=400
    )
    (counts,) = one.counts(1)
    (found,) = calibration.ours(one, counts[None])
    assert 20 * calibration.by_statsmodels(one, counts) == pytest.approx(20 * found, abs=0.1)


def test_a_precision_section_tells_time_and_error(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    coarse = Nodes(between=11, outside=4, log_sigma=7, lapse=3)
    monkeypatch.setattr(precision, "BESIDE", 0)
    monkeypatch.setattr(precision, "BATCH", 20)
    monkeypatch.setattr(precision, "GRIDS", (coarse,))
    monkeypatch.setattr(precision, "FINEST", Nodes(between=31, log_sigma=17, lapse=5))
    monkeypatch.setattr(precision, "FIGURE", tmp_path / "posterior.png")
    text = precision.section()
    assert "| 19 x 7 x 3 |" in text
    assert "`compare_conditions` takes " in text
    assert (tmp_path / "posterior.png").exists()


def test_a_groups_section_tells_coverage_of_groups_and_differences(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(groups, "STUDIES", 1)
    monkeypatch.setattr(groups, "BESIDE", 1)
    monkeypatch.setattr(groups, "PEOPLE", (3,))
    text = groups.section()
    assert "\n| prior | " in text
    assert "| 5 | statsmodels (`--population`) |" in text
    assert "\n| 2 dB | 3 dB | " in text


def test_a_gain_matrix_and_a_check_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    (name, text), *_ = gains.STUDIES.items()
    monkeypatch.setattr(gains, "STUDIES", {name: text})
    monkeypatch.setattr(gains, "REPEATS", 1)
    monkeypatch.setattr(gains, "N_DRAWN", 2)
    assert f"| {name} | " in gains.section()


def test_what_is_not_measured_stays_on_the_page(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    page = tmp_path / "benchmarks.md"
    page.write_text("# Old\n\n## Start\n\n1 s\n\n## Long runs\n\n42 kills\n", encoding="utf-8")
    monkeypatch.setattr(command, "PAGE", page)
    monkeypatch.setattr(command, "NAMES", ())
    command.main([])
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# Benchmarks\n\nMeasured by")
    assert text.endswith("\n\n## Long runs\n\n42 kills\n")
    assert "1 s" not in text


def test_a_section_of_people_tells_who_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(people, "DESIGNS", people.DESIGNS[:1])
    monkeypatch.setattr(people, "SESSIONS", 3)
    rows = people.section().splitlines()
    assert rows[-1].startswith("| the paper's, 150 | 0, 0, 0 | 0, 0, 0 | 3, 0, 0 | ")


def test_a_section_of_serial_effects_tells_how_often_one_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(serial, "TABLES", 4)
    few = {name: serial.NO_EFFECT[name] for name in ("one person", "staircase, one")}
    for name in ("NO_EFFECT", "DRIFT", "LAST"):
        monkeypatch.setattr(serial, name, few)
    text = serial.section()
    assert text.count("\n| each once, 6 x 12, one person | ") == 3
    assert "| staircase, 40 trials, one person | none told | none told | " in text


@pytest.mark.slow
def test_a_plan_of_power_is_held_against_fresh_studies_and_sessions() -> None:
    plan = power.Plan(goal="false-alarms=9%", spread_db=1.5, trials=5, blanks=20, most=8,
                      false_alarms=0.01)  # fmt: skip
    cells = power.row(plan, 1, spread, fresh=200, whole=5).strip("| ").split(" | ")
    assert len(power.plans()) == 40
    assert cells[:2] == ["false-alarms=9%", "1.5 dB"]
    assert [float(cell.split("%")[0]) >= 60 for cell in cells[6:9]] == [True] * 3


@pytest.mark.slow
def test_levels_of_each_condition_are_placed_by_a_pilot_session_of_both(tmp_path: Path) -> None:
    study = power.Plan(goal="difference=12dB", spread_db=1.0, blanks=20, placed=True).study()
    study = study.changed(simulation=replace(study.simulation, difference_db=-9.0))
    apart_db = []
    for folder in power.placed_sessions(
        study, tmp_path, participants=4, seed=6, gains=study_gains(study)
    ):
        levels = read_trials([folder.path]).groupby("condition", sort=False)["level_vpp"]
        middle = levels.apply(lambda of: sorted(of.dropna().unique())[2])
        first, second = (middle[one.name] for one in study.conditions)
        apart_db.append(20 * math.log10(second / first))
    assert np.median(apart_db) == pytest.approx(-9, abs=3)


@pytest.mark.slow
def test_levels_are_placed_by_a_pilot_session_of_the_same_person(tmp_path: Path) -> None:
    study = power.Plan(goal="half-width=20dB", spread_db=4.0, blanks=20, placed=True).study()
    thresholds, middles = [], []
    for folder in power.placed_sessions(
        study, tmp_path, participants=4, seed=3, gains=study_gains(study)
    ):
        levels = read_trials([folder.path])["level_vpp"].dropna().unique()
        assert len(levels) == 5
        header = json.loads(folder.header_path.read_text())
        thresholds.append(math.log10(header["observer"]["threshold_vpp"]))
        middles.append(math.log10(sorted(levels)[2]))
    assert np.corrcoef(thresholds, middles)[0, 1] > 0.9
