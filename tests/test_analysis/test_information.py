"""Mutual information: known values, known bias, and p that only the counts decide."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.answers.information import information

few = settings(deadline=None, max_examples=15)
counts = st.lists(
    st.lists(st.integers(0, 12), min_size=16, max_size=16), min_size=1, max_size=3
).map(lambda rows: np.array(rows, dtype=np.int64).reshape(-1, 4, 4))
MIRROR = [1, 0, 2, 3]


def table(*rows: tuple[int, ...]) -> Any:
    filled = np.zeros((1, 4, 4), dtype=np.int64)
    for row, values in enumerate(rows):
        filled[0, row, : len(values)] = values
    return filled


def test_a_published_table_gives_its_information() -> None:
    # Near-threshold and null trials, felt or not: M. Grund et al., J. Neurosci. 42 (2022) 643-656.
    _, found = information(table((8007, 8035), (497, 7545)))
    assert found.trials == 24084
    assert found.plugin_bits == pytest.approx(0.159008507271803, abs=1e-13)
    assert found.miller_madow_bits == pytest.approx(0.158978555954728, abs=1e-13)
    assert found.stimulus_bits == pytest.approx(0.918876036288604, abs=1e-13)
    assert found.p == 0.001


def test_without_information_or_stimuli_there_is_none() -> None:
    _, found = information(table((6, 2), (3, 1)))
    assert found.plugin_bits == pytest.approx(0, abs=1e-15)
    assert found.p == 1
    assert (found.miller_madow_bits or 0) < 0
    _, found = information(table((5,), (5,)))
    assert (found.plugin_bits, found.miller_madow_bits, found.p) == (0, 0, 1)
    for only in ((), ((3, 1),)):  # no answer; one kind of stimulus
        (one,), together = information(table(*only))
        assert one == together
        assert one.reason
        assert (one.plugin_bits, one.miller_madow_bits, one.p) == (None, None, None)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sizes", "shares", "plug_in", "miller_madow"),
    [
        ((75, 75, 5), (0.48, 0.48, 0.04), 0.0188, 0.0048),
        # (3 - 1) (3 - 1) / (2 * 155 ln 2), which Miller and Madow take off
        ((52, 52, 51), (1 / 3, 1 / 3, 1 / 3), 4 / (310 * math.log(2)), 0.0),
    ],
)
def test_without_information_its_estimates_are_biased_as_known(
    sizes: tuple[int, ...], shares: tuple[float, ...], plug_in: float, miller_madow: float
) -> None:
    rng = np.random.default_rng(1)
    found = []
    for _ in range(400):
        _, one = information(table(*(tuple(rng.multinomial(n, shares)) for n in sizes)))
        found.append((one.plugin_bits or 0.0, one.miller_madow_bits or 0.0))
    assert np.mean(found, axis=0) == pytest.approx([plug_in, miller_madow], abs=0.002)


@pytest.mark.slow
def test_p_is_uniform_where_there_is_no_information() -> None:
    rng = np.random.default_rng(2)
    drawn = rng.multinomial(25, [0.5, 0.3, 0.2], (300, 2))
    ps = [information(table(*map(tuple, rows)))[1].p for rows in drawn]
    for level in (0.05, 0.2, 0.5):
        assert np.mean(np.array(ps) <= level) == pytest.approx(level, abs=0.07)


def test_participants_who_only_differ_from_each_other_carry_no_information() -> None:
    likes_left, likes_right = table((18, 2), (9, 1)), table((1, 9), (2, 18))
    each, together = information(np.concatenate([likes_left, likes_right]))
    assert (together.plugin_bits or 0) > 0.05
    assert (together.p or 0) > 0.2
    assert [one.plugin_bits for one in each] == pytest.approx([0, 0], abs=1e-15)


@few
@given(counts, st.integers(0, 3))
def test_neither_order_nor_sides_change_a_value(tables: Any, seed: int) -> None:
    together: Any
    each, together = information(tables, seed)
    backwards, same = information(tables[::-1], seed)
    assert (backwards[::-1], same) == (each, together)
    mirrored = tables[:, MIRROR][:, :, MIRROR]
    assert information(mirrored, seed) == (each, together)
    if not together.reason:
        assert 0 <= together.plugin_bits <= together.stimulus_bits + 1e-12
        assert 0 < together.p <= 1


@pytest.mark.parametrize(
    ("tables", "seed", "name"),
    [
        (np.zeros((4, 4), np.int64), 0, "tables"),
        (np.zeros((1, 4, 3), np.int64), 0, "tables"),
        (np.zeros((1, 4, 4)), 0, "tables"),
        (np.full((1, 4, 4), -1), 0, "tables"),
        *((table((1, 2), (2, 1)), seed, "seed") for seed in (-1, True, 0.5)),
    ],
)
def test_other_tables_and_seeds_are_refused(tables: Any, seed: Any, name: str) -> None:
    with pytest.raises(ValueError, match=name):
        information(tables, seed)
