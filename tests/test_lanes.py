"""The lanes: which tests a command runs, and that the fast lane stays fast (tests/conftest.py)."""

from __future__ import annotations

import os

import pytest

pytest_plugins = ("pytester",)

TESTS = """
import time
import pytest

def test_at_once():
    pass

@pytest.mark.slow
def test_slow():
    pass
"""
SPINS = """
import time

def spin(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass

def test_first_import(counted=[]):
    spin(0.0 if counted else 2.1)
    counted.append(1)

def test_always(tmp_path):
    spin(2.1)

def square():
    '''
    >>> spin(2.1)
    >>> 2 * 2
    4
    '''
"""


@pytest.fixture
def project(pytester: pytest.Pytester, request: pytest.FixtureRequest) -> pytest.Pytester:
    """A project with the lanes of this one."""
    root = request.config.rootpath
    for name in ("pyproject.toml", "tests/conftest.py"):
        path = pytester.path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text((root / name).read_text())
    for name in ("tests/test_a.py", "tests/test_b.py"):
        (pytester.path / name).write_text(TESTS)
    return pytester


@pytest.mark.parametrize(
    ("arguments", "passed"),
    [
        ([], 2),
        (["tests"], 2),
        (["tests/test_a.py"], 2),
        (["tests/test_a.py", "tests/test_b.py"], 4),
        (["tests", "tests/test_a.py"], 3),
        (["tests/test_a.py::test_slow"], 1),
        (["-m", "slow"], 2),
        (["tests/test_a.py", "-m", "slow"], 1),
    ],
)
def test_a_named_file_runs_whole_and_a_folder_its_fast_lane(
    project: pytest.Pytester, arguments: list[str], passed: int
) -> None:
    done = project.inline_run(*arguments, "-p", "no:cacheprovider")
    assert len(done.listoutcomes()[0]) == passed
    assert done.countoutcomes()[1:] == [0, 0]


@pytest.mark.slow
def test_an_unknown_marker_is_refused(project: pytest.Pytester) -> None:
    path = project.path / "tests/test_a.py"
    path.write_text(TESTS.replace("mark.slow", "mark.slwo"))
    assert project.inline_run("-p", "no:cacheprovider").ret == pytest.ExitCode.INTERRUPTED


@pytest.mark.slow
def test_a_test_of_the_fast_lane_that_is_slow_twice_fails(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "nice", lambda _: 0)
    (project.path / "tests/test_a.py").write_text(SPINS)
    done = project.runpytest_inprocess("-p", "no:cacheprovider")
    done.stdout.fnmatch_lines(["*2.?? s of processor time, twice over 2.0 s: make it faster*"])
    done.assert_outcomes(passed=2, failed=2)
    done.stdout.fnmatch_lines(["*3 slow once*"])


@pytest.mark.slow
def test_in_the_background_no_test_is_timed(
    project: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "nice", lambda _: 19)
    (project.path / "tests/test_a.py").write_text(SPINS)
    done = project.runpytest_inprocess("-p", "no:cacheprovider", "tests/test_a.py", "-k", "always")
    done.assert_outcomes(passed=1)


@pytest.mark.slow
def test_a_test_of_another_lane_may_take_its_time(project: pytest.Pytester) -> None:
    (project.path / "tests/test_a.py").write_text(
        f"import pytest\npytestmark = pytest.mark.slow\n{SPINS}"
    )
    done = project.runpytest_inprocess("-p", "no:cacheprovider", "tests/test_a.py", "-k", "always")
    done.assert_outcomes(passed=1)
