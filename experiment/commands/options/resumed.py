"""How a session goes on: with the plan that it began with, by the line that began it."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Final

import click
from click.core import ParameterSource

from experiment.terms.exits import CommandError

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.archive.folders import SessionFolder
    from experiment.trial.plan import Plan

_LEFT_OUT: Final = frozenset({"confirm_hardware", "facts", "resuming", "resume_anyway", "seed"})
"""Told once, when a session begins; but that it is safe is said anew, by who sees the device."""


def resumed_line() -> str:
    """Return the present command as it was given, with --resume."""
    context = click.get_current_context()
    words = ["tactstrip", str(context.info_name)]
    for one in context.command.params:
        name = one.name or ""
        given = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if not given or name in _LEFT_OUT:
            continue
        value = context.params[name]
        words += one.opts[:1] if isinstance(one, click.Option) else []
        words += [] if value is True else [str(value)]
    return shlex.join([*words, "--resume"])


def plan_to_resume(
    folder: SessionFolder,
    study_file: Path,
    seed: int | None,
    levels_file: Path | None,
    facts: tuple[str, ...],
) -> Plan:
    """Return the session's plan; refuse options that say otherwise than it does."""
    from experiment.study.read import is_recorded, other_levels, read_levels

    levels_vpp = read_levels(levels_file, folder.participant) if levels_file else None
    plan = folder.read_plan()
    folder.refuse_loss()
    if facts:
        raise CommandError(
            f"--fact must be given when a session begins; got {facts[0]!r} with --resume: "
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


def refuse_another_number(given: int | None, plan: Plan) -> None:
    """Refuse a participant's number other than that which the session began with."""
    if given not in {None, plan.participant_number}:
        sealed = plan.participant_number
        raise CommandError(
            f"--participant-number must be that of the session, {sealed or 'none'}; got {given}"
        )
