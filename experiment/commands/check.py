"""The command `check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.commands.options.hardware import (
    answer,
    confirmed,
    device_failures,
    hardware_options,
    working,
)
from experiment.terms.exits import ANSWER_IS_NO, DEVICE_FAILED, CommandError, refusals

if TYPE_CHECKING:
    from device.driver import Lack
    from experiment.apparatus.rig import Rig
    from experiment.preview.device import DeviceCheck
    from experiment.study.sections.equipment import DeviceSettings, Masking
    from experiment.study.study import Study


@click.command(epilog="Example: tactstrip check study.toml")
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
@click.option(
    "--device",
    "with_device",
    is_flag=True,
    help="Also the device: who answers, what it takes, a burst at 10 % on each channel.",
)
@click.option(
    "--noise",
    "noise_s",
    type=click.IntRange(1, 3600),
    metavar="SECONDS",
    help="Also play the masking noise for so long, and no burst, to set its level.",
)
@hardware_options
@refusals
def check(
    *,
    study_file: Path,
    as_json: bool,
    with_device: bool,
    noise_s: int | None,
    driver: str | None,
    port: str | None,
    confirm_hardware: bool,
) -> None:
    """Check a study's stimuli against its strip, its levels against the device, and its length.

    The exit code is 0 if every burst keeps below the strip's cut-off or is accepted with a reason,
    1 if one does not, 2 if the study cannot be used. With --device, also 1 if the device does not
    suit the study, or a burst was not seen or not verified by the study's monitor, 3 if it fails.
    Nobody may touch the plate then. With --noise, also 3 if the noise does not play. What this
    machine lacks to run the study is a note; what `run` would refuse of the device, and a card that
    exceeds its ceiling, a warning: neither changes verdict or exit code.
    """
    from experiment.apparatus.rig import assemble, chosen_settings
    from experiment.preview.check import check_study, require_mock_suitable
    from experiment.preview.check_report import check_findings
    from experiment.preview.device import device_findings, machine_findings
    from experiment.study.read import read_study
    from experiment.study.study import told_by_file

    if confirm_hardware and not with_device:
        raise CommandError("--confirm-hardware needs --device")
    with working("Checking"), told_by_file(study_file):
        study = read_study(study_file)
        if noise_s is not None and study.masking.noise == "none":
            raise CommandError('--noise needs masking.noise = "pink" in the study; got "none"')
        settings = chosen_settings(study, driver=driver, port=port)
        checked = check_study(study)
        require_mock_suitable(study, driver)
    lacks = _machine_lacks(study, settings)
    found = check_findings(checked, str(study_file), machine_findings(lacks), device=settings)
    if "device" in dict(lacks):
        found.tell("", "of the study; on this machine the device is missing, see the notes")
    device = None
    if with_device and checked.verdict != "unfit":
        rig = assemble(study, driver=driver, port=port, simulated=True)
        device = _device_check(study, rig, given=confirm_hardware)
        found.part("device_check", device_findings(device))
        found.note(warnings=found.coded)
    # Last: a device that is refused, or not there, is told alone, not under a page of the study.
    click.echo(found.json if as_json else found.text)
    if noise_s is not None:
        _play(study.masking, noise_s)
    if checked.verdict == "unfit":
        click.get_current_context().exit(ANSWER_IS_NO)
    if device is not None:
        end_check(device)


def _play(masking: Masking, noise_s: int) -> None:
    """Play the masking noise alone, as a session would."""
    from device.clock import MonotonicClock
    from experiment.apparatus.noise import NoiseError, noise_player

    clock = MonotonicClock()
    try:
        player = noise_player(masking, clock, simulated=False)
        try:
            player.start()
            click.echo(f"the noise plays for {noise_s} s; Ctrl-C ends it", err=True)
            ends_s, health = clock.now_s() + noise_s, player.health()
            while health.ok and (left_s := ends_s - clock.now_s()) > 0:
                clock.wait(min(left_s, 1.0))
                health = player.health()
        finally:
            player.stop()
    except NoiseError as error:
        raise CommandError(str(error), exit_code=DEVICE_FAILED) from error
    if not health.ok:
        raise CommandError(health.words, exit_code=DEVICE_FAILED)


def _machine_lacks(study: Study, settings: DeviceSettings) -> list[tuple[str, Lack]]:
    """List what this machine lacks for the study's device, its noise and a participant's window."""
    from experiment.participant.window import window_lacks
    from experiment.preview.device import machine_lacks

    windows = [("--responder screen", lack) for lack in window_lacks()]
    return machine_lacks(settings, study.masking) + windows


def _device_check(study: Study, rig: Rig, *, given: bool) -> DeviceCheck:
    """Check a device; a real one with its operator, unless the command line has the answers."""
    from experiment.apparatus.slots import SuitabilityError
    from experiment.preview.device import check_device

    with device_failures():
        confirmation = confirmed(rig, given=given)
        asked = confirmation is not None and not given
        try:
            return check_device(
                study, rig, confirmation=confirmation, ask=answer if asked else None
            )
        except SuitabilityError as error:
            raise CommandError(f"unsuitable: {error}", exit_code=ANSWER_IS_NO) from error


def end_check(device: DeviceCheck) -> None:
    """End the command by what the channels did, and what a monitor measured of them."""
    wrong = [f"{one.side} {one.text}" for one in device.channels if not one.ready]
    measured = [
        f"{one.side}: {one.calibration.wrong}"
        for one in device.channels
        if one.calibration is not None and one.calibration.wrong
    ]
    told = [f"the device is not ready: {', '.join(wrong)}"] * bool(wrong)
    told += [f"the monitor does not verify the bursts: {', '.join(measured)}"] * bool(measured)
    if told:
        failed = any(channel.failed for channel in device.channels)
        raise CommandError("; ".join(told), exit_code=DEVICE_FAILED if failed else ANSWER_IS_NO)
