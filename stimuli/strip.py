"""The narrow strip as a waveguide of bending waves: its cut-offs, wavenumbers and mode shapes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from stimuli.checks import finite, finite_array, instance, whole
from stimuli.edge import CLAMPED, SIMPLY_SUPPORTED, ElasticEdge, IdealEdge, edge_phase
from stimuli.material import Material

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Symmetry = Literal["symmetric", "antisymmetric"]

_MOST_MODES: Final = 10_000
_MOST_CUTOFFS: Final = 1e9
"""Frequencies above so many first cut-offs are refused: no plate is thin against such waves."""

_PI_SQUARED: Final = Fraction("9.86960440108935861883449099987615113531369940724079")


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """A thin plate of constant width, held in the same way along both long edges.

    Attributes
    ----------
    width_m : float
        Width W; the edges are y = 0 and y = W.
    thickness_m : float
        Thickness h.
    material : Material
        What it is made of.
    edge : IdealEdge or ElasticEdge
        `SIMPLY_SUPPORTED`, `CLAMPED` or an `ElasticEdge`.
    length_m : float or None
        Length of a finite strip, with x = 0 in its middle; none is an endless one. Cut-offs,
        wavenumbers and mode shapes are those of the endless strip.

    Raises
    ------
    ValueError
        If a size is not a number from 1e-9 to 1000, or material or edge is none.

    Examples
    --------
    Doubling the width quarters every cut-off:

    >>> from stimuli import ALUMINIUM, CLAMPED, Strip
    >>> narrow = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> wide = Strip(width_m=0.050, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> round(narrow.cutoff_hz() / wide.cutoff_hz(), 12)
    4.0
    """

    width_m: float
    thickness_m: float
    material: Material
    edge: IdealEdge | ElasticEdge
    length_m: float | None = None

    def __post_init__(self) -> None:
        instance("material", self.material, Material, "a Material")
        edges = (IdealEdge, ElasticEdge)
        instance("edge", self.edge, edges, "SIMPLY_SUPPORTED, CLAMPED or an ElasticEdge")
        for name in ("width_m", "thickness_m", "length_m"):
            size_m = getattr(self, name)
            if name != "length_m" or size_m is not None:
                object.__setattr__(self, name, finite(name, size_m, least=1e-9, most=1e3))

    @property
    def bending_stiffness_n_m(self) -> float:
        """Bending stiffness D without loss in N m, equation (2)."""
        material = self.material
        relief = 12 * (1 - material.poisson_ratio) * (1 + material.poisson_ratio)
        return material.youngs_modulus_pa * self.thickness_m**3 / relief

    def cutoff_hz(self, mode: int = 1) -> float:
        """Return the frequency at which a mode begins to propagate, equations (11) and (17).

        Parameters
        ----------
        mode : int
            Number of the mode, from 1; odd modes are symmetric about the centre line, even
            ones antisymmetric.

        Returns
        -------
        float
            Cut-off frequency of the endless strip without loss, in Hz.

        Raises
        ------
        ValueError
            If the mode is not a whole number from 1 to 10000.

        Notes
        -----
        Source: paper, section II-A, for simply supported edges; the others follow from the
        edge condition (16). Holds while the plate is thin against the wave.

        Examples
        --------
        The cut-offs of a simply supported strip grow with the square of the mode:

        >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
        ...               edge=SIMPLY_SUPPORTED)
        >>> round(strip.cutoff_hz(), 3), round(strip.cutoff_hz(3) / strip.cutoff_hz(), 12)
        (1926.031, 9.0)
        """
        mode = whole("mode", mode, least=1, most=_MOST_MODES)
        advance = edge_phase(mode, self._edge_compliance()) / (math.pi / 2)
        return self._supported_cutoff_hz() * (mode + advance) ** 2

    def with_cutoff(self, frequency_hz: float) -> Strip:
        """Return this strip with the elastic edge that has a measured first cut-off.

        One cut-off does not tell a spring from a clamped strip that is wider than stated: the
        clamped strip of width W sqrt(f_clamped / f) has the same first cut-off, but other higher
        ones. The stiffness found is right only if width, thickness and material are.

        Parameters
        ----------
        frequency_hz : float
            First cut-off, above that of the simply supported strip and below that of the
            clamped one.

        Returns
        -------
        Strip
            The same strip with an `ElasticEdge` (lossless spring), equation (18).

        Raises
        ------
        ValueError
            If no spring has this cut-off; the message states the range.

        Examples
        --------
        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> measured = strip.with_cutoff(2900.0)
        >>> round(measured.edge.stiffness_n, 6), round(measured.cutoff_hz(), 9)
        (141.72084, 2900.0)
        """
        supported_hz = self._supported_cutoff_hz()
        clamped_hz = dataclasses.replace(self, edge=CLAMPED).cutoff_hz()
        wanted_hz = finite("frequency_hz", frequency_hz, least=0.0)
        if not supported_hz < wanted_hz < clamped_hz:
            raise ValueError(
                "frequency_hz must lie above the cut-off of the simply supported strip, "
                f"{supported_hz:.10g} Hz, and below that of the clamped one, "
                f"{clamped_hz:.10g} Hz, got {frequency_hz!r}"
            )
        stiffness_n = self._edge_stiffness_n(wanted_hz, supported_hz, clamped_hz)
        return dataclasses.replace(self, edge=ElasticEdge(stiffness_n=stiffness_n))

    def wavenumbers_rad_m(
        self, frequency_hz: float, n_modes: int = 4, symmetry: Symmetry = "symmetric"
    ) -> NDArray[np.complex128]:
        """Return the wavenumbers of the outgoing waves along the strip, equations (9) and (19).

        Both branches are listed: the waves of equation (9), which propagate above their cut-off,
        and those of equation (19), which never do. Only simply supported edges are implemented.

        Parameters
        ----------
        frequency_hz : float
            Frequency from 0 to 1e9 first cut-offs.
        n_modes : int
            How many wavenumbers to return.
        symmetry : {"symmetric", "antisymmetric"}
            Symmetry of the modes about the centre line.

        Returns
        -------
        ndarray of complex128, shape (n_modes,)
            Wavenumbers p of exp(+i p x) exp(-i omega t) in rad/m, x > 0: Im p > 0, or Im p = 0
            and p > 0. By increasing imaginary part; propagating waves first, the largest first.

        Raises
        ------
        ValueError
            If an argument is out of its range, or the edges are not simply supported.

        Notes
        -----
        Source: paper, section II-A, for the first branch. Near a cut-off the result is as exact
        as the inputs: the detuning is taken in rational arithmetic.

        Examples
        --------
        Below the first cut-off every wave is evanescent, and at rest both branches meet:

        >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
        ...               edge=SIMPLY_SUPPORTED)
        >>> strip.wavenumbers_rad_m(500.0, n_modes=2).imag.round(6)
        array([108.129134, 141.034834])
        >>> strip.wavenumbers_rad_m(0.0, n_modes=2).imag.round(6)
        array([125.663706, 125.663706])
        """
        most_hz = _MOST_CUTOFFS * self._supported_cutoff_hz()
        frequency_hz = finite("frequency_hz", frequency_hz, least=0.0, most=most_hz)
        n_modes = whole("n_modes", n_modes, least=1, most=_MOST_MODES)
        if symmetry not in ("symmetric", "antisymmetric"):
            raise ValueError(f"symmetry must be symmetric or antisymmetric, got {symmetry!r}")
        self._require_simple_support("wavenumbers")
        first = 1 if symmetry == "symmetric" else 2
        modes = range(first, first + 2 * n_modes, 2)
        ratio = self._squared_frequency_ratio(frequency_hz)
        factor = self.material.stiffness_factor(frequency_hz)
        q = math.pi / self.width_m * np.array(modes)
        p = np.concatenate([q, q]) * _relative_wavenumbers(modes, ratio, factor)
        return p[np.lexsort((-p.real, p.imag))][:n_modes]

    def mode_shape(self, mode: int, y_m: ArrayLike) -> NDArray[np.float64]:
        """Return the shape of a mode across the simply supported strip, equations (7) and (8).

        Parameters
        ----------
        mode : int
            Number n of the mode, from 1.
        y_m : array_like of float
            Places across the strip, from 0 to its width.

        Returns
        -------
        ndarray of float64, shape of `y_m`
            sin(n pi y / W): unit amplitude, exactly 0 on both edges.

        Raises
        ------
        ValueError
            If an argument is out of its range, or the edges are not simply supported.

        Examples
        --------
        Odd modes are symmetric about the centre line, even ones have a node there:

        >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
        ...               edge=SIMPLY_SUPPORTED)
        >>> strip.mode_shape(1, [0.0, 0.005, 0.0125, 0.02]).round(4).tolist()
        [0.0, 0.5878, 1.0, 0.5878]
        >>> float(strip.mode_shape(2, 0.0125).round(12))
        0.0
        """
        mode = whole("mode", mode, least=1, most=_MOST_MODES)
        y = finite_array("y_m", y_m)
        if np.any((y < 0) | (y > self.width_m)):
            raise ValueError(f"y_m must lie from 0 to the width {self.width_m:g} m, got {y_m!r}")
        self._require_simple_support("mode shapes")
        # counted from the nearer edge, so that both edges are exact zeros
        other = self.width_m - y
        mirrored = np.where(y > other, -1.0 if mode % 2 == 0 else 1.0, 1.0)
        return mirrored * np.sin(mode * np.pi * (np.minimum(y, other) / self.width_m))

    def _supported_cutoff_hz(self) -> float:
        """Return f_1 of the simply supported strip, equation (14)."""
        material = self.material
        relief = (1 - material.poisson_ratio) * (1 + material.poisson_ratio)
        speed_m_s = math.sqrt(material.youngs_modulus_pa / (material.density_kg_m3 * relief))
        return math.pi / (4 * math.sqrt(3)) * self.thickness_m / self.width_m**2 * speed_m_s

    def _squared_frequency_ratio(self, frequency_hz: float) -> Fraction:
        """Return (f / f_1)^2 of the simply supported strip, exact but for pi, equation (14)."""
        material = self.material
        nu = Fraction(material.poisson_ratio)
        inertia = Fraction(material.density_kg_m3) * (1 - nu * nu)
        size = Fraction(self.width_m) ** 4 / Fraction(self.thickness_m) ** 2
        stiffness = Fraction(material.youngs_modulus_pa)
        return 48 * Fraction(frequency_hz) ** 2 * size * inertia / (_PI_SQUARED * stiffness)

    def _edge_compliance(self) -> float:
        """Return 2 D / (K W): infinite for simply supported edges, 0 for clamped ones."""
        if isinstance(self.edge, IdealEdge):
            return math.inf if self.edge is SIMPLY_SUPPORTED else 0.0
        hold_n_m = self.edge.stiffness_n * self.width_m
        return 2 * self.bending_stiffness_n_m / hold_n_m if hold_n_m else math.inf

    def _edge_stiffness_n(self, cutoff_hz: float, supported_hz: float, clamped_hz: float) -> float:
        """Return the K of a first cut-off, equation (18), free of cancellation at both limits."""
        clamped = edge_phase(1, 0.0)
        ratio = math.sqrt(cutoff_hz / supported_hz)
        phase = (math.pi / 2) * (cutoff_hz - supported_hz) / supported_hz / (1 + ratio)
        clamped_ratio = math.sqrt(clamped_hz / supported_hz)
        rest = (math.pi / 2) * (clamped_hz - cutoff_hz) / supported_hz / (clamped_ratio + ratio)
        z = math.pi / 2 + phase
        grip = math.sin(rest) / (math.sin(phase) * math.sin(clamped))
        grip += math.sinh(rest) / (math.cosh(z) * math.cosh(math.pi / 2 + clamped))
        return 4 * z * self.bending_stiffness_n_m / (self.width_m * grip)

    def _require_simple_support(self, what: str) -> None:
        if not math.isinf(self._edge_compliance()):
            raise ValueError(
                f"{what} are available for simply supported edges only "
                f"(edge=SIMPLY_SUPPORTED), got {self.edge!r}"
            )


def _relative_wavenumbers(modes: range, ratio: Fraction, factor: complex) -> NDArray[np.complex128]:
    """Return p / q_n of both branches, equations (9) and (19), first branch first.

    p^2 / q^2 = -(1 - r c) and -(1 + r c) with r = k^2 / q^2 without loss and c = 1 / sqrt(factor).
    1 - r c = (1 - r^2) / (1 + r) + r (1 - c): no cancellation at cut-off nor at small loss.
    """
    detuning = np.array([float(1 - ratio / mode**4) for mode in modes])
    r = math.sqrt(ratio) / np.square(np.array(modes, dtype=np.float64))
    c = factor**-0.5
    deficit = complex(0.0, factor.imag) / factor / (1 + c)
    return _outgoing_root(-np.concatenate([detuning / (1 + r) + r * deficit, 1 + r * c]))


def _outgoing_root(square: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the root with Im > 0, or Im = 0 and Re > 0, whatever the sign of a zero."""
    root: NDArray[np.complex128] = np.sqrt(square)
    root[(root.imag < 0) | ((root.imag == 0) & (root.real < 0))] *= -1.0
    return root + 0j
