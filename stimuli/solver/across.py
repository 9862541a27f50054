"""Across the strip: even and odd exponentials, the supported strip's kernel, loads in y.

Lengths are in widths, Y = y / W - 1/2 runs from -1/2 to 1/2. All exponents are scaled so that
nothing overflows; g has a real part >= 0. `sign` is +1 for what is symmetric about the centre
line and -1 for what is antisymmetric: cosh(g Y) and sinh(g Y) / g, both even in g, equation (73).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.strip.waves import ratio

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_FLAT: Final = 0.3
"""|g| below which a branch is so flat across the strip that differences of exponentials lose its
antisymmetric part, as g^-2, and products of hyperbolic functions are used."""

_LONG: Final = 0.1
"""Length of a span from which the difference of two exponentials loses no digit that counts, and
takes half the time of `numpy.expm1`."""

_EDGE: Final = np.array(0.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """Where a load acts across the strip, in widths from the centre line: a point or a length.

    Examples
    --------
    >>> Span(centre=0.1, length=0.2).high
    0.2
    """

    centre: float | Real  # one for all points, or one for each: (n_points,)
    length: float = 0.0

    @property
    def low(self) -> float | Real:
        """Lower end, not beyond the edge."""
        if isinstance(self.centre, np.ndarray):
            return np.maximum(self.centre - self.length / 2, -0.5)
        return max(self.centre - self.length / 2, -0.5)

    @property
    def high(self) -> float | Real:
        """Upper end, not beyond the edge."""
        if isinstance(self.centre, np.ndarray):
            return np.minimum(self.centre + self.length / 2, 0.5)
        return min(self.centre + self.length / 2, 0.5)

    def at(self, points: NDArray[np.bool_] | NDArray[np.intp]) -> Span:
        """Return the spans of some of the points."""
        if not isinstance(self.centre, np.ndarray):
            return self
        return Span(centre=self.centre[points], length=self.length)

    def each(self) -> list[tuple[Span, NDArray[np.bool_] | bool]]:
        """Return the different spans, and which of the points have each."""
        if not isinstance(self.centre, np.ndarray):
            return [(self, True)]
        return [
            (Span(centre=float(centre), length=self.length), self.centre == centre)
            for centre in np.unique(self.centre)
        ]


def faded(g: Complex, length: Real | float) -> Complex:
    """Return int exp(-g t) dt from 0 to a length, which it is for g = 0.

    Examples
    --------
    >>> faded(np.array([0j, 1e-9, 2.0]), 1.0).real.round(6).tolist()
    [1.0, 1.0, 0.432332]
    """
    return ratio(-np.expm1(-g * length), g, length)


def shape(g: Complex, across: Real, sign: int) -> Complex:
    """Return exp(-g/2) cosh(g Y) (sign +1) or exp(-g/2) sinh(g Y) / g (sign -1), (73).

    Examples
    --------
    >>> g = np.array([2.0 + 0j])
    >>> bool(np.allclose(shape(g, np.array([0.3]), 1), np.exp(-1) * np.cosh(0.6)))
    True
    >>> shape(np.array([0j, 1e-12]), np.array([0.3]), -1).real.round(9).tolist()
    [0.3, 0.3]
    """
    if sign > 0:
        return np.asarray(0.5 * (np.exp(-g * (0.5 - across)) + np.exp(-g * (0.5 + across))))
    size = np.abs(across)
    return np.asarray(0.5 * np.sign(across) * np.exp(-g * (0.5 - size)) * faded(g, 2 * size))


def slope(g: Complex, across: Real, sign: int) -> Complex:
    """Return the derivative of `shape` by Y."""
    other = shape(g, across, -sign)
    return g * g * other if sign > 0 else other


def lag(g: Complex, sign: int) -> Complex:
    """Return g - g tanh(g/2) (sign +1) or g coth(g/2) - g (sign -1), as in (41).

    Examples
    --------
    >>> lag(np.array([0j, 1e-12]), -1).real.round(9).tolist()
    [2.0, 2.0]
    """
    fall = np.exp(-g)
    return np.asarray(2 * g * fall / (1 + fall) if sign > 0 else 2 * fall / faded(g, 1.0))


def shape_integral(g: Complex, span: Span, sign: int) -> Complex:
    """Return `shape` integrated over a span, or its value at a point.

    Examples
    --------
    >>> g = np.array([1e-9 + 0j])
    >>> bool(np.allclose(shape_integral(g, Span(centre=0.05, length=0.5), 1), 0.5))
    True
    """
    if not span.length:
        return shape(g, np.asarray(span.centre), sign)
    # a sum or difference over the ends is a product: no digit is lost where the branch is flat
    low, high = span.low, span.high
    middle, rest = (low + high) / 2, (1 - (high - low)) / 2
    if sign > 0 and isinstance(middle, float) and middle == 0:
        both = 2 * np.exp(-g * rest)
    elif sign > 0:
        both = np.exp(-g * (rest - middle)) + np.exp(-g * (rest + middle))
    else:
        size = np.abs(middle)
        both = np.sign(middle) * np.exp(-g * (rest - size)) * faded(g, 2 * size)
    return np.asarray(0.5 * both * faded(g, high - low))


@dataclass(frozen=True, slots=True, eq=False)
class Crossing:
    """One branch across a strip: all that a field needs of it."""

    kernel: Complex  # of g^2 - d2/dy2 with zero ends, integrated over a span, equation (38)
    shape: Complex  # `shape` at the places
    load: Complex  # `shape_integral` over the span
    end: Complex  # `shape` at the edge; these three up to a common factor
    lag: Complex  # `lag`

    def split(self) -> tuple[Crossing, Crossing]:
        """Return two branches that were computed together, side by side along the first axis."""
        parts = self.kernel, self.shape, self.load, self.end, self.lag
        one, two = (Crossing(*(part[i] for part in parts)) for i in (0, 1))
        return one, two


def crossing(g: Complex, across: Real, span: Span, sign: int) -> Crossing:
    """Return what `supported_kernel`, `shape` and `shape_integral` give, with shared exponentials.

    `g` are decay constants in 1 / width, broadcast with the places Y. For sign -1 shape, load and
    end are here times g, where g is not small.

    Examples
    --------
    >>> g, here = np.array([1.5 + 0.5j]), np.array([-0.3])
    >>> found = crossing(g, here, Span(centre=0.1), 1)
    >>> bool(np.allclose(found.shape, shape(g, here, 1)))
    True
    """
    flat = np.abs(g) < _FLAT
    some = bool(flat.any())
    given, g = g, np.where(flat, 1.0, g) if some else g
    above = np.exp(-g * (0.5 - span.high))
    off_centre = bool(np.any(span.centre))
    below = np.exp(-g * (0.5 + span.low)) if off_centre else above
    near, far, up, down, fall, whole = _exponentials(g, across, span, (above, below))
    if not off_centre:
        parts = (1 + sign) * (near - far)
    else:
        images = _images(g, -across, span, places=(down, up), ends=(above, below), whole=whole)
        parts = near - images[1] + sign * (images[0] - far)
    end: Complex = np.asarray(0.5 * (1 + sign * fall))
    found = Crossing(
        kernel=parts * (0.125 / (g * end)),
        shape=0.5 * (up + sign * down),
        load=0.5 * (above + sign * below) * whole,
        end=end,
        lag=g * fall / end,
    )
    if some:
        _flattened(found, given, across, span, sign)
    return found


def _exponentials(
    g: Complex, across: Real, span: Span, ends: tuple[Complex, Complex]
) -> tuple[Complex, Complex, Complex, Complex, Complex, Complex | float]:
    """Return what `_images` does, exp of the ways from places to edges and across, and the load.

    Where all places lie within the span, or a load at a point on one side of all, ways to the edges
    lead over its ends: products take the place of exponentials.
    """
    above, below = ends
    low, high = span.low, span.high
    left, right = across <= low, across >= high
    if span.length > _LONG and not (left | right).any():
        start, stop = np.exp(-g * (across - low)), np.exp(-g * (high - across))
        passed = (start * stop)[..., : g.shape[-1]]  # the same for all places
        one, other = (1 - start) / g, (1 - stop) / g
        up, down = above * stop, below * start
        far = up * below * one + down * above * other
        return one + other, far, up, down, above * below * passed, (1 - passed) / g
    if span.length > _LONG and g.shape[-1] == 1 and not isinstance(span.centre, np.ndarray):
        return _apart(g, across, span, ends, (left, right))
    if not span.length and left.all():
        near = np.exp(-g * (low - across))
        up, down = above * near, np.exp(-g * (0.5 + across))
        return near, down * above, up, down, above * below, 1.0
    up, down, fall = np.exp(-g * (0.5 - across)), np.exp(-g * (0.5 + across)), np.exp(-g)
    less = _less_one if span.length > _LONG else np.expm1
    whole: Complex | float = -less(-g * span.length) / g if span.length else 1.0
    near, far = _images(g, across, span, places=(up, down), ends=ends, whole=whole)
    return near, far, up, down, fall, whole


def _apart(
    g: Complex,
    across: Real,
    span: Span,
    ends: tuple[Complex, Complex],
    sides: tuple[NDArray[np.bool_], NDArray[np.bool_]],
) -> tuple[Complex, Complex, Complex, Complex, Complex, Complex]:
    """Return what `_exponentials` does for places within one span and on either side of it."""
    above, below = ends
    passed = np.exp(-g * (span.high - span.low))
    whole = (1 - passed) / g
    parts = np.empty((4, *g.shape[:-1], across.size), dtype=np.complex128)
    left, right = sides
    inside = ~(left | right)
    if inside.any():
        parts[..., inside] = _exponentials(g, across[inside], span, ends)[:4]
    for some, way, rest, edge, order in (
        (left, span.low - across, 0.5 + across, above, (0, 1, 2, 3)),
        (right, across - span.high, 0.5 - across, below, (0, 1, 3, 2)),
    ):
        if some.any():
            near, distant = np.exp(-g * way[some]), np.exp(-g * rest[some])
            found = near * whole, distant * edge * whole, edge * passed * near, distant
            for place, value in zip(order, found, strict=True):
                parts[place][..., some] = value
    near, far, up, down = parts
    return near, far, up, down, above * below * passed, whole


def _flattened(found: Crossing, g: Complex, across: Real, span: Span, sign: int) -> None:
    """Put in the entries of small g, as products without a division by g, equation (74)."""
    flat = np.abs(g) < _FLAT
    few = g[flat]
    found.end[flat], found.lag[flat] = shape(few, _EDGE, sign), lag(few, sign)
    for one, points in span.each():
        some = np.broadcast_to(flat & points, found.load.shape)
        found.load[some] = shape_integral(np.broadcast_to(g, some.shape)[some], one, sign)
        some = np.broadcast_to(flat & points, found.kernel.shape)
        few, here = np.broadcast_to(g, some.shape)[some], np.broadcast_to(across, some.shape)[some]
        found.shape[some] = shape(few, here, sign)
        found.kernel[some] = _flat_kernel(few, here, one, sign)


def _flat_kernel(g: Complex, across: Real, span: Span, sign: int) -> Complex:
    """Return `supported_kernel` for small g, element by element, equation (74)."""

    def odd(y: Real | float) -> Complex:
        return ratio(np.sinh(g * y), g, y)

    def own(y: Real | float) -> Complex:
        return np.cosh(g * y) if sign > 0 else odd(y)

    here = np.abs(across)
    total = np.zeros(here.shape, dtype=np.complex128)
    for low, high, factor in _folded(span, sign):
        if not span.length:
            near, far = np.minimum(here, low), np.maximum(here, low)
            total += factor * own(near) * odd(0.5 - far)
            continue
        split = np.clip(here, low, high)
        rise = own((low + split) / 2) * odd((split - low) / 2)
        fall = odd(0.5 - (split + high) / 2) * odd((high - split) / 2)
        total += 2 * factor * (rise * odd(0.5 - here) + fall * own(here))
    side = np.where(across < 0, sign, 1)
    return side * total / (2 * own(0.5))


def _folded(span: Span, sign: int) -> list[tuple[float, float, int]]:
    """Return a span folded onto the upper half of the strip: from, to, factor."""
    low, high = float(span.low), float(span.high)
    if low >= 0:
        return [(low, high, 1)]
    if high <= 0:
        return [(-high, -low, sign)]
    return [(0.0, high, 1), (0.0, -low, sign)]


def supported_kernel(g: Complex, across: Real, span: Span, sign: int) -> Complex:
    """Return the kernel of g^2 - d2/dy2 with zero ends, integrated over a span, equation (38).

    As for `crossing`; the kernels of the two symmetries add up to the whole.

    Examples
    --------
    The two parts add up to the closed form sinh(g y) sinh(g (1 - y0)) / (g sinh g), y <= y0:

    >>> g, here = np.array([1.5 + 0.5j]), np.array([-0.3])
    >>> both = sum(supported_kernel(g, here, Span(centre=0.1), sign) for sign in (1, -1))
    >>> closed = np.sinh(0.2 * g) * np.sinh(0.4 * g) / (g * np.sinh(g))
    >>> bool(np.allclose(both, closed, rtol=1e-14))
    True
    """
    return crossing(g, across, span, sign).kernel


def _images(
    g: Complex,
    across: Real,
    span: Span,
    *,
    places: tuple[Complex, Complex],
    ends: tuple[Complex, Complex],
    whole: Complex | float,
) -> tuple[Complex, Complex]:
    """Return the integrals of exp(-g |Y - y|) and exp(-g (1 - |Y - y|)) over the span.

    Every exponential decays: 1 - |Y - y| is the way from one of them to the one edge and from the
    other to the other edge, given as `places` for Y and as `ends` for the span.
    """
    (up, down), (above, below) = places, ends
    low, high = span.low, span.high
    right = across >= high
    inside = (across > low) & ~right if span.length else np.zeros_like(right)
    ways = across - low, high - across
    if inside.all():
        return _within(g, ways, span.length, places=places, ends=ends)
    beyond = np.maximum(-np.minimum(*ways), 0.0)
    near: Complex = np.exp(-g * beyond) * whole
    far: Complex = np.where(right, up * below, down * above) * whole
    if inside.any():
        inside = np.broadcast_to(inside, near.shape)
        some = [np.broadcast_to(a, near.shape)[inside] for a in (g, up, down, above, below)]
        one, other = (np.broadcast_to(way, near.shape)[inside] for way in ways)
        near[inside], far[inside] = _within(
            some[0], (one, other), span.length, places=(some[1], some[2]), ends=(some[3], some[4])
        )
    return near, far


def _within(
    g: Complex,
    ways: tuple[Real, Real],
    length: float,
    *,
    places: tuple[Complex, Complex],
    ends: tuple[Complex, Complex],
) -> tuple[Complex, Complex]:
    """Return the same for places within the span, from their ways to its ends."""
    (up, down), (above, below) = places, ends
    less = _less_one if length > _LONG else np.expm1
    left, rest = (less(-g * way) / g for way in ways)
    return -left - rest, -up * below * left - down * above * rest


def _less_one(exponent: Complex) -> Complex:
    return np.exp(exponent) - 1
