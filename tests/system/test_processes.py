"""Commands in processes of their own, killed before changes of the disk, and run again."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest

from experiment import ArchiveError, SessionFolder
from tests.test_experiment.sessions import contents
from tests.test_experiment.withdrawals import assert_gone

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.conftest import Run, Simulate

    KillAt = Callable[..., int | None]


@pytest.fixture
def results(tmp_path: Path, simulate: Simulate) -> Path:
    return simulate(tmp_path / "results", participants=2)


def test_a_withdrawal_killed_anywhere_is_whole_or_run_again(
    results: Path, kill_at: KillAt, run: Run, tmp_path: Path
) -> None:
    shutil.copytree(results, tmp_path / "kept")
    before = contents(results)
    person = {name for name in before if name.startswith("sub-01")}
    command = ("withdraw", str(results), "--participant", "01")
    step = 1
    while kill_at(step, *command, typed="01\n") is None:
        there = person & set(contents(results))
        assert there in (set(), person)
        begun = (results / "withdrawn" / "sub-01.json").exists()
        assert begun or there == person
        if begun:
            with pytest.raises(ArchiveError):
                SessionFolder(results, "01", "09").refuse_existing()
        assert run(*command, typed="01\n").exit_code == 0
        assert_gone(results)
        shutil.rmtree(results)
        shutil.copytree(tmp_path / "kept", results)
        step += 1
    assert_gone(results)
    assert step > 20


def test_an_export_killed_anywhere_leaves_the_old_or_the_new_one_and_is_run_again(
    results: Path, kill_at: KillAt, run: Run, tmp_path: Path
) -> None:
    bids, kept = tmp_path / "bids", tmp_path / "kept"
    arguments = ("export", str(results), "--bids", str(bids))
    assert run(*arguments).exit_code == 0
    old_bids = contents(bids)
    shutil.copytree(bids, kept)
    shutil.rmtree(results / "sub-02")
    steps = kill_at(10**6, *arguments)
    assert steps is not None
    new_bids = contents(bids)
    assert new_bids != old_bids
    seen = set()
    for step in (1, 9, 22, *range(steps - 44, steps + 1, 4), steps):
        shutil.rmtree(bids)
        shutil.copytree(kept, bids)
        assert kill_at(step, *arguments) is None
        if bids.exists():
            left = contents(bids)
            assert left in (old_bids, new_bids)
            seen.add("old" if left == old_bids else "new")
        else:
            assert contents(tmp_path / ".bids.tactstrip-old") == old_bids
        assert run(*arguments).exit_code == 0
        assert contents(bids) == new_bids
        assert sorted(path.name for path in tmp_path.iterdir()) == ["bids", "kept", "results"]
    assert seen == {"old", "new"}
