"""A participant's withdrawal: complete, refused, or run again."""

from __future__ import annotations

import json
import os
import shutil
from typing import TYPE_CHECKING

import pytest
from filelock import FileLock

from experiment import ArchiveError
from experiment.record.manifest import NAME
from experiment.record.withdraw import PersonalData, search
from tests.test_experiment.sessions import contents
from tests.test_experiment.withdrawals import (
    assert_gone,
    begin_withdrawal,
    change_meanwhile,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from tests.conftest import Refused, Run, Simulate

    Withdraw = Callable[..., Result]


@pytest.fixture(scope="module")
def two_people(tmp_path_factory: pytest.TempPathFactory, simulate: Simulate) -> Path:
    """A study's folder with participants 01 and 02, and a manifest of an analysis of both."""
    results = simulate(tmp_path_factory.mktemp("study") / "results", participants=2)
    (results / "analysis").mkdir()
    about = {"schema": 1, "what": "analysis", "participants": ["01", "02"], "files": {}}
    (results / "analysis" / NAME).write_text(json.dumps(about), encoding="utf-8")
    return results


@pytest.fixture
def results(two_people: Path, tmp_path: Path) -> Path:
    return shutil.copytree(two_people, tmp_path / "results")


@pytest.fixture
def withdraw(results: Path, run: Run) -> Withdraw:
    def withdraw(*more: str | Path, who: str = "01", typed: str | None = None) -> Result:
        typed = f"{who}\n" if typed is None else typed
        return run("withdraw", results, "--participant", who, *more, typed=typed)

    return withdraw


def withdrawing(results: Path, who: str = "01") -> tuple[str | Path, ...]:
    return "withdraw", results, "--participant", who


def test_a_withdrawn_person_is_gone_and_the_others_are_untouched(
    results: Path, withdraw: Withdraw, refused: Refused
) -> None:
    before = contents(results)
    assert withdraw().exit_code == 0
    assert_gone(results)
    after = contents(results)
    kept = {name for name in before if not name.startswith("sub-01")} - {"participants.tsv"}
    assert {name: after[name] for name in kept} == {name: before[name] for name in kept}
    assert set(after) == kept | {"participants.tsv", "withdrawn/sub-01.json"}
    tombstone = json.loads(after["withdrawn/sub-01.json"])
    assert set(tombstone) == {"schema", "participant", "withdrawn", "removed"}
    assert tombstone["participant"] == "01"
    assert len(tombstone["withdrawn"]) == len("2000-01-01")
    study = results.parent / "study.toml"
    study.write_text("", encoding="utf-8")
    assert "participant 01" in refused("run", study, "--participant", "01", "--out", results)


def test_a_session_of_an_interrupted_withdrawal_is_neither_resumed_nor_exported(
    results: Path, refused: Refused
) -> None:
    study = results.parent / "study.toml"
    study.write_text("", encoding="utf-8")
    begin_withdrawal(results, "01", "2026-01-02")
    resumed = ("run", study, "--participant", "01", "--out", results, "--resume")
    for command in (resumed, ("export", results)):
        assert "2026-01-02" in refused(*command)


@pytest.mark.parametrize("typed", ["", "\x04", "1\n", "sub-01\n", "02\n", "yes\n"])
def test_without_the_typed_id_nothing_changes(results: Path, typed: str, refused: Refused) -> None:
    refused(*withdrawing(results), typed=typed)


def test_nothing_is_removed_while_a_session_is_running_or_was_begun_meanwhile(
    results: Path, refused: Refused, withdraw: Withdraw
) -> None:
    with FileLock(results / "sub-01" / "ses-01" / ".lock"):
        refused(*withdrawing(results), typed="01\n")
    with change_meanwhile(results, "01") as remove:
        (results / "sub-01" / "ses-02").mkdir()
        before = contents(results)
        with pytest.raises(ArchiveError):
            remove()
        assert contents(results) == before
    (results / "sub-01" / "ses-02").rmdir()
    assert withdraw().exit_code == 0


@pytest.mark.parametrize("who", ["../results", "01/../02", "sub-01", "", ".", "all", "*", "03"])
def test_an_id_that_is_a_path_or_nobodys_is_refused(
    results: Path, who: str, refused: Refused
) -> None:
    assert refused(*withdrawing(results, who), typed=f"{who}\n").count("\n") == 1


@pytest.mark.parametrize(
    "place", ["sub-01", "sub-01/ses-01", "sub-01/ses-01/more", "participants.tsv", "withdrawn"]
)
def test_a_symbolic_link_in_the_way_is_refused(
    results: Path, tmp_path: Path, place: str, refused: Refused
) -> None:
    elsewhere = tmp_path / "elsewhere"
    link = results / place
    if link.exists():
        link.rename(elsewhere)
    else:
        elsewhere.mkdir()
    link.symlink_to(elsewhere)
    assert "symbolic" in refused(*withdrawing(results), typed="01\n")
    assert link.is_symlink()


def test_what_comes_back_from_a_backup_is_removed_under_the_first_day(
    results: Path, withdraw: Withdraw
) -> None:
    begin_withdrawal(results, "01", "2001-02-03", removed=True)
    assert withdraw().exit_code == 0
    assert_gone(results)
    tombstone = json.loads((results / "withdrawn" / "sub-01.json").read_text("utf-8"))
    assert tombstone["withdrawn"] == "2001-02-03"
    again = withdraw(typed="")
    assert (again.exit_code, contents(results)["withdrawn/sub-01.json"] != b"") == (0, True)


def listed(done: Result) -> set[str]:
    assert done.exit_code == 0, done.output
    return {line.strip() for line in done.stdout.splitlines() if line.startswith("  ")}


def test_analyses_and_copies_that_hold_the_person_are_listed(
    results: Path, tmp_path: Path, withdraw: Withdraw
) -> None:
    copies = tmp_path / "copies"
    for person in ("sub-01", "sub-02"):
        shutil.copytree(results / person, copies / "old" / person)
    shutil.copytree(results / "analysis", copies / "analysis")
    for name, text in (
        ("levels.toml", 'participant = "01"\nlevels_vpp = [60]\n'),
        ("others.toml", 'participant = "02"\nlevels_vpp = [1]\n'),
        ("no.toml", "participant = 01 is no TOML"),
        ("deep.toml", "levels_vpp = " + "[" * 100_000),
        ("table.csv", "side,participant\nleft,01\n"),
    ):
        (copies / name).write_text(text, encoding="utf-8")
    (copies / "link").symlink_to(results)
    (copies / "broken").mkdir()
    (copies / "broken" / NAME).write_text("[" * 100_000, encoding="utf-8")
    assert listed(withdraw("--also", copies)) == {
        f"analysis: {results / 'analysis'}",
        f"analysis: {copies / 'analysis'}",
        f"sessions: {copies / 'old' / 'sub-01'}",
        f"levels: {copies / 'levels.toml'}",
        f"table: {copies / 'table.csv'}",
        str(copies / "broken" / NAME),  # not searched
        str(copies / "link"),
    }
    assert_gone(results)


def test_of_an_export_the_whole_is_listed_and_what_was_put_into_it(
    results: Path, tmp_path: Path, run: Run
) -> None:
    bids, whole = tmp_path / "bids", PersonalData(tmp_path / "bids", "BIDS data set")
    assert run("export", results, "--bids", bids, "--with-sourcedata").exit_code == 0
    assert search([bids], "02").hits == (whole,)
    copies = [bids / "analysis", bids / "sourcedata" / "more"]
    for copy in copies:
        shutil.copytree(results / "analysis", copy)
    (bids / "code" / "sub-02").mkdir(parents=True)
    assert set(search([bids], "02").hits) == {
        whole,
        *(PersonalData(copy, "analysis") for copy in copies),
        PersonalData(bids / "code" / "sub-02", "sessions"),
    }
    assert search([bids], "03").hits == ()


REST = '"what": "analysis", "participants": ["01"], "files": {}}'


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        "",
        "null",
        "\udcff",
        "{" + REST,
        '{"schema": 2, ' + REST,
        *(
            '{"schema": 1, ' + REST.replace(*edit)
            for edit in (
                ('["01"]', '"01"'),
                ('["01"]', '{"01": "01"}'),
                ("{}", '{"a": 1}'),
                ('"analysis"', "1"),
                ('"files"', '"file"'),
            )
        ),
    ],
    ids=lambda text: text[:60],
)
def test_a_damaged_manifest_is_not_searched(tmp_path: Path, text: str) -> None:
    path = tmp_path / NAME
    path.write_text('{"schema": 1, ' + REST, encoding="utf-8")
    assert search([tmp_path], "01").hits == (PersonalData(tmp_path, "analysis"),)
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    found = search([tmp_path], "01")
    assert (found.hits, found.not_searched) == ((), (path,))


def test_renamed_copies_of_sessions_and_tables_are_listed(
    results: Path, tmp_path: Path, withdraw: Withdraw
) -> None:
    session = results / "sub-01" / "ses-01"
    notes, others = results / "notes", results / "sub-02" / "old"
    for folder in (notes, others):
        folder.mkdir()
    shutil.copytree(session, notes / "pilot")
    shutil.copytree(session, others / "ses-77")
    shutil.copy(session / "plan.json", others)
    shutil.copy(session / "trials.csv", notes / "first.csv")
    shutil.copy(results / "participants.tsv", notes / "people.tsv")
    shutil.copy(results / "sub-02" / "ses-01" / "trials.csv", notes / "others.csv")
    (notes / "words.csv").write_text("word,participant\n01,one\n", encoding="utf-8")
    os.mkfifo(notes / "header.json")
    os.mkfifo(notes / "levels.toml")
    (notes / "long.toml").write_text("a." * 60_000 + "a = 1\n", encoding="utf-8")
    assert listed(withdraw()) == {
        f"analysis: {results / 'analysis'}",
        f"sessions: {notes / 'pilot'}",
        f"sessions: {others}",
        f"sessions: {others / 'ses-77'}",
        f"table: {notes / 'first.csv'}",
        f"table: {notes / 'people.tsv'}",
        str(notes / "header.json"),  # not searched
    }
