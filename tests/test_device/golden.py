"""The golden frames: what is asked of a device from power on, and all that it answers.

`python -m tests.test_device.golden` writes the answers of golden_frames.json again, by the core and
the protocol of this program. The file was read against docs/protocol.md, and an implementation in
another language agrees with it.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from device.core.core import DeviceCore
from device.core.output import OutputStage
from device.core.reports import TAPS, About, Entropy, Health, Measurement
from device.limits import Limits
from device.wire.endpoint import Endpoint
from tests.test_device.bursts import identity
from tests.test_device.wire import answers

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from device.core.output import Emission

FILE: Final = Path(__file__).with_name("golden_frames.json")
GOLDEN: Final[dict[str, Any]] = json.loads(FILE.read_text(encoding="utf-8"))


def limits_of(facts: Mapping[str, Any]) -> Limits:
    """Return the limits of a device as the file describes one."""
    return Limits(
        ceiling_vpp=facts["ceiling_vpp"],
        min_interval_s=facts["least_interval_us"] / 1e6,
        max_duty=facts["max_duty_ppm"] / 1e6,
        longest_waveform=facts["longest_waveform"],
        slots=facts["slots"],
        memory_samples=facts["memory_samples"],
        dc_tolerance=facts["dc_tolerance_ppm"] / 1e6,
        longest_time_to_live_s=facts["longest_time_to_live_us"] / 1e6,
    )


LIMITS: Final = limits_of(GOLDEN["device"])


def measurement_of(reading: Sequence[int], token: int = 1) -> Measurement:
    """Return what an input measures, from the numbers of MEASURED after its token."""
    tap, left, right, offset, uncertainty, *correlations = reading
    return Measurement(
        token=token,
        tap=TAPS[tap],
        peaks=(left, right),
        onset_offset_us=offset,
        onset_uncertainty_us=uncertainty,
        correlations=tuple(correlations),
    )


@dataclass(slots=True)
class Reader:
    """What an input of a device measures of each burst that ends."""

    reading: Measurement | None = None

    def __call__(self, burst: Emission) -> Measurement | None:
        """Return it."""
        if self.reading is None:
            return None
        return Measurement(**asdict(self.reading) | {"token": burst.token})


READING: Final = measurement_of((2, 49_900, 12, 21, 11, 9987, 0))


def device_of(
    facts: Mapping[str, Any],
    reader: Reader,
    sink: Callable[[Emission], None],
    *,
    history: int = 1024,
    **output: Any,
) -> Endpoint:
    """Return a device as the file describes one, freshly switched on."""
    core = DeviceCore(
        boot_id=facts["boot_id"],
        limits=limits_of(facts),
        output=OutputStage(sample_rate_hz=facts["sample_rate_hz"], bits=facts["bits"], **output),
        sink=sink,
        measure=reader,
        about=About(firmware=facts["firmware"], entropy=tuple(Entropy)[facts["entropy"]]),
        history=history,
    )
    names = "model serial_number boot_id sample_rate_hz bits ceiling_vpp longest_waveform emulated"
    return Endpoint(core, identity(**{name: facts[name] for name in names.split()}))


def power_on(reader: Reader, sink: Callable[[Emission], None] = lambda _: None) -> Endpoint:
    """Return the golden device, freshly switched on."""
    return device_of(GOLDEN["device"], reader, sink)


def replay(device: Endpoint, reader: Reader, step: Mapping[str, Any]) -> bytes:
    """Have a step happen; return what the device answers."""
    match step:
        case {"question": question}:
            return device.receive(step["at_us"], bytes.fromhex(question))
        case {"sense": sensed}:
            health = Health.of_bits(reported_bits=sensed["known"], set_bits=sensed["set"])
            device.core.sense(step["at_us"], health)
        case {"reading": reading}:
            reader.reading = measurement_of(tuple(reading.values())) if reading else None
        case _:
            assert step["hang_up"]
            device.hang_up(step["at_us"])
    return b""


def written_again() -> str:
    """Return the file's text with the answers of this program: a line for each step."""
    content, reader = dict(GOLDEN), Reader()
    device = power_on(reader)
    lists = {name: content.pop(name) for name in ("steps", "no_frames")}
    for step in lists["steps"]:
        answer = replay(device, reader, step)
        if "question" in step:
            step["answer"] = answer.hex(" ")
        if answer:
            (head,) = answers(answer)
            step |= {"refusal": head.refusal and head.refusal.name, "state": head.state}
    parts = [f" {json.dumps(name)}: {json.dumps(value)}" for name, value in content.items()]
    for name, entries in lists.items():
        rows = ",\n".join(f"  {json.dumps(entry)}" for entry in entries)
        parts.append(f" {json.dumps(name)}: [\n{rows}\n ]")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    FILE.write_text(written_again(), encoding="utf-8")
