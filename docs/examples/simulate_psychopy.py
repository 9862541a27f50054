"""Write the simulated tables of docs/howto/external-table.md into the folder `data`.

Six simulated participants answer y or n to a vibration at one finger, in the layout of PsychoPy's
Builder. The other hand is still or moves, which raises the threshold by a factor of 1.4 (2.9 dB).

Usage: python simulate_psychopy.py
"""

import csv
import random
from collections.abc import Iterator
from math import log10
from pathlib import Path
from statistics import NormalDist

LOOP = ["trials.thisRepN", "trials.thisTrialN", "trials.thisN", "trials.thisIndex"]
HEAD = [
    *("instr.started", "key_instr.keys", "practice.thisN", "thisRow.t", "notes", "other_hand"),
    *("intensity", "key_resp.keys", "key_resp.rt", "key_resp.duration", *LOOP),
    *("participant", "session", "date", "expName", "psychopyVersion", "frameRate"),
]
FALSE_ALARMS, LAPSES, TIMEOUTS = 0.05, 0.03, 0.02
LEVELS = (0, 10, 16, 25, 40, 63)
PARTICIPANTS = {"Jörg": 22, "Zoë": 19, "p03": 27, "p04": 24, "p05": 30, "p06": 21}
"""Thresholds with the other hand still, in per cent of full scale."""


def answer(rng: random.Random, threshold: float, intensity: float) -> tuple[str, str]:
    """Return the key and the reaction time of a trial."""
    detected = NormalDist().cdf(log10(intensity / threshold) / 0.12) if intensity else 0.0
    key = "y" if rng.random() < FALSE_ALARMS + (1 - FALSE_ALARMS - LAPSES) * detected else "n"
    return (
        ("None", "") if rng.random() < TIMEOUTS else (key, f"{rng.lognormvariate(-0.5, 0.3):.4f}")
    )


def session(threshold: float, rng: random.Random) -> Iterator[dict[str, object]]:
    """Yield the rows of a session: instructions, four trials of practice, 144 trials, the end."""
    stimuli = [(hand, level) for hand in ("still", "moving") for level in LEVELS] * 12
    rng.shuffle(stimuli)
    yield {"instr.started": 4.2, "key_instr.keys": "space"}
    for number, (hand, level) in enumerate([("still", 63)] * 4 + stimuli, start=-4):
        row: dict[str, object] = {"thisRow.t": 20 + 3 * number}
        row |= {"other_hand": hand, "intensity": level}
        row |= {"practice.thisN": number + 4} if number < 0 else dict.fromkeys(LOOP, number)
        factor = 1.4 if hand == "moving" else 1.0
        keys = answer(rng, threshold * factor, level)
        yield row | dict(zip(("key_resp.keys", "key_resp.rt"), keys, strict=True))
    yield {"thisRow.t": 460}


def main() -> None:
    """Write a table for each participant."""
    Path("data").mkdir()
    for day, (name, threshold) in enumerate(PARTICIPANTS.items(), start=1):
        info = {"participant": name, "session": "001", "date": f"2026-03-0{day}_10h15.22"}
        info |= {"expName": "hands", "psychopyVersion": "2024.2.4", "frameRate": "59.94"}
        path = Path("data", f"{name}_hands_2026-03-0{day}.csv")
        with path.open("w", newline="", encoding="utf-8-sig") as file:
            table = csv.DictWriter(file, HEAD)
            table.writeheader()
            table.writerows(row | info for row in session(threshold, random.Random(day)))


if __name__ == "__main__":
    main()
