"""A threshold in micrometres is that in volts times the fingers' displacement per volt."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd
import pytest

from analysis import Axis
from analysis.thresholds.displacement import (
    with_group_micrometres,
    with_micrometres,
)


def trials(left: float, right: float, basis: Any = "measured", **columns: Any) -> pd.DataFrame:
    """Return a single stimulus on each side, of so many micrometres per volt."""
    table = {
        "participant": "1",
        "condition": "main",
        "kind": "single",
        "side": ["left", "right"],
        "level_vpp": [100.0, 50.0],
        "reason": "",
        "displacement_basis": basis,
        "peak_left_um": [100 * left, 0.01],
        "peak_right_um": [0.01, 50 * right],
    }
    return pd.DataFrame(table | columns)


def threshold(participant: str = "1", status: str = "ok") -> pd.DataFrame:
    table = {
        "participant": [participant],
        "condition": ["main"],
        "status": [status],
        "threshold_vpp": [60.0],
        "threshold_low_vpp": [50.0],
        "threshold_high_vpp": [72.0],
    }
    return pd.DataFrame(table)


EQUAL = trials(0.02, 0.02)
OTHER = trials(0.02, 0.02, participant="2")
NOTHING = [math.nan, math.nan, None]


@pytest.mark.parametrize(
    ("of", "status", "axis", "expected"),
    [
        (EQUAL, "ok", Axis(), [1.2, 1.2, "measured"]),
        (trials(0.02, 0.018), "ok", Axis(), [1.2, 1.08, "measured"]),
        (trials(0.02, 0.02, "predicted"), "ok", Axis(), [1.2, 1.2, "predicted"]),
        (trials(0.02, 0.02, ["measured", "predicted"]), "ok", Axis(), [1.2, 1.2, "predicted"]),
        # A plate that was measured again between sessions has no one number.
        (pd.concat([EQUAL, trials(0.03, 0.02)]), "ok", Axis(), [math.nan, 1.2, "measured"]),
        (trials(0.02, 0.02, [None, None]), "ok", Axis(), NOTHING),
        (trials(0.02, 0.02, reason="voided"), "ok", Axis(), NOTHING),
        (OTHER, "ok", Axis(), NOTHING),
        (trials(0.02, 0.02, kind="both"), "ok", Axis(), NOTHING),
        (EQUAL.drop(columns=["peak_left_um", "displacement_basis"]), "ok", Axis(), NOTHING),
        (EQUAL[:0], "ok", Axis(), NOTHING),
        (EQUAL, "threshold_above_levels", Axis(), NOTHING),
        (EQUAL, "ok", Axis(x_scale="linear", unit="mm"), NOTHING),
    ],
)
def test_a_threshold_has_the_micrometres_of_counted_single_stimuli(
    of: pd.DataFrame, status: str, axis: Axis, expected: list[Any]
) -> None:
    people = with_micrometres(threshold(status=status), of, axis)
    left, right, basis = people.iloc[0][
        ["threshold_left_um", "threshold_right_um", "displacement_basis"]
    ]
    assert [left, right] == pytest.approx(expected[:2], nan_ok=True)
    assert basis == expected[2] or (expected[2] is None and pd.isna(basis))


def test_a_group_has_micrometres_where_all_with_a_threshold_have_the_same() -> None:
    table = pd.concat([threshold("1"), threshold("2")], ignore_index=True)
    group = threshold().drop(columns="participant")
    other = trials(0.03, 0.03, participant="2")
    for of, expected in (
        (pd.concat([EQUAL, OTHER]), 1.2),
        (pd.concat([EQUAL, other]), None),
        (EQUAL, None),
    ):
        found = with_group_micrometres(group, with_micrometres(table, of, Axis()))
        value = float(found["threshold_left_um"].to_numpy()[0])
        assert math.isnan(value) if expected is None else value == pytest.approx(expected)
