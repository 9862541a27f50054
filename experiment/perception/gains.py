"""The gain matrix: how much of every actuator's vibration each finger gets.

It is computed once per study (`experiment.study.physics`), sealed into the plan, and only read
after that: by the simulated participant, by trials.csv, and by the check.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, get_args

from pydantic import TypeAdapter

from stimuli.checks import finite
from stimuli.fingers.actuator import Basis

if TYPE_CHECKING:
    from collections.abc import Sequence

SIGNIFICANT_DIGITS: Final = 4
"""Digits of a gain and of a displacement in trials.csv. What is computed is good to about 1 %; the
others keep equal steps of level equal, and the last bit of a machine shows in none of them."""

UNEQUAL_DB: Final = 1.0
"""From this difference on, a warning states that the same volts move one finger more. People differ
by 1.5 dB and more."""

BASES: Final = get_args(Basis)
"""Where a displacement comes from, the stronger basis first."""


def significant(value: float) -> float:
    """Round a number to `SIGNIFICANT_DIGITS`.

    Examples
    --------
    >>> significant(0.02715449), significant(0.0)
    (0.02715, 0.0)
    """
    return float(f"{value:.{SIGNIFICANT_DIGITS - 1}e}")


@dataclass(frozen=True, slots=True, kw_only=True)
class FingerGains:
    """The displacements of the fingers at the sites of a task, for each actuator.

    Attributes
    ----------
    per_vpp : tuple of tuple of float
        Peak displacement per Vpp, a row for each finger and a column for each driven actuator. It
        is in um if the basis is known, else relative to the driven finger.
    bases : tuple of (str or None)
        A word of `BASES` for each actuator; None if no displacement is known.

    Examples
    --------
    >>> gains = FingerGains(per_vpp=((0.02, 0.001), (0.001, 0.02)), bases=("measured",) * 2)
    >>> gains.peaks_um((100.0, 0.0))
    (2.0, 0.1)
    >>> without_crosstalk(2).amplitudes((100.0, 60.0)), without_crosstalk(2).peaks_um((100.0, 60.0))
    ((100.0, 60.0), None)
    """

    per_vpp: tuple[tuple[float, ...], ...]
    bases: tuple[str | None, ...]

    @property
    def basis(self) -> str | None:
        """The weakest of `bases`; none if one of them is not known."""
        return None if None in self.bases else max(self.bases, key=BASES.index)

    @property
    def own(self) -> tuple[float, ...]:
        """What each finger gets per Vpp of the actuator under it."""
        return tuple(row[site] for site, row in enumerate(self.per_vpp))

    @property
    def re_first_db(self) -> tuple[float, ...]:
        """How much more the same volts move each finger than the first, by its own actuator.

        >>> gains = FingerGains(per_vpp=((0.02, 0), (0, 0.03)), bases=("measured",) * 2)
        >>> [round(level_db, 1) for level_db in gains.re_first_db]
        [0.0, 3.5]
        """
        return tuple(20 * math.log10(gain / self.own[0]) for gain in self.own)

    def amplitudes(self, levels_vpp: Sequence[float]) -> tuple[float, ...]:
        """Return the greatest displacement at each finger.

        What comes from several actuators adds as if the peaks came at the same time: where more
        than one is driven it is an upper bound.

        Parameters
        ----------
        levels_vpp : sequence of float
            Levels of the actuators; 0 for a silent one.
        """
        return tuple(
            sum(gain * level for gain, level in zip(row, levels_vpp, strict=True))
            for row in self.per_vpp
        )

    def peaks_um(self, levels_vpp: Sequence[float]) -> tuple[float, ...] | None:
        """Return `amplitudes` in um to `SIGNIFICANT_DIGITS`; none without a basis."""
        return None if self.basis is None else tuple(map(significant, self.amplitudes(levels_vpp)))

    def basis_of(self, levels_vpp: Sequence[float]) -> str | None:
        """Return the basis of what the driven actuators do.

        Examples
        --------
        >>> gains = FingerGains(per_vpp=((0.02, 0.0), (0.0, 0.02)), bases=("measured", "predicted"))
        >>> gains.basis_of((100.0, 0.0)), gains.basis_of((100.0, 60.0))
        ('measured', 'predicted')
        """
        pairs = zip(self.bases, levels_vpp, strict=True)
        driven = [basis for basis, level_vpp in pairs if level_vpp > 0]
        return replace(self, bases=tuple(driven or self.bases)).basis if self.basis else None

    def with_crosstalk(self, crosstalk_db: float) -> FingerGains:
        """Return the same actuators on a plate of another cross-talk.

        Parameters
        ----------
        crosstalk_db : float
            Amplitude at every other finger, dB re the amplitude at the actuator's own.

        Examples
        --------
        >>> without_crosstalk(2).with_crosstalk(-20.0).per_vpp
        ((1.0, 0.1), (0.1, 1.0))
        """
        leak: float = 10.0 ** (crosstalk_db / 20)
        own = self.own
        per_vpp = tuple(
            tuple(gain * (1.0 if finger == site else leak) for site, gain in enumerate(own))
            for finger in range(len(own))
        )
        return replace(self, per_vpp=per_vpp)


def without_crosstalk(n_sites: int) -> FingerGains:
    """Return the gains of a plan that was sealed without a matrix."""
    per_vpp = tuple(tuple(float(f == site) for site in range(n_sites)) for f in range(n_sites))
    return FingerGains(per_vpp=per_vpp, bases=(None,) * n_sites)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionGains:
    """The gain matrix of one condition's drive: every actuator at every finger.

    Attributes
    ----------
    condition : str
        The condition's name.
    actuators : tuple of str
        The sites, then the undriven actuators by name.
    bases : tuple of (str or None)
        For each actuator a word of `BASES`; none where its displacement is not known.
    per_vpp : tuple of tuple of float
        A row for the place above each actuator, a column for each actuator: greatest displacement
        over the fingertip's contact area and over time, um per Vpp. The column of an actuator
        without basis is relative to its own place.

    Raises
    ------
    ValueError
        If the matrix is not square, or a number or word is out of its range.

    Examples
    --------
    >>> gains = ConditionGains(condition="main", actuators=("a", "b"),
    ...     bases=("measured", None), per_vpp=((0.02, 0.1), (0.001, 1.0)))
    >>> gains.at_fingers(("a", "b"))
    FingerGains(per_vpp=((1.0, 0.1), (0.05, 1.0)), bases=(None, None))
    """

    condition: str
    actuators: tuple[str, ...]
    bases: tuple[Basis | None, ...]
    per_vpp: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        size = len(self.actuators)
        if [len(self.bases), *map(len, (self.per_vpp, *self.per_vpp))] != [size] * (size + 2):
            raise ValueError(f"per_vpp must have a row and a column for each of {self.actuators}")
        for row, gains in enumerate(self.per_vpp):
            for column, gain in enumerate(gains):
                above = 0 if row == column else -math.inf
                finite(f"per_vpp[{row}][{column}]", gain, least=0, above=above)

    def level_db(self, finger: int, actuator: int) -> float:
        """Return the crosstalk from one actuator to the place above another.

        Parameters
        ----------
        finger, actuator : int
            Row and column of `per_vpp`, counted from 0.

        Returns
        -------
        float
            Level at `finger`, in dB re the place above the driven actuator.
        """
        from stimuli import level_db

        return level_db(self.per_vpp, own=actuator, other=finger)

    def at_fingers(self, sites: tuple[str, ...]) -> FingerGains:
        """Return the gains of the actuators at these sites at the fingers above them.

        Parameters
        ----------
        sites : tuple of str
            Names of driven actuators.

        Returns
        -------
        FingerGains
            Peak displacement, in um per Vpp, where the displacements of all of them are known.
            Otherwise the gains are relative to the finger above the driven actuator, which has 1.
        """
        indices = [self.actuators.index(site) for site in sites]
        rows = tuple(tuple(self.per_vpp[i][j] for j in indices) for i in indices)
        bases = tuple(self.bases[i] for i in indices)
        gains = FingerGains(per_vpp=rows, bases=bases)
        if gains.basis is not None:
            return gains
        relative = tuple(
            tuple(significant(gain / own) for gain, own in zip(row, gains.own, strict=True))
            for row in rows
        )
        return FingerGains(per_vpp=relative, bases=(None,) * len(sites))


GAINS: Final = TypeAdapter(ConditionGains)
"""Rebuilds a matrix from JSON.

>>> GAINS.validate_python({"condition": "main", "actuators": ["a", "b"],
...     "bases": [None, None], "per_vpp": [[1.0, 0.1], [0.1, 1.0]]}).level_db(1, 0)
-20.0
"""
