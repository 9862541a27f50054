"""The commands `init` and `check`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.exits import (
    ANSWER_IS_NO,
    DEVICE_FAILED,
    CommandError,
    device_failures,
    refusals,
)
from experiment.hardware_options import answer, confirmed, hardware_options

if TYPE_CHECKING:
    from experiment.device_check import DeviceCheck
    from experiment.rig import Rig
    from experiment.study import Study
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
@click.option(
    "--device",
    "with_device",
    is_flag=True,
    help="Also the device: who answers, what it takes, a burst at 10 % on each channel.",
)
@hardware_options
@refusals
def check(
    *,
    study_file: Path,
    as_json: bool,
    with_device: bool,
    driver: str | None,
    port: str | None,
    confirm_hardware: bool,
) -> None:
    """Check a study's stimuli against its strip, its levels against the device, and its length.

    The exit code is 0 if every burst keeps below the strip's cut-off or is accepted with a reason,
    1 if one does not, 2 if the study cannot be used. With --device, also 1 if the device does not
    suit the study or a burst was not seen, 3 if it fails. Nobody may touch the plate then.
    """
    from experiment.check_report import check_json, check_text
    from experiment.device_check import device_text
    from experiment.rig import assemble
    from experiment.study import read_study
    from experiment.study_check import check_study, require_mock_suitable

    if not with_device and (driver is not None or port is not None or confirm_hardware):
        raise CommandError("--driver, --port and --confirm-hardware need --device")
    found: StudyCheck = check_study(read_study(study_file))
    require_mock_suitable(found.study, driver)
    if not as_json:
        click.echo(check_text(found, str(study_file)))
    if found.verdict == "unfit" or not with_device:
        if as_json:
            click.echo(check_json(found))
        click.get_current_context().exit(ANSWER_IS_NO if found.verdict == "unfit" else 0)
    rig = assemble(found.study, driver=driver, port=port, simulated=True)
    device = _device_check(found.study, rig, given=confirm_hardware)
    if as_json:
        report = json.loads(check_json(found)) | {"device_check": device.facts}
        click.echo(json.dumps(report, allow_nan=False))
    else:
        click.echo(device_text(device))
    _end(device)


def _device_check(study: Study, rig: Rig, *, given: bool) -> DeviceCheck:
    """Check a device; a real one with its operator, unless the command line has the answers."""
    from experiment.device_check import check_device
    from experiment.stimulus import SuitabilityError

    with device_failures():
        confirmation = confirmed(rig, given=given)
        asked = confirmation is not None and not given
        try:
            return check_device(
                study, rig, confirmation=confirmation, ask=answer if asked else None
            )
        except SuitabilityError as error:
            raise CommandError(f"unsuitable: {error}", exit_code=ANSWER_IS_NO) from error


def _end(device: DeviceCheck) -> None:
    """End the command by what the channels did."""
    wrong = [channel for channel in device.channels if not channel.good]
    if wrong:
        raise CommandError(
            f"the device is not ready: {', '.join(f'{c.side} {c.text}' for c in wrong)}",
            exit_code=DEVICE_FAILED if any(c.failed for c in wrong) else ANSWER_IS_NO,
        )
