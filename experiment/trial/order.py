"""The order of conditions, balanced over participants: Latin squares that balance carry-over, too.

E. J. Williams, "Experimental designs balanced for the estimation of residual effects of
treatments", Aust. J. Sci. Res. A 2, 149 (1949).
"""

from __future__ import annotations


def order_count(conditions: int) -> int:
    """Return after how many participants every order was used once: n, or 2 n for an odd n > 1.

    >>> [order_count(n) for n in range(1, 6)]
    [1, 2, 6, 4, 10]
    """
    return conditions if conditions == 1 or conditions % 2 == 0 else 2 * conditions


def balanced_order(conditions: int, participant_number: int) -> tuple[int, ...]:
    """Return the order of the conditions 0, 1, ... for a participant, who is counted from 1.

    Over `order_count` participants in a row each condition is at each place equally often, and each
    one is followed by each other one equally often. An odd number of conditions needs every row of
    the square a second time, backwards, for the latter.

    >>> [balanced_order(4, number) for number in range(1, 5)]
    [(0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1)]
    """
    row = (participant_number - 1) % order_count(conditions)
    # 0, 1, n-1, 2, n-2, ...: its steps are all different modulo n, so that in the square that is
    # made by adding 0, 1, ... to it no two rows go from one condition to the same other one.
    first = [(place + 1) // 2 if place % 2 else -(place // 2) for place in range(conditions)]
    order = tuple((label + row) % conditions for label in first)
    return order if row < conditions else order[::-1]
