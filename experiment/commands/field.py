"""The command `field`: a displacement map, an animation, or the response at the fingers."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from device.printing import echo
from experiment.commands.options.common import PATH, json_option
from experiment.commands.options.hardware import working
from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from experiment.check.field import PlateBand, PlateMap, PlateMotion
    from experiment.commands.options.hardware import Step
    from experiment.study.study import Study


_ENDINGS: Final = (".png", ".svg", ".csv")
_ANIMATION_ENDINGS: Final = (".gif", ".mp4")


@click.command(epilog="Example: tactstrip field study.toml --band 100 5000 --out band.svg")
@click.argument("study_file", metavar="STUDY", type=PATH)
@click.option(
    "--frequency-hz",
    type=float,
    metavar="F",
    show_default="that of the first burst",
    help="Frequency of the map, in Hz.",
)
@click.option(
    "--band",
    "band_hz",
    type=float,
    nargs=2,
    metavar="LO HI",
    help="Draw the response at the fingers from LO to HI, in Hz, instead of a map.",
)
@click.option(
    "--animate",
    is_flag=True,
    help="Animate the plate in slow motion during the burst of the first condition, as .gif, or as "
    ".mp4 if ffmpeg is installed.",
)
@click.option(
    "--out",
    type=PATH,
    metavar="FILE",
    show_default="field.png, or burst.gif with --animate",
    help="File to write. Its extension selects the format: .png, .svg or .csv.",
)
@json_option
@refusals
def field(
    *,
    study_file: Path,
    frequency_hz: float | None,
    band_hz: tuple[float, float] | None,
    animate: bool,
    out: Path | None,
    as_json: bool,
) -> None:
    """Draw the displacement field of a study's plate.

    The result is a map at one frequency, the response over a band of frequencies, or an animation.
    Each actuator is driven alone. An existing picture or table of that name is replaced.
    """
    from experiment.check.field import report_field
    from experiment.check.report import report_json, report_text
    from experiment.record.files import write_atomically
    from experiment.study.files import naming, read_study

    if frequency_hz is not None and band_hz is not None:
        raise CommandError("--frequency-hz gives a map and --band none; give one of them")
    if animate and (frequency_hz is not None or band_hz is not None):
        raise CommandError("--animate shows the burst; give no --frequency-hz or --band with it")
    study = read_study(study_file)
    out = out or Path("burst.gif" if animate else "field.png")
    _check_target(out, _ANIMATION_ENDINGS if animate else _ENDINGS)
    with working("Computing the field") as step, naming(study_file):
        result = _computed(study, frequency_hz, band_hz, animate=animate)
        content = _content(result, out.suffix.lower().removeprefix("."), step)
        report = report_field(result, str(study_file)) | {"out": str(out)}
    write_atomically(out, content)
    text = report_json(report) if as_json else report_text("field", report)
    echo(*text.splitlines())


_HEAD_BYTES: Final = 4096
_MARKS: Final = {".csv": b"frequency_hz,", ".gif": b"GIF8", ".mp4": b"ftyp"}
"""First bytes of the files that this command writes; a picture names the program."""


def _check_target(out: Path, endings: tuple[str, ...]) -> None:
    """Refuse a file of an unknown type, or one that something else wrote."""
    from experiment.check.report import CREATOR

    ending = out.suffix.lower()
    if ending not in endings:
        raise CommandError(f"--out must end in {', '.join(endings)}; got {out}")
    if ending == ".mp4" and shutil.which("ffmpeg") is None:
        raise CommandError(f"--out must end in .gif: an MP4 needs ffmpeg, not found; got {out}")
    head = b""
    if out.is_file():
        with out.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    is_ours = _MARKS.get(ending, CREATOR.encode()) in head
    if out.is_symlink() or (out.exists() and not is_ours):
        raise CommandError(
            f"{out} is not a file that tactstrip field writes; name another file with --out"
        )


def _computed(
    study: Study,
    frequency_hz: float | None,
    band_hz: tuple[float, float] | None,
    *,
    animate: bool,
) -> PlateMap | PlateBand | PlateMotion:
    from experiment.check.field import plate_band, plate_map, plate_motion
    from experiment.check.plate import PlatePreview

    plate = PlatePreview(study)
    if animate:
        return plate_motion(plate)
    option = "--frequency-hz" if band_hz is None else "--band"
    try:
        if band_hz is not None:
            return plate_band(plate, band_hz)
        return plate_map(plate, plate.drive_hz if frequency_hz is None else frequency_hz)
    except ValueError as error:
        raise ValueError(f"{option}: {error}") from error


def _content(result: PlateMap | PlateBand | PlateMotion, ending: str, step: Step) -> bytes:
    """Return the contents of the file, by its extension."""
    from experiment.check.field import PlateMotion, field_csv
    from experiment.check.figure import animate, render

    if not isinstance(result, PlateMotion):
        return field_csv(result).encode() if ending == "csv" else render(result, ending)
    try:
        return animate(result, ending, step)
    except (BrokenPipeError, subprocess.CalledProcessError) as error:
        # The installed ffmpeg may lack the codec.
        raise CommandError("ffmpeg cannot write an MP4 here; let --out end in .gif") from error
