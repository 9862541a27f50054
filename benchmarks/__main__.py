"""Run the benchmarks named on the command line, or all, and write docs/benchmarks.md."""

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
        "sweep",
        "single",
        "motion",
        "gains",
        "skipping",
        "link",
    ),
    *("analysis", "precision", "calibration", "groups", "crosscheck", "people"),
)
PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"
BY_HAND = "## Long runs\n"
"""The section that `make bench` does not measure: it stays, at the end of the page."""
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
    """Run benchmarks, print their sections, and write the page if all were run."""
    unknown = set(names) - set(NAMES)
    if unknown:
        print(
            f"unknown: {', '.join(sorted(unknown))}; there are: {', '.join(NAMES)}", file=sys.stderr
        )
        sys.exit(2)
    sections = []
    for name in names or NAMES:
        sections.append(import_module(f"benchmarks.{name}").section())
        print(sections[-1], flush=True)
    if not names:
        head = f"# Benchmarks\n\nMeasured by `make bench` on: {machine()}.\n"
        kept = "".join(PAGE.read_text(encoding="utf-8").partition(BY_HAND)[1:])
        PAGE.write_text("\n".join([head, GUIDE, *sections, kept]), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
