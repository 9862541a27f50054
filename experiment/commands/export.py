"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.terms.exits import CommandError, refusals

if TYPE_CHECKING:
    from experiment.archive.folders import SessionFolder
    from experiment.integrity.places import FoundSessions


@click.command(epilog="Example: tactstrip export results --bids bids")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--bids",
    "out",
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="Write a BIDS data set to this folder instead. An unmodified earlier export is replaced.",
)
@click.option(
    "--with-sourcedata",
    is_flag=True,
    help="With --bids: include plans, headers and journals, which name host and operator.",
)
@click.option(
    "--allow-simulated",
    is_flag=True,
    help="With --bids: accept practice sessions on the mock device or an emulator.",
)
@refusals
def export(*, folder: Path, out: Path | None, with_sourcedata: bool, allow_simulated: bool) -> None:
    """Rebuild trials.csv from the journals, or write a BIDS data set.

    DIR is the folder of a study, a participant (sub-*) or a session (ses-*). If a monitor measured
    the bursts, tactstrip also rebuilds measured.csv. If a session has lost its plan or journal, the
    exit code is 2: the tables of the other sessions are rebuilt, but no BIDS data set is written.
    """
    if out is not None:
        _export_bids(folder, out, with_sourcedata=with_sourcedata, allow_simulated=allow_simulated)
    elif with_sourcedata:
        raise CommandError("--with-sourcedata goes with --bids; got it alone")
    else:
        _export_tables(folder)


def _export_tables(folder: Path) -> None:
    from experiment.integrity.places import find_sessions
    from experiment.integrity.sessions import refuse_altered

    def write(session: SessionFolder) -> None:
        with session.locked():
            session.read_history(session.read_plan())
            for difference in refuse_altered(session.path):
                if difference.mended_by == "export":
                    click.echo(f"{difference}; it is built anew", err=True)
            click.echo(session.write_trials())
            if session.measured_path.exists():
                click.echo(session.measured_path)

    # A plan that cannot be read stops all of it, before a lock is made or a table written; a
    # damaged journal is known only under its lock, and does not stop the other sessions. Neither
    # does what is lost: their tables can be built all the same.
    found = find_sessions(folder)
    refused = [str(link) for link in found.links]
    sessions = []
    for session in _begun(found):
        try:
            if session.plan_path.exists():
                session.read_plan()
            sessions.append(session)
        except ValueError as error:
            refused.append(str(error))
    _refuse(refused)
    for session in sessions:
        try:
            session.read_plan()
            write(session)
        except ValueError as error:
            refused.append(str(error))
    _refuse([*refused, *_lost(found)])


def _begun(found: FoundSessions) -> list[SessionFolder]:
    """List the sessions that began, or of which something is lost; tell of the others."""
    from experiment.integrity.sessions import examine

    sessions = []
    for session in found.sessions:
        if session.plan_path.exists() or examine(session.path).begun:
            sessions.append(session)
        else:
            click.echo(f"never began: {session.name}", err=True)
    return sessions


def _lost(found: FoundSessions) -> list[str]:
    return [f"{one.difference}; restore it from a copy" for one in found.lost]


def _refuse(refused: list[str]) -> None:
    if refused:
        more = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
        raise CommandError(refused[0] + more)


def _export_bids(folder: Path, out: Path, *, with_sourcedata: bool, allow_simulated: bool) -> None:
    from experiment.archive.bids import describe, export_bids
    from experiment.integrity.places import find_sessions

    found = find_sessions(folder)
    folders = _begun(found)
    for link in found.links:
        raise link
    for each in folders:
        each.read_plan()
        each.refuse_loss()
    for lost in _lost(found):
        raise CommandError(f"{lost}; nothing was written")
    for each in folders:
        _refuse_differences(each.path)
    exported = export_bids(
        folders, out, with_sourcedata=with_sourcedata, allow_simulated=allow_simulated
    )
    click.echo(f"{out}: {len(exported.sessions)} sessions")
    for session in exported.unfinished:
        click.echo(f"not finished: {describe(session)}")
    if exported.simulated:
        click.echo(f"simulated: {len(exported.simulated)} of {len(exported.sessions)} sessions")
    for session in exported.practice:
        click.echo(f"practice without a device: {session.name}")
    if exported.descriptions > 1:
        click.echo(
            f"the sessions' studies give {exported.descriptions} different [dataset] sections: "
            f"that of {exported.last.name}, which was begun last, is taken"
        )
    for column in exported.left_out:
        click.echo(f"left out of participants.tsv, declared by no study: {column}")


def _refuse_differences(session: Path) -> None:
    """Refuse to publish a session that is not as it was recorded."""
    from experiment.integrity.sessions import examine

    for difference in examine(session).differences:
        export = difference.mended_by == "export"
        if export and difference.line is None:  # no table: what is published is of the journal
            continue
        hint = "; tactstrip export DIR builds it anew from the journal" if export else ""
        raise CommandError(f"{difference}{hint}; nothing was written")
