"""How strongly an actuator loads the plate per volt: measured, or predicted from its layers."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from stimuli.checks import finite, instance
from stimuli.errors import PlateError, Rule
from stimuli.load import DISCS, LOADS
from stimuli.plate.patch import Layer, laminate, layer_of
from stimuli.plate.response import first_mode_hz, response
from stimuli.plate.scene import Scene
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli.load import Load
    from stimuli.plate.patch import BondedPatch
    from stimuli.plate.strip import Strip


Basis = Literal["measured", "predicted"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredDisplacement:
    """What was measured at an actuator's centre while a sine drove it.

    Attributes
    ----------
    displacement_m : float
        Amplitude of the plate's displacement at the patch's centre, up to 1 m.
    level_vpp : float
        Peak-to-peak voltage of the sine, twice its amplitude, up to 1e5 V.
    frequency_hz : float
        Its frequency, up to 1e6 Hz and below the strip's first mode.

    Raises
    ------
    ValueError
        If a value is not a number above 0 and up to its limit.

    Examples
    --------
    The paper's actuators (section III-B): 2.6 um at 100 V peak-to-peak and 300 Hz.

    >>> paper = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    >>> round(paper.displacement_per_v_m * 1e9, 3)
    52.0
    """

    displacement_m: float
    level_vpp: float
    frequency_hz: float

    def __post_init__(self) -> None:
        for name, most in (("displacement_m", 1.0), ("level_vpp", 1e5), ("frequency_hz", 1e6)):
            value = finite(name, getattr(self, name), above=0.0, most=most)
            object.__setattr__(self, name, value)

    @property
    def displacement_per_v_m(self) -> float:
        """Amplitude of the displacement per volt of the drive's amplitude, in m/V."""
        return self.displacement_m / (self.level_vpp / 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class PiezoLayers:
    """Layers of a bonded patch: a piezo, and a metal carrier between it and the plate if any.

    Attributes
    ----------
    thickness_m : float
        Thickness of the piezo, from 1 nm to 0.1 m.
    youngs_modulus_pa, poisson_ratio : float
        Of the piezo in its plane at constant field: 1 / s11E and -s12E / s11E.
    d31_m_v : float
        Strain in its plane per field, in m/V, of either sign; not 0, at most 1e-6.
    carrier_thickness_m : float
        Thickness of the carrier; 0 is none.
    carrier_youngs_modulus_pa, carrier_poisson_ratio : float
        Of the carrier; common brass (105 GPa, 0.35) by default.
    density_kg_m3, carrier_density_kg_m3 : float
        What weighs on the plate where `layers` are a patch of it; 0 leaves a mass out.

    Raises
    ------
    ValueError
        If a value is not a number in its range.

    Examples
    --------
    A plate of PIC255 ceramic, 0.25 mm (PI Ceramic's catalogue: d31 = -180 pm/V, s11E =
    16.1e-12 m2/N, Poisson's ratio 0.34):

    >>> patch = PiezoLayers(thickness_m=0.25e-3, youngs_modulus_pa=1 / 16.1e-12,
    ...                     poisson_ratio=0.34, d31_m_v=-180e-12)
    >>> patch.carrier_thickness_m
    0.0
    """

    thickness_m: float
    youngs_modulus_pa: float
    poisson_ratio: float
    d31_m_v: float
    carrier_thickness_m: float = 0.0
    carrier_youngs_modulus_pa: float = 105e9
    carrier_poisson_ratio: float = 0.35
    density_kg_m3: float = 0.0
    carrier_density_kg_m3: float = 0.0

    def __post_init__(self) -> None:
        ranges = {
            "thickness_m": (1e-9, 0.1),
            "youngs_modulus_pa": (1e-3, 1e15),
            "poisson_ratio": (-0.999, 0.5),
            "d31_m_v": (-1e-6, 1e-6),
            "carrier_thickness_m": (0.0, 0.1),
            "carrier_youngs_modulus_pa": (1e-3, 1e15),
            "carrier_poisson_ratio": (-0.999, 0.5),
            "density_kg_m3": (0.0, 1e6),
            "carrier_density_kg_m3": (0.0, 1e6),
        }
        for name, (least, most) in ranges.items():
            value = finite(name, getattr(self, name), least=least, most=most)
            object.__setattr__(self, name, value)
        if self.d31_m_v == 0:
            raise ValueError(f"d31_m_v must not be 0, got {self.d31_m_v!r}")

    @property
    def layers(self) -> tuple[Layer, ...]:
        """The layers from the plate outwards."""
        piezo = Layer(
            thickness_m=self.thickness_m,
            youngs_modulus_pa=self.youngs_modulus_pa,
            poisson_ratio=self.poisson_ratio,
            density_kg_m3=self.density_kg_m3,
        )
        if not self.carrier_thickness_m:
            return (piezo,)
        carrier = Layer(
            thickness_m=self.carrier_thickness_m,
            youngs_modulus_pa=self.carrier_youngs_modulus_pa,
            poisson_ratio=self.carrier_poisson_ratio,
            density_kg_m3=self.carrier_density_kg_m3,
        )
        return carrier, piezo


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadPerVolt:
    """The load of an actuator per volt, and how it is known.

    Attributes
    ----------
    load_per_v : float
        Amplitude of the load (N, Pa or N m/m, in its `unit`) per volt of the drive's
        amplitude; V volts peak-to-peak have the amplitude V / 2. An absolute value.
    basis : {"measured", "predicted"}
        Whether it follows from a measured displacement or from catalogue data of the layers.

    Raises
    ------
    ValueError
        If the load is not a number above 0, or the basis is none of the two.

    Examples
    --------
    >>> LoadPerVolt(load_per_v=1.3e-3, basis="guessed")
    Traceback (most recent call last):
    ValueError: basis must be "measured" or "predicted", got 'guessed'
    """

    load_per_v: float
    basis: Basis

    def __post_init__(self) -> None:
        object.__setattr__(self, "load_per_v", finite("load_per_v", self.load_per_v, above=0.0))
        if self.basis not in get_args(Basis):
            raise ValueError(f'basis must be "measured" or "predicted", got {self.basis!r}')


def load_per_volt(
    strip: Strip, load: Load, basis: MeasuredDisplacement | PiezoLayers
) -> LoadPerVolt:
    """Return the load of an actuator per volt, equations (45) and (46).

    Parameters
    ----------
    strip : Strip
        The strip it is mounted on. Where that has patches, they stiffen and load it here, too.
    load : Load
        What it does to the strip.
    basis : MeasuredDisplacement or PiezoLayers
        What is known of it. Layers give a bonded patch's moment only.

    Returns
    -------
    LoadPerVolt
        Absolute value: the sign of the displacement is lost in an amplitude, and that of a
        moment depends on the poling and on the side of the plate.

    Raises
    ------
    ValueError
        If the load is not on the strip; for layers, if it is no moment; for a measured
        displacement, if its frequency is not below the strip's first mode (`PlateError`;
        without ends its first cut-off). From there on, what the centre does depends on the
        strip's ends and on its loss as much as on the actuator, so that it determines no load.

    Notes
    -----
    The prediction is good to a factor of 1.5 to 2 at best: catalogue data, glue and rim are
    uncertain, and without `Strip.patches` so is the patch's own stiffness in the field. Take a
    measured displacement where there is one.

    Examples
    --------
    The measured displacement comes back:

    >>> from stimuli import ALUMINIUM, CLAMPED, MomentDisc, Strip
    >>> from stimuli.plate.response import displacement
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> known = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    >>> actuator = load_per_volt(strip, disc, known)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> per_load_m = abs(displacement(scene, [300.0])[0, 0, 0])
    >>> round(float(actuator.load_per_v * 50.0 * per_load_m) * 1e6, 5), actuator.basis
    (2.6, 'measured')
    """
    return loads_per_volt(strip, (load,), (basis,))[0]


@single_threaded
@lru_cache(maxsize=16)  # asked for with every stimulus and every assumed loss
def loads_per_volt(
    strip: Strip,
    loads: tuple[Load, ...],
    bases: tuple[MeasuredDisplacement | PiezoLayers, ...],
) -> tuple[LoadPerVolt, ...]:
    """Return the load of each actuator per volt, solved for all together.

    Parameters
    ----------
    strip : Strip
    loads, bases : tuple
        What each actuator does to the strip, and what is known of it.

    Returns
    -------
    tuple of LoadPerVolt

    Raises
    ------
    ValueError
        As `load_per_volt`; the `load` of a `PlateError` is the number of the actuator.

    Examples
    --------
    Equal actuators at mirrored places load the plate alike:

    >>> from stimuli import CLAMPED, ALUMINIUM, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> discs = tuple(MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035))
    >>> known = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    >>> left, right = loads_per_volt(strip, discs, (known, known))
    >>> round(left.load_per_v / right.load_per_v, 9)
    1.0
    """
    for load, basis in zip(loads, bases, strict=True):
        instance("load", load, LOADS, "a load")
        instance("basis", basis, (MeasuredDisplacement, PiezoLayers), "measured or layers")
        if isinstance(basis, PiezoLayers) and not load.is_moment:
            raise ValueError(f"load must be a moment, as layers predict no other, got {load!r}")
    centres_m = tuple((load.x_m, load.y_m) for load in loads)
    scene = Scene(strip=strip, loads=loads, points_m=centres_m)
    displacements_m = _centre_displacements(
        scene, [b.frequency_hz if isinstance(b, MeasuredDisplacement) else None for b in bases]
    )
    return tuple(
        LoadPerVolt(load_per_v=_moment_per_volt(strip, load, basis), basis="predicted")
        if isinstance(basis, PiezoLayers)
        else LoadPerVolt(load_per_v=basis.displacement_per_v_m / own_m, basis="measured")
        for load, basis, own_m in zip(loads, bases, displacements_m, strict=True)
    )


def _centre_displacements(scene: Scene, frequencies_hz: Sequence[float | None]) -> list[float]:
    """Return how far each unit load moves its own centre, 0 without frequencies."""
    strip, displacements_m = scene.strip, [0.0] * len(frequencies_hz)
    # Free ends cannot make a plate slower than the beams across it that it may be cut into.
    beam_hz = strip.cutoff_hz() * math.sqrt(1 - strip.material.poisson_ratio**2)
    for frequency_hz in dict.fromkeys(hz for hz in frequencies_hz if hz is not None):
        asked = [number for number, hz in enumerate(frequencies_hz) if hz == frequency_hz]
        if not strip.patches and frequency_hz >= beam_hz:
            first_hz = first_mode_hz(strip)
            if frequency_hz >= first_hz:
                data = {"frequency_hz": frequency_hz, "first_hz": first_hz}
                raise PlateError(Rule.ABOVE_FIRST_MODE, load=asked[0], **data)
        loads = tuple(scene.loads[number] for number in asked)
        points_m = tuple(scene.points_m[number] for number in asked)
        field = response(replace(scene, loads=loads, points_m=points_m), [frequency_hz])
        for number, own_m in zip(asked, np.diagonal(field.value[0]), strict=True):
            displacements_m[number] = abs(complex(own_m))
    return displacements_m


def _moment_per_volt(strip: Strip, load: Load, layers: PiezoLayers) -> float:
    """Return the moment that bends the plate as the layers bend it, equation (45)."""
    plate = layer_of(strip.material, strip.thickness_m)
    whole = laminate([plate, *layers.layers])
    # thickness times strain is d31 per volt, whatever the thickness
    biaxial_pa = layers.youngs_modulus_pa / (1 - layers.poisson_ratio)
    moment = biaxial_pa * abs(layers.d31_m_v) * whole.reach_m
    if any(_is_at(load, patch) for patch in strip.patches):
        return moment
    return laminate([plate]).biaxial_n_m * moment / whole.biaxial_n_m


def _is_at(load: Load, patch: BondedPatch) -> bool:
    """Return whether a load is that of a patch."""
    return (
        (load.x_m, load.y_m) == (patch.x_m, patch.y_m)
        and load.half_size_m == patch.half_size_m
        and isinstance(load, DISCS) == patch.is_disc
    )
