"""Spreading work: the same numbers however it is cut; kept results are not computed again."""

from __future__ import annotations

import json
import os
import re
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from analysis.planning.spread import Kept, spread
from tests.plates import on_paper_plate
from tests.test_analysis.shared import put, run

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from click.testing import Result

STUDIES = 60


@dataclass(frozen=True)
class Studies:
    """Some numbers to draw, each from a seed of its own."""

    first: int
    last: int
    spin_s: float = 0.0


def chunks(size: int, spin_s: float = 0.0) -> list[Studies]:
    return [Studies(first, min(first + size, STUDIES), spin_s) for first in range(0, STUDIES, size)]


def draw(chunk: Studies) -> list[float]:
    until_s = time.process_time() + chunk.spin_s
    while time.process_time() < until_s:
        pass
    return [float(np.random.default_rng((7, i)).normal()) for i in range(chunk.first, chunk.last)]


def end_the_process(_: Studies) -> None:
    """End what computes it, as the system does with a process that takes too much memory."""
    os._exit(9)


def numbers(results: Iterable[tuple[Studies, Any]]) -> list[float]:
    ordered = sorted(results, key=lambda pair: pair[0].first)
    return [number for _, values in ordered for number in values]


ALONE = draw(Studies(0, STUDIES))


def keeping(path: Path, seed: int = 7) -> Kept:
    return Kept(path, {"study": "5f" * 32, "seed": seed})


@pytest.mark.parametrize("size", [1, 7, STUDIES])
def test_numbers_do_not_depend_on_the_size_of_chunks_or_their_order(size: int) -> None:
    assert numbers(spread(draw, reversed(chunks(size)))) == ALONE


def test_a_run_that_was_stopped_continues_from_its_file(tmp_path: Path) -> None:
    path, computed = tmp_path / "power.jsonl", []

    def watched(chunk: Studies) -> object:
        computed.append(chunk)
        return draw(chunk)

    for stopped_after in (3, 2, 100):
        results = spread(watched, chunks(10), keeping(path))
        pairs = [pair for _, pair in zip(range(stopped_after), results, strict=False)]
        results.close()  # type: ignore[attr-defined]
        path.write_bytes(path.read_bytes() + b'{"chunk": "0a')  # the line at which it was killed
    assert numbers(pairs) == ALONE
    assert sorted(computed, key=repr) == sorted(chunks(10), key=repr)


@pytest.mark.parametrize("content", [None, "[design]\n", '{"schema": 1}\n', "trial,level"])
def test_a_file_of_something_else_is_refused_and_left_alone(
    content: str | None, tmp_path: Path
) -> None:
    path = tmp_path / "power.jsonl"
    if content is None:
        keeping(path, seed=8)
    else:
        path.write_text(content)
    before = path.read_bytes()
    with pytest.raises(ValueError, match=re.escape(str(path))):
        keeping(path)
    assert path.read_bytes() == before


STUDY = """
[design]
levels_vpp = [80.0]
trials_per_side = 5
both_trials = 0
[simulation]
threshold_vpp = 80.0
"""


def power(folder: Path, *options: object) -> Result:
    file = put(folder / "study.toml", on_paper_plate(STUDY))
    return run(
        "power", file, "--goal", "detection=40%@80V", "--participants", 1, 2, "--json", *options
    )


def stopping(after: int) -> Callable[..., Any]:
    """Return a `spread` that is stopped by Ctrl-C."""

    def stopped(*arguments: Any, **options: Any) -> Any:
        for _, pair in zip(range(after), spread(*arguments, **options), strict=False):
            yield pair
        raise KeyboardInterrupt

    return stopped


@pytest.mark.slow
def test_power_continues_from_its_file_with_its_seed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = tmp_path / "power.jsonl"
    with monkeypatch.context() as patched:
        patched.setattr("analysis.planning.spread.spread", stopping(1))
        assert power(tmp_path).exit_code == 130
        first = power(tmp_path, "--keep", kept, "--seed", 5)
    assert (first.exit_code, first.stdout) == (4, "")
    assert str(kept) in first.stderr.splitlines()[-1]
    before = kept.read_bytes()
    again, alone = power(tmp_path, "--keep", kept), power(tmp_path, "--seed", 5)
    assert again.exit_code == alone.exit_code == 0
    assert json.loads(again.stdout) == json.loads(alone.stdout)
    assert kept.read_bytes().startswith(before)
    refused = power(tmp_path, "--keep", kept, "--seed", 6)
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
