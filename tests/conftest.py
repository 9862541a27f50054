"""What all tests share: the command line, small studies, repeatable examples."""

from __future__ import annotations

import csv
import os
from typing import TYPE_CHECKING, TypeAlias

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Set before numpy is imported, as tactstrip.py does: the matrices are small."""

import pytest
from click.testing import CliRunner
from hypothesis import settings

from experiment import ConditionGains, simulate_study, study_from_text
from tactstrip import main
from tests.plates import PAPER_PLATE, on_paper_plate
from tests.processes import emulate, emulator_server, kill_at, null_sink, wide_sink
from tests.test_experiment.sessions import contents

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from experiment import Study

    Run: TypeAlias = Callable[..., Result]
    Rows: TypeAlias = Callable[..., list[dict[str, str]]]
    Refused: TypeAlias = Callable[..., str]
    Simulate: TypeAlias = Callable[..., Path]

pytest.register_assert_rewrite("tests.test_device.contract")
__all__ = ["emulate", "emulator_server", "kill_at", "null_sink", "wide_sink"]  # fixtures

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("repeatable")
"""The same examples in every run; ``--hypothesis-profile=explore`` looks for new ones."""

QUICK_BURST = """
[burst]
window = "hann"
"""
"""What it does at the other finger is computed quickest: it ends without a jump."""
SHORT_DESIGN = """
[design]
levels_vpp = [80, 160]
trials_per_side = 2
both_trials = 1
break_every = 3
foreperiod_s = [0.01, 0.02]
"""


@pytest.fixture
def run() -> Run:
    """Run a command in this process; the result has its exit code, output and errors."""

    def run(*arguments: str | Path, typed: str | None = None) -> Result:
        words = [str(argument) for argument in arguments]
        return CliRunner().invoke(main, words, input=typed, prog_name="tactstrip")

    return run


@pytest.fixture(scope="session")
def short_study_text() -> str:
    """A study file of five trials in two blocks."""
    return PAPER_PLATE + SHORT_DESIGN


@pytest.fixture(scope="session")
def quick_study_text() -> str:
    """The same with a burst whose displacements are computed in a moment."""
    return PAPER_PLATE + QUICK_BURST + SHORT_DESIGN


@pytest.fixture(scope="session")
def make_study() -> Callable[[str], Study]:
    """A study from the text of a study file, on the paper's plate unless it has another."""
    return lambda text: study_from_text(on_paper_plate(text), "study.toml")


@pytest.fixture
def refused(run: Run, tmp_path: Path) -> Refused:
    """Run a command that must end with 2 and change nothing; returns its error."""

    def refused(*arguments: str | Path, typed: str | None = None) -> str:
        before = contents(tmp_path)
        result = run(*arguments, typed=typed)
        assert result.exit_code == 2, result.output
        assert contents(tmp_path) == before
        return result.stderr

    return refused


@pytest.fixture
def rows_of() -> Rows:
    """Read trials.csv of a session of participant 01 below a folder of results."""

    def rows_of(out: Path, session: str = "01") -> list[dict[str, str]]:
        path = out / "sub-01" / f"ses-{session}" / "trials.csv"
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    return rows_of


GAINS = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=("measured", "measured"),
    per_vpp=((0.027, 0.001), (0.001, 0.027)),
)


@pytest.fixture(scope="session")
def simulate(make_study: Callable[[str], Study], short_study_text: str) -> Simulate:
    """Sessions of simulated participants in a new folder; their plate's gains are given.

    The text goes on with the short study's [design], or takes its place.
    """

    def run(
        folder: Path, text: str = "", *, participants: int = 1, seed: int = 7, study: str = ""
    ) -> Path:
        made = make_study((study or short_study_text) + text)
        sessions = simulate_study(
            made, folder, participants=participants, seed=seed, gains=(GAINS,)
        )
        assert len(list(sessions)) == participants
        return folder

    return run


@pytest.fixture(scope="session")
def two_sessions(tmp_path_factory: pytest.TempPathFactory, simulate: Simulate) -> Path:
    """A study's folder with a short session each of two simulated participants: not to change."""
    return simulate(tmp_path_factory.mktemp("simulated") / "results", participants=2)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add where real hardware is."""
    parser.addoption(
        "--driver",
        metavar="NAME",
        help="run the contract of devices on an installed driver of your own, at --port",
    )
    parser.addoption("--port", metavar="P", help="of that driver's device")
    parser.addoption(
        "--device-url",
        help="port or URL of a real device: tests/system/test_device_contract.py drives it. "
        "Its outputs go up to 200 Vpp: nobody may touch the plate.",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Refuse to drive one real device from several processes."""
    real = any(config.getoption(name) for name in ("--driver", "--port", "--device-url"))
    workers = config.getoption("numprocesses", None)
    if real and workers:
        raise pytest.UsageError(f"-n must be 0 with a real device; got {workers}")
