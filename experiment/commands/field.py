"""The command `field`: a displacement map, an animation, or the response at the fingers."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from experiment.commands.options.hardware import working
from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from experiment.check.field import PlateBand, PlateMap, PlateMotion
    from experiment.commands.options.hardware import Step
    from experiment.study.study import Study


_ENDINGS: Final = (".png", ".svg", ".csv")
_ANIMATION_ENDINGS: Final = (".gif", ".mp4")


@click.command(epilog="Example: tactstrip field study.toml --band 100 5000 --out band.svg")
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
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
    type=click.Path(path_type=Path),
    metavar="FILE",
    show_default="field.png, or burst.gif with --animate",
    help="New file. Its extension selects the format: .png, .svg or .csv.",
)
@refusals
def field(
    *,
    study_file: Path,
    frequency_hz: float | None,
    band_hz: tuple[float, float] | None,
    animate: bool,
    out: Path | None,
) -> None:
    """Draw the displacement field of a study's plate.

    The result is a map at one frequency, the response over a band of frequencies, or an animation.
    Each actuator is driven alone. An existing file is never overwritten.
    """
    from experiment.check.field_report import field_text
    from experiment.study.files import read_study
    from experiment.study.study import told_by_file

    if frequency_hz is not None and band_hz is not None:
        raise CommandError("--frequency-hz gives a map and --band none; give one of them")
    if animate and (frequency_hz is not None or band_hz is not None):
        raise CommandError("--animate shows the burst; give no --frequency-hz or --band with it")
    study = read_study(study_file)
    out = out or Path("burst.gif" if animate else "field.png")
    _check_target(out, _ANIMATION_ENDINGS if animate else _ENDINGS)
    result: PlateMap | PlateBand | PlateMotion
    with working("Computing the field") as step, told_by_file(study_file):
        if animate:
            from experiment.check.field import plate_motion, with_bursts
            from experiment.check.plate import plate_of

            result = with_bursts(plate_motion(plate_of(study)))
            content = _animated(result, out.suffix.lower(), step)
        else:
            result = _computed(study, frequency_hz, band_hz)
            content = _content(result, out.suffix.lower())
    _write_new(out, content)
    click.echo(field_text(result, str(study_file)))
    click.echo(f"\n{out} written")


def _check_target(out: Path, endings: tuple[str, ...]) -> None:
    if out.suffix.lower() not in endings:
        raise CommandError(f"--out must end in {', '.join(endings)}; got {out}")
    if out.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise CommandError(f"--out must end in .gif: an MP4 needs ffmpeg, not found; got {out}")
    if out.exists() or out.is_symlink():
        raise CommandError(
            f"{out} exists and is left as it is; delete it, or name another file with --out"
        )


def _computed(
    study: Study, frequency_hz: float | None, band_hz: tuple[float, float] | None
) -> PlateMap | PlateBand:
    from experiment.check.field import plate_band, plate_map, with_bursts
    from experiment.check.plate import plate_of

    plate = plate_of(study)
    option = "--frequency-hz" if band_hz is None else "--band"
    try:
        if band_hz is not None:
            return with_bursts(plate_band(plate, band_hz))
        map_hz = plate.drive_hz if frequency_hz is None else frequency_hz
        return with_bursts(plate_map(plate, map_hz))
    except ValueError as error:
        raise ValueError(_name_option(str(error), option)) from error


def _name_option(message: str, option: str) -> str:
    """Replace the parameter in an error message by the option of this command."""
    message = message.replace("be a one-dimensional array of frequencies from", "lie from")
    message = re.sub(r"lie from 0 to (\S+ Hz), got \[(.*)\]", r"lie from 0 to \1; got \2", message)
    return re.sub(r"\b(frequency_hz|frequencies_hz|band)(?= must)", option, message)


def _content(result: PlateMap | PlateBand, ending: str) -> bytes:
    if ending == ".csv":
        from experiment.check.field_report import field_csv

        return field_csv(result).encode()
    from experiment.check.field_figure import render

    return render(result, "png" if ending == ".png" else "svg")


def _animated(motion: PlateMotion, ending: str, step: Step) -> bytes:
    from experiment.check.field_figure import animate

    try:
        return animate(motion, "gif" if ending == ".gif" else "mp4", step)
    except (BrokenPipeError, subprocess.CalledProcessError) as error:
        # The installed ffmpeg may lack the codec.
        raise CommandError("ffmpeg cannot write an MP4 here; let --out end in .gif") from error


def _write_new(path: Path, content: bytes) -> None:
    """Create a file; remove it if it cannot be written completely."""
    with path.open("xb") as file:
        try:
            file.write(content)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
