"""`tactstrip field`: its tables are the library's values, its figures are repeatable."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from experiment import check_study, paper_study
from experiment.check.field import (
    PlateBand,
    level_db,
    plate_band,
    plate_map,
    plate_motion,
)
from experiment.check.report import format_level
from stimuli.plate.response import displacement
from stimuli.plate.scene import Scene
from tests.plates import PAPER_PLATE, study_from_text
from tests.test_experiment.studies import discs, measured, plate

if TYPE_CHECKING:
    from tests.conftest import Refused, Run

ENDLESS = '[strip]\nlength_mm = "endless"\n'
OFF_CENTRE = """
strip.edge = "simply-supported"
strip.width_mm = 40
strip.length_mm = "endless"
strip.youngs_modulus_gpa = 67
strip.poisson_ratio = 0.346
strip.density_kg_m3 = 2700
actuator = [
    {site = "left", x_mm = -30, diameter_mm = 25},
    {site = "right", shape = "rectangle", x_mm = 30, y_mm = 12, length_x_mm = 6, length_y_mm = 18},
]
"""
STEEL = (
    "[strip]\nwidth_mm = 30\nlength_mm = 150\nthickness_mm = 0.5\n"
    'material = "steel"\nedge = "clamped"\n' + discs(measured(4) + 'measured_by = "A"\n')
)


@pytest.fixture(autouse=True)
def in_a_folder_with_the_papers_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(PAPER_PLATE, encoding="utf-8")


def band(text: str, low_hz: float, high_hz: float, n_frequencies: int = 29) -> PlateBand:
    return plate_band(plate(text), (low_hz, high_hz), n_frequencies=n_frequencies)


def table(name: str) -> list[dict[str, str]]:
    with Path(name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def files() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "name"),
    [
        ((), "field.png"),
        (("--frequency-hz", "3000"), "map.svg"),
        (("--band", "100", "3000"), "band.svg"),
        (("--band", "100", "200"), "BAND.CSV"),
    ],
)
def test_a_figure_has_the_same_bytes_on_every_run(
    options: tuple[str, ...], name: str, run: Run
) -> None:
    out = () if name == "field.png" else ("--out", name)
    contents = []
    for _ in range(2):
        result = run("field", "study.toml", *options, *out)
        assert (result.exit_code, result.stderr, files()) == (0, "", sorted([name, "study.toml"]))
        contents.append(Path(name).read_bytes())  # the second run replaces it
    assert contents[0] == contents[1]
    if name == "field.png":
        assert contents[0].startswith(b"\x89PNG")
        check = check_study(paper_study()).conditions[0]
        assert format_level(check.level_db(1, 0), check.level_error_db(1, 0)) in result.stdout
        assert "of the tone at most -86.2 dB" in result.stdout  # less than is resolved
    if name.endswith("svg"):
        text = contents[0].decode()
        assert [one for one in ("(mm)", "2900 Hz", "200 Vpp") if one not in text] == (
            ["(mm)"] if "--band" in options else []
        )


@pytest.mark.slow
def test_a_field_has_the_level_of_the_burst_by_which_the_check_decides() -> None:
    (condition,) = check_study(study_from_text(STEEL, "s")).conditions
    levels_db = tuple(
        (condition.level_db(*pair), condition.level_error_db(*pair)) for pair in ((1, 0), (0, 1))
    )
    assert plate(STEEL).burst_levels_db == levels_db
    two = plate(STEEL + '[[condition]]\nname = "a"\n[[condition]]\nname = "b"\ncycles = 2\n')
    assert two.burst_levels_db == levels_db
    assert plate(f"{STEEL}[device]\nsample_rate_hz = 1000\n").burst_levels_db == ()


@pytest.mark.parametrize(
    ("text", "level_vpp", "known", "amplitudes"),
    [
        (discs(measured()), 200.0, ("left", "right"), None),
        (discs(measured(), ""), None, ("left",), (1.0, 1.0)),
        (discs(), None, (), (1.0, 1.0)),
        (OFF_CENTRE, None, (), (1.0, 1.0)),
    ],
)
def test_a_drive_is_in_volts_where_both_displacements_are_known(
    text: str, level_vpp: float | None, known: tuple[str, ...], amplitudes: object
) -> None:
    preview = plate(text)
    assert (preview.level_vpp, tuple(preview.loads_per_volt)) == (level_vpp, known)
    assert amplitudes in (None, preview.amplitudes)


@pytest.mark.slow
def test_the_paper_plate_confines_a_tone_of_its_burst() -> None:
    found = plate_map(plate(ENDLESS), 500.0)
    for driven, x_m in enumerate((-0.035, 0.035)):
        assert found.peak_of(driven)[1:] == pytest.approx((x_m, 0.0125), abs=1e-12)
        assert found.level_db(driven, 1 - driven) < -80


@pytest.mark.slow
def test_a_map_ends_with_the_plate_and_has_its_edges_at_rest() -> None:
    found = plate_map(plate(), 500.0)
    assert (found.x_m[0], found.x_m[-1]) == pytest.approx((-0.1, 0.1), abs=1e-15)
    assert (found.y_m[0], found.y_m[-1]) == (0.0, 0.025)
    assert not found.displacement_m[:, :, [0, -1]].any()
    longer = plate_map(plate("[strip]\nlength_mm = 900"), 500.0)
    assert 0.135 < longer.x_m[-1] < 0.15


def test_a_band_leaves_out_only_what_is_infinite() -> None:
    whole = band(ENDLESS, 100.0, 2900.0)
    assert whole.frequencies_hz.tolist() == [100.0 * n for n in range(1, 29)]
    assert whole.left_out_hz == (2900.0,)
    below = band(ENDLESS, 100.0, 2850.0)
    assert (below.left_out_hz, below.frequencies_hz.size) == ((), 29)


def test_only_waves_that_the_actuators_make_have_their_cutoff_marked() -> None:
    strip = paper_study().strip
    assert band("", 0.0, 20_000.0, 9).cutoffs_hz == (strip.cutoff_hz(1), strip.cutoff_hz(3))
    strip = study_from_text(OFF_CENTRE, "s").strip
    off_centre = band(OFF_CENTRE, 1000.0, 7000.0, 9)
    assert off_centre.cutoffs_hz == (strip.cutoff_hz(2), strip.cutoff_hz(3))


def test_the_measured_displacement_comes_out_at_the_highest_level() -> None:
    at_m = plate().at_fingers_m([300.0])[0][:, :, 0]
    assert np.abs(np.diag(at_m)) == pytest.approx(2 * 2.6e-6, rel=1e-4)


def test_a_level_is_the_other_finger_against_the_own_one() -> None:
    assert level_db(2.0, [2.0, 0.2j, -20.0]) == pytest.approx([0.0, -20.0, 20.0])
    assert level_db(1.0, 0.0) < -1000


@pytest.mark.slow
def test_the_table_of_a_map_has_the_librarys_values(run: Run) -> None:
    assert run("field", "study.toml", "--frequency-hz", "3300", "--out", "map.csv").exit_code == 0
    rows = table("map.csv")
    assert len(rows) == 401 * 51
    shown = plate()
    for row in rows[700::3001]:
        place = (float(row["x_mm"]) / 1e3, float(row["y_mm"]) / 1e3)
        scene = Scene(strip=shown.strip, loads=shown.loads, points_m=(place,))
        per_load_um = 1e6 * displacement(scene, [3300.0])[0, :, 0]
        expected_um = per_load_um * np.array(shown.amplitudes)
        for name, u_um in zip(("left", "right"), expected_um, strict=True):
            re_um, im_um, abs_um = (
                float(row[f"{name}_driven_{p}_um"]) for p in ("re", "im", "abs")
            )
            assert complex(re_um, im_um) == pytest.approx(u_um, rel=1e-4)
            assert abs_um == pytest.approx(abs(u_um), rel=1e-4)
    assert {row["frequency_hz"] for row in rows} == {"3300.0"}
    assert {(row["level_vpp"], row["loss_factor"], row["loss_basis"]) for row in rows} == {
        ("200", "0.01", "assumed")
    }


@pytest.mark.slow
def test_a_burst_leaves_the_driven_disc_and_stays_there() -> None:
    found = plate_motion(plate())
    size_m = np.abs(found.displacement_m).max(axis=1)
    for driven, x_m in enumerate((-0.035, 0.035)):
        along, _ = np.unravel_index(np.argmax(size_m[driven]), size_m[driven].shape)
        assert found.x_m[along] == pytest.approx(x_m, abs=0.002)
        own_m, other_m = (np.abs(found.at_fingers_m[driven, f]).max() for f in (driven, 1 - driven))
        assert other_m < 0.1 * own_m
    assert not found.displacement_m[:, 0].any()
    assert np.allclose(found.displacement_m[0, :, ::-1], found.displacement_m[1], atol=1e-9)


@pytest.mark.slow
def test_animate_writes_a_gif_of_both_actuators_and_replaces_pictures_only(
    run: Run, refused: Refused
) -> None:
    result = run("field", "study.toml", "--animate")
    assert (result.exit_code, result.stderr, files()) == (0, "", ["burst.gif", "study.toml"])
    with Image.open("burst.gif") as film:
        assert (getattr(film, "n_frames", 0), film.info["duration"]) == (2 * 41, 50)
    assert Path("burst.gif").stat().st_size < 5e6
    Path("burst.gif").write_text("notes", "utf-8")
    assert "burst.gif" in refused("field", "study.toml", "--animate")
    assert Path("burst.gif").read_text("utf-8") == "notes"
    Path("field.png").symlink_to("study.toml")
    assert "field.png" in refused("field", "study.toml")
