"""The commands `export` and `withdraw`."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from experiment.holdings import Search
    from experiment.withdraw import Person


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--bids",
    "out",
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="Write a BIDS data set instead; an unchanged earlier one there is replaced.",
)
@click.option(
    "--with-sourcedata",
    is_flag=True,
    help="With --bids: plans, headers and journals too, which name host and operator.",
)
@refusals
def export(*, folder: Path, out: Path | None, with_sourcedata: bool) -> None:
    """Build every trials.csv below DIR anew from its plan and journal, or a BIDS data set."""
    if out is not None:
        _export_bids(folder, out, with_sourcedata=with_sourcedata)
    elif with_sourcedata:
        raise CommandError("--with-sourcedata goes with --bids; got it alone")
    else:
        _export_tables(folder)


def _export_tables(folder: Path) -> None:
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


def _export_bids(folder: Path, out: Path, *, with_sourcedata: bool) -> None:
    from experiment.bids import describe, export_bids

    exported = export_bids(folder, out, with_sourcedata=with_sourcedata)
    click.echo(f"{out}: {len(exported.sessions)} sessions")
    for session in exported.unfinished:
        click.echo(f"not finished: {describe(session)}")
    if exported.simulated:
        click.echo(f"simulated: {len(exported.simulated)} of {len(exported.sessions)} sessions")
    if exported.descriptions > 1:
        click.echo(
            f"the sessions' studies give {exported.descriptions} different [dataset] sections: "
            f"that of {exported.last.name}, which was begun last, is taken"
        )
    for column in exported.left_out:
        click.echo(f"left out of participants.tsv, declared by no study: {column}")


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--participant", required=True, metavar="ID", help="Whose data are to be removed.")
@click.option(
    "--also",
    "others",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Look for exports and analyses there too; may be given again.",
)
@refusals
def withdraw(*, folder: Path, participant: str, others: tuple[Path, ...]) -> None:
    """Remove a person's data from DIR, for good, after the ID is typed once more.

    A dated mark stays, with the ID and nothing else. Exports and analyses that still hold the
    person are listed, not changed. After an interruption, run it again.
    """
    from experiment.holdings import search
    from experiment.withdraw import held, look_up, remove

    for other in others:
        if not other.is_dir():
            raise CommandError(f"--also must be a folder; got {other}")
    person = look_up(folder, participant)
    if person.gone:
        click.echo(f"Participant {participant} is removed already.")
    else:
        with held(person) as locks:
            _confirm(person)
            remove(person, locks, today=datetime.now(UTC).date().isoformat())
        click.echo(f"Participant {participant} is removed from {folder}.")
    _tell(search((folder, *others), participant, leave_out=person.known), participant)


def _confirm(person: Person) -> None:
    """Have the operator type whose data are to go."""
    row = "a row" if person.in_table else "no row"
    click.echo(
        f"{person.folder}: {person.files} files in {len(person.sessions)} sessions, {row} of "
        "participants.tsv. They are deleted for good.",
        err=True,
    )
    try:
        typed = click.prompt("Type the participant's ID to delete them", err=True)
    except click.Abort as error:
        raise CommandError("not confirmed; nothing was changed") from error
    if typed != person.participant:
        raise CommandError(
            f"not confirmed: {person.participant} must be typed; got {typed!r}; nothing was changed"
        )


def _tell(found: Search, participant: str) -> None:
    if found.holdings:
        click.echo(f"Participant {participant} is still in:")
    else:
        click.echo("Nothing else that was searched holds this person.")
    for holding in found.holdings:
        click.echo(f"  {holding.what}: {holding.path}")
    if found.not_searched:
        click.echo("Not searched (links, packed files, no permission):")
    for path in found.not_searched:
        click.echo(f"  {path}")
    click.echo("Backups and copies elsewhere are not known here.")
