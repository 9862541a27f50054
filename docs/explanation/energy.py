"""Draw energy.png and compute every number of energy.md: a burst above the plate's cut-off.

The paper's plate with its two free ends and a loss factor of 0.01, its two discs, and fingertips of
10 mm; the stimulus is the paper's burst, one cycle of 500 Hz without a window.

Usage: python docs/explanation/energy.py [OUT.png]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from experiment.study.files import paper_study
from experiment.study.physics import field_strip, fingertips_of, loads_of
from stimuli import (
    Burst,
    SampledDrive,
    Scene,
    causal,
    check_burst,
    displacement,
    felt,
    level_db,
    transient,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from stimuli import Drive, Strip

STUDY = paper_study()
PAPER = Burst(frequency_hz=500.0, cycles=1, window="none")
BURSTS = (
    PAPER,
    replace(PAPER, cycles=2),
    replace(PAPER, window="tukey"),
    replace(PAPER, window="hann"),
    replace(PAPER, window="hann", cycles=2),
)
SLOW_HZ, FAST_HZ = 8000.0, 48_000.0
STEP_HZ = 4.0
STEPS_SPAN_S, STEPS_LOOK_S = 0.05, 5e-6
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#7F7F7F"


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A burst: what its spectrum says, and the level at the other finger that follows."""

    burst: Burst
    energy: float
    level_db: float
    steps_energy: float
    steps_level_db: float
    fine_steps_level_db: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """Displacement at the centres of the own and of the other finger over time, per unit load."""

    time_s: NDArray[np.float64]
    whole_m: NDArray[np.float64]  # shape (2, n_times)
    below_m: NDArray[np.float64]  # ... of the frequencies below the cut-off alone

    @property
    def whole_db(self) -> float:
        """Peak at the other finger re that at the own one."""
        return self._level_db(self.whole_m)

    @property
    def below_db(self) -> float:
        """The same with nothing above the cut-off."""
        return self._level_db(self.below_m)

    def _level_db(self, moved_m: NDArray[np.float64]) -> float:
        return float(20 * np.log10(np.abs(moved_m[1]).max() / np.abs(self.whole_m[0]).max()))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Numbers:
    """All that the page tells."""

    cutoff_hz: float
    rows: tuple[Row, ...]
    motion: Motion
    tone_db: float  # a steady sine of the burst's frequency
    higher: Row  # one cycle of 1200 Hz
    higher_db: float  # ... with the loss factor of 0.005, as the check says it
    endless_db: float
    at_losses_db: tuple[float, float]  # loss factors of 0.005 and 0.02


def plate(loss_factor: float = 0.01) -> Strip:
    """Return the paper's plate with its free ends."""
    return field_strip(STUDY, loss_factor)


def level_on(strip: Strip, drive: Drive) -> float:
    """Return the peak over the other fingertip re that over the own one, in dB."""
    return level_db(felt(strip, loads_of(STUDY), fingertips_of(STUDY), drive), 0, 1)


def steps_level_on(strip: Strip, steps: SampledDrive) -> float:
    """Return the same for coarse steps, whose jumps leave a peak too uncertain for `felt`."""
    strip = causal(strip, steps)
    areas_m = [tip.points_m(strip) for tip in fingertips_of(STUDY)]
    scene = Scene(strip=strip, loads=loads_of(STUDY)[:1], points_m=(*areas_m[0], *areas_m[1]))
    moved_m = np.abs(transient(scene, steps, np.arange(0.0, STEPS_SPAN_S, STEPS_LOOK_S))[:, 0])
    own_m, other_m = np.split(moved_m.max(axis=0), [len(areas_m[0])])
    return float(20 * np.log10(other_m.max() / own_m.max()))


def numbers() -> Numbers:
    """Compute all of them."""
    motion, tone_db = _motion()
    higher = replace(PAPER, frequency_hz=1200.0)
    return Numbers(
        cutoff_hz=plate().cutoff_hz(),
        rows=tuple(_row(burst) for burst in BURSTS),
        motion=motion,
        tone_db=tone_db,
        higher=_row(higher),
        higher_db=level_on(plate(0.005), higher),
        endless_db=level_on(replace(plate(), length_m=None), PAPER),
        at_losses_db=(level_on(plate(0.005), PAPER), level_on(plate(0.02), PAPER)),
    )


def _row(burst: Burst) -> Row:
    found = check_burst(burst, plate(), sample_rate_hz=SLOW_HZ)
    steps, fine_steps = (
        SampledDrive(samples=burst.samples(rate_hz), sample_rate_hz=rate_hz, held=True)
        for rate_hz in (SLOW_HZ, FAST_HZ)
    )
    return Row(
        burst=burst,
        energy=found.energy_above_cutoff,
        level_db=level_on(plate(), burst),
        steps_energy=found.staircase_energy_above_cutoff,
        steps_level_db=steps_level_on(plate(), steps),
        fine_steps_level_db=level_on(plate(), fine_steps),
    )


def _motion() -> tuple[Motion, float]:
    own, _ = loads_of(STUDY)
    points_m = tuple((tip.x_m, tip.y_m) for tip in fingertips_of(STUDY))
    scene = Scene(strip=causal(plate(), PAPER), loads=(own,), points_m=points_m)
    frequencies_hz = np.arange(STEP_HZ / 2, plate().cutoff_hz(), STEP_HZ)
    below = displacement(scene, frequencies_hz)[:, 0].T * PAPER.spectrum(frequencies_hz)
    time_s = np.linspace(0.0, 0.012, 1201)
    phases = np.exp(-2j * np.pi * np.outer(frequencies_hz, time_s))
    tone = displacement(scene, [PAPER.frequency_hz])[0, 0]
    motion = Motion(
        time_s=time_s,
        whole_m=transient(scene, PAPER, time_s)[:, 0].T,
        below_m=2 * STEP_HZ * (below @ phases).real,
    )
    return motion, float(20 * np.log10(abs(tone[1] / tone[0])))


def draw(found: Numbers) -> Figure:
    """Draw the spectrum against the cut-off, and the motion that follows at both fingers."""
    figure = Figure(figsize=(5.2, 7.4), layout="constrained")
    spectrum, own, other = figure.subplots(3, 1, height_ratios=(1.5, 1, 1))
    _draw_spectrum(spectrum, found)
    motion, peak_m = found.motion, np.abs(found.motion.whole_m[0]).max()
    for axes, place, title in (
        (own, 0, "At the own finger"),
        (other, 1, "At the other finger, 70 mm away"),
    ):
        for moved_m, colour, line, label in (
            (motion.whole_m, BLUE, "-", "the burst"),
            (motion.below_m, ORANGE, "--", "without what lies above the cut-off"),
        ):
            axes.plot(
                motion.time_s * 1e3,
                100 * moved_m[place] / peak_m,
                line,
                color=colour,
                linewidth=1.6,
                label=label,
            )
        axes.set(title=title, ylabel="% of own peak", xlim=(0, 12))
        _tidy(axes)
    own.legend(frameon=False, loc="lower right")
    other.set(xlabel="Time (ms)", ylim=(-8, 8))
    figure.align_ylabels((spectrum, own, other))
    return figure


def _draw_spectrum(axes: Axes, found: Numbers) -> None:
    frequencies_hz = np.linspace(1.0, 6000.0, 3000)
    khz, floor_db = frequencies_hz / 1e3, -70.0
    peak, *size = np.abs(PAPER.spectrum(np.array([PAPER.peak_hz(), *frequencies_hz])))
    spectrum_db = 20 * np.log10(np.maximum(np.array(size) / peak, 10 ** (floor_db / 20)))
    low_hz, high_hz = PAPER.band_hz()
    for within, colour, label in (
        (
            (frequencies_hz >= low_hz) & (frequencies_hz <= high_hz),
            BLUE,
            "half-power band",
        ),
        (
            frequencies_hz >= found.cutoff_hz,
            ORANGE,
            f"above cut-off: {100 * found.rows[0].energy:.2g} % of energy",
        ),
    ):
        axes.fill_between(
            khz, floor_db, spectrum_db, where=within.tolist(), color=colour, alpha=0.45, label=label
        )
    axes.plot(khz, spectrum_db, color="#333333", linewidth=1.4)
    axes.axvline(found.cutoff_hz / 1e3, color=GREY, linewidth=1.2)
    axes.annotate(
        f"cut-off {found.cutoff_hz:.0f} Hz",
        (found.cutoff_hz / 1e3, -30),
        xytext=(4, 0),
        textcoords="offset points",
    )
    axes.set(
        title="One cycle of 500 Hz, no window",
        xlabel="Frequency (kHz)",
        ylabel="Spectrum (dB)",
        xlim=(0, 6),
        ylim=(floor_db, 3),
    )
    axes.legend(framealpha=1, edgecolor="none", loc="upper right")
    _tidy(axes)


def _tidy(axes: Axes) -> None:
    axes.grid(color="#E5E5E5")
    axes.spines[["top", "right"]].set_visible(False)


def main() -> None:
    """Compute, draw and save."""
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "energy.png")
    draw(numbers()).savefig(path, dpi=150)
    sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
