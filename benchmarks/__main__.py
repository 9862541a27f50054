"""Run the benchmarks named on the command line, or all, and write docs/benchmarks/results.md."""

from __future__ import annotations

import os
import platform
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

# As the program has it; before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

NAMES = (
    *(
        "startup",
        "session",
        "screen",
        "journal",
        "stability",
        "field",
        "gains",
        "skipping",
        "link",
    ),
    *("analysis", "precision", "calibration", "groups", "crosscheck", "people", "rules"),
)
PAGE = Path(__file__).parent.parent / "docs" / "benchmarks" / "results.md"
GUIDE = (
    "How numbers are taken is in each script in `benchmarks/`. No hardware and no person took "
    "part.\n"
)


def machine() -> str:
    """Describe the machine in one line."""
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        cpu = names[0].split(":")[1].strip() if names else cpu
    packages = ", ".join(
        f"{name} {version(name)}"
        for name in ("numpy", "scipy", "pandas", "matplotlib", "scikit-fem")
    )
    return (
        f"{cpu}, {os.cpu_count()} cores, {platform.system()}, "
        f"Python {platform.python_version()}, {packages}"
    )


def main(names: list[str]) -> None:
    """Run benchmarks, print their sections, and put them in the page.

    Without names all are run, and other sections than theirs are dropped.
    """
    unknown = set(names) - set(NAMES)
    if unknown:
        print(
            f"unknown: {', '.join(sorted(unknown))}; there are: {', '.join(NAMES)}", file=sys.stderr
        )
        sys.exit(2)
    measured: dict[str, str] = {}
    for name in names or NAMES:
        section = import_module(f"benchmarks.{name}").section()
        print(section, flush=True)
        measured |= sections(section)
    page = PAGE.read_text(encoding="utf-8")
    written = sections(page)
    if names:
        head = page.partition("\n## ")[0]
        kept = written | measured
    else:
        head = (
            f"# Results of the benchmarks\n\nMeasured by `make bench` on: {machine()}.\n\n{GUIDE}"
        )
        kept = measured
    PAGE.write_text("\n".join([head, *kept.values()]), encoding="utf-8")


def sections(page: str) -> dict[str, str]:
    r"""Return the sections of a page by their headings.

    >>> sections("# Page\n\n## One\n\nText.\n\n## Two\n")
    {'One': '## One\n\nText.\n', 'Two': '## Two\n'}
    """
    parts = f"\n{page}".split("\n## ")[1:]
    return {part.partition("\n")[0]: f"## {part}" for part in parts}


if __name__ == "__main__":
    main(sys.argv[1:])
