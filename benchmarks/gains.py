"""Processor time of a study's gain matrix, and of `tactstrip check`, over plates of every kind."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from tests.plates import on_paper_plate

REPEATS: Final = 2
IMPORTS: Final = "import numpy, pydantic, scipy.linalg, scipy.special"
MATRIX: Final = """
import sys, time
from pathlib import Path
from experiment.study.files import read_study
from experiment.study.physics import study_gains
import scipy.linalg, scipy.special
study = read_study(Path(sys.argv[1]))
began_s = time.process_time()
study_gains(study)
print(time.process_time() - began_s)
"""
DRY_RUN: Final = """
import sys, tempfile
from pathlib import Path
import analysis.commands.dry_run
from experiment.check.check import check_study
from experiment.session.simulate import simulate_study
from experiment.study.files import read_study
from tests.plates import on_paper_plate
study = read_study(Path(sys.argv[1]))
gains = check_study(study).gains
with tempfile.TemporaryDirectory() as folder:
    for _ in simulate_study(study, Path(folder), participants=5, seed=7, gains=gains):
        pass
"""


def _actuator(
    site: str | None, x_mm: float, *lines: str, diameter_mm: float = 12.8, y_mm: float | None = None
) -> str:
    across = [] if y_mm is None else [f"y_mm = {y_mm}"]
    measured = [
        "measured_displacement_um = 2.6",
        "measured_at_vpp = 100",
        "measured_at_hz = 100",
    ]
    return "\n".join(
        [
            "[[actuator]]",
            *([] if site is None else [f'site = "{site}"']),
            f"x_mm = {x_mm}",
            f"diameter_mm = {diameter_mm}",
            *across,
            *measured,
            *lines,
            "",
        ]
    )


def _study(
    strip: str = "",
    places_mm: tuple[float, float] = (-35, 35),
    *lines: str,
    rest: str = "",
    **sizes: float,
) -> str:
    """Return a study of two actuators on a plate, of the paper's where nothing else is told."""
    keys = "\n".join(f"{key.strip()}" for key in strip.split(";") if key)
    sides = "".join(
        _actuator(side, x_mm, *lines, **sizes)
        for side, x_mm in zip(("left", "right"), places_mm, strict=True)
    )
    return on_paper_plate(f"[strip]\n{keys}\n{sides}{rest}")


COUNTS: Final = (
    "patch_counts = true",
    "piezo_thickness_mm = 0.11",
    "piezo_youngs_modulus_gpa = 63",
    "piezo_poisson_ratio = 0.31",
    "piezo_density_kg_m3 = 7800",
    "carrier_thickness_mm = 0.1",
    "carrier_youngs_modulus_gpa = 105",
    "carrier_poisson_ratio = 0.35",
    "carrier_density_kg_m3 = 8530",
)
FINGERS: Final = (
    "[finger_load]\nmass_g = 0.2\nstiffness_n_m = 500\ndamping_n_s_m = 1\n"
    'holds_up_to_hz = 1000\nsource = "an example"\n'
)
OTHERS: Final = "".join(
    _actuator(None, x_mm, f'name = "at{x_mm}"', diameter_mm=10) for x_mm in (-70, 0, 70)
)
BARE: Final = "simply-supported"


def _plate(width_mm: float, thickness_mm: float, length_mm: float, edge: str, material: str) -> str:
    return (
        f"width_mm = {width_mm};thickness_mm = {thickness_mm};length_mm = {length_mm};"
        f'edge = "{edge}";material = "{material}"'
    )


LONG_3: Final = "length_mm = 3000;measured_cutoff_hz = 2900"
STUDIES: Final = {
    "the paper's plate": _study(),
    "... endless": _study('length_mm = "endless"'),
    "... fingers rest on it": _study(rest=FINGERS),
    "... its patches count": _study("", (-35, 35), *COUNTS),
    "... patches and fingers": _study("", (-35, 35), *COUNTS, rest=FINGERS),
    "... 3 m long, one end near": _study(LONG_3, (1400, 1470)),
    "... 3 m long, fingers": _study(LONG_3, rest=FINGERS),
    "... four more actuators": _study(rest=OTHERS),
    "... 2 mm off the centre line, fingers": _study(y_mm=10.5, rest=FINGERS),
    "... off the centre line, patches": _study("", (-35, 35), *COUNTS, y_mm=10.5),
    "clamped aluminium, 25 x 0.5 x 200 mm": _study(_plate(25, 0.5, 200, "clamped", "aluminium")),
    "simply supported steel, 20 x 0.3 x 160 mm": _study(_plate(20, 0.3, 160, BARE, "steel")),
    "clamped glass, 30 x 0.7 x 150 mm": _study(_plate(30, 0.7, 150, "clamped", "glass")),
    "clamped, 2 x 0.1 x 200 mm": _study(
        _plate(2, 0.1, 200, "clamped", "aluminium"), diameter_mm=1.5
    ),
    "clamped, 2 x 0.5 x 200 mm": _study(_plate(2, 0.5, 200, "clamped", "aluminium"), diameter_mm=1),
    "clamped, 5 x 0.5 x 200 mm": _study(_plate(5, 0.5, 200, "clamped", "aluminium"), diameter_mm=4),
    "clamped, 100 x 2 x 1000 mm": _study(_plate(100, 2, 1000, "clamped", "aluminium")),
}


def _processor_s(*command: str) -> float:
    """Return the processor time of a new process."""
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        command, env=one_thread, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):  # 1: the stimulus is unfit
        raise RuntimeError(f"{command} ended with {process.returncode}")
    return used.ru_utime + used.ru_stime


def _matrix_s(path: Path) -> float:
    one_thread = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", MATRIX, str(path)]
    done = subprocess.run(command, env=one_thread, check=True, capture_output=True, text=True)
    return float(done.stdout)


def measured(
    text: str, *, repeats: int = REPEATS, with_dry_run: bool = True
) -> tuple[float, float, float]:
    """Return processor times of a study's gain matrix, and beyond imports of check and dry run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.toml"
        path.write_text(text, encoding="utf-8")
        matrix_s = min(_matrix_s(path) for _ in range(repeats))
        bare_s, check_s, dry_s = (
            min(_processor_s(sys.executable, *command) for _ in range(repeats))
            for command in (
                ("-c", IMPORTS),
                ("-c", "from tactstrip import main; main()", "check", str(path)),
                ("-c", DRY_RUN if with_dry_run else IMPORTS, str(path)),
            )
        )
    return matrix_s, check_s - bare_s, dry_s - bare_s


MATERIALS: Final = ("steel", "aluminium", "glass", "brass", "pmma", "titanium")
LAYERS: Final = (
    "patch_counts = true",
    "piezo_thickness_mm = 0.25",
    "piezo_youngs_modulus_gpa = 62",
    "piezo_poisson_ratio = 0.31",
    "piezo_density_kg_m3 = 7800",
)


def drawn(rng: np.random.Generator) -> tuple[str, bool]:
    """Return a study of a random plate, and whether its patches count."""
    width_mm, off = float(rng.choice([18, 22, 25, 30, 40])), rng.random() < HALF
    length_mm = rng.choice([130, 180, 300, 600, 900, 1500, 2500]) * rng.uniform(0.9, 1.1)
    plate = _plate(
        width_mm,
        float(rng.choice([0.3, 0.4, 0.5, 0.8, 1.0])),
        round(float(length_mm)),
        str(rng.choice(["simply-supported", "clamped"])),
        str(rng.choice(MATERIALS)),
    )
    if rng.random() < STATED:
        plate += f";loss_factor = {rng.choice([0.001, 0.003, 0.01, 0.03])}"
    patched, pressed = rng.random() < PATCHED, rng.random() < HALF
    sides = "".join(
        _actuator(
            side,
            sign * round(float(rng.uniform(25, 50))),
            "finger_diameter_mm = 6",
            *(LAYERS if patched else ()),
            diameter_mm=min(12, width_mm / 2),
            y_mm=round(width_mm * float(rng.uniform(0.4, 0.6)), 1) if off else None,
        )
        for side, sign in (("left", -1), ("right", 1))
    )
    burst = (
        f"[burst]\nfrequency_hz = {rng.choice([150, 250, 500])}\n"
        f'cycles = {rng.choice([1, 2])}\nwindow = "{rng.choice(["none", "hann", "tukey"])}"\n'
    )
    keys = plate.replace(";", "\n")
    text = f"[strip]\n{keys}\n{sides}{burst}{FINGERS if pressed else ''}"
    return on_paper_plate(text), patched


HALF, STATED, PATCHED = 0.5, 0.7, 0.4
N_DRAWN: Final = 40


def distribution() -> list[str]:
    """Return rows of a table: how long random plates take; those that are refused left out."""
    rng = np.random.default_rng(12)
    taken: dict[str, list[tuple[float, float]]] = {"patches count": [], "they do not": []}
    for _ in range(N_DRAWN):
        text, patched = drawn(rng)
        try:
            matrix_s, check_s, _ = measured(text, repeats=1, with_dry_run=False)
        except (RuntimeError, subprocess.CalledProcessError):  # too many modes for patches
            continue
        taken["patches count" if patched else "they do not"].append((matrix_s, check_s))
        print(f"{patched} {matrix_s:.3f} {check_s:.3f}", file=sys.stderr, flush=True)
    rows = []
    for name, some in taken.items():
        told = [f"{name} ({len(some)})"]
        for seconds in np.array(some).T:
            shown = (np.median(seconds), np.quantile(seconds, 0.9), np.max(seconds))
            told.append(", ".join(f"{1e3 * float(one):.0f}" for one in shown))
        rows.append(f"| {' | '.join(told)} |")
    return rows


def section() -> str:
    """Measure and return the section of docs/benchmarks/results.md."""
    lines = [
        "## Gain matrix and check",
        "",
        "Least processor time of two new processes, one thread: of a study's gain matrix without",
        f"its imports, and beyond `{IMPORTS}` of `tactstrip check` and of what `dry-run` does with",
        "five participants before its analysis, in ms.",
        "",
        "| plate | gain matrix | check | dry run |",
        "|---|---|---|---|",
    ]
    for name, text in STUDIES.items():
        matrix, check, dry = (f"{1e3 * one_s:.0f}" for one_s in measured(text))
        lines.append(f"| {name} | {matrix} | {check} | {dry} |")
        print(lines[-1], file=sys.stderr, flush=True)
    lines += [
        "",
        f"{N_DRAWN} random plates (18 to 40 mm wide, 0.12 to 2.7 m long, six materials, clamped or",
        "simply supported, half with actuators off the centre line, half with fingers; those with",
        "too many modes for their patches, which are refused, left out): median, 90 %, worst.",
        "",
        "| | gain matrix | check |",
        "|---|---|---|",
        *distribution(),
    ]
    return "\n".join([*lines, ""])
