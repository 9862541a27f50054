"""The narrow strip as a waveguide of bending waves: its cut-offs, wavenumbers and mode shapes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from stimuli.checks import finite, finite_array, instance, whole
from stimuli.plate.edge import (
    CLAMPED,
    ElasticEdge,
    IdealEdge,
    edge_compliance,
    edge_grip,
    edge_phase,
)
from stimuli.plate.line import Margins
from stimuli.plate.material import Material
from stimuli.plate.patch import BondedPatch, checked_patches
from stimuli.plate.waveguide import make_cross_section, plate_wavenumber

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real
    from stimuli.plate.waveguide import CrossSection

Symmetry = Literal["symmetric", "antisymmetric"]

_MARGINS: Final = Margins(12, 12)
_MORE_WAVES: Final = 1.2
"""So many times more waves than required are followed: the last ones are the least known."""
_ROUNDING: Final = 1e-12
_MAX_MODE: Final = 10_000
_MAX_WAVES: Final = 100
"""Of wavenumbers and mode shapes: of an eigenproblem of some hundred functions."""
MAX_CUTOFFS: Final = 400.0
"""Highest frequency, in first cut-offs: 20 half waves over the width."""


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
        wavenumbers and mode shapes are those of the endless strip without patches.
    patches : tuple of BondedPatch
        What stiffens and loads a strip with ends.

    Raises
    ------
    ValueError
        If a size is not from 1e-9 to 1000, material or edge is none, or a patch is not on it.

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
    patches: tuple[BondedPatch, ...] = ()

    def __post_init__(self) -> None:
        instance("material", self.material, Material, "a Material")
        edges = (IdealEdge, ElasticEdge)
        instance("edge", self.edge, edges, "SIMPLY_SUPPORTED, CLAMPED or an ElasticEdge")
        for name in ("width_m", "thickness_m", "length_m"):
            size_m = getattr(self, name)
            if name != "length_m" or size_m is not None:
                object.__setattr__(self, name, finite(name, size_m, least=1e-9, most=1e3))
        checked = checked_patches(self.patches, self.width_m, self.length_m)
        object.__setattr__(self, "patches", checked)

    @property
    def bending_stiffness_n_m(self) -> float:
        """Bending stiffness D without loss in N m, equation (2)."""
        nu = self.material.poisson_ratio
        relief = 12 * (1 - nu) * (1 + nu)
        return self.material.youngs_modulus_pa * self.thickness_m**3 / relief

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
        Source: paper, section II-A; for other edges (16). Holds while the plate is thin.

        Examples
        --------
        On simple supports they grow with the square of the mode:

        >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
        ...               edge=SIMPLY_SUPPORTED)
        >>> round(strip.cutoff_hz(), 3), round(strip.cutoff_hz(3) / strip.cutoff_hz(), 12)
        (1926.031, 9.0)
        """
        mode = whole("mode", mode, least=1, most=_MAX_MODE)
        advance = edge_phase(mode, self._edge_compliance()) / (math.pi / 2)
        return self._supported_cutoff_hz() * (mode + advance) ** 2

    def with_cutoff(self, frequency_hz: float) -> Strip:
        """Return this strip with the elastic edge that has a measured first cut-off.

        One cut-off does not distinguish a spring from a clamped strip of width W sqrt(f_clamped /
        f): the stiffness is right only if width, thickness and material are.

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
            If no spring has this cut-off.

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
        grip = edge_grip(wanted_hz, supported_hz, clamped_hz)
        stiffness_n = self.bending_stiffness_n_m / self.width_m * grip
        return dataclasses.replace(self, edge=ElasticEdge(stiffness_n=stiffness_n))

    def wavenumbers_rad_m(
        self, frequency_hz: float, n_modes: int = 4, symmetry: Symmetry = "symmetric"
    ) -> Complex:
        """Return the wavenumbers of the outgoing waves along the strip.

        All are listed: waves that propagate, waves that decay, and waves that oscillate while they
        decay, which without loss come in pairs +-Re p + i Im p.

        Parameters
        ----------
        frequency_hz : float
            Frequency from 0 to 400 first cut-offs.
        n_modes : int
            How many wavenumbers to return, up to 100.
        symmetry : {"symmetric", "antisymmetric"}
            Symmetry of the modes about the centre line.

        Returns
        -------
        ndarray of complex128, shape (n_modes,)
            Wavenumbers p of exp(+i p x) exp(-i omega t) in rad/m, x > 0: Im p > 0, or Im p = 0
            and p > 0. By increasing imaginary part; of propagating waves the largest first; of a
            pair Re p > 0 first, the last may be half of one.

        Raises
        ------
        ValueError
            If an argument is out of its range.

        Notes
        -----
        Their squares are the eigenvalues of the cross section, equation (33), with an error of
        1e-11 of the largest one of the first ten, and 1e-7 of a hundred. At a cut-off, where p = 0,
        and where two wavenumbers coalesce (`exceptional_point_hz`), half of the digits are left.

        Examples
        --------
        At rest the two lowest waves are a pair between clamps:

        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> strip.wavenumbers_rad_m(0.0, n_modes=2).round(6)
        array([ 90.029144+168.495689j, -90.029144+168.495689j])
        """
        max_hz = MAX_CUTOFFS * self.cutoff_hz()
        frequency_hz = finite("frequency_hz", frequency_hz, least=0.0, most=max_hz)
        n_modes = whole("n_modes", n_modes, least=1, most=_MAX_WAVES)
        if symmetry not in ("symmetric", "antisymmetric"):
            raise ValueError(f"symmetry must be symmetric or antisymmetric, got {symmetry!r}")
        section = self._section(1 if symmetry == "symmetric" else -1, n_modes, frequency_hz)
        waves = section.waves(np.array([2 * math.pi * frequency_hz]))
        wavenumbers = waves.wavenumbers_rad_m[0]
        order = np.lexsort((-wavenumbers.real, wavenumbers.imag))[:n_modes]
        return np.asarray(wavenumbers[order])

    def exceptional_point_hz(self) -> float:
        """Return the frequency where the two lowest symmetric wavenumbers coalesce.

        Below it they are a pair +-Re p + i Im p, and the field has nulls along the strip. Between
        it and the first cut-off both are purely imaginary.

        Returns
        -------
        float
            The exceptional point of the strip without loss, see equation (33), in Hz; 0 on simple
            supports, whose wavenumbers all meet there in twos.

        Examples
        --------
        It lies below the first cut-off:

        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> round(strip.exceptional_point_hz(), 6), round(strip.cutoff_hz(), 6)
        (3618.11525, 4366.096943)
        """
        from scipy.optimize import brentq

        if math.isinf(self._edge_compliance()):
            return 0.0
        lossless = dataclasses.replace(self.material, loss_factor=0.0, viscous_time_s=0.0)
        strip = dataclasses.replace(self, material=lossless)

        def split(frequency_hz: float) -> float:
            """Return the squared difference of the two lowest p^2, smooth and 0 at the point."""
            first, second = strip.wavenumbers_rad_m(frequency_hz, 2) ** 2
            return float(((first - second) ** 2).real)

        cutoff_hz = self.cutoff_hz()
        return float(brentq(split, 0.0, cutoff_hz, xtol=_ROUNDING * cutoff_hz))

    def mode_shape(self, mode: int, y_m: ArrayLike) -> Real:
        """Return the shape of a mode across the strip at its cut-off.

        On simple supports it is sin(n pi y / W), equations (7) and (8).

        Parameters
        ----------
        mode : int
            Number n of the mode, from 1 to 100, as in `cutoff_hz`; odd modes are symmetric.
        y_m : array_like of float
            Places across the strip, from 0 to its width.

        Returns
        -------
        ndarray of float64, shape of `y_m`
            Shape with a mean square of 1/2 over the width, as a sine, 0 on both edges and rising
            from y = 0. Different modes are orthogonal.

        Raises
        ------
        ValueError
            If an argument is out of its range.

        Examples
        --------
        Odd modes are symmetric about the centre line, even ones have a node there:

        >>> from stimuli import ALUMINIUM, CLAMPED, SIMPLY_SUPPORTED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
        ...               edge=SIMPLY_SUPPORTED)
        >>> strip.mode_shape(1, [0.0, 0.005, 0.0125, 0.02]).round(4).tolist()
        [0.0, 0.5878, 1.0, 0.5878]
        >>> bool(abs(strip.mode_shape(2, 0.0125)) < 1e-9)
        True

        Between clamps the shape is that of the clamped beam:

        >>> clamped = dataclasses.replace(strip, edge=CLAMPED)
        >>> clamped.mode_shape(1, [0.0, 0.005, 0.0125, 0.02]).round(4).tolist()
        [0.0, 0.438, 1.123, 0.438]
        """
        mode = whole("mode", mode, least=1, most=_MAX_WAVES)
        y = finite_array("y_m", y_m)
        if np.any((y < 0) | (y > self.width_m)):
            raise ValueError(f"y_m must lie from 0 to the width {self.width_m:g} m, got {y_m!r}")
        section = self._section(1 if mode % 2 else -1, mode, self.cutoff_hz(mode))
        shape = section.mode_shapes(y.ravel())[:, (mode - 1) // 2]
        shape[(y.ravel() == 0) | (y.ravel() == self.width_m)] = 0
        return np.asarray(shape.reshape(y.shape) * math.sqrt(self.width_m / 2))

    def _section(self, parity: int, n_waves: int, frequency_hz: float) -> CrossSection:
        """Return a cross section that follows so many waves, and those of a frequency."""
        n_half_waves = self.width_m / math.pi * plate_wavenumber(self, frequency_hz)
        n_followed = math.hypot(n_half_waves, _MORE_WAVES * (n_waves + 1))
        wavenumber_rad_m = math.pi / self.width_m * n_followed
        return make_cross_section(self, wavenumber_rad_m, parity, _MARGINS)

    def _edge_compliance(self) -> float:
        return edge_compliance(self.edge, self.bending_stiffness_n_m, self.width_m)

    def _supported_cutoff_hz(self) -> float:
        """Return f_1 of the simply supported strip, equation (14)."""
        mass_kg_m2 = self.material.density_kg_m3 * self.thickness_m
        speed_m2_s = math.sqrt(self.bending_stiffness_n_m / mass_kg_m2)
        return math.pi / 2 * speed_m2_s / self.width_m**2
