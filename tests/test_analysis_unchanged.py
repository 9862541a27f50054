"""A table that changes while it is read is refused."""

from __future__ import annotations

import hashlib
import io
from typing import TYPE_CHECKING

import pytest
from click.testing import CliRunner

from analysis.commands import analyze
from analysis.rows import mapped_rows
from analysis.unchanged import HashedFile

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pandas as pd

    from analysis import ColumnMap

HEADER = "participant,side,level_vpp,response\n"


@pytest.mark.parametrize("content", [b"", b"a", b"line\n" * 40_000])
def test_the_checksum_is_that_of_the_file(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with HashedFile(path) as file, io.BufferedReader(file) as stream:
        while stream.readline(1000):
            pass
        assert file.unchanged_sha256() == hashlib.sha256(content).hexdigest()


def appended(path: Path) -> None:
    with path.open("a") as file:
        file.write("1,left,95,left\n")


def overwritten(path: Path) -> None:
    path.write_text(path.read_text().replace("60", "61"))


def replaced(path: Path) -> None:
    other = path.with_suffix(".new")
    other.write_text(HEADER + "2,left,60,left\n")
    other.replace(path)


@pytest.mark.parametrize("change", [appended, overwritten, replaced])
def test_a_table_changed_while_it_is_read_is_one_line_with_exit_code_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Path], None]
) -> None:
    path, names = tmp_path / "t.csv", tmp_path / "names.toml"
    path.write_text(HEADER + "1,left,60,left\n")
    names.write_text("")

    def read_and_change(text: pd.DataFrame, file: str, columns: ColumnMap) -> pd.DataFrame:
        change(path)
        return mapped_rows(text, file, columns)

    monkeypatch.setattr("analysis.load.mapped_rows", read_and_change)
    options = [str(path), "--columns", str(names), "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(analyze, options)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {path}: it changed while it was read")
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
