"""Start the device under QEMU, as `tactstrip emulate --tcp PORT --truth FILE` starts an emulator.

The first line says the port under which it is reached. What follows ``--`` goes to QEMU.
"""

from __future__ import annotations

import argparse
import os
import re
import secrets
import socket
from pathlib import Path
from typing import NoReturn

IMAGE = Path(__file__).parents[2] / "build" / "tactstrip-qemu.elf"
BOOT_ID, SAMPLE_RATE, ADC, SENSES = 0x20000000, 0x20000008, 0x20000010, 0x2000001C
"""Where the image looks for them: main.c."""
NUMBER = r"(\d+\.?\d*)"
ADC_FORM = re.compile(f"gain={NUMBER}(?:,delay_us={NUMBER}(?:,noise={NUMBER})?)?", re.ASCII)
ADC_RANGES = ((1e-6, 100.0), (0.0, 1000.0), (0.0, 100_000.0))


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong, in the words of tactstrip-native."""

    def error(self, message: str) -> NoReturn:
        """Say it, and end."""
        self.exit(2, f"{self.prog}: {message}\n")

    def whole(self, option: str, text: str, least: int, most: int) -> int:
        """Return a whole number, if it is in its range."""
        if not re.fullmatch(r"\d{1,9}", text, re.ASCII) or not least <= int(text) <= most:
            self.error(f'{option}: {least} to {most}, got "{text}"')
        return int(text)

    def adc(self, text: str | None) -> tuple[int, int, int]:
        """Return gain in ppm, delay in us and noise in mV; zeros where nothing is wired."""
        if text is None:
            return 0, 0, 0
        form = ADC_FORM.fullmatch(text)
        numbers = [float(number) for number in form.groups("0")] if form else [-1.0]
        ranges = zip(numbers, ADC_RANGES, strict=False)
        if not all(least <= number <= most for number, (least, most) in ranges):
            rule = "gain=G[,delay_us=US[,noise=MV]], up to 100, 1000, 100000"
            self.error(f'--adc: {rule}, got "{text}"')
        gain, delay_us, noise_mv = numbers
        return round(1e6 * gain), int(delay_us), int(noise_mv)


def main() -> None:
    """Become QEMU."""
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--tcp", metavar="PORT", default="0")
    parser.add_argument("--truth", metavar="FILE", default=os.devnull)
    parser.add_argument("--rate", metavar="HZ", default="48000")
    parser.add_argument("--adc", metavar="gain=G[,delay_us=US[,noise=MV]]")
    parser.add_argument("--switch-stdin", action="store_true")
    parser.add_argument("--unsensed", action="store_true")
    parser.add_argument("--image", metavar="FILE", default=str(IMAGE))
    parser.add_argument("qemu", nargs="*", metavar="-- OPTION")
    given = parser.parse_args()
    gain_ppm, delay_us, noise_mv = parser.adc(given.adc)
    words = {
        BOOT_ID: secrets.randbits(32),
        BOOT_ID + 4: secrets.randbits(32),
        SAMPLE_RATE: 1000 * parser.whole("--rate", given.rate, 1, 50_000),
        ADC: gain_ppm,
        ADC + 4: delay_us,
        ADC + 8: noise_mv,
        SENSES: int(given.switch_stdin and not given.unsensed),
    }
    server = socket.create_server(("127.0.0.1", parser.whole("--tcp", given.tcp, 0, 65_535)))
    os.set_inheritable(server.fileno(), True)  # noqa: FBT003 - it takes no keyword
    print(f"socket://127.0.0.1:{server.getsockname()[1]}", flush=True)
    line = f"socket,id=line,fd={server.fileno()},server=on,wait=off,nodelay=on"
    command = ["qemu-system-arm", "-machine", "mps2-an385", "-display", "none", "-monitor", "none"]
    command += ["-kernel", given.image]
    for address, word in words.items():
        command += ["-device", f"loader,addr={address:#x},data={word},data-len=4"]
    command += ["-chardev", line, "-serial", "chardev:line"]
    command += ["-chardev", f"file,id=truth,path={given.truth},append=on", "-serial"]
    command += ["chardev:truth"]
    if given.switch_stdin:
        command += ["-chardev", "stdio,id=words", "-serial", "chardev:words"]
        command += ["-semihosting-config", "enable=on,target=native"]  # its words on stderr
    os.execvp(command[0], [*command, *given.qemu])  # noqa: S606 - as meant


if __name__ == "__main__":
    main()
