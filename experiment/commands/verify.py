"""The command `verify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, refusals

if TYPE_CHECKING:
    from experiment.integrity.sessions import Examined


@click.command(
    epilog="""\b
    Exit codes:
      0  No session was modified.
      1  A session was modified, or files of it are missing.
      2  A session cannot be examined, for example because of a symbolic
         link. The other sessions are examined.

    Example: tactstrip verify results"""
)
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path, exists=True))
@refusals
def verify(*, folder: Path) -> None:
    """Verify that recorded sessions have not been modified.

    For each session below DIR, tactstrip checks plan, header, journal, trials.csv and measured.csv
    against the checksums in the journal and the final hash in sessions.tsv. It prints the final
    hash of each session, and each difference with its file and line.

    The check does not cover participants.tsv, the other columns of sessions.tsv, or the last lines
    of a session that has not ended. To detect a modified final hash, write the hash down when a
    session ends, and compare it with the output of this command.
    """
    from experiment.integrity.places import find_sessions
    from experiment.integrity.sessions import Examined, examine

    sessions = find_sessions(folder)
    records: list[Examined | ValueError | OSError] = []
    with working("Comparing") as step:
        for session in sessions.folders:
            try:
                records.append(examine(session))
            except (ValueError, OSError) as error:  # continue with the other sessions
                records.append(error)
            step(len(records), len(sessions.folders))
    n_differences = 0
    errors: list[ValueError | OSError] = [*sessions.links]
    for session, examined in zip(sessions.folders, records, strict=True):
        name = "/".join(session.resolve().parts[-2:])
        if not isinstance(examined, Examined):
            errors.append(examined)
            click.echo(f"{name}: cannot be examined")
            continue
        n_differences += len(examined.differences)
        click.echo(f"{name}: {_verdict(examined)}")
        click.echo(f"  head {examined.head_sha256 or 'n/a'}")
        for difference in examined.differences:
            click.echo(f"  {difference}")
    for lost in sessions.lost:
        n_differences += 1
        click.echo(f"{lost.difference}")
    # The first error ends the command below, which prints it.
    further = (str(error) for error in errors[1:] if str(error) != str(errors[0]))
    for message in dict.fromkeys(further):
        click.echo(message, err=True)
    if errors:
        raise errors[0]
    if n_differences:
        click.get_current_context().exit(ANSWER_IS_NO)


def _verdict(examined: Examined) -> str:
    number = len(examined.differences)
    if number:
        return f"{number} difference{'s' if number > 1 else ''}"
    if not examined.begun:
        return "it never began"
    if examined.ended:
        return "as it was recorded"
    return "as it was recorded, but for its last lines, which are not covered: it has not ended"
