"""The command `check`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from device.printing import echo, escaped
from experiment.commands.options.common import PATH, json_option
from experiment.commands.options.hardware import (
    answer,
    confirmed,
    device_failures,
    hardware_options,
    working,
)
from experiment.exits import ANSWER_IS_NO, DEVICE_FAILED, CommandError, refusals

if TYPE_CHECKING:
    from pathlib import Path

    from experiment.check.device import ChannelCheck, DeviceCheck
    from experiment.hardware.setup import Hardware
    from experiment.study.equipment import Masking
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
@click.argument("study_file", metavar="STUDY", type=PATH)
@json_option
@click.option("--details", is_flag=True, help="Print all results and all warnings.")
@click.option(
    "--device",
    "with_device",
    is_flag=True,
    help="Also identify the device, test all levels, and play a burst at 10 % of the highest level "
    "on each channel. Keep all hands off the plate during this test.",
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
    details: bool,
    with_device: bool,
    noise_s: int | None,
    driver: str | None,
    port: str | None,
    confirm_hardware: bool,
) -> None:
    """Check the stimuli, the levels and the duration of a study.

    tactstrip compares every burst with the cut-off frequency of the strip, and every level with the
    limits of the device. Warnings do not change the exit code. With --details, it also
    lists the equipment that this computer lacks.
    """
    from experiment.check.check import check_study, require_mock_suitable
    from experiment.check.device import missing_equipment
    from experiment.check.report import report_json, report_text
    from experiment.check.study_report import report_study
    from experiment.hardware.setup import assemble, chosen_settings
    from experiment.participant.window import window_lacks
    from experiment.study.files import naming, read_study

    if confirm_hardware and not with_device:
        raise CommandError("--confirm-hardware needs --device")
    with working("Checking"), naming(study_file):
        study = read_study(study_file)
        if noise_s is not None and study.masking.noise == "none":
            raise CommandError('--noise needs masking.noise = "pink" in the study; got "none"')
        settings = chosen_settings(study, driver=driver, port=port)
        checked = check_study(study)
        require_mock_suitable(study, driver)
    machine = missing_equipment(settings, study.masking)
    machine += [("--responder screen", lack) for lack in window_lacks()]
    violates = checked.verdict == "violates a limit"
    device = None
    if with_device and not violates:
        rig = assemble(study, driver=driver, port=port, simulated=True)
        device = _device_check(study, rig, given=confirm_hardware)
    # A device failure is printed alone, so nothing is printed before the device was checked.
    report = report_study(
        checked, escaped(study_file), machine, device=settings, device_check=device
    )
    if as_json:
        echo(report_json(report))
    else:
        text = report_text("details" if details else "check", report, details=details)
        verdict, *rest = text.split("\n")
        click.echo(click.style(escaped(verdict), fg="red" if violates else "green", bold=True))
        echo(*rest)
        if device is not None:
            echo(*report_text("device", device).split("\n"))
    if noise_s is not None:
        _play(study.masking, noise_s)
    if violates:
        click.get_current_context().exit(ANSWER_IS_NO)
    if device is not None:
        end_check(device)


def _play(masking: Masking, noise_s: int) -> None:
    """Play the masking noise without bursts, as in a session."""
    from device.clock import MonotonicClock
    from experiment.hardware.noise import NoiseError, noise_player

    clock = MonotonicClock()
    try:
        player = noise_player(masking, clock, is_silent=False)
        try:
            player.start()
            echo(f"the noise plays for {noise_s} s; Ctrl-C ends it", err=True)
            ends_s, health = clock.now_s() + noise_s, player.health()
            while health.ok and (left_s := ends_s - clock.now_s()) > 0:
                clock.wait(min(left_s, 1.0))
                health = player.health()
        finally:
            player.stop()
    except NoiseError as error:
        raise CommandError(str(error), exit_code=DEVICE_FAILED) from error
    if not health.ok:
        raise CommandError(health.message, exit_code=DEVICE_FAILED)


def _device_check(study: Study, rig: Hardware, *, given: bool) -> DeviceCheck:
    """Check a device; the operator answers for a real one unless --confirm-hardware is given."""
    from experiment.check.device import check_device
    from experiment.hardware.suitability import SuitabilityError

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
    failures = [_failure(channel) for channel in device.channels if not channel.good]
    if failures:
        failed = any(channel.failed for channel in device.channels)
        exit_code = DEVICE_FAILED if failed else ANSWER_IS_NO
        raise CommandError("; ".join(failures), exit_code=exit_code)


def _failure(channel: ChannelCheck) -> str:
    """Name what is wrong with the burst of a channel, and the keys that would correct it."""
    monitor = channel.monitor
    if not channel.ready or monitor is None:
        outcome = channel.outcome or "not tried"
        return f"{channel.side} channel: the device is not ready (burst: {outcome})"
    values = {"per_unit": monitor.per_unit, "delay_ms": monitor.delay_ms}
    keys = " and ".join(f"{k} = {value:.4g}" for k, value in values.items() if value is not None)
    correct = f"; {keys} would be exact" if keys else ""
    return (
        f"{channel.side} channel: the monitor does not verify the burst: {monitor.failure}{correct}"
    )
