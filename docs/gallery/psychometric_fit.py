"""A psychometric function in three lines, compared with psignifit
================================================================

Fit a table of counts in a notebook, and compare the threshold with that of `psignifit
<https://github.com/wichmann-lab/python-psignifit>`_. The counts are made up.

Usage: python docs/gallery/psychometric_fit.py [OUT.png]
"""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from paper_plate import save

# %%
# One row for each level: stimuli detected (k) and presented (n). The participant reported a
# vibration in 5 % of the trials without a stimulus, so the guess rate is 0.05.

frame = pd.DataFrame(
    {"level": [50, 63, 79, 100, 126, 158], "k": [4, 9, 21, 31, 38, 39], "n": [40] * 6}
)

# %%
# The three lines draw the counts, the function with its 95 % band, and the threshold with its
# 95 % interval:

import analysis

fit = analysis.fit(frame, level="level", detected="k", presented="n", guess_rate=0.05)
fit.plot()

save(plt.gcf(), "psychometric_fit.png")

# %%
# The fit prints itself as a table. ``low`` and ``high`` are the limits of the 95 % interval of the
# threshold.

print(fit)

# %%
# The threshold lies half-way between the guess rate and the upper asymptote. ``threshold_at``
# returns the level for any other proportion, with its interval:

print(fit.threshold_at(0.75).round(1).to_string(index=False))

# %%
# psignifit fits the same data: cumulative normal function, logarithmic levels, the same fixed guess
# rate. Its default model also estimates *eta*, the variance in excess of the binomial, which makes
# the interval wider. With eta fixed near 0, both programs assume binomial counts. Their priors of
# lapse rate and width differ.

try:
    from psignifit import psignifit
except ImportError:  # it is in the extra "bench"
    rows = [
        ("psignifit 4.3, eta near 0", (78.8, 72.6, 84.3)),
        ("psignifit 4.3, default", (78.7, 71.7, 84.9)),
    ]
else:
    from importlib.metadata import version

    data = np.column_stack([np.log10(frame["level"]), frame["k"], frame["n"]])
    rows = []
    for name, fixed in (("eta near 0", {"eta": 1e-8}), ("default", {})):
        result = psignifit(
            data, experiment_type="yes/no", sigmoid="norm", fixed_parameters={"gamma": 0.05} | fixed
        )
        estimate = result.get_parameter_estimate("mean")["threshold"]
        limits = result.confidence_intervals["threshold"]["0.95"]
        values = tuple(10**value for value in (estimate, *limits))
        rows.append((f"psignifit {version('psignifit')}, {name}", values))

person = fit.people.iloc[0]
rows.insert(0, ("tactstrip", tuple(person[["threshold", "low", "high"]])))
for name, (threshold, low, high) in rows:
    print(f"{name:<27}{threshold:6.1f} ({low:.1f} to {high:.1f})")
