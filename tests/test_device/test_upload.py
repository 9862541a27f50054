"""A waveform in pieces; what a bad line does to them is tested with the link."""

import numpy as np

from tests.test_device.wire import upload_of


def test_the_pieces_of_a_waveform_are_all_of_it_in_order() -> None:
    codes = np.outer((1, -1), np.arange(-50, 50)).astype(np.int32)
    octets, data = upload_of(codes, 7)
    assert octets == codes.astype("<i2").tobytes()
    pieces = list(data)
    assert b"".join(piece.octets for piece in pieces) == octets
    assert [piece.offset for piece in pieces] == list(range(0, len(octets), 32))
    assert {piece.upload for piece in pieces} == {7}
