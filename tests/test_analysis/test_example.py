"""The example table of the documentation: made from a seed, read to the counts it has."""

from __future__ import annotations

import csv
import io
import math
import random
from collections import Counter

from analysis import load_column_map, read_trials
from analysis.answers.detection import blank_table, both_table, detected_any, level_table
from tests.test_analysis.shared import EXAMPLES

TABLE = EXAMPLES / "synthetic-trials.csv"
MAP = EXAMPLES / "synthetic-columns.toml"
SEED = 20240607
LEVELS_VPP = (60, 95, 130, 165, 200)


def _felt(rng: random.Random, level_vpp: float, mu: float) -> bool:
    p = 0.98 * 0.5 * (1 + math.erf((math.log10(level_vpp) - mu) / 0.13 / math.sqrt(2)))
    return rng.random() < p


def _answer(rng: random.Random, kind: str, side: str, level_vpp: float, mu: float) -> str:
    draw = rng.random()
    if draw < 0.02:
        return "timeout"
    if kind == "null":
        return "left" if draw < 0.05 else "none"
    if kind == "both":
        return "both" if draw < 0.9 else rng.choice(("left", "right"))
    if not _felt(rng, level_vpp, mu):
        return "none"
    if draw < 0.05:
        return "both" if draw < 0.035 else {"left": "right", "right": "left"}[side]
    return side


def _participant(rng: random.Random, name: str) -> list[list[str]]:
    mu = 1.95 + 0.04 * rng.gauss(0, 1)
    trials = [("single", side, v) for side in ("left", "right") for v in LEVELS_VPP] * 6
    trials += [("both", "both", 130)] * 4 + [("null", "none", 0)] * 10
    rng.shuffle(trials)
    rows = []
    for number, (kind, side, level_vpp) in enumerate(trials, start=1):
        answer = _answer(rng, kind, side, level_vpp, mu)
        time_s = "" if answer == "timeout" else f"{rng.uniform(0.35, 1.2):.4f}"
        rows.append([name, "1", str(number), kind, side, str(level_vpp), answer, time_s])
    return rows


def _table() -> str:
    rng = random.Random(SEED)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    header = "participant,session,trial,kind,side,level_vpp,response,rt_s"
    writer.writerow(header.split(","))
    for number in range(1, 6):
        writer.writerows(_participant(rng, f"S{number:02d}"))
    return text.getvalue()


def test_the_example_table_is_what_its_seed_gives() -> None:
    assert TABLE.read_text(encoding="utf-8") == _table()


def test_the_example_is_counted_as_a_plain_reading_of_its_rows_counts_it() -> None:
    rows = list(csv.DictReader(io.StringIO(_table())))
    single = [row for row in rows if row["kind"] == "single"]
    correct = Counter(float(r["level_vpp"]) for r in single if r["response"] == r["side"])
    felt = Counter(
        float(r["level_vpp"]) for r in single if r["response"] in {"left", "right", "both"}
    )
    late = Counter(float(r["level_vpp"]) for r in single if r["response"] == "timeout")
    trials = read_trials([TABLE], load_column_map(MAP))
    levels = level_table(trials).set_index("level_vpp")
    assert levels["presented"].to_dict() == dict.fromkeys(map(float, LEVELS_VPP), 60)
    assert levels["detected"].to_dict() == {level: correct[level] for level in LEVELS_VPP}
    assert levels["timeouts"].to_dict() == {level: late[level] for level in LEVELS_VPP}
    any_felt = detected_any(trials).set_index("level_vpp")["detected_any"]
    assert any_felt.to_dict() == {level: felt[level] for level in LEVELS_VPP}
    noticed = sum(r["kind"] == r["response"] == "both" for r in rows)
    assert both_table(trials).iloc[-1][["noticed", "presented"]].tolist() == [noticed, 20]
    false = sum(r["kind"] == "null" and r["response"] not in {"none", "timeout"} for r in rows)
    total = blank_table(trials).iloc[-1]
    assert [total[["left", "right", "both"]].sum(), total["presented"]] == [false, 50]
