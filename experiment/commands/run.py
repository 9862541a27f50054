"""The command `run`."""

from __future__ import annotations

import contextlib
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click
from click.core import ParameterSource

from device.printing import echo
from experiment.commands.options.common import seed_option
from experiment.commands.options.hardware import (
    confirmed,
    device_failures,
    hardware_options,
    working,
)
from experiment.commands.options.responders import (
    complete_responders,
    display_beside,
    require_usable,
    responder_named,
)
from experiment.exits import DEVICE_FAILED, STOPPED_EARLY, CommandError, refusals, room_hint

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.hardware.safety import Purpose
    from experiment.hardware.setup import Hardware
    from experiment.operator.requests import StopSignal
    from experiment.record.folder import SessionFolder
    from experiment.session.config import SessionResult
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
    shell_complete=complete_responders,
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
@seed_option(show_default="random, printed", help="Seed of the trial plan.")
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
@click.option(
    "--rehearse",
    is_flag=True,
    help="Rehearse with window, noise and monitor, but with the mock device. To use an emulator, "
    "also give --driver and --port. No analysis accepts the session.",
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
    rehearse: bool,
) -> None:
    """Run one session with a participant.

    tactstrip writes every response to disk before it presents the next stimulus. If the session is
    stopped or interrupted, repeat the command with --resume to continue it.
    """
    from device.drivers import MOCK
    from experiment.hardware.noise import noise_player
    from experiment.hardware.safety import Purpose
    from experiment.hardware.setup import assemble
    from experiment.operator.requests import Requests, StopSignal
    from experiment.record.folder import SessionFolder
    from experiment.record.people import parse_participant_values
    from experiment.session.config import SessionConfig, require_operator
    from experiment.session.markers import LslMarkers, await_recorder
    from experiment.session.run import chosen_purpose, finish
    from experiment.session.run import run as run_session

    stop, requests = StopSignal(), Requests()
    responder_from = require_usable(responder)  # an invalid name is rejected before anything else
    require_operator(operator)
    purpose = chosen_purpose(practice=practice, rehearse=rehearse)
    if purpose is not Purpose.DATA and driver is None and port is None:
        driver = MOCK
    folder = SessionFolder(out, participant, session)
    chosen = {"seed": seed, "participant_number": participant_number}
    resuming = resuming or resume_anyway
    with stop.on_signals(), _failures(folder):
        if resuming:
            plan = _plan_to_resume(folder, study_file, levels_file, column_values, **chosen)
            result = finish(folder, plan, echo)
            if result is not None:
                _print_result(result, plan)
                return
        else:
            plan = _new_plan(folder, study_file, levels_file, driver, **chosen)
        study = folder.read_study(plan)
        if column_values:
            values = parse_participant_values(study.participants.columns, column_values)
            folder = replace(folder, values=values)
        folder.check_people(study)  # before a window opens or the operator is prompted
        simulated = responder == "simulated"
        hardware = assemble(study, driver=driver, port=port, simulated=simulated, purpose=purpose)
        _print_driver_notes(study, hardware, responder, purpose)
        names = {"participant": participant, "session": session}
        markers = LslMarkers(hardware.clock, **names) if lsl else None
        with _interruptible(stop):
            # Before a window opens; an installed responder says later whether it is a person.
            is_person = responder in {"screen", "terminal"}
            confirmation = confirmed(
                hardware, given=confirm_hardware, simulated=not is_person, purpose=purpose
            )
            if markers is not None:
                await_recorder(markers, echo, asking=True)
        noise = noise_player(
            study.masking,
            hardware.clock,
            is_silent=not purpose.plays_noise(simulated=simulated),
        )
        with (
            responder_named(
                *(responder, study, plan, hardware.clock),
                requests=requests,
                stop=stop,
                practice=purpose is Purpose.PRACTICE,
            ) as active_responder,
            display_beside(responder, requests, stop) as (show, report),
        ):
            config = SessionConfig(
                device=hardware.device,
                responder=active_responder,
                noise=noise,
                clock=hardware.clock,
                stop=stop,
                resume=resuming,
                resume_anyway=resume_anyway,
                purpose=purpose,
                confirmation=confirmation,
                report=report,
                requests=requests,
                show=show,
                responder_name=responder,
                operator=operator,
                responder_from=responder_from,
                driver_from=hardware.driver_from,
                markers=markers,
                monitor=hardware.monitor,
            )
            result = run_session(folder, plan, config)
    is_practice = purpose is Purpose.PRACTICE and not simulated
    _print_result(result, plan, practice_out=out if is_practice else None)


def _print_driver_notes(study: Study, hardware: Hardware, responder: str, purpose: Purpose) -> None:
    """Note a mock device in place of the study's, and installed names that a built-in one hides."""
    from device.drivers import MOCK, NEEDS
    from device.installed import DRIVERS, RESPONDERS, shadowed
    from experiment.hardware.safety import Purpose
    from experiment.trial import responder as built_in

    driver = hardware.settings.driver
    hidden = [shadowed(DRIVERS, driver)] if driver in NEEDS else []
    hidden += [shadowed(RESPONDERS, responder)] if responder in built_in.RESPONDERS else []
    for warning in filter(None, hidden):
        echo(f"Note: {warning}.", err=True)
    if purpose is not Purpose.DATA and driver == MOCK != study.device.driver:
        note = f"the mock takes the place of the driver {study.device.driver}"
        echo(f"Note: {note}: no device is opened, nothing moves.")


@contextlib.contextmanager
def _interruptible(stop: StopSignal) -> Iterator[None]:
    """Let a stop end a wait for the operator, before the session begins, as Ctrl-C does."""
    from experiment.operator.requests import StopRequested

    try:
        with stop.interruptible():
            yield
    except StopRequested as error:
        raise KeyboardInterrupt from error


def _new_plan(
    folder: SessionFolder,
    study_file: Path,
    levels_file: Path | None,
    driver: str | None,
    *,
    seed: int | None,
    participant_number: int | None,
) -> Plan:
    """Check the study, draw the plan of a session and print what was drawn."""
    from experiment.session.run import plan_session
    from experiment.study.files import naming, read_levels, read_study, with_levels

    folder.refuse_existing()
    levels_vpp = read_levels(levels_file, folder.participant) if levels_file else None
    with working("Checking"):
        study = read_study(study_file)
        if levels_vpp is not None:
            with naming(levels_file):
                with_levels(study, levels_vpp)
        with naming(study_file):
            plan = plan_session(
                folder,
                study,
                driver=driver,
                seed=seed,
                participant_number=participant_number,
                levels_vpp=levels_vpp,
            )
    echo(f"seed {plan.seed}")
    if plan.participant_number is not None:
        order = ", ".join(plan.condition_order)
        echo(f"participant number {plan.participant_number}: conditions in the order {order}")
    return plan


def _plan_to_resume(
    folder: SessionFolder,
    study_file: Path,
    levels_file: Path | None,
    column_values: tuple[str, ...],
    **chosen: int | None,
) -> Plan:
    """Return the plan of the session; reject options that contradict it."""
    from experiment.study.files import is_recorded, read_levels, with_levels

    levels_vpp = read_levels(levels_file, folder.participant) if levels_file else None
    plan = folder.read_plan()
    folder.refuse_loss()
    if column_values:
        raise CommandError(
            f"--fact must be given when a session begins; got {column_values[0]!r} with --resume: "
            "correct participants.tsv while no session runs"
        )
    if not is_recorded(study_file, plan.file_sha256):
        raise CommandError(
            f"STUDY is not the study that this session was begun with; got {study_file}, of "
            f"another sha256 than {plan.file_sha256[:12]}...: resume with the file as it was, or "
            "begin another session (--session, --out)"
        )
    for key, value in chosen.items():
        planned = getattr(plan, key)
        if value not in {None, planned}:
            option, was = f"--{key.replace('_', '-')}", "none" if planned is None else planned
            raise CommandError(f"{option} must be that of the session, {was}; got {value}")
    study = folder.read_study(plan)
    if levels_vpp is not None and with_levels(study, levels_vpp).sha256 != study.sha256:
        raise CommandError("--levels: must be the levels that the session was begun with")
    return plan


_OMITTED: Final = frozenset(
    {"confirm_hardware", "column_values", "resuming", "resume_anyway", "seed"}
)
"""Options that apply only when a session begins, or that must be confirmed again."""


def _resumed_line() -> str:
    """Return the command line of the current command with --resume."""
    context = click.get_current_context()
    arguments = ["tactstrip", str(context.info_name)]
    for parameter in context.command.params:
        name = parameter.name or ""
        is_given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if is_given and name not in _OMITTED:
            value = context.params[name]
            arguments += parameter.opts[:1] if isinstance(parameter, click.Option) else []
            arguments += [] if value is True else [str(value)]
    return shlex.join([*arguments, "--resume"])


@contextlib.contextmanager
def _failures(folder: SessionFolder) -> Iterator[None]:
    """Turn failures of device, noise and disk into errors with exit codes."""
    from experiment.hardware.noise import NoiseError
    from experiment.record.journal import JournalWriteError
    from experiment.trial.responder import ResponderError

    try:
        with device_failures():
            yield
    except ResponderError as error:
        message = f"responder: {error}; continue a session that began with --resume"
        raise CommandError(message, exit_code=STOPPED_EARLY) from error
    except NoiseError as error:
        message = f'{error}; a study with noise = "none" in [masking] plays none'
        raise CommandError(message, exit_code=DEVICE_FAILED) from error
    except (JournalWriteError, OSError) as error:
        is_disk_full = isinstance(error, JournalWriteError) or bool(room_hint(error.errno))
        if not (is_disk_full and folder.plan_path.exists()):
            raise
        where = f"{error.filename}: {error.strerror}" if isinstance(error, OSError) else str(error)
        hint = f"{room_hint(error.errno)}continue with {_resumed_line()}"
        message = f"{where}; the record is safe: {hint}"
        raise CommandError(message, exit_code=STOPPED_EARLY) from error


def _print_result(result: SessionResult, plan: Plan, practice_out: Path | None = None) -> None:
    """Print where the table is, what is still due, and the checksum last."""
    if result.torn_file is not None:
        echo(f"An incomplete last line of the journal was moved to {result.torn_file}.", err=True)
    if result.finished:
        unanswered = f", {result.unanswered} without an answer" if result.unanswered else ""
        echo(f"All {plan.describe_trials()} are done{unanswered}: {result.trials_path}")
    if practice_out is not None and result.trials_path.read_bytes().count(b"\n") > 1:
        command = f"tactstrip analyze {shlex.quote(str(practice_out))} --allow-simulated"
        echo(f"No stimulus was presented. To analyze the session nevertheless: {command}")
    error = None
    if result.failure is not None:
        message = f"device: {result.failure}; continue with {_resumed_line()}"
        error = CommandError(message, exit_code=DEVICE_FAILED)
    elif not result.finished:
        message = f"Stopped early: {result.trials_path}; continue with {_resumed_line()}"
        error = CommandError(message, exit_code=STOPPED_EARLY, label="")
    if error is not None:
        error.show()
    echo(f"Session checksum (copy it to your lab book): {result.head_sha256}")
    if error is not None:
        click.get_current_context().exit(error.exit_code)
