"""What was changed in a record after the session is named; an honest one is never suspected."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
from itertools import combinations
from random import Random
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ResultFileError
from analysis.reading.trials import read_inputs
from experiment import ArchiveError, examine, read_journal
from tests.test_experiment import records as edits
from tests.test_experiment.lab import Crash, Lab
from tests.test_experiment.records import SESSION, heads_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from experiment import Study
    from tests.conftest import Run
    from tests.test_experiment.records import Edit

HEAD = "sessions.tsv:2:"
"""Where an edit is found that only the kept hash tells of."""
FILES = {
    "p": "plan.json",
    "h": "header.json",
    "j": "journal.jsonl",
    "t": "trials.csv",
    "s": "../sessions.tsv",
    "m": "measured.csv",
}


OTHERS = {
    "plan.json": "plan.json",
    "header.json": "header.json",
    "journal.jsonl": "plan.json",
    "trials.csv": "trials.csv:2:",
}
"""What is replaced by another person's file, and what is named then."""
CELLS = [
    (2, ("schema", "1")),
    (3, ("level_vpp", "61")),
    (5, ("rt_s", "0.25")),
    (6, ("status", "voided")),
]


def again(change: Callable[[list[bytes]], list[bytes]]) -> Edit:
    """Change the journal as somebody who makes its hashes fit again."""
    return edits.journal(change, again=True)


def plan_text(change: Callable[[str], str]) -> Edit:
    return edits.rewrite("plan.json", change)


PLAN, HEADER, JOURNAL, TABLE = "plan.json", "header.json", "journal.jsonl", "trials.csv"
SEED = plan_text(lambda t: re.sub(r'"seed": \d+', '"seed": 99', t))
LINE_ENDS = edits.rewrite(TABLE, lambda t: t.replace("\n", "\r\n"))
ANSWER = edits.replaced("response", b'"left"', b'"right"')
LEVEL = edits.replaced("stimulus_confirmed", b'"levels_', b'"nevels_')
REAL = edits.replaced("session_open", b'"simulated":true', b'"simulated":false')
EDITS: list[tuple[Edit, str]] = [
    # how, and the file by which it is named
    *((edits.flip(PLAN, share), PLAN) for share in (0.0, 0.1, 0.7)),
    (plan_text(lambda t: t.replace("\n", "\n ", 1)), PLAN),
    (SEED, PLAN),
    (edits.resealed, PLAN),  # with other levels
    (edits.flip(HEADER, 0.0), HEADER),
    (edits.rewrite(HEADER, lambda t: t.replace("mock", "M1")), HEADER),
    (edits.gone(HEADER), HEADER),
    *((edits.of_another(name), named) for name, named in OTHERS.items()),
    (edits.flip(JOURNAL, 0.0), f"{JOURNAL}:1:"),
    (edits.flip(JOURNAL, 0.5), f"{JOURNAL}:"),
    (edits.flip(JOURNAL, 1.0), HEAD),
    (edits.journal(lambda lines: [*lines[:9], *lines[10:]], again=False), f"{JOURNAL}:10:"),
    (edits.journal(lambda lines: lines[:-1], again=False), HEAD),
    (edits.journal(lambda _: [], again=False), HEAD),
    (again(lambda lines: [*lines[:-9], *lines[-8:]]), HEAD),
    (again(lambda lines: lines[:20]), HEAD),
    *((again(change), HEAD) for change in (ANSWER, REAL)),
    (again(LEVEL), f"{JOURNAL}:"),
    (edits.flip(TABLE, 0.001), f"{TABLE}:1:"),
    (edits.flip(TABLE, 1.0), f"{TABLE}:"),
    (edits.answer(4), f"{TABLE}:4:"),
    *((edits.cell(line, *to), f"{TABLE}:{line}:") for line, to in CELLS),
    (edits.rows(lambda r: [*r[:3], *r[4:]]), f"{TABLE}:4:"),
    (edits.rows(lambda r: r[:-1]), f"{TABLE}:"),
    (edits.rows(lambda r: [*r[:4], *r[3:]]), f"{TABLE}:5:"),
    (edits.rows(lambda r: [*r[:2], r[3], r[2], *r[4:]]), f"{TABLE}:"),
    (LINE_ENDS, f"{TABLE}:1:"),
    (edits.heads(lambda t: re.sub(r"\t[0-9a-f]{2}", "\t00", t)), "sessions.tsv:"),
    (edits.heads(lambda t: t.replace("ses-", "ses-9")), "sessions"),
    (edits.heads(lambda t: t.split("\n")[0] + "\n"), "sessions.tsv"),
    (edits.heads(lambda t: t + t.split("\n")[1] + "\n"), "sessions"),
    (edits.without_heads, "sessions.tsv"),
    (edits.renamed, PLAN),
]


@pytest.fixture(scope="module")
def recorded(
    tmp_path_factory: pytest.TempPathFactory,
    make_study: Callable[[str], Study],
    short_study_text: str,
) -> Path:
    """Sessions of two people, the first stopped and resumed: not to change."""
    results = tmp_path_factory.mktemp("recorded") / "results"
    with pytest.MonkeyPatch.context() as patch:
        for person in ("01", "02"):
            lab = Lab(make_study(short_study_text), results, patch, participant=person)
            if person == "01":
                lab.begin(pause={1: False})
                lab.resume()
            else:
                lab.begin()
    return results


@pytest.fixture
def results(recorded: Path, tmp_path: Path) -> Path:
    return shutil.copytree(recorded, tmp_path / "results")


def analyze(run: Run, folder: Path, *more: str) -> Result:
    out = folder.resolve().parent / "out"
    return run("analyze", folder, "--out", out, "--no-figures", *more)


def test_what_was_recorded_is_not_suspected(results: Path, run: Run) -> None:
    done = run("verify", results)
    assert done.exit_code == 0, done.output
    hashes = re.findall("[0-9a-f]{64}", done.output)
    journals = sorted(results.glob("sub-*/ses-*/journal.jsonl"))
    assert hashes == [read_journal(path).head_sha256 for path in journals]
    assert not read_inputs([results]).altered
    events = [entry.event for entry in read_journal(journals[0]).entries]
    assert {"session_resume", "session_close"} <= {*events}


@pytest.mark.parametrize(("edit", "named"), EDITS)
def test_an_edit_is_found_and_named(results: Path, run: Run, edit: Edit, named: str) -> None:
    edit(results)
    done = run("verify", results)
    assert (done.exit_code, named in done.output) == (1, True), done.output
    with pytest.raises(ResultFileError) as caught:
        read_inputs([results])
    error = str(caught.value)
    assert re.search(r"(plan\.json|header\.json|journal\.jsonl|trials\.csv|sessions\.tsv)\b", error)
    assert "\n" not in error


@pytest.mark.parametrize("command", ["verify", "analyze", "export"])
def test_a_session_of_another_schema_is_refused_in_one_line(
    results: Path, run: Run, command: str
) -> None:
    edits.journal(
        lambda lines: [line.replace(b'"schema":5', b'"schema":4') for line in lines], again=True
    )(results)
    done = run(command, results)
    assert done.exit_code == 2
    assert re.fullmatch(
        r"error: [^\n]*journal\.jsonl:1: schema must be 5; got 4: another version of tactstrip "
        r"wrote it[^\n]*\n",
        done.stderr,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("edit", "named"), EDITS)
def test_what_is_accepted_is_read_with_its_mark_or_is_no_table(
    results: Path, edit: Edit, named: str
) -> None:
    edit(results)
    loaded = None
    with contextlib.suppress(ResultFileError):
        loaded = read_inputs([results], accept_altered=True)
    if loaded is None:  # no table any more, or one that contradicts itself
        assert TABLE in named or edit is edits.renamed
    else:
        assert len(loaded.altered) == 1
        assert len(loaded.lost) <= (named == "sessions" or edit is edits.renamed)


def test_a_changed_table_is_named_by_all_commands_and_export_builds_it_anew(
    results: Path, run: Run
) -> None:
    table = results / SESSION / "trials.csv"
    before = table.read_bytes()
    edits.answer(4)(results)
    edits.cell(5, "rt_s", "0.25")(results)
    listed = run("verify", results).stdout
    assert "trials.csv:4: column" in listed
    for command in (("analyze", "--out"), ("export", "--bids")):
        done = run(command[0], results, command[1], results.parent / "new")
        assert done.exit_code == 2
        assert done.stderr.startswith(f"error: {table}:4: column 'response'")
        assert not (results.parent / "new").exists()
    done = run("export", results)
    assert (done.exit_code, table.read_bytes()) == (0, before)
    assert f"{table}:4: column 'response'" in done.stderr
    assert run("verify", results).exit_code == 0


@pytest.mark.slow
def test_what_is_accepted_is_marked_in_every_output(results: Path, run: Run) -> None:
    edits.of_another("header.json")(results)
    done = analyze(run, results, "--accept-altered")
    assert done.exit_code == 0, done.output
    out = results.parent / "out"
    summary = json.loads((out / "summary.json").read_bytes())
    assert "1 of 2" in summary["mark"]
    assert [path.split(":")[0] for path in summary["altered"]] == [f"{SESSION}/header.json"]
    assert summary["mark"] in (out / "report.html").read_text("utf-8")
    assert summary["mark"] in done.stdout
    people = (out / "participants.csv").read_text("utf-8").splitlines()
    assert people[0].endswith(",altered")
    marks = {(line[:2], line.rsplit(",", 1)[1]) for line in people[1:]}
    assert marks == {("01", "true"), ("02", "false")}


def test_a_session_goes_on_only_with_the_record_that_it_left(lab: Lab) -> None:
    assert not lab.begin(pause={1: False}).finished
    header, kept = lab.folder.header_path, lab.folder.path.parent / "sessions.tsv"
    for path, pattern, other in ((header, "mock", "M1"), (kept, "[0-9a-f]{64}", "a" * 64)):
        before = path.read_text("utf-8")
        path.write_text(re.sub(pattern, other, before), encoding="utf-8")
        with pytest.raises(ArchiveError, match=path.name):
            lab.resume()
        path.write_text(before, encoding="utf-8")
    assert lab.resume().finished


def test_the_head_is_told_and_kept_when_a_visit_ends(lab: Lab) -> None:
    first, person = lab.begin(pause={1: False}), lab.folder.path.parent
    assert heads_of(person) == {"ses-01": first.head_sha256}
    assert first.head_sha256 == read_journal(lab.folder.journal_path).head_sha256
    second = lab.resume()
    assert heads_of(person) == {"ses-01": second.head_sha256} != {"ses-01": first.head_sha256}
    kept = (person / "sessions.tsv").read_bytes()
    assert lab.resume().head_sha256 == second.head_sha256
    assert (person / "sessions.tsv").read_bytes() == kept


def test_a_session_whose_folder_is_lost_is_not_begun_anew(lab: Lab) -> None:
    lab.begin()
    shutil.rmtree(lab.folder.path)
    with pytest.raises(ArchiveError, match=r"sessions\.tsv:2:"):
        lab.begin()
    assert not lab.folder.path.exists()


@pytest.mark.parametrize("earlier", [False, True])
def test_a_missing_or_earlier_head_of_the_same_chain_is_put_right_by_a_resume(
    lab: Lab, *, earlier: bool
) -> None:
    if earlier:
        lab.begin(pause={1: False}, ask={2: (None, 0.1)})
        kept = (lab.folder.path.parent / "sessions.tsv").read_bytes()
        while not lab.resume().finished:
            pass
        (lab.folder.path.parent / "sessions.tsv").write_bytes(kept)
    else:
        with lab.killed_after("session_close"), pytest.raises(Crash):
            lab.begin()
    (difference,) = lab.differences()
    assert (difference.path.name, difference.remedy) == ("sessions.tsv", "resume")
    lab.messages.clear()
    assert lab.resume().finished
    assert ["sessions.tsv:" in message for message in lab.messages] == [True]
    assert not lab.differences()


def honest(lab: Lab, rng: Random) -> None:
    """Run a session to its end, however often it is stopped, killed or torn on the way."""
    for _ in range(rng.randrange(5)):
        go_on = lab.resume if lab.folder.plan_path.exists() else lab.begin
        how = rng.randrange(4)
        ask = {rng.randrange(1, 9): rng.choice([("right", 0.4), (None, 2.0), Crash()])}
        with contextlib.suppress(Crash):
            if how == 0:
                go_on(pause={1: False}, ask=ask)
            elif how == 1:
                go_on(ask=ask)
            else:
                with lab.killed_after(lines=rng.randrange(1, 40)):
                    go_on(ask=ask)
        ended = examine(lab.folder.path).ended
        if how == 3 and lab.folder.journal_path.stat().st_size and not ended:
            with lab.folder.journal_path.open("ab") as file:
                file.write(b'{"crc":"00')
        amiss = lab.differences()
        assert {difference.remedy for difference in amiss} <= {"resume"}, amiss
    (lab.resume if lab.folder.plan_path.exists() else lab.begin)()


@pytest.mark.parametrize("people", [2, pytest.param(60, marks=pytest.mark.slow)])
def test_honest_sessions_are_never_suspected(
    make_study: Callable[[str], Study],
    short_study_text: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    people: int,
) -> None:
    rng, study, root = Random(people), make_study(short_study_text), tmp_path / "results"
    for number in range(people):
        lab = Lab(study, root, monkeypatch, participant=f"{number:03d}", seed=number)
        honest(lab, rng)
        assert lab.differences() == ()
        assert lab.is_sealed()
    loaded = read_inputs([root])
    assert (loaded.altered, loaded.not_compared) == ({}, ())


def test_a_table_alone_or_bytes_after_the_end_are_a_difference(results: Path) -> None:
    with (results / "sub-02/ses-01/journal.jsonl").open("ab") as file:
        file.write(b"x")
    (difference,) = examine(results / "sub-02/ses-01").differences
    assert "1 byte" in difference.message
    for letter in "jphs":
        (results / SESSION / FILES[letter]).unlink()
    assert len(examine(results / SESSION).differences) == 1


@pytest.mark.parametrize("finished", [True, False])
def test_a_table_that_was_edited_is_not_written_over_by_a_resume(
    lab: Lab, *, finished: bool
) -> None:
    assert lab.begin(pause={} if finished else {1: False}).finished == finished
    table = lab.folder.trials_path
    written = table.read_bytes()
    table.write_bytes(written.replace(b",left,", b",both,", 1))
    changed = table.read_bytes()
    with pytest.raises(ArchiveError, match=r"trials\.csv:2:"):
        lab.resume()
    assert table.read_bytes() == changed
    table.unlink()
    lab.resume()
    assert table.read_bytes().startswith(written)


LOST = {
    # what is removed: what verify names, and whether a table of the session is still read
    "p": ("plan.json: ", True),
    "pt": ("plan.json: ", False),
    "pj": ("journal.jsonl: ", True),
    "jt": ("journal.jsonl: ", False),
    "pjt": ("journal.jsonl: ", False),
    "phjt": ("sessions.tsv:2: ", False),
    "all": ("sessions.tsv:2: ", False),
    "jts": ("journal.jsonl: ", False),
    "pjts": ("journal.jsonl: ", False),
}


@pytest.mark.slow
@pytest.mark.parametrize("files", LOST)
def test_what_cannot_be_built_anew_is_named_by_every_command(
    results: Path, run: Run, files: str
) -> None:
    named, has_table = LOST[files]
    if files == "all":
        shutil.rmtree(results / SESSION)
    for letter in files if files != "all" else "":
        (results / SESSION / FILES[letter]).unlink()
    done = run("verify", results)
    assert (done.exit_code, named in done.stdout) == (1, True), done.output
    for more in ((), ("--bids", results.parent / "bids")):
        done = run("export", results, *more)
        assert (done.exit_code, len(done.stderr.splitlines())) == (2, 1), done.output
        assert "sub-01" in done.stderr
    assert not (results.parent / "bids").exists()
    unmarked = files == "pj"  # a table without a journal is read, and marked
    done = analyze(run, results)
    assert (done.exit_code, "--accept-altered" in done.stderr) == (
        (0, False) if unmarked else (2, True)
    )
    if not has_table:
        assert analyze(run, results, "--accept-altered").exit_code == 0
        summary = json.loads((results.parent / "out" / "summary.json").read_bytes())
        assert "1 session" in summary["mark"]
        assert any(path.startswith("sub-01/") for path in summary["altered"])


SUBSETS = ["".join(some) for n in range(5) for some in combinations("phjt", n)]


@pytest.mark.slow
@pytest.mark.parametrize("left", SUBSETS)
@pytest.mark.parametrize("ended", [False, True])
def test_whatever_files_are_left_all_commands_agree(
    results: Path, run: Run, stopped: Lab, left: str, *, ended: bool
) -> None:
    if not ended:
        with stopped.killed_after(lines=25), pytest.raises(Crash):
            stopped.begin()
        stopped.folder.write_trials()
    folder = results / SESSION if ended else stopped.folder.path
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
    done = (verified, analyzed, run("export", results), bids)
    assert tuple(result.exit_code for result in done) == codes, [one.output for one in done]
    assert (folder / "trials.csv").exists() == ("t" in left or whole)
    if whole and not never:
        assert run("verify", results).exit_code == 0


@pytest.fixture
def stopped(make_study: Callable[[str], Study], short_study_text: str, results: Path) -> Lab:
    """A session of a third person that is still to be begun."""
    with pytest.MonkeyPatch.context() as patch:
        return Lab(make_study(short_study_text), results, patch, participant="03")


LINKED = ["sub-01", SESSION, *(f"{SESSION}/{FILES[one]}" for one in "phjt"), "sub-01/sessions.tsv"]


@pytest.mark.parametrize("name", LINKED)
@pytest.mark.parametrize("dead", [False, True])
def test_a_link_among_the_results_is_refused_by_name(
    results: Path, run: Run, name: str, *, dead: bool
) -> None:
    place, elsewhere, out = results / name, results.parent / "elsewhere", results.parent / "out"
    place.rename(elsewhere)
    place.symlink_to(results.parent / "nowhere" if dead else elsewhere)
    commands: list[list[Any]] = [["verify"], ["analyze", "--out", out], ["export"]]
    for command in (*commands, ["export", "--bids", out]):
        done = run(command[0], results, *command[1:])
        assert done.exit_code == 2, (command, done.output)
        assert done.stderr.startswith(f"error: {place}: ")
    assert not out.exists()
