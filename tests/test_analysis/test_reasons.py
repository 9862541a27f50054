"""Whether and why a trial counts: one column, told once, that every table goes by."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import Analysis, ColumnMap, analyse, level_table, read_inputs
from analysis.reading.trials import with_reasons
from tests.test_analysis.shared import cases, loaded, put

if TYPE_CHECKING:
    from pathlib import Path

TRIALS = """participant,trial,kind,side,level_vpp,response,status,premature,noise_ok
P,1,practice,left,60,left,ok,false,true
P,2,single,left,60,left,ok,false,true
P,3,single,left,60,left,voided,false,false
P,4,single,right,60,left,ok,true,true
P,5,both,both,60,left,ok,false,false
P,6,blank,none,0,none,ok,false,n/a
"""
GOOD: dict[str, Any] = {
    "kind": "single",
    "status": "ok",
    "premature": False,
    "noise_ok": None,
    "burst_verified": None,
}


def tables(folder: Path, people: int) -> list[Path]:
    texts = [TRIALS.replace("P,", f"{number},") for number in range(people)]
    return [put(folder / f"{number}.csv", text) for number, text in enumerate(texts)]


def numbers(found: Analysis) -> list[list[Any]]:
    made = (found.levels, found.participants, found.both, found.blank, found.excluded)
    return [table.astype(object).fillna(-1).to_numpy().tolist() for table in made]


@pytest.mark.parametrize(("change", "reason", "fault"), cases("reasons"))
def test_the_first_reason_that_holds_is_told_and_a_fault_whatever_the_kind(
    change: dict[str, Any], reason: str, fault: str
) -> None:
    trial = with_reasons(pd.DataFrame([GOOD | change])).iloc[0]
    assert (trial["reason"], trial["fault"]) == (reason, fault)


@pytest.mark.slow
def test_no_table_looks_at_what_the_reason_was_told_from(tmp_path: Path) -> None:
    read = read_inputs(tables(tmp_path, 2), ColumnMap())
    bare = read.trials.drop(columns=["premature", "noise_ok"])
    assert numbers(analyse(replace(read, trials=bare))) == numbers(analyse(read))


def test_every_table_goes_by_the_reason(tmp_path: Path) -> None:
    read = read_inputs(tables(tmp_path, 1), ColumnMap())
    lost = analyse(replace(read, trials=read.trials.assign(reason="voided", fault="voided")))
    assert lost.excluded.to_numpy().tolist() == [["0", "voided", 6]]
    assert all(
        t.empty for t in (lost.levels, lost.both, lost.blank, lost.confusion, lost.hands_off)
    )
    assert level_table(read.trials)["presented"].tolist() == [1]


@pytest.mark.slow
def test_who_never_answers_in_a_condition_counts_there_for_nothing(tmp_path: Path) -> None:
    levels = [60, 95, 130] * 8
    felt = [
        f"{who},felt,left,{level},{'timeout' if level == 60 else 'left'}\n"
        for who in ("01", "02", "سمر, 3")
        for level in levels
    ]
    felt += [f"{who},felt,none,0,{answer}\n" for who in ("01", "02") for answer in ("none", "left")]
    mute = [
        f"{who},mute,left,{level},{'right' if who == '02' and level == 60 else 'timeout'}\n"
        for who in ("01", "02")
        for level in levels
    ]
    rows = [row.replace("سمر, 3", '"سمر, 3"') for row in [*felt, *mute]]
    head = "participant,condition,side,level_vpp,response\n"
    found = analyse(loaded(tmp_path, head + "".join(rows)))
    people = [*zip(found.thresholds["condition"], found.thresholds["participant"], strict=True)]
    assert people == [("felt", "01"), ("felt", "02"), ("felt", "سمر, 3"), ("mute", "02")]
    assert found.excluded.to_numpy().tolist() == [["01", "never_answered", 24]]
    assert found.levels.query("condition == 'mute'")["presented"].tolist() == [8, 8, 8]
    assert [*found.differences["participant"]] == ["02", "all"]
    (silent,) = (each for each in found.warnings if each.code == "answers_missing")
    assert silent.data == {"participant": "01", "condition": "mute", "number": 24}
