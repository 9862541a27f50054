"""The journal: what is written comes back, and damage is never taken for a record."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
import zlib
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiment import Journal, JournalError, JournalWriteError, read_journal
from experiment.record.entries import MarkerSent, lines_of
from experiment.record.files import UNWAITED

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


def write(path: Path, *texts: str) -> None:
    with Journal(
        path, now_s=lambda: 1.25, wall_s=lambda: 2.0, up_s=lambda: 0.5, disk=UNWAITED
    ) as journal:
        for text in texts:
            journal.append(MarkerSent(marker=text, at_s=0.1), sync=True)


def texts_of(path: Path) -> list[str]:
    return [line.marker for line in lines_of(read_journal(path).entries, MarkerSent)]


def test_what_is_appended_is_read_back(path: Path) -> None:
    write(path)
    assert read_journal(path).head_sha256 == "0" * 64
    write(path, "first")
    assert re.fullmatch(
        r'\{"crc":"[0-9a-f]{8}","schema":5,"seq":1,"prev":"0{64}","event":"marker",.*\}\n',
        path.read_text(encoding="utf-8"),
    )
    write(path, "second", "é\n\u2028")
    entries = read_journal(path).entries
    assert texts_of(path) == ["first", "second", "é\n\u2028"]
    assert entries[2].line == MarkerSent(marker="é\n\u2028", at_s=0.1)
    assert (entries[0].t_s, entries[0].wall_s, entries[0].up_s) == (1.25, 2.0, 0.5)


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_any_changed_byte_is_found_with_its_line(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("journal") / "journal.jsonl"
    write(path, "first", "second", "third")
    raw = bytearray(path.read_bytes())
    place = data.draw(st.integers(0, len(raw) - 2))
    raw[place] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(raw)
    line = raw[:place].count(b"\n") + 1
    with pytest.raises(JournalError, match=rf"journal\.jsonl:{line}: "):
        read_journal(path)
    with pytest.raises(JournalError):
        Journal(path, now_s=lambda: 0.0)
    assert path.read_bytes() == raw
    assert [p.name for p in path.parent.iterdir()] == ["journal.jsonl"]


def test_a_sound_line_of_another_schema_is_refused(path: Path) -> None:
    body = b'"schema":1,"seq":1,"event":"first","t_s":0.0,"wall_s":0.0}'
    path.write_bytes(b'{"crc":"%08x",%b\n' % (zlib.crc32(b"{" + body), body))
    with pytest.raises(JournalError, match=r":1: schema .* 5; got 1: another version"):
        read_journal(path)


def test_a_missing_and_a_repeated_line_are_found(path: Path) -> None:
    write(path, "first", "second", "third")
    lines = path.read_bytes().splitlines(keepends=True)
    for damaged, line in (([lines[0], lines[2]], 2), ([lines[0], lines[0], lines[1]], 2)):
        path.write_bytes(b"".join(damaged))
        with pytest.raises(JournalError, match=rf":{line}: seq .* {line}"):
            read_journal(path)


def test_each_line_has_the_hash_of_the_line_before(path: Path) -> None:
    write(path, "first", "second")
    write(path, "third")
    lines = path.read_bytes().splitlines()
    hashes = [hashlib.sha256(line).hexdigest() for line in lines]
    assert [json.loads(line)["prev"] for line in lines] == ["0" * 64, *hashes[:2]]
    assert read_journal(path).sha256 == tuple(hashes)
    with Journal(path, now_s=lambda: 0.0, disk=UNWAITED) as journal:
        assert journal.head_sha256 == read_journal(path).head_sha256 == hashes[-1]
        journal.append(MarkerSent(marker="fourth", at_s=0.1))
        assert journal.head_sha256 == read_journal(path).head_sha256 != hashes[-1]


def test_a_changed_line_with_a_checksum_that_fits_breaks_the_chain_after_it(path: Path) -> None:
    write(path, "first", "second", "third")
    lines = path.read_bytes().splitlines(keepends=True)
    body = lines[1].replace(b"0.1", b"0.2").split(b",", 1)[1].rstrip(b"\n")
    lines[1] = b'{"crc":"%08x",%b\n' % (zlib.crc32(b"{" + body), body)
    path.write_bytes(b"".join(lines))
    with pytest.raises(JournalError, match=r":3: prev .*[0-9a-f]{12}"):
        read_journal(path)
    path.write_bytes(b"".join(lines[:2]))
    changed = MarkerSent(marker="second", at_s=0.2)
    assert read_journal(path).entries[1].line == changed  # the head alone tells of it


def test_a_last_line_cut_short_is_set_aside_wherever_it_was_cut(path: Path) -> None:
    write(path, "first", "second")
    whole = path.read_bytes()
    start = whole.index(b"\n") + 1
    for number, end in enumerate(range(start + 1, len(whole), 5), start=1):
        path.write_bytes(whole[:end])
        with Journal(path, now_s=lambda: 0.0, disk=UNWAITED) as journal:
            assert texts_of(path) == ["first"]
            assert journal.torn_file == path.with_name(f"journal.torn-{number}")
            assert journal.torn_file.read_bytes() == whole[start:end]
            journal.append(MarkerSent(marker="third", at_s=0.1))
        assert texts_of(path) == ["first", "third"]


def test_a_journal_that_cannot_be_opened_or_written_is_an_error(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with Journal(path, now_s=lambda: 0.0) as journal:
        journal.append(MarkerSent(marker="first", at_s=0.1))
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", full)
            with pytest.raises(JournalWriteError):
                journal.append(MarkerSent(marker="second", at_s=0.1))
        with pytest.raises(JournalWriteError):  # after an earlier failure
            journal.append(MarkerSent(marker="third", at_s=0.1))
    assert texts_of(path) == ["first"]
    with pytest.raises(JournalWriteError):
        Journal(path / "no-folder" / "journal.jsonl", now_s=lambda: 0.0)


@pytest.mark.parametrize(
    ("members", "named"),
    [
        ({"event": "noon"}, "noon"),
        ({"event": "marker", "marker": "begin"}, "marker.at_s: Field required"),
        ({"event": "marker", "marker": "begin", "at_s": "0.1"}, "marker.at_s: .*valid number"),
        ({"event": "marker", "marker": "begin", "at_s": 0.1, "volts": 3}, "marker.volts: Extra"),
        ({"event": "break", "t_s": None}, "none of a journal"),
    ],
)
def test_a_line_that_is_no_line_of_its_event_is_refused(
    path: Path, members: dict[str, object], named: str
) -> None:
    chain = {"schema": 5, "seq": 1, "prev": "0" * 64, "t_s": 0.0, "wall_s": 0.0, "up_s": 0.0}
    body = json.dumps(chain | members).encode()
    path.write_bytes(b'{"crc":"%08x",%b\n' % (zlib.crc32(body), body[1:]))
    with pytest.raises(JournalError, match=rf"journal\.jsonl:1: .*{named}"):
        read_journal(path)
