"""The draft of a map: what is guessed is called so, and what is filled in runs."""

from __future__ import annotations

import contextlib
import csv
import random
import re
import tomllib
from itertools import product
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis import ColumnMap, load_column_map
from analysis.answers.detection import level_table
from analysis.reading.drafted.draft import NOTE, map_draft
from analysis.reading.foreign.columns import KEYS, SECTIONS
from analysis.reading.load import read_inputs
from analysis.reading.sources import find_sources
from tests.test_analysis.shared import EXAMPLES, LEAST, put, refused, run

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path


def filled(table: Path, target: Path, words: Mapping[str, str]) -> Path:
    """Draft the map of a table and fill in what is empty."""
    text, blanks = map_draft(find_sources([table], foreign=True).tables)
    assert {*words} == {*blanks}
    lines = (
        line.replace(' = ""', f' = "{words[line.split(" = ")[0]]}"')
        if "# FILL IN" in line
        else line
        for line in text.splitlines()
    )
    return put(target, "\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("psychopy", {"down": "none", "unit": "% FS"}),
        ("jspsych", {"f": "left", "j": "right", "unit": "%"}),
    ],
)
def test_a_draft_that_is_filled_in_reads_as_the_map_by_hand(
    tmp_path: Path, name: str, words: dict[str, str]
) -> None:
    table = EXAMPLES / f"{name}-trials.csv"
    drafted = read_inputs([table], load_column_map(filled(table, tmp_path / "map.toml", words)))
    by_hand = read_inputs([table], load_column_map(EXAMPLES / f"{name}-columns.toml"))
    same = ["trial", "side", "response", "rt_s", "kind"]
    assert drafted.trials[same].equals(by_hand.trials[same])
    assert drafted.left_out == by_hand.left_out


def test_a_column_with_our_name_and_no_numbers_is_left_out(tmp_path: Path) -> None:
    rows = "".join(
        f"{who},{skin},{skin},{level},{'y' if level > 20 else 'n'}\n"
        for who in (1, 2)
        for skin in ("bare", "glove")
        for level in (0, 10, 20, 30, 40)
    )
    table = put(tmp_path / "t.csv", f"subject,block,skin,level,felt\n{rows}")
    words = {"task": "yes/no", "side": "left", "unit": "%"}
    drafted = map_draft(find_sources([table], foreign=True).tables)[0]
    assert "to compare bare, glove (in every row as block)" in drafted
    columns = load_column_map(filled(table, tmp_path / "map.toml", words))
    assert columns.columns["block"] == ""
    assert read_inputs([table], columns).trials["block"].eq(1).all()


def test_the_examples_of_other_programs_have_the_counts_of_their_rows() -> None:
    with (EXAMPLES / "psychopy-trials.csv").open(encoding="utf-8-sig", newline="") as stream:
        felt = [r for r in csv.DictReader(stream) if r["trials.thisN"] and r["intensity"] != "0"]
    with (EXAMPLES / "jspsych-trials.csv").open(encoding="utf-8", newline="") as stream:
        heard = [r for r in csv.DictReader(stream) if r["phase"] == "main"]
    keys = {"f": "left", "j": "right"}
    hits = {
        "psychopy": [
            (float(r["intensity"]) * 2.5, r["key_resp.keys"] == r["stim_side"]) for r in felt
        ],
        "jspsych": [(float(r["volume"]), keys.get(r["response"]) == r["side"]) for r in heard],
    }
    for name, rows in hits.items():
        columns = load_column_map(EXAMPLES / f"{name}-columns.toml")
        read = read_inputs([EXAMPLES / f"{name}-trials.csv"], columns)
        levels = level_table(read.trials)[["level_vpp", "detected", "presented"]]
        expected = [
            [at, sum(hit for level, hit in rows if level == at), sum(x == at for x, _ in rows)]
            for at in sorted({level for level, _ in rows})
        ]
        assert levels.to_numpy().tolist() == expected


@pytest.mark.parametrize("blank", ["left", "none"])
def test_where_felt_or_not_was_asked_at_two_places_all_are_one(tmp_path: Path, blank: str) -> None:
    rows = ["participant,amplitude,stim_side,key_resp.keys"]
    rows += [
        f"p1,{0.1 * (i % 4):.1f},{blank if i % 4 == 0 else ('left', 'right')[i % 2]},"
        f"{'ny'[i % 4 > 1 or i == 8]}"
        for i in range(40)
    ]
    table = put(tmp_path / "t.csv", "\n".join(rows) + "\n")
    columns = load_column_map(filled(table, tmp_path / "m.toml", {"task": "yes/no", "unit": "um"}))
    trials = read_inputs([table], columns).trials
    assert sorted(trials["side"].astype(str)) == ["left"] * 30 + ["none"] * 10
    assert level_table(trials)["presented"].tolist() == [10, 10, 10]


def test_a_draft_tells_what_is_taken_as_it_is_and_of_how_many_files(tmp_path: Path) -> None:
    rows = "".join(f"{i},{'ab'[i % 2]},left,left\n" for i in range(4))
    for person in range(1, 11):
        head = "participant,amplitude,condition,side,response\n"
        lines = "".join(f"{person:02d},{row}" for row in rows.splitlines(keepends=True))
        put(tmp_path / f"{person:02d}.csv", head + lines)
    text, _ = map_draft(find_sources([tmp_path], foreign=True).tables)
    assert text.splitlines()[0].startswith("# A draft for 01.csv and 9 more: ")
    assert "# participant: taken as it is; 10 values: 01, 02, 03," in text
    assert "# condition: taken as it is; 2 values: a, b\n" in text
    assert 'level_vpp = "amplitude"  # guess; 4 values: 0, 1, 2, 3\n' in text


def test_a_table_of_counts_needs_its_task_alone(tmp_path: Path) -> None:
    table = put(tmp_path / "t.csv", "subject;volts;k;n\n1;60,5;3;10\n1;95;9;10\n")
    columns = load_column_map(filled(table, tmp_path / "m.toml", {"task": "forced choice"}))
    assert read_inputs([table], columns).cells is not None
    unfilled = put(tmp_path / "u.toml", map_draft(find_sources([table]).tables)[0])
    with pytest.raises(ValueError, match="need task"):
        load_column_map(unfilled)


def test_answers_of_0_and_1_need_their_task_and_what_has_no_column(tmp_path: Path) -> None:
    table = put(tmp_path / "p7.csv", "amp,correct,rt\n" + "60,1,480\n-95,0,510\n" * 3)
    words = {"task": "forced choice", "side": "left", "unit": "deg"}
    columns = load_column_map(filled(table, tmp_path / "m.toml", words))
    read = read_inputs([table], columns)
    assert {*read.trials["participant"]} == {"p7"}
    assert read.trials["rt_s"].max() == 0.51
    assert read.axis.x_scale == "linear"


def test_true_and_false_beside_keys_are_told_as_they_stand(tmp_path: Path) -> None:
    text = "subject,side,volume,response,correct\ns,left,60,f,true\ns,right,60,f,false\n"
    draft, _ = map_draft(find_sources([put(tmp_path / "t.csv", text)], foreign=True).tables)
    assert 'response = "response"  # guess; correct (true, false) does not say where' in draft
    asked = text.replace("response", "asked").replace(",f,", ",x,")
    draft, _ = map_draft(find_sources([put(tmp_path / "u.csv", asked)], foreign=True).tables)
    assert 'detected = "correct"  # guess; 2 values: true, false' in draft
    assert "values.detected" not in draft


def test_the_command_writes_no_file_twice_and_takes_no_table_of_ours(tmp_path: Path) -> None:
    table, target = put(tmp_path / "t.csv", LEAST + "1,left,60,f\n"), tmp_path / "map.toml"
    done = run("columns", table, "--write", target)
    assert (done.exit_code, "fill in f, then tactstrip analyze" in done.output) == (0, True)
    again = run("columns", table, "--write", target)
    assert (again.exit_code, "must be a new file" in again.output) == (2, True)
    assert "[values.response]" in run("columns", table).output
    assert run("columns", tmp_path / "nothing.csv").exit_code == 2
    assert "response] 'f': allowed left" in str(refused_map(target))
    own = put(tmp_path / "trials.csv", LEAST)
    assert "needs no map" in run("columns", own).output


def refused_map(path: Path) -> ValueError:
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        load_column_map(path)
    return caught.value


def draft(table: Path) -> str:
    return map_draft(find_sources([table], foreign=True).tables)[0]


def test_keys_for_yes_and_no_are_what_was_detected(tmp_path: Path) -> None:
    text = "participant;finger;intensity;keys;rt\nJ\u00f6rg;left;63;j;0,41\n"
    text += "J\u00f6rg;left;16;n;0,62\n"
    table = tmp_path / "t.csv"
    table.write_bytes((text + "J\u00f6rg;left;16;None;\n").encode("cp1252"))
    words = {"task": "yes/no", "unit": "um"}
    columns = load_column_map(filled(table, tmp_path / "m.toml", words))
    assert dict(columns.file) == {"encoding": "cp1252", "decimal": ","}
    read = read_inputs([table], columns).trials
    assert read["participant"].tolist() == ["J\u00f6rg"] * 3
    assert read["response"].tolist() == ["left", "none", "timeout"]
    assert read["rt_s"].tolist()[:2] == [0.41, 0.62]


def test_keys_1_and_2_of_two_intervals_are_no_sides(tmp_path: Path) -> None:
    text = "participant,amp,key_resp.keys,key_resp.corr\nA,5,1,1\nA,5,2,0\n"
    assert 'detected = "key_resp.corr"' in draft(put(tmp_path / "t.csv", text))


def test_tables_in_german_and_french_are_read_as_those_in_english(tmp_path: Path) -> None:
    english = put(
        tmp_path / "e.csv",
        "participant,condition,trial,side,voltage,response,rt\n"
        "P1,bare,1,left,60.5,right,0.51\nP1,bare,2,right,95,none,0.62\n"
        "P1,bare,3,none,0,both,0.43\n",
    )
    german = put(
        tmp_path / "g.csv",
        "Versuchsperson;Bedingung;Durchgang;Seite;Spannung;Antwort;Reaktionszeit\n"
        "P1;bare;1;links;60,5;rechts;0,51\nP1;bare;2;rechts;95;nichts;0,62\n"
        "P1;bare;3;nichts;0;beide;0,43\n",
    )
    french = put(
        tmp_path / "f.csv",
        "Sujet;Condition;Essai;Côté;Tension;Réponse;Temps de réponse\n"
        "P1;bare;1;gauche;60,5;droite;0,51\nP1;bare;2;droite;95;rien;0,62\n"
        "P1;bare;3;rien;0;les deux;0,43\n",
    )
    first, *others = (
        read_inputs([one], load_column_map(filled(one, tmp_path / f"{one.stem}.toml", {}))).trials
        for one in (english, german, french)
    )
    same = ["participant", "trial", "kind", "side", "level_vpp", "response", "rt_s", "status"]
    assert first["response"].tolist() == ["right", "none", "both"]
    for other in others:
        assert first[same].equals(other[same])


def test_two_intervals_in_german_are_known_by_what_was_right(tmp_path: Path) -> None:
    text = "VP;Intervall;Amplitude (µm);Antwort;Richtig\n1;1;0,4;2;0\n1;2;0,8;2;1\n"
    told = draft(put(tmp_path / "t.csv", text))
    assert 'detected = "Richtig"' in told
    assert 'task = ""  # FILL IN' in told


def test_buttons_that_jspsych_counts_are_not_taken_for_no_and_yes(tmp_path: Path) -> None:
    row = "html-button-response,1,900,k1,512,{},left,100\n"
    text = "trial_type,trial_index,time_elapsed,subject,rt,response,side,volume\n"
    told = draft(put(tmp_path / "t.csv", text + row.format(0) + row.format(1)))
    assert '0 = ""  # FILL IN: the button that jsPsych counts so, the first is 0: left' in told
    assert "detected" not in told


def test_a_column_that_may_be_the_condition_is_offered_and_not_taken(tmp_path: Path) -> None:
    text = "participant,side,level,response,plate,date\n" + "".join(
        f"{who},left,60,left,{plate},day {who}\n" for who in "AB" for plate in ("steel", "wood")
    )
    told = draft(put(tmp_path / "t.csv", text))
    assert '# condition = "plate"  # guess: delete the first # to compare steel, wood' in told
    assert told.count("\n# condition = ") == 1
    assert (
        '# Note: condition = "plate" compares steel, wood once its # is deleted; else all' in told
    )
    assert "condition" not in tomllib.loads(told)["columns"]


@pytest.mark.parametrize(
    ("more", "plates"),
    [("", ("steel", "wood")), ('condition = ""', None), ('condition = "plate"', None)],
)
def test_who_takes_no_condition_is_warned_of_those_there_may_be(
    tmp_path: Path, more: str, plates: tuple[str, str] | None
) -> None:
    text = "participant,side,level,response,plate,key\n" + "".join(
        f"{who},{side},60,{side},{plate},{side}\n"
        for who in "AB" for plate in ("steel", "wood") for side in ("left", "right")
    )  # fmt: skip
    table = put(tmp_path / "t.csv", text)
    named = f'[columns]\ntrial = ""\nlevel_vpp = "level"\n{more}\n'
    changed = read_inputs([table], load_column_map(put(tmp_path / "map.toml", named))).changed
    assert len(changed) == (plates is not None)
    if plates:
        assert changed[0].startswith("column plate (steel, wood) is no condition here")


@pytest.mark.parametrize("within", [True, False])
def test_beside_a_condition_those_that_vary_within_it_are_warned_of(
    tmp_path: Path, *, within: bool
) -> None:
    text = "participant,side,level,response,plate,grip\n" + "".join(
        f"{who},{side},60,{side},{plate},{grip if within else who + 'x'}\n"
        for who in "AB" for plate in ("steel", "wood") for side in ("left", "right")
        for grip in ("loose", "tight")
    )  # fmt: skip
    table = put(tmp_path / "t.csv", text)
    named = '[columns]\ntrial = ""\nlevel_vpp = "level"\ncondition = "plate"\n'
    changed = read_inputs([table], load_column_map(put(tmp_path / "map.toml", named))).changed
    told = (
        "column grip (loose, tight) varies within plate, which is the condition here: its trials "
        'are analysed together; one part of them is taken by [rows.keep] grip = "loose"'
    )
    assert changed == ((told,) if within else ())


def test_a_draft_says_which_rows_are_skipped_and_which_are_blanks(tmp_path: Path) -> None:
    target = tmp_path / "map.toml"
    table = EXAMPLES / "psychopy-trials.csv"
    told = run("columns", table, "--write", target).stdout.splitlines()
    skipped = "7 of 119 rows are skipped (4 with a level, 3 without), by [rows.skip]"
    assert told[0] == f'{skipped} "trials.thisN" = ""'
    assert told[1].startswith("32 rows have level 0: blanks, where the answer")
    text = target.read_text(encoding="utf-8")
    assert all(f"# Note: {line}\n" in text for line in told[:2])
    read = read_inputs([table], load_column_map(EXAMPLES / "psychopy-columns.toml"))
    assert read.left_out == 7
    assert read.trials["kind"].eq("blank").sum() == 32


def nested(folder: Path, *, blocks: int = 4, running: bool = False) -> Path:
    """Write files of PsychoPy's Builder with a loop of blocks, of two people; levels in um."""
    head = "practice.thisN,blocks.thisN,trials.thisN,level_um,key_resp.keys,key_resp.rt,participant"
    for person in ("01", "02"):
        rows = [f"{n},,,1.6,y,0.5,{person}" for n in range(3)]
        for block in range(blocks):
            rows += [
                f",{block},{n + 6 * block * running},{level},{'yn'[level < 0.4]},0.{5 + n},{person}"
                for n, level in enumerate((0.4, 0, 0.2, 1.6, 0.8, 0.1))
            ]
            rows.append(f",{block},,,,,{person}")
        put(folder / f"{person}.csv", "\n".join([head, *rows]) + "\n")
    return folder


def test_an_outer_loop_numbers_no_trials(tmp_path: Path) -> None:
    told = draft(nested(tmp_path / "a"))
    assert 'trial = ""  # numbered anew in each block: the order of rows is taken\n' in told
    guess = "guess: trials are numbered anew in each, so it tells their order"
    assert f'block = "blocks.thisN"  # {guess}\n' in told
    assert '"trials.thisN" = ""  # guess: outside this loop' in told
    told = draft(nested(tmp_path / "b", running=True))
    assert 'trial = "trials.thisN"  # guess; 24 values from 0 to 23\n' in told
    renamed = tmp_path / "c"
    for path in nested(tmp_path / "d").iterdir():
        put(renamed / path.name, path.read_text(encoding="utf-8").replace("trials.", "main."))
    assert '"main.thisN" = ""  # guess: outside this loop' in draft(renamed)


def test_a_draft_of_nested_loops_runs_as_it_is_filled_in(tmp_path: Path) -> None:
    words = {"task": "yes/no", "side": "left"}
    data = nested(tmp_path / "data")
    target = tmp_path / "map.toml"
    told = run("columns", data, "--write", target).stdout
    assert "; fill in task, side, then tactstrip analyze" in told
    with pytest.raises(ValueError, match=r"\[axis\] unit: printable text"):
        load_column_map(put(tmp_path / "v.toml", '[axis]\nunit = ""\n'))
    read = read_inputs([data], load_column_map(filled(data, tmp_path / "m.toml", words)))
    assert read.axis.unit == "um"
    assert read.trials["trial"].tolist() == [*range(1, 25)] * 2
    assert read.trials["block"].tolist() == [0] * 6 + [1] * 6 + [2] * 6 + [3] * 6 + [0] * 6 + [
        *[1] * 6, *[2] * 6, *[3] * 6
    ]  # fmt: skip
    again = 'trial = "trials.thisN"'
    text = (tmp_path / "m.toml").read_text(encoding="utf-8").replace('trial = ""', again)
    error = str(refused(data, columns=load_column_map(put(tmp_path / "n.toml", text))))
    assert 'numbered anew in each block, the map needs [columns] trial = ""' in error


def test_files_that_number_their_trials_anew_are_told_from_blocks(tmp_path: Path) -> None:
    rows = "".join(f"p,{n},60,left,left\n" for n in range(3))
    for name in ("1.csv", "2.csv"):
        put(tmp_path / name, f"participant,trial,volts,side,response\n{rows}")
    assert 'trial = ""  # numbered anew in each file: the order' in draft(tmp_path)


@pytest.mark.parametrize("name", ["volts", "Voltage", "level_vpp"])
def test_volts_are_peak_to_peak_only_where_their_name_says_so(tmp_path: Path, name: str) -> None:
    told = draft(put(tmp_path / "t.csv", f"participant,side,{name},response\nA,left,60,left\n"))
    assert ('unit = "V"  # guess; say peak or peak-to-peak if you know; printed' in told) == (
        name in ("volts", "Voltage")
    )


@pytest.mark.parametrize("name", ["side", "stim_side"])
@pytest.mark.parametrize("places", ["left right none", "left left none"])
def test_a_side_that_was_not_asked_for_is_left_out_and_the_draft_is_read(
    tmp_path: Path, name: str, places: str
) -> None:
    rows = "".join(
        f"{who},{place},{60 if place != 'none' else 0},{key}\n"
        for who in "AB"
        for place in places.split()
        for key in "yn"
    )
    table = put(tmp_path / "t.csv", f"participant,{name},intensity_um,key\n{rows}")
    told = draft(table).replace('task = ""', 'task = "yes/no"')
    columns = load_column_map(put(tmp_path / "map.toml", told))
    kinds = read_inputs([table], columns).trials["kind"]
    assert (kinds.eq("single").sum(), kinds.eq("blank").sum(), len(kinds)) == (8, 4, 12)


@pytest.mark.parametrize("name", ["driveVpp", "piezo_volts", "Amp left"])
def test_a_part_of_a_name_tells_the_level_of_a_few_numbers(tmp_path: Path, name: str) -> None:
    rows = "A,left,60,left\nA,right,80,right\n"
    told = draft(put(tmp_path / "t.csv", f"participant,side,{name},response\n{rows}"))
    assert f'level_vpp = "{name}"  # guess; 2 values: 60, 80' in told


@pytest.mark.parametrize(
    ("name", "unit"),
    [("amp_um", "um"), ("level_pct", "%"), ("amplitude (nm)", "nm")],
)
def test_the_unit_of_levels_is_guessed_by_the_name(tmp_path: Path, name: str, unit: str) -> None:
    table = put(tmp_path / "t.csv", f"participant,side,{name},response\nA,left,60,left\n")
    assert f'unit = "{unit}"  # guess, by the name; printed behind numbers' in draft(table)


def test_an_empty_cell_is_no_value(tmp_path: Path) -> None:
    rows = "".join(f"A,left,60,left,{0.2 + n / 100:.2f}\n" for n in range(20))
    text = "participant,side,volts,response,rt\n" + rows + "A,left,60,timeout,\n"
    told = draft(put(tmp_path / "t.csv", text))
    assert 'rt_s = "rt"  # guess; 20 values from 0.2 to 0.39; and empty cells\n' in told


CELLS = st.sampled_from(
    ["", "left", "1", "0", "60,5", "null", "practice", "a\tb", '"', "\x7f", "é"]
)


@pytest.mark.slow
@settings(
    deadline=None, max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(st.data())
def test_any_table_has_a_draft_that_is_a_map_or_names_what_it_lacks(
    tmp_path: Path, data: st.DataObject
) -> None:
    names = st.sampled_from(
        ["subject", "side", "level", "response", "rt", "correct", "k", "n", "trial_type",
         "time_elapsed", "trials.thisN", "p.thisN", 'a "b"', "x\ny", "volts"]
    )  # fmt: skip
    header = data.draw(st.lists(names, min_size=1, max_size=8, unique=True))
    rows = data.draw(st.lists(st.tuples(*[CELLS] * len(header)), min_size=1, max_size=6))
    path = tmp_path / "any.csv"
    with path.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows([header, *rows])
    if not any(any(row) for row in rows):
        assert "a header and no trials" in str(refused(path, columns=ColumnMap()))
        return
    text, blanks = map_draft(find_sources([path]).tables)
    assert tomllib.loads(text).keys() <= {*KEYS, *SECTIONS}
    with contextlib.suppress(ValueError) if blanks else contextlib.nullcontext():
        load_column_map(put(tmp_path / "m.toml", text))


def test_a_draft_says_what_blanks_and_both_sides_count_for(tmp_path: Path) -> None:
    rows = "A,left,60,left\nA,none,,none\nA,catch,,left\nA,both,80,both\n"
    told = draft(put(tmp_path / "t.csv", f"participant,side,driveVpp,response\n{rows}"))
    assert "# Note: 2 rows have side none: blanks\n" in told
    assert "# Note: 1 row has side both: in no threshold\n" in told
    silent = rows.replace("none,,", "none,0,").replace("catch,,", "catch,0.0,")
    told = draft(put(tmp_path / "u.csv", f"participant,side,driveVpp,response\n{silent}"))
    assert "# Note: the same rows have side none: blanks\n" in told
    more = silent + "A,none,60,none\n"
    told = draft(put(tmp_path / "v.csv", f"participant,side,driveVpp,response\n{more}"))
    assert "# Note: 3 rows have side none: blanks\n" in told
    assert "# its unit: V peak-to-peak, by the name; else state it, in [units]\n" in told


def test_several_files_are_drafted_as_one_map(tmp_path: Path) -> None:
    tables = [
        put(tmp_path / f"{who} 1.csv", f"participant,side,level_vpp,response\n{who},left,60,left\n")
        for who in "ab"
    ]
    target = tmp_path / "map.toml"
    done = run("columns", *tables, "--write", target)
    assert done.exit_code == 0, done.output
    assert "# A draft for a 1.csv and 1 more" in target.read_text()
    assert f"tactstrip analyze '{tables[0]}' '{tables[1]}' --columns" in done.output
    out = tmp_path / "out"
    done = run("analyze", *tables, "--columns", target, "--no-figures", "--out", out)
    assert done.exit_code == 0, done.output


def test_a_column_is_called_empty_only_of_the_rows_that_are_read(tmp_path: Path) -> None:
    rows = "practice.thisN,trials.thisN,level,notes\n0,,5,\n,0,9,\n,1,26,\n,2,5,\n"
    told, _ = map_draft(find_sources([put(tmp_path / "a.csv", rows)], foreign=True).tables)
    assert "#   practice.thisN: empty in the rows that are read\n" in told
    assert "#   notes: empty\n" in told
    assert "#   level: 3 values: 5, 9, 26\n" in told


def test_practice_within_the_loop_of_trials_is_skipped(tmp_path: Path) -> None:
    rows = "".join(
        f"{n},{phase},{noise},5,vibrodemo\n"
        for n, (phase, noise) in enumerate([("Practice", ""), ("main", "on"), ("main", "off")] * 4)
    )
    told = draft(put(tmp_path / "a.csv", f"trials.thisN,phase,noise,level,expName\n{rows}"))
    assert 'phase = ["Practice"]  # guess; there are: Practice, main\n' in told
    assert "expName = [" not in told  # all are of the demonstration: none is told apart
    assert '# condition = "noise"' in told
    assert '# condition = "phase"' not in told


def in_db(*, signal: bool) -> str:
    """Return a table of two people with levels in dB, none of them in blank trials."""
    rows = [f"{who},{grip},{level},{n % 2},{'yn'[n % 3 > 0]}" for who in "ab" for n in range(3)
            for grip in ("loose", "tight") for level in ("-12", "0", "")]  # fmt: skip
    if signal:
        rows = [f"{one},{int(',,' not in one)}" for one in rows]
    return "\n".join([f"participant,grip,level_dB,n,key{',signal' * signal}", *rows]) + "\n"


@pytest.mark.parametrize(("signal", "empty"), [(True, ""), (False, ""), (False, "NA")])
def test_levels_in_db_are_drafted_and_blanks_are_rows_without(
    tmp_path: Path, empty: str, *, signal: bool
) -> None:
    table = put(tmp_path / "a.csv", in_db(signal=signal).replace(",,", f",{empty},"))
    told = draft(table)
    assert f'"{empty}" = "-inf"'.replace('"NA"', "NA") in told
    assert "# Note: 12 rows without a level are blanks\n" in told
    assert 'x_scale = "dB"  # guess, by the name: 0 is a level\nunit = "dB"' in told
    assert "level 0" not in told
    assert '# condition = "signal"' not in told
    told = told.replace('side = ""', 'side = "left"')
    text = told.replace('task = ""', 'task = "yes/no"').replace(
        '# condition = "g', 'condition = "g'
    )
    read = read_inputs([table], load_column_map(put(tmp_path / "m.toml", text)))
    assert read.trials["kind"].eq("blank").sum() == 12
    assert sorted({*read.trials["level_vpp"].dropna()}) == [-12.0, 0.0]


def test_other_levels_are_0_where_they_are_empty(tmp_path: Path) -> None:
    text = (
        in_db(signal=False)
        .replace("level_dB", "level_um")
        .replace("-12", "5")
        .replace(",0,", ",9,")
    )
    table = put(tmp_path / "a.csv", text)
    told = draft(table)
    assert '[values.level_vpp]\n"" = "0"  # guess: 12 rows without a level are blanks\n' in told
    told = told.replace('task = ""', 'task = "yes/no"').replace('side = ""', 'side = "left"')
    read = read_inputs([table], load_column_map(put(tmp_path / "m.toml", told)))
    assert read.trials["kind"].eq("blank").sum() == 12


def test_keys_are_the_sides_at_which_they_are_right(tmp_path: Path) -> None:
    rows = [("L", "0.5", "f", "f"), ("R", "0.5", "j", "n"), ("-", "0", "n", "n"),
            ("L", "0.2", "f", "j"), ("R", "0.2", "j", "None")]  # fmt: skip
    head = "participant,loc,drive,corrAns,key_resp.keys\n"
    told = draft(
        put(tmp_path / "a.csv", head + "".join(f"1,{','.join(row)}\n" for row in rows * 2))
    )
    assert 'level_vpp = "drive"  # guess' in told
    for line in ('- = "none"  # guess', 'f = "left"  # guess', 'j = "right"  # guess',
                 'n = "none"  # guess'):  # fmt: skip
        assert f"\n{line}\n" in told, line
    felt = [(loc, "0.1" if loc == "-" else um, right, key) for loc, um, right, key in rows]
    told = draft(
        put(tmp_path / "b.csv", head + "".join(f"1,{','.join(row)}\n" for row in felt * 2))
    )
    assert '\n- = ""  # FILL IN' in told  # a place of stimuli: nobody knows which
    assert '\nn = ""  # FILL IN' in told


@pytest.mark.parametrize("keys", [("up", "down"), ("1", "2"), ("z", "m")])
def test_keys_of_a_single_place_are_no_sides(tmp_path: Path, keys: tuple[str, str]) -> None:
    rows = [f"p1,left,{um},{right},{key}" for um in (10, 20, 40) for right in keys for key in keys]
    head = "participant,finger,intensity,corrAns,key\n"
    told = draft(put(tmp_path / "a.csv", head + "\n".join(rows) + "\n"))
    assert all(f'\n{key} = ""  # FILL IN' in told for key in keys)


def test_rows_without_a_level_and_without_an_answer_are_no_blanks(tmp_path: Path) -> None:
    rows = ["10,0", "20,1", "40,1", ",", "10,0", "20,0", "40,1", ","]
    head = "subject,trial,level,felt\n"
    text = head + "".join(f"p1,{n},{row}\n" for n, row in enumerate(rows, 1))
    told = draft(put(tmp_path / "a.csv", text))
    assert 'level = [""]  # guess: 2 rows without a level and without an answer' in told
    assert "# Note: 2 of 8 rows are skipped" in told
    assert "blanks" not in told
    some = draft(put(tmp_path / "b.csv", text.replace("p1,8,,", "p1,8,,1")))
    assert "blanks" not in some  # of a fixation and a blank nobody knows which is which
    assert "\n[rows.skip]" not in some
    blanks = draft(put(tmp_path / "c.csv", text.replace(",,", ",,0")))
    assert '"" = "0"  # guess: 2 rows without a level are blanks' in blanks
    assert "# Note: 2 rows without a level are blanks\n" in blanks


@pytest.mark.parametrize(
    ("head", "words", "skipped"),
    [
        ("kind", ("train", "single"), None),  # of pulses
        ("condition", ("baseline", "post_training"), None),
        ("phase", ("Practice", "main", "main"), '["Practice"]'),
        ("part", ("training_1", "test", "test"), '["training_1"]'),
        ("is_practice", ("true", "false", "false"), '["true"]'),
        ("is_practice", ("0", "1", "0"), '["1"]'),
    ],
)
def test_practice_is_skipped_and_no_condition(
    tmp_path: Path, head: str, words: tuple[str, ...], skipped: str | None
) -> None:
    rows = [f"{who},{word},{level},y" for who in ("Ann", "Pract") for level in (5, 9) * 3
            for word in words]  # fmt: skip
    told = draft(
        put(tmp_path / "a.csv", f"participant,{head},level,key\n" + "\n".join(rows) + "\n")
    )
    assert (f"{head} = {skipped}  # guess; there are" in told) is (skipped is not None)
    assert ("[rows.skip]" in told) is (skipped is not None)


@pytest.mark.parametrize(
    ("columns", "level"),
    [("drive,volts", "volts"), ("drive,x", "drive"), ("x,dB", "dB"), ("dB SL,x", "dB SL")],
)
def test_levels_are_found_under_these_names(tmp_path: Path, columns: str, level: str) -> None:
    rows = "".join(f"p1,{n % 2 + 1},{n % 3 + 3},{n % 2}\n" for n in range(12))
    told = draft(put(tmp_path / "a.csv", f"subject,{columns},felt\n{rows}"))
    assert f'level_vpp = "{level}"  # guess' in told


def test_an_empty_level_is_not_0_where_that_is_a_level(tmp_path: Path) -> None:
    table = put(tmp_path / "a.csv", "participant,intensity,detected\np,0,1\np,,0\np,10,1\n")
    named = (
        'task = "yes/no"\n[columns]\nlevel_vpp = "intensity"\n[constant]\nside = "left"\n'
        '[values.level_vpp]\n"" = "0"\n[axis]\nx_scale = "dB"\nunit = "dB SL"\n'
    )
    error = refused(table, columns=load_column_map(put(tmp_path / "m.toml", named)))
    assert '"" = "0": 0 is a level where x_scale = "dB"; "" = "-inf" makes blanks' in str(error)


def test_what_says_the_stimulus_or_the_answer_again_is_no_factor(tmp_path: Path) -> None:
    rows = [
        f"{who},{grip},{level},{key},{'blank' if level == '0' else 'stimulus'},vib_{level}.wav,"
        f"{'hit' if key == 'left' else 'miss'}"
        for who in "AB" for grip in ("loose", "tight") for level in ("0", "5", "9") for key in
        ("left", "none") * 2
    ]  # fmt: skip
    head = "participant,condition,level,response,stim_type,soundfile,sdt,side\n"
    table = put(tmp_path / "a.csv", head + "".join(f"{row},left\n" for row in rows))
    named = load_column_map(put(tmp_path / "m.toml", '[columns]\nlevel_vpp = "level"\n'))
    assert read_inputs([table], named).changed == ()


def go_no_go(cells: str) -> str:
    """Return a table of one person who pressed a key at the higher level only."""
    head = "participant,amp_um,finger,key_resp.keys\n"
    shown = [("0", "none"), ("0.4", "left"), ("3.4", "right"), ("3.4", "left"), ("0.4", "right")]
    rows = [f"1,{level},{side},{'space' if level == '3.4' else cells}" for level, side in shown]
    return head + "\n".join(rows) + "\n"


@pytest.mark.parametrize("no_key", ["None", ""])
def test_a_single_key_is_drafted_as_felt_and_no_key_as_not_felt(
    tmp_path: Path, no_key: str
) -> None:
    table = put(tmp_path / "t.csv", go_no_go(no_key))
    text, blanks = map_draft(find_sources([table], foreign=True).tables)
    assert blanks == []
    told = tomllib.loads(text)
    assert told["task"] == "yes/no"
    assert told["columns"]["detected"] == "key_resp.keys"
    assert told["values"]["detected"] == {no_key: "0", "space": "1"}
    read = read_inputs([table], load_column_map(put(tmp_path / "m.toml", text))).trials
    assert read["response"].tolist().count("none") == 3
    assert "timeout" not in read["response"].tolist()


@pytest.mark.parametrize("word", ["left", "no", "n"])
def test_a_single_word_that_says_more_than_felt_is_no_go_key(tmp_path: Path, word: str) -> None:
    table = put(tmp_path / "t.csv", go_no_go("None").replace("space", word))
    text, _ = map_draft(find_sources([table], foreign=True).tables)
    assert "the only key" not in text


def localised(heading: str = "target") -> str:
    """Return a table of one person who names the finger, under a heading that is no known one."""
    shown = [("0", "none"), ("4", "left"), ("9", "right"), ("9", "left"), ("4", "right")]
    rows = [f"1,{level},{side},{'down' if level == '0' else side}" for level, side in shown]
    return f"participant,amp_um,{heading},key_resp.keys\n" + "\n".join(rows) + "\n"


@pytest.mark.parametrize("heading", ["target", "corrAns", "where"])
def test_a_column_that_says_left_and_right_is_the_side_whatever_it_is_called(
    tmp_path: Path, heading: str
) -> None:
    table = put(tmp_path / "t.csv", localised(heading))
    text, blanks = map_draft(find_sources([table], foreign=True).tables)
    assert blanks == ["down"]
    told = tomllib.loads(text)
    assert told["columns"]["side"] == heading
    assert told["columns"]["response"] == "key_resp.keys"
    assert f'condition = "{heading}"' not in text
    both = put(tmp_path / "two.csv", localised().replace("amp_um", "corrAns,amp_um", 1).replace(
        "1,", "1,left,").replace("1,left,9,right", "1,right,9,right"))  # fmt: skip
    assert tomllib.loads(map_draft(find_sources([both], foreign=True).tables)[0])["columns"][
        "side"
    ] == "target"  # fmt: skip


def test_one_place_for_all_is_refused_where_a_column_and_the_answers_tell_two(
    tmp_path: Path,
) -> None:
    table = put(tmp_path / "t.csv", localised())
    one = (
        '[columns]\nlevel_vpp = "amp_um"\nresponse = "key_resp.keys"\n'
        '[values.response]\ndown = "none"\n[constant]\nside = "left"\n[axis]\nunit = "um"\n'
    )
    said = str(refused(table, columns=load_column_map(put(tmp_path / "map.toml", one))))
    assert "column target says none, left, right, and answers name left and right" in said
    assert '[columns] side = "target" in its stead; if only "felt" was asked' in said
    keys = one.replace('down = "none"', 'down = "none"\nleft = "none"\nright = "left"')
    read_inputs([table], load_column_map(put(tmp_path / "keys.toml", keys)))  # yes/no by arrows


@pytest.mark.parametrize(
    ("head", "cells", "side"),
    [
        ("handedness,corrAns", "{hand},{side}", "corrAns"),
        ("handedness,transducer", "{hand},{side}", "transducer"),
        ("button_pressed,where", "{side},{side}", "where"),
        ("emplacement", "{side}", "emplacement"),
        ("one,other", "{side},{side}", None),
        ("handedness", "{hand}", None),
    ],
)
def test_a_handedness_or_an_answer_is_no_side(
    tmp_path: Path, head: str, cells: str, side: str | None
) -> None:
    rows = [
        f"{who},{level}," + cells.format(hand=hand, side=where) + ",down"
        for who, hand in (("1", "left"), ("2", "right"), ("3", "right"))
        for level, where in (("0", "aucunes"), ("4", "left"), ("9", "right"), ("9", "left"))
    ]
    table = put(tmp_path / "t.csv", f"participant,level,{head},key\n" + "\n".join(rows) + "\n")
    told = tomllib.loads(map_draft(find_sources([table], foreign=True).tables)[0])
    assert told["columns"].get("side") == side


def test_a_handedness_beside_a_finger_is_no_side(tmp_path: Path) -> None:
    rows = [f"{who},{hand},{um},{finger},{finger}" for who, hand in (("1", "left"), ("2", "right"))
            for um, finger in (("5", "left"), ("9", "right"), ("9", "left"))]  # fmt: skip
    text = "participant,hand,level,finger,key\n" + "\n".join(rows) + "\n"
    assert 'side = "finger"  # guess' in draft(put(tmp_path / "t.csv", text))


def test_a_single_column_of_few_numbers_in_a_unit_is_the_level(tmp_path: Path) -> None:
    table = put(tmp_path / "t.csv", localised().replace("amp_um", "load_pct", 1))
    told = tomllib.loads(map_draft(find_sources([table], foreign=True).tables)[0])
    assert (told["columns"]["level_vpp"], told["axis"]["unit"]) == ("load_pct", "%")
    two = localised().replace("amp_um", "load_pct,gap_um", 1)
    for level in "049":
        two = two.replace(f"1,{level},", f"1,{level},{level}1,")
    told = tomllib.loads(map_draft(find_sources([put(table, two)], foreign=True).tables)[0])
    assert told["columns"]["level_vpp"] == ""


def begun_again(folder: Path, *, people: int = 4) -> Path:
    """Write a file for each person, and one more of the last, who broke off after two trials."""
    head = "participant,session,trials.thisN,level_um,side,key_resp.keys,skin"
    rows = [
        f"{n},{level},{side},{side},{'dry' if n < 4 else 'moist'}"
        for n, (level, side) in enumerate(product((0.5, 1, 2, 4), ("left", "right")))
    ]
    for person in range(people):
        for name, number in (("b", 8), ("a", 2))[: 1 + (person == people - 1)]:
            own = "\n".join(f"p{person},001,{row}" for row in rows[:number])
            put(folder / f"p{person}_{name}.csv", f"{head}\n{own}\n")
    return folder


def test_a_run_begun_anew_is_named_and_pooled_with_no_other(tmp_path: Path) -> None:
    data = begun_again(tmp_path / "data")
    told = draft(data)
    both = "several files have the same session and trial numbers, p3, 001: p3_a (2 rows) and p3_b "
    assert f"{NOTE}{both}(8 rows): if a run was broken off and begun anew, delete the # " in told
    assert '\n# file- = "p3_a"  # several files' in told
    assert 'trial = "trials.thisN"' in told
    words = told.replace('down = ""', 'down = "none"')
    columns = load_column_map(put(tmp_path / "as-drafted.toml", words))
    error = str(refused(data, columns=columns))
    assert "p3_b.csv:2: participant p3, session 001, trial 1, attempt 1: the same" in error
    assert 'leave it out, such as [rows.skip] file- = "p3_a"; where both count, the map n' in error
    for change, rows, warned in (
        (("# file-", "file-"), 32, 0),
        (("# session: ", 'session = "file-"  # '), 34, 0),
        (('trial = "trials.thisN"', 'trial = ""'), 34, 1),
    ):
        text = words.replace(*change)
        read = read_inputs([data], load_column_map(put(tmp_path / "changed.toml", text)))
        assert len(read.trials) == rows
        pooled = [
            one
            for one in read.changed
            if one.startswith("one session is in several files, p3, 001: p3_a (2 rows) and ")
        ]
        assert len(pooled) == warned
        assert read.numbered is not bool(warned)


def test_two_persons_begin_anew(tmp_path: Path) -> None:
    data = begun_again(tmp_path / "data")
    put(data / "p0_c.csv", (data / "p3_a.csv").read_text(encoding="utf-8").replace("p3", "p0"))
    assert '\n# file- = ["p0_c", "p3_a"]  # several files' in draft(data)


def test_the_order_of_rows_is_that_of_conditions_within_a_file_only(tmp_path: Path) -> None:
    data = begun_again(tmp_path / "data", people=2)
    (data / "p1_a.csv").unlink()
    text = draft(data).replace('trial = "trials.thisN"', 'trial = ""')
    columns = load_column_map(put(tmp_path / "map.toml", text))
    assert read_inputs([data], columns).numbered
    for path in [*data.iterdir()]:
        head, *rows = path.read_text(encoding="utf-8").splitlines()
        for skin in ("dry", "moist"):
            own = [row for row in rows if row.endswith(skin)]
            put(path.with_name(f"{path.stem}{skin}.csv"), "\n".join([head, *own]) + "\n")
        path.unlink()
    assert not read_inputs([data], columns).numbered


def two_frequencies(folder: Path, keys: tuple[str, str, str], *, told: bool = True) -> Path:
    """Write a table of four people, two frequencies in random order, and which key was right."""
    rng = random.Random(3)
    key = dict(zip(("left", "right", "none"), keys, strict=True))
    shown = [
        (hz, side, level) for hz in (60, 200) for side in ("left", "right") for level in (1, 2, 4)
    ]
    shown += [(hz, "none", 0) for hz in (60, 200)]
    head = "participant,gender,trials.thisN,finger,level_um,freq,resp.keys,resp.corr"
    rows = []
    for person in range(4):
        order = [one for _ in range(8) for one in rng.sample(shown, len(shown))]
        for n, (hz, side, level) in enumerate(order):
            said = side if rng.random() < level / 4 else "none"
            right = f",{key[side]}" * told
            row = (
                f"{person},{'mf'[person % 2]},{n},{side},{level},{hz},{key[said]},{said == side:d}"
            )
            rows.append(row + right)
    return put(folder / "t.csv", "\n".join([head + ",correctAns" * told, *rows]) + "\n")


def test_a_frequency_in_random_order_is_offered_and_a_gender_is_not(tmp_path: Path) -> None:
    told = draft(two_frequencies(tmp_path, ("a", "l", "space")))
    assert '\n# condition = "freq"  # guess: delete the first # to compare 60, 200\n' in told
    assert "gender compares" not in told
    assert 'condition = "gender"' not in told


@pytest.mark.parametrize(
    ("keys", "told", "guessed"),
    [
        (("a", "l", "space"), True, ("left", "right", "none")),
        (("l", "r", "space"), True, ("left", "right", "none")),
        (("r", "l", "space"), True, ("left", "right", "none")),  # whatever their names
        (("right", "left", "down"), True, ("left", "right", "none")),
        (("l", "r", "space"), False, ("left", "right", "")),
        (("a", "l", "space"), False, ("", "", "")),
    ],
)
def test_a_key_is_the_side_where_it_is_right_whatever_its_name(
    tmp_path: Path, keys: tuple[str, str, str], *, told: bool, guessed: tuple[str, str, str]
) -> None:
    text = draft(two_frequencies(tmp_path, keys, told=told))
    for key, side in zip(keys, guessed, strict=True):
        line = "" if key == side else f'\n{key} = "{side}"  # {"guess" if side else "FILL IN"}'
        assert line in text


YES_NO: tuple[tuple[str, ...], ...] = (
    # column of answers, yes, no, column of right and wrong
    ("resp.keys", "1", "2", "resp.corr"),
    ("Stim.RESP", "0", "1", "Stim.ACC"),
    ("said", "ja", "nein", "correct"),
    ("key", "left", "right", "accuracy"),
    ("response", "ArrowRight", "ArrowLeft", "correct"),
)


def yes_no(folder: Path, keys: tuple[str, ...], *, extra: str = "", rights: bool = True) -> Path:
    """Write a yes/no table of three people with blanks at level 0, and which answers were right."""
    rng, (name, yes, no, right) = random.Random(5), keys
    rows = []
    for person in range(3):
        levels = rng.sample([0] * 30 + [1, 2, 4, 8, 16] * 12, 90)
        for n, level in enumerate(levels):
            felt = rng.random() < (level / 16 if level else 0.05)
            row = f"{person},{n},{level},{yes if felt else no}"
            rows.append(row + f",{int(felt is (level > 0))}" * rights)
    head = f"participant,trial,level,{name}" + f",{right}" * rights
    return put(folder / "t.csv", "\n".join([head, *rows]) + "\n" + extra)


@pytest.mark.parametrize("keys", YES_NO)
def test_a_right_no_to_a_blank_is_nothing_felt(tmp_path: Path, keys: tuple[str, ...]) -> None:
    text = draft(yes_no(tmp_path, keys))
    name, yes, no, _ = keys
    assert f'detected = "{name}"  # guess' in text
    for key, felt in ((yes, "1"), (no, "0")):
        assert (f'{key} = "{felt}"  # guess\n' in text) is (key != felt)
    filled_in = text.replace('task = ""', 'task = "yes/no"').replace('side = ""', 'side = "left"')
    columns = load_column_map(
        put(tmp_path / "m.toml", filled_in.replace('unit = ""', 'unit = "um"'))
    )
    trials = read_inputs([tmp_path / "t.csv"], columns).trials
    blank = trials[trials["kind"].eq("blank")]
    assert len(blank) == 90
    assert blank["response"].ne("none").sum() < 12


def test_without_a_column_of_answers_right_and_wrong_is_not_taken_for_it(tmp_path: Path) -> None:
    table = yes_no(tmp_path, YES_NO[0])
    lines = table.read_text(encoding="utf-8").splitlines()
    rows = [",".join([*line.split(",")[:3], line.split(",")[4]]) for line in lines]
    text = draft(put(tmp_path / "t.csv", "\n".join(rows) + "\n"))
    told = (
        "FILL IN: the column of the answer; resp.corr is 1 for most blanks: right answers, it "
        "seems, not felt"
    )
    assert f'response = ""  # {told}\n' in text
    columns = put(
        tmp_path / "m.toml",
        'task = "yes/no"\n[columns]\nlevel_vpp = "level"\ndetected = "resp.corr"\n'
        '[constant]\nside = "left"\n[axis]\nunit = "um"\n',
    )
    read = read_inputs([table], load_column_map(columns))
    (warned,) = (one for one in read.changed if "right and wrong" in one)
    assert re.match(
        r"in 9\d% of 90 blank trials something was felt: if that is a column of right", warned
    )


def test_an_arrow_is_no_side_where_no_column_has_sides(tmp_path: Path) -> None:
    text = draft(yes_no(tmp_path, ("response", "ArrowRight", "ArrowLeft", ""), rights=False))
    assert 'ArrowRight = ""  # FILL IN' in text
    assert 'ArrowLeft = ""  # FILL IN' in text


@pytest.mark.parametrize(
    ("names", "rows", "level"),
    [
        ("level,amp_um", [(0, 0), (1, 0.5), (2, 2), (3, 8)], "amp_um"),  # steps beside a unit
        ("level,amp_um", [(0, 8), (1, 0.5), (2, 2), (3, 0)], "level"),  # no steps of it
        ("gain,stim_V", [(20, 0), (20, 1), (20, 2), (20, 4)], "stim_V"),  # a constant
        ("strength,vib_um", [(3, 0), (5, 1), (9, 2), (7, 4)], "vib_um"),  # of a grip
        ("masker_intensity,target_intensity", [(0, 0), (0, 1), (20, 0), (20, 1)],
         "target_intensity"),
        ("level,intensity", [("easy", 0), ("hard", 1), ("easy", 2), ("hard", 4)], "intensity"),
    ],
)  # fmt: skip
def test_the_level_is_what_varies_in_a_unit(
    tmp_path: Path, names: str, rows: list[tuple[object, float]], level: str
) -> None:
    cells = "".join(f"p,{n},{a},{b},yes\n" for n, (a, b) in enumerate(rows * 4))
    text = draft(put(tmp_path / "t.csv", f"participant,trial,{names},felt\n{cells}"))
    taken = re.findall(r'^(?:level_vpp = "(.+?)"|# (level_vpp): taken)', text, re.MULTILINE)
    assert [one or other for one, other in taken] == [level]


@pytest.mark.parametrize(
    "heading",
    ["subNo", "Participant No.", "VpNr", "Participant Private ID", "Prolific_ID", "Vp-Code"],
)
def test_participants_have_many_names(tmp_path: Path, heading: str) -> None:
    rows = "".join(f"{who},{n},{n},yes\n" for who in ("a", "b") for n in range(3))
    text = draft(put(tmp_path / "t.csv", f"{heading},trial,level,felt\n{rows}"))
    assert f'participant = "{heading}"  # guess; 2 values: a, b\n' in text


@pytest.mark.parametrize(
    ("column", "practice", "trial"),
    [
        ("Procedure", "PracProc", "TrialProc"),
        ("Phase", "Übung", "Test"),
        ("phase", "entraînement", "essai"),
        ("phase", "familiarisation", "main"),
        ("isPracticeTrial", "True", "False"),
    ],
)
def test_practice_has_many_names(tmp_path: Path, column: str, practice: str, trial: str) -> None:
    rows = "".join(f"p,{n},{n % 5},{practice if n < 3 else trial},yes\n" for n in range(12))
    text = draft(put(tmp_path / "t.csv", f"participant,trial,level,{column},felt\n{rows}"))
    assert f'[rows.skip]\n{column} = ["{practice}"]  # guess' in text


def test_frequencies_with_levels_of_their_own_are_offered(tmp_path: Path) -> None:
    shown = [(30, level) for level in (20, 40, 80)] + [(250, level) for level in (2, 4, 8)]
    order = random.Random(1).sample(shown * 8, len(shown) * 8)
    rows = "".join(f"p{n % 2},{n},{hz},{level},yes\n" for n, (hz, level) in enumerate(order))
    text = draft(put(tmp_path / "t.csv", f"participant,trial,freq,level,felt\n{rows}"))
    assert '# condition = "freq"  # guess: delete the first # to compare ' in text


def test_sessions_called_pre_and_post_and_two_hands_are_offered(tmp_path: Path) -> None:
    rows = "".join(
        f"p{who},{session},{hand},{n},{n % 4},{'ny'[n % 4 > 1]}\n"
        for who in range(3)
        for session in ("pre", "post")
        for hand in ("left", "right")
        for n in range(12)
    )
    text = draft(put(tmp_path / "t.csv", f"participant,session,hand,trial,level,felt\n{rows}"))
    assert '# condition = "session"  # guess: delete the first # to compare pre, post\n' in text
    assert '# condition = "hand"  # guess: delete the first # to compare left, right\n' in text


@pytest.mark.parametrize(
    ("column", "blank", "stimulus"),
    [("catch", "1", "0"), ("stim_present", "0", "1"), ("trial_kind", "absent", "present")],
)
def test_blanks_that_have_a_level_are_told_by_their_column(
    tmp_path: Path, column: str, blank: str, stimulus: str
) -> None:
    rows = "".join(
        f"p,{n},{1 + n % 3},{blank if n % 4 == 0 else stimulus},{'no' if n % 4 == 0 else 'yes'}\n"
        for n in range(24)
    )
    table = put(tmp_path / "t.csv", f"participant,trial,level,{column},felt\n{rows}")
    note = (
        f'if it does, [columns] side = "{column}", instead of any other side, with [values.side] '
        f'{blank} = "none" and {stimulus} = "left"; their levels are not read then'
    )
    assert note in draft(table)
    columns = put(
        tmp_path / "m.toml",
        f'task = "yes/no"\n[columns]\nlevel_vpp = "level"\ndetected = "felt"\nside = "{column}"\n'
        f'[values.detected]\nyes = "1"\nno = "0"\n[values.side]\n{blank} = "none"\n'
        f'{stimulus} = "left"\n[axis]\nunit = "um"\n',
    )
    trials = read_inputs([table], load_column_map(columns)).trials
    assert trials["kind"].eq("blank").sum() == 6
    assert trials.loc[trials["kind"].eq("blank"), "level_vpp"].isna().all()


def test_a_column_correct_of_ones_and_a_time_of_minus_one_are_left_out(tmp_path: Path) -> None:
    rows = "".join(
        f"p,{n},{n % 3},left,{key},{int(key == 'left')},{-1 if n == 3 else 0.5}\n"
        for n, key in enumerate(["left", "right"] * 6)
    )
    text = draft(
        put(tmp_path / "t.csv", f"participant,trial,level,side,response,correct,rt\n{rows}")
    )
    assert (
        'correct = ""  # has our name and other values than true or false, such as 1: left out'
        in text
    )
    assert '-1 = "n/a"  # guess' in text


def test_two_loops_of_trials_are_said_to_be_two(tmp_path: Path) -> None:
    head = "participant,still.thisN,moving.thisN,level,resp.keys"
    rows = [f"p,{n},,{n % 4},y" for n in range(8)] + [f"p,,{n},{n % 4},n" for n in range(8)]
    text = draft(put(tmp_path / "t.csv", "\n".join([head, *rows]) + "\n"))
    assert "; others hold trials, too: skip rows that are none by another column" in text
    one = [f"p,{n},{n // 4},{n % 4},y" for n in range(8)]  # of one in the other
    text = draft(put(tmp_path / "o.csv", "\n".join([head, *one]) + "\n"))
    assert "others hold trials" not in text


def test_a_column_that_tells_blanks_is_no_answer_however_easy_the_task(tmp_path: Path) -> None:
    rows = "".join(
        f"p,{n},{(0, 4, 8)[n % 3]},{int(n % 3 > 0)},{'ba'[felt]},{int(felt is (n % 3 > 0))}\n"
        for n in range(60)
        for felt in [n % 3 > 0 if n % 20 else n % 3 == 0]
    )
    text = draft(put(tmp_path / "t.csv", f"participant,trial,level,shown,pressed,correct\n{rows}"))
    assert 'detected = "pressed"  # guess' in text
    assert 'a = "1"  # guess' in text


def test_one_person_who_broke_off_makes_no_handedness_of_the_side(tmp_path: Path) -> None:
    rows = [
        f"{who},{n},{side},{n % 3},{side}"
        for who in range(5)
        for n, side in enumerate(("left", "right") * 6)
        if who or n in (0, 2, 4)
    ]
    head = "participant,trial,side,level,response"
    text = draft(put(tmp_path / "t.csv", "\n".join([head, *rows]) + "\n"))
    assert "# side: taken as it is; 2 values: left, right" in text


def test_files_are_people_where_no_column_tells_them(tmp_path: Path) -> None:
    for who in range(4):
        rows = "".join(
            f"{n},{('left', 'right')[who % 2]},{('yes', 'no')[who < 2]},{n % 4},{'ny'[n % 4 > 1]}\n"
            for n in range(12)
        )
        put(tmp_path / f"{who}.csv", f"trial,hand,training,level,felt\n{rows}")
    text = draft(tmp_path)
    assert 'side = "hand"' not in text  # a handedness
    assert "\n[rows.skip]" not in text  # who was trained is no practice


def test_no_key_is_nothing_felt_beside_what_was_right_too(tmp_path: Path) -> None:
    rows = "".join(f"p,{n},{n % 3},{'space' if n % 3 else 'None'},1\n" for n in range(30))
    text = draft(put(tmp_path / "t.csv", f"participant,trial,level,key_resp.keys,correct\n{rows}"))
    assert 'detected = "key_resp.keys"  # guess' in text
    assert 'None = "0"  # guess' in text


def test_right_and_wrong_of_blanks_with_a_level_is_told_too(tmp_path: Path) -> None:
    rows = "".join(
        f"p,{n},{1 + n % 3},{('signal', 'catch')[n % 2]},{'fj'[n % 2]},1\n" for n in range(30)
    )
    text = draft(put(tmp_path / "t.csv", f"participant,trial,level,trial_type,key,correct\n{rows}"))
    assert 'detected = "key"  # guess' in text
    assert 'f = "1"  # guess' in text


def test_excels_first_line_is_no_heading(tmp_path: Path) -> None:
    table = put(tmp_path / "t.csv", "sep=;\nperson;trial;level;felt\na;1;2;yes\n")
    error = str(refused(table, columns=ColumnMap()))
    assert error.endswith("t.csv:1: this is Excel's note of the separator, no header: delete it")
    done = run("columns", table)
    assert done.exit_code == 2
    assert "t.csv:1: this is Excel's note of the separator" in done.stderr


def test_answers_with_the_other_side_are_counted_where_keys_name_sides(tmp_path: Path) -> None:
    rows = "a,left,60,left\na,right,60,left\na,left,80,right\na,right,80,none\na,none,0,left\n"
    told = draft(put(tmp_path / "t.csv", f"participant,side,amp,response\n{rows}"))
    assert "# Note: 2 rows have the other side for an answer: not detected, which" in told
    told = draft(put(tmp_path / "u.csv", f"participant,side,amp,response\n{rows[:15]}"))
    assert "the other side" not in told
