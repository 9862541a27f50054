"""The tree stays one in which a newcomer finds the way: folders of a few modules of one idea."""

from __future__ import annotations

import ast
import tomllib

import pytest

from benchmarks.size import ROOT, Folder, code_lines, folders, table

EVERY = folders()
MODULES = [module for folder in EVERY for module in folder.modules]
SMALL = {
    "experiment": "a package's own root: what it has is in its folders",
    "analysis": "a package's own root: the axis and the names that all its folders share",
}
"""Folders of fewer than three modules, with the reason."""
SAYS_NOTHING = {"utils", "util", "common", "base", "helpers", "misc"}


@pytest.mark.parametrize("folder", EVERY, ids=lambda folder: str(folder.path))
def test_a_folder_holds_three_to_ten_modules(folder: Folder) -> None:
    least = 0 if str(folder.path) in SMALL else 3
    assert least <= len(folder.modules) <= 10


LATER = {
    *(
        "options/resumed.py",
        "fingers/pressed.py",
        "fingers/dampers.py",
        "fingers/unpressed.py",
        "fingers/mirrored.py",
        "sections/finger.py",
    ),
    *("fingers/impedance.py", "motion/multiples.py"),
    *(
        "motion",
        "patches",
        "ringing",
        "field/rational.py",
        "strip/patch.py",
        "preview/displacements.py",
    ),
    *("integrity", "commands/verify.py", "trial/order.py"),
    "scpi/visa.py",
    *(
        "groups",
        "thresholds/density.py",
        "thresholds/grid.py",
        "foreign",
        "drafted",
        "commands/columns.py",
    ),
    *(
        "answers/dprime.py",
        "groups/criterion.py",
        "figures/d_prime.py",
        "figures/composed.py",
        "figures/curves.py",
        "figures/participants.py",
    ),
    *("field/parted.py", "solver/leading.py", "ends/reflection.py"),
    *("study/origins.py", "study/stated.py", "results/protocol.py", "results/answer.py"),
    *(
        "power",
        "workers",
        "commands/power.py",
        "terms/people.py",
        "terms/chances.py",
        "terms/entries.py",
        "device/errors.py",
        "reading/counts.py",
        "drive/sums.py",
        "study/slips.py",
        "session/settled.py",
    ),
    *("study/simulated.py", "terms/curves.py", "results/compared.py"),
    *("study/sources.py", "sections/actuator.py", "options/plate.py", "fingers/work.py"),
    *("monitor", "sound/recorder.py"),
    *("core/reports.py", "emulate/amplifier.py", "wire/dialogue.py"),
    "wire/forms.py",
    "commands/demo.py",
    *("commands/bursts.py", "bursts"),
    *("methods", "study/window.py", "stimuli/tuned.py"),
    *("device/installed.py", "core/converter.py", "participant/settings.py", "session/run.py"),
    *(
        "session/markers.py",
        "apparatus/monitor.py",
        "preview/monitor.py",
        "session/attendance.py",
        "options/responders.py",
        "participant/buttons.py",
    ),
}
"""Folders and modules of what the program could not do when the others were made."""


def test_there_are_at_most_185_modules_beside_those_of_later_folders() -> None:
    assert (
        sum(
            LATER.isdisjoint({module.parent.name, "/".join(module.parts[-2:])})
            for module in MODULES
        )
        <= 185
    )


def test_a_module_is_of_at_most_400_lines_unless_a_decision_says_why() -> None:
    decisions = "".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs/decisions").glob("*"))
    long = {
        module.relative_to(ROOT).as_posix()
        for module in MODULES
        if module.read_text(encoding="utf-8").count("\n") > 400
    }
    assert {module for module in long if f"`{module}`" not in decisions} == set()


def test_no_name_says_nothing() -> None:
    paths = [module.relative_to(ROOT).with_suffix("") for module in MODULES]
    assert not [path for path in paths if SAYS_NOTHING.intersection(path.parts)]


def test_folders_are_at_most_four_deep() -> None:
    assert max(len(module.relative_to(ROOT).parts) for module in MODULES) <= 4


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", 0),
        ('"""Two\nlines."""\n\n# a comment\nimport a\nfrom b import (\n    c,\n)\n', 0),
        ("x = [  # why\n    1,\n\n    2,\n]\n", 4),
        ('def f():\n    """Say."""\n    return """a\nb"""\n', 3),
    ],
)
def test_code_lines_are_neither_docstrings_comments_imports_nor_blank(
    text: str, lines: int
) -> None:
    assert code_lines(text) == lines


@pytest.mark.slow
def test_the_table_has_every_package() -> None:
    assert [line.split()[0] for line in table().splitlines()[1:6]] == [
        *("stimuli", "device", "experiment", "analysis", "together")
    ]


ONLY = {
    "pydantic": {"experiment.study"},
    "serial": {"device.wire", "device.commands.devices"},
    "sounddevice": {"device.sound"},
    "pyvisa": {"device.scpi.visa"},
    "psychopy": {"experiment.participant"},
    "pylsl": {"experiment.session.markers"},
    "click": {
        *("device.commands", "experiment.commands", "analysis.commands"),
        "experiment.terms.exits",
    },
}
"""Who may import a library; the contracts of pyproject.toml forbid it to all others."""


@pytest.mark.parametrize("library", ONLY)
def test_a_library_is_forbidden_to_every_module_but_its_own(library: str) -> None:
    config = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = config["tool"]["importlinter"]["contracts"]
    forbidden = [c for c in contracts if c.get("forbidden_modules") == [library]]
    refused = {source for contract in forbidden for source in contract["source_modules"]}
    for module in MODULES:
        name = ".".join(module.relative_to(ROOT).with_suffix("").parts)
        above = {name.rsplit(".", n)[0] for n in range(name.count(".") + 1)}
        assert bool(above & refused) != bool(above & ONLY[library]), name


@pytest.mark.slow
def test_only_the_apparatus_makes_devices() -> None:
    makers = {"make_device", "make_mock", "is_emulated"}
    for module in MODULES:
        name = module.relative_to(ROOT).as_posix()
        if name.startswith("experiment/") and not name.startswith("experiment/apparatus/"):
            text = module.read_text(encoding="utf-8")
            found = {
                alias.name
                for node in ast.walk(ast.parse(text))
                if isinstance(node, ast.ImportFrom)
                for alias in node.names
            }
            assert not found & makers, name
