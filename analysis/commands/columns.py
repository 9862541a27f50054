"""The command ``columns``: a proposed column map for external tables."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING

import click

from device.printing import echo
from experiment.commands.options.common import PATH, write_option
from experiment.exits import CommandError, refusals
from experiment.record.files import DISK, write_new

if TYPE_CHECKING:
    from pathlib import Path


@click.command(epilog="Example: tactstrip columns table.csv --write map.toml")
@click.argument("tables", metavar="TABLE...", nargs=-1, required=True, type=PATH)
@write_option(
    metavar="MAP.toml", show_default="print to the terminal", help="New file for the column map."
)
@refusals
def columns(*, tables: tuple[Path, ...], target: Path | None) -> None:
    """Propose a column map for an external table.

    TABLE is a file, a folder of files or a BIDS data set. All tables must have the same layout. In
    the map, review the lines marked `# guess`, and fill in those marked `# FILL IN`. Then pass the
    map to `tactstrip analyze --columns`.
    """
    from analysis.reading.draft import propose_map
    from analysis.reading.sources import TABLE, find_sources

    sources, _ = find_sources([*tables], foreign=True)
    if not sources or all(source.path.name == TABLE for source in sources):
        raise CommandError(f"{tables[0]}: a {TABLE} of tactstrip needs no map")
    text, fill_in, notes = propose_map(sources)
    if target is None:
        echo(*text.removesuffix("\n").split("\n"))
        return
    write_new(target, text.encode(), DISK)
    instruction = f"fill in {', '.join(fill_in)}" if fill_in else "check its guesses"
    arguments = shlex.join(map(str, tables))
    # Results are written next to the folder of the raw data, not into it.
    is_here = any(table.is_dir() and table.samefile(".") for table in tables)
    out = " --out ../analysis" if is_here else ""
    for note in notes:
        echo(note)
    analyze = f"tactstrip analyze {arguments} --columns {target}{out}"
    echo(f"Written to {target}; {instruction}, then {analyze}")
