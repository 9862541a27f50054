"""The command `verify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.commands.options.hardware import working
from experiment.terms.exits import ANSWER_IS_NO, refusals

if TYPE_CHECKING:
    from experiment.integrity.sessions import Examined


@click.command(epilog="Example: tactstrip verify results")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path, exists=True))
@refusals
def verify(*, folder: Path) -> None:
    """Tell whether the sessions below DIR are as they were recorded.

    Compared are the plan with its seal, plan and header with the journal's first line, each journal
    line with the next, the last one with sessions.tsv, trials.csv and measured.csv with what the
    journal tells. Each difference is named with file and line, and the exit code is 1; the head
    hash of each session is printed.

    A session of which files are missing is named, too, with what sessions.tsv tells of it; one that
    cannot be examined, for a symbolic link or a file of another version, ends the command with 2
    when the others have been.

    Not covered: other tables that labs edit, such as participants.tsv, and the other columns of
    sessions.tsv; .lock; what a session that has not ended wrote last; and whoever changes the hash
    in sessions.tsv, too. Against that, write the head hash down elsewhere when a session ends, and
    compare it with what is printed here.
    """
    from experiment.integrity.places import find_sessions
    from experiment.integrity.sessions import Examined, examine

    sessions = find_sessions(folder)
    records: list[Examined | ValueError | OSError] = []
    with working("Comparing") as step:
        for session in sessions.folders:
            try:
                records.append(examine(session))
            except (ValueError, OSError) as error:  # the others are examined all the same
                records.append(error)
            step(len(records), len(sessions.folders))
    found = 0
    unread: list[ValueError | OSError] = [*sessions.links]
    for session, examined in zip(sessions.folders, records, strict=True):
        name = "/".join(session.resolve().parts[-2:])
        if not isinstance(examined, Examined):
            unread.append(examined)
            click.echo(f"{name}: cannot be examined")
            continue
        found += len(examined.differences)
        click.echo(f"{name}: {_verdict(examined)}")
        click.echo(f"  head {examined.head_sha256 or 'n/a'}")
        for difference in examined.differences:
            click.echo(f"  {difference}")
    for lost in sessions.lost:
        found += 1
        click.echo(f"{lost.difference}")
    for message in dict.fromkeys(str(one) for one in unread[1:] if str(one) != str(unread[0])):
        click.echo(message, err=True)
    if unread:
        raise unread[0]
    if found:
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
