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

IMAGE = Path(__file__).parents[2] / "build" / "tactstrip-qemu.elf"
BOOT_ID, SAMPLE_RATE, ADC, SENSES = 0x20000000, 0x20000008, 0x20000010, 0x2000001C
"""Where the image looks for them: main.c."""
ADC_FORM = re.compile(r"gain=(\d+(?:\.\d+)?)(?:,delay_us=(\d+))?(?:,noise=(\d+))?")


def main() -> None:
    """Become QEMU."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tcp", metavar="PORT", type=int, default=0)
    parser.add_argument("--truth", metavar="FILE", default=os.devnull)
    parser.add_argument("--rate", metavar="HZ", type=int, default=48_000)
    parser.add_argument("--adc", metavar="gain=G[,delay_us=US[,noise=MV]]", default="gain=0")
    parser.add_argument("--switch-stdin", action="store_true")
    parser.add_argument("--unsensed", action="store_true")
    parser.add_argument("--image", metavar="FILE", default=str(IMAGE))
    parser.add_argument("qemu", nargs="*", metavar="-- OPTION")
    given = parser.parse_args()
    adc = ADC_FORM.fullmatch(given.adc)
    if adc is None:
        parser.error(f"--adc must be gain=G[,delay_us=US[,noise=MV]], got {given.adc!r}")
    server = socket.create_server(("127.0.0.1", given.tcp))
    os.set_inheritable(server.fileno(), True)  # noqa: FBT003 - it takes no keyword
    print(f"socket://127.0.0.1:{server.getsockname()[1]}", flush=True)
    line = f"socket,id=line,fd={server.fileno()},server=on,wait=off,nodelay=on"
    words = {
        BOOT_ID: secrets.randbits(32),
        BOOT_ID + 4: secrets.randbits(32),
        SAMPLE_RATE: 1000 * given.rate,
        ADC: round(1e6 * float(adc[1])),
        ADC + 4: int(adc[2] or 0),
        ADC + 8: int(adc[3] or 0),
        SENSES: int(given.switch_stdin and not given.unsensed),
    }
    command = ["qemu-system-arm", "-machine", "mps2-an385", "-display", "none", "-monitor", "none"]
    command += ["-kernel", given.image]
    for address, word in words.items():
        command += ["-device", f"loader,addr={address:#x},data={word},data-len=4"]
    command += ["-chardev", line, "-serial", "chardev:line"]
    command += ["-chardev", f"file,id=truth,path={given.truth},append=on", "-serial"]
    command += ["chardev:truth"]
    if given.switch_stdin:
        command += ["-chardev", "stdio,id=words", "-serial", "chardev:words"]
    os.execvp(command[0], [*command, *given.qemu])  # noqa: S606 - as meant


if __name__ == "__main__":
    main()
