"""The command `export`."""

from __future__ import annotations

from pathlib import Path

import click

from experiment.exits import CommandError, refusals


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@refusals
def export(*, folder: Path) -> None:
    """Build every trials.csv below DIR anew from its plan and journal."""
    from experiment.archive import session_folders

    refused = []
    for session in session_folders(folder):
        try:
            with session.locked():
                click.echo(session.write_trials())
        except ValueError as error:
            refused.append(str(error))
    if refused:
        others = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
        raise CommandError(refused[0] + others)
