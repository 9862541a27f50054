"""Ten thousand bursts with a fault, measured on a line in this process, and on real sound."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import pytest

from tests.long.test_fuzz import rounds
from tests.system.test_sound import WRONG, sound_rig
from tests.test_device.loops import SIDES
from tests.test_device.monitors import check_bursts

if TYPE_CHECKING:
    from tests.system.test_sound import SoundRig

__all__ = ["sound_rig"]  # a fixture


@pytest.mark.parametrize("noise_db", [20.0, 40.0])
@pytest.mark.parametrize("seed", range(100, 110))
def test_every_fault_is_caught_and_no_good_burst_is_blamed(noise_db: float, seed: int) -> None:
    check_bursts(rounds(500), noise_db=noise_db, seed=seed)


@pytest.mark.xdist_group("sound")
@pytest.mark.parametrize("part", range(4))
def test_no_faulty_burst_is_verified_on_real_sound(sound_rig: SoundRig, part: int) -> None:
    good, wrong = Counter[str | None](), Counter[tuple[str, str | None]]()
    names, sides = list(WRONG), ("left", "right", "both")
    for i in range(rounds(2500)):
        name = names[(i + part) % len(names)]
        wrong[name, sound_rig.verified(*WRONG[name])] += 1
        if i % 10 == 0:
            side = sides[i // 10 % 3]
            good[sound_rig.verified(side, SIDES[side][0])] += 1
    print(dict(good), dict(wrong))
    assert good["line"] >= good.total() / 2
    verified = {name: wrong[name, "line"] for name in WRONG if wrong[name, "line"]}
    assert verified == {}
