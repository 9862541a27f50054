"""What an operator's keys mean, without a terminal."""

from experiment.operator.terminal import LONGEST_NOTE, OperatorKeys


def test_a_note_has_an_end_and_an_empty_one_is_none() -> None:
    notes: list[str] = []
    keys = OperatorKeys(pause=print, go_on=bool, stop=print, note=notes.append)
    keys.type("n" + "x" * (LONGEST_NOTE + 5) + "\n" + "n  \n" + "n\x1b[Dy\x1bOC\n")
    assert notes == ["x" * LONGEST_NOTE, "y"]


def test_any_key_but_y_leaves_the_session_running() -> None:
    stops: list[None] = []
    keys = OperatorKeys(pause=print, go_on=bool, stop=lambda: stops.append(None), note=print)
    for key in ("n", "\n", "\x1b", "\x1b[D", " ", "s"):
        keys.type("s" + key)
        keys.type("y")
    assert stops == []
    keys.type("sY")
    assert stops == [None]
