"""The command line: names the commands and imports each only when it is called."""

from __future__ import annotations

import os
import re
import sys
import traceback
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

# More threads only wait for each other on small matrices. A value that the user has set is kept;
# stimuli/threads.py does the same for scripts.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

COMMANDS = {
    "demo": ("experiment", "Demonstrate a session in two minutes."),
    "init": ("experiment", "Write a commented study file."),
    "check": ("experiment", "Check the stimuli and levels of a study."),
    "bursts": ("experiment", "Compare bursts on a study's plate."),
    "dry-run": ("analysis", "Simulate participants and analyze them."),
    "run": ("experiment", "Run one session with a participant."),
    "analyze": ("analysis", "Analyze results and write a report."),
    "columns": ("analysis", "Propose a column map for an external table."),
    "power": ("analysis", "Estimate how many participants a study needs."),
    "audit": ("analysis", "Check whether a published table is possible."),
    "levels": ("analysis", "Choose levels from a participant's pilot session."),
    "field": ("experiment", "Draw the displacement field of a plate."),
    "devices": ("device", "List connected devices and sound cards."),
    "emulate": ("device", "Emulate a device for tests without hardware."),
    "export": ("experiment", "Rebuild trials.csv, or write a BIDS data set."),
    "verify": ("experiment", "Verify that sessions have not been modified."),
    "withdraw": ("experiment", "Permanently delete a participant's data."),
}
"""Command: its package and its line in the help.

``tactstrip dry-run`` is the function ``dry_run`` of ``<package>/commands/dry_run.py``.
"""

FIRST_STEPS = """\
tactstrip runs detection and discrimination experiments on narrow plates.

Try it without a device:
  tactstrip demo                         a short session at this terminal
  tactstrip dry-run                      an example study with simulated participants
Run a study:
  tactstrip init study.toml              then check, power, run, verify, analyze
Analyze a table from another program:
  tactstrip columns table.csv --write map.toml
  tactstrip analyze table.csv --columns map.toml

tactstrip --help lists all commands. Each command has --help, with an example.
"""
"""The output of `tactstrip` without arguments."""

PACKAGES = ("stimuli", "device", "experiment", "analysis")
"""The packages of tactstrip, beside this file."""

BAD_INPUT = 2
"""Exit code; `experiment.exits` has the same, but its package may be the one replaced."""


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
            similar = get_close_matches(name.lower().replace("_", "-"), COMMANDS, n=1)
            hint = f" Did you mean {similar[0]}?" if similar else ""
            ctx.fail(f"No such command {name!r}.{hint}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])

    def main(self, *args: Any, **kwargs: Any) -> Any:
        if (error := _intruder()) is not None:
            click.echo(f"error: {error}", err=True)
            sys.exit(BAD_INPUT)
        return super().main(*args, **kwargs)

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        with _one_line("tactstrip"):
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        with _one_line(ctx.command_path), _last_handler(debug=bool(ctx.params.get("debug"))):
            return super().invoke(ctx)


def _intruder() -> str | None:
    """Describe what Python would import in place of one of the packages, if anything.

    The packages have common names. A lab's own analysis.py comes first where its folder is on
    Python's path, as with ``python -m tactstrip`` there. A distribution with a package of the same
    name comes first in an editable installation; in a wheel installation, both write to one
    folder, and the last one wins. So nothing of the packages is imported before this check.
    """
    here = Path(__file__).resolve().parent
    for name in PACKAGES:
        ours = here / name / "__init__.py"
        spec = find_spec(name)
        folders = (spec and spec.submodule_search_locations) or ()
        path = Path((spec and spec.origin) or next(iter(folders), here)).resolve()
        site = path.parents[1] if path.name == "__init__.py" else path.parent
        if distribution := _other_distributions(site).get(name):
            return (
                f"the distribution {distribution} replaces the package {name} of tactstrip in "
                f"{site}: run pip uninstall {distribution}, then reinstall tactstrip with "
                "--force-reinstall"
            )
        if path not in {here, ours.parent, ours}:
            return (
                f"{path} hides the package {name} of tactstrip: rename it, or take its folder off "
                "Python's path"
            )
        if not ours.is_file() or "attach_stub(" not in ours.read_text("utf-8"):
            return (
                f"{ours} is missing or overwritten: remove what replaced it, then reinstall "
                "tactstrip with --force-reinstall"
            )
    return None


@cache
def _other_distributions(site: Path) -> dict[str, str]:
    """Map packages named as ours to the other distribution that installed files of that name."""
    line = re.compile(rf"^({'|'.join(PACKAGES)})(?:/|\.py,)", re.MULTILINE)
    return {
        package: record.parent.name.partition("-")[0]
        for record in site.glob("*.dist-info/RECORD")
        if not record.parent.name.startswith("tactstrip-")
        for package in line.findall(record.read_text("utf-8"))
    }


@contextmanager
def _one_line(command: str) -> Iterator[None]:
    """Report a usage error, or an interruption, in one line."""
    from experiment.exits import INTERRUPTED, CommandError

    try:
        yield
    except click.UsageError as error:
        path, message = error.ctx.command_path if error.ctx else command, error.format_message()
        end = "" if message.endswith((".", "?")) else "."
        raise CommandError(f"{message}{end} See {path} --help.") from error
    except KeyboardInterrupt as error:
        raise CommandError("interrupted", exit_code=INTERRUPTED) from error


@contextmanager
def _last_handler(*, debug: bool) -> Iterator[None]:
    """Report a fault of tactstrip itself in one line, with the traceback before it if `debug`."""
    from experiment.exits import INTERNAL_ERROR, CommandError

    try:
        yield
    except (click.ClickException, click.Abort, click.exceptions.Exit, BrokenPipeError):
        raise
    except Exception as error:
        if debug:
            traceback.print_exc()
        remedy = "please report it with the traceback above" if debug else "see tactstrip --debug"
        raise CommandError(
            f"{type(error).__name__}: {error} ({remedy})",
            exit_code=INTERNAL_ERROR,
            label="internal error: ",
        ) from error


@click.group(
    cls=_FrontDoor,
    invoke_without_command=True,
    epilog="""\b
    To complete commands with the Tab key, add this line to ~/.bashrc
    (for zsh, to ~/.zshrc, with zsh_source):
      eval "$(_TACTSTRIP_COMPLETE=bash_source tactstrip)"

    Example: tactstrip demo""",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="tactstrip")
@click.option("--debug", is_flag=True, help="Show the traceback of an internal error.")
@click.pass_context
def main(ctx: click.Context, *, debug: bool) -> None:  # noqa: ARG001 (see _FrontDoor.invoke)
    """Run vibrotactile detection experiments on narrow strip plates.

    Exit codes: 0 done; 1 done, but a check failed; 2 bad input or usage; 3 device failure;
    4 stopped early, can be resumed; 70 internal error.
    """
    if ctx.invoked_subcommand is None:
        click.echo(FIRST_STEPS, nl=False)


if __name__ == "__main__":
    main(prog_name="tactstrip")
