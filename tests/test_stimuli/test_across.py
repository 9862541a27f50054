"""Products in the place of exponentials across a strip change no digit that counts."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stimuli.solver.across import Span, crossing, shape, shape_integral
from stimuli.solver.guided import guided
from stimuli.solver.source import Source

if TYPE_CHECKING:
    from stimuli.arrays import Complex

G: Complex = np.multiply.outer([1e-3, 0.4, 5.0, 300.0], [1 + 0j, 1 + 1j, 1 - 3j])[..., np.newaxis]
"""Decays of branches that are flat across the strip, and of others that die within a load."""


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("span", "places"),
    [
        (Span(centre=0.0, length=0.6), (0.0, -0.2)),
        (Span(centre=-0.1, length=0.5), (-0.3, 0.1)),
        (Span(centre=-0.1, length=0.3), (-0.1, -0.4)),
        (Span(centre=-0.3, length=0.2), (-0.3, 0.3)),
        (Span(centre=0.0), (0.0, -0.3)),
        (Span(centre=-0.2), (-0.2, -0.4)),
    ],
)
def test_places_at_a_load_together_are_as_each_beside_another(
    span: Span, places: tuple[float, float], sign: int
) -> None:
    here = np.array(places)
    found = crossing(G, here, span, sign)
    # a place beyond the load's other side: then ways to the edges have exponentials of their own
    beside = crossing(G, np.append(here, 0.49), span, sign)
    np.testing.assert_allclose(found.kernel, beside.kernel[..., :2], rtol=1e-12)
    for one, other in ((found.load, beside.load), (found.end, beside.end), (found.lag, beside.lag)):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    wave = np.abs(G) >= 0.4
    as_shape = np.where(wave & (sign < 0), G, 1.0)
    np.testing.assert_allclose(found.shape, as_shape * shape(G, here, sign), rtol=1e-12)
    expected = as_shape * shape_integral(G, span, sign)
    np.testing.assert_allclose(found.load, expected, rtol=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("moment", [True, False])
@pytest.mark.parametrize("span", [Span(centre=-0.1), Span(centre=-0.05, length=0.4)])
def test_a_sine_moves_as_the_two_branches_that_it_is_made_of(
    *, sign: int, moment: bool, span: Span
) -> None:
    k, source, across = (
        np.array([2.0 + 0j, 7.5 - 0.1j]),
        Source(span=span, moment=moment),
        [-0.3, 0],
    )
    waves = guided(k, np.full(2, np.inf + 0j), 9, sign)
    row = k[:, np.newaxis]
    parts = waves.strengths(row, source) * waves.shapes(np.array(across))
    found = waves.moved(row, source, np.array(across))
    size = np.max(np.abs(parts), axis=1, keepdims=True)
    assert np.all(np.abs(found - parts) <= 1e-12 * np.maximum(size, 1e-300))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("span", [Span(centre=0.0, length=0.6), Span(centre=-0.15, length=0.3)])
def test_a_load_of_a_length_is_the_sum_of_its_points(span: Span, sign: int) -> None:
    places = np.array([-0.4, -0.2, -0.1, 0.35])
    g = G[:3]  # of the faintest 60 nodes would not be enough
    found = crossing(g, places, span, sign).kernel
    nodes, weights = np.polynomial.legendre.leggauss(60)
    for number, place in enumerate(places):
        cuts = np.unique(np.clip([span.low, place, -place, span.high], span.low, span.high))
        total = np.zeros_like(g[..., 0])
        for low, high in itertools.pairwise(cuts):
            for node, weight in zip(nodes, weights, strict=True):
                point = Span(centre=float((low + high) / 2 + (high - low) / 2 * node))
                part = crossing(g, np.array([place]), point, sign).kernel[..., 0]
                total += weight * (high - low) / 2 * part
        np.testing.assert_allclose(found[..., number], total, rtol=1e-8, atol=1e-16)
