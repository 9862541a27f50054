"""Run the firmware under QEMU, behind a TCP port of this machine.

The first line of output is the port's URL, as that of `tactstrip emulate`. The truth file gets what
hal/qemu/main.c writes about each burst.
"""

from __future__ import annotations

import argparse
import os
import secrets
import socket
from pathlib import Path

IMAGE = Path(__file__).parents[2] / "build" / "tactstrip-qemu.elf"
BOOT_ID, SAMPLE_RATE = 0x20000000, 0x20000008
"""Where hal/qemu/main.c reads them."""


def main() -> None:
    """Become QEMU."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tcp", type=int, metavar="PORT", default=0, help="0 is any free one")
    parser.add_argument("--truth", metavar="FILE", default=os.devnull)
    parser.add_argument(
        "--inputs",
        metavar="FIFO",
        help="a byte written there: 2 safety switch closed, 4 over-current, 128 line lost",
    )
    parser.add_argument("--rate", type=int, metavar="HZ", default=48_000)
    parser.add_argument("--image", metavar="FILE", default=str(IMAGE))
    options = parser.parse_args()
    server = socket.create_server(("127.0.0.1", options.tcp))
    server.set_inheritable(True)
    print(f"socket://127.0.0.1:{server.getsockname()[1]}", flush=True)
    words = {
        BOOT_ID: secrets.randbits(32),
        BOOT_ID + 4: secrets.randbits(31),
        SAMPLE_RATE: 1000 * options.rate,
    }
    line = f"socket,id=line,fd={server.fileno()},server=on,wait=off,nodelay=on"
    command = ["qemu-system-arm", "-machine", "mps2-an385", "-display", "none", "-monitor", "none"]
    command += ["-kernel", options.image]
    command += ["-chardev", line, "-serial", "chardev:line"]
    command += ["-serial", f"file:{options.truth}"]
    if options.inputs:
        command += [
            "-chardev",
            f"pipe,id=inputs,path={options.inputs}",
            "-serial",
            "chardev:inputs",
        ]
    for address, word in words.items():
        command += ["-device", f"loader,addr={address:#x},data={word},data-len=4"]
    os.execvp(command[0], command)  # noqa: S606 - this process is to become QEMU


if __name__ == "__main__":
    main()
