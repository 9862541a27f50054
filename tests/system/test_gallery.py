"""The gallery: every script runs, and its numbers are the paper's, the reference's or explained."""

from __future__ import annotations

import functools
import importlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.testing.compare import compare_images

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from stimuli import PiezoLayers, Strip

pytestmark = pytest.mark.gallery

ROOT = Path(__file__).resolve().parents[1]
GALLERY = ROOT / "docs" / "gallery"
SCRIPTS = sorted(path.stem for path in GALLERY.glob("*_*_*.py"))
SHAPES, SUPPORTED = "figure_01_mode_shapes", "figure_02_simply_supported_response"
DISC, PATCH = "figure_04_disc_response", "figure_08_patch_response"
ONE_DISC, TWO_DISCS = "figure_05_one_disc_map", "figure_06_two_discs_map"
UPRIGHT, FLAT = "figure_09_upright_patch_map", "figure_10_flat_patch_map"
MOTOR = "figure_11_motor_map"


@pytest.fixture(autouse=True)
def _gallery_on_the_path() -> Iterator[None]:
    """As when a script is run: its folder comes first."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(GALLERY)
        yield


def script(name: str) -> Any:
    return importlib.import_module(name)


@functools.cache
def numbers(name: str) -> Any:
    return script(name).numbers()


def level_db(name: str, frequency_hz: float) -> float:
    return float(numbers(name).response.level_at(frequency_hz))


def mean_db(name: str) -> float:
    return float(numbers(name).response.mean_level_db(numbers(name).cutoff_hz))


def centre_um(name: str) -> float:
    """The displacement above the first load."""
    found = numbers(name)
    return float(found.centres_m[0] if name == TWO_DISCS else found.centre_m) * 1e6


def force_n(*, clamped: bool) -> float:
    found = numbers(MOTOR)
    return float(found.clamped_force_n if clamped else found.force_n)


def test_every_figure_of_the_model_has_a_script() -> None:
    found = [int(name.split("_")[1]) for name in SCRIPTS if name.startswith("figure")]
    assert found == [1, 2, 4, 5, 6, 8, 9, 10, 11]


@pytest.mark.parametrize("name", SCRIPTS)
def test_script_draws_to_the_file_it_is_given(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "figure.png"
    monkeypatch.setattr(sys, "argv", [name, str(path)])
    script(name).main()
    assert path.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out == "", "the gallery shows what a script prints"


def test_script_names_the_file_it_draws_to_where_none_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [SHAPES])
    script(SHAPES).main()
    name = capsys.readouterr().out.removesuffix("\n")
    assert Path(name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.process
def test_a_downloaded_script_runs_as_it_is_unpacked(tmp_path: Path) -> None:
    offered, unpacked = tmp_path / "offered", tmp_path / "unpacked"
    offered.mkdir()
    for name in (f"{SHAPES}.py", "paper_plate.py"):
        shutil.copy(GALLERY / name, offered)
    (offered / f"{SHAPES}.zip").touch()
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(GALLERY.parent / "_ext")
        importlib.import_module("drawn").zip_with_shared(offered)
    shutil.unpack_archive(offered / f"{SHAPES}.zip", unpacked)
    command = [sys.executable, f"{SHAPES}.py"]
    subprocess.run(command, cwd=unpacked, env=os.environ | {"PYTHONPATH": str(ROOT)}, check=True)
    assert len(list(unpacked.glob("*.png"))) == 1


# Values of an independent computation with at least 13 digits (25-digit arithmetic and a
# finite-element model agree on them): cut-offs in Hz, displacement in m per N m/m, m per Pa.


def test_figure_1_has_the_cut_offs_of_the_reference() -> None:
    found = numbers(SHAPES)
    supported_hz = [1926.03136910769444, 7704.12547643077777, 17334.2823219692500]
    assert found.supported_hz[:3] == pytest.approx(supported_hz, rel=1e-12)
    assert found.built_hz[:2] == pytest.approx([2900.0, 8942.64392619945605], rel=1e-12)


def test_figure_1_shows_mode_n_with_n_lobes() -> None:
    for shapes in (numbers(SHAPES).supported, numbers(SHAPES).built):
        signs = [np.sign(shape[np.abs(shape) > 1e-9]) for shape in shapes]
        assert [1 + np.count_nonzero(np.diff(sign)) for sign in signs] == [1, 2, 3, 4, 5]


def test_figure_2_has_the_reference_and_confines_below_the_cut_off_only() -> None:
    known_m = -0.0000368781929448345153
    assert numbers(SUPPORTED).centre_at_300_hz_m == pytest.approx(known_m, rel=1e-6)
    assert 15 < level_db(SUPPORTED, 1000.0) < level_db(SUPPORTED, 300.0) < 25
    assert abs(level_db(SUPPORTED, 3000.0)) < 3


@pytest.mark.parametrize(("name", "cutoff_hz"), [(DISC, 2900.0), (PATCH, 2500.0)])
def test_figures_4_and_8_peak_at_the_measured_cut_off_and_have_the_papers_30_db_up_to_1_khz(
    name: str, cutoff_hz: float
) -> None:
    response = numbers(name).response
    peak = int(np.argmax(np.abs(response.centre_m)))
    assert response.frequencies_hz[peak] == cutoff_hz
    assert abs(response.centre_m[peak]) == pytest.approx(1.0, rel=1e-12)
    assert response.mean_level_db(1000.0) == pytest.approx(30.0, abs=3.5)
    for frequency_hz in (100.0, 300.0, 1000.0):
        assert response.level_at(frequency_hz) == pytest.approx(30.0, abs=5.5)
    # the level falls to 0 at the cut-off; the paper's "about 30 dB" is for all below
    assert -10 < mean_db(name) - 30.0 < -5


@pytest.mark.parametrize(
    ("name", "paper_um", "least", "most"),
    [
        # layer data are good to a factor of 1.5 to 2 at best
        (ONE_DISC, 1.0, 1 / 1.5, 1.5),
        (TWO_DISCS, 2.6, 1 / 1.5, 1.5),
        # the moment of a patch with a free rim is the least it can have
        (UPRIGHT, 2.8, 1.5, 2),
        (FLAT, 1.0, 1.2, 1.5),
    ],
)
def test_the_papers_amplitudes_are_met_within_a_factor(
    name: str, paper_um: float, least: float, most: float
) -> None:
    assert least < paper_um / centre_um(name) < most


def test_figure_6_leaves_the_rest_of_the_plate_at_rest() -> None:
    """The paper: 2.6 um above the discs, "the rest of the plate stays at rest"."""
    found = numbers(TWO_DISCS)
    assert found.plate.at(0.035) < 0.02 * found.centres_m[0]
    assert found.across_m < 1e-3 * found.centres_m[1]


def test_figures_5_and_6_of_the_paper_are_not_one_linear_plate() -> None:
    assert centre_um(TWO_DISCS) / centre_um(ONE_DISC) == pytest.approx(2.0, rel=1e-4)
    assert 2.6 / 1.0 > 1.25 * 2.0


def test_figure_10_has_the_reference_20_mm_from_the_centre() -> None:
    per_moment_m = numbers(FLAT).plate.at(0.02) / numbers(FLAT).moment_n
    assert per_moment_m == pytest.approx(4.96422864218509787e-7, rel=1e-5)


@pytest.mark.parametrize("name", [UPRIGHT, FLAT])
def test_figures_9_and_10_peak_at_the_patch_s_centre(name: str) -> None:
    assert numbers(name).plate.peak_place_m == pytest.approx((0.0, 0.0125), abs=1e-9)


def test_figure_10_moves_the_whole_width_over_a_patch_of_3_mm() -> None:
    """Section III-C: "the entire width of the plate is activated"."""
    plate = numbers(FLAT).plate
    across = np.abs(plate.displacement_m[plate.x_m.size // 2])
    assert across[np.isclose(plate.y_m, 0.006)] > across.max() / 4


def test_ratio_of_figures_9_and_10_misses_the_paper_s_by_less_than_a_factor_of_1_3() -> None:
    """Both patches are of one ceramic, so that its data drop out of the ratio."""
    assert 1 < 2.8 / (centre_um(UPRIGHT) / centre_um(FLAT)) < 1.3


def test_figure_11_takes_the_reference_s_force_between_clamps() -> None:
    per_force_m = 4.32387582593649594e-10 / (0.010 * 0.010)
    assert force_n(clamped=True) == pytest.approx(0.5e-6 / per_force_m, rel=1e-5)
    assert numbers(MOTOR).plate.at(0.0) == pytest.approx(0.5e-6, rel=1e-5)


def stiffening(strip: Strip, layers: PiezoLayers) -> float:
    """Bending stiffness of plate, carrier and piezo together over that of the plate alone."""
    material = strip.material
    moduli = (
        material.youngs_modulus_pa / (1 - material.poisson_ratio),
        layers.carrier_youngs_modulus_pa / (1 - layers.carrier_poisson_ratio),
        layers.youngs_modulus_pa / (1 - layers.poisson_ratio),
    )
    thick_m = (strip.thickness_m, layers.carrier_thickness_m, layers.thickness_m)
    levels_m = np.cumsum([0.0, *thick_m])
    zeroth, first, second = (
        float(np.dot(moduli, np.diff(levels_m**power) / power)) for power in (1, 2, 3)
    )
    alone = moduli[0] * strip.thickness_m**3 / 12
    return (second - first**2 / zeroth) / alone


def test_measured_amplitudes_lie_between_those_of_a_free_and_of_a_held_patch() -> None:
    plate = script("paper_plate")
    disc, patch = stiffening(plate.FIRST, plate.BUZZER), stiffening(plate.SECOND, plate.PIC255)
    assert f"by a factor of {patch:.1f} (PIC255) or {disc:.1f} (disc)" in told_of_figures()
    for measured_um, name, factor in (
        (2.6, TWO_DISCS, disc),
        (2.8, UPRIGHT, patch),
        (1, FLAT, patch),
    ):
        assert centre_um(name) < measured_um < factor * centre_um(name)
    assert centre_um(ONE_DISC) > 1.0


PEAKS = (
    (9, "SECOND", "UPRIGHT_PATCH", "PIC255", 700.0, 100.0),
    (10, "SECOND", "FLAT_PATCH", "PIC255", 700.0, 100.0),
    (6, "FIRST", "DISC", "BUZZER", 300.0, 100.0),
    (5, "FIRST", "DISC", "BUZZER", 300.0, 50.0),
)
MEANS = ((8, "SECOND", "UPRIGHT_PATCH", "PIC255"), (4, "FIRST", "DISC", "BUZZER"))


@pytest.mark.parametrize(("figure", "plate", "load", "layers", "frequency_hz", "level_vpp"), PEAKS)
def test_the_patch_in_the_plate_gives_what_the_page_tells(
    figure: int, plate: str, load: str, layers: str, frequency_hz: float, level_vpp: float
) -> None:
    paper = script("paper_plate")
    what = [getattr(paper, name) for name in (plate, load, layers)]
    per_v_m, _ = paper.with_patch(*what, np.array([frequency_hz]))
    told = re.search(rf"\| {figure}, [^|]*\| ([\d.]+) um \| [^|]*\| ([\d.]+) um", told_of_figures())
    assert told is not None
    assert per_v_m[0] * level_vpp / 2 * 1e6 == pytest.approx(float(told[2]), abs=0.005)


@pytest.mark.parametrize(("figure", "plate", "load", "layers"), MEANS)
def test_the_mean_level_with_the_patch_is_what_the_page_tells(
    figure: int, plate: str, load: str, layers: str
) -> None:
    paper = script("paper_plate")
    what = [getattr(paper, name) for name in (plate, load, layers)]
    frequencies_hz = np.linspace(10.0, what[0].cutoff_hz() - 100.0, 60)
    centre, beside = paper.with_patch(paper.lossy(what[0]), *what[1:], frequencies_hz)
    told = re.search(rf"\| {figure}, mean level [^|]*\|[^|]*\|[^|]*\| (\d+) dB", told_of_figures())
    assert told is not None
    assert np.mean(20 * np.log10(centre / beside)) == pytest.approx(float(told[1]), abs=0.5)


def test_the_motor_s_mass_does_not_matter_at_90_hz() -> None:
    """Per gram: mass times omega squared over the plate's stiffness under it."""
    stiffness_n_m = force_n(clamped=False) / 0.5e-6
    assert 1e-3 * (2 * np.pi * 90.0) ** 2 / stiffness_n_m < 0.01


# What the paper's section V says, 20 dB within 1 cm.


def distances_mm() -> dict[tuple[str, str], tuple[float, float]]:
    return {
        (decay.actuator, decay.edge): (decay.from_centre_m * 1e3, decay.from_rim_m * 1e3)
        for decay in numbers("section_5_twenty_decibels")
    }


def test_20_db_take_1_cm_from_the_rim_but_not_on_simple_supports() -> None:
    for (_, edge), (_, from_rim_mm) in distances_mm().items():
        assert (from_rim_mm < 10) == (edge != "simple supports")


def test_20_db_take_more_than_1_cm_from_the_centre_but_for_the_clamped_patch() -> None:
    near = [what for what, (from_centre_mm, _) in distances_mm().items() if from_centre_mm < 10]
    assert near == [("patch, 18 x 6 mm", "clamps")]


# The tables of docs/paper.md and the docstrings say what the scripts return.


@functools.cache
def told_lines() -> list[str]:
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    return text.split("\n## The figures\n")[1].split("\n## ")[0].splitlines()


def told_of_figures() -> str:
    return " ".join(" ".join(told_lines()).split())


def limits() -> str:
    plate = script("paper_plate")
    return f"put in; {plate.SUPPORTED.cutoff_hz():.0f} to {plate.HELD_FAST.cutoff_hz():.0f} Hz"


def levels(name: str) -> str:
    at = [f"{level_db(name, f_hz):.0f} dB" for f_hz in (300.0, 1000.0, 2000.0)]
    return f"{at[0]} at 300 Hz, {at[1]} at 1 kHz, {at[2]} at 2 kHz, mean {mean_db(name):.0f} dB"


def rows() -> list[tuple[str, str, str]]:
    """What, the paper's value, ours: the first three columns of the first table."""
    one, two, upright, flat = (centre_um(name) for name in (ONE_DISC, TWO_DISCS, UPRIGHT, FLAT))
    beside = (
        f"{level_db(SUPPORTED, 300):.0f} dB at 300 Hz, {level_db(SUPPORTED, 1000):.0f} dB at 1 kHz"
    )
    first_hz = f"{numbers(SUPPORTED).cutoff_hz:.0f} Hz"
    motor = f"put in; takes {force_n(clamped=False):.3f} N"
    return [
        ("cut-off on simple supports (fig. 1, 2)", "1.9 kHz", first_hz),
        ("cut-off of the first plate (fig. 4)", "2.9 kHz", limits()),
        ("cut-off of the second plate (fig. 8)", "2.5 kHz", limits()),
        ("level 20 mm along, W/6 off, simple supports (fig. 2)", "-", beside),
        ("level 20 mm from the disc's centre (fig. 4)", "about 30 dB", levels(DISC)),
        ("level 20 mm from a patch's centre (fig. 8)", "about 30 dB", levels(PATCH)),
        ("one disc, 300 Hz, 50 Vpp (fig. 5)", "1 um", f"{one:.2f} um"),
        ("two discs, 300 Hz, 100 Vpp (fig. 6)", "2.6 um", f"{two:.2f} um"),
        ("ratio of fig. 6 to fig. 5", "2.6", f"{two / one:.2f}"),
        ("patch 18 x 6 mm, 700 Hz, 100 Vpp (fig. 9)", "2.8 um", f"{upright:.2f} um"),
        ("patch 10 x 3 mm, 700 Hz, 100 Vpp (fig. 10)", "1.0 um", f"{flat:.2f} um"),
        ("ratio of fig. 9 to fig. 10", "2.8", f"{upright / flat:.2f}"),
        ("motor on 10 x 10 mm, 90 Hz (fig. 11)", "0.5 um", motor),
    ]


def test_table_of_the_paper_s_values_says_what_the_scripts_return() -> None:
    wanted = [f"| {what} | {paper} | {ours} |" for what, paper, ours in rows()]
    assert [row for row in wanted if row not in told_of_figures()] == []
    body = [line for line in told_lines() if line.startswith("|") and "---" not in line]
    headings, with_patches, their_ratio = 3, len(PEAKS) + len(MEANS), 1
    assert len(body) == (headings + len(wanted) + with_patches + their_ratio + len(distances_mm()))


def test_table_of_20_db_says_what_the_script_returns() -> None:
    wanted = [
        f"| {actuator} | {edge} | {from_centre_mm:.1f} mm | {from_rim_mm:.1f} mm |"
        for (actuator, edge), (from_centre_mm, from_rim_mm) in distances_mm().items()
    ]
    assert [row for row in wanted if row not in told_of_figures()] == []


def test_reasons_in_the_table_hold_the_right_numbers() -> None:
    plate = script("paper_plate")
    edges = [strip.edge.stiffness_n for strip in (plate.FIRST, plate.SECOND)]
    upright, flat = centre_um(UPRIGHT), centre_um(FLAT)
    plate_map = numbers(ONE_DISC).plate
    nearer, further = (20 * np.log10(plate_map.at(0) / plate_map.at(x)) for x in (0.018, 0.022))
    for told in (
        f"at 300 Hz it is {nearer:.0f} dB 2 mm nearer and {further:.0f} dB 2 mm further",
        f"K = {edges[0]:.0f} N by (18)",
        f"K = {edges[1]:.1f} N",
        f"between clamps it would take {force_n(clamped=True):.3f} N",
        f"too low by {2.8 / upright:.1f}: the moment",
        f"too low by {1.0 / flat:.1f}, for the same reason",
        f"free of the ceramic's data: {2.8 / (upright / flat):.1f} is",
    ):
        assert told in told_of_figures()


@pytest.mark.parametrize("name", SCRIPTS)
def test_docstring_tells_the_number(name: str) -> None:
    found, db = numbers(name), r"\d+ dB"
    told: dict[str, Callable[[], list[str]]] = {
        SHAPES: lambda: [f"{found.supported_hz[0]:.0f} Hz"],
        SUPPORTED: lambda: [f"{found.cutoff_hz:.0f} Hz", f"{level_db(name, 300):.0f} dB less"],
        MOTOR: lambda: [f"{found.force_n:.3f} N", f"{found.unbalance_kg_m * 1e6:.2f} g mm"],
        "section_5_twenty_decibels": lambda: [
            f"{found[1].from_centre_m * 1e3:.0f} mm from the centre of the disc",
            f"{found[1].from_rim_m * 1e3:.0f} mm beyond its rim",
        ],
    }
    told |= dict.fromkeys((DISC, PATCH), lambda: re.findall(db, levels(name)))
    told |= dict.fromkeys(
        (ONE_DISC, TWO_DISCS, UPRIGHT, FLAT), lambda: [f"{centre_um(name):.2f} um"]
    )
    number = " ".join(script(name).__doc__.split()).split("The number: ")[1]
    assert [text for text in told[name]() if text not in number] == []


# The picture of the README.


def test_front_page_shows_a_burst_that_stays_and_a_function_from_seldom_to_always() -> None:
    found = numbers("front_page")
    moved_um, along_mm = np.abs(found.moved_um), np.abs(found.x_mm - 1e3 * found.loads[0].x_m)
    assert moved_um[-1].max() < 0.01 * moved_um.max()  # the burst is over
    assert moved_um[:, along_mm > 40].max() < 0.02 * moved_um.max()
    assert found.level_db < -20


def test_front_page_is_told_with_its_numbers_where_it_cannot_be_seen() -> None:
    found = numbers("front_page")
    told = re.search(
        r"!\[([^]]+)\]\(docs/front_page.png\)", (ROOT / "README.md").read_text("utf-8")
    )
    assert told is not None
    (own_um, _), (first, *_, last) = found.shown_um, found.means
    least_um, *_, most_um = found.um_per_vpp[0] * found.levels_vpp
    for words in (
        f"by up to {own_um:.1f} µm",
        f"{-found.level_db:.0f} dB less",
        f"from {first:.2f} to {last:.2f} between {least_um:.1f} and {most_um:.1f} µm",
    ):
        assert words in told[1]


def test_front_page_is_what_its_script_draws(tmp_path: Path) -> None:
    drawn = tmp_path / "drawn.png"
    script("front_page").draw(numbers("front_page")).savefig(drawn, dpi=150)
    shown = ROOT / "docs" / "front_page.png"
    assert compare_images(str(shown), str(drawn), tol=2) is None
