"""The narrow strip as a waveguide of bending waves: its cut-offs, wavenumbers and mode shapes."""

from __future__ import annotations

import cmath
import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from stimuli.checks import finite, finite_complex, instance, whole
from stimuli.strip.dispersion import exceptional_bending
from stimuli.strip.edge import (
    CLAMPED,
    ElasticEdge,
    IdealEdge,
    edge_compliance,
    edge_grip,
    edge_phase,
)
from stimuli.strip.material import Material
from stimuli.strip.patch import BondedPatch, checked_patches
from stimuli.strip.roots import decays_squared
from stimuli.strip.shapes import folded, is_wave, wave_shape
from stimuli.strip.waves import Section, outgoing_root, supported_cutoff_hz, supported_wavenumbers

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real


Symmetry = Literal["symmetric", "antisymmetric"]

_MOST_MODES: Final = 10_000
_MOST_HELD: Final = 1_000
"""Most wavenumbers of edges that are not simply supported: a second of computing."""

_LEAST_BENDING: Final = 1e-30
"""Below it (k W / 2)^2 changes no digit of a wavenumber."""

_MOST_CUTOFFS: Final = 1e9
"""Frequencies above so many first cut-offs are refused: no plate is thin against such waves."""


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
        What stiffens and loads a finite strip: for its modes only, not over frequency.

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
        mode = whole("mode", mode, least=1, most=_MOST_MODES)
        advance = edge_phase(mode, self._edge_compliance()) / (math.pi / 2)
        return self._supported_cutoff_hz() * (mode + advance) ** 2

    def with_cutoff(self, frequency_hz: float) -> Strip:
        """Return this strip with the elastic edge that has a measured first cut-off.

        One cut-off does not tell a spring from a clamped strip of width W sqrt(f_clamped / f): the
        stiffness found is right only if width, thickness and material are.

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

        All are listed, whatever the edges: waves that propagate, waves that decay, and waves that
        oscillate while they decay, which without loss come in pairs +-Re p + i Im p. Equations
        (9) and (19) for simply supported edges, (31) for the others.

        Parameters
        ----------
        frequency_hz : float
            Frequency from 0 to 1e9 first cut-offs of the simply supported strip.
        n_modes : int
            How many wavenumbers to return, up to 1000; up to 10000 for simply supported edges.
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
        The error is what a few units in the last place of the inputs would make: unbounded at a
        cut-off and where two wavenumbers coalesce (`exceptional_point_hz`).

        Examples
        --------
        At rest the two lowest waves are one on simple supports, a pair between clamps:

        >>> from stimuli import ALUMINIUM, CLAMPED, SIMPLY_SUPPORTED, Strip
        >>> for edge in (SIMPLY_SUPPORTED, CLAMPED):
        ...     strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=edge)
        ...     print(strip.wavenumbers_rad_m(0.0, n_modes=2).round(6))
        [0.+125.663706j 0.+125.663706j]
        [ 90.029144+168.495689j -90.029144+168.495689j]
        """
        section = self._section(frequency_hz, symmetry)
        supported = math.isinf(self._edge_compliance())
        most = _MOST_MODES if supported else _MOST_HELD
        n_modes = whole("n_modes", n_modes, least=1, most=most)
        if not supported:
            return outgoing_root(-decays_squared(section, n_modes)) * (2 / self.width_m)
        first = 1 if section.symmetric else 2
        modes = range(first, first + 2 * n_modes, 2)
        plate = (self.material, self.width_m, self.thickness_m)
        return supported_wavenumbers(*plate, frequency_hz, modes)[:n_modes]

    def exceptional_point_hz(self) -> float:
        """Return the frequency where the two lowest symmetric wavenumbers coalesce.

        Below it they are a pair +-Re p + i Im p, and the field has nulls along the strip. Between
        it and the first cut-off both are purely imaginary.

        Returns
        -------
        float
            The exceptional point of the strip without loss, equation (35), in Hz; 0 on simple
            supports, whose wavenumbers all meet there in twos.

        Examples
        --------
        It lies below the first cut-off:

        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> round(strip.exceptional_point_hz(), 6), round(strip.cutoff_hz(), 6)
        (3618.11525, 4366.096943)
        """
        bending = exceptional_bending(self._edge_compliance())
        return self._supported_cutoff_hz() * bending / (math.pi / 2) ** 2

    def mode_shape(self, mode: int, y_m: ArrayLike) -> Real:
        """Return the shape of a mode across the strip at its cut-off.

        On simple supports it is sin(n pi y / W), equations (7) and (8), the shape of that mode at
        every frequency. With other edges the shape changes with frequency: see `wave_shape`.

        Parameters
        ----------
        mode : int
            Number n of the mode, from 1, as in `cutoff_hz`; odd modes are symmetric.
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
        >>> float(strip.mode_shape(2, 0.0125).round(12))
        0.0

        Between clamps the shape is that of the clamped beam:

        >>> clamped = dataclasses.replace(strip, edge=CLAMPED)
        >>> clamped.mode_shape(1, [0.0, 0.005, 0.0125, 0.02]).round(4).tolist()
        [0.0, 0.438, 1.123, 0.438]
        """
        mode = whole("mode", mode, least=1, most=_MOST_MODES)
        from_edge, parity = folded(y_m, self.width_m, symmetric=mode % 2 == 1)
        compliance = self._edge_compliance()
        if math.isinf(compliance):
            # counted from the nearer edge, so that both edges are exact zeros
            return np.asarray(parity * np.sin(mode * np.pi * (from_edge / 2)), dtype=np.float64)
        bending = (mode * (math.pi / 2) + edge_phase(mode, compliance)) ** 2
        section = Section(bending=bending, compliance=compliance, symmetric=mode % 2 == 1)
        return parity * wave_shape(section, 0.0, from_edge).real

    def wave_shape(
        self,
        wavenumber_rad_m: complex,
        frequency_hz: float,
        y_m: ArrayLike,
        symmetry: Symmetry = "symmetric",
    ) -> Complex:
        """Return the shape across the strip of one wave, equation (36).

        Parameters
        ----------
        wavenumber_rad_m : complex
            One of `wavenumbers_rad_m` for this frequency and symmetry, of either sign, its
            square exact to 1e-6 ``(|p|^2 + |k|^2)``.
        frequency_hz : float
            Frequency, as in `wavenumbers_rad_m`.
        y_m : array_like of float
            Places across the strip, from 0 to its width.
        symmetry : {"symmetric", "antisymmetric"}
            Symmetry of the wave about the centre line.

        Returns
        -------
        ndarray of complex128, shape of `y_m`
            Shape with a mean of ``|U|^2`` of 1/2 over the width, 0 on both edges; its phase makes
            U' + (W / 2) U'' at y = 0 real and positive. Without loss a pair's are conjugate.

        Raises
        ------
        ValueError
            If an argument is out of its range, or the strip has no such wave.

        Examples
        --------
        Coming from below, the shape of the slowest wave becomes that of the cut-off:

        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> for ratio in (0.9, 0.999):
        ...     p = strip.wavenumbers_rad_m(ratio * strip.cutoff_hz())[0]
        ...     shape = strip.wave_shape(p, ratio * strip.cutoff_hz(), 0.0125)
        ...     print((shape / strip.mode_shape(1, 0.0125)).real.round(4))
        1.0055
        1.0
        """
        section = self._section(frequency_hz, symmetry)
        from_edge, parity = folded(y_m, self.width_m, symmetric=section.symmetric)
        half = finite_complex("wavenumber_rad_m", wavenumber_rad_m) * (self.width_m / 2)
        if not is_wave(section, -half * half):
            raise ValueError(
                "wavenumber_rad_m must be one of the strip's wavenumbers for this frequency and "
                f"symmetry, got {wavenumber_rad_m!r}"
            )
        return parity * wave_shape(section, -half * half, from_edge)

    def _section(self, frequency_hz: float, symmetry: Symmetry) -> Section:
        """Return what the dispersion equation needs of the strip at one frequency."""
        first_hz = self._supported_cutoff_hz()
        most = _MOST_CUTOFFS * first_hz
        frequency_hz = finite("frequency_hz", frequency_hz, least=0.0, most=most)
        if symmetry not in ("symmetric", "antisymmetric"):
            raise ValueError(f"symmetry must be symmetric or antisymmetric, got {symmetry!r}")
        factor = self.material.stiffness_factor(frequency_hz)
        compliance: complex = self._edge_compliance()
        keeps_its_stiffness = isinstance(self.edge, ElasticEdge) and self.edge.lossless
        if keeps_its_stiffness and not cmath.isinf(compliance):
            compliance *= factor
        bending = (math.pi / 2) ** 2 * (frequency_hz / first_hz) / cmath.sqrt(factor)
        return Section(
            bending=bending if abs(bending) > _LEAST_BENDING else 0.0,
            compliance=compliance,
            symmetric=symmetry == "symmetric",
        )

    def _supported_cutoff_hz(self) -> float:
        return supported_cutoff_hz(self.material, self.width_m, self.thickness_m)

    def _edge_compliance(self) -> float:
        return edge_compliance(self.edge, self.bending_stiffness_n_m, self.width_m)
