"""The commands: what each says of itself, and what their exit codes mean."""

from __future__ import annotations

from importlib import import_module

from click.testing import CliRunner

import tactstrip
from reference.api.constants import constants
from reference.markdown import code, table


def exit_codes() -> list[tuple[int, str]]:
    """Return each exit code with its meaning: the constants of the code and what stands below."""
    found = {0: "done"}
    for module in ("experiment.exits", "tactstrip"):
        for name, text in constants(module).items():
            if text.startswith("Exit code"):
                meaning = text.partition(": ")[2] or text.removeprefix("Exit code ")
                found.setdefault(getattr(import_module(module), name), meaning.rstrip("."))
    return sorted(found.items())


def help_of(*command: str) -> str:
    """Return what ``tactstrip COMMAND --help`` prints on 80 columns."""
    told = CliRunner().invoke(tactstrip.main, [*command, "--help"], prog_name="tactstrip")
    return told.output


def page() -> str:
    """Write the page."""
    told = [
        "# Commands and exit codes\n",
        (
            "Errors are one line on stderr. With `--json` a command prints one JSON object and "
            "nothing else.\n"
        ),
        table(("exit code", "means"), [(str(n), text) for n, text in exit_codes()]),
        "## tactstrip --help\n",
        code(help_of()),
    ]
    for command, (_, text) in tactstrip.COMMANDS.items():
        told += [f"## tactstrip {command}\n", f"{text}\n", code(help_of(command))]
    return "\n".join(told)
