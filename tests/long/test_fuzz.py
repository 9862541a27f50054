"""Damaged files are read or refused. TACTSTRIP_LONG=0.1 runs a seeded tenth of each test."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np
import pytest

from analysis import ResultFileError, read_trials
from experiment import StudyError
from experiment.record.journal import JournalError, read_journal

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment import Study
    from tests.conftest import Run, Simulate

SHARE = float(os.environ.get("TACTSTRIP_LONG", "1"))
NASTY = (
    *(b"", b"\0", b"\xff\xfe", b"\r\n", b'"', b"n/a", b"-1", b"1e999", b"nan", b"["),
    "\u202e".encode(),
)
RECORD = ("plan.json", "header.json", "journal.jsonl", "trials.csv")


def rounds(whole: int) -> int:
    """How many of so many rounds are run; each draws from its own number."""
    return max(1, math.ceil(SHARE * whole))


def damaged(raw: bytes, rng: np.random.Generator) -> bytes:
    """Change, cut, repeat or insert something in one place, or in a few."""
    if rng.random() < 0.2:
        return raw[: rng.integers(len(raw))]
    for _ in range(rng.integers(1, 3)):
        at, end = sorted(rng.integers(0, len(raw) + 1, 2).tolist())
        end = min(end, at + 40)
        some = bytes(rng.integers(0, 256, 3, dtype=np.uint8))
        put = (NASTY[rng.integers(len(NASTY))], some, raw[at:end] * 2, b"")[rng.integers(4)]
        raw = raw[:at] + put + raw[end:]
    return raw


def refused(
    raw: bytes, whole: int, read: Callable[[bytes], object], error: type[Exception]
) -> list[str]:
    """Read damaged bytes, and return the messages of those that are refused."""
    messages = []
    for number in range(rounds(whole)):
        try:
            read(damaged(raw, np.random.default_rng(number)))
        except error as refusal:
            messages.append(str(refusal))
    assert messages
    return messages


@pytest.fixture
def session(tmp_path: Path, simulate: Simulate) -> Path:
    """The folder of a simulated participant's session of five trials."""
    return simulate(tmp_path / "results") / "sub-01" / "ses-01"


def test_a_study_file_of_any_text_is_read_or_refused(
    tmp_path: Path, run: Run, make_study: Callable[[str], Study]
) -> None:
    path = tmp_path / "study.toml"
    assert run("init", path).exit_code == 0

    def read(raw: bytes) -> None:
        make_study(raw.decode(errors="replace"))

    messages = refused(path.read_bytes(), 20_000, read, StudyError)
    assert all("study.toml" in line for line in messages)


def test_a_journal_of_any_bytes_is_a_beginning_or_refused(session: Path) -> None:
    path = session / "journal.jsonl"
    whole = read_journal(path).entries

    def read(raw: bytes) -> None:
        path.write_bytes(raw)
        entries = read_journal(path).entries
        assert entries == whole[: len(entries)]

    refused(path.read_bytes(), 20_000, read, JournalError)


@pytest.mark.parametrize("name", RECORD)
def test_every_change_of_a_record_is_found(session: Path, run: Run, name: str) -> None:
    path, results = session / name, session.parents[1]
    whole = path.read_bytes()
    assert run("verify", results).exit_code == 0
    for number in range(rounds(3000)):
        raw = damaged(whole, np.random.default_rng(number))
        path.write_bytes(raw)
        assert run("verify", results).exit_code in ((0,) if raw == whole else (1, 2)), number


def test_a_table_of_any_bytes_is_read_or_refused(session: Path, tmp_path: Path) -> None:
    raw, table = (session / "trials.csv").read_bytes(), tmp_path / "alone.csv"

    def read(raw: bytes) -> int:
        table.write_bytes(raw)
        return len(read_trials([table]))

    assert read(raw) == 5
    assert all("alone.csv" in line for line in refused(raw, 10_000, read, ResultFileError))
