"""The command ``demo``: a session at the terminal that is killed and resumed.

Each step runs the command that a user would type, in a separate process that can be killed.
"""

from __future__ import annotations

import contextlib
import csv
import os
import signal
import subprocess
import sys
import tempfile
import time
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from experiment.commands.options.common import make_new_folder
from experiment.commands.options.hardware import working
from experiment.exits import INTERRUPTED, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Iterator


SESSION: Final = ("run", "study.toml", "--participant", "01", "--practice-without-device")
CUT_IN_TRIAL: Final = 3
_TRIAL_COLUMNS: Final = ("trial", "attempt", "kind", "side", "level_vpp", "response", "status")
_POLL_INTERVAL_S: Final = 0.02
_QUESTION_DELAY_S: Final = 0.15
"""By this time the question is on the screen, and the participant has not answered yet."""


@click.command(epilog="Example: tactstrip demo --out demo")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    show_default="a temporary folder, deleted at the end",
    help="New folder for the files of the demonstration.",
)
@refusals
def demo(*, out: Path | None) -> None:
    """Demonstrate a session in two minutes at this terminal.

    The demonstration checks a burst and presents six trials, which you answer with the arrow keys.
    It kills the session halfway and resumes it, verifies the record, and analyzes simulated
    participants. It opens no device, plays no sound, and moves nothing.
    """
    if os.name != "posix" or not all(s and s.isatty() for s in (sys.stdin, sys.stdout)):
        raise CommandError(
            "demo needs a terminal (on Linux or macOS) to ask at; tactstrip dry-run needs none"
        )
    with _folder(out) as folder:
        study = files("experiment.commands").joinpath("demo.toml").read_text(encoding="utf-8")
        (folder / "study.toml").write_text(study, encoding="utf-8")
        click.echo(f"A study in {folder}: the paper's plate, six trials. No device is opened.")
        _run_steps(folder, kept=out is not None)
    click.echo(
        "\nThat was a session. Yours begins with\n"
        "  tactstrip init study.toml          and tactstrip --help lists the rest.\n"
        + (f"The files are in {out}." if out else "The demo's files are removed.")
    )


@contextlib.contextmanager
def _folder(out: Path | None) -> Iterator[Path]:
    if out is not None:
        make_new_folder(out)
        yield out
        return
    with tempfile.TemporaryDirectory(prefix="tactstrip-demo-") as folder:
        yield Path(folder)


def _run_steps(folder: Path, *, kept: bool) -> None:
    """Run the steps of the demonstration and print the output of each."""
    _print_heading("1. Does the burst stay where the finger is?")
    click.echo(_run_command(folder, "Checking", "check", "study.toml").rstrip())
    click.echo("A burst that would spread along the plate is refused before it is felt.")

    _print_heading("2. A session. It will be cut off in its midst.")
    with _restored_terminal():
        _run_session(folder, *SESSION, cut=True)
    click.echo(
        "\n\nKilled, as by a power cut. Each answer was on the disk before the next burst. Whether "
        "the burst\nthat was under way was felt is unknown. The same command resumes the session:"
    )

    _print_heading("3. The session, resumed.")
    with _restored_terminal():
        _run_session(folder, *SESSION, "--resume", cut=False)
    if not kept:
        click.echo("(these results are removed with the demo; tactstrip demo --out DIR keeps them)")

    _print_heading("4. The record: no trial is lost, and none is repeated in silence.")
    _print_trials(folder / "results" / "sub-01" / "ses-01" / "trials.csv")
    click.echo(_run_command(folder, "Comparing", "verify", "results").rstrip())

    _print_heading("5. An analysis: the results of five simulated participants, 1075 trials.")
    output = _run_command(folder, "Simulating", "dry-run", "--seed", "7", "--out", "simulated")
    answer = output.split("\n\n")[:2]  # files have the rest
    click.echo("\n\n".join(answer))
    click.echo(
        "\nThe participants are simulated, so the true median threshold is known: it is printed\n"
        "above as assumed, and should lie within the interval."
    )


def _print_heading(text: str) -> None:
    click.echo()
    click.secho(text, bold=True)


def _command_line(*arguments: str) -> list[str]:
    # -P keeps the working directory off the path, where another analysis.py may lie.
    return [sys.executable, "-P", "-m", "tactstrip", *arguments]


def _run_command(folder: Path, activity: str, *arguments: str) -> str:
    """Run a command with a progress line and return its output."""
    click.echo(f"$ tactstrip {' '.join(arguments)}")
    with working(activity):
        process = subprocess.run(  # noqa: S603 - our own command
            _command_line(*arguments),
            cwd=folder,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
    if process.returncode:
        message = process.stderr.removeprefix("error: ").strip()
        raise CommandError(message, exit_code=process.returncode)
    return process.stdout


def _run_session(folder: Path, *arguments: str, cut: bool) -> None:
    """Run a session at this terminal; kill it in trial `CUT_IN_TRIAL` to `cut` it off."""
    click.echo(f"$ tactstrip {' '.join(arguments)}")
    journal = folder / "results" / "sub-01" / "ses-01" / "journal.jsonl"
    with subprocess.Popen(_command_line(*arguments), cwd=folder) as session:  # noqa: S603 - our own
        try:
            while cut and session.poll() is None and _count_bursts(journal) < CUT_IN_TRIAL:
                time.sleep(_POLL_INTERVAL_S)
            if cut and session.poll() is None:
                time.sleep(_QUESTION_DELAY_S)
                session.kill()
            exit_code = session.wait()
        finally:
            session.kill()
    if exit_code == STOPPED_EARLY:
        raise CommandError("the demo was stopped", exit_code=INTERRUPTED)
    if exit_code > 0:  # it has said why
        raise CommandError("the demo's session could not be held", exit_code=exit_code)


def _count_bursts(journal: Path) -> int:
    """Count the bursts in a journal that another process is writing."""
    try:
        return journal.read_bytes().count(b'"stimulus_commanded"')
    except FileNotFoundError:
        return 0


@contextlib.contextmanager
def _restored_terminal() -> Iterator[None]:
    """Restore the terminal however a session ends; leave Ctrl-C to the session."""
    import termios

    settings = termios.tcgetattr(sys.stdin)
    previous_handler: Any = signal.signal(signal.SIGINT, lambda *_: None)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous_handler)
        termios.tcsetattr(sys.stdin, termios.TCSAFLUSH, settings)


def _print_trials(path: Path) -> None:
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in (dict(zip(_TRIAL_COLUMNS, _TRIAL_COLUMNS, strict=True)), *rows):
        click.echo("".join(f"{row[name]:<11}" for name in _TRIAL_COLUMNS).rstrip())
