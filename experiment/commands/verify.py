"""The command `verify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from device.printing import echo
from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, CommandError, refusals

if TYPE_CHECKING:
    from experiment.record.verify import Verification


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
    against the checksums in the journal and the session checksum in sessions.tsv. It prints the
    checksum of each session, and each difference with its file and line.

    The check does not cover participants.tsv, the other columns of sessions.tsv, or the last lines
    of a session that has not ended. To detect a modified checksum, write it down when a session
    ends, and compare it with the output of this command.
    """
    from experiment.record.index import find_sessions
    from experiment.record.verify import examine

    sessions = find_sessions(folder)
    errors = [*map(str, sessions.links)]
    lines: list[object] = []
    n_differences = len(sessions.lost)
    with working("Comparing") as step:
        for number, session in enumerate(sessions.folders, 1):
            name = "/".join(session.resolve().parts[-2:])
            try:
                examined = examine(session)
            except (ValueError, OSError) as error:  # continue with the other sessions
                reason = str(error)
                if isinstance(error, OSError):
                    reason = f"{error.filename}: {error.strerror}"
                errors.append(reason)
                lines.append(f"{name}: cannot be examined")
            else:
                lines += (
                    f"{name}: {_verdict(examined)}",
                    f"  session checksum {examined.head_sha256 or 'n/a'}",
                    *(f"  {difference}" for difference in examined.differences),
                )
                n_differences += len(examined.differences)
            step(number, len(sessions.folders))
    for line in (*lines, *sessions.lost.values()):
        echo(line)
    if errors:
        raise CommandError(*dict.fromkeys(errors))
    if n_differences:
        click.get_current_context().exit(ANSWER_IS_NO)


def _verdict(examined: Verification) -> str:
    number = len(examined.differences)
    if number:
        return f"{number} difference{'s' if number > 1 else ''}"
    if not examined.begun:
        return "never began"
    if examined.ended:
        return "unmodified"
    return "unmodified; the session has not ended, so its last lines are not covered"
