"""A participant's withdrawal: complete, refused, or run again."""

from __future__ import annotations

import json
import shutil
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner
from filelock import FileLock

from experiment.archive.bids import export_bids
from experiment.archive.files import ArchiveError
from experiment.archive.folders import SessionFolder
from experiment.archive.manifest import NAME, Holding, search
from experiment.archive.participants import Tombstone, read_people, read_tombstone, write_tombstone
from experiment.archive.withdraw import held, look_up, remove
from experiment.integrity.places import find_sessions
from tactstrip import main
from tests.test_experiment.sessions import contents

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from tests.conftest import Refused, Run


@pytest.fixture(scope="module")
def two_people(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study's folder with participants 01 and 02 and their analysis."""
    root = tmp_path_factory.mktemp("study")
    study = root / "study.toml"
    text = '[burst]\nwindow = "hann"\n[design]\ntrials_per_side = 2\nlevels_vpp = [80, 160]\n'
    study.write_text(text, encoding="utf-8")
    arguments = ["dry-run", str(study), "--participants", "2", "--out", str(root / "results")]
    assert CliRunner().invoke(main, [*arguments, "--seed", "1"]).exit_code == 0
    return root / "results"


@pytest.fixture
def results(two_people: Path, tmp_path: Path) -> Path:
    return shutil.copytree(two_people, tmp_path / "results")


def withdraw(results: Path, *more: str, typed: str = "01\n") -> Result:
    arguments = ["withdraw", str(results), "--participant", "01", *more]
    return CliRunner().invoke(main, arguments, input=typed)


STEPS = 24
"""How often a withdrawal changes the disk."""


def assert_gone(results: Path) -> None:
    assert not (results / "sub-01").exists()
    assert read_people(results).rows == (("sub-02",),)
    tombstone = read_tombstone(results, "01")
    assert tombstone is not None
    assert tombstone.removed
    assert [path.name for path in (results / "withdrawn").iterdir()] == ["sub-01.json"]
    assert look_up(results, "01").gone
    assert (results / "sub-02" / "ses-01" / "trials.csv").exists()


@pytest.mark.slow
def test_a_withdrawn_person_is_gone_and_the_others_are_untouched(results: Path) -> None:
    before = contents(results)
    done = withdraw(results)
    assert done.exit_code == 0, done.stderr
    assert_gone(results)
    after = contents(results)
    assert "participants.tsv" in after
    kept = {name for name in before if not name.startswith("sub-01")} - {"participants.tsv"}
    assert {name: after[name] for name in kept} == {name: before[name] for name in kept}
    assert set(after) == kept | {"participants.tsv", "withdrawn/sub-01.json"}
    tombstone = json.loads(after["withdrawn/sub-01.json"])
    assert set(tombstone) == {"schema", "participant", "withdrawn", "removed"}
    assert tombstone["participant"] == "01"
    assert len(tombstone["withdrawn"]) == len("2000-01-01")


def withdrawing(results: Path, who: str = "01") -> tuple[str | Path, ...]:
    return "withdraw", results, "--participant", who


@pytest.fixture
def study(tmp_path: Path) -> Path:
    path = tmp_path / "study.toml"
    path.write_text("", encoding="utf-8")
    return path


def test_a_withdrawn_id_is_not_given_again(results: Path, study: Path, refused: Refused) -> None:
    withdraw(results)
    told = refused("run", study, "--participant", "01", "--out", results)
    assert "participant 01 withdrew on " in told


def test_a_session_of_an_interrupted_withdrawal_is_neither_resumed_nor_exported(
    results: Path, study: Path, refused: Refused
) -> None:
    (results / "withdrawn").mkdir()
    write_tombstone(results, Tombstone(participant="01", withdrawn="2026-01-02", removed=False))
    resumed = ("run", study, "--participant", "01", "--out", results, "--resume")
    for command in (resumed, ("export", results)):
        told = refused(*command)
        assert "participant 01 withdrew on 2026-01-02" in told


@pytest.mark.parametrize("typed", ["", "\x04", "1\n", "sub-01\n", "02\n", "yes\n"])
def test_without_the_typed_id_nothing_changes(results: Path, typed: str, refused: Refused) -> None:
    told = refused(*withdrawing(results), typed=typed)


def test_nothing_is_removed_while_a_session_is_running(results: Path, refused: Refused) -> None:
    with FileLock(results / "sub-01" / "ses-01" / ".lock"):
        told = refused(*withdrawing(results), typed="01\n")
    assert withdraw(results).exit_code == 0


def test_nothing_is_removed_when_a_session_was_begun_meanwhile(results: Path) -> None:
    person = look_up(results, "01")
    with held(person) as locks:
        (results / "sub-01" / "ses-02").mkdir()
        before = contents(results)
        with pytest.raises(ArchiveError, match="meanwhile"):
            remove(person, locks, today="2026-01-02")
        assert contents(results) == before


@pytest.mark.parametrize("who", ["../results", "01/../02", "sub-01", "", ".", "all", "*", "0 1"])
def test_an_id_that_is_a_path_is_refused(results: Path, who: str, refused: Refused) -> None:
    told = refused(*withdrawing(results, who), typed=f"{who}\n")
    assert told.count("\n") == 1


def test_nobody_is_not_removed(results: Path, refused: Refused) -> None:
    told = refused(*withdrawing(results, "03"))
    assert "03 here" in told
    assert told.count("\n") == 1


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
    assert "symbolic link" in refused(*withdrawing(results), typed="01\n")
    assert link.is_symlink()


def test_what_comes_back_from_a_backup_is_removed_under_the_first_day(results: Path) -> None:
    write_tombstone(results, Tombstone(participant="01", withdrawn="2001-02-03", removed=True))
    assert withdraw(results).exit_code == 0
    assert_gone(results)
    tombstone = read_tombstone(results, "01")
    assert tombstone is not None
    assert tombstone.withdrawn == "2001-02-03"


@pytest.mark.parametrize("step", range(1, STEPS + 1))
def test_a_withdrawal_killed_anywhere_is_whole_or_run_again(
    results: Path, step: int, kill_at: Callable[..., int | None]
) -> None:
    before = contents(results)
    assert kill_at(step, *map(str, withdrawing(results)), typed="01\n") is None
    person = {name for name in before if name.startswith("sub-01")}
    there = person & set(contents(results))
    assert there in (set(), person)
    tombstone = read_tombstone(results, "01")
    assert tombstone is not None or there == person
    if tombstone is not None:
        with pytest.raises(ArchiveError, match="withdrew on"):
            SessionFolder(results, "01", "09").refuse_existing()
    assert withdraw(results).exit_code == 0
    assert_gone(results)


def test_a_withdrawal_has_no_more_steps_than_it_was_killed_at(
    results: Path, kill_at: Callable[..., int | None]
) -> None:
    assert kill_at(STEPS + 1, *map(str, withdrawing(results)), typed="01\n") == STEPS
    assert_gone(results)


def test_analyses_and_copies_that_hold_the_person_are_listed(results: Path, tmp_path: Path) -> None:
    copies = tmp_path / "copies"
    shutil.copytree(results / "sub-01", copies / "old" / "sub-01")
    shutil.copytree(results / "sub-02", copies / "old" / "sub-02")
    shutil.copytree(results / "analysis", copies / "analysis")
    for name, text in (
        ("levels.toml", 'participant = "01"\nlevels_vpp = [60]\n'),
        ("others.toml", 'participant = "02"\nlevels_vpp = [1]\n'),
        ("no.toml", "participant = 01 is no TOML"),
        ("table.csv", "side,participant\nleft,01\n"),
    ):
        (copies / name).write_text(text, encoding="utf-8")
    (copies / "link").symlink_to(results)
    (copies / "broken").mkdir()
    (copies / "broken" / NAME).write_text("[]", encoding="utf-8")
    done = withdraw(results, "--also", str(copies))
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    at, then = lines.index("Participant 01 is still in:"), lines.index(UNSEARCHED)
    held, unsearched = lines[at + 1 : then], lines[then + 1 :]
    assert set(held) == {
        f"  analysis: {results / 'analysis'}",
        f"  analysis: {copies / 'analysis'}",
        f"  sessions: {copies / 'old' / 'sub-01'}",
        f"  levels: {copies / 'levels.toml'}",
    }
    assert unsearched[:-1] == [f"  {copies / 'broken' / NAME}", f"  {copies / 'link'}"]
    assert unsearched[-1] == "Files of other origin, packed files and backups are not known here."


UNSEARCHED = "Not searched (links, damaged manifests, no permission):"


def test_an_analysis_inside_an_export_is_listed(results: Path, tmp_path: Path) -> None:
    bids = tmp_path / "bids"
    only_01 = shutil.copytree(results, tmp_path / "one", ignore=shutil.ignore_patterns("sub-02"))
    export_bids(find_sessions(only_01).sessions, bids)
    analysis = shutil.copytree(results / "analysis", bids / "derivatives" / "ana")
    done = CliRunner().invoke(
        main, [*map(str, withdrawing(results, "02")), "--also", str(bids)], input="02\n"
    )
    assert done.exit_code == 0, done.stderr
    listed = [line for line in done.stdout.splitlines() if line.startswith("  ")]
    assert listed == [f"  analysis: {analysis}", f"  analysis: {results / 'analysis'}"]


def test_of_an_export_the_whole_is_listed_and_what_was_put_into_it(
    results: Path, tmp_path: Path
) -> None:
    bids = tmp_path / "bids"
    export_bids(find_sessions(results).sessions, bids, with_sourcedata=True)
    whole = Holding(bids, "BIDS data set")
    assert search([bids], "02").holdings == (whole,)
    copies = [bids / "analysis", bids / "sourcedata" / "more"]
    for copy in copies:
        shutil.copytree(results / "analysis", copy)
    (bids / "code" / "sub-02").mkdir(parents=True)
    table = bids / "sub-02" / "sub-02_sessions.tsv"
    table.symlink_to(table.rename(tmp_path / "elsewhere.tsv"))
    found = search([bids], "02")
    assert set(found.holdings) == {
        whole,
        *(Holding(copy, "analysis") for copy in copies),
        Holding(bids / "code" / "sub-02", "sessions"),
        Holding(bids / "sub-02", "sessions"),
    }
    assert {search([bids], who).holdings for who in ("03", "analysis")} == {()}


def test_an_export_with_files_gone_is_listed_once(results: Path, tmp_path: Path) -> None:
    bids = tmp_path / "bids"
    export_bids(find_sessions(results).sessions, bids)
    shutil.rmtree(bids / "sub-01")
    assert search([bids], "02").holdings == (Holding(bids, "BIDS data set"),)


REST = '"what": "analysis", "participants": ["01"], "files": {}}'


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"schema": ' + "[" * 100_000,
        "",
        "null",
        "1" * 10_000,
        "\udcff",
        "{" + REST,
        '{"schema": 2, ' + REST,
        '{"schema": 1, ' + REST.replace('["01"]', '"01"'),
        '{"schema": 1, ' + REST.replace('["01"]', '["01", 2]'),
        '{"schema": 1, ' + REST.replace('["01"]', '{"01": "01"}'),
        '{"schema": 1, ' + REST.replace("{}", '["01"]'),
        '{"schema": 1, ' + REST.replace("{}", '{"a": 1}'),
        '{"schema": 1, ' + REST.replace('"analysis"', "1"),
        '{"schema": 1, ' + REST.replace('"files"', '"file"'),
    ],
    ids=lambda text: text[:60],
)
def test_a_damaged_manifest_is_told_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / NAME
    path.write_text('{"schema": 1, ' + REST, encoding="utf-8")
    assert search([tmp_path], "01").holdings == (Holding(tmp_path, "analysis"),)
    path.write_text(text, encoding="utf-8", errors="surrogateescape")
    found = search([tmp_path], "01")
    assert (found.holdings, found.not_searched) == ((), (path,))


def test_brackets_without_end_do_not_stop_a_withdrawal(results: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / NAME).write_text("[" * 100_000, encoding="utf-8")
    (damaged / "levels.toml").write_text("levels_vpp = " + "[" * 100_000, encoding="utf-8")
    done = withdraw(results, "--also", str(damaged))
    assert (done.exit_code, done.exception) == (0, None)
    assert_gone(results)
    lines = done.stdout.splitlines()
    assert lines[lines.index(UNSEARCHED) + 1 : -1] == [f"  {damaged / NAME}"]


@pytest.mark.slow
def test_an_analysis_without_the_person_is_not_listed(results: Path, run: Run) -> None:
    withdraw(results)
    assert search([results], "01", leave_out=look_up(results, "01").known).holdings
    analyzed = run("analyze", results, "--out", results / "analysis", "--no-figures")
    assert analyzed.exit_code == 0
    done = withdraw(results, typed="")
    assert done.exit_code == 0


def test_the_heads_of_sessions_go_with_the_person_and_are_no_session(results: Path) -> None:
    assert look_up(results, "01").sessions == ("ses-01",)
    done = withdraw(results)
    assert "files in 1 sessions" in done.stderr
    assert not [*results.rglob("sub-01/sessions.tsv")]
    assert (results / "sub-02" / "sessions.tsv").is_file()
