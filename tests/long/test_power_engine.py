"""Counts drawn at once are distributed as those of sessions through the engine and the files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import chi2

from analysis import read_trials
from experiment import simulate_study
from tests.test_analysis.planning import drawn_counts, study_of

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

DESIGN = """
levels_vpp = [50.0, 65.0, 90.0]
trials_per_side = 24
both_trials = 6
blank_trials = 24
responses = ["left", "right", "both", "none"]
response_window_s = 1.2
order = "{}"
break_every = 0
"""
PEOPLE = """
threshold_sd_db = 3.0
sigma = 0.12
lapse_rate = 0.05
false_alarm_rate = 0.2
side_bias = 0.6
guess_both = 0.1
finger_difference_sd_db = 1.0
difference_db = 2.0
difference_sd_db = 1.0
sigma_spread = 0.3
{}
[[condition]]
name = "a"
[[condition]]
name = "b"
"""
COURSE = "drift_db = 4.0\nwander_db = 1.4\nwander_trials = 11.0\nlast_answer_db = 2.0"
ELSEWHERE = "threshold_vpp = 3.0\nthreshold_at_hz = 250\nthreshold_at_s = 0.2"


def moments(rows: Floats) -> tuple[Floats, Floats]:
    """Return the mean of rows of counts and its covariance."""
    return rows.mean(axis=0), np.cov(rows.T) / len(rows)


@pytest.mark.parametrize(
    ("order", "more"), [("balanced", ""), ("random", COURSE), ("balanced", ELSEWHERE)]
)
def test_counts_are_those_of_the_engine(order: str, more: str, tmp_path: Path) -> None:
    study, number = study_of(DESIGN.format(order), PEOPLE.format(more)), 150
    gains, drawn = drawn_counts(study, 4 * number)
    for _ in simulate_study(study, tmp_path, participants=number, seed=5, gains=gains):
        pass
    trials = read_trials([tmp_path])
    single = trials[trials["kind"].eq("single")]
    hit = single["response"].astype(str).eq(single["side"].astype(str))
    table = single.assign(hit=hit).groupby(["participant", "condition", "level_vpp"])["hit"].sum()
    detected = table.unstack(["condition", "level_vpp"], fill_value=0).sort_index(axis=1)
    blank = trials[trials["kind"].eq("blank")]
    false = blank["response"].isin(["left", "right", "both"])
    alarms = false.groupby([blank["participant"], blank["condition"]]).sum().unstack()
    through = np.hstack([detected.to_numpy(), alarms.to_numpy()])
    # means, and the spread between people, which drifts and dependent answers widen
    spreads = [(counts - counts.mean(axis=0)) ** 2 for counts in (through, drawn)]
    for pair in ((through, drawn), spreads):
        (mean, of_mean), (other, of_other) = (moments(rows) for rows in pair)
        statistic = float((mean - other) @ np.linalg.solve(of_mean + of_other, mean - other))
        assert chi2.sf(statistic, len(mean)) > 0.001
