"""What the columns of an analysis mean is told of each."""

from __future__ import annotations

import re

from analysis.definitions import DEFINITIONS, OF_ONE_PLACE, OF_SIDES, definitions_in

ENDS = re.compile(r"(?<![a-z])(low|high|left|right|both)(?![a-z])")


def test_only_ends_of_an_interval_and_sides_share_a_meaning() -> None:
    for names in (*DEFINITIONS, *OF_ONE_PLACE):
        assert len({ENDS.sub("", name) for name in names.split(", ")}) == 1, names


def test_what_means_nothing_of_one_place_is_defined_of_two() -> None:
    assert {*OF_SIDES} <= {*DEFINITIONS}


def test_a_lab_s_own_unit_takes_the_place_of_volts_everywhere() -> None:
    told = definitions_in("mN")
    assert len(told) == len(DEFINITIONS) + 1
    assert not [text for text in told.values() if re.search(r"volts peak|V peak", text)]
