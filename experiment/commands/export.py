"""The command `export`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.exits import CommandError, refusals

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

    # An unreadable plan stops the export before any lock is taken or table written. A damaged
    # journal is detected only under its lock, and does not stop the export of other sessions.
    # Neither do lost sessions.
    located = find_sessions(folder)
    errors = [str(link) for link in located.links]
    sessions = []
    for session in _begun_sessions(located):
        try:
            if session.plan_path.exists():
                session.read_plan()
            sessions.append(session)
        except ValueError as error:
            errors.append(str(error))
    _raise_errors(errors)
    for session in sessions:
        try:
            session.read_plan()
            write(session)
        except ValueError as error:
            errors.append(str(error))
    _raise_errors([*errors, *_lost_messages(located)])


def _begun_sessions(located: FoundSessions) -> list[SessionFolder]:
    """List the sessions that began, including damaged ones; print the names of the others."""
    from experiment.integrity.sessions import examine

    sessions = []
    for session in located.sessions:
        if session.plan_path.exists() or examine(session.path).begun:
            sessions.append(session)
        else:
            click.echo(f"never began: {session.name}", err=True)
    return sessions


def _lost_messages(located: FoundSessions) -> list[str]:
    return [f"{session.difference}; restore it from a copy" for session in located.lost]


def _raise_errors(errors: list[str]) -> None:
    if errors:
        remainder = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise CommandError(errors[0] + remainder)


def _export_bids(folder: Path, out: Path, *, with_sourcedata: bool, allow_simulated: bool) -> None:
    from experiment.archive.bids import describe, export_bids
    from experiment.integrity.places import find_sessions

    located = find_sessions(folder)
    sessions = _begun_sessions(located)
    for link in located.links:
        raise link
    for session in sessions:
        session.read_plan()
        session.refuse_loss()
    for message in _lost_messages(located):
        raise CommandError(f"{message}; nothing was written")
    for session in sessions:
        _require_unmodified(session.path)
    exported = export_bids(
        sessions, out, with_sourcedata=with_sourcedata, allow_simulated=allow_simulated
    )
    click.echo(f"{out}: {len(exported.sessions)} sessions")
    for unfinished in exported.unfinished:
        click.echo(f"not finished: {describe(unfinished)}")
    if exported.simulated:
        click.echo(f"simulated: {len(exported.simulated)} of {len(exported.sessions)} sessions")
    for practice in exported.practice:
        click.echo(f"practice without a device: {practice.name}")
    if exported.descriptions > 1:
        click.echo(
            f"the sessions' studies give {exported.descriptions} different [dataset] sections: "
            f"that of {exported.last.name}, which was begun last, is taken"
        )
    for column in exported.left_out:
        click.echo(f"left out of participants.tsv, declared by no study: {column}")


def _require_unmodified(session: Path) -> None:
    """Raise CommandError if a session was modified."""
    from experiment.integrity.sessions import examine

    for difference in examine(session).differences:
        can_rebuild = difference.mended_by == "export"
        if can_rebuild and difference.line is None:  # no table; the journal is published instead
            continue
        hint = "; tactstrip export DIR builds it anew from the journal" if can_rebuild else ""
        raise CommandError(f"{difference}{hint}; nothing was written")
