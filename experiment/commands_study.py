"""The commands `init` and `check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.exits import ANSWER_IS_NO, CommandError, refusals

if TYPE_CHECKING:
    from experiment.study_check import StudyCheck


@click.command()
@click.argument(
    "file", metavar="[FILE]", type=click.Path(path_type=Path), default=Path("study.toml")
)
@click.option(
    "--preset",
    type=click.Choice(["paper", "recommended"]),
    default="paper",
    show_default=True,
    help="The paper's protocol, or the one we recommend.",
)
@refusals
def init(*, file: Path, preset: str) -> None:
    """Write a commented study file, study.toml by default; an existing one is left alone."""
    from experiment.archive import write_atomically
    from experiment.study_text import write_study_text

    text = write_study_text(preset)
    try:
        file.open("x").close()
    except FileExistsError as error:
        raise CommandError(f"{file} exists and is left as it is; name another file") from error
    try:
        write_atomically(file, text)
    except OSError:
        file.unlink(missing_ok=True)
        raise
    click.echo(f"{file} holds the {preset} preset; next: tactstrip check {file}")


@click.command()
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
@refusals
def check(*, study_file: Path, as_json: bool) -> None:
    """Check a study's stimuli against its strip, its levels against the device, and its length.

    The exit code is 0 if every burst keeps below the strip's cut-off or is accepted with a reason,
    1 if one does not, 2 if the study cannot be used.
    """
    from experiment.check_report import check_json, check_text
    from experiment.study import read_study
    from experiment.study_check import check_study

    found: StudyCheck = check_study(read_study(study_file))
    click.echo(check_json(found) if as_json else check_text(found, str(study_file)))
    if found.verdict == "unfit":
        click.get_current_context().exit(ANSWER_IS_NO)
