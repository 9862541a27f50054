"""What the answers tell, in rows of quantity, value, p and remark."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.choice import Choices
    from analysis.sensitivity import Sensitivity, Share, SidePreference
    from analysis.serial_effects import SerialEffect

_SERIAL = {
    "correct": "Correct again after a correct answer",
    "felt": "Felt again after a stimulus was felt",
    "side": "The same side answered again",
}


def choice_rows(choices: Choices) -> Iterator[list[str]]:
    """Yield the rows of a table: quantity, value, p, remark.

    Parameters
    ----------
    choices : Choices
        Of a participant or of all in a condition.
    """
    yield ["Over-report: both to a single stimulus", _share(choices.over_report), "", ""]
    yield ["Mislocalised: the other side", _share(choices.mislocalised), "", ""]
    told = choices.information
    corrected = (
        f"corrected for chance {_number(told.miller_madow_bits)} bits" if told.trials else ""
    )
    yield ["Information of an answer", f"{_number(told.plugin_bits)} bits", _number(told.p),
           told.reason or f"{corrected}, of {_number(told.stimulus_bits)} at most"]  # fmt: skip
    yield from _sensitivity("Detection", choices.detection)
    yield from _sensitivity("Left against right", choices.spatial)
    yield _preference("Side of wrong answers", choices.wrong_side)
    yield _preference("Side answered to blank trials", choices.blank_side)
    yield _preference("Side felt alone of both fingers", choices.extinction)
    for name, words in _SERIAL.items():
        yield _serial(words, getattr(choices.serial, name))


def _sensitivity(name: str, one: Sensitivity) -> Iterator[list[str]]:
    remark = one.reason
    if one.participants > 1:
        remark = f"mean of {one.participants} participants"
    yield [f"{name}: d'", _number(one.d_prime), "", remark]
    yield [f"{name}: criterion", _number(one.criterion), "", remark]


def _preference(name: str, one: SidePreference) -> list[str]:
    return [name, f"left {one.left}, right {one.right}", _number(one.p), one.reason]


def _serial(name: str, one: SerialEffect) -> list[str]:
    otherwise = "" if one.otherwise is None else f"otherwise {_share(one.otherwise)}"
    return [name, _share(one.again), _number(one.p), one.reason or otherwise]


def _share(share: Share) -> str:
    told = f"{share.count} of {share.of}"
    return told if share.p is None else f"{share.p:.3f} ({told})"


def _number(value: float | None) -> str:
    return "n/a" if value is None else f"{value:.3f}"
