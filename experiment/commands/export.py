"""The command `export`."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import click

from device.printing import echo
from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.record.bids import Export
    from experiment.record.folder import SessionFolder
    from experiment.record.index import SessionIndex


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
        raise CommandError("--with-sourcedata needs --bids")
    else:
        _export_tables(folder)


def _export_tables(folder: Path) -> None:
    from experiment.record.index import find_sessions
    from experiment.record.verify import refuse_modified

    # An unreadable plan stops the export before any lock is taken or table written. A damaged
    # journal is detected only under its lock, and does not stop the export of other sessions.
    # Neither do lost sessions.
    located = find_sessions(folder)
    errors = [str(link) for link in located.links]
    sessions = _begun_sessions(located)
    for session in sessions:
        with _collecting(errors):
            if session.plan_path.exists():
                session.read_plan()
    if errors:
        raise CommandError(*errors)
    for session in sessions:
        with _collecting(errors):
            plan = session.read_plan()
            with session.locked():
                session.read_history(plan)
                for difference in refuse_modified(session.path, rebuilds_tables=True):
                    if difference.remedy == "export":
                        echo(f"{difference}; the table is rebuilt", err=True)
                echo(session.write_trials())
                if session.measured_path.exists():
                    echo(session.measured_path)
    errors += [f"{lost}; restore it from a copy" for lost in located.lost.values()]
    if errors:
        raise CommandError(*errors)


@contextlib.contextmanager
def _collecting(errors: list[str]) -> Iterator[None]:
    try:
        yield
    except ValueError as error:
        errors.append(str(error))


def _begun_sessions(located: SessionIndex) -> list[SessionFolder]:
    """List the sessions that began, including damaged ones; print the names of the others."""
    from experiment.record.verify import examine

    sessions = []
    for session in located.sessions:
        if session.plan_path.exists() or examine(session.path).begun:
            sessions.append(session)
        else:
            echo(f"never began: {session.name}", err=True)
    return sessions


def _export_bids(folder: Path, out: Path, *, with_sourcedata: bool, allow_simulated: bool) -> None:
    from experiment.record.bids import export_bids
    from experiment.record.index import find_sessions
    from experiment.record.verify import refuse_modified

    located = find_sessions(folder)
    sessions = _begun_sessions(located)
    for link in located.links:
        raise link
    for session in sessions:
        session.read_plan()
        session.refuse_loss()
    for lost in located.lost.values():
        raise CommandError(f"{lost}; restore it from a copy; nothing was written")
    for session in sessions:
        for difference in refuse_modified(session.path):
            if difference.remedy != "export":
                raise CommandError(f"{difference}; nothing was written")
    exported = export_bids(
        sessions, out, with_sourcedata=with_sourcedata, allow_simulated=allow_simulated
    )
    _print_export(out, exported)


def _print_export(out: Path, exported: Export) -> None:
    echo(f"{out}: {len(exported.sessions)} sessions")
    for session in exported.sessions:
        if not session.finished:
            echo(f"not finished: {session.progress}")
    if exported.simulated:
        echo(f"simulated: {len(exported.simulated)} of {len(exported.sessions)} sessions")
    for session in exported.practice:
        echo(f"practice without a device: {session.name}")
    n_descriptions = len({session.study.dataset for session in exported.sessions})
    if n_descriptions > 1:
        echo(
            f"The studies have {n_descriptions} different [dataset] sections; the one of "
            f"{exported.last.name}, the latest session, is used."
        )
    for column in exported.left_out:
        echo(f"left out of participants.tsv, declared by no study: {column}")
