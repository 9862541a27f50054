"""The command ``analyze``: result files to tables, summary, figures and a report."""

from __future__ import annotations

import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import click

from analysis.definitions import METHODS
from device.printing import echo
from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from contextlib import AbstractContextManager

    from analysis.reading.foreign.columns import ColumnMap
    from analysis.reading.sources import InputTable
    from analysis.results.tables import Analysis


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
    population: bool = False,
    figures: bool = True,
    pdf: bool = False,
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
        The seed of the bootstrap and the permutation tests, saved in the summary.
    population : bool
        Whether to also fit the participants of each condition as one population.
    figures : bool
        Whether to write figures.
    pdf : bool
        Whether to also write figures as PDF.
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
    ['.tactstrip.json', 'confusion.csv', 'levels.csv', 'methods.txt', 'participants.csv',
    'report.html', 'summary.json', 'table.csv', 'thresholds.csv', 'trials_clean.csv']
    >>> analysis.levels[["detected", "presented"]].to_numpy().tolist()
    [[1, 1]]
    """
    from analysis.reading.load import no_search_for_circles, read_inputs
    from analysis.results.files import save
    from analysis.results.tables import analyse

    loaded = read_inputs(
        paths,
        columns,
        watched=_reading_progress if bar else nullcontext,
        accept_altered=accept_altered,
    )
    with working("Fitting") if bar else nullcontext(), no_search_for_circles():
        analysis = analyse(
            loaded, ci=ci, seed=seed, allow_simulated=allow_simulated, population=population
        )
    with working("Writing") if bar else nullcontext(), no_search_for_circles():
        save(analysis, Path(out_dir), with_figures=figures, read=loaded.paths, pdf=pdf)
    return analysis


def _reading_progress(
    sources: Sequence[InputTable],
) -> AbstractContextManager[Iterable[InputTable]]:
    hidden = len(sources) < MANY_TABLES or not sys.stderr.isatty()
    return click.progressbar(sources, label="Reading", file=sys.stderr, hidden=hidden)


@click.command(epilog="Example: tactstrip analyze results")
@click.argument(
    "paths", nargs=-1, required=True, metavar="PATH...", type=click.Path(path_type=Path)
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    show_default="PATH/analysis for a single folder of sessions, ./analysis otherwise",
    help="Folder for the results.",
)
@click.option(
    "--columns",
    type=click.Path(path_type=Path),
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
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    metavar="N",
    default=0,
    show_default=True,
    help="Seed of the bootstrap and the permutation tests, saved in summary.json.",
)
@click.option(
    "--population",
    is_flag=True,
    help="Also fit all participants of a condition as one population. Not available for a guess "
    "rate above 0.03 or for forced choice.",
)
@click.option("--strict", is_flag=True, help="Exit with code 1 if there is a warning.")
@click.option("--pdf", is_flag=True, help="Also write each figure as PDF.")
@click.option(
    "--no-figures", is_flag=True, help="Write no figures. The report contains tables only."
)
@refusals
def analyze(
    paths: tuple[Path, ...],
    out: Path | None,
    columns: Path | None,
    ci: str,
    seed: int,
    *,
    allow_simulated: bool,
    accept_altered: bool,
    population: bool,
    strict: bool,
    pdf: bool,
    no_figures: bool,
) -> None:
    """Analyze result files and write tables, figures and a report.

    PATH is a file or a folder. In a folder, tactstrip reads every sub-*/ses-*/trials.csv, or with
    --columns every .csv and .tsv file. It verifies each session against its journal, and stops with
    exit code 2 if a session was modified. A table without a journal is analyzed and marked.
    """
    from analysis.reading.foreign.columns import load_column_map
    from analysis.results.console import print_analysis

    if pdf and no_figures:
        raise click.UsageError("--pdf writes figures: leave --no-figures out")
    # Results are written into a folder of sessions, but not into data of another program.
    is_session_folder = columns is None and len(paths) == 1 and paths[0].is_dir()
    is_session_folder = is_session_folder and not (paths[0] / _BIDS).exists()
    target = out or (paths[0] if is_session_folder else Path()) / "analysis"
    if out is None:
        _require_analysis_folder(target)
    analysis = write_analysis(
        paths,
        target,
        columns=load_column_map(columns) if columns else None,
        ci=ci,
        allow_simulated=allow_simulated,
        accept_altered=accept_altered,
        seed=seed,
        population=population,
        figures=not no_figures,
        pdf=pdf,
        bar=True,
    )
    print_analysis(analysis, sys.stdout)
    echo(f"Written to {target}{'' if pdf or no_figures else '; --pdf: figures as PDF, too'}")
    if strict and analysis.warnings:
        click.get_current_context().exit(ANSWER_IS_NO)


def _require_analysis_folder(target: Path) -> None:
    """Reject a default folder that holds files but no earlier analysis."""
    from experiment.archive import manifest

    if target.is_dir() and not (target / manifest.NAME).exists() and any(target.iterdir()):
        first = min(path.name for path in target.iterdir())
        raise CommandError(
            f"{target}: has files that no analysis wrote, such as {first}; --out DIR names another "
            "folder"
        )
