"""What is distributed: an sdist with all of the repository, a wheel with the packages only."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

from tactstrip import PACKAGES

ROOT = Path(__file__).parents[2]
BUILD = """
import sys, setuptools.build_meta as backend
folder = sys.argv[1]  # which a build replaces
backend.build_sdist(folder), backend.build_wheel(folder)
"""


def tracked() -> list[str]:
    """List what is in the repository and not deleted."""
    if not (ROOT / ".git").exists():
        pytest.skip("only a checkout tells which files belong to the project")
    done = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, check=True, text=True)
    return [name for name in done.stdout.splitlines() if (ROOT / name).is_file()]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build both distributions of a copy, as by pip, but with the setuptools that is here."""
    pytest.importorskip("setuptools", minversion="77")
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("dist")
    for name in tracked():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    done = subprocess.run(
        [sys.executable, "-c", BUILD, out], cwd=source, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return out


@pytest.mark.process
def test_the_sdist_has_every_file_of_the_repository(built: Path) -> None:
    (path,) = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        inside = {name.partition("/")[2] for name in archive.getnames()}
    assert set(tracked()) <= inside


@pytest.mark.process
def test_the_wheel_has_the_packages_and_nothing_else(built: Path) -> None:
    (path,) = built.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        inside = set(archive.namelist())
        metadata = message_from_bytes(
            archive.read(next(name for name in inside if name.endswith("/METADATA")))
        )
    ours = {name for name in tracked() if name.split("/")[0] in {*PACKAGES, "tactstrip.py"}}
    assert {name for name in inside if ".dist-info/" not in name} == ours
    assert metadata["Version"] == version()
    assert "Operating System :: POSIX :: Linux" in metadata.get_all("Classifier", [])


def version() -> str:
    """Return what pyproject.toml says."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return str(project["version"])


def test_changelog_and_citation_are_of_this_version() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## \[(.+?)\]", changelog, re.MULTILINE)
    assert sections[:2] == ["Unreleased", version()]
    (dated,) = re.findall(rf"^## \[{re.escape(version())}\] - (\S+)$", changelog, re.MULTILINE)
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version()}\ndate-released: {dated}\n" in citation


@pytest.mark.process
def test_a_system_without_termios_has_every_module_of_a_session() -> None:
    program = (
        "import sys\nsys.modules['termios'] = sys.modules['tty'] = None\n"
        "import experiment.participant.terminal, experiment.operator.view, analysis.commands.demo"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.stderr == b""
