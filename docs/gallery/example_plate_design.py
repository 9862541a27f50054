"""A plate designed: its width, and a burst for it
===============================================

Choose the width of a steel strip from its cut-off frequency, and compare bursts on it.

Usage: python docs/gallery/example_plate_design.py [OUT.png]
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from paper_plate import save

from stimuli import (
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    Burst,
    Fingertip,
    MomentDisc,
    Strip,
    check_burst,
    felt,
    level_db,
)

# %%
# The cut-off frequency falls with the square of the width. A real edge lies between the two ideal
# ones. At 30 mm, both stay well above the band of a burst of 500 Hz.

STEEL = MATERIALS["steel"].material
widths_m = np.linspace(0.015, 0.06, 60)
figure, axes = plt.subplots(figsize=(5, 3.4), layout="constrained")
for edge, name in ((CLAMPED, "clamped"), (SIMPLY_SUPPORTED, "simply supported")):
    strips = [
        Strip(width_m=width_m, thickness_m=0.0005, material=STEEL, edge=edge)
        for width_m in widths_m
    ]
    axes.plot(widths_m * 1e3, [strip.cutoff_hz() for strip in strips], label=name)
axes.axvline(30, color="grey", lw=0.8)
axes.set(xlabel="Width (mm)", ylabel="Cut-off frequency (Hz)", yscale="log")
axes.legend()
save(figure, "plate_design.png")

# %%
# Two discs lie 70 mm apart on a plate of 150 mm with free ends. For each burst, print the share of
# its energy above the cut-off frequency, and the crosstalk at the undriven finger. A window
# lowers both. The loss factor is assumed.

plate = Strip(
    width_m=0.03,
    thickness_m=0.0005,
    length_m=0.15,
    material=replace(STEEL, loss_factor=0.01),
    edge=CLAMPED,
)
places_m = (-0.035, 0.035)
discs = [MomentDisc(x_m=x_m, y_m=0.015, radius_m=0.0064) for x_m in places_m]
fingers = [Fingertip(x_m=x_m, y_m=0.015) for x_m in places_m]
for burst in (
    Burst(frequency_hz=500, cycles=1, window="none"),
    Burst(frequency_hz=500, cycles=1, window="hann"),
    Burst(frequency_hz=250, cycles=2, window="hann"),
):
    energy = check_burst(burst, plate).energy_above_cutoff
    crosstalk_db = level_db(felt(plate, discs, fingers, burst), own=0, other=1)
    name = f"{burst.cycles} x {burst.frequency_hz:g} Hz, {burst.window}"
    print(f"{name:20} {energy:.1e} {crosstalk_db:6.1f} dB")
