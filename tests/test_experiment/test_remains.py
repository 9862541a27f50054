"""What is left of a session: what can be built anew is said to be, and what cannot is said so."""

from __future__ import annotations

import json
import shutil
from itertools import combinations
from typing import TYPE_CHECKING

import pytest

from analysis.reading.load import read_inputs
from experiment.integrity.sessions import examine
from tests.test_experiment.lab import Crash, Lab
from tests.test_experiment.test_verified import ByItself

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from experiment.study.study import Study
    from tests.conftest import Run

SESSION = "sub-01/ses-01"
FILES = {
    "p": "plan.json", "h": "header.json", "j": "journal.jsonl", "t": "trials.csv",
    "s": "../sessions.tsv", "m": "measured.csv",
}  # fmt: skip


@pytest.fixture(scope="module")
def recorded(
    tmp_path_factory: pytest.TempPathFactory, make_study: Callable[[str], Study],
    short_study_text: str,
) -> Path:  # fmt: skip
    """Sessions of two people: not to change."""
    results = tmp_path_factory.mktemp("recorded") / "results"
    with pytest.MonkeyPatch.context() as patch:
        for person in ("01", "02"):
            Lab(make_study(short_study_text), results, patch, participant=person).begin()
    return results


@pytest.fixture
def results(recorded: Path, tmp_path: Path) -> Path:
    return shutil.copytree(recorded, tmp_path / "results")


def lose(results: Path, files: str) -> None:
    """Remove files of a session by their letters, or all of it."""
    if files == "all":
        shutil.rmtree(results / SESSION)
    for letter in files if files != "all" else "":
        (results / SESSION / FILES[letter]).unlink()


def analyze(run: Run, folder: Path, *more: str) -> Result:
    out = folder.resolve().parent / "out"
    return run("analyze", folder, "--out", out, "--no-figures", *more)


LOST = {
    # what is removed: what verify names, and whether a table of the session is still read
    "p": ("plan.json: is missing", True),
    "pt": ("plan.json: is missing", False),
    "pj": ("journal.jsonl: is missing", True),
    "jt": ("journal.jsonl: is missing", False),
    "pjt": ("journal.jsonl: is missing", False),
    "phjt": ("sessions.tsv:2: session 01 ended on", False),
    "all": ("and its folder is lost", False),
    "jts": ("journal.jsonl: is missing", False),
    "pjts": ("journal.jsonl: is missing", False),
}


@pytest.mark.slow
@pytest.mark.parametrize("files", LOST)
def test_what_cannot_be_built_anew_is_named_by_every_command(
    results: Path, run: Run, files: str
) -> None:
    named, has_table = LOST[files]
    lose(results, files)
    told = run("verify", results)
    assert (told.exit_code, named in told.stdout) == (1, True), told.output
    for more in ((), ("--bids", results.parent / "bids")):
        done = run("export", results, *more)
        assert (done.exit_code, len(done.stderr.splitlines())) == (2, 1), done.output
        assert "sub-01" in done.stderr
        assert "copy" in done.stderr
    assert not (results.parent / "bids").exists()
    without_mark = has_table and files == "pj"  # a table without a journal is read, and marked
    done = analyze(run, results)
    assert done.exit_code == (0 if without_mark else 2), done.output
    assert "builds it" not in done.output
    if not without_mark:
        assert "--accept-altered" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("files", [files for files, (_, table) in LOST.items() if not table])
def test_a_lost_session_is_left_out_with_a_mark_where_that_is_accepted(
    results: Path, run: Run, files: str
) -> None:
    lose(results, files)
    done = analyze(run, results, "--accept-altered")
    assert done.exit_code == 0, done.output
    summary = json.loads((results.parent / "out" / "summary.json").read_bytes())
    assert "1 session" in summary["mark"]
    assert [one.startswith("sub-01/") for one in summary["altered"]].count(True) >= 1
    assert "altered" in (results.parent / "out" / "levels.csv").read_text("utf-8").split("\n")[0]


SUBSETS = ["".join(some) for n in range(5) for some in combinations("phjt", n)]


@pytest.mark.slow
@pytest.mark.parametrize("left", SUBSETS)
@pytest.mark.parametrize("ended", [False, True])
def test_whatever_files_are_left_all_commands_agree(
    results: Path, run: Run, killed: Path, left: str, *, ended: bool
) -> None:
    folder = results / SESSION if ended else killed
    for letter in {*"phjt"} - {*left}:
        (folder / FILES[letter]).unlink()
    whole, honest = {*"phj"} <= {*left}, ended <= ("t" in left)
    alone = "t" in left and "j" not in left  # a table without a journal is read all the same
    never = not left and not ended
    codes = (
        0 if never or (whole and honest) else 1,
        0 if never or (whole and honest) or alone else 2,
        0 if never or whole else 2,
        0 if never or whole else 2,
    )
    verified, analyzed = run("verify", results), analyze(run, results)
    bids = run("export", results, "--bids", results.parent / "bids")
    exported = run("export", results)
    done = (verified, analyzed, exported, bids)
    assert tuple(one.exit_code for one in done) == codes, [one.output for one in done]
    promised = "tactstrip export DIR builds it" in " ".join(analyzed.output.split())
    assert promised == (whole and "t" not in left)
    assert (folder / "trials.csv").exists() == ("t" in left or whole)


MEASURED = ["".join(some) for n in range(4) for some in combinations("jtm", n)]


@pytest.mark.slow
@pytest.mark.parametrize("left", MEASURED)
def test_whatever_is_left_of_a_measured_session_all_commands_agree(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch, left: str
) -> None:
    monkeypatch.setattr("experiment.session.conduct.require_confirmed", lambda *_: None)
    rig = ByItself(tmp_path / "results")
    assert rig.begin().finished
    for letter in {*"jtm"} - {*left}:
        (rig.folder.path / FILES[letter]).unlink()
    verified, analyzed = run("verify", rig.folder.root), analyze(run, rig.folder.root)
    exported = run("export", rig.folder.root)
    codes = verified.exit_code, analyzed.exit_code, exported.exit_code
    alone = "t" in left and "j" not in left  # a table without a journal is read all the same
    assert codes == (left != "jtm", 0 if alone or left == "jtm" else 2, 0 if "j" in left else 2)
    named = {letter for letter in "jtm" if f"{FILES[letter]}: is missing" in verified.output}
    gone = {*"jtm"} - {*left}
    assert named == (gone if "j" in left else gone - {"m"})  # of which nothing else would tell
    if "j" in left:
        assert run("verify", rig.folder.root).exit_code == 0


def test_other_sessions_are_built_where_one_is_lost(results: Path, run: Run) -> None:
    lose(results, "p")
    table = results / "sub-02/ses-01/trials.csv"
    before = table.read_bytes()
    table.unlink()
    done = run("export", results)
    assert (done.exit_code, table.read_bytes()) == (2, before)
    assert "plan.json missing, journal.jsonl and trials.csv left" in done.stderr


def test_where_all_sessions_are_lost_that_is_said(results: Path, run: Run) -> None:
    for person in ("01", "02"):
        shutil.rmtree(results / f"sub-{person}" / "ses-01")
    for folder, number in ((results, 2), (results / "sub-01", 1)):
        told = run("verify", folder)
        assert (told.exit_code, told.stdout.count("its folder is lost")) == (1, number)


@pytest.mark.slow
def test_a_table_that_can_be_built_anew_is_said_to_be(results: Path, run: Run) -> None:
    lose(results, "t")
    told = run("verify", results)
    assert (told.exit_code, "trials.csv: is missing" in told.stdout) == (1, True)
    done = analyze(run, results)
    assert done.exit_code == 2
    assert f"{results / SESSION}/trials.csv: is missing" in done.stderr
    assert run("export", results).exit_code == 0
    assert run("verify", results).exit_code == analyze(run, results).exit_code == 0


@pytest.fixture
def killed(make_study: Callable[[str], Study], short_study_text: str, results: Path) -> Path:
    """The folder of a third person's session, killed amid it, with a table of what there was."""
    with pytest.MonkeyPatch.context() as patch:
        lab = Lab(make_study(short_study_text), results, patch, participant="03")
        with lab.killed_after(lines=25), pytest.raises(Crash):
            lab.begin()
    lab.folder.write_trials()
    return lab.folder.path


@pytest.fixture
def stopped(make_study: Callable[[str], Study], short_study_text: str, results: Path) -> Lab:
    """A session of a third person that is still to go on, killed before its first line."""
    with pytest.MonkeyPatch.context() as patch:
        lab = Lab(make_study(short_study_text), results, patch, participant="03")
        lab.folder.path.mkdir(parents=True)
        return lab


@pytest.mark.slow
def test_a_session_that_never_began_is_no_loss(results: Path, run: Run, stopped: Lab) -> None:
    stopped.folder.journal_path.touch()
    assert run("verify", results).exit_code == 0
    done = analyze(run, results)
    assert done.exit_code == 0
    assert "session sub-03/ses-01" in " ".join(
        done.stdout.split()
    )
    assert run("export", results).exit_code == 0
    done = run("export", results, "--bids", results.parent / "bids")
    assert (done.exit_code, "-03/ses-01" in done.output) == (0, True)


@pytest.mark.slow
def test_a_session_that_is_not_exported_yet_is_a_warning(
    results: Path, run: Run, stopped: Lab
) -> None:
    stopped.folder.create(stopped.plan, {})
    done = analyze(run, results)
    told = " ".join(done.stdout.split())
    assert done.exit_code == 0
    assert "session sub-03/ses-01" in told


@pytest.mark.parametrize("line", [2, 4])
def test_a_cell_of_the_schema_is_an_edit_like_another(results: Path, run: Run, line: int) -> None:
    table = results / SESSION / "trials.csv"
    before = table.read_text("utf-8")
    lines = before.splitlines(keepends=True)
    lines[line - 1] = lines[line - 1].replace("2", "1", 1)
    table.write_text("".join(lines), encoding="utf-8")
    edit = f"trials.csv:{line}: column 'schema' is '1'; by the journal it is '2'"
    told = run("verify", results)
    assert told.exit_code == 1
    assert edit in told.stdout
    assert "sub-02/ses-01:" in told.stdout
    refused = analyze(run, results)
    assert (refused.exit_code, edit in refused.stderr) == (2, True)
    loaded = read_inputs([results], accept_altered=True)
    assert loaded.altered
    assert {*loaded.trials["schema"]} == {2}
    assert run("export", results).exit_code == 0
    assert table.read_text("utf-8") == before


def test_verify_examines_the_others_where_one_cannot_be_read(results: Path, run: Run) -> None:
    (results / SESSION / "plan.json").unlink()
    (results / SESSION / "plan.json").symlink_to(results / "sub-02/ses-01/plan.json")
    told = run("verify", results)
    assert told.exit_code == 2
    assert "plan.json:" in told.stderr
    assert "sub-02/ses-01:" in told.stdout


@pytest.mark.slow
@pytest.mark.parametrize("place", ["", "sub-01", SESSION])
def test_an_honest_session_is_not_suspected_wherever_one_stands(
    results: Path, run: Run, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    tables = {path: path.read_bytes() for path in results.glob("sub-*/ses-*/trials.csv")}
    monkeypatch.chdir(results / place)
    out = results.parent / "out"
    assert run("verify", ".").exit_code == 0
    assert run("analyze", ".", "--out", out, "--no-figures").exit_code == 0
    assert run("export", ".").exit_code == 0
    assert {path: path.read_bytes() for path in tables} == tables
    done = run("export", ".", "--bids", results.parent / "bids")
    assert done.exit_code == 0, done.output
    number = 1 if place else 2
    assert f"{number} sessions" in done.output
    assert len([*(results.parent / "bids").glob("sub-*/ses-*/beh/*.tsv")]) == number


@pytest.mark.slow
def test_a_bare_name_is_a_path_like_another(
    results: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(results / SESSION)
    out = results.parent / "out"
    assert run("analyze", "trials.csv", "--out", out, "--no-figures").exit_code == 0
    for path in ("..", "../ses-01"):
        assert run("verify", path).exit_code == 0
    (results / SESSION / "trials.csv").write_bytes(b"")
    told = run("verify", ".")
    assert (told.exit_code, "trials.csv:1" in told.stdout) == (1, True)


def test_a_copy_beside_the_journal_is_compared_with_it(results: Path, run: Run) -> None:
    table = results / SESSION / "trials.csv"
    copy = table.with_name("trials_fixed.csv")
    copy.write_bytes(table.read_bytes())
    loaded = read_inputs([copy])
    assert (loaded.not_compared, len(loaded.progress)) == ((), 1)
    assert [one.name for one in loaded.inputs] == ["plan.json", "trials_fixed.csv"]
    text = table.read_text("utf-8")
    copy.write_text(text.replace(",0.5,", ",0.25,", 1), encoding="utf-8")
    done = analyze(run, copy)
    assert done.exit_code == 2
    assert f"{copy}:2: column 'rt_s' is '0.25'; by the journal it is '0.5'" in done.stderr
    assert "export" not in done.stderr
    accepted = read_inputs([copy], accept_altered=True)
    (told,) = accepted.altered.values()
    assert told[0].startswith("trials_fixed.csv:2: column 'rt_s'")


LINKED = ["sub-01", SESSION, *(f"{SESSION}/{FILES[one]}" for one in "phjt"), "sub-01/sessions.tsv"]


@pytest.mark.parametrize("name", LINKED)
@pytest.mark.parametrize("dead", [False, True])
def test_a_link_among_the_results_is_refused_by_name(
    results: Path, run: Run, name: str, *, dead: bool
) -> None:
    place, elsewhere = results / name, results.parent / "elsewhere"
    place.rename(elsewhere)
    place.symlink_to(results.parent / "nowhere" if dead else elsewhere)
    for command in (("verify",), ("analyze", "--out", results.parent / "out"), ("export",),
                    ("export", "--bids", results.parent / "bids")):  # fmt: skip
        done = run(command[0], results, *command[1:])
        assert done.exit_code == 2, (command, done.output)
        assert done.stderr.startswith(f"error: {place}: must not be a symbolic link")
    assert not (results.parent / "out").exists()


@pytest.mark.parametrize("name", ["sub-01", SESSION])
def test_a_link_given_as_the_path_is_refused_with_what_it_leads_to(
    results: Path, run: Run, name: str
) -> None:
    link = results.parent / "link"
    link.symlink_to(results / name)
    for command in (("verify",), ("analyze", "--out", results.parent / "out"), ("export",)):
        done = run(command[0], link, *command[1:])
        told = f"error: {link}: is a symbolic link to {results / name}; give that folder itself\n"
        assert (done.exit_code, done.stderr) == (2, told)


@pytest.mark.parametrize("name", ["sub-01", SESSION])
@pytest.mark.parametrize("given", ["sub-01", SESSION, f"{SESSION}/trials.csv"])
def test_a_link_in_the_place_of_a_folder_is_refused_from_below_too(
    results: Path, run: Run, name: str, given: str
) -> None:
    (results / name).rename(results.parent / "elsewhere")
    (results / name).symlink_to(results.parent / "elsewhere")
    done = run("analyze", results / given, "--out", results.parent / "out")
    assert done.exit_code == 2
    assert done.stderr.startswith(f"error: {results / name}: must not be a symbolic link")


def test_a_link_to_a_session_s_table_is_refused_with_what_it_leads_to(
    results: Path, run: Run
) -> None:
    table = results / SESSION / "trials.csv"
    link = results.parent / "t.csv"
    link.symlink_to(table)
    done = run("analyze", link, "--out", results.parent / "out")
    assert done.exit_code == 2
    assert (
        f"{link}: is a symbolic link to {table.resolve()}, whose journal lies there" in done.stderr
    )


@pytest.mark.slow
def test_the_folder_of_results_may_be_reached_by_a_link(results: Path, run: Run) -> None:
    link = results.parent / "link"
    link.symlink_to(results)
    assert run("verify", link).exit_code == 0
    assert analyze(run, link).exit_code == 0
    assert run("export", link).exit_code == 0


def test_a_session_is_examined_by_its_place_not_by_the_way_to_it(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(results / SESSION)
    assert not examine(results.__class__()).differences
