"""Blanks of tables made elsewhere, from `columns` over what it asks for to `analyze`."""

from __future__ import annotations

import csv
import re
from typing import TYPE_CHECKING

import pytest

from tests.test_analysis.shared import put, run

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

SAID = {"1": "yes", "0": "no"}
LEVELS = ("-30", "-24", "-18", "-12", "-6")


def felt(level: str, n: int) -> str:
    """Answer higher levels more often, of ten trials each; one blank in ten is a false alarm."""
    return SAID["1" if n < 2 * LEVELS.index(level) + 1 else "0"] if level in LEVELS else SAID[
        "1" if n == 0 else "0"
    ]  # fmt: skip


def one_place(silent: str, levels: Iterable[str] = LEVELS, name: str = "amp_db") -> str:
    shown = {**dict(zip(LEVELS, levels, strict=True)), "": silent}
    rows = [f"{who},{cond},{shown[at]},{felt(at, n)},0.{400 + n}"
            for who in "123" for cond in "AB" for at in shown for n in range(10)]  # fmt: skip
    return "\n".join([f"subject,cond,{name},ans,rt", *rows]) + "\n"


def two_places(silent: str) -> str:
    """Let every row name a place, as where it is drawn before the level is."""
    rows = []
    for who in "123":
        for at in (*LEVELS, silent):
            for n in range(20):
                place = "LR"[n % 2]
                said = {"yes": place, "no": "none"}[felt(at, n // 2)]
                rows.append(f"{who},{place},{at},{said},0.{400 + n}")
    return "\n".join(["subject,side,amp_db,ans,rt", *rows]) + "\n"


def drafted(folder: Path, table: str, **told: str) -> str:
    """Draft the map by the command, and fill in what it asks for; keys that are told are put in."""
    put(folder / "t.csv", table)
    assert run("columns", folder / "t.csv", "--write", folder / "draft.toml").exit_code == 0
    text = (folder / "draft.toml").read_text(encoding="utf-8")
    for key, word in told.items():
        assert f'{key} = ""  # FILL IN' in text
        text = text.replace(f'{key} = ""  # FILL IN', f'{key} = "{word}"  # FILL IN')
    assert '= ""  # FILL IN' not in text
    return text


def false_alarms(folder: Path, text: str) -> dict[str, int]:
    """Analyse by a map; return false alarms and how many blanks there are."""
    columns = put(folder / "map.toml", text)
    done = run("analyze", folder / "t.csv", "--columns", columns, "--out", folder / "o",
               "--no-figures")  # fmt: skip
    assert done.exit_code == 0, done.stderr
    with (folder / "o" / "trials_clean.csv").open(encoding="utf-8", newline="") as stream:
        blanks = [one["response"] for one in csv.DictReader(stream) if one["kind"] == "blank"]
    return {
        "felt": sum(said not in {"none", "not_felt"} for said in blanks),
        "presented": len(blanks),
    }


@pytest.mark.parametrize("silent", ["-inf", "-Inf", "", "NA"])
def test_blanks_of_one_place_are_drafted_by_their_level(tmp_path: Path, silent: str) -> None:
    text = drafted(tmp_path, one_place(silent), task="yes/no", side="left")
    assert "# Note: 60 row" in text
    assert false_alarms(tmp_path, text) == {"felt": 6, "presented": 60}


@pytest.mark.parametrize("silent", ["-inf", "-Inf", "", "NA"])
def test_blanks_that_name_a_place_are_blanks_by_their_level(tmp_path: Path, silent: str) -> None:
    text = drafted(tmp_path, two_places(silent))
    assert false_alarms(tmp_path, text) == {"felt": 6, "presented": 60}


@pytest.mark.parametrize("silent", ["0", "", "-inf"])
def test_blanks_of_amplitudes_are_drafted_as_well(tmp_path: Path, silent: str) -> None:
    table = one_place(silent, ("1", "2", "4", "8", "16"), "amp_um")
    text = drafted(tmp_path, table, task="yes/no", side="left")
    assert false_alarms(tmp_path, text) == {"felt": 6, "presented": 60}


def test_an_answer_that_no_name_tells_changes_nothing(tmp_path: Path) -> None:
    table = one_place("-inf").replace(",ans,", ",said,", 1)
    text = drafted(tmp_path, table, response="said", side="left")
    assert '# condition = "said"' not in text
    text = text.replace("[constant]", '[values.response]\nyes = "left"\nno = "none"\n\n[constant]')
    assert false_alarms(tmp_path, text) == {"felt": 6, "presented": 60}


@pytest.mark.parametrize("name", ["ans", "said", "verdict"])
def test_answers_are_offered_as_no_condition(tmp_path: Path, name: str) -> None:
    rows = [f"{who},{um},{SAID[str(int(n < um))]}" for who in "123" for um in (0, 1, 2, 4, 8)
            for n in range(6)]  # fmt: skip
    put(tmp_path / "t.csv", "\n".join([f"participant,amp_um,{name}", *rows]) + "\n")
    told = run("columns", tmp_path / "t.csv").stdout
    assert "condition = " not in told


@pytest.mark.parametrize("two", [False, True])
def test_a_code_for_no_stimulus_is_asked_for_and_not_guessed(tmp_path: Path, *, two: bool) -> None:
    table = two_places("-999") if two else one_place("-999")
    told = {} if two else {"task": "yes/no", "side": "left"}
    text = drafted(tmp_path, table, **told)
    line = '[values.level_vpp] -999 = "-inf" makes blanks of its rows'
    assert f"# Note: level -999 may be a code for no stimulus: if it is, {line}" in text
    text = text.replace("[axis]", '[values.level_vpp]\n-999 = "-inf"\n\n[axis]')
    assert false_alarms(tmp_path, text) == {"felt": 6, "presented": 60}


def test_levels_of_an_amplitude_are_not_taken_for_signed_by_a_code(tmp_path: Path) -> None:
    table = one_place("-999", ("1", "2", "4", "8", "16"), "amp_um")
    text = drafted(tmp_path, table, task="yes/no", side="left")
    assert "x_scale" not in text
    assert '[values.level_vpp] -999 = "0" makes blanks' in text


def with_catch(table: str, level: str) -> str:
    """Tell blanks by a column, in place of their level."""
    head, *rows = table.splitlines()
    rows = [f"{one.replace(',,', f',{level},')},{int(',,' in one)}" for one in rows]
    return "\n".join([f"{head},catch", *rows]) + "\n"


def test_a_column_that_may_tell_blanks_at_0_db_is_named_and_not_taken(tmp_path: Path) -> None:
    text = drafted(tmp_path, with_catch(one_place(""), "0"), task="yes/no", side="left")
    line = 'side = "catch", instead of any other side, with [values.side] 1 = "none" and 0 = "left"'
    assert f"# Note: column catch may tell blanks: if it does, [columns] {line}" in text
    assert '# condition = "catch"' not in text
    text = re.sub('\n\\[constant\\]\nside = "left".*', "", text)
    text = text.replace("\n[columns]", '\n[columns]\nside = "catch"').replace(
        "[axis]", '[values.side]\n1 = "none"\n0 = "left"\n\n[axis]'
    )
    assert false_alarms(tmp_path, text) == {"felt": 6, "presented": 60}


def test_beside_two_places_such_a_column_can_only_leave_rows_out(tmp_path: Path) -> None:
    text = drafted(tmp_path, with_catch(two_places(""), "0"))
    assert (
        'if it does, [rows.skip] catch = "1" leaves them out, or let column side say none' in text
    )
    assert (
        "catch"
        not in drafted(tmp_path / "other", with_catch(two_places(""), "")).partition(
            "# All columns"
        )[0]
    )


def test_a_row_without_a_level_is_refused_with_what_would_make_it_a_blank(tmp_path: Path) -> None:
    text = drafted(tmp_path, one_place(""), task="yes/no", side="left")
    put(tmp_path / "map.toml", text.replace('\n"" = "-inf"', "\n# "))
    names = ("--columns", tmp_path / "map.toml")
    done = run("analyze", tmp_path / "t.csv", *names, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert done.stderr.endswith(
        "t.csv:52: column 'level_vpp' is n/a; it must be a number where there is a stimulus; "
        'blanks without a level: in the map [values.level_vpp] "" = "-inf", or what stands there'
        ' for ""\n'
    )
