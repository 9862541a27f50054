"""The command `run`."""

from __future__ import annotations

import contextlib
import secrets
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.commands.options.hardware import (
    confirmed,
    device_failures,
    hardware_options,
    working,
)
from experiment.commands.options.responders import display_beside, distribution_of, responder_named
from experiment.commands.options.resumed import (
    plan_to_resume,
    refuse_another_number,
    resumed_line,
)
from experiment.exits import DEVICE_FAILED, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.clock import Clock
    from experiment.apparatus.noise import NoisePlayer
    from experiment.apparatus.rig import Confirmation, Rig
    from experiment.archive.folders import SessionFolder
    from experiment.operator.requests import StopSignal
    from experiment.session.markers import Markers
    from experiment.session.setting import Ending
    from experiment.study.study import Study
    from experiment.trial.plan import Plan


@click.command(
    epilog="Example: tactstrip run study.toml --participant 01 --practice-without-device"
)
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option(
    "--participant",
    required=True,
    metavar="ID",
    help="Identifier of the participant: 1 to 32 letters or digits.",
)
@click.option(
    "--session",
    default="01",
    show_default=True,
    metavar="ID",
    help="Identifier of the session: 1 to 32 letters or digits.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results"),
    show_default=True,
    metavar="DIR",
    help="Folder for the results of the study.",
)
@click.option(
    "--responder",
    default="terminal",
    show_default=True,
    metavar="NAME",
    help="Source of the responses: screen (a participant at a window), terminal (a participant at "
    "this terminal), simulated (a simulated participant), or an installed responder.",
)
@click.option(
    "--operator", metavar="NAME", help="Name of the operator, saved in the session header."
)
@click.option(
    "--fact",
    "column_values",
    multiple=True,
    metavar="NAME=VALUE",
    help="Value of a participant column that the study declares. Repeat the option for several "
    "columns.",
)
@hardware_options
@click.option(
    "--levels",
    "levels_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Use the levels in this file, written by `tactstrip levels`, instead of those of the "
    "study.",
)
@click.option(
    "--lsl",
    is_flag=True,
    help="Send event markers for EEG and MEG recordings over Lab Streaming Layer.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    metavar="N",
    show_default="random, printed",
    help="Seed of the trial plan.",
)
@click.option(
    "--participant-number",
    type=click.IntRange(min=1),
    metavar="N",
    show_default="the participant's row in participants.tsv",
    help="Number that selects the order of conditions if the study balances it.",
)
@click.option("--resume", "resuming", is_flag=True, help="Continue an interrupted session.")
@click.option(
    "--resume-anyway",
    is_flag=True,
    help="Like --resume, but also on another host or device, or after more than 30 minutes.",
)
@click.option(
    "--practice-without-device",
    "practice",
    is_flag=True,
    help="Use the mock device, which moves nothing, instead of the device of the study. To use an "
    "emulator, also give --driver and --port.",
)
@refusals
def run(
    *,
    study_file: Path,
    participant: str,
    session: str,
    out: Path,
    responder: str,
    operator: str | None,
    column_values: tuple[str, ...],
    driver: str | None,
    port: str | None,
    confirm_hardware: bool,
    levels_file: Path | None,
    lsl: bool,
    seed: int | None,
    participant_number: int | None,
    resuming: bool,
    resume_anyway: bool,
    practice: bool,
) -> None:
    """Run one session with a participant.

    tactstrip writes every response to disk before it presents the next stimulus. If the session is
    stopped or interrupted, repeat the command with --resume to continue it.
    """
    from device.drivers import MOCK
    from experiment.apparatus.rig import assemble, require_device
    from experiment.archive.folders import SessionFolder
    from experiment.archive.participants import participant_facts
    from experiment.operator.requests import Requests, StopSignal
    from experiment.session.conduct import begin, completed, resume
    from experiment.session.markers import NoMarkers
    from experiment.session.setting import Setting, Sitting

    stop, requests = StopSignal(), Requests()
    responder_from = distribution_of(responder)
    Sitting(operator=operator)  # rejects an invalid name before anything else happens
    with stop.on_signals():
        if responder == "screen":
            from experiment.participant.window import require_window

            require_window()
        folder = SessionFolder(out, participant, session)
        driver = MOCK if practice and driver is None and port is None else driver
        resuming = resuming or resume_anyway
        if resuming:
            plan = plan_to_resume(folder, study_file, seed, levels_file, column_values)
            refuse_another_number(participant_number, plan)
            with _failures():
                ending = completed(folder, plan, click.echo)
            if ending is not None:
                _print_result(ending, plan)
                return
        else:
            plan = _new_plan(
                folder, study_file, seed, levels_file, driver, participant_number=participant_number
            )
        study = folder.read_study(plan)
        if column_values:
            folder = replace(
                folder, facts=participant_facts(study.participants.columns, column_values)
            )
        folder.check_people(study)  # before a window opens or the operator is prompted
        simulated = responder == "simulated"
        rig = assemble(study, driver=driver, port=port, simulated=simulated, practice=practice)
        _print_driver_notes(study, rig, responder, practice=practice)
        markers = _markers(folder, rig.clock) if lsl else NoMarkers()
        sitting = Sitting(
            responder=responder,
            operator=operator,
            responder_from=responder_from,
            driver_from=rig.driver_from,
        )
        with device_failures():
            confirmation = _confirm_hardware(rig, stop, given=confirm_hardware, practice=practice)
        if confirmation is None and responder in {"screen", "terminal"}:
            # This check precedes the window. A confirmed device identifies itself when it is
            # opened, and an installed responder declares whether it is a person.
            kind = "mock" if rig.settings.driver == MOCK else "emulated"
            require_device(kind, simulated=False, practice=practice)
        if lsl:
            _await_recorder(markers, stop)
        with (
            _failures(),
            responder_named(
                *(responder, study, plan, rig.clock),
                requests=requests,
                stop=stop,
                practice=practice,
            ) as active_responder,
            display_beside(responder, requests, stop) as display,
        ):
            setting = Setting(
                device=rig.device,
                responder=active_responder,
                noise=_noise(study, rig.clock, simulated=simulated or practice),
                clock=rig.clock,
                stop=stop,
                resume_anyway=resume_anyway,
                confirmation=confirmation,
                practice=practice,
                tell=_print_below if responder == "terminal" else click.echo,
                requests=requests,
                display=display,
                sitting=sitting,
                markers=markers,
                monitor=rig.monitor,
            )
            ending = resume(folder, setting) if resuming else begin(folder, plan, setting)
        _print_result(ending, plan, practice_out=out if practice and not simulated else None)


def _print_below(message: str) -> None:
    """Print on a new line, because the last line of a participant's terminal stays open."""
    click.echo(f"\n{message}")


def _print_driver_notes(study: Study, rig: Rig, responder: str, *, practice: bool) -> None:
    """Note a mock device in place of the study's, and installed names that a built-in one hides."""
    from device.drivers import MOCK, NEEDS
    from device.installed import DRIVERS, RESPONDERS, shadowed
    from experiment.trial import responder as built_in

    for group, name, names in (
        (DRIVERS, rig.settings.driver, NEEDS),
        (RESPONDERS, responder, built_in.RESPONDERS),
    ):
        if name in names and (warning := shadowed(group, name)):
            click.echo(f"Note: {warning}.", err=True)
    if practice and rig.settings.driver == MOCK != study.device.driver:
        click.echo(
            f"Note: the mock takes the place of the driver {study.device.driver}: no device is "
            "opened, nothing moves."
        )


def _markers(folder: SessionFolder, clock: Clock) -> Markers:
    from experiment.session.markers import LslMarkers

    return LslMarkers(clock, participant=folder.participant, session=folder.session)


def _await_recorder(markers: Markers, stop: StopSignal) -> None:
    from experiment.operator.requests import StopRequested
    from experiment.session.markers import await_recorder

    try:
        with stop.interruptible():
            await_recorder(markers, click.echo, asking=True)
    except StopRequested as error:
        raise KeyboardInterrupt from error


def _confirm_hardware(
    rig: Rig, stop: StopSignal, *, given: bool, practice: bool
) -> Confirmation | None:
    from experiment.operator.requests import StopRequested

    try:
        with stop.interruptible():
            return confirmed(rig, given=given, practice=practice)
    except StopRequested as error:
        raise KeyboardInterrupt from error


def _new_plan(
    folder: SessionFolder,
    study_file: Path,
    seed: int | None,
    levels_file: Path | None,
    driver: str | None,
    *,
    participant_number: int | None,
) -> Plan:
    from experiment.check.check import require_fit
    from experiment.study.files import read_levels, read_study
    from experiment.study.presentation import key_doubts, unsaid_in
    from experiment.study.study import told_by_file
    from experiment.trial.draw import draw_plan

    levels_vpp = read_levels(levels_file, folder.participant) if levels_file else None
    folder.refuse_existing()
    with working("Checking"), told_by_file(study_file):
        study = read_study(study_file)
        gains = require_fit(study, driver=driver).gains
    balanced = study.design.condition_order == "balanced"
    if balanced and participant_number is None:
        participant_number = folder.participant_number()
    elif participant_number is not None and not balanced:
        raise CommandError(
            f'--participant-number needs condition_order = "balanced" in [design]; got '
            f"{study.design.condition_order!r}"
        )
    if omitted := unsaid_in(study.texts, study.design):
        click.echo(f"Note: your own instructions are {omitted}: say it if they do not.")
    for warning in key_doubts(study.texts, study.keys, study.design):
        click.echo(f"Note: {warning}.")
    seed = secrets.randbits(32) if seed is None else seed
    with told_by_file(levels_file):
        plan = draw_plan(
            study,
            participant=folder.participant,
            session=folder.session,
            seed=seed,
            levels_vpp=levels_vpp,
            gains=gains,
            participant_number=participant_number,
        )
    click.echo(f"seed {seed}")
    if balanced:
        order = ", ".join(plan.condition_order)
        click.echo(f"participant number {participant_number}: conditions in the order {order}")
        assert plan.participant_number is not None
        if warning := folder.number_shared(plan.participant_number):
            click.echo(f"Note: {warning}.")
    return plan


@contextlib.contextmanager
def _failures() -> Iterator[None]:
    """Turn failures of device, noise and disk into errors with exit codes."""
    from experiment.apparatus.noise import NoiseError
    from experiment.archive.journal import JournalWriteError
    from experiment.trial.responder import ResponderError

    try:
        with device_failures():
            yield
    except ResponderError as error:
        raise CommandError(
            f"responder: {error}; a session that was begun goes on with --resume",
            exit_code=STOPPED_EARLY,
        ) from error
    except NoiseError as error:
        raise CommandError(
            f'{error}; a study with noise = "none" in [masking] plays none',
            exit_code=DEVICE_FAILED,
        ) from error
    except JournalWriteError as error:
        raise CommandError(
            f"{error}; what is recorded is safe: make room, then go on with --resume",
            exit_code=STOPPED_EARLY,
        ) from error


def _noise(study: Study, clock: Clock, *, simulated: bool) -> NoisePlayer:
    from experiment.apparatus.noise import noise_player

    return noise_player(study.masking, clock, simulated=simulated)


def _has_trials(table: Path) -> bool:
    return table.read_bytes().count(b"\n") > 1


def _print_result(ending: Ending, plan: Plan, practice_out: Path | None = None) -> None:
    click.echo(f"head hash of the journal, to be written down elsewhere: {ending.head_sha256}")
    if ending.torn_file is not None:
        click.echo(
            f"a last journal line that was cut short was moved to {ending.torn_file}", err=True
        )
    if ending.failure is not None:
        message = f"device: {ending.failure}; go on with {resumed_line()}"
        raise CommandError(message, exit_code=DEVICE_FAILED)
    if ending.finished:
        unanswered = ending.unanswered
        outcome = f"done, {unanswered} of them without an answer" if unanswered else "answered"
        click.echo(f"all {plan.trials_words()} are {outcome}: {ending.trials_path}")
    if practice_out is not None and _has_trials(ending.trials_path):
        command = f"tactstrip analyze {shlex.quote(str(practice_out))} --allow-simulated"
        click.echo(f"nobody felt anything; to analyze it all the same: {command}")
    if not ending.finished:
        message = (
            f"stopped early, {ending.trials_path} holds what is done; go on with {resumed_line()}"
        )
        raise CommandError(message, exit_code=STOPPED_EARLY, label="")
