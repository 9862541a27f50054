"""The command `withdraw`."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from device.printing import echo, shown
from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from experiment.record.withdraw import Person, SearchResult


@click.command(epilog="Example: tactstrip withdraw results --participant 01")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--participant", required=True, metavar="ID", help="Participant whose data are deleted."
)
@click.option(
    "--also",
    "folders",
    multiple=True,
    type=click.Path(path_type=Path, exists=True, file_okay=False),
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
    from experiment.record.withdraw import find_person, locked_sessions, remove, search

    person = find_person(folder, participant)
    if person.is_removed:
        echo(f"Participant {participant} was removed before.")
    else:
        with locked_sessions(person) as locks:
            _confirm(person)
            remove(person, locks, today=datetime.now(UTC).date().isoformat())
        echo(f"Participant {participant} is removed from {folder}.")
    _print_search(
        search((folder, *folders), participant, leave_out=person.removed_paths), participant
    )


def _confirm(person: Person) -> None:
    """Require the operator to type the ID of the participant."""
    row = "a row" if person.in_table else "no row"
    echo(
        f"{person.folder}: {person.n_files} files in {len(person.sessions)} sessions, {row} of "
        "participants.tsv. They will be permanently deleted.",
        err=True,
    )
    try:
        typed = click.prompt("Type the participant's ID to delete them", err=True)
    except click.Abort as error:
        raise CommandError("not confirmed; nothing was changed") from error
    if typed != person.participant:
        raise CommandError(
            f"not confirmed: {person.participant} must be typed; got {shown(typed)}; "
            "nothing was changed"
        )


def _print_search(result: SearchResult, participant: str) -> None:
    if result.hits:
        echo(f"Participant {participant} is still in:")
        echo(*(f"  {hit.what}: {hit.path}" for hit in result.hits))
    else:
        echo("The folders that were searched hold nothing else of this participant.")
    if result.not_searched:
        echo("Not searched (links, damaged manifests, no permission):")
        echo(*(f"  {path}" for path in result.not_searched))
    echo("Files of other programs, archives and backups were not searched.")
