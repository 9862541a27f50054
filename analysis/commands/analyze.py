"""The command ``analyze``: result files to tables, summary, figures and a report."""

from __future__ import annotations

import sys
import webbrowser
from contextlib import nullcontext
from functools import reduce
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from analysis.numbers import METHODS
from experiment.commands.options.common import PATH, seed_option
from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from contextlib import AbstractContextManager

    from analysis.reading.columns import ColumnMap
    from analysis.reading.sources import InputTable
    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


_BIDS = "dataset_description.json"
MANY_TABLES = 20
"""Reading this many tables or more takes long enough for a progress bar."""


def write_analysis(
    paths: Sequence[str | Path],
    out_dir: str | Path,
    *,
    columns: ColumnMap | None = None,
    ci: str = "wilson",
    allow_simulated: bool = False,
    accept_altered: bool = False,
    seed: int = 0,
    figures: bool = True,
    style: Style | None = None,
    bar: bool = False,
) -> Analysis:
    r"""Read result files, analyse them and write tables, summary, figures and a report.

    Parameters
    ----------
    paths : sequence of str or Path
        Files and folders, as for `analysis.read_trials`.
    out_dir : str or Path
        The output folder. It is not changed if the input is rejected.
    columns : ColumnMap, optional
        The column map of external tables.
    ci : str
        The method of the intervals of proportions.
    allow_simulated : bool
        Whether to accept simulated together with real sessions, and practice without a device.
    accept_altered : bool
        Whether to analyse modified sessions, and mark them in every output.
    seed : int
        The seed of the bootstrap, saved in the summary.
    figures : bool
        Whether to write figures.
    style : Style, optional
        The width, the style sheet and the formats of the figures.
    bar : bool
        Whether to show progress on a terminal.

    Returns
    -------
    Analysis
        The tables that were written.

    Raises
    ------
    ResultFileError
        If a file is not a valid table of trials.
    ValueError
        If the method is unknown, or the output folder holds the input or other files with the
        names of output files.
    OSError
        If the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from analysis import ColumnMap
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response\n1,left,60,left\n")
    ...     analysis = write_analysis([table], folder, columns=ColumnMap(), figures=False)
    ...     sorted(path.name for path in Path(folder).iterdir())
    ['.tactstrip.json', 'columns.json', 'confusion.csv', 'levels.csv', 'methods.txt',
    'participants.csv', 'report.html', 'summary.json', 'table.csv', 'thresholds.csv',
    'trials_clean.csv']
    >>> analysis.levels[["detected", "presented"]].to_numpy().tolist()
    [[1, 1]]
    """
    from analysis.reading.trials import read_inputs

    step, watched = (working, _reading_progress) if bar else (nullcontext, nullcontext)
    loaded = read_inputs(paths, columns, watched=watched, accept_altered=accept_altered)
    from analysis.results.analysis import analyse

    with step("Fitting"):
        analysis = analyse(loaded, ci=ci, seed=seed, allow_simulated=allow_simulated)
    from analysis.results.figures.drawing import DEFAULT_STYLE
    from analysis.results.files import save

    with step("Writing"):
        chosen = (style or DEFAULT_STYLE) if figures else None
        save(analysis, Path(out_dir), read=loaded.paths, style=chosen)
    return analysis


def _reading_progress(
    sources: Sequence[InputTable],
) -> AbstractContextManager[Iterable[InputTable]]:
    hidden = len(sources) < MANY_TABLES or not sys.stderr.isatty()
    return click.progressbar(sources, label="Reading", file=sys.stderr, hidden=hidden)


_OUTPUT_OPTIONS = (
    click.option(
        "--no-figures", is_flag=True, help="Write no figures. The report contains tables only."
    ),
    click.option("--details", is_flag=True, help="Also print the tables."),
    click.option("--open", "open_report", is_flag=True, help="Open the report in the web browser."),
)


def output_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options of a command that writes an analysis."""
    return reduce(lambda function, option: option(function), reversed(_OUTPUT_OPTIONS), command)


@click.command(epilog="Example: tactstrip analyze results")
@click.argument("paths", nargs=-1, required=True, metavar="PATH...", type=PATH)
@click.option(
    "--out",
    type=PATH,
    show_default="PATH/analysis for a single folder of sessions, PATH-analysis otherwise",
    help="Folder for the results.",
)
@click.option(
    "--columns",
    type=PATH,
    help="Column map of external tables. `tactstrip columns` proposes one.",
)
@click.option(
    "--ci",
    type=click.Choice(METHODS),
    default=METHODS[0],
    show_default=True,
    help="Method for the 95 % interval of each participant's proportions.",
)
@click.option(
    "--allow-simulated",
    is_flag=True,
    help="Accept simulated sessions together with real ones, and practice without a device.",
)
@click.option(
    "--accept-altered",
    is_flag=True,
    help="Accept modified sessions. Every output is marked accordingly.",
)
@seed_option(default=0, show_default=True, help="Seed of the bootstrap, saved in summary.json.")
@click.option("--strict", is_flag=True, help="Exit with code 1 if there is a warning.")
@click.option("--pdf", is_flag=True, help="Also write each figure as PDF.")
@click.option(
    "--width-mm",
    type=click.FloatRange(60, 400),
    metavar="MM",
    default=85.0,
    show_default=True,
    help="Width of the figures.",
)
@click.option(
    "--style",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Matplotlib style sheet for the figures.",
)
@output_options
@refusals
def analyze(
    paths: tuple[Path, ...],
    out: Path | None,
    columns: Path | None,
    *,
    strict: bool,
    pdf: bool,
    width_mm: float,
    style: Path | None,
    no_figures: bool,
    details: bool,
    open_report: bool,
    **options: Any,
) -> None:
    """Analyze result files and write tables, figures and a report.

    PATH is a file or a folder. In a folder, tactstrip reads every sub-*/ses-*/trials.csv, or with
    --columns every .csv and .tsv file. It verifies each session against its journal, and stops with
    exit code 2 if a session was modified. A table without a journal is analyzed and marked.
    """
    if pdf and no_figures:
        raise click.UsageError("--pdf writes figures: leave --no-figures out")
    from analysis.reading.columns import load_column_map

    column_map = load_column_map(columns) if columns else None
    for path in paths:
        if not path.exists():
            raise CommandError(f"{path}: no such file or folder")
    from analysis.results.figures.drawing import Style

    target = out or default_folder(paths, external=columns is not None)
    analysis = write_analysis(
        paths,
        target,
        columns=column_map,
        figures=not no_figures,
        style=Style(width_mm=width_mm, style=style, pdf=pdf),
        bar=True,
        **options,
    )
    show_analysis(analysis, target, details=details, open_report=open_report)
    if strict and analysis.warnings:
        click.get_current_context().exit(ANSWER_IS_NO)


def show_analysis(
    analysis: Analysis, folder: Path, *, details: bool, open_report: bool, **remarks: Any
) -> None:
    """Print the answer of an analysis, and open its report if the user asks for it."""
    from analysis.results.console import print_analysis
    from analysis.results.files import REPORT

    report = folder / REPORT
    print_analysis(analysis, sys.stdout, details=details, report=str(report), **remarks)
    if open_report:
        webbrowser.open(report.resolve().as_uri())


def default_folder(paths: Sequence[Path], *, external: bool) -> Path:
    """Return the folder for the results: new, empty, or of an earlier analysis.

    Results are written into a folder of sessions, but not into data of another program.
    """
    first = paths[0]
    is_session_folder = not external and len(paths) == 1 and first.is_dir()
    if is_session_folder and not (first / _BIDS).exists():
        base = first / "analysis"
    else:
        base = Path(f"{first.resolve().stem}-analysis")
    numbered = (base.with_name(f"{base.name}-{number}") for number in count(2))
    return next(folder for folder in chain([base], numbered) if _is_free(folder))


def _is_free(folder: Path) -> bool:
    from experiment.record import manifest

    if not folder.is_dir():
        return not folder.exists()
    return (folder / manifest.NAME).exists() or not any(folder.iterdir())
