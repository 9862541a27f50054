"""Bursts at several sites that begin one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from experiment import StudyError, first_study
from experiment.check.report import burst_text
from tests.test_experiment.lab import Lab

if TYPE_CHECKING:
    from pathlib import Path

    from experiment import Study

DESIGN = {"levels_vpp": [120.0], "trials_per_side": 2, "both_trials": 3}


def study_with(asynchrony_ms: float, **sections: object) -> Study:
    return first_study().changed(
        **{"burst": {"asynchrony_ms": asynchrony_ms}, "design": DESIGN} | sections
    )


@pytest.mark.parametrize("asynchrony_ms", [0.0, 12.5, 60.0])
def test_the_second_site_begins_later_where_both_are_driven(
    asynchrony_ms: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = Lab(study_with(asynchrony_ms), tmp_path, monkeypatch)
    assert lab.begin().finished
    for row, emission in zip(lab.rows, lab.device.emitted, strict=True):
        onsets = [
            np.flatnonzero(volts).min(initial=emission.volts.shape[1]) for volts in emission.volts
        ]
        if row.kind == "both":
            late_s = (onsets[1] - onsets[0]) / emission.sample_rate_hz
            assert late_s == pytest.approx(asynchrony_ms / 1e3, abs=0.5 / emission.sample_rate_hz)
            first, second = (
                volts[onset : onset + 90]
                for volts, onset in zip(emission.volts, onsets, strict=True)
            )
            assert np.array_equal(first, second)
        else:
            assert min(onsets) == 1  # a burst begins at zero


def test_conditions_may_differ_and_take_the_rest_from_the_burst() -> None:
    study = study_with(
        20.0,
        condition=[{"name": "a"}, {"name": "b", "asynchrony_ms": 0.0}, {"name": "c", "cycles": 2}],
    )
    assert [each.asynchrony_s for each in study.conditions] == [0.02, 0.0, 0.02]
    texts = [burst_text(each) for each in study.conditions]
    assert ["between onsets" in text for text in texts] == [True, False, True]


@pytest.mark.parametrize(
    ("asynchrony_ms", "sections", "named"),
    [
        (501.0, {}, "burst.asynchrony_ms"),
        (-1.0, {}, "burst.asynchrony_ms"),
        (20.0, {"task": {"kind": "2ifc"}, "design": {"levels_vpp": [120.0]}}, "one site at a time"),
        (
            20.0,
            {"monitor": {"source": "device", "tap": "amplifier"}, "device": {"driver": "serial"}},
            "simultaneous",
        ),
        (450.0, {"design": DESIGN | {"response_window_s": 0.4}}, "must be shorter"),
    ],
)
def test_an_asynchrony_that_cannot_be_is_refused(
    asynchrony_ms: float, sections: dict[str, object], named: str
) -> None:
    with pytest.raises(StudyError, match=named):
        study_with(asynchrony_ms, **sections)
