"""Small tables that were once misread: the proposed map, filled in, gives what is in the table.

A row is: the table, what is filled in, detected and presented by level, false alarms and blank
trials, participants, and the codes of warnings; or for a refusal, its parts.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, ResultFileError, load_column_map, read_inputs
from tests.test_analysis.shared import draft

if TYPE_CHECKING:
    from analysis import LoadedTrials

TABLES = Path(__file__).parent / "tables_external"
WORDS = {"task": "yes/no", "side": "left", "unit": "u"}
AFC = {"task": "forced choice", "participant": "file-"}
K = (2, 5, 16, 36, 36)
FIVE = dict(zip((0.05, 0.1, 0.2, 0.4, 0.8), ((k, 36) for k in K), strict=True))
SITES = {1.0: (22, 68), 2.0: (36, 62), 4.0: (58, 62)}
READ: list[tuple[str, dict[str, str], dict[float, tuple[int, int]], Any, int, list[str]]] = [
    ("missed-is-felt/hits.csv", {}, FIVE, (1, 36), 3, []),
    ("keine-is-timeout/deutsch.csv", {}, SITES, (5, 83), 3, []),
    ("keine-is-timeout/english.csv", {}, SITES, (5, 83), 3, []),
    ("only-the-first-heading/data", {}, FIVE, (1, 36), 3, []),
    ("id-is-no-person/data", {}, FIVE, (0, 0), 3, []),
    ("one-person-two-spellings/blank.csv", {}, FIVE, (1, 36), 6, ["names_alike"]),
    ("one-person-two-spellings/float.csv", {}, FIVE, (1, 36), 6, ["names_alike"]),
    ("empty-files/data", {}, FIVE, (1, 36), 3, []),
    ("metres/metres.csv", {}, FIVE, (1, 36), 3, []),
    ("words-by-hand/hand.csv", {}, FIVE, (1, 36), 3, []),
    ("lines-before-the-heading/r_table.txt", {}, FIVE, (1, 36), 3, []),
    ("two-loops/loops.csv", {}, FIVE, (1, 36), 3, []),
    ("messages/catch.csv", {}, FIVE, (1, 36), 3, []),
    (
        "id-is-no-person/index",
        {"level_vpp": "ComparisonStim", "darker": "0", "brighter": "1"},
        dict(zip(FIVE, zip((2, 4, 10, 24, 24), (24,) * 5, strict=True), strict=True)),
        (0, 0),
        2,
        [],
    ),
    (
        "broken-off-row/data",
        {},
        dict(zip(FIVE, ((2, 33), (4, 32), (15, 34), (33, 33), (29, 29)), strict=True)),
        (1, 33),
        3,
        [],
    ),
    (
        "copied-file/data",
        {},
        dict(zip(FIVE, ((4, 48), (6, 48), (21, 48), (48, 48), (48, 48)), strict=True)),
        (1, 48),
        4,
        ["same_trials_twice"],
    ),
    (
        "draft-refused/counts.csv",
        AFC,
        {1.0: (24, 48), 2.0: (30, 48), 3.0: (38, 48), 4.0: (45, 48), 6.0: (48, 48)},
        None,
        1,
        [],
    ),
    (
        "felt-and-missed/two_counts.csv",
        {},
        dict(zip(FIVE, zip((3, 15, 36, 54, 60), (60,) * 5, strict=True), strict=True)),
        None,
        3,
        [],
    ),
]


def counts(read: LoadedTrials) -> tuple[dict[float, tuple[int, int]], Any, int]:
    """Count detected and presented by level, false alarms and participants, row by row."""
    if read.cells is not None:
        sums = read.cells.groupby("level_vpp")[["detected", "presented"]].sum()
        levels = {level: (int(k), int(n)) for level, k, n in sums.itertuples()}
        return levels, None, read.cells["participant"].nunique()
    trials = read.trials.astype({"kind": object, "side": object, "response": object})
    single, blank = (trials[trials["kind"].eq(kind)] for kind in ("single", "blank"))
    hit = single["side"].eq(single["response"])
    levels = {
        float(level): (int(rows.sum()), len(rows))
        for level, rows in hit.groupby(single["level_vpp"])
    }
    false = int((~blank["response"].isin(["none", "timeout"])).sum())
    return levels, (false, len(blank)), trials["participant"].nunique()


@pytest.mark.parametrize(
    ("table", "filled_in", "levels", "false_alarms", "people", "warnings"), READ, ids=lambda v: v
)
def test_a_proposed_map_gives_what_is_in_the_table(
    tmp_path: Path, table: str, filled_in: Any, levels: Any, false_alarms: Any, people: int,
    warnings: list[str],
) -> None:  # fmt: skip
    made = draft(TABLES / table)
    entries = WORDS | filled_in
    assert {*made.fill_in} <= {*entries}
    read = read_inputs([TABLES / table], made.filled(tmp_path / "map.toml", entries))
    assert counts(read) == (levels, false_alarms, people)
    assert [str(code) for code, _ in read.warnings] == warnings


def test_people_in_a_column_of_an_unknown_spelling_stay_apart(tmp_path: Path) -> None:
    table = TABLES / "people-pooled" / "sub_id.csv"
    made = draft(table)
    assert made.map["columns"]["participant"] == "SubID"
    names = [
        "sub_id",
        "ppn",
        "pp",
        "obs",
        "sujeto",
        "soggetto",
        "proefpersoon",
        "listener",
        "user",
        "SID",
        "sub-id",
        "VP_Nr",
    ]
    text = table.read_text(encoding="utf-8")
    for name in names:
        renamed = tmp_path / "t.csv"
        renamed.write_text(text.replace("SubID", name, 1), encoding="utf-8")
        assert draft(renamed).map["columns"]["participant"] == name
    renamed.write_text(text.replace("SubID", "kuerzel", 1), encoding="utf-8")
    assert "participant" in draft(renamed).fill_in
    entries = {"task": "forced choice", "level_vpp": "Coh", "side": "left", "unit": "u"}
    trials = read_inputs([table], made.filled(tmp_path / "m.toml", entries)).trials
    assert trials["participant"].nunique() == 3
    assert len(trials) == 180


def test_two_columns_of_levels_are_both_named() -> None:
    made = draft(TABLES / "left-and-right-amplitude" / "two.csv")
    line = next(line for line in made.text.splitlines() if line.startswith("level_vpp"))
    assert line.startswith('level_vpp = ""  # FILL IN')
    assert "amp_left" in line
    assert "amp_right" in line


def test_every_file_of_a_folder_is_looked_at() -> None:
    made = draft(TABLES / "empty-files" / "data")
    assert made.map["rows"]["skip"]["file-"] == ["402", "502", "602"]
    assert all(f"file {stem} " in made.text for stem in ("402", "502", "602"))
    made = draft(TABLES / "only-the-first-heading" / "data")
    assert made.map["rows"]["skip"]["file-"] == ["002_vib"]
    made = draft(TABLES / "broken-off-row" / "data")
    assert made.map["rows"]["skip"]["participant"] == ""
    assert "1 of 195 rows" in made.text


def test_bookkeeping_of_a_staircase_is_no_condition(tmp_path: Path) -> None:
    table = TABLES / "staircase-bookkeeping" / "stairs.csv"
    made = draft(table)
    assert "staircase.direction" not in made.text.partition("# All columns")[0]
    read = read_inputs([table], made.filled(tmp_path / "map.toml", WORDS))
    assert len(read.trials) == 120
    assert read.warnings == ()


REFUSED = [
    ("no-heading/no_heading.csv", "no_heading.csv:1: |numbers, not like a heading"),
    ("settings-are-no-answers/adjust.csv", "adjust.csv: |response|40|settings"),
    ("lines-before-the-heading/expyriment.xpd.csv", "the heading seems to be line 4"),
    ("lines-before-the-heading/eprime.txt", "the heading seems to be line 2"),
]


@pytest.mark.parametrize(("table", "parts"), REFUSED)
def test_what_has_no_map_is_refused_in_one_line(table: str, parts: str) -> None:
    with pytest.raises(ResultFileError) as caught:
        draft(TABLES / table)
    assert all(part in str(caught.value) for part in parts.split("|"))
    assert "\n" not in str(caught.value)


def test_a_point_where_commas_are_decimal_is_named(tmp_path: Path) -> None:
    table = TABLES / "messages" / "mixed.csv"
    columns = draft(table).filled(tmp_path / "map.toml", WORDS)
    with pytest.raises(ResultFileError, match=re.escape('decimal = ","')) as caught:
        read_inputs([table], columns)
    assert caught.value.line == 6


def test_blocks_of_counts_are_summed() -> None:
    folder = TABLES / "blocks-of-counts"
    read = read_inputs([folder / "blocks.csv"], load_column_map(folder / "blocks.toml"))
    assert counts(read)[0] == {1.0: (5, 20), 2.0: (15, 20), 4.0: (19, 20)}


@pytest.mark.parametrize("name", ["9" * 50_000, "stim" * 12_000, "_" * 50_000 + "um"])
def test_hostile_headings_are_read_in_linear_time(tmp_path: Path, name: str) -> None:
    table = tmp_path / "t.csv"
    table.write_text(f"participant,{name},felt\na,1,1\na,2,0\n", encoding="utf-8")
    assert draft(table).fill_in


def test_a_thousand_columns_have_a_draft(tmp_path: Path) -> None:
    names = ["participant", "level", "felt", *(f"c{n}" for n in range(1000))]
    rows = [[f"p{n % 5}", str(n % 7), str(n % 2), *("ab"[n % 2] * 1000)] for n in range(300)]
    table = tmp_path / "t.csv"
    pd.DataFrame(rows, columns=names).to_csv(table, index=False)
    read = read_inputs([table], draft(table).filled(tmp_path / "map.toml", WORDS))
    assert len(read.trials) == 300


def test_control_signs_of_a_table_reach_neither_map_nor_message(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    table.write_text(
        "participant,level,\x1b[2Jfelt,answer\na,1,1,\x9b\na,2,0,y\n", encoding="utf-8"
    )
    made = draft(table)
    assert all(line.isprintable() for line in made.text.splitlines())
    columns = ColumnMap(columns={"side": "no"})
    with pytest.raises(ResultFileError) as caught:
        read_inputs([table], columns)
    assert str(caught.value).isprintable()
