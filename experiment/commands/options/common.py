"""Types, options and checks that commands share."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Final

import click

from experiment.exits import CommandError
from experiment.record.files import UNWAITED, make_folder

PATH: Final = click.Path(path_type=Path)
json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print one JSON object instead of text."
)
seed_option = partial(click.option, "--seed", type=click.IntRange(min=0), metavar="N")


def make_new_folder(out: Path) -> None:
    """Make the folder of ``--out``; reject one that holds files."""
    if out.exists() and any(out.iterdir()):
        raise CommandError(f"--out must be a new or empty folder; got {out}, which holds files")
    make_folder(out, UNWAITED)


def _require_new(_context: object, option: click.Parameter, path: Path | None) -> Path | None:
    if path is not None and (path.exists() or path.is_symlink()):
        raise CommandError(f"{option.opts[0]} must be a new file; got {path}, which exists")
    return path


write_option = partial(click.option, "--write", "target", type=PATH, callback=_require_new)
"""Where a command writes a text that it would otherwise only print."""
