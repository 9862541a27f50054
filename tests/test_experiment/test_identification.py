"""Identification at many sites: each burst on its own channel, rows by site, refusals."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis import ResultFileError, read_trials
from experiment import StudyError, first_study
from experiment.perception.answers import answer_probabilities
from experiment.perception.gains import without_crosstalk
from experiment.record.rows import columns_of
from experiment.tasks import make_task
from experiment.tasks.task import Guessing, Sensation
from tests.test_experiment.lab import Lab

if TYPE_CHECKING:
    from pathlib import Path

    from experiment import Study

LEVEL_VPP = 120.0


def study_at(*sites: str, kind: str = "identification", **design: object) -> Study:
    """Return a study with a small actuator at each site, 20 mm from the next."""
    actuators = [
        {"site": site, "x_mm": 20.0 * i - 10.0 * (len(sites) - 1), "diameter_mm": 8.0}
        | {"finger_diameter_mm": 8.0, "measured_displacement_um": 2.6}
        | {"measured_at_vpp": 100.0, "measured_at_hz": 200.0}
        for i, site in enumerate(sites)
    ]
    length_mm = 20.0 * len(sites) + 60.0
    plate = first_study().plate.changed(length_mm=length_mm)
    return first_study().changed(
        task={"kind": kind},
        strip=plate,
        device={"ceiling_vpp": 200.0},
        monitor={},
        actuator=actuators,
        design={"levels_vpp": [LEVEL_VPP], "trials_per_side": 2} | design,
    )


def names(number: int) -> tuple[str, ...]:
    return tuple(f"s{i + 1}" for i in range(number))


@pytest.mark.parametrize("number", [2, 5, 16])
def test_each_burst_is_on_the_channel_of_its_site(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = Lab(study_at(*names(number)), tmp_path, monkeypatch)
    assert lab.begin().finished
    emitted = list(lab.device.emitted)
    assert len(emitted) == len(lab.rows) == 2 * number
    for row, emission in zip(lab.rows, emitted, strict=True):
        index = names(number).index(row.side)
        peaks_v = np.abs(emission.volts).max(axis=1)
        assert peaks_v.shape == (number,)
        assert peaks_v[index] == pytest.approx(LEVEL_VPP / 2, rel=0.01)
        assert not np.delete(peaks_v, index).any()
        assert row.site_levels_vpp == tuple(LEVEL_VPP * (i == index) for i in range(number))
    heading = lab.folder.trials_path.read_text("utf-8").partition("\n")[0].split(",")
    assert heading == [column.name for column in columns_of(lab.plan.task)]
    assert lab.differences() == ()


def test_a_table_of_other_sites_is_read_only_next_to_its_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = Lab(study_at(*names(3)), tmp_path / "lab", monkeypatch)
    assert lab.begin().finished
    copy = tmp_path / "copy.csv"
    copy.write_bytes(lab.folder.trials_path.read_bytes())
    with pytest.raises(ResultFileError, match=r"only next to its plan\.json"):
        read_trials([copy])
    trials = read_trials([lab.folder.path])
    assert trials["level_s2_vpp"].max() == LEVEL_VPP


def test_sites_are_ordered_from_left_to_right_whatever_the_file_says() -> None:
    study = study_at("c", "a", "b")
    shuffled = study.changed(actuator=[each.model_dump() for each in study.actuators[::-1]])
    assert shuffled.task.sites == study.task.sites == ("c", "a", "b")


@pytest.mark.parametrize(
    ("sites", "keys", "named"),
    [
        (names(1), {}, "actuator: must have 2 to 16 sites"),
        (names(17), {}, "actuator: must have 2 to 16 sites"),
        (("a", "a"), {}, "distinct"),
        (("a", "pause"), {}, "name of another key"),
        (("a", "b c"), {}, r"actuator\[1\].site"),
        (names(3), {"both_trials": 2}, "design.both_trials: must be omitted"),
        (names(3), {"blank_trials": 2}, "design.blank_trials: must be omitted"),
        (names(3), {"kind": "left-right-both"}, r"actuator\[0\].site: must be one of left, right"),
    ],
)
def test_what_cannot_be_identified_is_refused(
    sites: tuple[str, ...], keys: dict[str, object], named: str
) -> None:
    with pytest.raises(StudyError, match=named) as refused:
        study_at(*sites, **keys)  # type: ignore[arg-type]
    assert str(refused.value).count("\n") == 0


@pytest.mark.parametrize("kind", ["yes-no", "2ifc", "3ifc"])
@pytest.mark.parametrize("number", [1, 3])
def test_detection_has_any_number_of_sites(kind: str, number: int) -> None:
    study = study_at(*names(number), kind=kind)
    assert study.task.sites == names(number)
    assert {p.site for p in study.task.of_kind("single")} == {*names(number)}


def test_the_strongest_detected_burst_is_answered() -> None:
    task = make_task("identification", sites=names(3))
    p, um = (0.5, 0.8, 0.25), (1.0, 3.0, 2.0)
    felt = Sensation([np.full((1, 1), v) for v in p], [np.full((1, 1), v) for v in um], [])
    decided = task.decide([felt], task.answer_names, Guessing(*np.array([[0.0], [0.5], [0.0]])))
    guess = 0.5 * 0.2 * 0.75 / 3
    expected = (0.5 * 0.2 * 0.75 + guess, 0.8 + guess, 0.25 * 0.2 + guess)
    assert [decided[name].item() for name in names(3)] == pytest.approx(expected)
    assert sum(expected) == pytest.approx(1.0)


def test_every_site_masks_and_is_masked() -> None:
    person = first_study().simulation.median
    gains = without_crosstalk(4)
    task = make_task("identification", sites=names(4))
    levels_vpp = [[200.0], [15.0], [0.0], [0.0]]
    people = [replace(person, threshold_um=None, threshold_vpp=10.0)]
    p = answer_probabilities(people, [levels_vpp], task.answer_names, 9.0, gains=gains, task=task)
    assert p[0, 0, 0] > 0.95  # 20 dB more at the first site than at the second
    assert p[0, 0].sum() == pytest.approx(1.0, abs=0.01)
