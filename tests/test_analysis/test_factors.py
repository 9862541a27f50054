"""Columns of numbers in tables made elsewhere: which are offered as a condition, which are not."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, Any

import pytest

from analysis import load_column_map
from analysis.reading.drafted.draft import map_draft
from analysis.reading.drafted.factors import Roles, factor_words
from analysis.reading.drafted.sample import Sample
from analysis.reading.load import read_inputs
from analysis.reading.sources import find_sources
from tests.test_analysis.shared import put

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

Row = dict[str, Any]

LEVELS = (0, 0.3, 0.6, 1.2, 2.4)
PEOPLE = 6


def session(person: int, *, blocked: bool, yes_no: bool) -> list[Row]:
    """Simulate 100 trials of two factor values: in two blocks, both orders, or shuffled."""
    rng = random.Random(person)
    stimuli = [(value, level) for value in (0, 1) for level in LEVELS for _ in range(10)]
    rng.shuffle(stimuli)
    if blocked:
        stimuli.sort(key=lambda one: one[0] != person % 2)
    places = {level: [1, 2] * 10 for level in LEVELS}
    rows: list[Row] = []
    for number, (value, level) in enumerate(stimuli):
        felt = rng.random() < (0.05, 0.2, 0.5, 0.9, 0.98)[LEVELS.index(level)]
        at = places[level].pop(rng.randrange(len(places[level])))
        said = at if felt else rng.choice((1, 2))
        answer = {"resp": "ny"[felt]} if yes_no else {"key": "fj"[said - 1], "corr": said == at}
        hit = felt if yes_no else said == at
        rows.append({"subject": f"p{person}", "amp": level, "rt": rng.uniform(0.2, 0.9)})
        rows[-1] |= {"person": person, "n": number, "factor": value, "at": at, "felt": felt}
        rows[-1] |= {"rng": rng, "said": said, "hit": hit, "answer": answer}
    return rows


def table(target: Path, column: str, made: Callable[[Row], object], **design: bool) -> Path:
    """Write the table of six people with a column of numbers that is made of each row."""
    design = {"blocked": True, "yes_no": True} | design
    lines = []
    for person in range(PEOPLE):
        for row in session(person, **design):
            cells = {"subject": row["subject"], "amp": row["amp"], "rt": f"{row['rt']:.3f}"}
            cells |= {name: str(word).lower() for name, word in row["answer"].items()}
            cells[column] = made(row)
            lines.append(cells)
    text = [",".join(lines[0]), *(",".join(map(str, one.values())) for one in lines)]
    return put(target, "\n".join(text) + "\n")


def offered(path: Path) -> list[str]:
    text, _ = map_draft(find_sources([path], foreign=True).tables)
    start = "# condition = "
    return [line.removeprefix(start) for line in text.splitlines() if line.startswith(start)]


FACTORS: dict[str, tuple[str, Callable[[Row], object], dict[str, bool]]] = {
    "frequencies in blocks": ("freq_Hz", lambda r: (40, 250)[r["factor"]], {}),
    "temperatures, shuffled": ("Temp", lambda r: (18.5, 32)[r["factor"]], {"blocked": False}),
    "in one order for all": ("hz", lambda r: (250, 40)[r["n"] // 50], {}),
    "a flag, in blocks": ("glove", lambda r: r["factor"], {}),
    "a flag, shuffled": ("noise_on", lambda r: r["factor"], {"blocked": False}),
    "codes, in blocks": ("kontaktor", lambda r: r["factor"] + 1, {"yes_no": False}),
    "a force, forced choice": ("kraft_N", lambda r: (1, 5)[r["factor"]],
                               {"yes_no": False, "blocked": False}),
    "people in two groups": ("probe_mm", lambda r: 1 + 4 * (r["person"] % 2), {}),
    "none in blanks": ("frequency", lambda r: r["amp"] and (60, 300)[r["factor"]],
                       {"blocked": False}),
    "three within": ("duree", lambda r: (50, 100, 400)[r["n"] % 99 // 33], {}),
}  # fmt: skip


@pytest.mark.parametrize("case", FACTORS)
def test_numbers_that_were_varied_by_design_are_offered(tmp_path: Path, case: str) -> None:
    column, made, design = FACTORS[case]
    assert [one.split('"')[1] for one in offered(table(tmp_path / "t.csv", column, made, **design))]


OTHERS: dict[str, Callable[[Row], object]] = {
    "block": lambda r: 1 + r["n"] // 50,
    "part": lambda r: 1 + r["n"] // 25,  # counts, whatever its name
    "miniBlock": lambda r: (10, 20)[r["n"] // 50],
    "durchlauf": lambda r: r["n"] // 20,
    "cycle": lambda r: r["n"] % 5,
    "trials.thisRepN": lambda r: r["n"] // 25,
    "trials.thisIndex": lambda r: 2 * LEVELS.index(r["amp"]) % 5,
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
    "stufe": lambda r: LEVELS.index(r["amp"]),
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
    "Alter": lambda r: (22, 25)[r["person"] % 2],
    "constant": lambda _: 200,
}


@pytest.mark.parametrize("column", OTHERS)
def test_numbers_that_are_plainly_something_else_are_not_offered(
    tmp_path: Path, column: str
) -> None:
    assert not offered(table(tmp_path / "t.csv", column, OTHERS[column], blocked=True))
    assert not offered(table(tmp_path / "u.csv", column, OTHERS[column], blocked=False))


@pytest.mark.parametrize("column", ["target_interval", "pos", "ort", "stimPos_nr", "corrAns"])
@pytest.mark.parametrize("words", [(1, 2), (-1, 1), (70, 74)])
def test_where_the_target_was_is_not_offered(
    tmp_path: Path, column: str, words: tuple[int, int]
) -> None:
    def place(row: Row) -> int:
        return words[row["at"] - 1]

    for blocked in (True, False):
        path = table(tmp_path / f"{blocked}.csv", column, place, yes_no=False, blocked=blocked)
        assert not offered(path)


def test_a_factor_of_numbers_is_offered_with_names_to_print_and_warned_of(tmp_path: Path) -> None:
    path = table(tmp_path / "t.csv", "freq_Hz", lambda r: (63, 200)[r["factor"]], blocked=False)
    text, _ = map_draft(find_sources([path], foreign=True).tables)
    assert '# 63 = "63 Hz"  # to print so, or as you like, where freq_Hz is the condition\n' in text
    assert '# Note: condition = "freq_Hz" compares' in text
    text = text.replace('task = ""', 'task = "yes/no"').replace('unit = ""', 'unit = "µm"')
    text = text.replace('side = ""', 'side = "left"')
    read = read_inputs([path], load_column_map(put(tmp_path / "a.toml", text)))
    assert [one.split(" is no condition here")[0] for one in read.changed] in (
        ["column freq_Hz (63, 200)"],
        ["column freq_Hz (200, 63)"],
    )
    taken = text.replace("# condition", "condition").replace("# 63 =", "63 =")
    read = read_inputs([path], load_column_map(put(tmp_path / "b.toml", taken)))
    assert ({*read.trials["condition"]}, read.changed) == ({"63 Hz", "200"}, ())
    assert read.axis.unit == "µm"


def test_draws_of_one_person_are_seldom_taken_for_a_plan() -> None:
    def offers(seed: int, *, drawn: bool) -> bool:
        rng = random.Random(seed)
        plan = [(value, level) for value in "28" for level in "01234" for _ in range(8)]
        rng.shuffle(plan)
        rows = [
            ["p", level, rng.choice("28") if drawn else value, "ny"[rng.random() < int(level) / 4]]
            for value, level in plan
        ]
        sample = Sample(header=["person", "level", "value", "said"], rows=rows)
        roles = Roles(person="person", level="level", answers=["said"])
        return factor_words(sample, "value", roles) != []

    assert sum(offers(seed, drawn=True) for seed in range(100)) <= 5
    assert all(offers(seed, drawn=False) for seed in range(20))


def test_numbers_that_repeat_words_are_offered_once(tmp_path: Path) -> None:
    path = table(tmp_path / "t.csv", "code", lambda r: f"{7 + r['factor']}")
    lines = path.read_text(encoding="utf-8").splitlines()
    named = [f"{line},{'cold' if line.endswith('7') else 'warm'}" for line in lines[1:]]
    put(path, "\n".join([f"{lines[0]},hand_is", *named]) + "\n")
    assert [one.split('"')[1] for one in offered(path)] == ["hand_is"]


def test_answers_that_are_missing_are_counted_and_can_be_left_out(tmp_path: Path) -> None:
    rows = "".join(f"a,{n % 3},{('NaN', 0, 1)[n % 3]}\n" for n in range(12))
    path = put(tmp_path / "t.csv", f"subject,amp_um,felt\n{rows}")
    text, _ = map_draft(find_sources([path], foreign=True).tables)
    line = (
        "guess: 4 rows, counted as not detected: say so in a paper; to leave them out, "
        'write felt = "NaN" below [rows.skip]'
    )
    assert f'NaN = "timeout"  # {line}\n' in text
    text = text.replace('task = ""', 'task = "yes/no"').replace('side = ""', 'side = "left"')
    kept = read_inputs([path], load_column_map(put(tmp_path / "a.toml", text)))
    assert (len(kept.trials), kept.left_out) == (12, 0)
    text += '[rows.skip]\nfelt = "NaN"\n'
    left = read_inputs([path], load_column_map(put(tmp_path / "b.toml", text)))
    assert (len(left.trials), left.left_out) == (8, 4)
