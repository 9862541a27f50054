"""The maps of docs/examples for published data: they read what those tables look like.

The rows are a few of each table, named in its map; the data sets themselves stay where they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from analysis import load_column_map
from analysis.answers.detection import blank_table, level_table
from analysis.reading.load import read_inputs
from tests.test_analysis.shared import EXAMPLES, loaded, put

if TYPE_CHECKING:
    from pathlib import Path

    from analysis.reading.load import LoadedTrials

GRUND = "ID,block,trial,stim_type,stim_step,intensity,resp1,resp1_t,resp1_btn\n"


def read(folder: Path, name: str, text: str) -> LoadedTrials:
    return loaded(folder, text, load_column_map(EXAMPLES / f"{name}-columns.toml"))


def test_an_unanswered_trial_of_grund_2022_is_no_no(tmp_path: Path) -> None:
    rows = ("1,1,1,1,1.0,2.6,0,0.6899,2", "1,1,2,1,1.0,2.6,1,0.37,1", "1,2,1,1,1.0,2.6,0,1.5,0",
            "1,2,2,0,0.0,2.6,1,0.5,1", "1,2,3,0,0.0,2.6,0,1.5,-1")  # fmt: skip
    trials = read(tmp_path, "grund2022", GRUND + "\n".join(rows) + "\n").trials
    assert trials["response"].tolist() == ["none", "left", "timeout", "left", "timeout"]
    assert trials["rt_s"].isna().tolist() == [False, False, True, False, True]
    level = level_table(trials).iloc[0]
    assert level[["level_vpp", "detected", "presented", "timeouts"]].tolist() == [1, 1, 3, 1]
    assert level["p_answered"] == 1 / 2
    assert blank_table(trials)[["left", "presented"]].iloc[-1].tolist() == [1, 2]


def test_names_of_files_tell_whose_a_table_of_a_bids_data_set_is(tmp_path: Path) -> None:
    header = ("participant_id", "run", "posture", "soa", "tactor1side", "response_correct", "rt",
              "session", "trial")  # fmt: skip
    rows = (("sub-008", "1", "crossed", "50", "left", "1", "1365", "ses-01", "1"),
            ("sub-008", "1", "crossed", "300", "left", "0", "844", "ses-01", "2"))  # fmt: skip
    for who in ("008", "009"):
        lines = ["\t".join(row).replace("008", who) for row in (header, *rows)]
        put(tmp_path / f"sub-{who}/ses-01/sub-{who}_task-LID_beh.tsv", "\n".join(lines) + "\n")
    columns = load_column_map(EXAMPLES / "r2bids-columns.toml")
    trials = read_inputs([tmp_path], columns).trials
    told = trials[["participant", "session", "condition", "level_vpp", "response", "rt_s"]]
    assert told.to_numpy().tolist() == [
        [who, "ses-01", "crossed", *told]
        for who in ("008", "009")
        for told in ((50.0, "left", 1.365), (300.0, "right", 0.844))
    ]


def test_quickpsy_has_levels_below_0(tmp_path: Path) -> None:
    text = "participant,cond,trial,phase,resp\nParticipant1,cond1,1.0,-150.0,0\n"
    found = read(tmp_path, "quickpsy", f"{text}Participant1,cond2,2.0,-50.0,1\n")
    assert found.axis.x_scale == "linear"
    levels = level_table(found.trials)[["condition", "level_vpp", "detected", "presented"]]
    assert levels.to_numpy().tolist() == [["cond1", -150.0, 0, 1], ["cond2", -50.0, 1, 1]]


@pytest.mark.parametrize(
    ("name", "text", "cells"),
    [
        (
            "hsp1942",
            "participant,session,level,p,N,k\nSH,R1,46.9,0.0,35,0\nSH,R1,73.1,9.4,35,3\n",
            [["session=R1", 46.9, "SH", 0, 35], ["session=R1", 73.1, "SH", 3, 35]],
        ),
        (
            "miranda2008",
            "level,k,n\n0.1,0,3\n0.3,0,5\n",
            [["main", 0.1, "one", 0, 3], ["main", 0.3, "one", 0, 5]],
        ),
        (
            "dallmann2015",
            "participant,vibration,level,k,n,slower\nMI,0,1.0,0,40,40\nMA,0,1.0,1,40,39\n",
            [["vibration=0", 1.0, "MA", 1, 40], ["vibration=0", 1.0, "MI", 0, 40]],
        ),
    ],
)
def test_tables_of_counts_give_their_cells(
    tmp_path: Path, name: str, text: str, cells: list[list[object]]
) -> None:
    found = read(tmp_path, name, text).cells
    assert found is not None
    told = found[["condition", "level_vpp", "participant", "detected", "presented"]]
    assert told.to_numpy().tolist() == cells
