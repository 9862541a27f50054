"""The command `export`."""

from __future__ import annotations

from pathlib import Path

import click

from experiment.terms.exits import CommandError, refusals


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
@click.option(
    "--allow-simulated",
    is_flag=True,
    help="With --bids: accept sessions of people on the mock device or an emulator.",
)
@refusals
def export(*, folder: Path, out: Path | None, with_sourcedata: bool, allow_simulated: bool) -> None:
    """Build every trials.csv below DIR anew from its plan and journal, or a BIDS data set."""
    if out is not None:
        _export_bids(folder, out, with_sourcedata=with_sourcedata, allow_simulated=allow_simulated)
    elif with_sourcedata:
        raise CommandError("--with-sourcedata goes with --bids; got it alone")
    else:
        _export_tables(folder)


def _export_tables(folder: Path) -> None:
    from experiment.archive.folders import SessionFolder, session_folders
    from experiment.integrity.sessions import refuse_altered

    def write(session: SessionFolder) -> None:
        with session.locked():
            session.read_history(session.read_plan())
            for difference in refuse_altered(session.path):
                if difference.mended_by == "export" and difference.line is not None:
                    click.echo(f"{difference}; it is built anew", err=True)
            click.echo(session.write_trials())

    # A plan that cannot be read stops all of it, before a lock is made or a table written; a
    # damaged journal is known only under its lock, and does not stop the other sessions.
    sessions = session_folders(folder)
    for work in (SessionFolder.read_plan, write):
        refused = []
        for session in sessions:
            try:
                work(session)
            except ValueError as error:
                refused.append(str(error))
        if refused:
            others = f" (and {len(refused) - 1} more)" if len(refused) > 1 else ""
            raise CommandError(refused[0] + others)


def _export_bids(folder: Path, out: Path, *, with_sourcedata: bool, allow_simulated: bool) -> None:
    from experiment.archive.bids import describe, export_bids
    from experiment.archive.folders import session_folders

    folders = session_folders(folder)
    for each in folders:
        each.read_plan()
    for each in folders:
        _refuse_differences(each.path)
    exported = export_bids(
        folder, out, with_sourcedata=with_sourcedata, allow_simulated=allow_simulated
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
