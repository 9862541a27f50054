"""The column map that `tactstrip columns` proposes: golden tables, names, any table.

A case of `cases` is a folder with tables, or the example of docs/examples of that name, and with
expected.json: `fill_in` has the keys that the draft leaves empty and a word for each, `read` how
many trials the filled-in map gives by kind and answer or the line at which that is refused, and the
other keys are those of the map. UPDATE=1 writes them
anew: review the difference.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import tomllib
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis import ColumnMap, ResultFileError, load_column_map, read_inputs
from analysis.reading.columns import KEYS, SECTIONS
from tests.test_analysis.shared import EXAMPLES, LEAST, cases, draft, put, refused

if TYPE_CHECKING:
    from tests.conftest import Run

CASES = sorted((Path(__file__).parent / "cases").iterdir())
WORDS = {
    "task": "yes/no",
    "participant": "file-",
    "side": "left",
    "unit": "um",
    "encoding": "cp1252",
}


def counts(paths: list[Path], columns: ColumnMap) -> dict[str, int]:
    """Count the trials that a map reads by kind and answer, and the rows that it leaves out."""
    try:
        read = read_inputs(paths, columns)
    except ResultFileError as error:
        return {"refused_at_line": error.line or 0}
    if read.cells is not None:
        return {name: int(read.cells[name].sum()) for name in ("detected", "presented")}
    kinds = (" ".join(pair) for pair in read.trials[["kind", "response"]].astype(str).to_numpy())
    people = read.trials["participant"].nunique()
    return dict(sorted(Counter(kinds).items())) | {"people": people, "left_out": read.left_out}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_table_has_the_expected_draft(case: Path, tmp_path: Path) -> None:
    target = case / "expected.json"
    expected = json.loads(target.read_text(encoding="utf-8"))
    tables = sorted(p for p in case.iterdir() if p != target) or [EXAMPLES / f"{case.name}.csv"]
    made = draft(*tables)
    filled_in = {key: expected["fill_in"].get(key, WORDS.get(key, "")) for key in made.fill_in}
    result: dict[str, Any] = {"fill_in": filled_in, **made.map}
    if all(filled_in.values()):
        result["read"] = counts(tables, made.filled(tmp_path / "map.toml", filled_in))
    if os.environ.get("UPDATE"):
        lines = [
            f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in result.items()
        ]
        target.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    assert result == expected


@pytest.mark.parametrize(("name", "task"), [("psychopy", "yes/no"), ("jspsych", "forced choice")])
def test_a_filled_in_draft_reads_as_the_map_by_hand(tmp_path: Path, name: str, task: str) -> None:
    filled_in = {"task": task, "down": "none", "f": "left", "j": "right", "unit": "%"}
    table = EXAMPLES / f"{name}-trials.csv"
    drafted = read_inputs([table], draft(table).filled(tmp_path / "map.toml", filled_in))
    by_hand = read_inputs([table], load_column_map(EXAMPLES / f"{name}-columns.toml"))
    same = ["trial", "side", "response", "rt_s", "kind"]
    assert drafted.trials[same].equals(by_hand.trials[same])
    assert drafted.left_out == by_hand.left_out


def of_rows(folder: Path, head: str, rows: list[str]) -> Path:
    return put(folder / "t.csv", "\n".join([head, *rows]) + "\n")


@pytest.mark.parametrize(("header", "rows", "section", "key", "value"), cases("headings"))
def test_headings_and_words_have_their_meaning(
    tmp_path: Path, header: str, rows: list[str], section: str, key: str, value: object
) -> None:
    entry: Any = draft(of_rows(tmp_path, header, rows)).map
    for name in section.split("."):
        entry = entry.get(name, {})
    assert entry.get(key) == value


CELLS = st.sampled_from(
    ["", "left", "1", "0", "60,5", "null", "practice", "a\tb", '"', "\x7f", "é"]
)
NAMES = st.sampled_from(
    [
        "subject",
        "side",
        "level",
        "response",
        "rt",
        "correct",
        "k",
        "n",
        "trial_type",
        "time_elapsed",
        "trials.thisN",
        "p.thisN",
        'a "b"',
        "x\ny",
        "volts",
    ]
)


@pytest.mark.slow
@settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data())
def test_any_table_has_a_draft_that_is_a_map_or_names_what_it_lacks(
    tmp_path: Path, data: st.DataObject
) -> None:
    header = data.draw(st.lists(NAMES, min_size=1, max_size=8, unique=True))
    rows = data.draw(st.lists(st.tuples(*[CELLS] * len(header)), min_size=1, max_size=6))
    path = tmp_path / "any.csv"
    with path.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows([header, *rows])
    if not any(any(row) for row in rows):
        refused(path, columns=ColumnMap())
        return
    made = draft(path)
    assert tomllib.loads(made.text).keys() <= {*KEYS, *SECTIONS}
    with contextlib.suppress(ValueError) if made.fill_in else contextlib.nullcontext():
        load_column_map(put(tmp_path / "m.toml", made.text))


def test_the_command_writes_a_new_file_and_counts_what_it_skips(tmp_path: Path, run: Run) -> None:
    table, target = EXAMPLES / "psychopy-trials.csv", tmp_path / "map.toml"
    done = run("columns", table, "--write", target)
    assert done.exit_code == 0
    skipped = done.stdout.splitlines()[0]
    assert "7 of 119" in skipped
    assert f": {skipped}\n" in target.read_text(encoding="utf-8")
    assert run("columns", table, "--write", target).exit_code == 2
    assert run("columns", tmp_path / "nothing.csv").exit_code == 2
    assert run("columns", put(tmp_path / "trials.csv", LEAST)).exit_code == 2
    excel = run("columns", put(tmp_path / "excel.csv", "sep=;\nperson;trial;level;felt\na;1;2;y\n"))
    assert excel.exit_code == 2
    assert "excel.csv:1: " in excel.stderr
