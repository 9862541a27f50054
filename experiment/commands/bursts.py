"""The command `bursts`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from device.printing import echo
from experiment.commands.options.common import PATH, json_option
from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, refusals

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from stimuli.drive.windows import Window


def _list_parser(item: Callable[[str], Any], items: str) -> Callable[..., tuple[Any, ...]]:
    """Return a click callback that parses numbers separated by commas."""

    def parse(_: click.Context, option: click.Parameter, text: str | None) -> tuple[Any, ...]:
        try:
            return tuple(map(item, text.split(","))) if text is not None else ()
        except ValueError as error:
            raise click.UsageError(
                f"{option.opts[0]} must be {items} with commas between them; got {text!r}"
            ) from error

    return parse


@click.command(epilog="Example: tactstrip bursts study.toml --frequency-hz 200,300 --cycles 1,2")
@click.argument("study_file", metavar="STUDY", type=PATH)
@click.option(
    "--frequency-hz",
    "frequencies_hz",
    metavar="A,B,...",
    callback=_list_parser(float, "numbers"),
    show_default="200 to 500 and those of the study",
    help="Frequencies to compare, in Hz.",
)
@click.option(
    "--cycles",
    metavar="A,B,...",
    callback=_list_parser(int, "whole numbers"),
    show_default="1,2,3 and those of the study",
    help="Numbers of cycles to compare.",
)
@click.option(
    "--window",
    type=click.Choice(("none", "hann", "tukey", "gaussian")),
    show_default="that of [burst]",
    help="Window of every burst.",
)
@json_option
@refusals
def bursts(
    *,
    study_file: Path,
    frequencies_hz: tuple[float, ...],
    cycles: tuple[int, ...],
    window: Window | None,
    as_json: bool,
) -> None:
    """Compare bursts on a study's plate, and print the shortest within limits as TOML.

    tactstrip checks each combination of frequency and number of cycles like `tactstrip check`. If
    the edges are ideal and no cut-off frequency was measured, it also checks the other ideal edge.
    The exit code is 0 if a burst is within limits, and 1 if none is. The study file is not changed.
    """
    from experiment.check.bursts import compare_bursts, grid_of
    from experiment.check.report import report_json, report_text
    from experiment.study.base import StudyError
    from experiment.study.files import naming, read_study

    study = read_study(study_file)
    with working("Comparing bursts") as step, naming(study_file):
        try:
            report = compare_bursts(
                study,
                grid_of(study, frequencies_hz, cycles),
                step,
                file_name=str(study_file),
                window=window,
            )
        except StudyError as error:
            given = {"frequency_hz": frequencies_hz, "cycles": cycles, "window": window}
            options = {f"burst.{key}": f"--{key.replace('_', '-')}" for key in given if given[key]}
            raise error.renamed(options) from error
    text = report_json(report) if as_json else report_text("bursts", report)
    echo(*text.splitlines())
    if report["best"] is None:
        click.get_current_context().exit(ANSWER_IS_NO)
