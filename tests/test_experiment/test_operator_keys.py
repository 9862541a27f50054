"""What an operator's keys, and a participant's keys at a terminal, mean."""

import pytest

from experiment.operator.terminal import LONGEST_NOTE, OperatorKeys


def test_a_note_has_an_end_and_an_empty_one_is_none() -> None:
    notes: list[str] = []
    keys = OperatorKeys(pause=print, go_on=bool, stop=print, note=notes.append)
    keys.type("n" + "x" * (LONGEST_NOTE + 5) + "\n" + "n  \n" + "n\x1b[Dy\x1bOC\n")
    assert notes == ["x" * LONGEST_NOTE, "y"]


@pytest.mark.parametrize("key", ["n", "\n", "\x1b", "\x1b[D", " ", "s", "Y"])
def test_only_a_y_confirms_a_stop(key: str) -> None:
    stops: list[None] = []
    keys = OperatorKeys(pause=print, go_on=bool, stop=lambda: stops.append(None), note=print)
    keys.type("s" + key)
    assert len(stops) == (key == "Y")
