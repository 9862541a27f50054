"""The commands `run` and `export`."""

from __future__ import annotations

import contextlib
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.exits import CommandError, refusals, require_fit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.clock import Clock
    from experiment.archive import SessionFolder
    from experiment.conduct import Ending
    from experiment.plan import Plan
    from experiment.responder import Responder
    from experiment.study import Study

DEVICE_FAILED = 3
STOPPED_EARLY = 4


@click.command()
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option("--participant", required=True, metavar="ID", help="1 to 32 letters or digits.")
@click.option("--session", default="01", show_default=True, metavar="ID", help="Likewise.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results"),
    show_default=True,
    metavar="DIR",
    help="The study's folder of results.",
)
@click.option(
    "--responder",
    type=click.Choice(["terminal", "simulated"]),
    default="terminal",
    show_default=True,
    help="Who answers.",
)
@click.option("--driver", type=click.Choice(["mock"]), help="Instead of the study's driver.")
@click.option(
    "--levels",
    "levels_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Levels placed for this participant, instead of the study's.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the plan; random by default.")
@click.option("--resume", "resuming", is_flag=True, help="Go on with an interrupted session.")
@click.option(
    "--resume-anyway",
    is_flag=True,
    help="The same on another host or device, or after more than 30 minutes.",
)
@refusals
def run(
    *,
    study_file: Path,
    participant: str,
    session: str,
    out: Path,
    responder: str,
    driver: str | None,
    levels_file: Path | None,
    seed: int | None,
    resuming: bool,
    resume_anyway: bool,
) -> None:
    """Run one session with a participant.

    Every answer is on the disk before the next stimulus. A session that was stopped or interrupted
    in any way goes on with --resume.
    """
    from experiment.archive import SessionFolder
    from experiment.study import read_levels, read_study, with_levels

    del driver  # the mock is the only one so far, and the study names it already
    folder = SessionFolder(out, participant, session)
    study = read_study(study_file)
    if levels_file is not None:
        study = with_levels(study, read_levels(levels_file, participant))
    if resuming or resume_anyway:
        plan = folder.read_plan()
        _refuse_contradictions(plan, study, seed, placed=levels_file is not None)
    else:
        plan = _new_plan(folder, study, seed)
    ending = _conduct(
        folder, study, plan, responder, resuming=resuming, resume_anyway=resume_anyway
    )
    _report(ending, plan)


def _new_plan(folder: SessionFolder, study: Study, seed: int | None) -> Plan:
    from experiment.plan import draw_plan

    folder.refuse_existing()
    require_fit(study)
    seed = secrets.randbits(32) if seed is None else seed
    click.echo(f"seed {seed}")
    return draw_plan(study, participant=folder.participant, session=folder.session, seed=seed)


def _refuse_contradictions(plan: Plan, study: Study, seed: int | None, *, placed: bool) -> None:
    """Refuse options that say otherwise than the session that is to be resumed."""
    from experiment.study import study_from_canonical, with_levels

    if seed is not None and seed != plan.seed:
        raise CommandError(f"--seed must be that of the session, {plan.seed}; got {seed}")
    levels_vpp = study_from_canonical(plan.study).design.levels_vpp
    if not placed:
        study = with_levels(study, levels_vpp)
    elif study.design.levels_vpp != levels_vpp:
        raise CommandError(
            f"--levels must be those of the session, {levels_vpp}; got {study.design.levels_vpp}"
        )
    if study.sha256 != plan.study_sha256:
        raise CommandError(
            "STUDY is not the study that this session was begun with "
            f"(sha256 {plan.study_sha256[:12]}...); got {study.sha256[:12]}..."
        )


def _conduct(
    folder: SessionFolder,
    study: Study,
    plan: Plan,
    responder_name: str,
    *,
    resuming: bool,
    resume_anyway: bool,
) -> Ending:
    from device.clock import MonotonicClock, VirtualClock
    from device.driver import DeviceError
    from experiment.conduct import Setting, begin, resume
    from experiment.interrupts import StopSignal
    from experiment.journal import JournalWriteError
    from experiment.rig import mock_device

    clock = VirtualClock() if responder_name == "simulated" else MonotonicClock()
    stop = StopSignal()
    try:
        with _responder(responder_name, study, plan, clock) as responder, stop.on_signals():
            setting = Setting(
                device=mock_device(study, clock),
                responder=responder,
                clock=clock,
                stop=stop,
                resume_anyway=resume_anyway,
            )
            if resuming or resume_anyway:
                return resume(folder, setting)
            return begin(folder, plan, setting)
    except DeviceError as error:
        raise CommandError(f"device: {error}", exit_code=DEVICE_FAILED) from error
    except JournalWriteError as error:
        raise CommandError(str(error), exit_code=STOPPED_EARLY) from error


@contextlib.contextmanager
def _responder(name: str, study: Study, plan: Plan, clock: Clock) -> Iterator[Responder]:
    if name == "simulated":
        from experiment.simulate import simulated_responder

        yield simulated_responder(study, plan, clock)
    else:
        from experiment.terminal import TerminalResponder

        if study.masking.noise != "none":
            click.echo(f"Note: {study.masking.noise} noise is not played by this program yet.")
        with TerminalResponder(clock, responses=plan.responses) as responder:
            yield responder


def _report(ending: Ending, plan: Plan) -> None:
    if ending.torn_file is not None:
        click.echo(
            f"a last journal line that was cut short was moved to {ending.torn_file}", err=True
        )
    if ending.failure is not None:
        raise CommandError(
            f"device: {ending.failure}; go on with --resume", exit_code=DEVICE_FAILED
        )
    if not ending.finished:
        raise CommandError(
            f"stopped early, {ending.trials_path} holds what is done; go on with --resume",
            exit_code=STOPPED_EARLY,
        )
    click.echo(f"all {len(plan.trials)} trials are answered: {ending.trials_path}")


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@refusals
def export(*, folder: Path) -> None:
    """Build every trials.csv below DIR anew from its plan and journal."""
    from experiment.archive import session_folders

    for session in session_folders(folder):
        click.echo(session.write_trials())
