"""The command `emulate`."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click

from device.commands.options import emulator_options, require_together, usage
from device.printing import echo

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from device.emulate.emulator import Emulator, Nature
    from device.emulate.faults import Faults
    from device.emulate.generator import GeneratorEmulator
    from device.emulate.lines import Line


@click.command(
    epilog="""\b
    Faults (--fault):
      drop, corrupt             probability for each byte
      duplicate, delay          probability for each frame
      stall, reset, disconnect  probability each time that data arrive
      delay_s, stall_s          longest duration, in s
      disconnect_at             number of bytes until the line is lost

    \b
    Measurement input (--adc):
      tap       line, amplifier (the default), current or motion
      gain      output per mV at the actuator, in mV (current: uA; motion: nm)
      noise     RMS noise, in the same unit
      delay_us  delay, in us
      loss      probability that a burst is not measured

    Example: tactstrip emulate --pty --truth truth.jsonl"""
)
@emulator_options
@click.pass_context
def emulate(
    ctx: click.Context,
    /,
    *,
    on_pty: bool,
    tcp_port: int | None,
    generator: str | None,
    truth_file: Path | None,
    script: str,
    seed: int,
    amplifier_gain: float,
    switch_stdin: bool,
    **device: Any,
) -> None:
    """Emulate a device on a pseudo-terminal or TCP port, for tests without hardware.

    The first line of output names the port to open. The emulator runs until Ctrl-C or SIGTERM. The
    options from --baud to --adc apply to the emulated tactstrip device, not to a --generator.
    """
    from device.emulate.lines import PtyLine, TcpLine

    if on_pty and tcp_port is not None:
        raise click.UsageError("--pty and --tcp exclude each other.", ctx)
    require_together(ctx)
    path = truth_file or Path(os.devnull)
    with usage(ctx), _until_signal(), path.open("a", encoding="utf-8") as truth:
        faults = _faults(script, seed)
        make_emulator = (
            _generator(truth, faults, amplifier_gain)
            if generator is not None
            else _device(truth, faults, **device)
        )
        line = PtyLine() if tcp_port is None else TcpLine(tcp_port)
        emulator = make_emulator(line)
        _print_port(line.name, "serial" if generator is None else "generator")
        if switch_stdin:
            threading.Thread(target=_read_switch, args=(emulator,), daemon=True).start()
        emulator.run()


def _faults(script: str, seed: int) -> Faults:
    import numpy as np

    from device.emulate.faults import Faults, FaultScript

    return Faults(FaultScript.parse(script), np.random.default_rng(seed))


def _generator(
    truth: IO[str], faults: Faults, amplifier_gain: float
) -> Callable[[Line], GeneratorEmulator]:
    """Return what makes an emulated generator on a line."""
    from device.checks import require_positive
    from device.emulate.generator import GeneratorEmulator

    require_positive("amplifier_gain", amplifier_gain)
    return lambda line: GeneratorEmulator(line, truth, amplifier_gain=amplifier_gain, faults=faults)


def _device(truth: IO[str], faults: Faults, **device: Any) -> Callable[[Line], Emulator]:
    """Return what makes an emulated device on a line."""
    from device.clock import MonotonicClock
    from device.emulate.emulator import Emulator, Truth

    nature = _nature(**device)
    return lambda line: Emulator(line, nature, faults, Truth(truth), MonotonicClock())


def _nature(
    *,
    channels: int,
    ceiling_vpp: float,
    sample_rate_hz: float,
    firmware: Path | None,
    switch_open: bool,
    unsensed: bool,
    over_current_at_s: float,
    adc: str | None,
    **settings: Any,
) -> Nature:
    from device.core.output import OutputStage
    from device.emulate.amplifier import Adc, Amplifier
    from device.emulate.emulator import Nature
    from device.emulate.firmware import FirmwareLibrary
    from device.limits import Limits

    amplifier = Amplifier(
        switch_open=switch_open,
        sensed=not unsensed,
        over_current_at_s=over_current_at_s,
        adc=None if adc is None else Adc.parse(adc),
    )
    limits = Limits(ceiling_vpp=ceiling_vpp, min_interval_s=_MIN_INTERVAL_S)
    output = OutputStage(channels=channels, sample_rate_hz=sample_rate_hz, rail_v=ceiling_vpp / 2)
    return Nature(
        limits=limits,
        output=output,
        amplifier=amplifier,
        firmware=None if firmware is None else FirmwareLibrary(firmware),
        **settings,
    )


def _read_switch(emulator: Emulator) -> None:
    """Move the switch by lines on standard input."""
    rest = b""
    while data := os.read(0, 4096):  # a thread that waits in sys.stdin would block the exit
        *lines, rest = (rest + data).split(b"\n")
        for line in (line.removesuffix(b"\r") for line in lines):
            if line in {b"open", b"closed"}:
                emulator.move_switch(is_open=line == b"open")
            else:
                echo(
                    f"the switch is open or closed, got {line.decode(errors='replace')!r}", err=True
                )


_MIN_INTERVAL_S = 0.005
"""The shortest time between two bursts, as in the mock device."""


def _print_port(port: str, driver: str) -> None:
    """Print the port alone on the first line, for programs, and below it how to use it."""
    echo(port)
    options = f"--driver {driver} --port {port}"
    echo(
        f"Use it in another terminal: tactstrip check STUDY --device {options}",
        f"or: tactstrip run STUDY --participant ID --practice-without-device {options}",
        "Ctrl-C ends the emulator.",
        err=True,
    )


@contextlib.contextmanager
def _until_signal() -> Iterator[None]:
    """Treat Ctrl-C and SIGTERM as the normal end of the emulator."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    handlers = [signal.signal(number, signal.default_int_handler) for number in numbers]
    try:
        yield
    except KeyboardInterrupt:
        return
    finally:
        for number, handler in zip(numbers, handlers, strict=True):
            signal.signal(number, handler)
