"""The figure of levels that a rule chose, trial by trial."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis import analyse, read_inputs
from analysis.results.figures.figures import FIGURES, drawings
from analysis.results.figures.tracks import plot_tracks, tracks_of
from experiment import first_study, simulate_study

if TYPE_CHECKING:
    from pathlib import Path

LEVELS = tuple(np.geomspace(40.0, 200.0, 8).round().tolist())


@pytest.mark.parametrize("kind", ["left-right-both", "2ifc"])
def test_every_chosen_level_is_drawn_with_its_answer(kind: str, tmp_path: Path) -> None:
    study = first_study().changed(
        task={"kind": kind},
        design={"levels_vpp": LEVELS, "trials_per_side": 12},
        simulation={"threshold_vpp": 90.0},
        levels={"rule": "staircase"},
    )
    folders = [*simulate_study(study, tmp_path, participants=2, seed=1, gains=())]
    analysis = analyse(read_inputs([tmp_path]))
    assert "tracks" in [picture.figure for picture in drawings(analysis)]
    figure = plot_tracks(analysis)
    figure.canvas.draw()
    titles = [axes.get_title("left") for axes in figure.axes]
    for folder in folders:
        axes = figure.axes[titles.index(folder.participant)]
        rows = folder.read_history(folder.read_plan()).rows
        single = [(order, row) for order, row in enumerate(rows, start=1) if row.kind == "single"]
        track, hits, misses = (line.get_xydata() for line in axes.lines[:3])
        assert np.allclose(track, [(order, row.level_vpp or 0.0) for order, row in single])
        detected = [study.task.is_detected(row.side, row.response or "") for _, row in single]
        assert np.allclose(hits, np.asarray(track)[detected])
        assert np.allclose(misses, np.asarray(track)[~np.array(detected)])


def test_constant_levels_have_no_tracks(tmp_path: Path) -> None:
    study = first_study().changed(simulation={"threshold_vpp": 90.0})
    assert [*simulate_study(study, tmp_path, participants=1, seed=1, gains=())]
    analysis = analyse(read_inputs([tmp_path]))
    assert len(tracks_of(analysis)) == 0
    assert [picture.figure for picture in drawings(analysis)] != [*FIGURES]
