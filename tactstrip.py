"""The command line's front door: names the commands and imports each only when it is called."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

# No threads that nobody uses: see stimuli/tuned.py, which scripts have instead. Who sets the
# variable is left alone.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMANDS = {
    "demo": ("analysis", "Show what a session is, in two minutes."),
    "init": ("experiment", "Write a commented study file."),
    "check": ("experiment", "Check a study's stimuli against its strip."),
    "bursts": ("experiment", "Compare bursts on a study's plate."),
    "dry-run": ("analysis", "Simulate participants and analyze them."),
    "run": ("experiment", "Run one session with a participant."),
    "analyze": ("analysis", "Turn result CSVs into tables and figures."),
    "columns": ("analysis", "Draft the map of a table made elsewhere."),
    "power": ("analysis", "Tell how many people and trials a study needs."),
    "audit": ("analysis", "Tell if a printed table of proportions can be true."),
    "levels": ("analysis", "Place levels on a participant's function."),
    "field": ("experiment", "Draw the displacement of a study's plate."),
    "devices": ("device", "List what answers on ports and sound cards."),
    "emulate": ("device", "Emulate a device on a port, for tests."),
    "export": ("experiment", "Build trials.csv anew, or a BIDS data set."),
    "verify": ("experiment", "Tell if sessions are as they were recorded."),
    "withdraw": ("experiment", "Remove a person's data."),
}
"""Command: its package, and what the help says of it.

``tactstrip dry-run`` is the function ``dry_run`` of ``<package>/commands/dry_run.py``.
"""

OTHER_WORDS = {
    "demo": "example intro tour tutorial",
    "init": "config create design new settings setup template",
    "check": "calibrate calibration noise validate",
    "bursts": "stimulus waveform",
    "dry-run": "mock simulate simulation test",
    "run": "continue experiment gui record resume screen session start",
    "analyze": "figure figures fit graph plot report results statistics stats threshold",
    "columns": "import map",
    "power": "plan planning sample-size",
    "levels": "pilot",
    "field": "displacement draw figure map plot",
    "devices": "list ports scan",
    "emulate": "server",
    "export": "bids convert save",
    "verify": "integrity validate",
    "withdraw": "delete erase forget remove",
    "--help": "commands help",
    "--version": "version",
}
"""Command or option: words that people use for what it does.

A word may stand at two commands: both are named then.
"""


_LIKE = 0.8
"""What is spelt more like a command than this is that command, whatever else it is like."""

FIRST_STEPS = """\
tactstrip runs left / right / both detection experiments on narrow plates.

Try it out, without a device:
  tactstrip demo                         two minutes at this terminal
  tactstrip dry-run                      the paper's study on simulated people
Run a study:
  tactstrip init study.toml              then check, power, run, verify, analyze
Analyze a table made elsewhere:
  tactstrip columns table.csv --write map.toml
  tactstrip analyze table.csv --columns map.toml

tactstrip --help lists all commands; each has --help, with an example.
"""
"""What `tactstrip` alone says."""

PACKAGES = ("stimuli", "device", "experiment", "analysis")
"""Ours, beside this file."""

BAD_INPUT = 2
"""Exit code, as `experiment.terms.exits` has it, which may be hidden."""


class _FrontDoor(click.Group):
    """A group whose commands are imported when they are called, and whose errors are one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        package, _ = COMMANDS[cmd_name]
        name = cmd_name.replace("-", "_")
        command = getattr(import_module(f"{package}.commands.{name}"), name)
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        name = args[0]
        if name not in COMMANDS and not name.startswith("-") and not ctx.resilient_parsing:
            meant = " or ".join(_meant(name.lower().replace("_", "-")))
            hint = f" Did you mean {meant}?" if meant else ""
            ctx.fail(f"No such command {name!r}.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def main(self, *args: Any, **kwargs: Any) -> Any:
        if (error := _hidden_package()) is not None:
            click.echo(f"error: {error}", err=True)
            sys.exit(BAD_INPUT)
        return super().main(*args, **kwargs)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        with _one_line("tactstrip"):
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        with _one_line(ctx.command_path):
            return super().invoke(ctx)


def _meant(typed: str) -> list[str]:
    """List the commands that do what was typed, or what is spelt most like it."""
    from difflib import get_close_matches

    said: dict[str, list[str]] = {command: [command] for command in COMMANDS}
    for command, words in OTHER_WORDS.items():
        for word in words.split():
            said.setdefault(word, []).append(command)
    near = (
        [typed] * (typed in said)
        or get_close_matches(typed, COMMANDS, cutoff=_LIKE)
        or get_close_matches(typed, said)
    )
    return said[near[0]] if near else []


def _hidden_package() -> str | None:
    """Say which file Python would run in place of one of our packages, if there is one.

    Their names are plain words: a lab's own analysis.py comes first where its folder is on the
    path, as it is with ``python -m tactstrip`` there. So nothing of ours is imported before this.
    """
    for name in PACKAGES:
        spec, ours = find_spec(name), Path(__file__).resolve().parent / name / "__init__.py"
        if spec and spec.origin and Path(spec.origin).resolve() != ours:
            return (
                f"{spec.origin} hides the package {name} of tactstrip: rename it, or "
                "take its folder off Python's path"
            )
    return None


@contextmanager
def _one_line(command: str) -> Iterator[None]:
    """Say what is wrong with a command line, or that it was interrupted, in one line."""
    from experiment.terms.exits import INTERRUPTED, CommandError

    try:
        yield
    except click.UsageError as error:
        where, said = error.ctx.command_path if error.ctx else command, error.format_message()
        end = "" if said.endswith((".", "?")) else "."
        raise CommandError(f"{said}{end} See {where} --help.") from error
    except KeyboardInterrupt as error:
        raise CommandError("interrupted", exit_code=INTERRUPTED) from error


@click.group(
    cls=_FrontDoor,
    invoke_without_command=True,
    epilog="""\b
    Tab completes words after this line in ~/.bashrc (in ~/.zshrc: zsh_source):
      eval "$(_TACTSTRIP_COMPLETE=bash_source tactstrip)"

    Example: tactstrip demo""",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="tactstrip")
@click.pass_context
def main(ctx: click.Context) -> None:
    """Run vibrotactile detection experiments on narrow strip plates.

    Exit codes: 0 done; 1 done, and the answer is no; 2 bad input or usage; 3 device failure;
    4 stopped early, can be resumed.
    """
    if ctx.invoked_subcommand is None:
        click.echo(FIRST_STEPS, nl=False)


if __name__ == "__main__":
    main(prog_name="tactstrip")
