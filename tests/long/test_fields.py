"""Fields of many random plates, where waves meet."""

from __future__ import annotations

from tests.long.test_fuzz import rounds
from tests.test_stimuli.meetings import check_estimates_at_meetings


def test_the_estimate_is_above_the_error_at_and_beside_meetings() -> None:
    check_estimates_at_meetings(seed=33, strips=rounds(40))
