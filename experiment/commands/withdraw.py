"""The command `withdraw`."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from experiment.archive.manifest import Search
    from experiment.archive.withdraw import Person


@click.command(epilog="Example: tactstrip withdraw results --participant 01")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--participant", required=True, metavar="ID", help="Participant whose data are deleted."
)
@click.option(
    "--also",
    "folders",
    multiple=True,
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Also search this folder for exports and analyses. Repeat the option for several folders.",
)
@refusals
def withdraw(*, folder: Path, participant: str, folders: tuple[Path, ...]) -> None:
    """Permanently delete a participant's data from DIR.

    tactstrip prompts you to type the participant's ID before it deletes anything. It keeps a dated
    record that contains only the ID. It lists exports and analyses that still contain the
    participant, but does not change them. If the command is interrupted, run it again.
    """
    from experiment.archive.manifest import search
    from experiment.archive.withdraw import held, look_up, remove

    for additional in folders:
        if not additional.is_dir():
            raise CommandError(f"--also must be a folder; got {additional}")
    person = look_up(folder, participant)
    if person.gone:
        click.echo(f"Participant {participant} is removed already.")
    else:
        with held(person) as locks:
            _confirm(person)
            remove(person, locks, today=datetime.now(UTC).date().isoformat())
        click.echo(f"Participant {participant} is removed from {folder}.")
    _print_search(search((folder, *folders), participant, leave_out=person.known), participant)


def _confirm(person: Person) -> None:
    """Require the operator to type the ID of the participant."""
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


def _print_search(result: Search, participant: str) -> None:
    if result.holdings:
        click.echo(f"Participant {participant} is still in:")
    else:
        click.echo("Nothing else that was searched holds this person.")
    for holding in result.holdings:
        click.echo(f"  {holding.what}: {holding.path}")
    if result.not_searched:
        click.echo("Not searched (links, damaged manifests, no permission):")
    for path in result.not_searched:
        click.echo(f"  {path}")
    click.echo("Files of other origin, packed files and backups are not known here.")
