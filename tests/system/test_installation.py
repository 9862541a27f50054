"""Processes of Python: what is imported, and a wheel beside a distribution of the same names."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

from tactstrip import COMMANDS, PACKAGES

ROOT = Path(__file__).parents[2]
HEAVY = {
    *("numpy", "scipy", "pandas", "pydantic", "rich", "matplotlib", "statsmodels", "psychopy"),
    *("serial", "filelock"),
}


def python(*arguments: str, folder: Path, program: Path | str = sys.executable) -> tuple[int, str]:
    """Run Python in a folder; return its exit code and what it writes to stderr."""
    done = subprocess.run(
        [program, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    return done.returncode, done.stderr


def imported_by(*arguments: str) -> set[str]:
    """Return the packages that a command imports."""
    program = (
        "import sys\nfrom tactstrip import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit as end:\n    assert not end.code, end\n"
        "print('\\n'.join(sys.modules), file=sys.stderr)"
    )
    exit_code, modules = python("-c", program, *arguments, folder=ROOT)
    assert exit_code == 0, modules
    return {line.split(".")[0] for line in modules.splitlines()}


@pytest.mark.parametrize("command", [(), *((command,) for command in COMMANDS)])
def test_help_imports_nothing_heavy(command: tuple[str, ...]) -> None:
    assert not imported_by(*command, "--help") & HEAVY


def test_a_dry_run_imports_no_psychopy_and_no_serial(tmp_path: Path) -> None:
    used = imported_by("dry-run", "--participants", "1", "--out", str(tmp_path / "out"))
    assert not used & {"psychopy", "serial"}


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_is_imported_without_numpy(package: str, tmp_path: Path) -> None:
    line = f"import sys, {package}; sys.exit('numpy' in sys.modules)"
    assert python("-c", line, folder=tmp_path) == (0, "")


@pytest.mark.parametrize("name", PACKAGES)
@pytest.mark.parametrize("arguments", [("check", "study.toml"), ("--help",), ()])
def test_a_labs_own_file_that_hides_a_package_is_named_and_not_run(
    name: str, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    own = tmp_path / f"{name}.py"
    own.write_text("raise SystemExit(70)\n", encoding="utf-8")
    exit_code, errors = python("-m", "tactstrip", *arguments, folder=tmp_path)
    assert (exit_code, errors.count("\n")) == (2, 1)
    assert str(own) in errors


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The wheel of this checkout, and one of another distribution with a package `stimuli`."""
    folder = tmp_path_factory.mktemp("wheels")
    source = folder / "source"
    files = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.splitlines()
    for file in files:
        if file.endswith(
            (".py", ".pyi", ".typed", ".toml", ".mplstyle", ".jinja", ".css", ".md", "LICENSE")
        ):
            (source / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, source / file)
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--wheel-dir", str(folder))
    exit_code, errors = python("-m", "pip", "wheel", *options, str(source), folder=folder)
    assert exit_code == 0, errors
    other = folder / "stimuli-9.0-py3-none-any.whl"
    with zipfile.ZipFile(other, "w") as archive:
        archive.writestr("stimuli/__init__.py", "raise SystemExit(70)\n")
        archive.writestr("stimuli/audio.py", "")
        info = "stimuli-9.0.dist-info"
        archive.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: stimuli\nVersion: 9.0\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "stimuli/__init__.py,,\nstimuli/audio.py,,\n")
    (ours,) = folder.glob("tactstrip-*.whl")
    return {"tactstrip": ours, "stimuli": other}


@pytest.mark.parametrize(
    "order", [("tactstrip", "stimuli"), ("stimuli", "tactstrip")], ids=" then ".join
)
def test_another_distribution_with_a_package_of_ours_is_named(
    order: tuple[str, ...], wheels: dict[str, Path], tmp_path: Path
) -> None:
    venv.create(tmp_path / "venv", with_pip=False, symlinks=os.name != "nt")
    (site,) = (tmp_path / "venv").glob("lib/python*/site-packages")
    (tools,) = {path for path in map(Path, sys.path) if (path / "click").is_dir()}
    (site / "tools.pth").write_text(f"{tools}\n", encoding="utf-8")
    inside = tmp_path / "venv" / "bin" / "python"
    install = ("-m", "pip", "--python", str(inside), "install", "--no-deps", "--no-index")
    study = ROOT / "docs" / "examples" / "first-study.toml"
    for name in order:
        assert python(*install, str(wheels[name]), folder=tmp_path)[0] == 0
    exit_code, errors = python(
        "-m", "tactstrip", "check", str(study), folder=tmp_path, program=inside
    )
    assert (exit_code, errors.count("\n")) == (2, 1)
    assert "stimuli" in errors.split("distribution")[1]
    uninstall = ("-m", "pip", "--python", str(inside), "uninstall", "-y", "stimuli")
    assert python(*uninstall, folder=tmp_path)[0] == 0
    again = (*install, "--force-reinstall", str(wheels["tactstrip"]))
    assert python(*again, folder=tmp_path)[0] == 0
    command = ("-m", "tactstrip", "check", str(study))
    assert python(*command, folder=tmp_path, program=inside) == (0, "")
