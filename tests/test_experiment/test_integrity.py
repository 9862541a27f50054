"""What was changed in a record after the session is named; an honest one is never suspected."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import json
import re
import shutil
import zlib
from dataclasses import replace
from random import Random
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

from analysis.reading.load import read_inputs
from analysis.reading.text import ResultFileError
from analysis.results.tables import analyse
from experiment.archive.files import ArchiveError
from experiment.archive.journal import ROOT, JournalError, read_journal
from experiment.integrity.heads import SessionHead, enter_head, read_heads
from experiment.integrity.sessions import examine, unaltered
from experiment.session.conduct import resume
from experiment.study.study import StudyError
from experiment.trial.plan import Plan, Trial, plan_from_json, seal
from tests.test_experiment.lab import Crash, Lab

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study
    from tests.conftest import Run

    Edit: TypeAlias = Callable[[Path], None]

SESSION = "sub-01/ses-01"


def chained(lines: list[bytes], *, damaged: int = 0) -> bytes:
    """Write journal lines as one would who knows how: numbers, hashes and checksums fit again.

    But for the checksum of a line that is to be damaged.
    """
    written, previous = b"", ROOT
    for number, line in enumerate(lines, start=1):
        facts = json.loads(line)
        del facts["crc"]
        facts |= {"seq": number, "prev": previous}
        body = json.dumps(facts, separators=(",", ":"), ensure_ascii=False).encode()
        made = b'{"crc":"%08x",%b' % (zlib.crc32(body) ^ (number == damaged), body[1:])
        previous = hashlib.sha256(made).hexdigest()
        written += made + b"\n"
    return written


def flip(name: str, share: float) -> Edit:
    """Change one bit of one byte, so far into a file."""

    def edit(results: Path) -> None:
        path = results / SESSION / name
        raw = bytearray(path.read_bytes())
        raw[int(share * (len(raw) - 1))] ^= 1
        path.write_bytes(raw)

    return edit


def rewrite(name: str, change: Callable[[str], str]) -> Edit:
    def edit(results: Path) -> None:
        path = results / SESSION / name
        before = path.read_text("utf-8")
        after = change(before)
        assert after != before
        path.write_bytes(after.encode())

    return edit


def rows(change: Callable[[list[str]], list[str]]) -> Edit:
    """Change the lines of trials.csv."""
    return rewrite("trials.csv", lambda text: "".join(change(text.splitlines(keepends=True))))


def cell(line: int, column: str, value: str) -> Edit:
    def change(lines: list[str]) -> list[str]:
        place = lines[0].rstrip("\n").split(",").index(column)
        cells = lines[line - 1].rstrip("\n").split(",")
        cells[place] = value
        return [*lines[: line - 1], ",".join(cells) + "\n", *lines[line:]]

    return rows(change)


def answer(at: int) -> Edit:
    """Turn an answer round, 0 the last, and the verdict, as somebody who knows the table."""

    def change(lines: list[str]) -> list[str]:
        names, line = lines[0].rstrip("\n").split(","), at or len(lines)
        told = dict(zip(names, lines[line - 1].rstrip("\n").split(","), strict=True))
        told["response"] = {"left": "right"}.get(told["response"], "left")
        told["correct"] = "true" if told["response"] == told["side"] else "false"
        return [*lines[: line - 1], ",".join(told.values()) + "\n", *lines[line:]]

    return rows(change)


def journal(change: Callable[[list[bytes]], list[bytes]], *, again: bool) -> Edit:
    """Change the lines of the journal, and chain them anew or leave them so."""

    def edit(results: Path) -> None:
        path = results / SESSION / "journal.jsonl"
        lines = change(path.read_bytes().splitlines())
        path.write_bytes(chained(lines) if again else b"".join(one + b"\n" for one in lines))

    return edit


def replaced(event: str, old: bytes, new: bytes) -> Callable[[list[bytes]], list[bytes]]:
    def change(lines: list[bytes]) -> list[bytes]:
        place = next(n for n, one in enumerate(lines) if event.encode() in one and old in one)
        return [*lines[:place], lines[place].replace(old, new, 1), *lines[place + 1 :]]

    return change


def resealed(results: Path) -> None:
    """Draw other levels into the plan, and seal it so that it holds by itself."""
    path = results / SESSION / "plan.json"
    contents = json.loads(path.read_bytes())
    for trial in contents["trials"]:
        if trial["level_vpp"] is not None:
            trial["level_vpp"] += 5.0
    study = json.dumps(contents["study"], sort_keys=True, separators=(",", ":"))
    whole = plan_of(contents, study)
    path.write_text(whole, encoding="utf-8")
    assert plan_from_json(whole).sha256 == json.loads(whole)["sha256"]


def plan_of(contents: dict[str, Any], study: str) -> str:
    made: dict[str, Any] = {name: contents.get(name) for name in Plan.__dataclass_fields__}
    for name in ("trials", "warm_up"):
        made[name] = tuple(Trial(**trial) for trial in contents[name])
    return seal(Plan(**made | {"study": study, "gains": ()})).to_json()


def of_another(name: str) -> Edit:
    def edit(results: Path) -> None:
        shutil.copy(results / "sub-02" / "ses-01" / name, results / SESSION / name)

    return edit


def gone(name: str) -> Edit:
    return lambda results: (results / SESSION / name).unlink()


def heads(change: Callable[[str], str]) -> Edit:
    def edit(results: Path) -> None:
        path = results / "sub-01" / "sessions.tsv"
        path.write_text(change(path.read_text("utf-8")), encoding="utf-8")

    return edit


def without_heads(results: Path) -> None:
    (results / "sub-01" / "sessions.tsv").unlink()


def renamed(results: Path) -> None:
    (results / SESSION).rename(results / "sub-01" / "ses-02")


EDITS: dict[str, tuple[Edit, str]] = {
    # what is done: how, and the file by which it is named
    "plan: its first byte": (flip("plan.json", 0.0), "plan.json"),
    "plan: a byte of the study": (flip("plan.json", 0.1), "plan.json"),
    "plan: a byte of the trials": (flip("plan.json", 0.7), "plan.json"),
    "plan: its last byte": (flip("plan.json", 1.0), "plan.json"),
    "plan: a blank more": (rewrite("plan.json", lambda t: t.replace("\n", "\n ", 1)), "plan.json"),
    "plan: its seed": (
        rewrite("plan.json", lambda t: re.sub(r'"seed": \d+', '"seed": 99', t)),
        "plan.json",
    ),
    "plan: sealed anew with other levels": (resealed, "plan.json"),
    "plan: of another person": (of_another("plan.json"), "plan.json"),
    "header: its first byte": (flip("header.json", 0.0), "header.json"),
    "header: a byte within": (flip("header.json", 0.5), "header.json"),
    "header: its last byte": (flip("header.json", 1.0), "header.json"),
    "header: the device": (
        rewrite("header.json", lambda t: t.replace("mock", "M1")),
        "header.json",
    ),
    "header: of another person": (of_another("header.json"), "header.json"),
    "header: gone": (gone("header.json"), "header.json: is missing"),
    "journal: its first byte": (flip("journal.jsonl", 0.0), "journal.jsonl:1:"),
    "journal: a byte within": (flip("journal.jsonl", 0.5), "journal.jsonl:"),
    "journal: its last byte": (flip("journal.jsonl", 1.0), "sessions.tsv:2:"),
    "journal: a line removed": (
        journal(lambda lines: [*lines[:9], *lines[10:]], again=False),
        "journal.jsonl:10:",
    ),
    "journal: a line repeated": (
        journal(lambda lines: [*lines[:9], *lines[8:]], again=False),
        "journal.jsonl:10:",
    ),
    "journal: its last line removed": (
        journal(lambda lines: lines[:-1], again=False),
        "sessions.tsv:2:",
    ),
    "journal: cut at half": (journal(lambda lines: lines[:20], again=False), "sessions.tsv:2:"),
    "journal: emptied": (journal(lambda _: [], again=False), "sessions.tsv:2:"),
    "journal: of another person": (of_another("journal.jsonl"), "plan.json"),
    "journal: a line removed, chained": (
        journal(lambda lines: [*lines[:-9], *lines[-8:]], again=True),
        "sessions.tsv:2:",
    ),
    "journal: cut, chained": (journal(lambda lines: lines[:20], again=True), "sessions.tsv:2:"),
    "journal: another answer, chained": (
        journal(replaced("response", b'"left"', b'"right"'), again=True),
        "sessions.tsv:2:",
    ),
    "journal: another reaction time, chained": (
        journal(replaced("response", b'"rt_s":0.5', b'"rt_s":0.4'), again=True),
        "sessions.tsv:2:",
    ),
    "journal: another level, chained": (
        journal(replaced("stimulus_confirmed", b'"level_', b'"nevel_'), again=True),
        "sessions.tsv:2:",
    ),
    "journal: no simulation, chained": (
        journal(replaced("session_open", b'"simulated":true', b'"simulated":false'), again=True),
        "sessions.tsv:2:",
    ),
    "journal: a note put in, chained": (
        journal(lambda lines: [*lines[:8], lines[8], lines[7], *lines[9:]], again=True),
        "sessions.tsv:2:",
    ),
    "trials.csv: a byte of the heading": (flip("trials.csv", 0.001), "trials.csv:1:"),
    "trials.csv: a byte within": (flip("trials.csv", 0.5), "trials.csv:"),
    "trials.csv: its last byte": (flip("trials.csv", 1.0), "trials.csv:"),
    "trials.csv: an answer and its verdict": (answer(4), "trials.csv:4:"),
    "trials.csv: the last answer": (answer(0), "trials.csv:"),
    "trials.csv: a reaction time": (cell(5, "rt_s", "0.25"), "trials.csv:5:"),
    "trials.csv: a level": (cell(3, "level_vpp", "61"), "trials.csv:3:"),
    "trials.csv: a trial made void": (cell(6, "status", "voided"), "trials.csv:6:"),
    "trials.csv: noise that played": (cell(6, "noise_ok", "true"), "trials.csv:6:"),
    "trials.csv: a real device": (cell(6, "device_kind", "real"), "trials.csv:6:"),
    "trials.csv: a row removed": (rows(lambda r: [*r[:3], *r[4:]]), "trials.csv:4:"),
    "trials.csv: the last row removed": (rows(lambda r: r[:-1]), "trials.csv:"),
    "trials.csv: a row repeated": (rows(lambda r: [*r[:4], *r[3:]]), "trials.csv:5:"),
    "trials.csv: two rows exchanged": (
        rows(lambda r: [*r[:2], r[3], r[2], *r[4:]]),
        "trials.csv:",
    ),
    "trials.csv: other line ends": (
        rewrite("trials.csv", lambda t: t.replace("\n", "\r\n")),
        "trials.csv:1:",
    ),
    "trials.csv: of another person": (of_another("trials.csv"), "trials.csv:2:"),
    "sessions.tsv: a digit of the hash": (
        heads(lambda t: re.sub(r"\t([0-9a-f])", lambda m: f"\t{'0' if m[1] > '0' else '1'}", t)),
        "sessions.tsv:",
    ),
    "sessions.tsv: of another session": (
        heads(lambda t: t.replace("ses-", "ses-9")),
        "sessions.tsv",
    ),
    "sessions.tsv: a row removed": (heads(lambda t: t.split("\n")[0] + "\n"), "sessions.tsv"),
    "sessions.tsv: a row repeated": (
        heads(lambda t: t + t.split("\n")[1] + "\n"),
        "sessions.tsv:3:",
    ),
    "sessions.tsv: gone": (without_heads, "sessions.tsv"),
    "folder: of another session": (renamed, "plan.json"),
}  # fmt: skip


@pytest.fixture(scope="module")
def recorded(
    tmp_path_factory: pytest.TempPathFactory, make_study: Callable[[str], Study],
    short_study_text: str,
) -> Path:  # fmt: skip
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
    copy = tmp_path / "results"
    shutil.copytree(recorded, copy)
    return copy


def test_there_are_at_least_forty_edits() -> None:
    assert len(EDITS) >= 40


def test_what_was_recorded_is_not_suspected(results: Path, run: Run) -> None:
    done = run("verify", results)
    assert done.exit_code == 0, done.output
    heads_told = re.findall("  head ([0-9a-f]{64})\n", done.output)
    journals = sorted(results.glob("sub-*/ses-*/journal.jsonl"))
    assert heads_told == [read_journal(path).head_sha256 for path in journals]
    assert not read_inputs([results]).altered
    events = [entry.event for entry in read_journal(journals[0]).entries]
    assert {"session_resume", "session_close"} <= {*events}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_is_found_and_named(results: Path, run: Run, name: str) -> None:
    edit, named = EDITS[name]
    edit(results)
    done = run("verify", results)
    assert (done.exit_code, named in done.output) == (1, True), done.output
    with pytest.raises(ResultFileError) as caught:
        read_inputs([results])
    told = str(caught.value)
    assert re.search(r"(plan\.json|header\.json|journal\.jsonl|trials\.csv|sessions\.tsv)\b", told)
    assert "\n" not in told


def test_a_record_whose_checksums_fit_is_read_without_its_trials_in_the_journal(
    results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for session in sorted(results.glob("sub-*/ses-*")):
        found, examined = unaltered(session), examine(session)
        assert found
        assert found == replace(examined, history=None)
    whole = read_inputs([results])
    monkeypatch.setattr("experiment.integrity.sessions.replay", None)
    assert read_inputs([results]).trials.equals(whole.trials)


def whole_rewritten(results: Path, edit: Edit) -> None:
    """Edit the journal and write the head that it has then into sessions.tsv."""
    edit(results)
    head = read_journal(results / SESSION / "journal.jsonl").head_sha256
    heads(lambda text: re.sub("[0-9a-f]{64}", head, text))(results)


def test_without_the_table_s_checksum_the_journal_is_compared(results: Path) -> None:
    def change(lines: list[bytes]) -> list[bytes]:
        return [*lines[:-1], re.sub(b',"trials_sha256":"[0-9a-f]+"', b"", lines[-1])]

    whole_rewritten(results, journal(change, again=True))
    assert unaltered(results / SESSION) is None
    assert not read_inputs([results]).altered


def checksums_anew(session: Path, *, damaged: int = 0) -> None:
    """Make the checksums of plan and table in the journal fit the files, and chain it anew."""
    path = session / "journal.jsonl"
    first, *between, last = path.read_bytes().splitlines()
    for name, key in (("plan.json", b"plan_file_sha256"), ("trials.csv", b"trials_sha256")):
        made = b'%b":"%b"' % (
            key,
            hashlib.sha256((session / name).read_bytes()).hexdigest().encode(),
        )
        first, last = (re.sub(rb'%b":"[0-9a-f]+"' % key, made, line) for line in (first, last))
    path.write_bytes(chained([first, *between, last], damaged=damaged))


GIVEN_UP: dict[str, tuple[Edit, int, str]] = {
    # how, which line of the journal is damaged, if any, and what verify says of it
    "another answer": (
        journal(replaced("response", b'"left"', b'"right"'), again=True), 0, "trials.csv:",
    ),
    "a line damaged": (lambda _: None, 9, "journal.jsonl:9: this line is damaged"),
    "the plan's seal broken": (
        rewrite("plan.json", lambda t: re.sub(r'"seed": \d+', '"seed": 99', t)), 0, "plan.json:",
    ),
    "other line ends": (
        rewrite("trials.csv", lambda t: t.replace("\n", "\r\n")), 0, "trials.csv:1: is written",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", GIVEN_UP)
def test_verify_reads_everything_whatever_the_checksums_say(
    results: Path, run: Run, name: str
) -> None:
    edit, damaged, told = GIVEN_UP[name]
    edit(results)
    checksums_anew(results / SESSION, damaged=damaged)
    head = hashlib.sha256(
        (results / SESSION / "journal.jsonl").read_bytes().splitlines()[-1]
    ).hexdigest()
    heads(lambda text: re.sub("[0-9a-f]{64}", head, text))(results)
    assert unaltered(results / SESSION)  # docs/session.md says so: "Not covered"
    done = run("verify", results)
    assert (done.exit_code, told in done.output) == (1, True), done.output
    assert run("export", results, "--bids", results.parent / "bids").exit_code == 2


@pytest.mark.parametrize("name", EDITS)
@pytest.mark.slow
def test_what_is_accepted_is_read_with_its_mark_or_is_no_table(results: Path, name: str) -> None:
    EDITS[name][0](results)
    loaded = None
    with contextlib.suppress(ResultFileError):
        loaded = read_inputs([results], accept_altered=True)
    if loaded is None:  # no table any more, or one that contradicts itself
        assert name.split(":", maxsplit=1)[0] in {"trials.csv", "folder"}
    else:
        assert len(loaded.altered) == 1
        told = "Altered after recording: 1 of 2 sessions"
        if name in {"sessions.tsv: of another session", "folder: of another session"}:
            told += "; Lost after recording, left out: 1 session"
        assert analyse(loaded).mark.endswith(told)


def test_analyze_names_what_verify_names_and_writes_nothing(results: Path, run: Run) -> None:
    answer(4)(results)
    table = results / SESSION / "trials.csv"
    done = run("analyze", results, "--out", results.parent / "out")
    assert done.exit_code == 2
    assert done.stderr.startswith(f"error: {table}:4: column 'response' is 'right'; by the journal")
    assert not (results.parent / "out").exists()


def test_a_table_that_contradicts_itself_is_not_promised_to_be_taken(
    results: Path, run: Run
) -> None:
    path = results / SESSION / "trials.csv"
    names, first, *others = path.read_text("utf-8").splitlines()
    told = dict(zip(names.split(","), first.split(","), strict=True))
    assert told["correct"] == "true"
    told["response"] = {"left": "right"}.get(told["response"], "left")
    path.write_text("\n".join([names, ",".join(told.values()), *others, ""]), "utf-8")
    command = ("analyze", results, "--out", results.parent / "out")
    assert "--accept-altered" in run(*command).stderr
    done = run(*command, "--accept-altered")
    assert done.exit_code == 2
    assert f"{path}:2: column 'correct' is true; it must be what kind, side and" in done.stderr


@pytest.mark.slow
def test_what_is_accepted_is_marked_in_every_output(results: Path, run: Run) -> None:
    of_another("header.json")(results)
    out = results.parent / "out"
    done = run("analyze", results, "--out", out, "--accept-altered", "--no-figures")
    assert done.exit_code == 0, done.output
    told = "Altered after recording: 1 of 2 sessions"
    assert told in done.stdout
    assert f"warning: altered after recording: {SESSION}/header.json" in done.stdout
    summary = json.loads((out / "summary.json").read_bytes())
    assert told in summary["mark"]
    assert [one.split(":")[0] for one in summary["altered"]] == [f"{SESSION}/header.json"]
    assert any("recording" in one for one in summary["warnings"])
    assert told in (out / "report.html").read_text("utf-8")
    for table in sorted(out.glob("*.csv")):
        with table.open(encoding="utf-8", newline="") as file:
            told_of = {line["altered"] for line in csv.DictReader(file)}
        assert told_of <= {"true", "false", "mixed"}, table
    people = (out / "participants.csv").read_text("utf-8").splitlines()[1:]
    assert {(line[:2], line.rsplit(",", 1)[1]) for line in people} == {
        ("01", "true"),
        ("02", "false"),
    }


def test_figures_carry_the_mark(results: Path, run: Run) -> None:
    of_another("header.json")(results)
    loaded = read_inputs([results], accept_altered=True)


def test_a_plan_that_is_in_doubt_is_not_read(results: Path) -> None:
    resealed(results)
    loaded = read_inputs([results], accept_altered=True)
    assert [one.participant for one in loaded.progress] == ["02"]
    assert [*loaded.altered] == [str(results / SESSION / "trials.csv")]


def test_a_session_whose_folder_is_lost_is_told_by_an_analysis(results: Path) -> None:
    shutil.rmtree(results / SESSION)
    with pytest.raises(ResultFileError, match=r"sessions\.tsv:2: session 01 ended on "):
        read_inputs([results])
    loaded = read_inputs([results], accept_altered=True)
    told = [one for one in analyse(loaded).warnings if "is lost" in one]
    assert len(told) == 1
    assert "sub-01/sessions.tsv:2: session 01 ended on " in told[0]
    assert not read_inputs([results / "sub-02"]).lost


def test_a_session_whose_table_was_removed_is_not_left_out_silently(results: Path) -> None:
    (results / SESSION / "trials.csv").unlink()
    with pytest.raises(ResultFileError, match=r"2 of sessions\.tsv"):
        read_inputs([results])
    loaded = read_inputs([results], accept_altered=True)
    table = f"{SESSION}/trials.csv"
    assert loaded.lost == {SESSION: (f"{table}: is missing; line 2 of sessions.tsv tells of it",)}
    with (results / SESSION / "journal.jsonl").open("r+b") as file:
        lines = file.readlines()[:10]
        file.seek(0)
        file.truncate()
        file.writelines(lines)
    without_heads(results)  # as of a session that was cut off before its first end
    assert read_inputs([results]).without_table == {SESSION: "tactstrip export DIR builds it"}


@pytest.mark.slow
def test_a_table_without_a_journal_is_analysed_and_marked(results: Path, run: Run) -> None:
    (results / SESSION / "journal.jsonl").unlink()
    out = results.parent / "out"
    done = run("analyze", results, "--out", out, "--no-figures")
    assert done.exit_code == 0, done.output
    summary = json.loads((out / "summary.json").read_bytes())
    assert summary["not_compared"] == [f"{SESSION}/trials.csv"]
    removed = f"{SESSION}/journal.jsonl: is missing; line 2 of sessions.tsv tells of it"
    assert summary["altered"] == [removed]
    assert removed in " ".join(done.stdout.split())
    named = run("verify", results)
    assert named.exit_code == 1
    assert "2 of sessions.tsv" in named.stdout


def test_a_record_of_another_version_is_named_with_both_schemas(results: Path, run: Run) -> None:
    path = results / SESSION / "journal.jsonl"
    first, rest = path.read_bytes().split(b"\n", 1)
    facts = json.loads(first)
    del facts["crc"]
    body = json.dumps(facts | {"schema": 1}, separators=(",", ":")).encode()
    path.write_bytes(b'{"crc":"%08x",%b\n%b' % (zlib.crc32(body), body[1:], rest))
    for command in ("verify", "analyze"):
        done = run(command, results)
        others = "sub-02/ses-01: as it was recorded" if command == "verify" else ""
        assert (done.exit_code, others in done.stdout) == (2, True)
        assert done.stderr == f"error: {path}:1: schema must be 2; got 1\n"


def test_verify_lists_every_difference_with_its_line(results: Path, run: Run) -> None:
    answer(3)(results)
    cell(5, "rt_s", "0.25")(results)
    of_another("header.json")(results)
    told = run("verify", results).stdout
    assert "3 differences" not in told  # an answer and its verdict are two cells
    for place in ("header.json: ", "trials.csv:3: column 'response'", "trials.csv:3: column 'c",
                  "trials.csv:5: column 'rt_s' is '0.25'; by the journal it is '0.5'"):  # fmt: skip
        assert place in told


def test_a_session_that_was_deleted_is_named_by_its_head(results: Path, run: Run) -> None:
    shutil.rmtree(results / SESSION)
    done = run("verify", results)
    assert done.exit_code == 1
    assert re.search(
        r"sub-01/sessions\.tsv:2: session 01 ended on .*, and its folder is lost", done.stdout
    )


def test_export_builds_a_changed_table_anew_and_says_what_was_changed(
    results: Path, run: Run
) -> None:
    table = results / SESSION / "trials.csv"
    before = table.read_bytes()
    answer(4)(results)
    published = run("export", results, "--bids", results.parent / "bids")
    assert (published.exit_code, f"{table}:4: column 'response'" in published.stderr) == (2, True)
    assert not (results.parent / "bids").exists()
    done = run("export", results)
    assert (done.exit_code, table.read_bytes()) == (0, before)
    assert f"{table}:4: column 'response' is 'right'; by the journal" in done.stderr
    assert run("verify", results).exit_code == 0


def test_export_refuses_a_record_that_no_journal_can_mend(results: Path, run: Run) -> None:
    of_another("header.json")(results)
    for more in ((), ("--bids", results.parent / "bids")):
        done = run("export", results, *more)
        assert (done.exit_code, "header.json:" in done.stderr) == (2, True)


@pytest.fixture
def lab(
    make_study: Callable[[str], Study], short_study_text: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> Lab:  # fmt: skip
    return Lab(make_study(short_study_text), tmp_path / "results", monkeypatch)


def test_a_session_goes_on_only_with_the_record_that_it_left(lab: Lab) -> None:
    assert not lab.begin(pause={1: False}).finished
    header, heads_file = lab.folder.header_path, lab.folder.path.parent / "sessions.tsv"
    for path, words in ((header, "header.json: is not the file"), (heads_file, "is of no line of")):
        before = path.read_text("utf-8")
        path.write_text(before.replace("e", "d").replace("1", "2"), encoding="utf-8")
        if path == heads_file:
            path.write_text(re.sub("[0-9a-f]{64}", "a" * 64, before), encoding="utf-8")
        with pytest.raises(ArchiveError, match=words):
            lab.resume()
        path.write_text(before, encoding="utf-8")
    assert lab.resume().finished


def test_the_head_is_told_and_kept_when_a_sitting_ends(lab: Lab) -> None:
    first = lab.begin(pause={1: False})
    (head,) = read_heads(lab.folder.path.parent)
    assert (
        first.head_sha256 == head.head_sha256 == read_journal(lab.folder.journal_path).head_sha256
    )
    second = lab.resume()
    (head,) = read_heads(lab.folder.path.parent)
    assert first.head_sha256 != second.head_sha256 == head.head_sha256
    ended = head.ended
    assert lab.resume().head_sha256 == second.head_sha256
    assert read_heads(lab.folder.path.parent)[0].ended == ended


def test_heads_of_other_sessions_stay(tmp_path: Path) -> None:
    for session, digit in (("01", "a"), ("02", "b"), ("01", "c")):
        enter_head(tmp_path, SessionHead(session=session, head_sha256=digit * 64, ended="then"))
    told = {head.session: head.head_sha256[0] for head in read_heads(tmp_path)}
    assert told == {"01": "c", "02": "b"}


def test_a_session_whose_folder_is_lost_is_not_begun_anew(lab: Lab) -> None:
    lab.begin()
    shutil.rmtree(lab.folder.path)
    with pytest.raises(ArchiveError, match=r"sessions\.tsv:2:"):
        lab.begin()
    assert not lab.folder.path.exists()


def test_killed_before_its_head_is_kept_a_session_is_put_right_by_a_resume(lab: Lab) -> None:
    with lab.killed_after("session_close"), pytest.raises(Crash):
        lab.begin()
    (difference,) = examine(lab.folder.path).differences
    assert (difference.path.name, difference.mended_by) == ("sessions.tsv", "resume")
    told: list[str] = []
    assert resume(lab.folder, replace(lab.setting(), tell=told.append)).finished
    (line,) = told
    assert line.endswith("whose journal has ended; it is written anew.")
    assert "sessions.tsv:" in line
    assert not examine(lab.folder.path).differences


def test_an_earlier_head_of_the_same_chain_is_put_right_by_a_resume_and_told(lab: Lab) -> None:
    lab.begin(pause={1: False}, ask={2: (None, 0.1)})
    heads = lab.folder.path.parent / "sessions.tsv"
    earlier = heads.read_bytes()
    while not lab.resume().finished:
        pass
    heads.write_bytes(earlier)
    (difference,) = examine(lab.folder.path).differences
    assert difference.mended_by == "resume"
    told: list[str] = []
    assert resume(lab.folder, replace(lab.setting(), tell=told.append)).finished
    assert ["sessions.tsv:2:" in line for line in told] == [True]
    assert not examine(lab.folder.path).differences


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
        if how == 3 and lab.folder.journal_path.stat().st_size and not ended(lab):
            with lab.folder.journal_path.open("ab") as file:
                file.write(b'{"crc":"00')
        amiss = examine(lab.folder.path).differences
        assert {one.mended_by for one in amiss} <= {"resume"}, amiss
    (lab.resume if lab.folder.plan_path.exists() else lab.begin)()


def ended(lab: Lab) -> bool:
    return examine(lab.folder.path).ended


def never_suspected(study: Study, root: Path, patch: pytest.MonkeyPatch, people: int) -> None:
    rng = Random(people)
    for number in range(people):
        lab = Lab(study, root, patch, participant=f"{number:03d}", seed=number)
        honest(lab, rng)
        assert examine(lab.folder.path).differences == ()
        assert unaltered(lab.folder.path)
    loaded = read_inputs([root])
    assert (loaded.altered, loaded.not_compared) == ({}, ())


def test_honest_sessions_are_never_suspected(
    make_study: Callable[[str], Study], short_study_text: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    never_suspected(make_study(short_study_text), tmp_path / "results", monkeypatch, 3)


@pytest.mark.long
def test_none_of_two_hundred_honest_sessions_is_suspected(
    make_study: Callable[[str], Study], short_study_text: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    never_suspected(make_study(short_study_text), tmp_path / "results", monkeypatch, 200)


def test_a_table_alone_is_not_as_it_was_recorded(results: Path) -> None:
    session = results / SESSION
    for name in ("journal.jsonl", "plan.json", "header.json"):
        (session / name).unlink()
    (session.parent / "sessions.tsv").unlink()
    (difference,) = examine(session).differences


def test_bytes_after_the_end_of_a_session_are_found(results: Path) -> None:
    session = results / SESSION
    with (session / "journal.jsonl").open("ab") as journal:
        journal.write(b"x")
    (difference,) = examine(session).differences


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
    told: list[str] = []
    resume(lab.folder, replace(lab.setting(), tell=told.append))
    assert any(line.endswith("tells of it; it is written anew.") for line in told)
    assert table.read_bytes().startswith(written)


def test_a_session_has_ended_whatever_lies_at_its_table(lab: Lab) -> None:
    table = lab.folder.trials_path

    def spoil() -> tuple[str, float]:
        table.write_bytes(b"\n" * 999)
        return "left", 0.5

    with pytest.raises(JournalError, match="998 trials"):
        lab.begin(ask={2: spoil})
    assert lab.entries()[-1].facts == {"finished": True}
    table.unlink()
    opened = lab.device.open
    lab.patch.setattr(lab.device, "open", None)
    assert lab.resume().finished
    lab.patch.setattr(lab.device, "open", opened)
    assert unaltered(lab.folder.path) is None
    assert examine(lab.folder.path).differences == ()


def test_a_stray_measured_csv_is_to_be_removed(results: Path, run: Run) -> None:
    path = results / SESSION / "measured.csv"
    path.write_text("schema,trial\n2,1\n", encoding="utf-8")
    for command in (["export"], ["export", "--bids", results.parent / "bids"], ["analyze"]):
        done = run(*command, results)
        assert done.exit_code == 2
        assert f"{path}: is there, though nothing was measured; remove it" in done.stderr
        assert "copy" not in done.stderr


@pytest.mark.parametrize("told", [None, "0.0.1"])
def test_a_session_of_a_version_with_other_keys_is_named_with_it(
    lab: Lab, run: Run, told: str | None
) -> None:
    lab.begin(pause={1: False})
    folder, results = lab.folder, lab.folder.root
    plan = json.loads(folder.plan_path.read_bytes())
    del plan["study"]["monitor"]
    study = json.dumps(plan["study"], sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    older = plan_of(plan, study)
    folder.plan_path.write_text(older, encoding="utf-8")
    if told:
        header = re.sub(
            '("tactstrip": ")[^"]+', rf"\g<1>{told}", folder.header_path.read_text("utf-8")
        )
        folder.header_path.write_text(header, encoding="utf-8")
    first, *lines = folder.journal_path.read_bytes().splitlines()
    opening = json.loads(first) | folder.sealed() | {"plan_sha256": json.loads(older)["sha256"]}
    folder.journal_path.write_bytes(chained([json.dumps(opening).encode(), *lines]))
    head = read_journal(folder.journal_path).head_sha256
    heads(lambda text: re.sub("[0-9a-f]{64}", head, text))(results)
    assert run("verify", results).exit_code == 0
    assert len(read_inputs([results]).progress) == 1
    who = f"tactstrip {told}" if told else "another version of tactstrip"
    words = f"{folder.plan_path}: was recorded by {who}, whose studies"
    with pytest.raises(StudyError, match=re.escape(words)):
        lab.resume()
    done = run("export", results, "--bids", results.parent / "bids")
    assert (done.exit_code, words in done.stderr) == (2, True)
    assert not (results.parent / "bids").exists()
