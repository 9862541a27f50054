"""Uploads with many pieces under way: what a bad line does to them, and what it cannot do."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from device.wire.upload import Window
from tests.test_device.wire import upload_of

LATE_S = 0.025


@settings(max_examples=100)
@given(
    n_pieces=st.integers(0, 40),
    size=st.integers(1, 9),
    seed=st.integers(0, 2**32 - 1),
    loss=st.sampled_from([0.0, 0.1, 0.5]),
)
def test_every_piece_gets_through_and_no_more_are_under_way_than_may_be(
    n_pieces: int, size: int, seed: int, loss: float
) -> None:
    rng, now_s, arrived = np.random.default_rng(seed), 0.0, set()
    window = Window(((n, bytes([n])) for n in range(n_pieces)), size=size, late_s=LATE_S)
    while (due := window.due(now_s)) or not window.is_over:
        assert len(due) <= size
        now_s += 0.001 if due else LATE_S
        for (number,) in due:
            if rng.random() >= loss:
                arrived.add(number)
                if rng.random() >= loss:
                    window.answered(number, now_s)
        assert now_s < 100.0
    assert arrived == set(range(n_pieces))


def test_the_pieces_of_a_waveform_are_all_of_it_in_order() -> None:
    codes = np.arange(-50, 50, dtype=np.int32)
    octets, data = upload_of(codes, -codes, 7)
    assert octets == np.stack((codes, -codes)).astype("<i2").tobytes()
    pieces = list(data)
    assert b"".join(piece.octets for piece in pieces) == octets
    assert [piece.offset for piece in pieces] == list(range(0, len(octets), 32))
    assert {piece.upload for piece in pieces} == {7}
