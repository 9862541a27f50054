"""A study simulated, from the plan to the group threshold
=======================================================

Simulate the sessions of a small study, and analyze them as real ones. A dry run does the same.

Usage: python docs/gallery/example_study_simulation.py [OUT.png]
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from paper_plate import save

from analysis import analyse, plot_detection, read_inputs
from experiment import paper_study, simulate_study

# %%
# The study of the paper, with fewer trials and other levels. Participants have thresholds around
# 62 V that differ by 1.5 dB.

study = paper_study().changed(
    design={"levels_vpp": [30.0, 45.0, 67.0, 100.0, 150.0], "trials_per_side": 25},
    simulation={"threshold_vpp": 62.0, "threshold_sd_db": 1.5},
)

# %%
# Each session writes its plan, journal and table into the folder, like a session with a device.

with TemporaryDirectory() as folder:
    sessions = list(simulate_study(study, Path(folder), participants=4, seed=7))
    result = analyse(read_inputs([folder]), allow_simulated=True)

# %%
# The figure shows the participants, the function of the group with its 95 % band, and the
# threshold.

figure = plot_detection(result)
save(figure, "study_simulation.png")
print(f"{len(sessions)} sessions, {result.counts.trials} trials")
