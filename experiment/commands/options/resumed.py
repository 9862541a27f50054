"""The resumption of a session: its plan, and the command line that continues it."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Final

import click
from click.core import ParameterSource

from experiment.exits import CommandError

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.archive.folders import SessionFolder
    from experiment.trial.plan import Plan

_OMITTED: Final = frozenset(
    {"confirm_hardware", "column_values", "resuming", "resume_anyway", "seed"}
)
"""Options that apply only when a session begins, or that must be confirmed anew."""


def resumed_line() -> str:
    """Return the command line of the current command with --resume."""
    context = click.get_current_context()
    arguments = ["tactstrip", str(context.info_name)]
    for parameter in context.command.params:
        name = parameter.name or ""
        is_given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if not is_given or name in _OMITTED:
            continue
        value = context.params[name]
        arguments += parameter.opts[:1] if isinstance(parameter, click.Option) else []
        arguments += [] if value is True else [str(value)]
    return shlex.join([*arguments, "--resume"])


def plan_to_resume(
    folder: SessionFolder,
    study_file: Path,
    seed: int | None,
    levels_file: Path | None,
    column_values: tuple[str, ...],
) -> Plan:
    """Return the plan of the session; reject options that contradict it."""
    from experiment.study.files import is_recorded, other_levels, read_levels

    levels_vpp = read_levels(levels_file, folder.participant) if levels_file else None
    plan = folder.read_plan()
    folder.refuse_loss()
    if column_values:
        raise CommandError(
            f"--fact must be given when a session begins; got {column_values[0]!r} with --resume: "
            "correct participants.tsv while no session runs"
        )
    if not is_recorded(study_file, plan.study, plan.file_sha256):
        raise CommandError(
            f"STUDY is not the study that this session was begun with; got {study_file}, of "
            f"another sha256 than {plan.file_sha256[:12]}...: resume with the file as it was, or "
            "begin another session (--session, --out)"
        )
    if seed is not None and seed != plan.seed:
        raise CommandError(f"--seed must be that of the session, {plan.seed}; got {seed}")
    if levels_vpp is not None and (planned := other_levels(folder.read_study(plan), levels_vpp)):
        raise CommandError(f"--levels must be those of the session, {planned}; got others")
    return plan


def refuse_another_number(participant_number: int | None, plan: Plan) -> None:
    """Reject a participant number other than that of the session."""
    if participant_number not in {None, plan.participant_number}:
        raise CommandError(
            "--participant-number must be that of the session, "
            f"{plan.participant_number or 'none'}; got {participant_number}"
        )
