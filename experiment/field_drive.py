"""How strongly the actuators of a study are driven where its field is shown, and on what basis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiment.felt_gains import loads_per_volt
from experiment.plate import loads_of

if TYPE_CHECKING:
    from experiment.study_values import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """How strongly each actuator of a study is driven.

    Attributes
    ----------
    names : tuple of str
        What the actuators are called, in the study's order.
    units : tuple of str
        Unit of each one's load.
    amplitudes : tuple of float
        Amplitude of each one's load in that unit; unit loads where no level is stated.
    bases : tuple of str
        How each amplitude is known; empty for unit loads.
    level_vpp : float or None
        Level of the drive; none for unit loads.

    Examples
    --------
    >>> Drive(names=("left", "right"), units=("N m/m", "N m/m"), amplitudes=(0.09, 0.08),
    ...       bases=("measured", "predicted"), level_vpp=200.0).basis
    'left measured, right predicted, at 200 Vpp'
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    amplitudes: tuple[float, ...]
    bases: tuple[str, ...]
    level_vpp: float | None

    @property
    def basis(self) -> str:
        """What the displacements rest on, in words."""
        if self.level_vpp is None:
            units = [f"1 {unit}" for unit in dict.fromkeys(self.units)]
            return f"per unit load of {' or '.join(units)}"
        each = [f"{name} {basis}" for name, basis in zip(self.names, self.bases, strict=True)]
        words = ", ".join(each) if len(set(self.bases)) > 1 else self.bases[0]
        return f"{words}, at {self.level_vpp:g} Vpp"

    def per_load(self, driven: int) -> str:
        """Return what follows the unit of an actuator's displacement: the unit of its load, if any.

        Parameters
        ----------
        driven : int
            Which actuator.
        """
        return "" if self.level_vpp is not None else f" per {self.units[driven]}"

    @property
    def per_any_load(self) -> str:
        """The same for displacements of all actuators."""
        same = len(set(self.units)) == 1 or self.level_vpp is not None
        return self.per_load(0) if same else " per unit load"


def drive_of(study: Study) -> Drive:
    """Return how strongly a study's actuators are driven where its field is shown.

    Parameters
    ----------
    study : Study
        The study.

    Returns
    -------
    Drive
        The study's highest level, or unit loads if the displacement of an actuator is not known.

    Raises
    ------
    StudyError
        If the displacement of an actuator cannot be had from what is stated of it.

    Examples
    --------
    >>> from experiment.study import paper_study
    >>> drive_of(paper_study()).basis
    'measured, at 200 Vpp'
    """
    units = tuple(load.unit for load in loads_of(study))
    names = tuple(actuator.label for actuator in study.actuators)
    known = [(load, basis) for load, basis in loads_per_volt(study) if load and basis]
    if len(known) < len(units):
        ones = tuple(1.0 for _ in units)
        return Drive(names=names, units=units, amplitudes=ones, bases=(), level_vpp=None)
    level_vpp = max(study.design.levels_vpp)
    return Drive(
        names=names,
        units=units,
        amplitudes=tuple(load_per_v * level_vpp / 2 for load_per_v, _ in known),
        bases=tuple(basis for _, basis in known),
        level_vpp=level_vpp,
    )
