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
from experiment.exits import ANSWER_IS_NO, DEVICE_FAILED, CommandError, refusals

if TYPE_CHECKING:
    from device.driver import Lack
    from experiment.apparatus.rig import Rig
    from experiment.check.device import DeviceCheck
    from experiment.study.equipment import DeviceSettings, Masking
    from experiment.study.study import Study


@click.command(
    epilog="""\b
    Exit codes:
      0  Every burst is within limits, or the study accepts it with a reason.
      1  A burst violates a limit. With --device: the device is unsuitable, or
         a test burst was not confirmed by you or by the monitor.
      2  The study cannot be used.
      3  The device failed (--device), or the noise did not play (--noise).

    Example: tactstrip check study.toml"""
)
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
@click.option(
    "--device",
    "with_device",
    is_flag=True,
    help="Also identify the device, test all levels, and play a burst at 10 % of the highest level "
    "on each channel. Nobody may touch the plate during this test.",
)
@click.option(
    "--noise",
    "noise_s",
    type=click.IntRange(1, 3600),
    metavar="SECONDS",
    help="Also play the masking noise, without bursts, for this time in s, so that you can set its "
    "level.",
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
    """Check the stimuli, the levels and the duration of a study.

    tactstrip compares every burst with the cut-off frequency of the strip, and every level with the
    limits of the device. It also lists the equipment and software that this computer lacks for the
    study. Notes and warnings do not change the exit code.
    """
    from experiment.apparatus.rig import assemble, chosen_settings
    from experiment.check.check import check_study, require_mock_suitable
    from experiment.check.check_report import check_findings
    from experiment.check.device import device_findings, machine_findings
    from experiment.study.files import read_study
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
    findings = check_findings(checked, str(study_file), machine_findings(lacks), device=settings)
    if "device" in dict(lacks):
        findings.tell("", "of the study; on this machine the device is missing, see the notes")
    device = None
    if with_device and checked.verdict != "unfit":
        rig = assemble(study, driver=driver, port=port, simulated=True)
        device = _device_check(study, rig, given=confirm_hardware)
        findings.part("device_check", device_findings(device))
        findings.note(warnings=findings.coded)
    # A device failure is printed alone, so nothing is printed before the device was checked.
    click.echo(findings.json if as_json else findings.text)
    if noise_s is not None:
        _play(study.masking, noise_s)
    if checked.verdict == "unfit":
        click.get_current_context().exit(ANSWER_IS_NO)
    if device is not None:
        end_check(device)


def _play(masking: Masking, noise_s: int) -> None:
    """Play the masking noise without bursts, as in a session."""
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
    """List what this computer lacks for the device, the noise and the participant's window."""
    from experiment.check.device import machine_lacks
    from experiment.participant.window import window_lacks

    windows = [("--responder screen", lack) for lack in window_lacks()]
    return machine_lacks(settings, study.masking) + windows


def _device_check(study: Study, rig: Rig, *, given: bool) -> DeviceCheck:
    """Check a device; the operator answers for a real one unless --confirm-hardware is given."""
    from experiment.apparatus.slots import SuitabilityError
    from experiment.check.device import check_device

    with device_failures():
        confirmation = confirmed(rig, given=given)
        interactive = confirmation is not None and not given
        try:
            return check_device(
                study, rig, confirmation=confirmation, ask=answer if interactive else None
            )
        except SuitabilityError as error:
            raise CommandError(f"unsuitable: {error}", exit_code=ANSWER_IS_NO) from error


def end_check(device: DeviceCheck) -> None:
    """Raise CommandError if a channel is not ready or the monitor does not verify its burst."""
    not_ready = [
        f"{channel.side} {channel.text}" for channel in device.channels if not channel.ready
    ]
    unverified = [
        f"{channel.side}: {channel.calibration.wrong}"
        for channel in device.channels
        if channel.calibration is not None and channel.calibration.wrong
    ]
    problems = []
    if not_ready:
        problems.append(f"the device is not ready: {', '.join(not_ready)}")
    if unverified:
        problems.append(f"the monitor does not verify the bursts: {', '.join(unverified)}")
    if problems:
        failed = any(channel.failed for channel in device.channels)
        exit_code = DEVICE_FAILED if failed else ANSWER_IS_NO
        raise CommandError("; ".join(problems), exit_code=exit_code)
