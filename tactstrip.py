"""The command line's front door: names the commands and imports each only when it is called."""

from __future__ import annotations

from importlib import import_module

import click

COMMANDS = {
    "init": ("experiment.commands_study", "init", "Write a commented study file."),
    "check": ("experiment.commands_study", "check", "Check a study's stimuli against its strip."),
    "dry-run": ("analysis.dry_run", "dry_run", "Simulate participants and analyze them."),
    "run": ("experiment.commands", "run", "Run one session with a participant."),
    "analyze": ("analysis.commands", "analyze", "Turn result CSVs into tables and figures."),
    "export": ("experiment.commands", "export", "Build trials.csv anew from the journals."),
}
"""Command: the module and the name where it is defined, and what the help says of it."""


class _FrontDoor(click.Group):
    """A group whose commands are imported when they are called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, name, _ = COMMANDS[cmd_name]
        command = getattr(import_module(module), name)
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, _, text) in COMMANDS.items()])


@click.group(cls=_FrontDoor, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="tactstrip")
def main() -> None:
    """Run vibrotactile detection experiments on narrow strip plates.

    Exit codes: 0 done; 1 done, and the answer is no; 2 bad input or usage; 3 device failure;
    4 stopped early, can be resumed.
    """
