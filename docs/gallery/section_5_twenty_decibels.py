"""Section V: how far from an actuator the vibration is 20 dB weaker
=================================================================

The paper says that 1 cm is enough for the 20 dB at which masking sets in, and gives neither patch
nor edge nor where one counts from. Ours follows the centre line at 500 Hz, for the disc and the
patch of 18 x 6 mm, on three edges: simple supports, the elastic edge with the measured cut-off of
2.9 kHz, and clamps (endless plate, no loss). The distance is where the level falls 20 dB below that
of the actuator's centre for good.

The number: on the measured edge 15 mm from the centre of the disc, which is 9 mm beyond its rim.
One centimetre is enough beyond the rim there and between clamps, but not on simple supports, and
from the centre only for the patch between clamps.

Usage: python docs/gallery/section_5_twenty_decibels.py [OUT.png]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from paper_plate import DISC, FIRST, HELD_FAST, MIDDLE_M, SUPPORTED, UPRIGHT_PATCH, save

from stimuli import Load, Scene, Strip, displacement

if TYPE_CHECKING:
    from numpy.typing import NDArray

FREQUENCY_HZ = 500.0
EDGES = (("simple supports", SUPPORTED), ("2.9 kHz edge", FIRST), ("clamps", HELD_FAST))
ACTUATORS = (("disc, 12.8 mm", DISC), ("patch, 18 x 6 mm", UPRIGHT_PATCH))
MASKED_DB = 20.0
LOOKS = (("#0072B2", "-"), ("#E69F00", "--"), ("#009E73", ":"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Decay:
    """The level along the centre line, relative to the actuator's centre."""

    actuator: str
    edge: str
    rim_m: float
    x_m: NDArray[np.float64]
    level_db: NDArray[np.float64]

    @property
    def from_centre_m(self) -> float:
        """Distance from the centre beyond which the level stays below -20 dB."""
        last = int(np.flatnonzero(self.level_db >= -MASKED_DB)[-1])
        return float(
            np.interp(MASKED_DB, -self.level_db[last : last + 2], self.x_m[last : last + 2])
        )

    @property
    def from_rim_m(self) -> float:
        """The same from the actuator's rim."""
        return self.from_centre_m - self.rim_m


def numbers() -> tuple[Decay, ...]:
    """Compute every actuator on every edge."""
    return tuple(
        _decay(actuator, load, edge, strip) for actuator, load in ACTUATORS for edge, strip in EDGES
    )


def _decay(actuator: str, load: Load, edge: str, strip: Strip) -> Decay:
    x_m = np.linspace(0.0, 0.04, 401)
    scene = Scene(strip=strip, loads=(load,), points_m=tuple((float(x), MIDDLE_M) for x in x_m))
    along_m = np.abs(displacement(scene, [FREQUENCY_HZ])[0, 0])
    level_db = 20 * np.log10(along_m / along_m[0])
    return Decay(
        actuator=actuator, edge=edge, rim_m=load.half_size_m[0], x_m=x_m, level_db=level_db
    )


def draw(found: tuple[Decay, ...]) -> Figure:
    """Draw one panel per actuator."""
    figure = Figure(figsize=(8.0, 3.8), layout="constrained")
    panels = figure.subplots(1, len(ACTUATORS), sharey=True)
    for panel, (actuator, load) in zip(panels, ACTUATORS, strict=True):
        decays = [decay for decay in found if decay.actuator == actuator]
        for decay, (colour, line) in zip(decays, LOOKS, strict=True):
            label = f"{decay.edge}: {decay.from_centre_m * 1e3:.0f} mm"
            panel.plot(decay.x_m * 1e3, decay.level_db, line, color=colour, label=label)
        panel.axhline(-MASKED_DB, color="#7F7F7F", linewidth=1)
        panel.axvspan(0, load.half_size_m[0] * 1e3, color="#EEEEEE")
        panel.set(xlabel="Distance from the centre (mm)", title=actuator, xlim=(0, 40))
        panel.set_ylim(-60, 26)
        panel.legend(title="20 dB lower from", loc="upper right", frameon=False)
        panel.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("Level re centre of the actuator (dB)")
    return figure


def main() -> None:
    """Compute, draw and save."""
    save(draw(numbers()), "section_5.png")


if __name__ == "__main__":
    main()
