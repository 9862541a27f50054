"""Spreading work: the same numbers however it is cut; what is kept is not computed again."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest

from tests.plates import on_paper_plate
from tests.test_analysis.shared import put, run
from tests.test_analysis.toy import STUDIES, Studies, begin, chunks, draw, keeping, numbers

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

ALONE = numbers(begin(chunks(STUDIES)))


@pytest.mark.parametrize("size", [1, 7, STUDIES])
def test_numbers_do_not_depend_on_the_size_of_chunks_or_their_order(size: int) -> None:
    assert numbers(begin(reversed(chunks(size)))) == ALONE


def test_chunks_are_taken_as_they_are_needed() -> None:
    endless = iter(int, 1)
    results = begin(Studies(0, first, 2) for first in endless)
    assert next(results)[1] == next(results)[1]


def test_a_run_that_was_stopped_continues_from_its_file(tmp_path: Path) -> None:
    path, computed = tmp_path / "power.jsonl", []

    def watched(chunk: Studies) -> object:
        computed.append(chunk)
        return draw(chunk)

    for stopped_after in (3, 2, None):
        with keeping(path) as kept:
            results = begin(chunks(10), watched, kept=kept)
            found = [
                result for _, result in zip(range(stopped_after or 100), results, strict=False)
            ]
            results.close()  # type: ignore[attr-defined]
        path.write_bytes(path.read_bytes() + b'{"chunk": "0a')  # the line at which it was killed
    assert numbers(found) == ALONE
    assert sorted(computed, key=repr) == sorted(chunks(10), key=repr)


@pytest.mark.parametrize("content", [None, "[design]\n", '{"schema": 1}\n', "trial,level"])
def test_a_file_of_something_else_is_refused_and_left_alone(
    content: str | None, tmp_path: Path
) -> None:
    path = tmp_path / "power.jsonl"
    if content is None:
        with keeping(path, seed=8):
            pass
    else:
        path.write_text(content)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        keeping(path).__enter__()
    assert content is not None or all(seed in str(caught.value) for seed in ("seed 8", "7"))
    assert path.read_bytes() == before


STUDY = """
[design]
levels_vpp = [80.0]
trials_per_side = 5
both_trials = 0
[simulation]
threshold_vpp = 80.0
threshold_sd_db = 2.0
"""


def power(folder: Path, *options: object) -> Result:
    asked = ("--goal", "detection=40%@80V", "--participants", 1, 2, "--json", *options)
    return run("power", put(folder / "study.toml", on_paper_plate(STUDY)), *asked)


@pytest.mark.slow
def test_power_continues_from_its_file_with_its_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "power.jsonl"

    def stopped(*arguments: Any, **options: Any) -> Any:
        yield next(begin(arguments[1], arguments[0], **options))
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("analysis.workers.chunks.spread", stopped)
        assert power(tmp_path).exit_code == 130
        first = power(tmp_path, "--keep", kept, "--seed", 5)
    assert first.exit_code == 4
    assert str(kept) in first.stderr.splitlines()[-1]
    before = kept.read_bytes()
    again, alone = power(tmp_path, "--keep", kept), power(tmp_path, "--seed", 5)
    assert again.exit_code == alone.exit_code == 0
    assert again.stdout == alone.stdout != ""
    assert kept.read_bytes().startswith(before)
    other = power(tmp_path, "--keep", kept, "--seed", 6)
    assert (other.exit_code, other.stderr.count("\n")) == (2, 1)
