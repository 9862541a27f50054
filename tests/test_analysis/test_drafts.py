"""The column map that `tactstrip columns` proposes: golden tables, names, factors, any table.

A case of `cases` is a folder with tables, or the example of docs/examples of that name, and with
expected.json: `fill_in` has the keys that the draft leaves empty and a word for each, `offered`
the entries behind a #, `read` how many trials the filled-in map gives by kind and answer or
the line at which that is refused, and the other keys are those of the map. UPDATE=1 writes them
anew: review the difference.
"""

from __future__ import annotations

import contextlib
import csv
import json
import os
import random
import tomllib
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis import ColumnMap, ResultFileError, load_column_map, read_inputs
from analysis.reading.foreign.columns import KEYS, SECTIONS
from tests.test_analysis.shared import EXAMPLES, LEAST, cases, draft, put, refused

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.conftest import Run

CASES = sorted((Path(__file__).parent / "cases").iterdir())
WORDS = {"task": "yes/no", "side": "left", "unit": "um"}


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
    words = {key: expected["fill_in"].get(key, WORDS.get(key, "")) for key in made.fill_in}
    found: dict[str, Any] = {"fill_in": words, "offered": made.offered, **made.map}
    if all(words.values()):
        found["read"] = counts(tables, made.filled(tmp_path / "map.toml", words))
    if os.environ.get("UPDATE"):
        lines = [f" {json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in found.items()]
        target.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    assert found == expected


@pytest.mark.parametrize("name", ["psychopy", "jspsych"])
def test_a_filled_in_draft_reads_as_the_map_by_hand(tmp_path: Path, name: str) -> None:
    words = {"down": "none", "f": "left", "j": "right", "unit": "%"}
    table = EXAMPLES / f"{name}-trials.csv"
    drafted = read_inputs([table], draft(table).filled(tmp_path / "map.toml", words))
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
    found: Any = draft(of_rows(tmp_path, header, rows)).map
    for name in section.split("."):
        found = found.get(name, {})
    assert found.get(key) == value


Row = dict[str, Any]
STRENGTHS = (0, 0.3, 0.6, 1.2, 2.4)


def session(person: int, *, blocked: bool, yes_no: bool) -> list[Row]:
    """Simulate 100 trials of two factor values: in two blocks, both orders, or shuffled."""
    rng = random.Random(person)
    stimuli = [(value, level) for value in (0, 1) for level in STRENGTHS for _ in range(10)]
    rng.shuffle(stimuli)
    if blocked:
        stimuli.sort(key=lambda stimulus: stimulus[0] != person % 2)
    places = {level: [1, 2] * 10 for level in STRENGTHS}
    rows: list[Row] = []
    for number, (value, level) in enumerate(stimuli):
        felt = rng.random() < (0.05, 0.2, 0.5, 0.9, 0.98)[STRENGTHS.index(level)]
        at = places[level].pop(rng.randrange(len(places[level])))
        said = at if felt else rng.choice((1, 2))
        answer = {"resp": "ny"[felt]} if yes_no else {"key": "fj"[said - 1], "corr": said == at}
        hit = felt if yes_no else said == at
        rows.append({"subject": f"p{person}", "amp": level, "rt": rng.uniform(0.2, 0.9)})
        rows[-1] |= {"person": person, "n": number, "factor": value, "at": at, "felt": felt}
        rows[-1] |= {"rng": rng, "said": said, "hit": hit, "answer": answer}
    return rows


def factor_table(target: Path, column: str, made: Callable[[Row], object], **design: bool) -> Path:
    """Write the table of six people with a column of numbers that is made of each row."""
    design = {"blocked": True, "yes_no": True} | design
    lines = []
    for person in range(6):
        for row in session(person, **design):
            cells = {"subject": row["subject"], "amp": row["amp"], "rt": f"{row['rt']:.3f}"}
            cells |= {name: str(word).lower() for name, word in row["answer"].items()}
            lines.append(cells | {column: made(row)})
    text = [",".join(lines[0]), *(",".join(map(str, cells.values())) for cells in lines)]
    return put(target, "\n".join(text) + "\n")


def conditions(path: Path) -> list[str]:
    return [value for key, value in draft(path).offered if key == "condition"]


SHUFFLED, FORCED = {"blocked": False}, {"yes_no": False}
FACTORS: dict[str, tuple[str, Callable[[Row], object], dict[str, bool]]] = {
    "frequencies in blocks": ("freq_Hz", lambda r: (40, 250)[r["factor"]], {}),
    "temperatures, shuffled": ("Temp", lambda r: (18.5, 32)[r["factor"]], SHUFFLED),
    "in one order for all": ("hz", lambda r: (250, 40)[r["n"] // 50], {}),
    "a flag, in blocks": ("glove", lambda r: r["factor"], {}),
    "a flag, shuffled": ("noise_on", lambda r: r["factor"], SHUFFLED),
    "codes, in blocks": ("kontaktor", lambda r: r["factor"] + 1, FORCED),
    "a force, forced choice": ("kraft_N", lambda r: (1, 5)[r["factor"]], FORCED | SHUFFLED),
    "people in two groups": ("probe_mm", lambda r: 1 + 4 * (r["person"] % 2), {}),
    "none in blanks": ("frequency", lambda r: r["amp"] and (60, 300)[r["factor"]], SHUFFLED),
    "three within": ("duree", lambda r: (50, 100, 400)[r["n"] % 99 // 33], {}),
}


@pytest.mark.parametrize("case", FACTORS)
def test_numbers_that_were_varied_by_design_are_offered(tmp_path: Path, case: str) -> None:
    column, made, design = FACTORS[case]
    assert conditions(factor_table(tmp_path / "t.csv", column, made, **design)) == [column]


OTHERS: dict[str, Callable[[Row], object]] = {
    "block": lambda r: 1 + r["n"] // 50,
    "part": lambda r: 1 + r["n"] // 25,  # counts, whatever its name
    "miniBlock": lambda r: (10, 20)[r["n"] // 50],
    "durchlauf": lambda r: r["n"] // 20,
    "cycle": lambda r: r["n"] % 5,
    "trials.thisRepN": lambda r: r["n"] // 25,
    "trials.thisIndex": lambda r: 2 * STRENGTHS.index(r["amp"]) % 5,
    "session_nr": lambda r: 2 - r["factor"],
    "visitDate": lambda r: (20260301, 20260308)[r["factor"]],
    "keyCode": lambda r: (78, 89)[r["felt"]],
    "which": lambda r: (78, 89)[r["felt"]],  # follows the answer, whatever its name
    "ok": lambda r: int(r["hit"]),
    "is_catch": lambda r: int(r["amp"] == 0),
    "leer": lambda r: int(r["amp"] == 0),
    "large": lambda r: int(r["amp"] > 0.5),
    "stepdB": lambda r: (4, 2)[r["n"] % 50 > 20],
    "amp_dB": lambda r: round(10 * r["amp"]),
    "um": lambda r: 3.5 * r["amp"],  # levels in another unit, whatever its name
    "stufe": lambda r: STRENGTHS.index(r["amp"]),
    "roll": lambda r: r["rng"].randint(1, 3),
    "draw": lambda r: r["rng"].choice((0.5, 1, 1.5)),
    "ITI_ms": lambda r: r["rng"].choice((1000, 1500)),
    "foreperiod": lambda r: (0.5, 1)[r["at"] - 1],
    "rt_bin": lambda r: int(5 * r["rt"]) % 3,
    "frameRate": lambda r: (59.94, 60)[r["person"] % 2],
    "fps": lambda r: (59.94, 60)[r["person"] % 2],
    "seed": lambda r: 41 + r["person"],
    "zahl": lambda r: 900 + 7 * r["person"],  # another one for everybody
    "age": lambda r: (22, 25)[r["person"] % 2],
    "constant": lambda _: 200,
}


@pytest.mark.parametrize("column", OTHERS)
def test_numbers_that_are_no_factor_are_not_offered(tmp_path: Path, column: str) -> None:
    for blocked in (True, False):
        path = factor_table(tmp_path / f"{blocked}.csv", column, OTHERS[column], blocked=blocked)
        assert not conditions(path)


@pytest.mark.parametrize("column", ["target_interval", "pos"])
@pytest.mark.parametrize("words", [(1, 2), (-1, 1), (70, 74)])
@pytest.mark.parametrize("blocked", [True, False])
def test_where_the_target_was_is_not_offered(
    tmp_path: Path, column: str, words: tuple[int, int], *, blocked: bool
) -> None:
    path = factor_table(
        tmp_path / "t.csv", column, lambda r: words[r["at"] - 1], yes_no=False, blocked=blocked
    )
    assert not conditions(path)


def test_a_factor_of_numbers_is_offered_with_names_to_print_and_warned_of(tmp_path: Path) -> None:
    frequencies = (63, 200)
    path = factor_table(tmp_path / "t.csv", "freq_Hz", lambda r: frequencies[r["factor"]])
    made = draft(path)
    assert ["63", "63 Hz"] in made.offered
    words = {"task": "yes/no", "unit": "µm", "side": "left"}
    read = read_inputs([path], made.filled(tmp_path / "a.toml", words))
    assert len(read.changed) == 1
    assert "freq_Hz" in str(read.changed[0])
    text = made.text.replace("# condition", "condition").replace("# 63 =", "63 =")
    taken = type(made)(text, made.fill_in).filled(tmp_path / "b.toml", words)
    read = read_inputs([path], taken)
    assert ({*read.trials["condition"]}, read.changed) == ({"63 Hz", "200"}, ())
    assert read.axis.unit == "µm"


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
    skipped, blank = done.stdout.splitlines()[:2]
    assert "7 of 119" in skipped
    assert blank.startswith("32 ")
    assert all(f": {line}\n" in target.read_text(encoding="utf-8") for line in (skipped, blank))
    assert run("columns", table, "--write", target).exit_code == 2
    assert run("columns", tmp_path / "nothing.csv").exit_code == 2
    assert run("columns", put(tmp_path / "trials.csv", LEAST)).exit_code == 2
    excel = run("columns", put(tmp_path / "excel.csv", "sep=;\nperson;trial;level;felt\na;1;2;y\n"))
    assert excel.exit_code == 2
    assert "excel.csv:1: " in excel.stderr
