"""Discrimination of amplitudes: the difference threshold, and levels relative to the reference.

The psychometric function is that of the comparison to be judged stronger than the reference. Its
median is the point of subjective equality. The difference threshold is half of the distance between
the levels at which the normal distribution is 1/4 and 3/4, lapses left out: 0.6745 sigma
(G. A. Gescheider, Psychophysics: The Fundamentals, 3rd ed., 1997, chapter 3).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import ndtri

from analysis.thresholds.fit import WITH_FUNCTION

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from analysis.thresholds.likelihood import Tables

    Floats = NDArray[np.float64]


DB_PER_LOG10: Final = 20.0
DB_PER_SIGMA: Final = DB_PER_LOG10 * float(ndtri(0.75))
"""The difference threshold in dB of a sigma of 1, which is in log10 units."""
DIFFERENCE_COLUMNS: Final = tuple(f"difference_threshold{end}_db" for end in ("", "_low", "_high"))


def with_difference_thresholds(
    thresholds: pd.DataFrame, people: Tables, reference_vpp: float
) -> pd.DataFrame:
    """Return thresholds of people in dB re the reference, with `DIFFERENCE_COLUMNS`.

    These are the posterior median and 95 % limits, NaN where a table does not determine a whole
    function.
    """
    steps = people.prior.step if len(people) else 1.0
    sigma = {
        name: steps * np.exp(likelihood.log_sigma_points[[1, 0, 2]])
        for name, likelihood in zip(people.names, people.likelihoods, strict=True)
    }
    names = zip(thresholds["condition"], thresholds["participant"], strict=True)
    widths = np.array([sigma[name] for name in names]).reshape(-1, len(DIFFERENCE_COLUMNS))
    widths[~thresholds["status"].isin(WITH_FUNCTION).to_numpy()] = math.nan
    return _with_columns(thresholds, widths, reference_vpp)


def with_group_difference_thresholds(groups: pd.DataFrame, reference_vpp: float) -> pd.DataFrame:
    """Return thresholds of groups in dB re the reference, with `DIFFERENCE_COLUMNS`.

    They are those of the median width of the people's functions.
    """
    widths = groups[["sigma", "sigma_low", "sigma_high"]].to_numpy(dtype=np.float64)
    return _with_columns(groups, widths, reference_vpp)


def _with_columns(table: pd.DataFrame, widths: Floats, reference_vpp: float) -> pd.DataFrame:
    reference_db = DB_PER_LOG10 * math.log10(reference_vpp)
    columns = dict(zip(DIFFERENCE_COLUMNS, DB_PER_SIGMA * np.transpose(widths), strict=True))
    relative = {
        name: table[name] - reference_db
        for name in ("threshold_db", "threshold_low_db", "threshold_high_db")
    }
    return table.assign(**relative, reference_vpp=reference_vpp, **columns)
