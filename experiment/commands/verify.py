"""The command `verify`."""

from __future__ import annotations

from pathlib import Path

import click

from experiment.commands.options import working
from experiment.terms.exits import ANSWER_IS_NO, refusals


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path, exists=True))
@refusals
def verify(*, folder: Path) -> None:
    """Tell whether the sessions below DIR are as they were recorded.

    Compared are the plan with its seal, plan and header with the journal's first line, each journal
    line with the next, the last one with sessions.tsv, trials.csv with the journal. Each difference
    is named with file and line, and the exit code is 1; the head hash of each session is printed.

    Not covered: other tables that labs edit, such as participants.tsv, and the other columns of
    sessions.tsv; .lock; what a session that has not ended wrote last; and whoever changes the hash
    in sessions.tsv, too. Against that, write the head hash down elsewhere when a session ends, and
    compare it with what is printed here.
    """
    from experiment.integrity.sessions import examine, lost_sessions, people_of, session_paths

    sessions = session_paths(folder)
    records = []
    with working("Comparing") as step:
        for session in sessions:
            records.append(examine(session))
            step(len(records), len(sessions))
    found = 0
    for session, examined in zip(sessions, records, strict=True):
        found += len(examined.differences)
        name = "/".join(session.resolve().parts[-2:])
        click.echo(f"{name}: {_verdict(len(examined.differences), ended=examined.ended)}")
        click.echo(f"  head {examined.head_sha256 or 'n/a'}")
        for difference in examined.differences:
            click.echo(f"  {difference}")
    for person in people_of(folder, sessions):
        for difference in lost_sessions(person):
            found += 1
            click.echo(f"{difference}")
    if found:
        click.get_current_context().exit(ANSWER_IS_NO)


def _verdict(differences: int, *, ended: bool) -> str:
    if differences:
        return f"{differences} difference{'s' if differences > 1 else ''}"
    if ended:
        return "as it was recorded"
    return "as it was recorded, but for its last lines, which are not covered: it has not ended"
