"""`tactstrip field`: its tables are the library's values, its figures say what they show."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from experiment.preview.field import PlateBand, level_db, plate_band, plate_map, plate_motion
from experiment.preview.field_figure import render
from experiment.preview.field_report import field_csv, field_text, metres, strip_text
from experiment.preview.plate import DriveLevels, plate_of
from experiment.study.physics import field_strip, loads_of, study_gains
from experiment.study.read import paper_study, study_from_text
from experiment.study.sources import displacement_source
from stimuli import Fingertip, ForceRectangle, Scene, displacement

if TYPE_CHECKING:
    from experiment.preview.plate import PlatePreview
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
    {side = "left", x_mm = -30, diameter_mm = 25},
    {side = "right", shape = "rectangle", x_mm = 30, y_mm = 12, length_x_mm = 6, length_y_mm = 18},
]
"""


@pytest.fixture(autouse=True)
def in_a_folder_with_the_papers_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text("", encoding="utf-8")


def plate(text: str = "") -> PlatePreview:
    return plate_of(study_from_text(text, "s"))


def band(text: str, low_hz: float, high_hz: float, n_frequencies: int = 29) -> PlateBand:
    return plate_band(plate(text), (low_hz, high_hz), n_frequencies=n_frequencies)


def missing(told: str, *words: str) -> list[str]:
    """List the words that are not told."""
    return [word for word in words if word not in told]


def table(name: str) -> list[dict[str, str]]:
    with Path(name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def files() -> list[str]:
    return sorted(path.name for path in Path().iterdir())


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


def test_the_drive_scales_every_displacement_and_no_level() -> None:
    asked = plate()
    left, right = asked.drive.amplitudes
    driven = replace(asked, drive=replace(asked.drive, amplitudes=(0.5 * left, 2.0 * right)))
    asked_m, scaled_m = (found.at_fingers_m([300.0]) for found in (asked, driven))
    assert np.allclose(scaled_m, asked_m * np.array([0.5, 2.0])[:, None, None], rtol=1e-14)


def test_the_measured_displacement_comes_out_at_the_highest_level() -> None:
    at_m = plate().at_fingers_m([300.0])[:, :, 0]
    assert np.abs(np.diag(at_m)) == pytest.approx(2 * 2.6e-6, rel=1e-4)
    unknown = plate(OFF_CENTRE).drive
    assert (unknown.basis, unknown.amplitudes) == ("per unit load of 1 N m/m", (1.0, 1.0))


def test_a_level_is_the_other_finger_against_the_own_one() -> None:
    assert level_db(2.0, [2.0, 0.2j, -20.0]) == pytest.approx([0.0, -20.0, 20.0])
    assert level_db(1.0, 0.0) < -1000


def test_a_plate_with_loss_has_a_field_at_its_cutoff_too() -> None:
    found = band("[strip]\nloss_factor = 0.01", 100.0, 2900.0)
    assert found.left_out_hz == ()
    assert np.argmax(np.abs(found.at_fingers_m[0, 0])) == 28


@pytest.mark.slow
def test_an_actuator_under_neither_finger_is_shown_at_both() -> None:
    two = plate()
    motor = ForceRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.004, length_y_m=0.01)
    drive = DriveLevels(
        names=("left", "right", "motor"),
        units=("N m/m", "N m/m", "N"),
        amplitudes=(1.0, 1.0, 1.0),
        bases=(),
        level_vpp=None,
    )
    fingertips = (*two.fingertips, Fingertip(x_m=0.0, y_m=0.0125))
    three = replace(two, loads=(*two.loads, motor), drive=drive, fingertips=fingertips)
    assert [three.others_of(driven) for driven in range(3)] == [(1,), (0,), (0, 1)]
    found, over = plate_map(three, 500.0), plate_band(three, (100.0, 3000.0), n_frequencies=9)
    told = field_text(found, "s").splitlines()
    assert told[-1].startswith("motor driven   ")
    assert re.search(
        r" left finger: tone (.*) dB; right finger: tone \1 dB; at most .* um per N, at ", told[-1]
    )
    assert "per unit load of 1 N m/m or 1 N" in told[2]
    assert "motor_driven_at_left_abs_um_per_unit_load" in field_csv(over)
    svg = render(over, "svg").decode()
    assert not missing(svg, "|u| (µm per unit load)", "other finger, the right of two")
    assert "motor actuator driven" in render(found, "svg").decode()


@pytest.mark.slow
def test_without_options_it_is_a_map_at_the_burst_of_the_first_condition(run: Run) -> None:
    result = run("field", "study.toml")
    assert result.exit_code == 0, result.stderr
    assert files() == ["field.png", "study.toml"]
    assert Path("field.png").read_bytes().startswith(b"\x89PNG")
    assert not missing(
        result.stdout,
        "map            500 Hz",
        "computed for 200 Vpp; displacement per volt: measured by the paper",
        "loss factor 0.01 assumed",
        "burst: at the other finger, as check has it, which decides; the limit is -20 dB\n   ",
        "right finger: burst -23.7 dB, tone -90.8 dB; at most 5.25 um, at x = -35, y = 12.5 mm of",
        "field.png written",
    )


@pytest.mark.slow
def test_the_table_of_a_map_has_the_librarys_values(run: Run) -> None:
    assert run("field", "study.toml", "--frequency-hz", "3300", "--out", "map.csv").exit_code == 0
    rows = table("map.csv")
    assert len(rows) == 401 * 51
    study = paper_study()
    for row in rows[700::3001]:
        place = (float(row["x_mm"]) / 1e3, float(row["y_mm"]) / 1e3)
        scene = Scene(strip=field_strip(study), loads=loads_of(study), points_m=(place,))
        per_load_um = 1e6 * displacement(scene, [3300.0], rtol=1e-8)[0, :, 0]
        expected_um = per_load_um * np.array(plate_of(study).drive.amplitudes)
        for name, u_um in zip(("left", "right"), expected_um, strict=True):
            re_um, im_um, abs_um = (
                float(row[f"{name}_driven_{p}_um"]) for p in ("re", "im", "abs")
            )
            assert complex(re_um, im_um) == pytest.approx(u_um, rel=1e-4)
            assert abs_um == pytest.approx(abs(u_um), rel=1e-4)
    assert {row["frequency_hz"] for row in rows} == {"3300.0"}
    basis = "computed for 200 Vpp; displacement per volt: measured by the paper"
    assert {row["basis"] for row in rows} == {f"{basis}; loss factor 0.01 assumed"}


def test_the_table_of_a_band_has_the_librarys_values_in_full_precision(run: Run) -> None:
    Path("study.toml").write_text(ENDLESS, encoding="utf-8")
    assert run("field", "study.toml", "--band", "100", "3000", "--out", "band.csv").exit_code == 0
    rows = table("band.csv")
    found = band(ENDLESS, 100.0, 3000.0, 500)
    assert [float(row["frequency_hz"]) for row in rows] == found.frequencies_hz.tolist()
    for i, driven in enumerate(("left", "right")):
        for j, finger in enumerate(("left", "right")):
            re_um, im_um = (
                np.array([float(row[f"{driven}_driven_at_{finger}_{part}_um"]) for row in rows])
                for part in ("re", "im")
            )
            assert np.array_equal(re_um + 1j * im_um, found.at_fingers_m[i, j] * 1e6)


@pytest.mark.slow
def test_a_band_says_where_the_other_finger_comes_near_and_what_is_left_out(run: Run) -> None:
    Path("study.toml").write_text(ENDLESS, encoding="utf-8")
    result = run("field", "study.toml", "--band", "500", "2900", "--out", "band.svg")
    assert result.exit_code == 0, result.stderr
    assert not missing(
        result.stdout,
        "499 frequencies",
        "left out       2900 Hz, a cut-off",
        "above -20 dB first at 28",
    )
    quiet = run("field", "study.toml", "--band", "100", "1000", "--out", "quiet.csv")
    assert "above -20 dB nowhere" in quiet.stdout


def test_the_ending_may_be_in_capitals(run: Run) -> None:
    assert run("field", "study.toml", "--band", "100", "200", "--out", "BAND.CSV").exit_code == 0
    assert len(table("BAND.CSV")) == 500


MAP_TOLD = (
    "displacement at 3000 Hz; cut-off",
    "x along the plate, from its middle (mm)",
    "y (mm)",
    "|u| (dB re the panel's largest)",
    "left actuator driven: largest",
    "fingertip's contact",
    "−20 dB, the masking limit",
)
BAND_TOLD = (
    "displacement at the fingers; cut-off 2900 Hz (measured by the paper), elastic edges",
    "Frequency (Hz)",
    "|u| (µm)",
    "computed for 200 Vpp; displacement per volt: measured by the paper",
    "above the actuator",
    "other finger",
    "2900 Hz",
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "basis", "unit"),
    [
        ("", "computed for 200 Vpp; displacement per volt: measured by the paper", "µm"),
        (OFF_CENTRE, "per unit load of 1 N m/m", "µm per N m/m"),
    ],
    ids=["paper", "off-centre"],
)
def test_a_map_names_its_axes_its_unit_its_cutoff_and_its_basis(
    text: str, basis: str, unit: str
) -> None:
    svg = render(plate_map(plate(text), 3000.0), "svg")
    assert not missing(svg.decode(), *MAP_TOLD, basis, unit)


@pytest.mark.slow
def test_a_band_names_its_axes_its_unit_its_cutoffs_and_its_basis() -> None:
    assert not missing(render(band("", 100.0, 5000.0, 500), "svg").decode(), *BAND_TOLD)


@pytest.mark.slow
def test_figures_have_the_same_bytes_on_every_run() -> None:
    for found in (plate_map(plate(), 500.0), band("", 100.0, 5000.0)):
        assert render(found, "png") == render(found, "png")
        assert render(found, "svg") == render(found, "svg")


@pytest.mark.slow
def test_a_known_displacement_per_volt_changes_every_unit_and_says_its_basis() -> None:
    drive = DriveLevels(
        names=("left", "right"),
        units=("N m/m", "N m/m"),
        amplitudes=(0.13, 0.13),
        bases=("your measurement", "predicted"),
        level_vpp=200.0,
    )
    found = plate_map(replace(plate(), drive=drive), 500.0)
    head, first, *_ = field_csv(found).splitlines()
    assert "left_driven_abs_um," in head
    assert "per_unit_load" not in head
    for text in (first, field_text(found, "study.toml"), render(found, "svg").decode()):
        assert (
            "computed for 200 Vpp; displacement per volt: left your measurement, right predicted"
            in text
        )
        assert "N m/m" not in text


@pytest.mark.parametrize(
    ("keys", "whose"),
    [("", "your measurement"), ('measured_by = "A. Meier"\n', "measured by A. Meier")],
)
def test_a_measurement_says_whose_it_is(keys: str, whose: str) -> None:
    study = study_from_text(f"[strip]\nmeasured_cutoff_hz = 2500\n{keys}", "s.toml")
    assert strip_text(plate_of(study)) == f"cut-off 2500 Hz ({whose}), elastic edges"


def test_what_layers_predict_is_called_so_with_how_well() -> None:
    layers = (
        "piezo_thickness_mm = 0.13\npiezo_youngs_modulus_gpa = 61\npiezo_poisson_ratio = 0.3\n"
        "piezo_d31_pm_v = -170\n"
    )
    discs = "".join(
        f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ndiameter_mm = 9\n{layers}'
        for side, x_mm in (("left", -40), ("right", 40))
    )
    found = plate(f"[design]\nlevels_vpp = [31, 113]\n{discs}")
    assert found.drive.basis == (
        "computed for 113 Vpp; displacement per volt: predicted from layers, to a factor of two"
    )
    source = displacement_source(found.study, 1)
    assert source is not None
    assert source.words == "displacement predicted from its layers, yours"


@pytest.mark.parametrize(
    ("size_m", "told"),
    [(2.6e-6, "2.6 um"), (3.65e-3, "3.65 mm"), (7.96e-10, "796 pm"), (0.0, "0 pm")],
)
def test_a_displacement_has_a_prefix_that_suits_it(size_m: float, told: str) -> None:
    assert metres(size_m) == told


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--frequency-hz", "nan"], "--frequency-hz must be a finite number >= 0, got nan"),
        (["--frequency-hz=-1"], "--frequency-hz must be a finite number >= 0, got -1.0"),
        (["--frequency-hz", "1e9"], "--frequency-hz must lie from 0 to"),
        (["--frequency-hz", "2900"], "must not hold a cut-off of a strip without loss"),
        (["--band", "500", "100"], "--band must be two frequencies LO < HI"),
        (["--band", "500", "500"], "--band must be two frequencies LO < HI"),
        (["--band", "nan", "100"], "--band must be two frequencies LO < HI"),
        (["--band", "0", "inf"], "--band must be two frequencies LO < HI"),
        (["--band", "0", "1e9"], "--band must lie from 0 to"),
        (["--band", "1", "2", "--frequency-hz", "3"], "give one of them"),
        (["--out", "field.pdf"], "--out must end in .png, .svg, .csv; got field.pdf"),
        (["--out", "field"], "--out must end in .png, .svg, .csv; got field"),
        (["--out", "nowhere/field.png"], "nowhere/field.png: No such file or directory"),
    ],
)
def test_bad_input_is_one_line_and_changes_nothing(
    arguments: list[str], told: str, run: Run
) -> None:
    Path("study.toml").write_text(ENDLESS, encoding="utf-8")
    result = run("field", "study.toml", *arguments)
    assert (result.exit_code, result.stdout, files()) == (2, "", ["study.toml"])
    assert told in result.stderr
    assert result.stderr.count("\n") == 1
    assert len(result.stderr) < 250


@pytest.mark.parametrize("name", ["old.png", "old.svg", "old.csv"])
def test_an_existing_file_is_left_alone(name: str, refused: Refused) -> None:
    Path(name).write_text("mine", encoding="utf-8")
    told = (
        f"error: {name} exists and is left as it is; delete it, or name another file with --out\n"
    )
    assert refused("field", "study.toml", "--out", name) == told


def test_a_dangling_link_is_not_followed(run: Run) -> None:
    Path("field.png").symlink_to("elsewhere.png")
    assert run("field", "study.toml").exit_code == 2
    assert not Path("elsewhere.png").exists()


def test_a_missing_study_is_one_line(refused: Refused) -> None:
    assert refused("field", "no.toml") == "error: no.toml: No such file or directory\n"


@pytest.mark.slow
def test_a_write_that_fails_leaves_no_file_behind(
    monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    Path("study.toml").write_text(ENDLESS, encoding="utf-8")
    monkeypatch.setattr("experiment.commands.field._content", lambda *_: "no bytes")
    result = run("field", "study.toml")
    assert isinstance(result.exception, TypeError)
    assert files() == ["study.toml"]


@pytest.mark.process
def test_a_table_imports_no_matplotlib() -> None:
    program = (
        "import sys\nfrom experiment.commands.field import field\n"
        "field(['study.toml', '--out', 'field.csv'], standalone_mode=False)\n"
        "print('matplotlib' in sys.modules)"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"


@pytest.mark.slow
def test_the_headline_has_the_numbers_of_the_map() -> None:
    found = plate_map(plate(OFF_CENTRE), 3000.0)
    for driven, line in enumerate(field_text(found, "s").splitlines()[-2:]):
        told = re.search(r"tone ([-\d.]+) dB;", line)
        assert told is not None
        assert float(told[1]) == pytest.approx(found.level_db(driven, 1 - driven), abs=0.05)


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
def test_the_motion_above_the_actuator_is_what_its_finger_gets_by_the_check() -> None:
    (gains,) = study_gains(paper_study())
    own_um = 1e6 * np.abs(plate_motion(plate()).at_fingers_m[0, 0]).max()
    assert own_um == pytest.approx(200 * gains.per_vpp[0][0], rel=0.02)


@pytest.mark.slow
def test_animate_writes_a_gif_of_both_actuators_and_leaves_files_alone(
    run: Run, refused: Refused
) -> None:
    result = run("field", "study.toml", "--animate")
    assert (result.exit_code, result.stderr, files()) == (0, "", ["burst.gif", "study.toml"])
    told = result.stdout
    assert missing(told, "0 to 4 ms in steps of 0.1 ms, slowed 500 times", "right driven") == []
    assert "of the peaks at the fingers' centres in this time" in told
    level = r"-\d\d\.\d dB"
    assert re.search(rf"\nright driven   left finger: burst {level}, shown {level}; at most", told)
    with Image.open("burst.gif") as film:
        assert (getattr(film, "n_frames", 0), film.info["duration"]) == (2 * 41, 50)
    assert Path("burst.gif").stat().st_size < 5e6
    assert "burst.gif exists" in refused("field", "study.toml", "--animate")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_animate_writes_an_mp4(run: Run) -> None:
    result = run("field", "study.toml", "--animate", "--out", "b.mp4")
    assert (result.exit_code, result.stderr) == (0, "")
    assert Path("b.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.slow
def test_an_ffmpeg_that_cannot_is_one_line(
    refused: Refused, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "bin" / "ffmpeg"
    broken.parent.mkdir()
    broken.write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    broken.chmod(0o700)
    monkeypatch.setenv("PATH", str(broken.parent), prepend=os.pathsep)
    told = refused("field", "study.toml", "--animate", "--out", "b.mp4")
    assert told.endswith("ffmpeg cannot write an MP4 here; let --out end in .gif\n")
    assert not Path("b.mp4").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--out", "a.png"), "--out must end in .gif, .mp4; got a.png"),
        (("--out", "a.mp4"), "an MP4 needs ffmpeg"),
        (("--frequency-hz", "500"), "--animate shows the burst"),
        (("--band", "100", "500"), "--animate shows the burst"),
    ],
)
def test_what_cannot_be_animated_is_one_line(
    options: tuple[str, ...], said: str, refused: Refused, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shutil.which", lambda name: None)
    told = refused("field", "study.toml", "--animate", *options)
    assert said in told
    assert told.count("\n") == 1


WORK = """
import sys, time
from experiment.commands.options import working
with working("Computing") as step:
    step(1, 4)
    time.sleep(float(sys.argv[1]))
print("rich" in sys.modules)
"""


@pytest.mark.process
@pytest.mark.parametrize(("seconds", "shows"), [("1.5", b"1"), ("0", b"")])
def test_progress_is_on_a_terminal_only_and_not_for_what_is_over_at_once(
    seconds: str, shows: bytes
) -> None:
    ours, theirs = os.openpty()
    command = [sys.executable, "-c", WORK, seconds]
    try:
        environment = os.environ | {"TERM": "xterm"}
        subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=theirs, env=environment)
        os.write(theirs, b"|end|")
        seen = os.read(ours, 1 << 16)
    finally:
        os.close(ours)
        os.close(theirs)
    assert (b"Computing" in seen) == bool(shows)
    piped = subprocess.run(command, check=True, capture_output=True, text=True)
    assert (piped.stdout, piped.stderr) == ("False\n", "")


def test_where_a_band_exceeds_the_limit_does_not_depend_on_its_steps() -> None:
    first_hz = [
        float(re.findall(r"above -20 dB first at ([\d.]+) Hz", field_text(one, "s"))[0])
        for one in (band("", 200, 5000, 500), band("", 2500, 2900, 100))
    ]
    assert first_hz[0] == pytest.approx(first_hz[1], abs=1)  # steps of 9.6 and 4 Hz
